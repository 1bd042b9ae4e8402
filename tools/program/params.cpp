#include "tools/program/params.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "firmware/motion/step_command.h"
#include "sim/scenario/reader.h"
#include "sim/sensors/sensors.h"
#include "tools/program/program.h"
#include "tools/tracking/followed_plan.h"

namespace ballast::program {
namespace {

// Messages one tick old are no fault, so that a board that does not wait for its messages may receive one late. In all
// present backends a tick begins only with its own sensors and verdict, so the age is 0.
constexpr int kSensorStaleTicks = 1;
constexpr int kMonitorStaleTicks = 1;

static_assert(sim::kMaxMotionPieces == firmware::kMaxPieces);
static_assert([] {
  for (int masses = 1; masses <= firmware::kMaxMasses; ++masses) {
    if (sim::sure_steps_per_control_period(masses) != firmware::sure_steps_per_tick(masses)) return false;
  }
  return true;
}());

std::string mass_key(std::size_t mass, const char* field) { return fmt::format("mass.{}.{}", mass, field); }

// Numbers have all their digits, so that one given as allowed is allowed.
std::string describe(const firmware::ParamError& error) {
  const std::string value = sim::number_text(error.value), limit = sim::number_text(error.limit);
  if (error.piece >= 0) {
    return fmt::format("mass.{}.motion.{}: {} {}: the controller allows {}, {}", error.index, error.piece, error.field,
                       value, limit, error.allowed);
  }
  const std::string field =
      error.index < 0 ? error.field : mass_key(static_cast<std::size_t>(error.index), error.field);
  if (error.limit != 0) {
    return fmt::format("{} = {}: the controller allows {}, {}", field, value, limit, error.allowed);
  }
  return fmt::format("{} = {}: the controller allows {}", field, value, error.allowed);
}

firmware::TriadErrors to_triad_errors(const sim::ImuTriad& triad, double rate_hz) {
  firmware::TriadErrors errors;
  errors.noise = triad.noise_density * std::sqrt(rate_hz / 2);  // one-sided density
  errors.bias = triad.bias;
  errors.bias_walk = triad.bias_walk;
  errors.scale_error = triad.scale_error;
  errors.misalignment_rad = triad.misalignment_rad;
  errors.range = triad.range;
  errors.resolution = triad.resolution;
  return errors;
}

// The sensors as their designer states them, never as they were drawn. Ideal sensors leave every default.
firmware::EstimationParams to_estimation_params(const sim::Scenario& scenario) {
  const sim::SensorModel& sensors = scenario.sensors;
  const double period_s = scenario.run.control_period_s;
  firmware::EstimationParams estimation;
  // A tracked plan begins where it was made for, wherever the true ball is set down. The governor certifies the start
  // from there.
  const bool planned = scenario.control.tracking && scenario.plan.start;
  const sim::InitialState& start = planned ? *scenario.plan.start : scenario.initial;
  if (sensors.present || scenario.control.governor) {
    estimation.initial_orientation = start.orientation;
    estimation.initial_angular_velocity_B_radps = start.angular_velocity_B_radps;
    estimation.initial_position_W_m = start.position_W_m;
  }
  if (!sensors.present) return estimation;
  estimation.estimated = sensors.attitude_estimated;
  estimation.measures_contact = true;
  constexpr std::int64_t kNever = 1'000'000'000;  // longer than any run, and the most that the controller allows
  estimation.imu_period_ticks = static_cast<int>(std::min(sim::ticks_per_sample(sensors.rate_hz, period_s), kNever));
  estimation.imu_latency_ticks = static_cast<int>(sim::delay_ticks(sensors.latency_s, period_s));
  estimation.gyro = to_triad_errors(sensors.gyro, sensors.rate_hz);
  estimation.accelerometer = to_triad_errors(sensors.accelerometer, sensors.rate_hz);
  estimation.accelerometer_position_B_m = sensors.accelerometer_position_B_m;
  estimation.fix_delay_ticks = static_cast<int>(sim::delay_ticks(sensors.fix.delay_s, period_s));
  estimation.fix_noise_m = sensors.fix.noise_m;
  estimation.has_encoders = !sensors.encoder_resolution.empty();
  for (std::size_t i = 0; i < sensors.encoder_resolution.size(); ++i) {
    estimation.encoder_resolution[i] = sensors.encoder_resolution[i];
  }
  return estimation;
}

// How a stepper moves its mass: physics.md, section 5.
firmware::MotorSwing to_motor_swing(const sim::Mass& mass) {
  const sim::Motor& motor = mass.motor;
  firmware::MotorSwing swing;
  swing.natural_radps = mass.swing_radps();
  swing.damping_ratio = mass.damping_ratio();
  swing.microstep = 1 / motor.microsteps_per_rail_unit();
  swing.full_step = motor.microsteps * swing.microstep;
  swing.step_error = motor.step_error;
  swing.detent = motor.detent_torque_nm * std::fabs(motor.shaft_ratio) / mass.moving_inertia();
  return swing;
}

firmware::GovernorSettings to_governor_settings(const sim::Scenario& scenario) {
  firmware::GovernorSettings governor;
  if (!scenario.control.governor) return governor;
  governor.on = true;
  governor.friction_use = scenario.control.friction_use * scenario.envelope.friction_use;
  governor.friction = governor.friction_use * scenario.belief().surface.static_friction;
  governor.min_normal_force_n = scenario.envelope.min_normal_force_n;
  governor.belief_error = {scenario.control.belief_error.mass_share, scenario.control.belief_error.center_of_mass_m};
  if (scenario.run.actuation != sim::Actuation::kStepper) return governor;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    governor.swing[i] = to_motor_swing(scenario.belief().masses[i]);
  }
  return governor;
}

}  // namespace

