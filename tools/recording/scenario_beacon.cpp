#include "tools/recording/scenario_beacon.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <utility>

#include "hal/lcm/bus.h"
#include "hal/lcm/channels.h"
#include "tools/recording/black_box.h"
#include "tools/recording/receive_buffer.h"

namespace ballast::sil {

namespace {

// An operator's wish waits for the scenario, so it is told often; a long scenario less often, so that the bus has room.
constexpr std::chrono::milliseconds kEvery{100};
constexpr std::size_t kMostBytesPerSecond = 16'000'000;
constexpr int kPoll_ms = 10;
// More than one: the newest may be refused while another is followed.
constexpr std::size_t kMostCourses = 4;
constexpr int kMostPartsAtOnce = 16;  // receivers lose parts of a longer burst
constexpr std::size_t kPieceSize = scenario_piece_t::MOST_SIZE;

// Other kinds of LCM buses are files, which a second connection would spoil.
bool leaves_this_process(const std::string& url) { return url.starts_with("udpm:") || url.starts_with("tcpq:"); }

}  // namespace

ScenarioBeacon::ScenarioBeacon(std::string url, std::int64_t run_id, const sim::Scenario& scenario)
    : text_(scenario_file(scenario)) {
  const std::size_t pieces = (text_.size() + kPieceSize - 1) / kPieceSize;
  if (pieces > scenario_piece_t::MOST_PIECES || !leaves_this_process(url)) return;
  piece_.scenario_id = scenario.id;
  piece_.run_id = run_id;
  piece_.pieces = static_cast<std::int32_t>(pieces);
  thread_ = std::thread([this, url = std::move(url)] { run(url); });
}

ScenarioBeacon::~ScenarioBeacon() {
  over_ = true;
  if (thread_.joinable()) thread_.join();
}

void ScenarioBeacon::run(const std::string& url) {
  const std::string roomy = with_receive_buffer(url);  // the parts of a course come once, and each is needed
  lcm::LCM bus(roomy);
  if (!hal::usable(bus, roomy)) return;
  using Hears = void (*)(const lcm::ReceiveBuffer*, const std::string&, ScenarioBeacon*);
  const Hears hears = [](const lcm::ReceiveBuffer* buffer, const std::string&, ScenarioBeacon* self) {
    operator_t message{};
    if (hal::decode(buffer->data, buffer->data_size, message)) self->hear(message);
  };
  bus.subscribeFunction(hal::kChannelOperator, hears, this)->setQueueCapacity(1000);
  const auto every = std::max(kEvery, std::chrono::milliseconds(1000 * text_.size() / kMostBytesPerSecond));
  auto due = std::chrono::steady_clock::now();
  while (!over_) {
    if (std::chrono::steady_clock::now() >= due) {
      if (!send_scenario(bus)) return;
      due += every;
      if (outbox_.empty()) {
        for (const auto& course : courses_) outbox_.insert(outbox_.end(), course.begin(), course.end());
      }
    }
    if (!send_parts(bus) || (bus.handleTimeout(kPoll_ms) < 0 && errno != EINTR)) return;
  }
}

bool ScenarioBeacon::send_scenario(lcm::LCM& bus) {
  for (piece_.piece = 0; piece_.piece < piece_.pieces; ++piece_.piece) {
    const std::size_t from = static_cast<std::size_t>(piece_.piece) * kPieceSize;
    const std::size_t size = std::min(kPieceSize, text_.size() - from);
    piece_.size = static_cast<std::int16_t>(size);
    std::fill(std::copy_n(text_.data() + from, size, piece_.text), std::end(piece_.text), std::int8_t{0});
    if (bus.publish(hal::kChannelScenario, &piece_) != 0) return false;
  }
  return true;
}

bool ScenarioBeacon::send_parts(lcm::LCM& bus) {
  for (int k = 0; k < kMostPartsAtOnce && !outbox_.empty(); ++k) {
    if (bus.publish(hal::kChannelCourse, &outbox_.front()) != 0) return false;
    outbox_.pop_front();
  }
  return true;
}

void ScenarioBeacon::hear(const operator_t& message) {
  if (message.run_id != piece_.run_id || message.command != operator_t::COMMAND_GO) return;
  if (message.course_first == 0) {
    const auto begins_again = [&](const std::vector<operator_t>& course) {
      return course.front().course == message.course;
    };
    std::erase_if(courses_, begins_again);
    courses_.emplace_back();
    if (courses_.size() > kMostCourses) courses_.pop_front();
  }
  if (courses_.empty()) return;
  std::vector<operator_t>& newest = courses_.back();
  // A sender repeats a part until it is answered.
  const bool first = newest.empty();
  if (!first && (newest.front().course != message.course ||
                 newest.back().course_first + newest.back().course_count != message.course_first)) {
    return;
  }
  newest.push_back(message);
}

std::string ScenarioPieces::take(const scenario_piece_t& piece) {
  if (piece.run_id != first_.run_id || piece.scenario_id != first_.scenario_id || piece.pieces != first_.pieces) {
    first_ = piece;
    texts_.assign(static_cast<std::size_t>(piece.pieces), "");
  }
  texts_[static_cast<std::size_t>(piece.piece)].assign(piece.text, piece.text + piece.size);
  std::string whole;
  for (const std::string& text : texts_) {
    if (text.empty()) return "";
    whole += text;
  }
  return whole;
}

}  // namespace ballast::sil
