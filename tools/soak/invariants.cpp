#include "tools/soak/invariants.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>

#include "firmware/governor/governor.h"
#include "firmware/safety/fault.h"
#include "hal/lcm/channels.h"
#include "hal/lcm/encode.h"
#include "tools/program/program.h"
#include "tools/recording/log_reader.h"
#include "tools/soak/bounds.h"
#include "tools/soak/mode_rules.h"
#include "tools/soak/plant_rules.h"
#include "tools/summary/summary.h"

namespace ballast::soak {

namespace {

constexpr InvariantText kTexts[kInvariantCount] = {
    {"detected",
     "An envelope violation of the true ball trips monitor or controller in the tick at whose end it shows; one "
     "tick later at most if messages or peers are disturbed. A violation is N <= min_normal_force, f_s > "
     "friction_use mu_s N, sliding after rolling, or a loss of rolling that ends the run. Not checked while both "
     "are silent: the motors then stand."},
    {"no_false_alarm",
     "The monitor trips only in a tick in which the true ball is outside the envelope, or for what an injected fault "
     "does at that time. The controller trips only after the monitor, for a mass that is commanded on over a closed "
     "end switch, for steps that its motor cannot make, or for such a fault; for a slip or a light ball that it "
     "measures, only after a slide, a flight or a fault, under a force that it is not told of, or where masses have "
     "lost steps or swing by more than 4 % of N, for a light ball by more than a quarter of N; for a slip also on a "
     "floor with patches that resist otherwise than it is told."},
    {"truthful",
     "A trip has the cause, value, limit and time of the true violation: of the plant's own N and f_s and the "
     "scenario's limits, or of the two estimates that disagree."},
    {"agreed",
     "While the ball rolls and sensors and messages are sound, the controller's N and f_s are the plant's for the "
     "commanded masses and the attitude that the controller senses or estimates, except for rounding. Whatever is "
     "wrong, a difference of more than 5 % of the weight trips the monitor in the next tick."},
    {"in_regime",
     "Every contact message says the regime of the true ball. Where it says rolling, the geometric centre moves as "
     "rolling moves it; the floor gives no more friction than mu_s N, and no force in flight. A run that ends by slip "
     "says sliding in its last message."},
    {"switched",
     "An end switch is closed exactly while the true mass is at or beyond that end of its rail. A controller that gets "
     "it closed, and commands the mass on over that end, has the end-switch fault in the same tick."},
    {"obeyed",
     "A controller that receives a trip is tripped in the same tick, or was never armed; two ticks later if the "
     "verdict does not reach it. It changes its mode only for a fault, for a command that allows it, or when a motion "
     "is complete."},
    {"latched",
     "A trip keeps its cause, tick, value and limit to the end. Every fault trips an armed controller; a tripped one "
     "keeps its faults and is released only by a reset at rest with the cause gone. If a restarted peer forgets them, "
     "the run ends in that tick with a reason."},
    {"at_rest",
     "A stop takes no longer than the motors' limits need, the commanded masses rest when the stop said they would, "
     "and no pulse follows. After a trip the true masses are then at the commanded positions, or the run reports why "
     "not: slips, lost or undelivered steps, an end stop, an early end."},
    {"logged",
     "The log contains every message of every tick up to the last, in order and byte for byte, and can be read."},
    {"ended",
     "The run ends with a defined reason and exit status. Status 0 means that nothing tripped and the true ball "
     "stayed inside the envelope."},
    {"finite",
     "No published value is NaN or infinite unless its .lcm file allows it. From sensors that are NaN or corrupted, "
     "or before there is an estimate of the attitude, the controller's N is NaN; f_s / N is then +infinity and the "
     "margin -1."},
    {"in_order",
     "Ticks count up by one, every message belongs to its tick, and pulses, positions and counts of the steps agree."},
    {"patient", "No run has more ticks than its duration, and none exceeds the limit of wall-clock time."},
    {"repeatable", "The same seed gives the same log, byte for byte (checked for one seed in 32)."},
    {"governed",
     "While the governor commands ideal masses of a rolling ball, on a floor and under forces that it is told of, with "
     "ideal sensors and before any fault, and what it believes is true or off by less than control.belief_error, the "
     "true ball keeps f_s <= friction_use mu_s N of envelope and control, and "
     "a stop is certified: for ever, or up to a tick that is still to come."},
    {"halted",
     "A halt that such a run says will take T seconds ends with the ball at rest, at the latest 2 T + 2 s after its "
     "beginning."},
};

// Parts of N by which real and commanded forces may differ where slip is told truly, and where a light ball is.
constexpr double kMostSwing = 0.04, kMostSwingOfLight = 0.25;

// The belief is the truth, or masses, inertia and centre of mass are off by no more than control.belief_error.
bool declared(const sim::Scenario& scenario) {
  if (!scenario.believed) return true;
  constexpr double kRounding = 1e-12;
  const sim::World& believed = *scenario.believed;
  const auto& error = scenario.control.belief_error;
  const auto near = [&](double truth, double belief) {
    return std::abs(truth - belief) <= (error.mass_share + kRounding) * belief;
  };
  const sim::Surface &floor = scenario.surface, &other = believed.surface;
  if (floor.static_friction != other.static_friction || floor.rolling_resistance != other.rolling_resistance ||
      floor.spin_friction_m != other.spin_friction_m || floor.slope_rad != other.slope_rad ||
      floor.downhill_rad != other.downhill_rad || scenario.ball.radius_m != believed.ball.radius_m) {
    return false;
  }
  bool inside = near(scenario.ball.mass_kg, believed.ball.mass_kg);
  const Eigen::Vector3d off = scenario.ball.center_of_mass_B_m - believed.ball.center_of_mass_B_m;
  inside &= off.cwiseAbs().maxCoeff() <= error.center_of_mass_m + kRounding * scenario.ball.radius_m;
  for (int k = 0; k < 3; ++k) inside &= near(scenario.ball.inertia_kgm2[k], believed.ball.inertia_kgm2[k]);
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    inside &= near(scenario.masses[i].mass_kg, believed.masses[i].mass_kg);
  }
  return inside;
}

constexpr std::uint64_t kHashSeed = 0xcbf29ce484222325;

// As in FNV-1a, but for a word of 8 bytes. The shift brings the high bits of the product into the next.
std::uint64_t mix(std::uint64_t sum, std::uint64_t word) {
  const std::uint64_t product = (sum ^ word) * 0x9e3779b97f4a7c15;
  return product ^ (product >> 32);
}

// Four sums that do not wait for each other; the last words are filled up with zeros.
std::uint64_t hash_of(std::int64_t number, std::int64_t utime, const std::vector<char>& bytes) {
  std::array<std::uint64_t, 4> sums{kHashSeed, static_cast<std::uint64_t>(number), static_cast<std::uint64_t>(utime),
                                    bytes.size()};
  std::array<std::uint64_t, 4> words{};
  for (std::size_t at = 0; at < bytes.size(); at += sizeof words) {
    words.fill(0);
    std::memcpy(words.data(), &bytes[at], std::min(sizeof words, bytes.size() - at));
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] = mix(sums[k], words[k]);
  }
  return mix(mix(mix(sums[0], sums[1]), sums[2]), sums[3]);
}