std::optional<std::string> to_ball_params(const sim::World& world, firmware::BallParams& ball) {
  if (world.masses.size() > firmware::kMaxMasses) {
    return fmt::format("mass: {} masses: the controller allows at most {}", world.masses.size(), firmware::kMaxMasses);
  }
  for (std::size_t i = 0; i < world.masses.size(); ++i) {
    if (world.masses[i].trajectory.times_s.empty()) continue;
    return mass_key(i, "trajectory") + ": the controller moves masses along rails only";
  }
  ball.radius_m = world.ball.radius_m;
  ball.gravity_mps2 = world.gravity_mps2;
  ball.shell_mass_kg = world.ball.mass_kg;
  ball.inertia_kgm2 = world.ball.inertia_kgm2;
  ball.center_of_mass_B_m = world.ball.center_of_mass_B_m;
  ball.external_force_W_n = world.external_force_W_n;  // the controller models no force table and no drag
  const sim::Surface& floor = world.surface;
  if (floor.slope_rad != 0) {
    ball.down_W = {std::sin(floor.slope_rad) * std::cos(floor.downhill_rad),
                   std::sin(floor.slope_rad) * std::sin(floor.downhill_rad), -std::cos(floor.slope_rad)};
  }
  ball.rolling_resistance = floor.rolling_resistance;
  ball.spin_friction_m = floor.spin_friction_m;
  if (floor.rolling_resistance > 0 || floor.spin_friction_m > 0) ball.creep_radps = world.creep_radps();
  ball.mass_count = static_cast<int>(world.masses.size());
  for (std::size_t i = 0; i < world.masses.size(); ++i) {
    ball.mass_kg[i] = world.masses[i].mass_kg;
    ball.rail[i] = world.masses[i].rail;
  }
  return std::nullopt;
}

