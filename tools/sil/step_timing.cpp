#include "tools/sil/step_timing.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace ballast::sil {

namespace {

long double microsteps_per_unit(const sim::Motor& motor) {
  return static_cast<long double>(motor.steps_per_revolution) * motor.microsteps * motor.shaft_ratio /
         (2 * std::numbers::pi_v<long double>);
}

std::vector<stepcheck::Piece> pieces_of(const sim::Mass& mass) {
  std::vector<stepcheck::Piece> pieces;
  for (const auto& piece : mass.motion) {
    pieces.push_back({piece.duration_s, piece.acceleration_start, piece.acceleration_end});
  }
  return pieces;
}

}  // namespace

StepTimingCheck::StepTimingCheck(const sim::Scenario& scenario) : scenario_(scenario) {
  for (const auto& mass : scenario.masses) {
    stepcheck::Drive drive;
    drive.motion.position = mass.initial_position;
    drive.motion.microsteps_per_unit = microsteps_per_unit(mass.motor);
    drive.max_step_rate_hz = mass.motor.max_step_rate_hz;
    drive.direction_setup_s = mass.motor.direction_setup_s;
    drive.timer_frequency_hz = scenario.run.timer_frequency_hz;
    drive.control_period_s = scenario.run.control_period_s;
    checks_.emplace_back(drive);
  }
}

// The scenario's motion, begun at rest from the positions in `stand`; null: begun from the initial state.
std::vector<stepcheck::MotionInSteps> StepTimingCheck::motions(const controller_status_t* stand) const {
  std::vector<stepcheck::MotionInSteps> motions;
  for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
    const sim::Mass& mass = scenario_.masses[i];
    stepcheck::Motion motion;
    motion.position = stand == nullptr ? mass.initial_position : stand->commanded_position[i];
    motion.velocity = stand == nullptr ? mass.initial_velocity : 0;
    motion.from_zero = static_cast<long double>(motion.position) - mass.initial_position;
    motion.microsteps_per_unit = microsteps_per_unit(mass.motor);
    motion.pieces = pieces_of(mass);
    motions.emplace_back(motion);
  }
  return motions;
}

std::vector<stepcheck::MotionInSteps> StepTimingCheck::sampled(const Stretch& plan) const {
  std::vector<stepcheck::MotionInSteps> motions;
  for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
    const sim::Mass& mass = scenario_.masses[i];
    stepcheck::SampledMotion motion;
    for (const controller_status_t& sample : plan.samples) {
      motion.position.push_back(sample.commanded_position[i]);
      motion.velocity.push_back(sample.commanded_velocity[i]);
    }
    if (plan.rests_tick) motion.velocity.back() = 0;
    motion.period_s = scenario_.run.control_period_s;
    motion.max_jerk = mass.motor.max_jerk;
    motion.zero = mass.initial_position;
    motion.microsteps_per_unit = microsteps_per_unit(mass.motor);
    motions.emplace_back(motion);
  }
  return motions;
}

void StepTimingCheck::begin(Kind kind, std::int64_t tick, const controller_status_t& status) {
  stretches_.push_back({kind, tick, false, {}, {}, {}, std::nullopt});
  if (kind == Kind::kMotion) stretches_.back().what = motions(started_ ? &status : nullptr);
  if (kind != Kind::kMotion && !record_.motion_left_tick) record_.motion_left_tick = tick;
  started_ = true;
}

bool StepTimingCheck::check_command(const step_command_t& command) {
  for (std::size_t i = 0; i < checks_.size(); ++i) {
    bursts_.clear();
    for (std::size_t b = 0; b < static_cast<std::size_t>(command.burst_count); ++b) {
      if (command.motor[b] != static_cast<int>(i)) continue;
      bursts_.push_back(
          {command.direction[b], command.count[b], command.first[b], command.interval[b], command.add[b]});
    }
    record_.violation = checks_[i].tick(command.tick, bursts_, command.steps[i], command.position_steps[i]);
    record_.violation_motor = static_cast<int>(i);
    if (record_.violation) return false;
  }
  return true;
}