// Equal, infinities too, or within this part of the greater.
bool near(double a, double b, double part) {
  return a == b ||
         (std::isfinite(a) && std::isfinite(b) && std::abs(a - b) <= part * std::max(std::abs(a), std::abs(b)));
}

// Whether f_s / N is finite or +infinity, which the .lcm files allow where N <= 0.
bool ratio(double value) { return std::isfinite(value) || value > 0; }

bool finite(const double* values, std::size_t count) {
  return std::all_of(values, values + count, [](double value) { return std::isfinite(value); });
}

template <std::size_t n>
bool finite(const double (&values)[n]) {
  return finite(values, n);
}

// A rotor further than a tooth from its field is held by another tooth.
bool astray(const sim::Scenario& scenario, std::size_t i, const sim::Plant::Sample& truth,
            const controller_status_t& status) {
  const sim::Motor& motor = scenario.masses[i].motor;
  const double tooth = 2 * std::numbers::pi * 4 / motor.steps_per_revolution / motor.shaft_ratio;
  return std::abs(truth.mass_position[i] - status.commanded_position[i]) > tooth;
}

template <class... Values>
bool all_finite(Values... values) {
  return (std::isfinite(values) && ...);
}

}  // namespace

const InvariantText& text_of(Invariant invariant) { return kTexts[static_cast<std::size_t>(invariant)]; }

Invariants::Invariants(const sim::Scenario& scenario)
    : scenario_(scenario),
      has_controller_(sim::has_controller(scenario.run.actuation)),
      windows_(scenario),
      // Hold and countdown; the first and the last tick add one, and rounding of the division another.
      most_laps_(static_cast<std::int64_t>(std::ceil(scenario.duration_s / scenario.run.control_period_s)) +
                 scenario.run.lead_ticks() + 2),
      starts_rolling_(!scenario.initial.has_velocity && scenario.initial.height_m == 0),
      has_rolled_(starts_rolling_) {}

bool Invariants::has_fault(sim::FaultKind kind) const {
  return std::ranges::any_of(scenario_.faults, [kind](const sim::Fault& fault) { return fault.kind == kind; });
}

void Invariants::fail(Invariant invariant, std::int64_t tick, const std::string& text) {
  for (const Broken& known : broken_) {
    if (known.invariant == invariant) return;
  }
  broken_.push_back({invariant, tick, text});
}

void Invariants::observe(const sil::Lap& lap, const Sample& truth) {
  for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
    const auto& rail = scenario_.masses[i].rail;
    const double lever = rail.shape == firmware::RailShape::kCircle ? rail.radius_m : 1;
    top_speed_mps_ = std::max(top_speed_mps_, lever * std::abs(truth.mass_velocity[i]));
  }
  if (lap.command) commands_.push_back(*lap.command);
  commands_.insert(commands_.end(), lap.heard.begin(), lap.heard.end());
  check_order(lap);
  note_disturbances(lap, truth);
  check_finite(lap);
  if (lap.verdict) check_verdict(lap);
  check_regime(lap, truth);
  check_switches(lap, truth);
  if (scenario_.sensors.attitude_estimated) compare_forces(lap);
  if (has_controller_ && lap.answer) {
    check_steps(lap);
    check_obeyed(lap);
    check_modes(lap);
    check_stop(lap, truth);
    check_controllers_alarm(lap);
    check_governed(lap, truth);
    has_status_ = true;
    status_ = lap.answer->status;
  }
  check_envelope(lap, truth);
  if (trip_.tripped != 0 && first_trip_tick_ == tick_) {
    check_monitors_alarm(truth);
    check_trip(lap, truth);
  }
  if (has_controller_) check_agreement(lap);
  if (has_controller_ && !scenario_.sensors.attitude_estimated) compare_forces(lap);
  expect_in_log(lap);
  truth_ = truth;
  if (++laps_ == most_laps_ + 1) {
    fail(Invariant::kPatient, tick_,
         fmt::format("the run has had {} ticks and goes on; {:g} s have at most {}", laps_, scenario_.duration_s,
                     most_laps_));
  }
}

void Invariants::note_disturbances(const sil::Lap& lap, const Sample& truth) {
  const double now_s = static_cast<double>(tick_) * scenario_.run.control_period_s;
  disturbed_ = disturbed_ || bus_faults_active_ ||
               std::ranges::any_of(scenario_.faults, [&](const sim::Fault& fault) { return fault.begun(now_s); });
  const contact_t& contact = lap.plant.contact;
  has_slid_ = has_slid_ || contact.regime != contact_t::REGIME_ROLLING;
  // Masses that swing so hard in their motors are not where the firmware takes them to be.
  const double swing_n = std::max(std::abs(contact.normal_force_n - contact.commanded_normal_force_n),
                                  std::abs(contact.static_friction_n - contact.commanded_static_friction_n));
  most_swing_ = std::max(most_swing_, swing_n / contact.commanded_normal_force_n);  // keeps its value beside a NaN
  if (!has_controller_ || !lap.answer) return;
  const controller_status_t& status = lap.answer->status;
  no_estimate_ = no_estimate_ || (status.faults & static_cast<int>(firmware::Fault::kNoEstimate)) != 0;
  for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
    disturbed_ = disturbed_ || astray(scenario_, i, truth, status);
  }
}

