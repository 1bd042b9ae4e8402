#include "tools/sil/lcm_peers.h"

#include <cstdio>

namespace ballast::sil {

using hal::Status;

LcmPeers::LcmPeers(hal::Bus& bus, LcmPeersOptions options) : bus_(bus), options_(std::move(options)) {
  bus_.subscribe<trip_t>(hal::kChannelTrip, [this](const trip_t& m) {
    if (m.scenario_id != options_.scenario_id) foreign_ = "monitor";
    if (m.tick == tick_) trip_ = m;
  });
  if (!options_.controller_expected) return;
  bus_.subscribe<controller_status_t>(hal::kChannelControllerStatus, [this](const controller_status_t& m) {
    if (m.scenario_id != options_.scenario_id) foreign_ = "controller";
    if (m.tick == tick_) status_ = m;
  });
  bus_.subscribe<step_command_t>(hal::kChannelStepCommand, [this](const step_command_t& m) {
    if (m.tick == tick_ + 1) steps_ = m;
  });
}

template <class Done>
Status LcmPeers::wait(hal::Seconds timeout, const Done& done) {
  constexpr hal::Seconds kLook{0.1};  // how often to look whether a peer has ended
  const auto deadline = hal::after(hal::WallClock::now(), timeout);
  for (;;) {
    const auto now = hal::WallClock::now();
    const Status status =
        bus_.receive_until(std::min(deadline, hal::after(now, kLook)), [&] { return foreign_ != nullptr || done(); });
    if (foreign_ != nullptr) {
      trouble_ = std::string("the ") + foreign_ + " runs another scenario than the plant";
      return Status::kForeignScenario;
    }
    if (status == Status::kInterrupted) trouble_ = "interrupted";
    if (status == Status::kIo) trouble_ = "the LCM bus failed";
    if (status != Status::kEmpty) return status;
    if (options_.peer_ended) {
      if (trouble_ = options_.peer_ended(); !trouble_.empty()) return Status::kPeerLost;
    }
    if (now >= deadline) return Status::kPeerLost;
  }
}

// Without a verdict the controller cannot answer either, so the monitor is named first.
void LcmPeers::lost(const std::string& when, hal::Seconds silence) {
  if (!trouble_.empty()) return;
  char seconds[32];
  std::snprintf(seconds, sizeof seconds, "%g", silence.count());
  trouble_ = std::string(trip_ ? "controller" : "monitor") + " lost: silent for " + seconds + " s " + when;
}

Status LcmPeers::connect() {
  tick_ = hal::kWaitingTick;
  const Status status =
      wait(options_.start_timeout, [this] { return trip_ && (status_ || !options_.controller_expected); });
  if (status == Status::kPeerLost) lost("before the first tick", options_.start_timeout);
  return status;
}

Status LcmPeers::exchange(Lap& lap) {
  tick_ = lap.plant.contact.tick;
  trip_.reset();
  status_.reset();
  steps_.reset();
  const auto publish = [this](const char* channel, const auto& message) {
    const bool sent = bus_.publish(channel, message) == Status::kOk;
    if (!sent) trouble_ = std::string(channel) + ": the LCM bus does not take messages any more";
    return sent;
  };
  if (lap.command && !publish(hal::kChannelOperator, *lap.command)) return Status::kIo;
  if (!publish(hal::kChannelContact, lap.plant.contact) || !publish(hal::kChannelPlantState, lap.plant.state) ||
      !publish(hal::kChannelSensors, lap.plant.sensors)) {
    return Status::kIo;
  }
  const Status status =
      wait(options_.peer_timeout, [this] { return trip_ && (!options_.controller_expected || (status_ && steps_)); });
  if (status == Status::kPeerLost) lost("at tick " + std::to_string(tick_), options_.peer_timeout);
  if (status != Status::kOk) return status;
  lap.trip = *trip_;
  if (options_.controller_expected) {
    lap.status = *status_;
    lap.steps = *steps_;
  }
  return Status::kOk;
}

}  // namespace ballast::sil