// Checks the stretch's commands so far.
bool StepTimingCheck::check(Stretch& stretch) {
  if (!stretch.followed) {
    stretch.followed = true;
    for (std::size_t i = 0; i < checks_.size(); ++i) {
      if (stretch.kind == Kind::kUnknown) {
        checks_[i].leave_motion();
      } else {
        checks_[i].follow(stretch.start_tick, stretch.what[i]);
      }
    }
  }
  const auto steps_now = [this] {
    std::int64_t sum = 0;
    for (const auto& check : checks_) sum += check.statistics().checked_steps;
    return sum;
  };
  const std::int64_t before = steps_now();
  for (const step_command_t& command : stretch.commands) {
    if (!check_command(command)) return false;
  }
  stretch.commands.clear();
  if (stretch.kind == Kind::kPlan) record_.plan_steps += steps_now() - before;
  return true;
}

bool StepTimingCheck::observe(const controller_status_t& status, const step_command_t& steps) {
  if (steps.tick < 0) {  // the countdown, in which nothing may move
    mode_ = status.mode;
    return check_command(steps);
  }
  for (std::size_t s = 0; s < stretches_.size(); ++s) {
    Stretch& stretch = stretches_[s];
    const bool over = s + 1 < stretches_.size() && stretches_[s + 1].start_tick < status.tick;
    if (stretch.kind == Kind::kPlan && status.tick >= stretch.start_tick && stretch.what.empty() && !over) {
      stretch.samples.push_back(status);
    }
  }
  const bool overload =
      (static_cast<std::uint32_t>(status.faults) & static_cast<std::uint32_t>(firmware::Fault::kStepOverload)) != 0;
  if (overload && !overloaded_) {
    begin(Kind::kUnknown, steps.tick, status);
  } else if (status.plan_duration_s > 0 && status.plan_tick == steps.tick) {
    begin(Kind::kPlan, steps.tick, status);
  } else if (status.mode == controller_status_t::MODE_RUNNING && mode_ != controller_status_t::MODE_RUNNING) {
    // The pulses of a tracked motion may wait for their distance.
    begin(scenario_.control.tracking && !started_ ? Kind::kUnknown : Kind::kMotion, steps.tick, status);
  }
  overloaded_ = overload;
  mode_ = status.mode;
  if (stretches_.empty()) return check_command(steps);  // nothing has begun: at rest
  Stretch& newest = stretches_.back();
  newest.commands.push_back(steps);
  if (newest.kind == Kind::kPlan && status.at_rest != 0 && !newest.rests_tick) newest.rests_tick = status.tick;

  for (;;) {
    Stretch& first = stretches_.front();
    const bool replaced = stretches_.size() > 1;
    if (first.kind == Kind::kPlan && first.what.empty()) {
      // The plan is known once it is up to its end: the next stretch's start, or a sample at rest.
      const std::int64_t newest_sample = first.start_tick + static_cast<std::int64_t>(first.samples.size()) - 1;
      const bool known =
          replaced ? newest_sample >= stretches_[1].start_tick : first.rests_tick && newest_sample > *first.rests_tick;
      if (!known) return true;
      first.what = sampled(first);
      first.samples.clear();
    }
    if (!check(first)) return false;
    if (!replaced) return true;
    stretches_.pop_front();
  }
}

bool StepTimingCheck::finish() {
  if (record_.violation) return false;
  while (!stretches_.empty()) {
    Stretch& stretch = stretches_.front();
    if (stretch.kind == Kind::kPlan && stretch.what.empty()) {
      // Pulses within the time of a touch from the last sample may depend on samples not yet known.
      double touch_s = 0;
      for (const sim::Mass& mass : scenario_.masses) {
        touch_s = std::max({touch_s, 1 / mass.motor.max_step_rate_hz, mass.motor.direction_setup_s});
      }
      const double touch_ticks = std::ceil(touch_s / scenario_.run.control_period_s) + 1;
      const double known_ticks = static_cast<double>(stretch.samples.size()) - 1 - touch_ticks;
      std::vector<step_command_t> rest;
      const auto known =
          static_cast<std::size_t>(std::clamp(known_ticks, 0.0, static_cast<double>(stretch.commands.size())));
      rest.assign(stretch.commands.begin() + static_cast<std::ptrdiff_t>(known), stretch.commands.end());
      stretch.commands.resize(known);
      if (known > 0) {
        stretch.what = sampled(stretch);
        if (!check(stretch)) return false;
      }
      stretches_.insert(stretches_.begin() + 1, {Kind::kUnknown, 0, false, std::move(rest), {}, {}, std::nullopt});
    } else if (!check(stretch)) {
      return false;
    }
    stretches_.pop_front();
  }
  return true;
}

StepTimingRecord StepTimingCheck::record() const {
  StepTimingRecord record = record_;
  for (const auto& check : checks_) record.motors.push_back(check.statistics());
  return record;
}

}  // namespace ballast::sil