void Invariants::check_order(const sil::Lap& lap) {
  const contact_t& contact = lap.plant.contact;
  const std::int64_t tick = contact.tick;
  if (laps_ == 0) {
    // With the hold or the countdown, but there is none if the ball cannot be set down.
    if (contact.tick != scenario_.run.first_tick() && contact.tick != 0)
      fail(Invariant::kInOrder, contact.tick, fmt::format("the first tick is {}", tick));
  } else if (contact.tick != tick_ + 1) {
    fail(Invariant::kInOrder, contact.tick, fmt::format("tick {} after {}", tick, tick_));
  }
  tick_ = contact.tick;
  bus_faults_active_ = windows_.bus(tick_);
  if (has_ended_) fail(Invariant::kInOrder, tick_, "the tick before said that it was the last");
  has_ended_ = contact.last != 0;
  const auto due = [&](const char* what, std::int64_t is, std::int64_t should_be) {
    if (is == should_be) return;
    fail(Invariant::kInOrder, tick_, fmt::format("{} is {} where {} is due", what, is, should_be));
  };
  due("the plant state's tick", lap.plant.state.tick, tick_);
  due("the sensors' tick", lap.plant.sensors.tick, tick_);
  if (lap.verdict && !bus_faults_active_) due("the verdict's tick", lap.verdict->tick, tick_);
  due("the sensors' scenario_id", lap.plant.sensors.scenario_id, scenario_.id);
  due("the plant state's last", lap.plant.state.last, contact.last);
  due("the sensors' last", lap.plant.sensors.last, contact.last);
  const double tick_s =
      std::clamp(static_cast<double>(tick_) * scenario_.run.control_period_s, 0.0, scenario_.duration_s);
  if (contact.time_s != tick_s && !has_ended_) {
    fail(Invariant::kInOrder, tick_,
         fmt::format("tick at t = {:.17g} s where {:.17g} s is due", contact.time_s, tick_s));
  }
  if (!has_controller_ || !lap.answer) return;
  due("the status's scenario_id", lap.answer->status.scenario_id, scenario_.id);
  due("the step command's tick", lap.answer->steps.tick, lap.answer->status.tick + 1);
  if (!bus_faults_active_) {
    due("the status's tick", lap.answer->status.tick, tick_);
  } else if (lap.answer->status.tick > tick_) {
    fail(Invariant::kInOrder, tick_,
         fmt::format("a status of tick {}, which is still to come", lap.answer->status.tick));
  }
}

void Invariants::check_steps(const sil::Lap& lap) {
  std::array<std::int64_t, sim::kMaxMasses> sum{}, pulses{};
  for (int b = 0; b < lap.answer->steps.burst_count; ++b) {
    const auto motor = static_cast<std::size_t>(lap.answer->steps.motor[b]);
    sum[motor] += static_cast<std::int64_t>(lap.answer->steps.direction[b]) * lap.answer->steps.count[b];
    pulses[motor] += lap.answer->steps.count[b];
  }
  // After a restart, or if commands of several ticks arrive at once, only the latest command is known.
  const bool goes_on = has_status_ && lap.answer->status.tick == status_.tick + 1 &&
                       lap.answer->status.operator_commands >= status_.operator_commands;
  for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
    if (!goes_on) {
      position_steps_[i] = lap.answer->steps.position_steps[i] - sum[i];
      steps_issued_[i] = lap.answer->status.steps_issued[i] - pulses[i];
    }
    position_steps_[i] += sum[i];
    steps_issued_[i] += pulses[i];
    if (lap.answer->steps.steps[i] != sum[i] || lap.answer->steps.position_steps[i] != position_steps_[i] ||
        lap.answer->status.steps_issued[i] != steps_issued_[i]) {
      fail(Invariant::kInOrder, tick_,
           fmt::format("motor {}: the bursts' sum {}, position {} and count {} are said to be {}, {} and {}", i, sum[i],
                       position_steps_[i], steps_issued_[i], lap.answer->steps.steps[i],
                       lap.answer->steps.position_steps[i], lap.answer->status.steps_issued[i]));
    }
  }
}

void Invariants::check_finite(const sil::Lap& lap) {
  const auto check = [&](bool good, const char* what) {
    if (!good) fail(Invariant::kFinite, tick_, fmt::format("{} has a number that is not finite", what));
  };
  const contact_t& contact = lap.plant.contact;
  check(all_finite(contact.time_s, contact.normal_force_n, contact.static_friction_n, contact.margin,
                   contact.normal_force_min_n) &&
            finite(contact.friction_force_W_n) && ratio(contact.mu_required) && ratio(contact.mu_required_max),
        "contact_t");
  const bool commanded = all_finite(contact.commanded_normal_force_n, contact.commanded_static_friction_n) &&
                         ratio(contact.commanded_mu_required);
  // The step commands of the tick before give them. A sliding ball may have none (Painleve's paradox).
  // For an estimated attitude there are none where the ball does not roll, or there was no estimate.
  const bool may_have_none = contact.regime == contact_t::REGIME_SLIDING ||
                             (scenario_.sensors.attitude_estimated && contact.regime != contact_t::REGIME_ROLLING) ||
                             (scenario_.sensors.attitude_estimated && has_status_ && status_.estimate_valid == 0);
  const bool none_due =
      !has_controller_ || tick_ < 0 || laps_ == 0 || contact.last != 0 || may_have_none || bus_faults_active_;
  check(commanded || (none_due && std::isnan(contact.commanded_normal_force_n) &&
                      std::isnan(contact.commanded_static_friction_n) && std::isnan(contact.commanded_mu_required)),
        "commanded_ of contact_t");

  const plant_state_t& state = lap.plant.state;
  bool masses = true;
  for (const auto& position : state.mass_position_B_m) masses = masses && finite(position);
  check(masses && std::isfinite(state.time_s) && finite(state.orientation) && finite(state.angular_velocity_B_radps) &&
            finite(state.position_W_m) && finite(state.velocity_W_mps) && finite(state.center_of_mass_B_m) &&
            finite(state.mass_position) && finite(state.mass_velocity) && finite(state.motor_torque_nm),
        "plant_state_t");
  const sensors_t& sensors = lap.plant.sensors;
  // A message of sensors that give NaN is the fault itself.
  const bool good_sensors =
      finite(sensors.orientation) && finite(sensors.gyro_B_radps) && finite(sensors.accelerometer_B_mps2);
  check(good_sensors || has_fault(sim::FaultKind::kSensorNan), "sensors_t");
  if (lap.verdict) {
    // On a floor of perfect friction f_s / N has no limit, but the ball may slip if rolling is impossible.
    const bool no_limit = lap.verdict->cause == trip_t::CAUSE_FRICTION && std::isinf(scenario_.surface.static_friction);
    check(std::isfinite(lap.verdict->trip_time_s) && ratio(lap.verdict->value) &&
              (std::isfinite(lap.verdict->limit) || (no_limit && lap.verdict->limit > 0)),
          "trip_t");
  }
  if (!has_controller_ || !lap.answer) return;
  const controller_status_t& status = lap.answer->status;
  check(finite(status.commanded_position) && finite(status.commanded_velocity) && finite(status.next_position) &&
            finite(status.next_velocity) && finite(status.next_acceleration) &&
            all_finite(status.margin, status.overload_value, status.overload_limit, status.refusal_value,
                       status.plan_duration_s, status.plan_horizon_s, status.plan_margin_min) &&
            ratio(status.mu_required) && ratio(status.plan_mu_required_max),
        "controller_status_t");
  check(finite(status.estimated_orientation) && finite(status.estimated_angular_velocity_B_radps) &&
            finite(status.estimated_gyro_bias_B_radps) && finite(status.estimated_position_W_m) &&
            all_finite(status.tilt_sigma_rad, status.yaw_sigma_rad, status.gyro_bias_sigma_radps,
                       status.position_sigma_m) &&
            all_finite(status.measured_normal_force_n, status.measured_normal_sigma_n,
                       status.measured_static_friction_n, status.measured_slip_mps2, status.measured_slip_sigma_mps2) &&
            ratio(status.measured_mu_required) && ratio(status.measured_mu_sigma),
        "an estimated or measured number of controller_status_t");
  // N cannot be estimated from sensors without numbers. f_s / N and the margin then have their worst values.
  // Nor where there is no estimate of the attitude, or none to go by; a prediction of that time stays.
  const bool no_numbers = has_fault(sim::FaultKind::kSensorNan) || has_fault(sim::FaultKind::kMessagesCorrupted) ||
                          no_estimate_ || (scenario_.sensors.attitude_estimated && status.estimate_valid == 0);
  const auto unknown = [&](double mu_required, double margin) {
    return no_numbers && std::isinf(mu_required) && margin == -1;
  };
  check(all_finite(status.normal_force_n, status.static_friction_n) || unknown(status.mu_required, status.margin),
        "the estimate of controller_status_t");
  check(std::isfinite(status.plan_normal_force_min_n) || unknown(status.plan_mu_required_max, status.plan_margin_min),
        "the prediction of controller_status_t");
}

