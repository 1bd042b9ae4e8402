#include "tools/sil/faulty_peers.h"

#include <algorithm>

#include "hal/lcm/channels.h"
#include "sim/random.h"
#include "tools/sil/in_process_peers.h"

namespace ballast::sil {

using sim::Fault;
using sim::FaultKind;
using sim::FaultLayer;
using sim::FaultPeer;

// --- one channel ---

template <class M>
InjuredLink<M>::InjuredLink(const sim::Scenario& scenario, const char* channel, std::optional<FaultPeer> to)
    : random_(scenario.seed) {
  for (const char* c = channel; *c != '\0'; ++c) random_ = random_ * 31 + static_cast<unsigned char>(*c);
  random_ = 3 * random_ + (to ? static_cast<std::uint64_t>(*to) : 2);  // each link draws for itself
  for (const Fault& fault : scenario.faults) {
    if (fault.of(FaultLayer::kMessage) && fault.channel == channel && (!fault.peer || fault.peer == to)) {
      faults_.push_back(fault);
    }
  }
}

template <class M>
bool InjuredLink<M>::strikes(const Fault& fault) {
  return fault.value >= 1 || sim::uniform(random_) < fault.value;
}

template <class M>
void InjuredLink<M>::send(const M& message, std::int64_t tick, double time_s) {
  const int size = message.getEncodedSize();
  OnItsWay one{tick, static_cast<double>(sent_++), std::vector<std::uint8_t>(static_cast<std::size_t>(size))};
  message.encode(one.bytes.data(), 0, size);
  bool dropped = false, doubled = false;
  for (const Fault& fault : faults_) {
    if (tick < 0 || !fault.active(time_s)) continue;
    switch (fault.kind) {
      case FaultKind::kMessagesDropped:
        dropped = strikes(fault) || dropped;
        break;
      case FaultKind::kMessagesDoubled:
        doubled = strikes(fault) || doubled;
        break;
      case FaultKind::kMessagesDelayed:
        one.due_tick += static_cast<std::int64_t>(fault.value);
        break;
      case FaultKind::kMessagesReordered:
        // After the next one, and not before that comes.
        if (strikes(fault)) {
          one.due_tick += 1;
          one.order += 1.5;
        }
        break;
      case FaultKind::kMessagesCorrupted:
        for (int bit = 0; bit < static_cast<int>(fault.value) && !one.bytes.empty(); ++bit) {
          const std::uint64_t at = sim::random_bits(random_) % (8 * one.bytes.size());
          one.bytes[at / 8] ^= static_cast<std::uint8_t>(1u << (at % 8));
        }
        break;
      case FaultKind::kMessagesTruncated:
        one.bytes.resize(one.bytes.size() - std::min(one.bytes.size(), static_cast<std::size_t>(fault.value)));
        break;
      default:
        break;
    }
  }
  if (dropped) return;
  if (doubled) on_its_way_.push_back(one);
  on_its_way_.push_back(std::move(one));
}

template <class M>
std::vector<M> InjuredLink<M>::arrive(std::int64_t tick) {
  std::stable_sort(on_its_way_.begin(), on_its_way_.end(),
                   [](const OnItsWay& a, const OnItsWay& b) { return a.order < b.order; });
  std::vector<M> arrived;
  for (const OnItsWay& one : on_its_way_) {
    if (one.due_tick > tick) continue;
    M message{};
    if (hal::decode(one.bytes.data(), one.bytes.size(), message)) {
      arrived.push_back(message);
    } else {
      ++malformed_;
    }
  }
  std::erase_if(on_its_way_, [tick](const OnItsWay& one) { return one.due_tick <= tick; });
  return arrived;
}

// --- the peers ---

namespace {

// The one of this tick, or the newest.
template <class M>
const M* best(const std::vector<M>& messages, std::int64_t tick) {
  const M* newest = nullptr;
  for (const M& message : messages) {
    if (message.tick == tick) return &message;
    if (newest == nullptr || message.tick > newest->tick) newest = &message;
  }
  return newest;
}

template <class M>
bool repeated(const std::vector<M>& messages) {
  for (std::size_t i = 1; i < messages.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (messages[i].tick == messages[j].tick) return true;
    }
  }
  return false;
}

// A message is of another scenario only if its bytes have been injured.
template <class M>
void take_out_foreign(std::vector<M>& messages, std::int64_t scenario_id, std::int64_t& foreign) {
  foreign += static_cast<std::int64_t>(
      std::erase_if(messages, [scenario_id](const M& message) { return message.scenario_id != scenario_id; }));
}

}  // namespace

