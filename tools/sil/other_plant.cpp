#include "tools/sil/other_plant.h"

namespace ballast::sil {

OtherPlant::OtherPlant(const std::string& url, std::int64_t run_id)
    : bus_(std::make_unique<hal::Bus>(url)), run_id_(run_id) {
  bus_->subscribe<sensors_t>(hal::kChannelSensors, [this](const sensors_t& message) {
    // Messages without a run are those of a log that is played back.
    if (message.run_id == 0 || message.run_id == run_id_ || !found_.empty()) return;
    found_ = "another plant is on this bus (tick " + std::to_string(message.tick) +
             "): give every run a bus of its own with --lcm";
  });
}

void OtherPlant::take(std::chrono::duration<double> wait) {
  static_cast<void>(bus_->receive_until(hal::after(hal::WallClock::now(), wait), [this] { return !found_.empty(); }));
}

std::string OtherPlant::listen() {
  constexpr hal::Seconds kListen{0.2};
  take(kListen);
  return found_;
}

std::string OtherPlant::heard() {
  constexpr hal::Seconds kBothBegin{1};
  if (bus_ == nullptr) return found_;
  const auto now = hal::WallClock::now();
  if (!until_) until_ = hal::after(now, kBothBegin);
  take(hal::Seconds(0));
  if (now >= *until_) bus_.reset();
  return found_;
}

}  // namespace ballast::sil
