// The summary for the terminal, line by line.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numbers>
#include <utility>

#include "sim/scenario/reader.h"
#include "tools/program/short_number.h"
#include "tools/summary/coast.h"
#include "tools/summary/controller_words.h"
#include "tools/summary/required_friction.h"
#include "tools/summary/summary_parts.h"

namespace ballast::sil {

namespace {

using program::short_number;
using program::short_time;

// The least margin that the plant showed during a plan.
std::string seen_text(const RunResult& result, const PlanRecord& plan) {
  if (plan.seen_margin_min) return "the least margin seen was " + short_number(*plan.seen_margin_min);
  const double end_s = result.final_sample.time_s;
  if (end_s > plan.start_s) return "no margin was seen: the ball was in the air";
  return fmt::format("did not begin: the {} at t = {} s",
                     result.end_reason == EndReason::kSlipped ? "ball slipped" : "run ended", short_time(end_s));
}

std::string end_text(const sim::Scenario& scenario, const RunResult& result) {
  const double end_s = result.final_sample.time_s;
  switch (result.end_reason) {
    case EndReason::kCompleted:
      return fmt::format("completed at t = {} s", short_time(end_s));
    case EndReason::kSlipped:
      return fmt::format("slipped at t = {} s: f_s reached mu_s N (mu_s = {})", short_time(end_s),
                         short_number(result.final_sample.floor_static_friction));
    case EndReason::kDetached:
      return fmt::format("detached at t = {} s: N fell to 0, the floor no longer carries the ball", short_time(end_s));
    case EndReason::kTripped:
      if (result.masses_rested)
        return fmt::format("tripped; the masses were at rest at t = {} s, which ended the run", short_time(end_s));
      // All steps are made, or the run would not have ended so. A mass that still moves has slipped or swings.
      return fmt::format("tripped and stopped; at t = {} s, the run's end, the masses still {}", short_time(end_s),
                         lost_steps_text(scenario, result).empty() ? "swung in their motors" : "moved");
    case EndReason::kInconsistent:
      return fmt::format("inconsistent at t = {} s: {}", short_time(end_s), result.end_text);
    case EndReason::kStepTiming:
      return fmt::format("at t = {} s: a step pulse in the wrong place, a bug of this program; motor {}, {}",
                         short_time(end_s), result.step_timing->violation_motor, result.step_timing->violation->text());
  }
  return "";
}

// Less than a ten-thousandth of the ball, or of the ball per second, is standing still to a reader.
std::string travel_line(const sim::Scenario& scenario, const RunResult& result) {
  const double nothing = 1e-4 * scenario.ball.radius_m;
  const sim::Plant::Sample& end = result.final_sample;
  const bool rolled = result.regimes.size() == 1 && result.regimes.front().regime == sim::Regime::kRolling;
  return fmt::format("  travel      {} to ({}, {}) m, {} m of path, {} m/s at the end\n", rolled ? "rolled" : "came",
                     short_number(end.position_W_m[0], nothing), short_number(end.position_W_m[1], nothing),
                     short_number(result.distance_m, nothing), short_number(end.velocity_W_mps.norm(), nothing));
}

// How near the ball came to the goal of its plan.
std::string goal_line(const sim::Scenario& scenario, const RunResult& result) {
  if (!scenario.plan.goal_W_m) return "";
  constexpr double kNegligible_m = 1e-6;  // a plan meets its goal within 1 mm
  const Eigen::Vector2d& goal = *scenario.plan.goal_W_m;
  const double off_m = (result.final_sample.position_W_m.head<2>() - goal).norm();
  return fmt::format("  goal        ({}, {}) m in its plan; the ball ended {} mm from there\n",
                     short_number(goal[0], kNegligible_m), short_number(goal[1], kNegligible_m),
                     short_number(1e3 * off_m, 1e3 * kNegligible_m));
}

// How far the ball was from the place of its plan.
std::string tracking_line(const sim::Scenario& scenario, const RunResult& result) {
  if (!result.tracking) return "";
  const TrackingRecord& t = *result.tracking;
  const double nothing_mm = 1e-3;
  const auto mm = [&](double m) { return short_number(1e3 * m, nothing_mm); };
  const bool tracked = scenario.control.tracking && has_controller(scenario.run.actuation);
  const std::string delay =
      t.delay_s > 0 ? fmt::format("; the plan waited {} s for the ball", short_number(t.delay_s)) : "";
  return fmt::format("  tracking    {}: {} mm rms from the plan, {} mm at most, {} mm at the end, of {} m of path{}\n",
                     tracked ? "on" : "off", mm(t.rms_m), mm(t.max_m), mm(t.final_m), short_number(t.path_length_m),
                     delay);
}

std::string courses_line(const RunResult& result) {
  if (result.courses == 0) return "";
  return fmt::format("  courses     {} from operators\n", result.courses);
}

// The governor's part, in a sentence.
std::string governor_line(const RunResult& result) {
  if (!result.governor) return "";
  const GovernorRecord& g = *result.governor;
  if (g.bent_ticks == 0) {
    return fmt::format(
        "  governor    on: bent no command; in all its ticks a stop was certified, with a margin of {}\n",
        short_number(g.least_margin));
  }
  constexpr double kNothing = 1e-6;  // rail units
  double most = 0;
  for (const double bend : g.largest_bend) most = std::max(most, bend);
  const std::string allowance = g.motor_allowance > 0
                                    ? fmt::format("; kept up to {} % of N free for motors, estimate and belief",
                                                  short_number(100 * g.motor_allowance))
                                    : "";
  return fmt::format(
      "  governor    on: bent the commands of {} % of its ticks, {} % on the backup, by {} rail units{}\n",
      short_number(100 * g.share(g.bent_ticks)), short_number(100 * g.share(g.backup_ticks)),
      most < kNothing ? fmt::format("less than {:g}", kNothing) : "up to " + short_number(most), allowance);
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
      text += fmt::format("{}{} from {} s", i == 0 ? "" : ", ", regime_name(result.regimes[i].regime),
                          short_time(result.regimes[i].time_s));
    }
    if (result.regimes.size() > kShown) text += fmt::format(", ... ({} in all)", result.regimes.size());
    text += "\n";
  }
  if (!result.impacts.empty()) {
    double hardest = 0;
    for (const auto& impact : result.impacts) hardest = std::max(hardest, impact.normal_impulse_ns);
    text += fmt::format("  impacts     {}, the first at t = {} s, the hardest {} N s\n", result.impacts.size(),
                        short_time(result.impacts.front().time_s), short_number(hardest));
  }
  return text;
}