void Invariants::check_envelope(const sil::Lap& lap, const Sample& truth) {
  all_silent_ = !lap.verdict && (!lap.answer || !has_controller_);
  // The norm of the force is computed here instead of taken from the plant. It may differ in the last digits.
  constexpr double kRounding = 1e-12;
  const double friction_n = truth.friction_force_W_n.norm();
  const double least_n = std::min(truth.normal_force_n, truth.normal_force_min_n);
  const double mu_allowed = scenario_.envelope.friction_use * scenario_.surface.static_friction;
  too_light_ = least_n <= scenario_.envelope.min_normal_force_n;
  // The ball may also slide on a floor of perfect friction, where rolling is impossible. A monitor that has been
  // started again only knows how the run started.
  if (windows_.monitor_restarts(tick_)) has_rolled_ = starts_rolling_;
  const bool lost = has_rolled_ && truth.regime == sim::Regime::kSliding;
  has_rolled_ = has_rolled_ || truth.regime == sim::Regime::kRolling;
  const auto slips_with = [&](double allowed) {
    return lost ||
           (std::isfinite(allowed) && (friction_n > allowed * truth.normal_force_n || truth.mu_required_max > allowed));
  };
  outside_within_rounding_ = too_light_ || slips_with(mu_allowed * (1 - kRounding));
  outside_ = too_light_ || slips_with(mu_allowed * (1 + kRounding));
  if (!outside_) {
    undetected_ticks_ = 0;
    return;
  }
  violated_ = true;
  const bool by_controller = has_status_ && (status_.mode == controller_status_t::MODE_TRIPPED || status_.faults != 0);
  const bool detected = monitor_tripped_ || by_controller;
  if (detected || all_silent_) {
    undetected_ticks_ = 0;
    return;
  }
  const std::int64_t allowed = bus_faults_active_ ? 1 : 0;
  if (++undetected_ticks_ > allowed) {
    fail(Invariant::kDetected, tick_,
         fmt::format(
             "N = {:g} N (least {:g}), f_s = {:g} N (most f_s/N {:g}), and no trip; allowed N > {:g}, f_s/N <= {:g}",
             truth.normal_force_n, least_n, friction_n, truth.mu_required_max, scenario_.envelope.min_normal_force_n,
             mu_allowed));
  }
}

// A governed tick of a run whose controller knows all that moves the ball.
bool Invariants::governs_exactly(const sil::Lap& lap) const {
  if (!has_status_ || status_.governed == 0 || lap.answer->status.governed == 0) return false;
  const bool untold = !scenario_.force_table.times_s.empty() || scenario_.drag.coefficient_kgpm > 0 ||
                      !scenario_.surface.patches.empty() || !declared(scenario_);
  const bool exact = scenario_.run.actuation == sim::Actuation::kIdeal && !scenario_.sensors.present && !untold;
  return exact && !has_slid_ && !disturbed_;
}

// The status of the tick before says what is certified from this tick on.
void Invariants::check_governed(const sil::Lap& lap, const Sample& truth) {
  if (!governs_exactly(lap)) return;
  const controller_status_t& status = lap.answer->status;
  if (status.mode == controller_status_t::MODE_HALTING && status.halt_said != 0) {
    const double begun_s = static_cast<double>(status.tick - status.halt_tick) * scenario_.run.control_period_s;
    if (begun_s > 2 * status.halt_duration_s + 2) {
      fail(Invariant::kHalted, tick_,
           fmt::format("the ball is not at rest {:g} s after the beginning of a halt that was to take {:g} s", begun_s,
                       status.halt_duration_s));
    }
  }
  const bool certified = status.backup_margin >= 0 &&
                         (status.backup_until_tick == firmware::kForEverTick || status.backup_until_tick > status.tick);
  if (!certified) {
    fail(Invariant::kGoverned, tick_,
         fmt::format("no stop is certified: margin {:g}, up to tick {}", status.backup_margin,
                     status.backup_until_tick));
  }
  const double allowed =
      scenario_.control.friction_use * scenario_.envelope.friction_use * scenario_.surface.static_friction;
  if (std::isinf(allowed)) return;
  // The greatest of the first tick is also that of the masses at rest, as they are before it.
  const double now = truth.friction_force_W_n.norm() / truth.normal_force_n;
  const double most = tick_ == 0 ? now : std::max(now, truth.mu_required_max);
  if (most <= allowed) return;
  fail(Invariant::kGoverned, tick_,
       fmt::format("the governed ball needs f_s/N = {:.12g}; allowed: {:.12g}", most, allowed));
}

