#include "tools/summary/controller_words.h"

#include <fmt/format.h>

#include <cmath>

#include "hal/lcm/messages.h"
#include "sim/scenario/reader.h"
#include "tools/program/short_number.h"
#include "tools/summary/summary.h"

namespace ballast::sil {

namespace {

using program::short_number;
using program::short_time;

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
  const auto [value, limit] = program::apart(trip.value, trip.limit);
  switch (trip.cause) {
    case trip_t::CAUSE_NORMAL_FORCE:
      return fmt::format(": N was {} N; allowed: > {} N", value, limit);
    case trip_t::CAUSE_FRICTION:
      // A limit just passed, at a located instant, differs from the value only in digits without meaning.
      if (trip.value > trip.limit * (1 + 1e-6)) return fmt::format(": f_s/N was {}; allowed: <= {}", value, limit);
      if (trip.value > trip.limit)
        return fmt::format(": f_s/N came to the allowed {} and grew", short_number(trip.limit));
      return fmt::format(": the ball slid at f_s/N = {}, on a floor that was to hold up to {}", value, limit);
    case trip_t::CAUSE_DISAGREEMENT:
      return fmt::format(
          ": plant and controller, or the plant's own messages, differed by {} N about N and f_s; allowed: <= {} N",
          value, limit);
    case trip_t::CAUSE_MISSING:
    case trip_t::CAUSE_REPEATED:
      return fmt::format(": the newest tick was {:.0f} where {:.0f} was due", trip.value, trip.limit);
    case trip_t::CAUSE_STALE:
      if (trip.value < 0) return ": the controller sent a status of a tick still to come";
      return fmt::format(": silent for {:.0f} ticks; allowed: {:.0f}", trip.value, trip.limit);
    default:
      return "";
  }
}

// The refusal of a later start, which runs the motion from where the masses stand.
std::string restart_text(const controller_status_t& status, const char* what, const char* unit) {
  return fmt::format(
      "mass {}, piece {} of its motion: begun at rest from where it stands, its {} would reach {} {}, more than its "
      "motor's limit",
      status.refusal_motor, status.refusal_piece, what, short_number(status.refusal_value), unit);
}

// The refusal of a move to an end of its rail or beyond.
std::string rail_end_text(const controller_status_t& status, const firmware::MoveRequest* move) {
  const bool lower = status.refusal == controller_status_t::REFUSAL_LOWER_END;
  const auto mass = static_cast<std::size_t>(status.refusal_motor);
  std::string target;
  if (move != nullptr && mass < move->target_position.size()) {
    target = " ";
    target += sim::number_text(move->target_position[mass]);
  }
  // Printed with all digits, so that the value given as allowed is allowed.
  return "mass " + std::to_string(mass) + ": the target" + target + " is beyond the " + (lower ? "lower" : "upper") +
         " end of its rail or too close to it; allowed: at " + (lower ? "least " : "most ") +
         sim::number_text(status.refusal_value) +
         ", which leaves the two full steps that its motor may swing before its end switch";
}

// The commands that the controller obeys now.
const char* allowed_text(const controller_status_t& status) {
  switch (status.mode) {
    case controller_status_t::MODE_DISARMED:
      return "arm, if it is healthy";
    case controller_status_t::MODE_ARMED:
      return "start, move, and stop, which disarms; under the governor also go and halt";
    case controller_status_t::MODE_PENDING:
      return "stop, which takes back what is about to begin";
    case controller_status_t::MODE_RUNNING:
      return status.governed != 0 ? "stop, go and halt"
                                  : "stop; go and halt need a governor, which this run does not have";
    case controller_status_t::MODE_HALTING:
      return "stop; start, move and go once the ball rests";
    case controller_status_t::MODE_TRIPPED:
      return "reset, once the masses rest and the cause is gone";
    case controller_status_t::MODE_STOPPING:
      return "nothing that changes something, until the masses rest";
    default:
      return "stop";
  }
}

// Under a motion that is over, or has a rest, or has just begun from one.
bool all_rest(const controller_status_t& status, const plant_state_t& plant) {
  if (status.mode != controller_status_t::MODE_RUNNING) return false;
  // Feedback leaves masses some speed. A motion that passes a rest has accelerations there.
  constexpr double kStill = 1e-4;     // rail units/s
  constexpr double kSteady = 1e-3;    // rail units/s^2
  constexpr double kRest_mps = 0.01;  // near the halt's 0.01 sqrt(g r); a status does not know the ball
  for (int i = 0; i < status.motor_count; ++i) {
    if (std::abs(status.next_velocity[i]) > kStill || std::abs(status.next_acceleration[i]) > kSteady) return false;
  }
  return std::hypot(plant.velocity_W_mps[0], plant.velocity_W_mps[1]) < kRest_mps;
}

}  // namespace

