#include "tools/recording/scenario_beacon.h"

#include <algorithm>
#include <chrono>
#include <lcm/lcm-cpp.hpp>
#include <utility>

#include "hal/lcm/bus.h"
#include "tools/recording/black_box.h"

namespace ballast::sil {

namespace {

constexpr std::chrono::seconds kEvery{1};
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
  thread_ = std::thread([this, url = std::move(url)] { send(url); });
}

ScenarioBeacon::~ScenarioBeacon() {
  {
    const std::lock_guard lock(mutex_);
    over_ = true;
  }
  wake_.notify_one();
  if (thread_.joinable()) thread_.join();
}

void ScenarioBeacon::send(const std::string& url) {
  lcm::LCM bus(url);
  if (!hal::usable(bus, url)) return;
  std::unique_lock lock(mutex_);
  do {
    for (piece_.piece = 0; piece_.piece < piece_.pieces; ++piece_.piece) {
      const std::size_t from = static_cast<std::size_t>(piece_.piece) * kPieceSize;
      const std::size_t size = std::min(kPieceSize, text_.size() - from);
      piece_.size = static_cast<std::int16_t>(size);
      std::fill(std::copy_n(text_.data() + from, size, piece_.text), std::end(piece_.text), std::int8_t{0});
      if (bus.publish(hal::kChannelScenario, &piece_) != 0) return;
    }
  } while (!wake_.wait_for(lock, kEvery, [this] { return over_; }));
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
