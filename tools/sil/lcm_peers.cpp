#include "tools/sil/lcm_peers.h"

#include <fmt/format.h>

namespace ballast::sil {

using hal::Status;

LcmPeers::LcmPeers(hal::Bus& bus, LcmPeersOptions options)
    : bus_(bus), options_(std::move(options)), ear_(options_.controller_expected ? &bus : nullptr) {
  bus_.subscribe<trip_t>(hal::kChannelTrip, [this](const trip_t& m) { on_trip(m); });
  // A bus gives back what is published on it: each sensors message of this plant must come once, and no other plant's.
  // It may come after its answers, so a lap waits for it too: in the next lap it would look like another plant's.
  bus_.subscribe<sensors_t>(hal::kChannelSensors,
                            [this](const sensors_t& m) { accept(m, m.tick, tick_, echo_, "plant"); });
  if (!options_.controller_expected) return;
  bus_.subscribe<controller_status_t>(hal::kChannelControllerStatus,
                                      [this](const controller_status_t& m) { on_status(m); });
  bus_.subscribe<step_command_t>(hal::kChannelStepCommand, [this](const step_command_t& m) {
    accept(m, m.tick, tick_ + 1, steps_, "controller");
  });
}

void LcmPeers::fail(Status status, const std::string& why) {
  if (failure_ != Status::kOk) return;
  failure_ = status;
  trouble_ = why;
}

void LcmPeers::on_trip(const trip_t& message) {
  if (waits_for_another_run(message)) {
    monitor_waits_ = true;
    return;
  }
  check_scenario(message.scenario_id, "monitor");
  const bool any_tick = !options_.verdicts_name_their_tick && !trip_ && message.tick != hal::kWaitingTick;
  const bool of_this_tick = message.tick == tick_ || any_tick;
  // A monitor that hears nobody any more sends a last verdict. The timeout here finds the peer that went silent.
  if (message.tripped == 1 && message.cause == trip_t::CAUSE_STALE && (!of_this_tick || trip_)) return;
  if (of_this_tick && tripped_ && message.tripped == 0) {
    fail(Status::kForeignPeer,
         "another monitor is on this bus, or it was started again: it takes back the trip (tick " +
             std::to_string(message.tick) + ")");
  }
  tripped_ = tripped_ || (of_this_tick && message.tripped == 1);
  accept(message, message.tick, of_this_tick ? message.tick : tick_, trip_, "monitor");
}

void LcmPeers::on_status(const controller_status_t& message) {
  if (waits_for_another_run(message)) {
    controller_waits_ = true;
    return;
  }
  refused_by_controller_ = message.refused_messages;
  check_scenario(message.scenario_id, "controller");
  accept(message, message.tick, tick_, status_, "controller");
}

void LcmPeers::check_scenario(std::int64_t scenario_id, const char* sender) {
  if (scenario_id == options_.scenario_id) return;
  fail(Status::kForeignScenario, std::string("the ") + sender +
                                     " runs another scenario than the plant; if another run is on this bus, give every "
                                     "run a bus of its own with --lcm");
}

// A waiting peer repeats its message. A run under way takes no notice of it.
template <class M>
bool LcmPeers::waits_for_another_run(const M& message) const {
  return tick_ != hal::kWaitingTick && message.run_id == 0;
}

// In lockstep every answer is the one waited for, and comes once. Fields that belong to the bus are cleared.
template <class M>
void LcmPeers::accept(const M& message, std::int64_t tick, std::int64_t tick_due, std::optional<M>& mailbox,
                      const char* sender) {
  if (tick == hal::kWaitingTick) {
    // A peer that has heard half of the first tick knows its run and may still say that it waits.
    if (tick_ == hal::kWaitingTick) mailbox = message;
  } else if (tick == tick_due && !mailbox && tick_ != hal::kWaitingTick) {
    mailbox = message;
    mailbox->run_id = 0;
    if constexpr (std::is_same_v<M, controller_status_t>) mailbox->refused_messages = 0;
  } else {
    fail(Status::kForeignPeer, std::string("another ") + sender + " is on this bus (tick " + std::to_string(tick) +
                                   "): give every run a bus of its own with --lcm");
  }
}

template <class Done>
Status LcmPeers::wait(hal::Seconds timeout, const Done& done) {
  const auto deadline = hal::after(hal::WallClock::now(), timeout);
  for (;;) {
    const auto now = hal::WallClock::now();
    const Status status = bus_.receive_until(std::min(deadline, hal::after(now, options_.poll_period)),
                                             [&] { return failure_ != Status::kOk || done(); });
    if (failure_ != Status::kOk) return failure_;
    if (status == Status::kInterrupted) trouble_ = "interrupted";
    if (status == Status::kIo) trouble_ = "the LCM bus failed";
    if (status != Status::kEmpty) return status;
    // Called on the last lap too, since it may wake a peer; but then a peer ends as soon as it has answered.
    if (std::string ended = options_.peer_ended ? options_.peer_ended() : ""; !ended.empty() && !last_lap_) {
      trouble_ = std::move(ended);
      return Status::kPeerLost;
    }
    if (now >= deadline) return Status::kPeerLost;
  }
}

// Names the monitor if its verdict is missing: without it the controller cannot answer either.
void LcmPeers::lost(const std::string& when, hal::Seconds silence) {
  if (!trouble_.empty()) return;
  trouble_ = fmt::format("{} lost: silent for {:g} s {}", trip_ ? "controller" : "monitor", silence.count(), when);
}

Status LcmPeers::connect() {
  // Long enough to hear a plant that is already at work on this bus.
  constexpr hal::Seconds kListen{0.2};
  const auto listened = hal::after(hal::WallClock::now(), kListen);
  const Status status = wait(options_.start_timeout, [&] {
    return trip_ && (status_ || !options_.controller_expected) && hal::WallClock::now() >= listened;
  });
  if (status == Status::kPeerLost) lost("before the first tick", options_.start_timeout);
  return status;
}

Status LcmPeers::wait_for_restarted(bool controller, bool monitor) {
  if (!controller && !monitor) return Status::kOk;
  controller_waits_ = monitor_waits_ = false;
  const Status status =
      wait(options_.start_timeout, [&] { return (controller_waits_ || !controller) && (monitor_waits_ || !monitor); });
  if (status == Status::kPeerLost && trouble_.empty()) {
    trouble_ = std::string(controller && !controller_waits_ ? "controller" : "monitor") +
               " lost: was started again and is not there";
  }
  return status;
}

Status LcmPeers::send(Lap& lap) {
  if (tick_ == hal::kWaitingTick) bus_.join(options_.run_id);
  tick_ = lap.tick();
  last_lap_ = lap.plant.contact.last != 0;
  echo_.reset();
  trip_.reset();
  status_.reset();
  steps_.reset();
  ear_.begin(lap);
  const auto publish = [this](const char* channel, const auto& message) {
    const bool sent = bus_.publish(channel, message) == Status::kOk;
    if (!sent) trouble_ = std::string(channel) + ": the LCM bus does not take messages any more";
    return sent;
  };
  if (lap.command && !publish(hal::kChannelOperator, *lap.command)) return Status::kIo;
  const bool sent = publish(hal::kChannelContact, lap.plant.contact) &&
                    publish(hal::kChannelPlantState, lap.plant.state) &&
                    publish(hal::kChannelSensors, lap.plant.sensors);
  return sent ? Status::kOk : Status::kIo;
}

Status LcmPeers::receive(Lap& lap) {
  const auto answered = [this] { return trip_ && (!options_.controller_expected || (status_ && steps_)); };
  const Status status = wait(options_.peer_timeout, [&] { return answered() && echo_; });
  if (status == Status::kPeerLost && answered() && trouble_.empty()) {
    trouble_ = "the LCM bus does not give back what is published on it (tick " + std::to_string(tick_) + ")";
  }
  if (status == Status::kPeerLost) lost("at tick " + std::to_string(tick_), options_.peer_timeout);
  if (status != Status::kOk) return status;
  lap.verdict = *trip_;
  if (options_.controller_expected) lap.answer = Answer{*status_, *steps_};
  ear_.hand_out(lap);
  return Status::kOk;
}

RefusedMessages LcmPeers::refused() const {
  RefusedMessages refused = ear_.refused();
  refused.by_controller = refused_by_controller_;
  refused.here.malformed = bus_.malformed();
  refused.here.foreign = bus_.foreign();
  return refused;
}

}  // namespace ballast::sil
