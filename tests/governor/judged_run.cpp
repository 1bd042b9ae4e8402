#include "tests/governor/judged_run.h"

#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <random>
#include <stdexcept>

#include "sim/scenario/fingerprint.h"
#include "tests/firmware/corner_ball.h"
#include "tests/firmware/governed_ball.h"
#include "tests/firmware/governor/bench.h"
#include "tests/tracking/study.h"
#include "tools/program/params.h"

namespace ballast::governor_test {

namespace {

using firmware::Real;
using firmware::Vector3;
using firmware::Wide;

std::unique_ptr<firmware::ControllerParams> params_of(const sim::Scenario& scenario) {
  auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto why = program::to_controller_params(scenario, *params)) throw std::runtime_error(*why);
  return params;
}

}  // namespace

Judged run_ideal(const Draw& draw, bool governed) {
  const sim::Scenario scenario = random_robot(draw);
  const auto params = params_of(scenario);
  params->governor.on = governed;
  firmware::testing::GovernedBall ball(*params);
  firmware::BallParams truth;
  if (const auto why = program::to_ball_params(scenario, truth)) throw std::runtime_error(*why);
  ball.set_truth(truth, static_cast<Real>(scenario.surface.static_friction));
  ball.start();
  Judged out;
  out.started = ball.out.status.mode == firmware::Mode::kRunning;
  if (!out.started) return out;
  const auto end_tick = static_cast<std::int64_t>(scenario.duration_s / scenario.run.control_period_s);
  while (ball.in.tick < end_tick) ball.tick();
  out.most_use = static_cast<double>(ball.most_use);
  out.time_s = static_cast<double>(ball.most_use_tick) * scenario.run.control_period_s;
  out.broken = !(out.most_use <= 1);
  out.largest_bend = static_cast<double>(ball.largest_bend);
  if (ball.out.status.mode != firmware::Mode::kRunning) out.other = fmt::format("faults {}", ball.out.status.faults);
  return out;
}

Judged run_plant(const Draw& draw, bool governed) {
  sim::Scenario scenario = random_robot(draw);
  scenario.control.governor = governed;
  const sil::RunResult result = tracking_test::run(scenario, false);
  Judged out;
  // A ball that breaks the cone as it is set down is not governed for a tick.
  out.started = governed ? result.governor.has_value() : !result.refusal;
  if (!out.started) return out;
  out.most_use = result.extrema.mu_required_max.value / scenario.surface.static_friction;
  out.time_s = result.extrema.mu_required_max.time_s;
  out.broken = !(out.most_use <= 1) || result.rolling_lost;
  out.motors_added = result.motor_share.mu_required.difference() / scenario.surface.static_friction;
  if (result.governor) {
    out.allowed = result.governor->motor_allowance / scenario.surface.static_friction;
    const auto& bends = result.governor->largest_bend;
    out.largest_bend = *std::max_element(bends.begin(), bends.end());
  }
  if (result.end_reason != sil::EndReason::kCompleted && !out.broken) {
    out.other = fmt::format("{} at {:.4f} s", sil::to_string(result.end_reason), result.final_sample.time_s);
  }
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    if (result.motors[i].slips > 0) out.other += fmt::format("{}mass {} lost steps", out.other.empty() ? "" : ", ", i);
  }
  return out;
}

namespace {

// The robot as it is set down, its masses where their motion begins.
firmware::RobotState first_state(const firmware::ControllerParams& params) {
  firmware::RobotState out;
  out.orientation = params.estimation.initial_orientation;
  out.angular_velocity_B_radps = params.estimation.initial_angular_velocity_B_radps;
  for (std::size_t i = 0; i < static_cast<std::size_t>(params.ball.mass_count); ++i) {
    out.mass_position[i] = static_cast<Real>(params.motion[i].at(0).position);
    out.mass_velocity[i] = static_cast<Real>(params.motion[i].at(0).velocity);
  }
  return out;
}

// Compares the needs of the true robot and of the believed one, which is astray by so much.
void compare(const firmware::BallParams& ball, const firmware::BeliefErrors& errors,
             const firmware::RobotState& believed, const firmware::RollingForces& forces,
             const firmware::RollingForces& seen, const firmware::Astray& astray, firmware::Drift& drift,
             Astrayed& out) {
  firmware::MassMotion masses = firmware::motion_of(believed);
  masses.acceleration = believed.mass_acceleration;
  const Vector3& omega = believed.angular_velocity_B_radps;
  firmware::drift_of(ball, errors, firmware::arms_of(ball, masses, omega), believed.orientation, omega, forces, drift);
  const Real more = seen.static_friction_n / seen.normal_force_n - forces.static_friction_n / forces.normal_force_n;
  const Real bound = astray.force_n(drift) / forces.normal_force_n;
  if (!(bound < Real(0.3))) return;
  out.over = std::fmax(out.over, static_cast<double>(more - bound));
  out.part = std::fmax(out.part, static_cast<double>(more / bound));
}

}  // namespace