namespace {

bool needs_faulty_peers(const Fault& fault) {
  return fault.of(FaultLayer::kMessage) || fault.of(FaultLayer::kPeer) || fault.kind == FaultKind::kClockJump ||
         fault.kind == FaultKind::kControllerOverrun;
}

}  // namespace

bool FaultyPeers::needed(const sim::Scenario& scenario) {
  return std::any_of(scenario.faults.begin(), scenario.faults.end(), needs_faulty_peers);
}

std::string FaultyPeers::not_possible(const sim::Scenario& scenario, const std::string& where) {
  const auto fault = std::find_if(scenario.faults.begin(), scenario.faults.end(), needs_faulty_peers);
  if (fault == scenario.faults.end()) return "";
  return to_string(*fault) + ": cannot be had " + where +
         ": messages, peers and their clock suffer in simulated time, which takes them all in one process; allowed: "
         "ballast run without --processes and --firmware";
}

std::unique_ptr<Peers> peers_in_process(const sim::Scenario& scenario, const firmware::ControllerParams* params,
                                        const monitor::MonitorLimits& limits, hal::Bus* operator_bus) {
  if (FaultyPeers::needed(scenario)) return std::make_unique<FaultyPeers>(scenario, params, limits, operator_bus);
  return std::make_unique<InProcessPeers>(params, limits, scenario.run.control_period_s, operator_bus);
}

FaultyPeers::FaultyPeers(const sim::Scenario& scenario, const firmware::ControllerParams* params,
                         const monitor::MonitorLimits& limits, hal::Bus* operator_bus)
    : scenario_(scenario),
      params_(params),
      limits_(limits),
      contact_to_monitor_(scenario, hal::kChannelContact, FaultPeer::kMonitor),
      state_to_monitor_(scenario, hal::kChannelPlantState, FaultPeer::kMonitor),
      sensors_to_monitor_(scenario, hal::kChannelSensors, FaultPeer::kMonitor),
      sensors_to_controller_(scenario, hal::kChannelSensors, FaultPeer::kController),
      trip_to_controller_(scenario, hal::kChannelTrip, FaultPeer::kController),
      status_to_monitor_(scenario, hal::kChannelControllerStatus, FaultPeer::kMonitor),
      steps_to_plant_(scenario, hal::kChannelStepCommand, std::nullopt),
      monitor_(limits),
      operator_bus_(operator_bus) {
  if (params_ != nullptr) controller_.emplace(*params_, board_);
  if (operator_bus_ == nullptr) return;
  operator_bus_->subscribe<operator_t>(hal::kChannelOperator, [this](const operator_t& m) { operator_.hear(m); });
}

FaultyPeers::Suffered FaultyPeers::suffered(FaultPeer peer, double time_s, double before_s) const {
  Suffered all;
  for (const Fault& fault : scenario_.faults) {
    if (!fault.of(FaultLayer::kPeer) || fault.peer != peer || !fault.begun(time_s)) continue;
    if (fault.kind == FaultKind::kPeerKilled) all.killed = true;
    if (fault.kind == FaultKind::kPeerFrozen && fault.active(time_s)) all.frozen = true;
    if (fault.kind == FaultKind::kPeerRestarted && !fault.begun(before_s)) all.restarted = true;
    if (fault.kind == FaultKind::kPeerTooSlow && fault.active(time_s)) {
      all.slow_ticks += static_cast<std::int64_t>(fault.value);
    }
  }
  return all;
}

hal::Status FaultyPeers::exchange(Lap& lap) {
  const std::int64_t tick = lap.plant.contact.tick;
  const double time_s = tick < 0 ? -1 : lap.plant.contact.time_s;
  sensors_t stamped = lap.plant.sensors;
  for (const Fault& fault : scenario_.faults) {
    if (fault.kind != FaultKind::kClockJump || !fault.begun(time_s)) continue;
    stamped.tick += static_cast<std::int64_t>(fault.value);
    stamped.utime = hal::tick_utime(stamped.tick, scenario_.run.control_period_s);
  }
  contact_to_monitor_.send(lap.plant.contact, tick, time_s);
  state_to_monitor_.send(lap.plant.state, tick, time_s);
  sensors_to_monitor_.send(stamped, tick, time_s);

  ask_monitor(lap, time_s);
  hal::Status status = hal::Status::kOk;
  if (controller_) {
    sensors_to_controller_.send(stamped, tick, time_s);
    if (!lap.monitor_silent) trip_to_controller_.send(lap.trip, tick, time_s);
    status = ask_controller(lap, time_s);
  }
  before_s_ = time_s;
  return status;
}