// Whether an injected fault, or the ball itself, is a reason for this cause now.
bool Invariants::explained(const trip_t& trip) const {
  if (windows_.corruption(tick_)) return true;
  switch (trip.cause) {
    case trip_t::CAUSE_NORMAL_FORCE:
    case trip_t::CAUSE_FRICTION:
      return outside_within_rounding_ || (violated_ && bus_faults_active_);  // judged late
    case trip_t::CAUSE_NONFINITE:
      return windows_.nan(tick_);
    case trip_t::CAUSE_STALE:
    case trip_t::CAUSE_MISSING:
    case trip_t::CAUSE_REPEATED:
      return bus_faults_active_;
    case trip_t::CAUSE_DISAGREEMENT:
      return windows_.sensors(tick_) || windows_.push(tick_) || bus_faults_active_;
    default:
      return false;
  }
}

void Invariants::check_monitors_alarm(const Sample& truth) {
  if (outside_within_rounding_ || explained(trip_)) return;
  fail(Invariant::kNoFalseAlarm, tick_,
       fmt::format("the monitor trips (cause {}, value {:g}, limit {:g}) while N = {:g} N (least {:g}), f_s = {:g} N "
                   "(most f_s/N {:g})",
                   trip_.cause, trip_.value, trip_.limit, truth.normal_force_n, truth.normal_force_min_n,
                   truth.friction_force_W_n.norm(), truth.mu_required_max));
}

// The first verdict that has tripped. A message that may be another than the plant's has no truth to be compared with.
void Invariants::check_trip(const sil::Lap& lap, const Sample& truth) {
  if (bus_faults_active_) return;
  const auto due = [&](const char* what, double is, double should_be, double part) {
    if (near(is, should_be, part)) return;
    fail(Invariant::kTruthful, tick_,
         fmt::format("the trip's {} is {:.17g} (cause {}) where {:.17g} is due", what, is, trip_.cause, should_be));
  };
  due("time", trip_.trip_time_s, truth.time_s, 0);
  const double least_n = std::min(truth.normal_force_n, truth.normal_force_min_n);
  // The norm of the force is computed here: some roundings.
  constexpr double kNorm = 1e-9;
  switch (trip_.cause) {
    case trip_t::CAUSE_NORMAL_FORCE:
      due("value", trip_.value, least_n, 0);
      due("limit", trip_.limit, scenario_.envelope.min_normal_force_n, 0);
      break;
    case trip_t::CAUSE_FRICTION:
      due("value", trip_.value, std::max(truth.friction_force_W_n.norm() / truth.normal_force_n, truth.mu_required_max),
          kNorm);
      due("limit", trip_.limit, scenario_.envelope.friction_use * scenario_.surface.static_friction, 0);
      break;
    case trip_t::CAUSE_DISAGREEMENT:
      due("value", trip_.value, apart_tick_ == tick_ - 1 ? apart_n_ : 0, 0);
      due("limit", trip_.limit, disagreement_limit_n(scenario_), kNorm);
      break;
    default:
      due("value", trip_.value, 0, 0);
      due("limit", trip_.limit, 0, 0);
  }
  // The monitor's order: a message with a NaN says nothing; then N; then f_s.
  const sensors_t& sensors = lap.plant.sensors;
  const bool has_numbers =
      finite(sensors.orientation) && finite(sensors.gyro_B_radps) && finite(sensors.accelerometer_B_mps2);
  const std::int8_t cause = !has_numbers ? trip_t::CAUSE_NONFINITE
                            : too_light_ ? trip_t::CAUSE_NORMAL_FORCE
                            : outside_   ? trip_t::CAUSE_FRICTION
                                         : trip_.cause;
  due("cause", trip_.cause, cause, 0);
}

// The controller's own N and f_s beside the plant's, both for the commanded masses and the same attitude: sensed in
// this tick, or estimated in the tick before.
void Invariants::compare_forces(const sil::Lap& lap) {
  const contact_t& contact = lap.plant.contact;
  const bool estimated = scenario_.sensors.attitude_estimated;
  if (estimated ? !has_status_ : !lap.answer) return;
  const controller_status_t& status = estimated ? status_ : lap.answer->status;
  const bool rolls = contact.regime == contact_t::REGIME_ROLLING && contact.commanded_tick == status.tick &&
                     status.tick == (estimated ? tick_ - 1 : tick_) && contact.commanded_normal_force_n > 0;
  if (!rolls) return;
  if (!all_finite(status.normal_force_n, status.static_friction_n, contact.commanded_static_friction_n)) return;
  apart_n_ = std::max(std::abs(contact.commanded_normal_force_n - status.normal_force_n),
                      std::abs(contact.commanded_static_friction_n - status.static_friction_n));
  apart_tick_ = status.tick;
  if (bus_faults_active_ || windows_.sensors(tick_) || windows_.push(tick_)) return;
  const double allowed_n = rounding_n(scenario_, contact.commanded_normal_force_n, contact.commanded_static_friction_n,
                                      status.commanded_velocity, status.next_acceleration);
  if (!(apart_n_ > allowed_n)) return;
  fail(
      Invariant::kAgreed, tick_,
      fmt::format("the controller says N = {:.12g} N, f_s = {:.12g} N where the plant has {:.12g} and {:.12g}; allowed "
                  "difference {:g}",
                  status.normal_force_n, status.static_friction_n, contact.commanded_normal_force_n,
                  contact.commanded_static_friction_n, allowed_n));
}

// The monitor has both forces of the tick before.
void Invariants::check_agreement(const sil::Lap& lap) {
  const double limit_n = disagreement_limit_n(scenario_);
  const bool can_tell = apart_tick_ == tick_ - 1 && lap.verdict && !bus_faults_active_;
  if (!can_tell || apart_n_ <= limit_n || lap.verdict->tripped != 0) return;
  fail(Invariant::kAgreed, tick_,
       fmt::format("plant and controller differ by {:g} N in tick {} and the monitor allows it; allowed {:g} N",
                   apart_n_, apart_tick_, limit_n));
}

void Invariants::check_regime(const sil::Lap& lap, const Sample& truth) {
  regime_ = lap.plant.contact.regime;
  const std::string error = regime_error(scenario_, lap.plant.contact, truth);
  if (!error.empty()) fail(Invariant::kInRegime, tick_, error);
}

