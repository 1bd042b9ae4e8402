// The summary for the terminal, line by line.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "tools/program/short_number.h"
#include "tools/summary/controller_words.h"
#include "tools/summary/required_friction.h"
#include "tools/summary/summary_parts.h"

namespace ballast::sil {

namespace {

const char* overload_unit(int error) {
  switch (error) {
    case controller_status_t::OVERLOAD_TOO_MANY_STEPS:
      return "microsteps in the tick";
    case controller_status_t::OVERLOAD_TOO_MANY_BURSTS:
      return "bursts in the tick";
    default:
      return "microsteps/s";
  }
}

// A trip's value and limit, by its cause (trip_t.lcm).
std::string trip_values_text(const trip_t& trip) {
  switch (trip.cause) {
    case trip_t::CAUSE_NORMAL_FORCE:
      return fmt::format(": N was {:.6g} N; allowed: > {:.6g} N", trip.value, trip.limit);
    case trip_t::CAUSE_FRICTION:
      // A limit just passed, at a located instant, differs from the value only in digits without meaning.
      if (trip.value > trip.limit * (1 + 1e-6))
        return fmt::format(": f_s/N was {:.6g}; allowed: <= {:.6g}", trip.value, trip.limit);
      if (trip.value > trip.limit) return fmt::format(": f_s/N came to the allowed {:.6g} and grew", trip.limit);
      return fmt::format(": the ball slid at f_s/N = {:.6g}, on a floor that was to hold up to {:.6g}", trip.value,
                         trip.limit);
    case trip_t::CAUSE_DISAGREEMENT:
      return fmt::format(
          ": plant and controller, or the plant's own messages, differed by {:.6g} N about N and f_s; allowed: <= "
          "{:.6g} N",
          trip.value, trip.limit);
    case trip_t::CAUSE_MISSING:
    case trip_t::CAUSE_REPEATED:
      return fmt::format(": the newest tick was {:.0f} where {:.0f} was due", trip.value, trip.limit);
    case trip_t::CAUSE_STALE:
      if (trip.value < 0) return ": the controller sent a status of a tick still to come";
      return fmt::format(": silent for {:.6g} ticks; allowed: {:.6g}", trip.value, trip.limit);
    default:
      return "";
  }
}

// The least margin that the plant showed during a plan.
std::string seen_text(const RunResult& result, const PlanRecord& plan) {
  // Adding 0 removes the sign of a value that rounds to zero.
  if (plan.seen_margin_min) return fmt::format("seen {:.4f}", std::round(1e4 * *plan.seen_margin_min) / 1e4 + 0.0);
  const double end_s = result.final_sample.time_s;
  if (end_s > plan.start_s) return "nothing seen of it: the ball was in the air";
  return fmt::format("never begun: the run {} at t = {:.6g} s",
                     result.end_reason == EndReason::kSlipped ? "slipped" : "ended", end_s);
}

std::string end_text(const sim::Scenario& scenario, const RunResult& result) {
  const double end_s = result.final_sample.time_s;
  switch (result.end_reason) {
    case EndReason::kCompleted:
      return fmt::format("completed at t = {:.6g} s", end_s);
    case EndReason::kSlipped:
      return fmt::format("slipped at t = {:.10g} s: f_s reached mu_s N (mu_s = {:g})", end_s,
                         result.final_sample.floor_static_friction);
    case EndReason::kDetached:
      return fmt::format("detached at t = {:.10g} s: N fell to 0, the floor no longer carries the ball", end_s);
    case EndReason::kTripped:
      if (result.masses_rested) return fmt::format("tripped; the masses were at rest at t = {:.6g} s", end_s);
      // All steps are made, or the run would not have ended so. A mass that still moves has slipped or swings.
      return fmt::format("tripped and stopped; at t = {:.6g} s, the run's end, the masses still {}", end_s,
                         lost_steps_text(scenario, result).empty() ? "swung in their motors" : "moved");
    case EndReason::kInconsistent:
      return fmt::format("inconsistent at t = {:.10g} s: {}", end_s, result.end_text);
    case EndReason::kStepTiming:
      return fmt::format("at t = {:.10g} s: a step pulse in the wrong place, a bug of this program; motor {}, {}",
                         end_s, result.step_timing->violation_motor, result.step_timing->violation->text());
  }
  return "";
}

std::string travel_line(const RunResult& result) {
  const sim::Plant::Sample& end = result.final_sample;
  const bool rolled = result.regimes.size() == 1 && result.regimes.front().regime == sim::Regime::kRolling;
  return fmt::format("  travel      {} to ({}, {}) m, {} m of path, {} m/s at the end\n", rolled ? "rolled" : "came",
                     program::short_number(end.position_W_m[0]), program::short_number(end.position_W_m[1]),
                     program::short_number(result.distance_m), program::short_number(end.velocity_W_mps.norm()));
}

std::string fault_lines(const sim::Scenario& scenario, const RunResult& result) {
  std::string text;
  for (const sim::Fault& fault : scenario.faults) {
    text += (fault.begun(result.final_sample.time_s) ? "  fault       " : "  not reached ") + to_string(fault) + "\n";
  }
  if (result.missing_commands > 0) {
    text += fmt::format("  WARNING     in {} ticks no step command reached the motors: they stood\n",
                        result.missing_commands);
  }
  return text;
}

std::string regime_lines(const RunResult& result) {
  std::string text;
  if (result.regimes.size() > 1 || result.regimes.front().regime != sim::Regime::kRolling) {
    constexpr std::size_t kShown = 8;
    text += "  regimes     ";
    for (std::size_t i = 0; i < std::min(result.regimes.size(), kShown); ++i) {
      text += fmt::format("{}{} from {:.6g} s", i == 0 ? "" : ", ", regime_name(result.regimes[i].regime),
                          result.regimes[i].time_s);
    }
    if (result.regimes.size() > kShown) text += fmt::format(", ... ({} in all)", result.regimes.size());
    text += "\n";
  }
  if (!result.impacts.empty()) {
    double hardest = 0;
    for (const auto& impact : result.impacts) hardest = std::max(hardest, impact.normal_impulse_ns);
    text += fmt::format("  impacts     {}, the first at t = {:.6g} s, the hardest {:.6g} N s\n", result.impacts.size(),
                        result.impacts.front().time_s, hardest);
  }
  return text;
}

std::string controller_trip_text(const ControllerTrip& trip) {
  std::string text = fmt::format("by the controller itself at t = {:.6f} s: {}", trip.time_s, fault_cause(trip.faults));
  if (const auto& status = trip.status; status.overload_error != 0) {
    text += fmt::format(": motor {} in tick {}, {:.6g} {}, limit {:.6g}", status.overload_motor, status.overload_tick,
                        status.overload_value, overload_unit(status.overload_error), status.overload_limit);
  }
  if (const int mass = mass_at_its_end(trip); mass >= 0) {
    text += fmt::format(": mass {} is at an end of its rail and is commanded on", mass);
  }
  return text;
}

std::string trip_text(const sim::Scenario& scenario, const RunResult& result) {
  if (result.trip.tripped == 0) return result.controller_trip ? controller_trip_text(*result.controller_trip) : "none";
  std::string text = fmt::format("{} at t = {:.6f} s{}", trip_cause(result.trip.cause), result.trip.trip_time_s,
                                 trip_values_text(result.trip));
  const bool physics_ended = result.end_reason != EndReason::kCompleted && result.end_reason != EndReason::kTripped;
  const bool stepper = scenario.run.actuation == sim::Actuation::kStepper;
  if (stepper && result.latency_ticks.value_or(-1) >= 0 && !physics_ended) {
    text +=
        fmt::format("; the stop began {} tick{} later", *result.latency_ticks, *result.latency_ticks == 1 ? "" : "s");
  }
  return text;
}

std::string plan_lines(const sim::Scenario& scenario, const RunResult& result) {
  std::string text;
  for (const auto& [name, plan] : {std::pair("move", &result.move), std::pair("stop", &result.stop)}) {
    if (!*plan) continue;
    const PlanRecord& p = **plan;
    // A plan that the run's end forestalled needs no second reason for its missing prediction.
    const bool predicted = !std::isnan(p.predicted.normal_force_min_n);
    const bool begun = p.seen_margin_min || result.final_sample.time_s > p.start_s;
    text += fmt::format("  {}        from t = {:.6g} s, {:.6g} s; {}{}\n", name, p.start_s, p.predicted.duration_s,
                        predicted || begun ? predicted_text(p.predicted) + "; " : "", seen_text(result, p));
  }
  if (const auto& move = result.move; move && move->seen_margin_min) {
    const std::string missed = far_below_text(move->predicted, *move->seen_margin_min);
    if (!missed.empty()) text += "  WARNING     " + missed + " (how much: share)\n";
  }
  if (result.move_end) {
    text += (arrived(result) ? "  arrived     " : "  NOT THERE   ") + move_end_text(scenario, result) + "\n";
  }
  return text;
}

std::string friction_lines(const sim::Scenario& scenario, const RunResult& result) {
  const sim::ContactExtrema& x = result.extrema;
  std::string text =
      fmt::format("  least N     {:.6g} N at t = {:.4f} s\n", x.normal_force_min.value, x.normal_force_min.time_s);
  if (!std::isfinite(x.mu_required_max.value)) {
    text += fmt::format("  most f_s/N  unbounded: N = 0 at t = {:.4f} s", x.mu_required_max.time_s);
  } else {
    text += fmt::format("  most f_s/N  {:.6f} at t = {:.4f} s", x.mu_required_max.value, x.mu_required_max.time_s);
    if (std::isfinite(scenario.surface.static_friction)) {
      text += fmt::format(" (this floor gives mu_s = {:g})", scenario.surface.static_friction);
    }
  }
  if (result.end_reason != EndReason::kCompleted) {
    text += "; the lines below hold only up to the run's end";
  } else if (result.rolling_lost) {
    text += "; rolling was lost: the lines below hold only up to then";
  }
  std::string holds_on, slips_on;
  const auto floors = floor_verdicts(scenario, result);
  for (const FloorVerdict& floor : floors) {
    std::string& list = floor.holds ? holds_on : slips_on;
    list += fmt::format("{}{} {:.2f}", list.empty() ? "" : ", ", floor.name, floor.static_friction);
  }
  if (!floors.empty()) text += "\n  holds on    " + (holds_on.empty() ? "none of the paper's floors" : holds_on);
  if (!slips_on.empty()) text += "\n  not on      " + slips_on;
  return text + "\n  in short    " + required_friction_text(result, floors) + "\n";
}

std::string published_lines(const sim::Scenario& scenario, const RunResult& result) {
  std::string text;
  for (const auto& published : scenario.published) {
    // A run that ended early has not reached the published extremum.
    if (result.end_reason != EndReason::kCompleted && published.quantity != "end.time") continue;
    const double here = measured(result, published.quantity);
    text += fmt::format("  published   {} = {:g} ({}); here {}\n", published.quantity, published.value,
                        published.source, std::isfinite(here) ? fmt::format("{:.6g}", here) : "unbounded");
  }
  return text;
}

std::string step_lines(const sim::Scenario& scenario, const RunResult& result) {
  std::string text;
  if (scenario.run.actuation == sim::Actuation::kStepper) {
    std::string issued;
    std::int64_t lost = 0, slips = 0;
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      issued += fmt::format("{}{}", i == 0 ? "" : " + ", result.motors[i].steps);
      lost += result.final_sample.lost_steps[i];
      slips += result.motors[i].slips;
    }
    text += fmt::format("  steps       {} issued, {} lost", issued.empty() ? "0" : issued, lost);
    if (slips > 0) text += fmt::format(" ({} slips, both directions counted)", slips);
    text += "\n";
  }
  for (const std::string& warning : warnings_of_masses(scenario, result)) text += "  WARNING     " + warning + "\n";
  if (!result.step_timing) return text;
  const CheckedSteps sums = checked_steps(*result.step_timing);
  text += fmt::format("  step timing {} steps checked, the worst {:.3f} us from its crossing (allowed {:.3g})",
                      sums.checked, sums.max_error_us, sums.tolerance_us);
  if (result.step_timing->plan_steps > 0) {
    text += fmt::format("; {} of them of stops and moves", result.step_timing->plan_steps);
  }
  if (sums.structural > 0) text += fmt::format("; {} more by spacing, set-up and counts only", sums.structural);
  return text + "\n";
}

std::string motor_lines(const sim::Scenario& scenario, const RunResult& result) {
  std::string text;
  double margin = 1, electrical_j = 0, copper_j = 0;
  bool any_motor = false;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    margin = std::min(margin, result.motor_extrema[i].torque_margin);
    electrical_j += result.motor_energy[i].electrical_j;
    copper_j += result.motor_energy[i].copper_j;
    any_motor = any_motor || scenario.masses[i].trajectory.times_s.empty();
  }
  if (any_motor) {
    if (scenario.run.actuation == sim::Actuation::kStepper) {
      text += fmt::format("  motors      least torque margin {:.0f} %", 100 * margin);
    } else if (margin < 0) {
      text +=
          fmt::format("  motors      not simulated; this motion needs {:.3g} times the torque they have", 1 - margin);
    } else {
      text += fmt::format("  motors      not simulated; this motion leaves {:.0f} % of their torque", 100 * margin);
    }
    if (electrical_j != 0) {
      text += fmt::format("; {:.3g} J from the supply, {:.3g} J of it heat in the windings", electrical_j, copper_j);
    }
    text += "\n";
  }
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::EndStopRecord& stop = result.end_stops[i];
    if (stop.touches == 0) continue;
    text += fmt::format(
        "  end stop    mass {} touched it first at t = {:.6g} s (touches: {}), pushed back by up to {:.4g} N\n", i,
        stop.first_s, stop.touches, stop.max_force_n);
  }
  return text;
}

