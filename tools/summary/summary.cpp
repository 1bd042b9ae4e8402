#include "tools/summary/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "sim/scenario/reader.h"
#include "tools/program/short_number.h"
#include "tools/summary/summary_parts.h"

namespace ballast::sil {

namespace {

struct Floor {
  const char* name;
  double static_friction;
};

// mu_s of an aluminium shell on the paper's floors (PHYSICS.md section 6).
constexpr Floor kFloors[] = {{"aluminium", .42}, {"steel", .35},    {"titanium", .34}, {"nickel", .33},
                             {"copper", .28},    {"chromium", .27}, {"glass", .17},    {"graphite", .16}};

// Whether the ball of a run that started rolling rolls on such a floor, up to where rolling was lost. A ball that
// slipped does not hold on its own floor, nor on a smoother one.
bool holds(const sim::Scenario& scenario, const RunResult& result, double static_friction) {
  // A fault may have made the floor worse than the scenario's.
  const double slipped_on = std::min(scenario.surface.static_friction, result.final_sample.floor_static_friction);
  if (result.end_reason == EndReason::kSlipped && static_friction <= slipped_on) return false;
  return result.extrema.normal_force_min.value > 0 && result.extrema.mu_required_max.value <= static_friction;
}

// The masses that were outside the ball, and what to do about it; empty: none.
std::string outside_ball_text(const sim::Scenario& scenario, const RunResult& result) {
  std::string who;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::EndStopRecord& stop = result.end_stops[i];
    if (stop.outside_ball_m > 0) {
      who +=
          fmt::format("{}mass {} was outside the ball by up to {} m, first seen at t = {} s", who.empty() ? "" : ", ",
                      i, program::short_number(stop.outside_ball_m), program::short_time(stop.outside_ball_s));
    }
  }
  if (who.empty()) return "";
  return who +
         ": its end stop gave way, and there is no shell in the model to hold it; give it a stiffer stop "
         "(rail.end_stop_stiffness) or stops further in (rail.end_stops)";
}

// The faults injected into that motor up to the end of the run; empty: none.
std::string motor_faults_text(const sim::Scenario& scenario, std::size_t motor, double end_s) {
  std::string text;
  for (const sim::Fault& fault : scenario.faults) {
    if (!fault.of(sim::FaultLayer::kMotor) || fault.mass != static_cast<int>(motor) || !fault.begun(end_s)) continue;
    text += (text.empty() ? "" : ", and ") + to_string(fault);
  }
  return text;
}

}  // namespace

const char* regime_name(sim::Regime regime) {
  switch (regime) {
    case sim::Regime::kRolling:
      return "rolling";
    case sim::Regime::kSliding:
      return "sliding";
    case sim::Regime::kFlight:
      return "flight";
  }
  return "";
}

int mass_at_its_end(const ControllerTrip& trip) {
  if ((static_cast<std::uint32_t>(trip.faults) & static_cast<std::uint32_t>(firmware::Fault::kEndSwitch)) == 0) {
    return -1;
  }
  for (int i = 0; i < trip.status.motor_count; ++i) {
    const int switches = trip.sensors.limit_switch[i];
    const double velocity = trip.status.commanded_velocity[i];
    if (((switches & 1) != 0 && velocity < 0) || ((switches & 2) != 0 && velocity > 0)) return i;
  }
  return -1;
}

double measured(const RunResult& result, const std::string& quantity) {
  if (quantity == "mu_required.max") return result.extrema.mu_required_max.value;
  if (quantity == "normal_force.min") return result.extrema.normal_force_min.value;
  return result.final_sample.time_s;  // end.time; the scenario reader allows no other
}

CheckedSteps checked_steps(const StepTimingRecord& record) {
  CheckedSteps sums;
  for (const auto& motor : record.motors) {
    sums.checked += motor.checked_steps;
    sums.structural += motor.structural_steps;
    sums.max_error_us = std::max(sums.max_error_us, motor.max_error_us);
    sums.tolerance_us = motor.tolerance_us;
  }
  return sums;
}

// A rail coordinate below this counts as 0: rad or m.
constexpr double kSmallPosition = 1e-6;

std::string move_end_text(const sim::Scenario& scenario, const RunResult& result) {
  std::string moved, held;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const double position = result.final_sample.mass_position[i];
    const double target = result.move_end->asked.target_position[i];
    if (asked(*result.move_end, i))
      moved += fmt::format("{}mass {} at {} (asked: {}, {} to go)", moved.empty() ? "" : ", ", i,
                           program::short_number(position), sim::number_text(target),
                           program::short_number(target - position));
    else
      held += fmt::format("{}mass {} at {}", held.empty() ? "; held: " : ", ", i,
                          program::short_number(position, kSmallPosition));
  }
  if (result.masses_rested || !result.move) return moved + held;
  return moved + held + (result.move_end->steps_made ? "; still swinging in their motors" : "; still moving");
}