void Invariants::check_switches(const sil::Lap& lap, const Sample& truth) {
  for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
    const int is = lap.plant.sensors.limit_switch[i], due = switches_due(scenario_, truth, i);
    if (is == due || windows_.switches(tick_)) continue;
    fail(Invariant::kSwitched, tick_,
         fmt::format("mass {} at {:.17g} has the switches {} where {} is due", i, truth.mass_position[i], is, due));
  }
  // The controller may have got another message while messages are disturbed, this one a few ticks later.
  if (!bus_faults_active_) over_an_end_ = false;
  if (!has_controller_ || !lap.answer) return;
  const bool over_an_end = driven_over_an_end(lap.plant.sensors, lap.answer->status);
  over_an_end_ = over_an_end_ || over_an_end;
  const auto faults = static_cast<std::uint32_t>(lap.answer->status.faults);
  const bool noticed = (faults & static_cast<std::uint32_t>(firmware::Fault::kEndSwitch)) != 0;
  if (!over_an_end || noticed || bus_faults_active_) return;
  fail(Invariant::kSwitched, tick_, "a mass is commanded on over a closed end switch, and the controller has no fault");
}

// Faults that were not there in the tick before.
void Invariants::check_controllers_alarm(const sil::Lap& lap) {
  using firmware::Fault;
  const controller_status_t& status = lap.answer->status;
  const auto before = has_status_ ? static_cast<std::uint32_t>(status_.faults) : 0u;
  const auto faults = static_cast<std::uint32_t>(status.faults) & ~before;
  if (faults == 0 || windows_.corruption(tick_)) return;
  std::uint32_t known = 0;
  const auto explain = [&known](Fault fault, bool reason) {
    if (reason) known |= static_cast<std::uint32_t>(fault);
  };
  explain(Fault::kMonitorTrip, monitor_tripped_ || (trip_.tripped != 0 && bus_faults_active_));
  explain(Fault::kEndSwitch, over_an_end_);
  explain(Fault::kStepOverload, overload_possible(scenario_, status));
  explain(Fault::kSensorNotFinite, windows_.nan(tick_));
  // Filters remember what has disturbed them.
  // The firmware is told of neither force table nor drag, and takes them for the floor's. Nor of patches, whose
  // resistance turns the ball as a slip does.
  const bool untold = !scenario_.force_table.times_s.empty() || scenario_.drag.coefficient_kgpm > 0;
  const bool resisted = std::ranges::any_of(scenario_.surface.patches, [&](const sim::SurfacePatch& patch) {
    return patch.rolling_resistance != scenario_.belief().surface.rolling_resistance;
  });
  explain(Fault::kSlipMeasured, disturbed_ || has_slid_ || untold || resisted || most_swing_ > kMostSwing);
  explain(Fault::kLightMeasured, disturbed_ || has_slid_ || untold || most_swing_ > kMostSwingOfLight);
  explain(Fault::kNoEstimate, disturbed_);
  for (const Fault fault : {Fault::kSensorStale, Fault::kMonitorStale, Fault::kTickOutOfOrder}) {
    explain(fault, bus_faults_active_);
  }
  if ((faults & ~known) != 0) {
    fail(Invariant::kNoFalseAlarm, tick_,
         fmt::format("the controller has faults 0x{:x}, and nothing explains them", faults & ~known));
  }
}

void Invariants::check_obeyed(const sil::Lap& lap) {
  const std::int8_t mode = lap.answer->status.mode;
  if (!monitor_tripped_ || mode == controller_status_t::MODE_TRIPPED || mode == controller_status_t::MODE_DISARMED)
    return;
  // A verdict is stale when it is two ticks old.
  const std::int64_t late = lap.answer->status.tick - first_trip_tick_;
  if (late < (bus_faults_active_ ? 2 : 0)) return;
  fail(Invariant::kObeyed, tick_,
       fmt::format("the monitor says since tick {} that it has tripped, and the controller is in mode {}",
                   first_trip_tick_, mode));
}

void Invariants::check_verdict(const sil::Lap& lap) {
  const trip_t& trip = *lap.verdict;
  if (trip_.tripped == 0 && trip.tripped != 0) {
    trip_ = trip;
    first_trip_tick_ = tick_;
    if (trip.cause == trip_t::CAUSE_NONE || (trip.trip_tick != tick_ && !bus_faults_active_)) {
      fail(Invariant::kLatched, tick_,
           fmt::format("a trip begins with cause {} and tick {}", trip.cause, trip.trip_tick));
    }
  } else if (trip_.tripped != 0) {
    // The value may be +infinity but not NaN, so it can be compared.
    const bool same = trip.cause == trip_.cause && trip.trip_tick == trip_.trip_tick &&
                      trip.trip_time_s == trip_.trip_time_s && trip.value == trip_.value && trip.limit == trip_.limit;
    // A restarted monitor may find the ball outside again. That second trip is as good as the first, and is kept.
    if (trip.tripped == 1 && (same || windows_.monitor_restarted(tick_))) {
      if (!same) {
        trip_ = trip;
        first_trip_tick_ = tick_;
      }
      monitor_tripped_ = true;
      return;
    }
    const std::string text = fmt::format("the trip of tick {} (cause {}) has become tripped = {}, tick {}, cause {}",
                                         trip_.trip_tick, trip_.cause, trip.tripped, trip.trip_tick, trip.cause);
    if (!reopened_latch_) reopened_latch_ = {Invariant::kLatched, tick_, text};
  }
  monitor_tripped_ = trip.tripped != 0;
}

// The commands that the controller has counted since its last status.
std::vector<operator_t> Invariants::counted_commands(const controller_status_t& status) {
  std::int64_t count = status.operator_commands - (has_status_ ? status_.operator_commands : 0);
  std::vector<operator_t> counted;
  for (; count > 0 && !commands_.empty(); --count) {
    counted.push_back(commands_.front());
    commands_.pop_front();
  }
  return counted;
}

