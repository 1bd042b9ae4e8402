#include "tools/ballast/foxglove_feed.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <signal.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <climits>
#include <string_view>
#include <utility>

#include "hal/lcm/channels.h"
#include "tools/recording/black_box.h"
#include "tools/recording/log_event.h"
#include "tools/sil/robot.h"

namespace ballast {

namespace {

constexpr double kEvery_s = 1.0 / 60;
constexpr double kSilent_s = 3;  // after this time without a message, another run may be shown
constexpr std::chrono::seconds kLinger{5};
constexpr char kServer[] = "ballast-foxglove";

// Writes all of it, waiting for the reader.
bool write_all(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

// A file as an event: its name as the channel.
std::string file_event(const char* name, const std::string& content) {
  std::string event(sil::kEventHeaderSize + std::string_view(name).size(), '\0');
  sil::write_event_header(event.data(), 0, 0, name, content.size());
  return event + content;
}

}  // namespace

FoxgloveFeed::~FoxgloveFeed() {
  input_ = program::Descriptor();  // the server ends with its input
  if (server_.running()) (void)server_.wait(kLinger);
}

std::string FoxgloveFeed::start(const std::string& host, int port) {
  signal(SIGPIPE, SIG_IGN);
  const std::string path = program::beside_this_program(kServer);
  auto pipe = program::open_pipe();
  if (!pipe) return program::cannot_start(path, {errno, std::generic_category()});
  const program::ProcessStart start{.arguments = {path, "--host=" + host, "--port=" + std::to_string(port)},
                                    .input = pipe->reading.get(),
                                    .ends_with_parent = true,
                                    .own_group = true};
  if (const auto error = server_.start(start)) return program::cannot_start(path, error);
  pipe->reading = program::Descriptor();  // or else a write after the server's end would wait for ever
  input_ = std::move(pipe->writing);
  const std::string files =
      file_event("robot.json", sil::robot_json(scenario_)) + file_event("scenario.toml", sil::scenario_file(scenario_));
  if (!write_all(input_.get(), files)) {
    const auto end = server_.wait();
    return fmt::format("{} ended with {}", kServer, end.text());
  }
  fcntl(input_.get(), F_SETFL, fcntl(input_.get(), F_GETFL) | O_NONBLOCK);
  return "";
}

void FoxgloveFeed::observe(const contact_t& message, double now_s) {
  if (!is_shown(message.run_id, now_s)) return;
  contact_ = message;
  ended_ = ended_ || message.last != 0;
  pass_on(now_s);
}

void FoxgloveFeed::observe(const plant_state_t& message, double now_s) {
  if (!is_shown(message.run_id, now_s)) return;
  state_ = message;
  ended_ = ended_ || message.last != 0;
  pass_on(now_s);
}

void FoxgloveFeed::observe(const sensors_t& message, double now_s) {
  if (is_shown(message.run_id, now_s)) recognise(message.scenario_id);
}

void FoxgloveFeed::observe(const controller_status_t& message, double now_s) {
  if (!is_shown(message.run_id, now_s)) return;
  recognise(message.scenario_id);
  status_ = message;
}

void FoxgloveFeed::observe(const trip_t& message, double now_s) {
  if (!is_shown(message.run_id, now_s)) return;
  recognise(message.scenario_id);
  trip_ = message;
}

std::string FoxgloveFeed::ended() {
  const auto end = server_.wait(std::chrono::seconds(0));
  return end ? fmt::format("{} ended with {}", kServer, end->text()) : "";
}

bool FoxgloveFeed::is_shown(std::int64_t run_id, double now_s) {
  if (run_id == 0) return false;  // a peer that waits for a run
  if (run_id_ != run_id) {
    if (run_id_ && !ended_ && now_s - heard_s_ < kSilent_s) return false;
    run_id_ = run_id;
    known_ = ours_ = ended_ = false;
    contact_.reset();
    state_.reset();
    status_.reset();
    trip_.reset();
    passed_s_ = now_s - kEvery_s;
  }
  heard_s_ = now_s;
  return true;
}

void FoxgloveFeed::recognise(std::int64_t scenario_id) {
  known_ = true;
  ours_ = scenario_id == scenario_id_;
}

// A batch is either written as a whole or not at all: PIPE_BUF bytes are written at once, and its messages have fewer.
void FoxgloveFeed::pass_on(double now_s) {
  if (!contact_ || !state_ || contact_->tick != state_->tick) return;
  const bool last = contact_->last != 0 || state_->last != 0;
  if (!ours_ || (!last && now_s - passed_s_ < kEvery_s)) return;
  passed_s_ = now_s;
  std::array<char, PIPE_BUF> batch;
  std::size_t size = 0;
  // All of a batch has the plant's time, so that the timeline does not jump to the tick that a controller answered.
  const auto add = [&](const char* channel, const auto& message) {
    const std::size_t more = sil::event_size(channel, message);
    if (size + more > batch.size()) return;
    sil::write_event(&batch[size], events_++, state_->utime, channel, message);
    size += more;
  };
  if (status_) add(hal::kChannelControllerStatus, *status_);
  if (trip_) add(hal::kChannelTrip, *trip_);
  add(hal::kChannelContact, *contact_);
  add(hal::kChannelPlantState, *state_);
  (void)!write(input_.get(), batch.data(), size);  // EAGAIN: dropped. EPIPE: ended() says so
}

}  // namespace ballast
