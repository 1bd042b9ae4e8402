#include "tools/faults/faulty_peers.h"

#include <algorithm>

#include "hal/lcm/channels.h"
#include "tools/sil/in_process_peers.h"

namespace ballast::sil {

using sim::Fault;
using sim::FaultKind;
using sim::FaultLayer;
using sim::FaultPeer;

namespace {

bool needs_faulty_peers(const Fault& fault) {
  return fault.of(FaultLayer::kMessage) || fault.of(FaultLayer::kPeer) || fault.kind == FaultKind::kClockJump ||
         fault.kind == FaultKind::kControllerOverrun;
}

}  // namespace

bool FaultyPeers::needed(const sim::Scenario& scenario) {
  return std::any_of(scenario.faults.begin(), scenario.faults.end(), needs_faulty_peers);
}

std::string FaultyPeers::not_possible(const sim::Scenario& scenario, Elsewhere elsewhere, const std::string& where) {
  const auto possible = [elsewhere](const Fault& fault) {
    if (!needs_faulty_peers(fault)) return true;
    if (fault.of(FaultLayer::kMessage) || fault.kind == FaultKind::kClockJump) return elsewhere != Elsewhere::kNothing;
    return fault.of(FaultLayer::kPeer) && elsewhere == Elsewhere::kProcesses;
  };
  const auto fault = std::find_if_not(scenario.faults.begin(), scenario.faults.end(), possible);
  if (fault == scenario.faults.end()) return "";
  const char* allowed = fault->kind == FaultKind::kControllerOverrun ? "ballast run without --processes and --firmware"
                        : elsewhere == Elsewhere::kNothing ? "ballast run without --firmware and --check-steps"
                                                           : "ballast run, with --processes or without";
  return to_string(*fault) + ": cannot be had " + where + "; allowed: " + allowed;
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
      monitor_hearing_(scenario),
      controller_hearing_(scenario),
      motor_hearing_(scenario),
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
  const double time_s = fault_time_s(scenario_, lap.plant.contact.tick);
  ask_monitor(lap, time_s);
  const hal::Status status = controller_ ? ask_controller(lap, time_s) : hal::Status::kOk;
  before_s_ = time_s;
  return status;
}

void FaultyPeers::ask_monitor(Lap& lap, double time_s) {
  const std::int64_t tick = lap.plant.contact.tick;
  monitor_inbox_.push_back(monitor_hearing_.hear(lap.plant.contact, lap.plant.state, lap.plant.sensors));
  if (lap.replayed) {
    monitor_inbox_.clear();
    lap.monitor_silent = !lap.verdict;
    if (lap.verdict) lap.trip = *lap.verdict;
    return;
  }

  const Suffered now = suffered(FaultPeer::kMonitor, time_s, before_s_);
  if (now.restarted) {
    monitor_ = monitor::Monitor(limits_);
    monitor_inbox_.erase(monitor_inbox_.begin(), monitor_inbox_.end() - 1);
    verdicts_.clear();
  }
  if (!now.killed && !now.frozen) {
    for (const monitor::Heard& heard : monitor_inbox_) {
      verdicts_.push_back({tick + now.slow_ticks, monitor::judge(monitor_, heard)});
    }
    monitor_inbox_.clear();
  }
  lap.monitor_silent = true;
  for (; !now.killed && !verdicts_.empty() && verdicts_.front().due_tick <= tick; verdicts_.pop_front()) {
    lap.trip = verdicts_.front().trip;
    lap.monitor_silent = false;
  }
}

hal::Status FaultyPeers::hear_operators(Lap& lap, ControllerInbox& inbox) {
  if (operator_bus_ != nullptr) {
    operator_.now(lap.plant.contact.tick);
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
  Suffered now = suffered(FaultPeer::kController, time_s, before_s_);
  // Over a bus the plant waited for it.
  if (lap.replayed && lap.answered) now = {.restarted = now.restarted};
  if (now.restarted) {
    board_ = hal::LockstepBoard();
    controller_.emplace(*params_, board_);
    controller_hearing_.forget();
    controller_inbox_.clear();
    answers_.clear();
  }
  ControllerInbox inbox{tick,
                        lap.plant.contact.last != 0,
                        controller_hearing_.hear(lap.plant.sensors, lap.monitor_silent ? nullptr : &lap.trip),
                        {}};
  if (const hal::Status s = hear_operators(lap, inbox); s != hal::Status::kOk) return s;
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
    monitor_hearing_.tell(lap.status, tick);
    motor_hearing_.tell(lap.steps, tick);
  }
  motor_hearing_.deliver(lap);

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
  if (inbox.heard.sensors) board_.give_sensors(hal::from_message(*inbox.heard.sensors));
  if (inbox.heard.trip) board_.give_verdict(hal::from_message(*inbox.heard.trip));
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

RefusedMessages FaultyPeers::refused() const {
  RefusedMessages all = refused_operators(operator_bus_, operator_);
  all.here += monitor_hearing_.counters();
  all.here += controller_hearing_.counters();
  all.here += motor_hearing_.counters();
  return all;
}

}  // namespace ballast::sil