std::optional<std::string> to_controller_params(const sim::Scenario& scenario, firmware::ControllerParams& params) {
  const auto p = std::make_unique<firmware::ControllerParams>();  // too large for the stack
  if (const auto refusal = to_ball_params(scenario.belief(), p->ball)) return refusal;
  p->scenario_id = scenario.id;
  p->control_period_s = scenario.run.control_period_s;
  p->timer_frequency_hz = scenario.run.timer_frequency_hz;
  p->static_friction = scenario.belief().surface.static_friction;
  p->sensor_stale_ticks = kSensorStaleTicks;
  p->monitor_stale_ticks = kMonitorStaleTicks;
  p->estimation = to_estimation_params(scenario);
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::Mass& mass = scenario.masses[i];
    p->motor[i].steps_per_unit = mass.motor.microsteps_per_rail_unit();
    p->motor[i].max_step_rate_hz = mass.motor.max_step_rate_hz;
    p->motor[i].direction_setup_s = mass.motor.direction_setup_s;
    p->motor[i].max_acceleration = mass.motor.max_acceleration;
    p->motor[i].max_jerk = mass.motor.max_jerk;
    // A rotor further than this from its commanded position slips to the next tooth: tools/docs/physics.md, section 5.
    constexpr double kSwingFullSteps = 2;
    p->motor[i].swing = kSwingFullSteps * mass.motor.microsteps / std::fabs(p->motor[i].steps_per_unit);

    if (mass.motion.size() > firmware::kMaxPieces) {
      return fmt::format("{}: {} pieces: the controller allows at most {}", mass_key(i, "motion"), mass.motion.size(),
                         firmware::kMaxPieces);
    }
    std::vector<firmware::ProfilePiece> pieces;
    for (const sim::MotionPiece& piece : mass.motion) {
      pieces.push_back({piece.duration_s, piece.acceleration_start, piece.acceleration_end});
    }
    if (!p->motion[i].set(mass.initial_position, mass.initial_velocity, pieces.data(),
                          static_cast<int>(pieces.size()))) {
      return mass_key(i, "motion") + ": durations must be positive, and all numbers finite";
    }
  }
  p->governor = to_governor_settings(scenario);
  if (scenario.control.tracking) {
    if (const auto why = plan::set_reference(scenario, p->ball, p->tracking)) {
      return "control.tracking = true: there is no reference to track: " + *why;
    }
  }
  if (const firmware::ParamError error = firmware::validate(*p); !error.ok()) return describe(error);
  params = *p;
  return std::nullopt;
}

std::unique_ptr<firmware::ControllerParams> make_controller_params(const char* program_name,
                                                                   const sim::Scenario& scenario) {
  auto params = std::make_unique<firmware::ControllerParams>();
  const auto refusal = to_controller_params(scenario, *params);
  if (!refusal) return params;
  complain(program_name, *refusal);
  return nullptr;
}

monitor::MonitorLimits to_monitor_limits(const sim::Scenario& scenario) {
  monitor::MonitorLimits limits;
  limits.min_normal_force_n = scenario.envelope.min_normal_force_n;
  limits.friction_use = scenario.envelope.friction_use;
  const sim::World& belief = scenario.belief();
  limits.static_friction = belief.surface.static_friction;
  // The monitor does not know where the ball is on a floor with patches: the best of them bounds every margin.
  limits.margin_friction = scenario.surface.greatest_static_friction();
  limits.starts_rolling = !scenario.initial.has_velocity && scenario.initial.height_m == 0;
  limits.controller_expected = has_controller(scenario.run.actuation);
  limits.scenario_id = scenario.id;
  limits.first_tick = scenario.run.first_tick();
  // The plant computes f_s in the body frame and turns the force into the space frame with the quaternion of a step's
  // end, whose four components are off by up to 2 tolerances each. So its square is off by up to 8, the turned force by
  // as much, and f_s, which takes N and the vertical from the same quaternion, by up to twice as much. The rest is for
  // roundings of the force's terms, which are greater than their sum.
  limits.turned_part = 1e-10 + 24 * scenario.run.tolerance;
  // The two forces are compared under the external forces that the controller is told of. They differ by rounding with
  // exact sensors (1e-9 of the weight) and by 2 % of the weight if the attitude is off by a degree. A wrong sign, a
  // wrong unit or a missing term exceeds 5 %.
  constexpr double kFractionOfWeight = 0.05;
  double total_mass_kg = belief.ball.mass_kg;
  for (const sim::Mass& mass : belief.masses) total_mass_kg += mass.mass_kg;
  // Without gravity only an external force can press the ball down.
  const double pressing_n = std::max(total_mass_kg * scenario.gravity_mps2, scenario.external_force_W_n.norm());
  if (pressing_n > 0) limits.disagreement_n = kFractionOfWeight * pressing_n;
  return limits;
}

}  // namespace ballast::program
