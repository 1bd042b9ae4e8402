#include "tools/soak/fault_windows.h"

#include <algorithm>

namespace ballast::soak {

namespace {

using sim::Fault;
using sim::FaultKind;
using sim::FaultLayer;
using sim::FaultSensor;

bool on_the_bus(const Fault& fault) {
  return fault.of(FaultLayer::kMessage) || fault.of(FaultLayer::kPeer) || fault.kind == FaultKind::kClockJump;
}

// A peer that is gone, or a clock that has jumped, stays so.
bool lasts_for_ever(const Fault& fault) {
  return fault.kind == FaultKind::kPeerKilled || fault.kind == FaultKind::kClockJump;
}

bool delays(const Fault& fault) {
  return fault.kind == FaultKind::kMessagesDelayed || fault.kind == FaultKind::kPeerTooSlow;
}

// Ticks by which the effect of any fault outlasts it. A message that is lost in tick k is missed in k, or in k + 1 if
// it is the controller's, and what that peer answers is judged one tick later: 2. Messages and answers that are late
// add what they are late by.
std::int64_t longest_aftermath_ticks(const sim::Scenario& scenario) {
  std::int64_t ticks = 2;
  for (const Fault& fault : scenario.faults) {
    if (delays(fault)) ticks += static_cast<std::int64_t>(fault.value);
  }
  return ticks;
}

bool restarts_the_monitor(const Fault& fault) {
  return fault.kind == FaultKind::kPeerRestarted && fault.peer == sim::FaultPeer::kMonitor;
}

bool turns_the_estimate(const Fault& fault) {
  return fault.of(FaultLayer::kSensor) &&
         (fault.sensor == FaultSensor::kOrientation || fault.sensor == FaultSensor::kGyro);
}

}  // namespace

FaultWindows::FaultWindows(const sim::Scenario& scenario)
    : scenario_(scenario), aftermath_ticks_(longest_aftermath_ticks(scenario)) {}

template <class Selects>
bool FaultWindows::any(std::int64_t tick, Selects selects) const {
  if (tick < 0) return false;  // no fault begins in the countdown
  const double period_s = scenario_.run.control_period_s;
  return std::ranges::any_of(scenario_.faults, [&](const Fault& fault) {
    if (!selects(fault) || !fault.begun(static_cast<double>(tick) * period_s)) return false;
    if (lasts_for_ever(fault)) return true;
    // An instant between two ticks shows in the later one.
    const double last_s = static_cast<double>(tick - aftermath_ticks_ - 1) * period_s;
    return last_s < fault.end_s - Fault::kRounding;
  });
}

bool FaultWindows::bus(std::int64_t tick) const { return any(tick, on_the_bus); }

bool FaultWindows::corruption(std::int64_t tick) const {
  return any(tick, [](const Fault& fault) { return fault.kind == FaultKind::kMessagesCorrupted; });
}

bool FaultWindows::sensors(std::int64_t tick) const { return any(tick, turns_the_estimate); }

bool FaultWindows::nan(std::int64_t tick) const {
  return any(tick, [](const Fault& fault) { return fault.kind == FaultKind::kSensorNan; });
}

bool FaultWindows::push(std::int64_t tick) const {
  return any(tick, [](const Fault& fault) { return fault.kind == FaultKind::kPush; });
}

bool FaultWindows::switches(std::int64_t tick) const {
  return any(tick, [](const Fault& fault) {
    return fault.of(FaultLayer::kSensor) && fault.sensor == FaultSensor::kLimitSwitch;
  });
}

bool FaultWindows::monitor_restarted(std::int64_t tick) const { return any(tick, restarts_the_monitor); }

bool FaultWindows::monitor_restarts(std::int64_t tick) const {
  const double period_s = scenario_.run.control_period_s;
  const double now_s = static_cast<double>(tick) * period_s;
  return tick >= 0 && std::ranges::any_of(scenario_.faults, [&](const Fault& fault) {
           return restarts_the_monitor(fault) && fault.begun(now_s) && !fault.begun(now_s - period_s);
         });
}

}  // namespace ballast::soak