void Invariants::check_modes(const sil::Lap& lap) {
  const controller_status_t& status = lap.answer->status;
  const auto faults = static_cast<std::uint32_t>(status.faults);
  const bool tripped = status.mode == controller_status_t::MODE_TRIPPED;
  const std::vector<operator_t> counted = counted_commands(status);
  const bool restarted = has_status_ && status.operator_commands < status_.operator_commands;
  const bool goes_on = has_status_ && status.tick == status_.tick + 1 && counted.size() <= 1 && !restarted;
  bool released = controller_tripped_ && !tripped;
  if (goes_on) {
    const bool monitor_tripped = !bus_faults_active_ && lap.verdict && lap.verdict->tripped != 0;
    const ModeError error =
        judge({status_, status, counted.empty() ? std::nullopt : std::optional(counted.front()), monitor_tripped});
    if (error != ModeError::kNone) {
      const bool latch = error == ModeError::kFaultWithoutTrip || error == ModeError::kTripReleased;
      fail(latch ? Invariant::kLatched : Invariant::kObeyed, tick_,
           fmt::format("the controller goes from mode {} (faults 0x{:x}) to mode {} (faults 0x{:x}): {}", status_.mode,
                       static_cast<std::uint32_t>(status_.faults), status.mode, faults, to_string(error)));
    }
  } else if (released && std::ranges::none_of(counted, [](const operator_t& command) {
               return command.command == operator_t::COMMAND_RESET;
             })) {
    const std::string text = fmt::format("the controller tripped with faults 0x{:x}, and is in mode {} with 0x{:x}",
                                         faults_, status.mode, faults);
    if (!reopened_latch_) reopened_latch_ = {Invariant::kLatched, tick_, text};
  }
  if (released) faults_ = 0;
  if (tripped && (faults == 0 || (faults & faults_) != faults_)) {
    fail(Invariant::kLatched, tick_,
         fmt::format("the controller tripped with faults 0x{:x}, and now has 0x{:x}", faults_, faults));
  }
  if (tripped) faults_ |= faults;
}

// The plan of the stop gives its end. It is made in the tick of the trip, and again only if its steps are impossible,
// which the controller reports with a fault.
void Invariants::check_stop(const sil::Lap& lap, const Sample& truth) {
  const controller_status_t& status = lap.answer->status;
  controller_tripped_ = status.mode == controller_status_t::MODE_TRIPPED;
  controller_has_tripped_ = controller_has_tripped_ || controller_tripped_;
  const bool begins = !stopping_;
  stopping_ = controller_tripped_ || status.mode == controller_status_t::MODE_STOPPING;
  if (!stopping_) return;
  if (begins) carried_away_ = {};
  const double period_s = scenario_.run.control_period_s;
  const bool planned_now = status.plan_duration_s > 0 && status.plan_tick == status.tick + 1;
  if (planned_now) {
    const double longest_s = longest_stop_s(scenario_, status.next_velocity, status.next_acceleration);
    // A mass whose steps are impossible is halted in the very tick, and the duration is still that of its stop.
    const bool halted = (status.faults & static_cast<int>(firmware::Fault::kStepOverload)) != 0 && !begins;
    // Sums of three durations each.
    if (!halted && status.plan_duration_s > longest_s * (1 + 1e-9)) {
      fail(Invariant::kAtRest, tick_,
           fmt::format("a stop is to take {:g} s; the motors need at most {:g} s", status.plan_duration_s, longest_s));
    }
  }
  if (begins || (planned_now && status.overload_error != 0)) {
    rest_due_tick_ = status.tick + 1;
    double left_s = 0;
    if (planned_now) {
      left_s = status.plan_duration_s;
    } else if (status.at_rest == 0 && status.plan_duration_s > 0) {  // an earlier stop is still going on
      left_s = status.plan_duration_s - static_cast<double>(status.tick + 1 - status.plan_tick) * period_s;
    } else if (status.at_rest == 0) {
      fail(Invariant::kAtRest, tick_, "the controller trips while its masses move, and promises no stop");
    }
    // The end may lie inside a tick. Often it is the start of a tick except for rounding, since a stop out of a ramp
    // takes three times as long as the ramp so far. The next tick is then correct too.
    stop_ticks_ = std::max(left_s, 0.0) / period_s;
    if (left_s > 0) rest_due_tick_ += static_cast<std::int64_t>(std::ceil(stop_ticks_ + 1e-9));
  }
  // `at_rest` is the state at the start of the next tick, whose steps are in the same lap.
  if (status.tick + 1 < rest_due_tick_) return;
  if (status.at_rest == 0) {
    fail(
        Invariant::kAtRest, tick_,
        fmt::format("the commanded masses move on after the stop's promised end, tick {}, {:.12g} ticks after it began",
                    rest_due_tick_, stop_ticks_));
  }
  std::array<std::int64_t, sim::kMaxMasses> pulses{};
  for (int b = 0; b < lap.answer->steps.burst_count; ++b) {
    pulses[static_cast<std::size_t>(lap.answer->steps.motor[b])] += lap.answer->steps.count[b];
  }
  for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
    if ((pulses[i] != 0 || lap.answer->steps.steps[i] != 0) && lap.answer->steps.tick > rest_due_tick_) {
      fail(Invariant::kAtRest, tick_,
           fmt::format("motor {} is sent {} pulses after the stop's promised end, tick {}", i, pulses[i],
                       rest_due_tick_));
    }
    if (status.tick > rest_due_tick_ && astray(scenario_, i, truth, status)) carried_away_[i] = true;
  }
}

void Invariants::expect_in_log(const sil::Lap& lap) {
  const auto expect = [&](const char* channel, const auto& message, std::int64_t utime) {
    bytes_.resize(hal::encoded_size(message));
    hal::encode(message, bytes_.data());
    expected_.push_back({channel, tick_, hash_of(static_cast<std::int64_t>(expected_.size()), utime, bytes_)});
  };
  if (lap.command) expect(hal::kChannelOperator, *lap.command, lap.command->utime);
  for (const operator_t& heard : lap.heard) expect(hal::kChannelOperator, heard, lap.plant.contact.utime);
  expect(hal::kChannelContact, lap.plant.contact, lap.plant.contact.utime);
  expect(hal::kChannelPlantState, lap.plant.state, lap.plant.state.utime);
  expect(hal::kChannelSensors, lap.plant.sensors, lap.plant.sensors.utime);
  if (lap.verdict) expect(hal::kChannelTrip, *lap.verdict, lap.verdict->utime);
  if (!has_controller_ || !lap.answer) return;
  expect(hal::kChannelControllerStatus, lap.answer->status, lap.answer->status.utime);
  expect(hal::kChannelStepCommand, lap.answer->steps, lap.answer->steps.utime);
}

void Invariants::finish(const sil::RunResult& result, const std::string& log_path) {
  if (reopened_latch_ && (result.status == hal::Status::kOk || reopened_latch_->tick != tick_))
    fail(Invariant::kLatched, reopened_latch_->tick, reopened_latch_->text);
  finish_detected(result);
  finish_end(result);
  finish_stop(result);
  read_log(log_path, result.status != hal::Status::kOk && has_fault(sim::FaultKind::kDiskFull));
}