std::string controller_trip_text(const ControllerTrip& trip) {
  std::string text =
      fmt::format("by the controller itself at t = {} s: {}", short_time(trip.time_s), fault_text(trip.status));
  if (const int mass = mass_at_its_end(trip); mass >= 0) {
    text += fmt::format(": mass {} is at an end of its rail and is commanded on", mass);
  }
  return text;
}

// Empty where the whole floor holds alike.
std::string floor_at_trip_text(const sim::Scenario& scenario, const RunResult& result) {
  if (!result.trip_static_friction || *result.trip_static_friction == scenario.surface.static_friction) return "";
  if (!std::isfinite(*result.trip_static_friction)) return "";
  return fmt::format(" (mu_s = {} where it was)", short_number(*result.trip_static_friction));
}

std::string trip_text(const sim::Scenario& scenario, const RunResult& result) {
  const bool monitor_tripped = result.trip.tripped != 0, controller_first = controller_tripped_first(result);
  if (!monitor_tripped) return controller_first ? controller_trip_text(*result.controller_trip) : "none";
  std::string text = verdict_text(result.trip, floor_at_trip_text(scenario, result));
  if (controller_first) return controller_trip_text(*result.controller_trip) + "; then by the monitor, " + text;
  const bool physics_ended = result.end_reason != EndReason::kCompleted && result.end_reason != EndReason::kTripped;
  if (has_controller(scenario.run.actuation) && result.latency_ticks.value_or(-1) >= 0 && !physics_ended) {
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
    const std::string when =
        begun ? fmt::format("from t = {} s, takes {} s; ", short_time(p.start_s), short_time(p.predicted.duration_s))
              : fmt::format("planned for t = {} s; ", short_time(p.start_s));
    text += fmt::format("  {}        {}{}{}\n", name, when,
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

// Empty for a floor without patches.
std::string patches_text(const sim::Surface& surface) {
  if (surface.patches.empty()) return "";
  const auto [least, most] =
      std::minmax_element(surface.patches.begin(), surface.patches.end(),
                          [](const auto& a, const auto& b) { return a.static_friction < b.static_friction; });
  if (least->static_friction == most->static_friction) {
    return fmt::format(", its patches {}", short_number(least->static_friction));
  }
  return fmt::format(", its patches {} to {}", short_number(least->static_friction),
                     short_number(most->static_friction));
}

std::string friction_lines(const sim::Scenario& scenario, const RunResult& result) {
  const sim::ContactExtrema& x = result.extrema;
  std::string text = fmt::format("  least N     {} N at t = {} s\n", short_number(x.normal_force_min.value),
                                 short_time(x.normal_force_min.time_s));
  if (!std::isfinite(x.mu_required_max.value)) {
    text += fmt::format("  most f_s/N  unbounded: N = 0 at t = {} s", short_time(x.mu_required_max.time_s));
  } else {
    text += fmt::format("  most f_s/N  {} at t = {} s", short_number(x.mu_required_max.value),
                        short_time(x.mu_required_max.time_s));
    if (std::isfinite(scenario.surface.static_friction)) {
      text += fmt::format(" (this floor gives mu_s = {}{})", short_number(scenario.surface.static_friction),
                          patches_text(scenario.surface));
    }
  }
  if (result.end_reason != EndReason::kCompleted) {
    text += "; the lines below are about the run up to its end";
  } else if (result.rolling_lost) {
    text += "; rolling was lost: the lines below are about the run up to then";
  }
  std::string holds_on, slips_on;
  const auto floors = floor_verdicts(scenario, result);
  for (const FloorVerdict& floor : floors) {
    std::string& list = floor.holds ? holds_on : slips_on;
    list += fmt::format("{}{} {}", list.empty() ? "" : ", ", floor.name, short_number(floor.static_friction));
  }
  if (!floors.empty()) text += "\n  rolls on    " + (holds_on.empty() ? "none of the paper's floors" : holds_on);
  if (!slips_on.empty()) text += "\n  not on      " + slips_on;
  return text + "\n  in short    " + required_friction_text(result, floors) + "\n";
}

std::string published_lines(const sim::Scenario& scenario, const RunResult& result) {
  std::string text;
  for (const auto& published : scenario.published) {
    // A run that ended early has not reached the published extremum.
    if (result.end_reason != EndReason::kCompleted && published.quantity != "end.time") continue;
    const double here = measured(result, published.quantity);
    // With as many digits as were published, so that the difference shows.
    const std::string value = sim::number_text(published.value);
    const std::size_t first = value.find_first_of("123456789");
    const auto digits = std::count_if(value.begin() + static_cast<std::ptrdiff_t>(std::min(first, value.size())),
                                      value.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
    text += fmt::format(
        "  published   {} = {} ({}); here {}\n", published.quantity, value, published.source,
        std::isfinite(here) ? program::significant(here, std::max(3, static_cast<int>(digits))) : "unbounded");
  }
  return text;
}

std::string step_lines(const sim::Scenario& scenario, const RunResult& result) {
  std::string text;
  if (has_controller(scenario.run.actuation)) {
    std::string issued;
    std::int64_t lost = 0, slips = 0;
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      issued += fmt::format("{}{}", i == 0 ? "" : " + ", result.motors[i].steps);
      lost += result.final_sample.lost_steps[i];
      slips += result.motors[i].slips;
    }
    const bool ideal = scenario.run.actuation == sim::Actuation::kIdeal;
    text += fmt::format("  steps       {} issued, {}", issued.empty() ? "0" : issued,
                        ideal ? "none needed: the masses are ideal" : fmt::format("{} lost", lost));
    if (slips > 0) text += fmt::format(" ({} slips, both directions counted)", slips);
    text += "\n";
  }
  for (const std::string& warning : warnings_of_masses(scenario, result)) text += "  WARNING     " + warning + "\n";
  if (!result.step_timing) return text;
  const CheckedSteps sums = checked_steps(*result.step_timing);
  text += fmt::format("  step timing {} steps checked, the worst {} us from its crossing (allowed {})", sums.checked,
                      short_number(sums.max_error_us), short_number(sums.tolerance_us));
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
      text += fmt::format("  motors      least torque margin {} %", program::fixed_number(100 * margin, 0));
    } else if (margin < 0) {
      text += fmt::format("  motors      not simulated; this motion needs {} times the torque they have",
                          short_number(1 - margin));
    } else {
      text += fmt::format("  motors      not simulated; this motion leaves {} % of their torque",
                          program::fixed_number(100 * margin, 0));
    }
    if (electrical_j != 0) {
      text += fmt::format("; {} J from the supply, {} J of it heat in the windings", short_number(electrical_j),
                          short_number(copper_j));
    }
    text += "\n";
  }
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::EndStopRecord& stop = result.end_stops[i];
    if (stop.touches == 0) continue;
    text += fmt::format("  end stop    mass {} touched it first at t = {} s (touches: {}), pushed back by up to {} N\n",
                        i, short_time(stop.first_s), stop.touches, short_number(stop.max_force_n));
  }
  return text;
}