const char* trip_cause(int cause) {
  switch (cause) {
    case trip_t::CAUSE_NORMAL_FORCE:
      return "normal_force";
    case trip_t::CAUSE_FRICTION:
      return "friction";
    case trip_t::CAUSE_NONFINITE:
      return "nonfinite";
    case trip_t::CAUSE_STALE:
      return "stale";
    case trip_t::CAUSE_MISSING:
      return "missing";
    case trip_t::CAUSE_REPEATED:
      return "repeated";
    case trip_t::CAUSE_DISAGREEMENT:
      return "disagreement";
    default:
      return "none";
  }
}

const char* fault_cause(std::int32_t faults) {
  using firmware::Fault;
  constexpr std::pair<Fault, const char*> kNames[] = {{Fault::kSensorNotFinite, "sensor_not_finite"},
                                                      {Fault::kSensorStale, "sensor_stale"},
                                                      {Fault::kMonitorStale, "monitor_stale"},
                                                      {Fault::kStepOverload, "step_overload"},
                                                      {Fault::kTickOutOfOrder, "tick_out_of_order"},
                                                      {Fault::kEndSwitch, "end_switch"},
                                                      {Fault::kSlipMeasured, "slip_measured"},
                                                      {Fault::kLightMeasured, "light_measured"},
                                                      {Fault::kNoEstimate, "no_estimate"},
                                                      {Fault::kInternal, "internal"}};
  for (const auto& [fault, name] : kNames) {
    if ((static_cast<std::uint32_t>(faults) & static_cast<std::uint32_t>(fault)) != 0) return name;
  }
  return "controller";
}

bool controller_tripped_first(const RunResult& result) {
  if (!result.controller_trip) return false;
  return result.trip.tripped == 0 || result.controller_trip->tick < result.trip.trip_tick;
}

std::vector<FloorVerdict> floor_verdicts(const sim::Scenario& scenario, const RunResult& result) {
  std::vector<FloorVerdict> verdicts;
  if (result.regimes.front().regime != sim::Regime::kRolling) return verdicts;
  for (const Floor& floor : kFloors) {
    verdicts.push_back({floor.name, floor.static_friction, holds(scenario, result, floor.static_friction)});
  }
  return verdicts;
}

std::string lost_steps_text(const sim::Scenario& scenario, const RunResult& result) {
  std::string who, faulty, stopped;
  bool in_free_motion = false;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const auto lost = result.final_sample.lost_steps[i];
    if (lost == 0) continue;
    who += fmt::format("{}motor {} lost {}", who.empty() ? "" : ", ", i, lost);
    // The motion's limits do not explain steps lost to an injected fault.
    if (const std::string faults = motor_faults_text(scenario, i, result.final_sample.time_s); !faults.empty())
      faulty += fmt::format(" The fault {1} was injected into motor {0}.", i, faults);
    else if (const sim::EndStopRecord& stop = result.end_stops[i]; stop.touches > 0)
      stopped += fmt::format(" Mass {} met its end stop at t = {} s: how many steps were lost there is not known.", i,
                             program::short_time(stop.first_s));
    else
      in_free_motion = true;
  }
  if (who.empty()) return "";
  const std::string text = who + " microsteps: its mass is not where the controller believes it is." + faulty + stopped;
  if (!in_free_motion && stopped.empty()) return text.substr(0, text.size() - 1);
  return text + (in_free_motion ? " The torque did not carry the motion" : " If the torque did not carry the motion") +
         ": allow it less speed, acceleration or jerk (motor.max_step_rate, max_acceleration, max_jerk, or "
         "ballast move --speed-fraction), or give it more torque";
}

bool arrived(const RunResult& result) {
  const auto& lost = result.final_sample.lost_steps;
  return result.move_end && result.move_end->steps_made &&
         std::all_of(lost.begin(), lost.end(), [](std::int64_t steps) { return steps == 0; });
}

std::vector<std::string> warnings_of_masses(const sim::Scenario& scenario, const RunResult& result) {
  std::vector<std::string> texts{lost_steps_text(scenario, result), outside_ball_text(scenario, result)};
  std::erase(texts, "");
  return texts;
}

std::vector<std::string> warnings(const sim::Scenario& scenario, const RunResult& result) {
  std::vector<std::string> texts = warnings_of_masses(scenario, result);
  if (result.move_end && !arrived(result)) {
    texts.push_back("the move did not arrive: " + move_end_text(scenario, result));
  }
  return texts;
}

int exit_status(const RunResult& result) {
  if (result.end_reason == EndReason::kStepTiming) return 2;
  const bool completed = result.end_reason == EndReason::kCompleted && !result.rolling_lost;
  if (!completed || result.trip.tripped != 0 || result.controller_trip) return 3;
  return result.move_end && !arrived(result) ? 2 : 0;
}

}  // namespace ballast::sil
