#include "tools/sil/operator_ear.h"

#include "hal/lcm/channels.h"

namespace ballast::sil {

using hal::Status;

OperatorEar::OperatorEar(hal::Bus* bus) : bus_(bus) {
  if (bus_ == nullptr) return;
  bus_->subscribe<operator_t>(hal::kChannelOperator, [this](const operator_t& m) { inbox_.hear(m); });
}

void OperatorEar::begin(const Lap& lap) {
  inbox_.now(lap.tick());
  if (lap.command) inbox_.know(*lap.command);
}

void OperatorEar::hand_out(Lap& lap, std::size_t at_most) {
  for (std::size_t count = 0; count < at_most; ++count) {
    const std::optional<operator_t> message = inbox_.next();
    if (!message) return;
    lap.heard.push_back(*message);
    lap.heard.back().run_id = 0;
  }
}

Status OperatorEar::listen(Lap& lap) {
  if (bus_ == nullptr) return Status::kOk;
  begin(lap);
  if (bus_->receive_until(hal::WallClock::now(), [] { return false; }) == Status::kIo) return Status::kIo;
  if (lap.tick() >= 0) hand_out(lap, 1);
  return Status::kOk;
}

RefusedMessages OperatorEar::refused() const {
  RefusedMessages refused{inbox_.counters(), 0};
  if (bus_ == nullptr) return refused;
  refused.here.malformed = bus_->malformed();
  refused.here.foreign = bus_->foreign();
  return refused;
}

}  // namespace ballast::sil