std::string mode_text(std::int8_t mode) {
  switch (mode) {
    case controller_status_t::MODE_DISARMED:
      return "disarmed";
    case controller_status_t::MODE_ARMED:
      return "armed";
    case controller_status_t::MODE_RUNNING:
      return "running";
    case controller_status_t::MODE_STOPPING:
      return "stopping";
    case controller_status_t::MODE_TRIPPED:
      return "tripped";
    case controller_status_t::MODE_MOVING:
      return "moving";
    case controller_status_t::MODE_PENDING:
      return "about to move";
    case controller_status_t::MODE_HALTING:
      return "halting";
    default:
      return "mode " + std::to_string(mode);
  }
}

std::string verdict_text(const trip_t& trip, const std::string& where) {
  return fmt::format("{} at t = {} s{}{}", trip_cause(trip.cause), short_time(trip.trip_time_s), trip_values_text(trip),
                     where);
}

std::string fault_text(const controller_status_t& status) {
  std::string text = fault_cause(status.faults);
  if (status.overload_error == 0) return text;
  const auto [value, limit] = program::apart(status.overload_value, status.overload_limit);
  return text + fmt::format(": motor {} in tick {}, {} {}, limit {}", status.overload_motor, status.overload_tick,
                            value, overload_unit(status.overload_error), limit);
}

std::string refusal_text(const controller_status_t& status, const firmware::MoveRequest* move) {
  const std::string mass = "mass " + std::to_string(status.refusal_motor) + ": ";
  const std::string value = sim::number_text(status.refusal_value);
  switch (status.refusal) {
    case controller_status_t::REFUSAL_NONE:
      return "";
    case controller_status_t::REFUSAL_NO_MASS:
      return "it names no mass";
    case controller_status_t::REFUSAL_UNKNOWN_MASS:
      return "there is no mass " + value + " (they count from 0)";
    case controller_status_t::REFUSAL_TARGET:
      return mass + "the target " + value +
             " cannot be reached; allowed: finite, at most 1e15 microsteps from its start";
    case controller_status_t::REFUSAL_LOWER_END:
    case controller_status_t::REFUSAL_UPPER_END:
      return rail_end_text(status, move);
    case controller_status_t::REFUSAL_SPEED_FRACTION:
      return "the speed fraction " + value + " is out of range; allowed: 0 < .. <= 1";
    case controller_status_t::REFUSAL_VELOCITY:
      return restart_text(status, "speed", "per s");
    case controller_status_t::REFUSAL_ACCELERATION:
      return restart_text(status, "acceleration", "per s^2");
    case controller_status_t::REFUSAL_JERK:
      return restart_text(status, "jerk", "per s^3");
    case controller_status_t::REFUSAL_RAIL_END:
      return mass + "piece " + std::to_string(status.refusal_piece) +
             " of its motion, begun from where it stands, takes it to " + value + ", beyond the end of its rail";
    case controller_status_t::REFUSAL_NOT_PLANNED:
      return mass + "no profile over the distance " + value + " could be made";
    case controller_status_t::REFUSAL_CANCELLED:
      return "a fault came before it began";
    case controller_status_t::REFUSAL_NO_ESTIMATE:
      return "it has no estimate of its attitude yet: no sample of the IMU has come that it could use";
    case controller_status_t::REFUSAL_NO_BACKUP:
      if (status.refusal_value == 0) return "no stop can be certified: its plan has more bends than can be kept";
      return fmt::format(
          "no stop can be certified: {} s after it began, the ball would need {} % more friction than the governor may "
          "use",
          short_number(status.refusal_time_s), short_number(100 * (status.refusal_value - 1)));
    case controller_status_t::REFUSAL_LIFTS_OFF:
      return fmt::format("no stop can be certified: {} s after it began, N would fall to {} N",
                         short_number(status.refusal_time_s), short_number(status.refusal_value));
    case controller_status_t::REFUSAL_NOT_CERTIFIED:
      if (status.refusal_value > 0) {
        return fmt::format("it takes {} s, and a move of at most {} s can be certified",
                           short_number(status.refusal_value), short_number(status.refusal_time_s));
      }
      return "no stop is certified yet: the ball still rolls, the floor slopes, or the search is under way";
    case controller_status_t::REFUSAL_NO_REST:
      return fmt::format("no rest was found within {} s: the ball would still roll with {} m/s",
                         short_number(status.refusal_time_s), short_number(status.refusal_value));
    case controller_status_t::REFUSAL_COURSE:
      return fmt::format("its value {} is none of a course for this robot, or parts of it are missing",
                         static_cast<long long>(status.refusal_value));
    case controller_status_t::REFUSAL_LATE:
      if (status.refusal_value == 0) return "it says no tick, and only a ball under masses that hold can wait for one";
      return fmt::format("it was not certified by its tick {}: the ball goes on as before",
                         static_cast<long long>(status.refusal_value));
    case controller_status_t::REFUSAL_OFF_COURSE:
      return mass + "it begins " + value + " (or that much per s) from where the mass will be";
    default:
      break;
  }
  std::string text = "it is " + mode_text(status.mode);
  if (status.faults != 0) text += fmt::format(", with faults 0x{:x}", static_cast<unsigned>(status.faults));
  return text + "; allowed now: " + allowed_text(status);
}