std::string share_line(const MotorShare& share) {
  if (!share.seen()) return "";
  const auto part = [](const Deviation& d) {
    return std::isfinite(d.difference()) ? short_number(std::abs(d.difference())) : "any bound";
  };
  const double commanded = share.commanded_mu_required_max.value;
  return fmt::format(
      "  share       the motors change N by up to {} N, f_s by {} N, f_s/N by {}; commanded most f_s/N {}\n",
      part(share.normal_force_n), part(share.static_friction_n), part(share.mu_required),
      std::isfinite(commanded) ? short_number(commanded) : "unbounded");
}

std::string bus_line(const RefusedMessages& refused) {
  if (refused.here.refused() + refused.by_controller == 0) return "";
  return fmt::format(
      "  bus         messages not used: {} malformed, {} of another run, {} repeated, {} old, {} dropped; by the "
      "controller {}\n",
      refused.here.malformed, refused.here.foreign, refused.here.repeated, refused.here.old, refused.here.dropped,
      refused.by_controller);
}

// The effect of the difference between belief and truth.
std::string belief_lines(const sim::Scenario& scenario, const RunResult& result) {
  if (!scenario.believed || !result.belief) return "";
  // Patches alone leave a belief without them. With prescribed masses nobody acts by it.
  if (!scenario.belief_is_written && !has_controller(scenario.run.actuation)) return "";
  const BeliefPrediction& p = *result.belief;
  const Eigen::Vector3d &at = p.position_W_m, &real = result.final_sample.position_W_m;
  const double mu = p.extrema.mu_required_max.value;
  const bool motors = scenario.run.actuation == sim::Actuation::kStepper;
  std::string text = fmt::format(
      "  believed    {}{} would have needed f_s/N of {}, with least N {} N, and come to ({}, {}) m",
      scenario.belief_is_written ? "the believed robot" : "the robot on the floor without patches, as is believed",
      motors ? ", its masses as commanded and without their motors' swing," : "",
      std::isfinite(mu) ? short_number(mu) : "no bound", short_number(p.extrema.normal_force_min.value),
      short_number(at[0]), short_number(at[1]));
  if (p.end != sim::PhysicsEnd::kNone) {
    return text + fmt::format(", where it would have stopped rolling at t = {} s\n", short_time(p.time_s));
  }
  if (p.time_s < result.final_sample.time_s) {
    return text +
           fmt::format(" at t = {} s, after which the controller's command is not known\n", short_time(p.time_s));
  }
  return text + fmt::format("; the real one is {} m from there\n", short_number((real - at).norm()));
}