void FaultyPeers::ask_monitor(Lap& lap, double time_s) {
  const std::int64_t tick = lap.plant.contact.tick;
  MonitorInbox inbox{contact_to_monitor_.arrive(tick), state_to_monitor_.arrive(tick), sensors_to_monitor_.arrive(tick),
                     std::nullopt};
  take_out_foreign(inbox.sensors, scenario_.id, counters_.foreign);
  for (const controller_status_t& status : status_to_monitor_.arrive(tick - 1)) {
    if (status.scenario_id != scenario_.id) {
      ++counters_.foreign;
    } else if (controller_tick_ && status.tick == *controller_tick_) {
      ++counters_.repeated;
    } else {
      controller_tick_ = std::max(status.tick, controller_tick_.value_or(status.tick));
    }
  }
  inbox.controller_tick = controller_tick_;
  if (lap.replayed) {
    lap.monitor_silent = !lap.verdict;
    if (lap.verdict) lap.trip = *lap.verdict;
    return;
  }

  const Suffered now = suffered(FaultPeer::kMonitor, time_s, before_s_);
  monitor_inbox_.push_back(std::move(inbox));
  if (now.restarted) {
    monitor_ = monitor::Monitor(limits_);
    monitor_inbox_.erase(monitor_inbox_.begin(), monitor_inbox_.end() - 1);
    verdicts_.clear();
  }
  if (!now.killed && !now.frozen) {
    for (const MonitorInbox& of_tick : monitor_inbox_) verdicts_.push_back({tick + now.slow_ticks, judge(of_tick)});
    monitor_inbox_.clear();
  }
  lap.monitor_silent = true;
  for (; !now.killed && !verdicts_.empty() && verdicts_.front().due_tick <= tick; verdicts_.pop_front()) {
    lap.trip = verdicts_.front().trip;
    lap.monitor_silent = false;
  }
}

trip_t FaultyPeers::judge(const MonitorInbox& inbox) {
  const std::int64_t due = monitor_.verdict().tick + 1;
  const bool first = monitor_.verdict().tick == hal::kWaitingTick;
  const std::int64_t tick = first && !inbox.contact.empty() ? inbox.contact.front().tick : due;
  const monitor::Samples samples{best(inbox.contact, tick), best(inbox.state, tick), best(inbox.sensors, tick),
                                 inbox.controller_tick};
  trip_t verdict = monitor_.judge(samples);
  // As over a bus: what comes twice is judged twice.
  if (repeated(inbox.contact) || repeated(inbox.state) || repeated(inbox.sensors)) verdict = monitor_.judge(samples);
  return verdict;
}

hal::Status FaultyPeers::hear_operators(Lap& lap, ControllerInbox& inbox) {
  if (operator_bus_ != nullptr) {
    if (lap.command) operator_.know(*lap.command);
    const hal::Status s = operator_bus_->receive_until(hal::WallClock::now(), [] { return false; });
    if (s == hal::Status::kIo) return s;
    const auto message = inbox.tick < 0 ? std::nullopt : operator_.next();
    if (message) {
      lap.heard.push_back(*message);
      lap.heard.back().run_id = 0;
      inbox.commands.push_back(*message);
    }
  }
  if (lap.command) inbox.commands.push_back(*lap.command);
  return hal::Status::kOk;
}