std::string refused_text(const std::string& what, const std::string& refusal) {
  return "the controller refuses the " + what + ": " + refusal;
}

std::string status_text(const controller_status_t& status, const plant_state_t* plant) {
  constexpr double kNegligible = 1e-5;  // m, m/s
  const auto number = [](double value) { return short_number(value, kNegligible); };
  std::string ball;
  if (plant != nullptr) {
    const double *place_m = plant->position_W_m, *v_mps = plant->velocity_W_mps;
    ball = fmt::format(", the ball at ({}, {}) m, {} m/s", number(place_m[0]), number(place_m[1]),
                       number(std::hypot(v_mps[0], v_mps[1], v_mps[2])));
  } else if (status.estimate_valid != 0) {
    const double* place_m = status.estimated_position_W_m;
    ball = fmt::format(", the ball at ({}, {}) m as estimated", number(place_m[0]), number(place_m[1]));
  }
  const bool rest = plant != nullptr && all_rest(status, *plant);
  return fmt::format("{}{}, masses {} {} in tick {}{}", mode_text(status.mode), rest ? ", ball and masses at rest" : "",
                     rest                  ? "at"
                     : status.at_rest != 0 ? "at rest at"
                                           : "moving, at",
                     positions_text(status), status.tick, ball);
}

std::string plan_text(const controller_status_t& status) {
  return fmt::format("{} s; {}", short_time(status.plan_duration_s), predicted_text(hal::from_message(status).plan));
}

std::string halt_text(const controller_status_t& status) {
  return fmt::format("halting from tick {}; from there the ball will still roll {:.4g} m, for {:.4g} s",
                     status.halt_tick, status.halt_distance_m, status.halt_duration_s);
}

std::string positions_text(const controller_status_t& status) {
  std::string text;
  for (int i = 0; i < status.motor_count; ++i)
    text += (i == 0 ? "" : ", ") + short_number(status.commanded_position[i]);
  return text;
}

std::string breach_text(const firmware::Prediction& plan, double friction_use, double min_normal_force_n) {
  // The negations make a NaN, from an unknown attitude, a breach too.
  if (!(plan.normal_force_min_n > min_normal_force_n)) {
    const auto [least, allowed] = program::apart(plan.normal_force_min_n, min_normal_force_n);
    return fmt::format("least N {} N; allowed: > {} N", least, allowed);
  }
  if (!(plan.margin_min >= 1 - friction_use)) {
    const auto [least, allowed] = program::apart(plan.margin_min, 1 - friction_use);
    return fmt::format("least margin {} (f_s/N {}); allowed: >= {}", least, short_number(plan.mu_required_max),
                       allowed);
  }
  return "";
}

std::string predicted_text(const firmware::Prediction& plan) {
  if (std::isnan(plan.normal_force_min_n)) {
    return "not predicted: the run ended first, or the sensors gave no valid attitude";
  }
  const bool in_part = plan.horizon_s < plan.duration_s;
  return fmt::format("predicted{}, masses as commanded: least N {} N, most f_s/N {}, least margin {}",
                     in_part ? fmt::format(" for its first {} s", short_number(plan.horizon_s)) : "",
                     short_number(plan.normal_force_min_n), short_number(plan.mu_required_max),
                     short_number(plan.margin_min));
}

std::string far_below_text(const firmware::Prediction& plan, double seen_margin_min) {
  constexpr double kFar = 0.1;  // of the friction cone; sound motors of the shipped robots take less
  if (!(seen_margin_min < plan.margin_min - kFar)) return "";
  return fmt::format(
      "the least margin was {} where {} was predicted: a prediction takes the masses as commanded and leaves out their "
      "motors' swing{}",
      short_number(seen_margin_min), short_number(plan.margin_min),
      plan.horizon_s < plan.duration_s ? ", and this one the move's end" : "");
}

}  // namespace ballast::sil
