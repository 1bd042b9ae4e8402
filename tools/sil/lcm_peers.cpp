#include "tools/sil/lcm_peers.h"

#include <cstdio>

namespace ballast::sil {

using hal::Status;

LcmPeers::LcmPeers(hal::Bus& bus, LcmPeersOptions options) : bus_(bus), options_(std::move(options)) {
  if (options_.faults != nullptr) motors_.emplace(*options_.faults);
  bus_.subscribe<trip_t>(hal::kChannelTrip, [this](const trip_t& m) {
    if (waits_for_another_run(m)) {
      monitor_waits_ = true;
      return;
    }
    check_scenario(m.scenario_id, "monitor");
    // Of a monitor that has heard what was made of the plant's messages the verdict may name any tick.
    const bool of_this_tick = m.tick == tick_ || (motors_ && !trip_ && m.tick != hal::kWaitingTick);
    // The last word of a monitor that hears nobody any more; who went silent is found by the timeout here.
    if (m.tripped == 1 && m.cause == trip_t::CAUSE_STALE && (!of_this_tick || trip_)) return;
    if (of_this_tick && tripped_ && m.tripped == 0 && failure_ == Status::kOk) {
      failure_ = Status::kForeignPeer;
      trouble_ = "another monitor is on this bus, or it was started again: it takes back the trip (tick " +
                 std::to_string(m.tick) + ")";
    }
    tripped_ = tripped_ || (of_this_tick && m.tripped == 1);
    accept(m, m.tick, of_this_tick ? m.tick : tick_, trip_, "monitor");
  });
  // A bus gives back what is published on it: each of our ticks must be heard once, and nobody else's. It may come
  // after the answers to it, so a lap waits for it too: in the next it would be another plant's.
  bus_.subscribe<sensors_t>(hal::kChannelSensors,
                            [this](const sensors_t& m) { accept(m, m.tick, tick_, echo_, "plant"); });
  if (!options_.controller_expected) return;
  bus_.subscribe<operator_t>(hal::kChannelOperator, [this](const operator_t& m) { operator_.hear(m); });
  bus_.subscribe<controller_status_t>(hal::kChannelControllerStatus, [this](const controller_status_t& m) {
    if (waits_for_another_run(m)) {
      controller_waits_ = true;
      return;
    }
    refused_by_controller_ = m.refused_messages;
    check_scenario(m.scenario_id, "controller");
    accept(m, m.tick, tick_, status_, "controller");
  });
  bus_.subscribe<step_command_t>(hal::kChannelStepCommand, [this](const step_command_t& m) {
    accept(m, m.tick, tick_ + 1, steps_, "controller");
  });
}

void LcmPeers::check_scenario(std::int64_t scenario_id, const char* sender) {
  if (scenario_id == options_.scenario_id || failure_ != Status::kOk) return;
  failure_ = Status::kForeignScenario;
  trouble_ = std::string("the ") + sender + " runs another scenario than the plant";
}

// Peers that wait say so again and again; once the run is under way that is none of its business.
template <class M>
bool LcmPeers::waits_for_another_run(const M& message) const {
  return tick_ != hal::kWaitingTick && message.run_id == 0;
}

// In lockstep every answer is the one waited for, and comes once. The lap knows nothing of what belongs to the bus.
template <class M>
void LcmPeers::accept(const M& message, std::int64_t tick, std::int64_t tick_due, std::optional<M>& mailbox,
                      const char* sender) {
  if (tick == hal::kWaitingTick) {
    // A peer that has heard half of the first tick knows its run, and may still say that it waits.
    if (tick_ == hal::kWaitingTick) mailbox = message;
  } else if (tick == tick_due && !mailbox && tick_ != hal::kWaitingTick) {
    mailbox = message;
    mailbox->run_id = 0;
    if constexpr (std::is_same_v<M, controller_status_t>) mailbox->refused_messages = 0;
  } else if (failure_ == Status::kOk) {
    failure_ = Status::kForeignPeer;
    trouble_ = std::string("another ") + sender + " is on this bus (tick " + std::to_string(tick) +
               "): give every run a bus of its own with --lcm";
  }
}

template <class Done>
Status LcmPeers::wait(hal::Seconds timeout, const Done& done) {
  const auto deadline = hal::after(hal::WallClock::now(), timeout);
  for (;;) {
    const auto now = hal::WallClock::now();
    const Status status = bus_.receive_until(std::min(deadline, hal::after(now, options_.look)),
                                             [&] { return failure_ != Status::kOk || done(); });
    if (failure_ != Status::kOk) return failure_;
    if (status == Status::kInterrupted) trouble_ = "interrupted";
    if (status == Status::kIo) trouble_ = "the LCM bus failed";
    if (status != Status::kEmpty) return status;
    // Asked on the last lap too, since who sleeps is woken there; but then a peer ends as soon as it has answered.
    if (std::string ended = options_.peer_ended ? options_.peer_ended() : ""; !ended.empty() && !last_lap_) {
      trouble_ = std::move(ended);
      return Status::kPeerLost;
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
  // Long enough to hear a plant that is already at work here.
  constexpr hal::Seconds kListen{0.2};
  const auto listened = hal::after(hal::WallClock::now(), kListen);
  const Status status = wait(options_.start_timeout, [&] {
    return trip_ && (status_ || !options_.controller_expected) && hal::WallClock::now() >= listened;
  });
  if (status == Status::kPeerLost) lost("before the first tick", options_.start_timeout);
  return status;
}

// Who is there before the tick's first message hears all of it.
Status LcmPeers::wait_for_the_new(const LcmPeersOptions::StartedAnew& anew) {
  if (!anew.controller && !anew.monitor) return Status::kOk;
  controller_waits_ = monitor_waits_ = false;
  const Status status = wait(options_.start_timeout, [&] {
    return (controller_waits_ || !anew.controller) && (monitor_waits_ || !anew.monitor);
  });
  if (status == Status::kPeerLost && trouble_.empty()) {
    trouble_ = std::string(anew.controller && !controller_waits_ ? "controller" : "monitor") +
               " lost: was started again and is not there";
  }
  return status;
}

Status LcmPeers::exchange(Lap& lap) {
  if (tick_ == hal::kWaitingTick) bus_.join(options_.run_id);
  if (options_.before_tick) {
    const Status status = wait_for_the_new(options_.before_tick(lap.plant.contact.tick));
    if (status != Status::kOk) return status;
  }
  tick_ = lap.plant.contact.tick;
  operator_.now(tick_);
  last_lap_ = lap.plant.contact.last != 0;
  echo_.reset();
  trip_.reset();
  status_.reset();
  steps_.reset();
  const auto publish = [this](const char* channel, const auto& message) {
    const bool sent = bus_.publish(channel, message) == Status::kOk;
    if (!sent) trouble_ = std::string(channel) + ": the LCM bus does not take messages any more";
    return sent;
  };
  if (lap.command) {
    operator_.know(*lap.command);
    if (!publish(hal::kChannelOperator, *lap.command)) return Status::kIo;
  }
  if (!publish(hal::kChannelContact, lap.plant.contact) || !publish(hal::kChannelPlantState, lap.plant.state) ||
      !publish(hal::kChannelSensors, lap.plant.sensors)) {
    return Status::kIo;
  }
  const auto answered = [this] { return trip_ && (!options_.controller_expected || (status_ && steps_)); };
  const Status status = wait(options_.peer_timeout, [&] { return answered() && echo_; });
  if (status == Status::kPeerLost && answered() && trouble_.empty()) {
    trouble_ = "the LCM bus does not give back what is said on it (tick " + std::to_string(tick_) + ")";
  }
  if (status == Status::kPeerLost) lost("at tick " + std::to_string(tick_), options_.peer_timeout);
  if (status != Status::kOk) return status;
  lap.trip = *trip_;
  while (const auto message = operator_.next()) {
    lap.heard.push_back(*message);
    lap.heard.back().run_id = 0;
  }
  if (options_.controller_expected) {
    lap.status = *status_;
    lap.steps = *steps_;
    if (motors_) {
      motors_->tell(lap.steps, tick_);
      motors_->deliver(lap);
    }
  }
  return Status::kOk;
}

RefusedMessages LcmPeers::refused() const {
  RefusedMessages refused{operator_.counters(), refused_by_controller_};
  refused.here.malformed = bus_.malformed();
  refused.here.foreign = bus_.foreign();
  if (motors_) refused.here += motors_->counters();
  return refused;
}

}  // namespace ballast::sil