hal::Status FaultyPeers::ask_controller(Lap& lap, double time_s) {
  const std::int64_t tick = lap.plant.contact.tick;
  ControllerInbox inbox{
      tick, lap.plant.contact.last != 0, sensors_to_controller_.arrive(tick), trip_to_controller_.arrive(tick), {}};
  take_out_foreign(inbox.sensors, scenario_.id, counters_.foreign);
  take_out_foreign(inbox.verdicts, scenario_.id, counters_.foreign);
  if (const hal::Status s = hear_operators(lap, inbox); s != hal::Status::kOk) return s;

  const Suffered now = suffered(FaultPeer::kController, time_s, before_s_);
  if (now.restarted) {
    board_ = hal::LockstepBoard();
    controller_.emplace(*params_, board_);
    newest_sensors_ = newest_verdict_ = hal::kWaitingTick;
    controller_inbox_.clear();
    answers_.clear();
  }
  controller_inbox_.push_back(std::move(inbox));
  if (!now.killed && !now.frozen) {
    for (const ControllerInbox& of_tick : controller_inbox_) {
      if (const hal::Status s = serve(of_tick, tick + now.slow_ticks); s != hal::Status::kOk) return s;
    }
    controller_inbox_.clear();
  }
  lap.controller_silent = true;
  for (; !now.killed && !answers_.empty() && answers_.front().due_tick <= tick; answers_.pop_front()) {
    lap.status = answers_.front().status;
    lap.steps = answers_.front().steps;
    lap.controller_silent = false;
    status_to_monitor_.send(lap.status, tick, time_s);
    steps_to_plant_.send(lap.steps, tick, time_s);
  }
  deliver_steps(lap);

  std::int64_t late = 0;
  for (const Fault& fault : scenario_.faults) {
    if (fault.kind == FaultKind::kControllerOverrun && fault.begun(time_s))
      late += static_cast<std::int64_t>(fault.value);
  }
  if (late == 0) return hal::Status::kOk;
  trouble_ = "the firmware is late at tick " + std::to_string(tick) + ": its board has counted " +
             std::to_string(late) + " overruns";
  exit_status_ = program::kExitLate;
  return hal::Status::kIo;
}

hal::Status FaultyPeers::serve(const ControllerInbox& inbox, std::int64_t due_tick) {
  for (const sensors_t& message : inbox.sensors) {
    if (message.tick > newest_sensors_) {
      newest_sensors_ = message.tick;
      board_.give_sensors(hal::from_message(message));
    } else {
      ++(message.tick == newest_sensors_ ? counters_.repeated : counters_.old);
    }
  }
  for (const trip_t& message : inbox.verdicts) {
    if (message.tick > newest_verdict_) {
      newest_verdict_ = message.tick;
      board_.give_verdict(hal::from_message(message));
    } else {
      ++(message.tick == newest_verdict_ ? counters_.repeated : counters_.old);
    }
  }
  for (const operator_t& message : inbox.commands) {
    if (const hal::Status s = board_.give_operator(hal::from_message(message)); s != hal::Status::kOk) return s;
  }
  board_.release_tick(inbox.tick, inbox.last);
  if (const hal::Status s = controller_->step(); s != hal::Status::kOk) return s;
  firmware::ControllerStatus status;
  firmware::StepCommand steps;
  if (const hal::Status s = board_.take_status(status); s != hal::Status::kOk) return s;
  if (const hal::Status s = board_.take_steps(steps); s != hal::Status::kOk) return s;
  const double period_s = scenario_.run.control_period_s;
  answers_.push_back({due_tick, hal::to_message(status, period_s), hal::to_message(steps, period_s)});
  return hal::Status::kOk;
}

// The motors take the command of the tick that comes; one of a tick that has begun is of no use to them.
void FaultyPeers::deliver_steps(Lap& lap) {
  const std::int64_t tick = lap.plant.contact.tick;
  lap.steps_injured = true;
  for (const step_command_t& command : steps_to_plant_.arrive(tick)) {
    if (command.tick == tick + 1 && !lap.delivered) {
      lap.delivered = command;
    } else {
      ++(command.tick == tick + 1 ? counters_.repeated : counters_.old);
    }
  }
}

RefusedMessages FaultyPeers::refused() const {
  RefusedMessages all = refused_operators(operator_bus_, operator_);
  all.here.malformed += contact_to_monitor_.malformed() + state_to_monitor_.malformed() +
                        sensors_to_monitor_.malformed() + sensors_to_controller_.malformed() +
                        trip_to_controller_.malformed() + status_to_monitor_.malformed() + steps_to_plant_.malformed();
  all.here.foreign += counters_.foreign;
  all.here.repeated += counters_.repeated;
  all.here.old += counters_.old;
  return all;
}

}  // namespace ballast::sil