void Invariants::finish_end(const sil::RunResult& result) {
  if (result.status != hal::Status::kOk) {
    const bool has_reason =
        bus_faults_active_ || has_fault(sim::FaultKind::kControllerOverrun) || has_fault(sim::FaultKind::kDiskFull);
    if (!has_reason || result.trouble.empty())
      fail(Invariant::kEnded, tick_, fmt::format("the run broke off: \"{}\"", result.trouble));
    return;
  }
  const bool tripped = result.trip.tripped != 0 || result.controller_trip.has_value();
  bool as_it_says = false;
  switch (result.end_reason) {
    case sil::EndReason::kCompleted:
      as_it_says = result.final_sample.time_s >= scenario_.duration_s * (1 - 1e-12);  // it is a sum of periods
      break;
    case sil::EndReason::kTripped:
      as_it_says = tripped;
      break;
    case sil::EndReason::kSlipped:
    case sil::EndReason::kDetached:
      as_it_says = result.rolling_lost && scenario_.run.on_violation == sim::OnViolation::kStop;
      break;
    case sil::EndReason::kInconsistent:
      as_it_says = !result.end_text.empty();
      break;
    case sil::EndReason::kStepTiming:
      break;  // --check-steps is off
  }
  if (!as_it_says) {
    fail(Invariant::kEnded, tick_,
         fmt::format("it ended as {} at t = {:.17g} s, which is not what happened", to_string(result.end_reason),
                     result.final_sample.time_s));
  }
  if (!has_ended_) fail(Invariant::kEnded, tick_, "the last message does not say that it is the last");
  if (result.end_reason == sil::EndReason::kSlipped && regime_ != contact_t::REGIME_SLIDING) {
    fail(Invariant::kInRegime, tick_,
         fmt::format("the run ended by slip, and its last message says regime {}", regime_));
  }
  const int status = sil::exit_status(result);
  // A slip that begins and ends between two ticks shows in no sample, but the run reports it.
  const int due = violated_ || result.rolling_lost || trip_.tripped != 0 || controller_has_tripped_ ||
                          result.end_reason != sil::EndReason::kCompleted
                      ? program::kExitEnvelope
                      : program::kExitCompleted;
  if (status != due) fail(Invariant::kEnded, tick_, fmt::format("exit status {} where {} is due", status, due));
  if ((result.trip.tripped != 0) != (trip_.tripped != 0) || (result.controller_trip.has_value() && !tripped)) {
    fail(Invariant::kEnded, tick_, "the summary's trip is not the one of the messages");
  }
  const sim::ContactExtrema& x = result.extrema;
  if (!ratio(x.mu_required_max.value) ||
      !all_finite(x.normal_force_min.value, x.normal_force_max.value, x.static_friction_max.value)) {
    fail(Invariant::kFinite, tick_, "the summary's extrema are not finite");
  }
}

// A run that ends because rolling is lost needs a trip, whatever regime the plant reported.
void Invariants::finish_detected(const sil::RunResult& result) {
  const bool lost = result.status == hal::Status::kOk &&
                    (result.end_reason == sil::EndReason::kSlipped || result.end_reason == sil::EndReason::kDetached);
  const bool detected = monitor_tripped_ || (has_status_ && status_.faults != 0);
  // A ball that has never rolled loses nothing. With faulty messages, the trip may be in a message that was lost.
  if (!lost || detected || !has_rolled_ || bus_faults_active_ || all_silent_) return;
  fail(Invariant::kDetected, tick_,
       fmt::format("the run ended as {}, and nobody has tripped", to_string(result.end_reason)));
}

void Invariants::finish_stop(const sil::RunResult& result) {
  if (!controller_tripped_ || result.status != hal::Status::kOk) return;
  // The run may end before the stop does, because rolling is lost or the scenario is over. The controller's latest
  // status is of the start of the next tick.
  if (status_.tick + 1 < rest_due_tick_) {
    if (result.end_reason == sil::EndReason::kTripped)
      fail(Invariant::kAtRest, tick_,
           fmt::format("ended as stopped before the stop's promised end, tick {}", rest_due_tick_));
    return;
  }
  for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
    const bool reported = result.motors[i].slips != 0 || result.final_sample.lost_steps[i] != 0 ||
                          result.motors[i].undelivered_steps != 0 || result.missing_commands != 0 ||
                          result.end_stops[i].touches != 0;
    if (carried_away_[i] && !reported) {
      fail(Invariant::kAtRest, tick_,
           fmt::format("mass {} was not held where the stop had sent it, and nothing that explains it is reported", i));
    }
    if (result.end_reason != sil::EndReason::kTripped || !result.masses_rested) continue;
    // The run calls a mass at rest if it is slower than a twentieth of the greatest speed.
    const auto& rail = scenario_.masses[i].rail;
    const double lever = rail.shape == firmware::RailShape::kCircle ? rail.radius_m : 1;
    if (lever * std::abs(truth_.mass_velocity[i]) > top_speed_mps_ / 20 * (1 + 1e-12)) {
      fail(Invariant::kAtRest, tick_,
           fmt::format("mass {} is said to be at rest, and moves at {:g} m/s of at most {:g}", i,
                       lever * std::abs(truth_.mass_velocity[i]), top_speed_mps_));
    }
  }
}

void Invariants::read_log(const std::string& path, bool cut_short) {
  sil::LogReader reader(path);
  if (!reader.error().empty()) {
    // A run that fails in its first tick has published nothing, and its log is empty.
    const bool empty_log = cut_short ? laps_ <= 1 : laps_ == 0;
    if (!empty_log) fail(Invariant::kLogged, tick_, reader.error());
    return;
  }
  log_hash_ = kHashSeed;
  std::size_t read = 0;
  for (sil::LogEvent event; reader.next(event); ++read) {
    if (read >= expected_.size()) {
      fail(Invariant::kLogged, tick_, fmt::format("the log goes on after the last tick with {}", event.channel));
      return;
    }
    const Logged& due = expected_[read];
    const std::uint64_t hash_here = hash_of(event.number, event.timestamp, event.data);
    log_hash_ = mix(log_hash_, hash_here);
    if (event.channel != due.channel || hash_here != due.hash) {
      fail(Invariant::kLogged, due.tick,
           fmt::format("event {} is {} where this tick's {} is due, or its number or bytes are others", read,
                       event.channel, due.channel));
      return;
    }
  }
  // A full disk has stored every tick but the last, and the run has reported it.
  if (cut_short && read < expected_.size() && expected_[read].tick == tick_) return;
  if (!reader.damage().empty()) {
    fail(Invariant::kLogged, tick_, fmt::format("the log is {}", reader.damage()));
  } else if (read < expected_.size()) {
    fail(Invariant::kLogged, expected_[read].tick,
         fmt::format("the log ends before this tick's {}", expected_[read].channel));
  }
}

}  // namespace ballast::soak