// The controller's estimate beside the truth.
std::string estimate_line(const sim::Scenario& scenario, const RunResult& result) {
  if (!result.estimate) return "";
  const EstimateErrors& e = *result.estimate;
  const double nothing_m = 1e-4 * scenario.ball.radius_m, degrees = 180 / std::numbers::pi;
  const Eigen::Vector3d& real = result.final_sample.position_W_m;
  std::string text = fmt::format(
      "  estimate    at the end ({}, {}) m, in truth ({}, {}) m; rms errors {} m and {} degrees of tilt; at the end {} "
      "degrees of heading, {} degrees/s of the gyro's bias",
      short_number(e.position_W_m[0], nothing_m), short_number(e.position_W_m[1], nothing_m),
      short_number(real[0], nothing_m), short_number(real[1], nothing_m), short_number(e.position_rms_m),
      short_number(degrees * e.tilt_rms_rad), short_number(degrees * e.yaw_error_rad),
      short_number(degrees * e.gyro_bias_error_radps));
  if (e.friction_rms) {
    text += fmt::format("; measured f_s/N off by {} rms, {} at most", short_number(*e.friction_rms),
                        short_number(*e.friction_error));
  }
  return text + "\n";
}

std::string speed_line(const sim::Scenario& scenario, const RunResult& result) {
  const double simulated_s = scenario.run.hold_s + result.final_sample.time_s;
  const double speed = simulated_s / std::max(result.wall_time_s, 1e-9);
  std::string text = "  speed       " + short_number(speed) + " times real time";
  if (result.ticks > 0) {
    const auto ticks = static_cast<double>(result.ticks + scenario.run.hold_ticks());
    text += fmt::format(", {} us per tick", short_number(1e6 * result.wall_time_s / ticks));
  }
  // A pace counts as kept if the lateness is too small for a person to notice.
  if (result.asked_speed > 0 && speed < 0.95 * result.asked_speed &&
      result.wall_time_s > simulated_s / result.asked_speed + 0.2) {
    text += fmt::format("; it was to be {}, which was not kept", short_number(result.asked_speed));
  }
  return text + "\n";
}

}  // namespace

std::string summary_text(const sim::Scenario& scenario, const RunResult& result,
                         const std::filesystem::path& directory) {
  std::string text = fmt::format("{}, {} masses\n", scenario.name, masses_word(scenario.run.actuation));
  text += "  ended       " + end_text(scenario, result) + "\n";
  text += travel_line(scenario, result);
  text += goal_line(scenario, result);
  text += tracking_line(scenario, result);
  text += courses_line(result);
  text += governor_line(result);
  text += coast_line(scenario, result);
  text += fault_lines(scenario, result);
  text += regime_lines(result);
  text += "  trip        " + trip_text(scenario, result) + "\n";
  text += plan_lines(scenario, result);
  text += friction_lines(scenario, result);
  text += published_lines(scenario, result);
  text += step_lines(scenario, result);
  text += motor_lines(scenario, result);
  text += belief_lines(scenario, result);
  text += share_line(result.motor_share);
  text += estimate_line(scenario, result);
  text += bus_line(result.refused);
  text += speed_line(scenario, result);
  return text + "  results     " + directory.string() + "\n";
}

}  // namespace ballast::sil