Astrayed lead_astray(const Draw& draw) {
  const sim::Scenario scenario = random_robot(draw);
  const auto params = params_of(scenario);
  const firmware::GovernorParams governor = firmware::governor_params(*params);
  const firmware::BallParams& ball = params->ball;
  std::mt19937_64 random(draw.seed);
  const firmware::BallParams truth = firmware::testing::corner_ball(ball, governor.belief_error, random);
  const Real unit_s = std::sqrt(ball.radius_m / ball.gravity_mps2), h_s = Real(0.02) * unit_s;
  std::uniform_real_distribution<Real> part(0, 1);
  const Real parted_s = 8 * part(random) * unit_s, braked_s = parted_s + (1 + 9 * part(random)) * unit_s;
  const firmware::testing::ProfileLaw law{&ball, &params->motion, 1 / unit_s};
  const auto wish = [&](Real time_s, const firmware::RobotState& at) {
    return time_s < braked_s ? law(Wide{time_s}, at).u : firmware::braking(governor, at, ball.mass_count);
  };
  firmware::RobotState believed = first_state(*params);
  Astrayed out;
  firmware::RobotState true_one;
  firmware::Astray astray;
  bool parted = false;
  for (Real time_s = 0; time_s < braked_s + 16 * unit_s; time_s += h_s) {
    believed.mass_acceleration = wish(time_s, believed);
    if (!parted && time_s >= parted_s) {
      parted = true;
      true_one = believed;
    }
    const firmware::PerMass<Real> end = wish(time_s + h_s, believed);
    const auto forces = firmware::testing::forces_of(ball, believed, believed.mass_acceleration);
    const Real use = forces.static_friction_n / forces.normal_force_n;
    if (!(forces.normal_force_n > 0 && use < Real(0.6))) return out;
    if (parted) {
      firmware::Drift drift;
      const auto seen = firmware::testing::forces_of(truth, true_one, believed.mass_acceleration);
      compare(ball, governor.belief_error, believed, forces, seen, astray, drift, out);
      astray.advance(drift, h_s);
      true_one.mass_acceleration = believed.mass_acceleration;
      true_one = firmware::testing::moved(truth, true_one, end, h_s);
    }
    believed = firmware::testing::moved(ball, believed, end, h_s);
  }
  out.rolled = true;
  return out;
}

Instants fork_at_instants(const Draw& draw, int count) {
  const sim::Scenario scenario = random_robot(draw);
  const auto params = params_of(scenario);
  firmware::testing::Bench bench;
  bench.ball = params->ball;
  bench.params = firmware::governor_params(*params);
  bench.motion = params->motion;
  bench.bandwidth_radps = std::sqrt(bench.ball.gravity_mps2 / bench.ball.radius_m);
  bench.state = first_state(*params);
  Instants out;
  if (!bench.start()) return out;
  const auto end_tick = static_cast<std::int64_t>(scenario.duration_s / scenario.run.control_period_s);
  std::mt19937_64 random(draw.seed);
  std::vector<std::int64_t> ticks(static_cast<std::size_t>(count));
  for (std::int64_t& tick : ticks) tick = std::uniform_int_distribution<std::int64_t>(1, end_tick - 1)(random);
  std::sort(ticks.begin(), ticks.end());
  for (const std::int64_t tick : ticks) {
    while (bench.tick < tick) bench.step();
    const firmware::testing::ExecutedPlan plan = firmware::testing::execute_plan(bench);
    ++out.forks;
    out.broken += plan.most_use <= 1 ? 0 : 1;
    out.worst_use = std::fmax(out.worst_use, static_cast<double>(plan.most_use));
    if (bench.governor.mode != firmware::GovernorMode::kNominal) continue;
    const firmware::Certificate& certificate = bench.governor.certificate;
    const bool for_ever = certificate.until_tick == firmware::kForEverTick;
    const auto less = static_cast<double>(certificate.margin - (1 - plan.backup_use));
    const double off = for_ever ? std::fmax(less, 0) : std::fabs(less);
    const Wide ahead_s = static_cast<Wide>(certificate.switch_tick - tick) * bench.params.control_period_s;
    Instants::Margins& margins = for_ever ? out.for_ever : ahead_s <= bench.params.horizon_s ? out.near : out.far;
    ++margins.count;
    margins.off += off <= 0.02 ? 0 : 1;
    margins.worst = std::fmax(margins.worst, off);
  }
  return out;
}

}  // namespace ballast::governor_test