std::string share_line(const MotorShare& share) {
  if (!share.seen()) return "";
  const auto part = [](const Deviation& d) {
    return std::isfinite(d.difference()) ? fmt::format("{:.3g}", std::abs(d.difference())) : "any bound";
  };
  const double commanded = share.commanded_mu_required_max.value;
  return fmt::format(
      "  share       the motors change N by up to {} N, f_s by {} N, f_s/N by {}; commanded most f_s/N {}\n",
      part(share.normal_force_n), part(share.static_friction_n), part(share.mu_required),
      std::isfinite(commanded) ? fmt::format("{:.6f}", commanded) : "unbounded");
}

std::string bus_line(const RefusedMessages& refused) {
  if (refused.here.refused() + refused.by_controller == 0) return "";
  return fmt::format(
      "  bus         messages not used: {} malformed, {} of another run, {} repeated, {} old, {} dropped; by the "
      "controller {}\n",
      refused.here.malformed, refused.here.foreign, refused.here.repeated, refused.here.old, refused.here.dropped,
      refused.by_controller);
}

std::string speed_line(const RunResult& result) {
  const double end_s = result.final_sample.time_s;
  const double speed = end_s / std::max(result.wall_time_s, 1e-9);
  std::string text = "  speed       " + (speed < 9.95 ? fmt::format("{:.2g}", speed) : fmt::format("{:.0f}", speed)) +
                     " times real time";
  if (result.ticks > 0) {
    text += fmt::format(", {:.2f} us per tick", 1e6 * result.wall_time_s / static_cast<double>(result.ticks));
  }
  // A pace counts as kept if the lateness is too small for a person to notice.
  if (result.asked_speed > 0 && speed < 0.95 * result.asked_speed &&
      result.wall_time_s > end_s / result.asked_speed + 0.2) {
    text += fmt::format("; it was to be {:.6g}, which was not kept", result.asked_speed);
  }
  return text + "\n";
}

}  // namespace

std::string summary_text(const sim::Scenario& scenario, const RunResult& result,
                         const std::filesystem::path& directory) {
  const bool stepper = scenario.run.actuation == sim::Actuation::kStepper;
  std::string text = fmt::format("{}, {} masses\n", scenario.name, stepper ? "stepper-driven" : "prescribed");
  text += "  ended       " + end_text(scenario, result) + "\n";
  text += travel_line(result);
  text += fault_lines(scenario, result);
  text += regime_lines(result);
  text += "  trip        " + trip_text(scenario, result) + "\n";
  text += plan_lines(scenario, result);
  text += friction_lines(scenario, result);
  text += published_lines(scenario, result);
  text += step_lines(scenario, result);
  text += motor_lines(scenario, result);
  text += share_line(result.motor_share);
  text += bus_line(result.refused);
  text += speed_line(result);
  return text + "  results     " + directory.string() + "\n";
}

}  // namespace ballast::sil
