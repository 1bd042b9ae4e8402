// validate(): the parameters that the controller accepts.
#include "firmware/control/params.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "firmware/motion/motion_limits.h"
#include "firmware/motion/rail_ends.h"
#include "firmware/motion/step_command.h"

namespace ballast::firmware {

namespace {

// Tolerance on unit lengths and right angles. Rails are built by functions that normalise, so only rounding is left,
// which is far smaller.
constexpr Real kUnitTolerance = std::max(static_cast<Real>(1e-9), 16 * std::numeric_limits<Real>::epsilon());

// Keeps the first error.
class Checker {
 public:
  void require(bool ok, const char* field, int index, Wide value, const char* allowed, Wide limit = 0) {
    if (ok || !error_.ok()) return;
    error_.field = field;
    error_.index = index;
    error_.value = value;
    error_.allowed = allowed;
    error_.limit = limit;
  }
  void positive(Wide value, const char* field, int index = -1) {
    require(std::isfinite(value) && value > 0, field, index, value, "finite, > 0");
  }
  void not_negative(Wide value, const char* field, int index = -1) {
    require(std::isfinite(value) && value >= 0, field, index, value, "finite, >= 0");
  }
  void motion(const Profile& profile, const MotionLimits& limits, int mass) {
    const LimitBreach breach = check_limits(profile, limits);
    if (breach.ok() || !error_.ok()) return;
    const bool speed = breach.what == Limited::kVelocity, acceleration = breach.what == Limited::kAcceleration;
    require(false, speed ? "motion speed" : (acceleration ? "motion acceleration" : "motion jerk"), mass, breach.value,
            speed          ? "what motor.max_step_rate_hz allows"
            : acceleration ? "<= motor.max_acceleration"
                           : "<= motor.max_jerk");
    error_.piece = breach.piece;
    error_.limit = speed ? limits.max_velocity : (acceleration ? limits.max_acceleration : limits.max_jerk);
  }
  // Requires that the motion's pulses fit the motor's share of the bursts in every tick, started as given and from
  // rest. sure_steps_per_tick() includes one reversal in a tick; each further one costs two pulses.
  void reversals(const ControllerParams& params, int mass) {
    const auto k = static_cast<std::size_t>(mass);
    const Profile& profile = params.motion[k];
    const int bursts = bursts_per_motor(params.ball.mass_count);
    const int pulses = static_cast<int>(params.motor[k].max_step_rate_hz * params.control_period_s) + 1;
    // The limit for a burst per pulse, too: a touch has two crossings per reversal, and the generator counts them.
    constexpr int kMostReversals = kMaxStepsPerTick / 2;
    const int allowed = pulses <= bursts ? kMostReversals : std::clamp((3 * bursts - pulses) / 2, 1, kMostReversals);
    const int most = std::max(most_reversals(profile, params.control_period_s, 0),
                              most_reversals(profile, params.control_period_s, -profile.at(0).velocity));
    require(most <= allowed, "motion reversals in a tick", mass, most, "at this motor.max_step_rate_hz", allowed);
  }
  void ends(const BallParams& ball, const Profile& profile, int mass) {
    const LeavesRail leaves = leaves_rail(ball, mass, profile);
    if (leaves.piece < 0) return;
    const RailEnds ends = rail_ends(ball, mass);
    require(false, "motion position", mass, leaves.position, "the end of its rail");
    error_.piece = leaves.piece;
    error_.limit = leaves.position < ends.lower ? ends.lower : ends.upper;
  }
  void finite(const Vector3& v, const char* field, int index = -1) {
    for (int j = 0; j < 3; ++j) require(std::isfinite(v[j]), field, index, v[j], "finite");
  }
  void unit(const Quaternion& q, const char* field) {
    const Real length = std::sqrt(q.w() * q.w() + q.x() * q.x() + q.y() * q.y() + q.z() * q.z());
    require(std::fabs(length - 1) <= kUnitTolerance, field, -1, length, "unit length");
  }
  [[nodiscard]] const ParamError& error() const { return error_; }

 private:
  ParamError error_;
};

void check_floor(const BallParams& ball, Checker& check) {
  const Real down2 = ball.down_W.dot(ball.down_W);
  check.require(std::fabs(down2 - 1) <= kUnitTolerance, "ball.down_W", -1, std::sqrt(down2), "unit length");
  check.require(ball.down_W[2] < 0, "ball.down_W", -1, ball.down_W[2], "into the floor, third entry < 0");
  check.not_negative(ball.rolling_resistance, "ball.rolling_resistance");
  check.not_negative(ball.spin_friction_m, "ball.spin_friction_m");
  check.not_negative(ball.creep_radps, "ball.creep_radps");
  const bool resists = ball.rolling_resistance > 0 || ball.spin_friction_m > 0;
  check.require(ball.creep_radps > 0 || !resists, "ball.creep_radps", -1, ball.creep_radps,
                "> 0 where the floor resists");
}

void check_ball(const BallParams& ball, Checker& check) {
  check.positive(ball.radius_m, "ball.radius_m");
  check.require(std::isfinite(ball.gravity_mps2) && ball.gravity_mps2 >= 0, "ball.gravity_mps2", -1, ball.gravity_mps2,
                "finite, >= 0");
  check.positive(ball.shell_mass_kg, "ball.shell_mass_kg");
  const Vector3& d = ball.inertia_kgm2;
  for (int j = 0; j < 3; ++j) check.positive(d[j], "ball.inertia_kgm2");
  for (int j = 0; j < 3; ++j) {
    check.require(d[j] <= (d[(j + 1) % 3] + d[(j + 2) % 3]) * (1 + kUnitTolerance), "ball.inertia_kgm2", -1, d[j],
                  "no larger than the sum of the other two");
  }
  const Vector3& chi = ball.center_of_mass_B_m;
  check.finite(chi, "ball.center_of_mass_B_m");
  const Real offset = std::sqrt(chi.dot(chi));
  check.require(offset < ball.radius_m, "ball.center_of_mass_B_m", -1, offset, "inside the ball");
  check.finite(ball.external_force_W_n, "ball.external_force_W_n");
  check_floor(ball, check);
}

void check_spline(const Rail& rail, int i, Checker& check) {
  const int pieces = rail.piece_count;
  check.require(pieces >= 1 && pieces <= kMaxRailPieces, "ball.rail.piece_count", i, pieces, "1..64");
  static_assert(kMaxRailPieces == 64);
  check.positive(rail.piece_length_m, "ball.rail.piece_length_m", i);
  if (!check.error().ok()) return;
  check.positive(length_m(rail), "ball.rail.piece_length_m", i);
  for (int k = 0; k <= pieces; ++k) {
    const RailKnot& knot = rail.knots[static_cast<std::size_t>(k)];
    check.finite(knot.position_B_m, "ball.rail.knots", i);
    check.finite(knot.d2_B_per_m, "ball.rail.knots", i);
  }
  if (!rail.closed) return;
  const RailKnot &first = rail.knots[0], &last = rail.knots[static_cast<std::size_t>(pieces)];
  for (int j = 0; j < 3; ++j) {
    check.require(last.position_B_m[j] == first.position_B_m[j] && last.d2_B_per_m[j] == first.d2_B_per_m[j],
                  "ball.rail.knots", i, last.position_B_m[j], "the last of a closed rail equal to the first");
  }
}

void check_rail(const Rail& rail, int i, Checker& check) {
  check.require(rail.shape == RailShape::kCircle || rail.shape == RailShape::kLine || rail.shape == RailShape::kSpline,
                "ball.rail.shape", i, static_cast<Wide>(rail.shape), "circle, line or spline");
  check.require(rail.lower_end < rail.upper_end, "ball.rail.lower_end", i, rail.lower_end, "below ball.rail.upper_end");
  if (rail.shape == RailShape::kSpline) {
    check_spline(rail, i, check);
    return;
  }
  check.finite(rail.origin_B_m, "ball.rail.origin_B_m", i);
  const Real cos2 = rail.axis_cos_B.dot(rail.axis_cos_B);
  check.require(std::fabs(cos2 - 1) <= kUnitTolerance, "ball.rail.axis_cos_B", i, std::sqrt(cos2), "unit length");
  if (rail.shape != RailShape::kCircle) return;
  const Real sin2 = rail.axis_sin_B.dot(rail.axis_sin_B);
  check.require(std::fabs(sin2 - 1) <= kUnitTolerance, "ball.rail.axis_sin_B", i, std::sqrt(sin2), "unit length");
  const Real skew = rail.axis_cos_B.dot(rail.axis_sin_B);
  check.require(std::fabs(skew) <= kUnitTolerance, "ball.rail.axis_sin_B", i, skew, "perpendicular to axis_cos_B");
  check.positive(rail.radius_m, "ball.rail.radius_m", i);
}

void check_tracking(const ReferenceTable& table, int masses, Checker& check) {
  if (table.samples == 0) return;
  const int most = kMostReferenceFloats / reference_row(masses);
  check.require(table.samples >= 2 && table.samples <= most, "tracking.samples", -1, table.samples,
                "0, or 2 to as many rows as the table has", most);
  check.positive(table.period_s, "tracking.period_s");
  if (!check.error().ok()) return;
  check.require(masses > 0, "tracking.samples", -1, table.samples, "0 without masses");
  const int row = reference_row(masses);
  for (int k = 0; k < table.samples * row; ++k) {
    const auto value = static_cast<Wide>(table.values[static_cast<std::size_t>(k)]);
    check.require(std::isfinite(value), "tracking.values", k, value, "finite");
  }
  for (int k = 0; k < table.samples && check.error().ok(); ++k) {
    const float* q = table.values.data() + static_cast<std::ptrdiff_t>(k) * row;
    const float length2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    // Rounded to floats.
    check.require(std::fabs(length2 - 1) <= 1e-5F, "tracking.values", k * row, static_cast<Wide>(length2),
                  "an attitude of unit length");
  }
}

// Greatest number of ticks from one sample to the next, or of its age: a run's, so that sums of ticks fit an int.
constexpr int kMostSampleTicks = 1'000'000'000;

void check_sample_ticks(int ticks, int least, const char* field, Checker& check) {
  check.require(ticks >= least && ticks <= kMostSampleTicks, field, -1, ticks, least == 0 ? "0..1e9" : "1..1e9");
}

// The names of its fields stay below 40 characters, which is what a target's answer holds.
struct TriadFields {
  const char *noise, *bias, *bias_walk, *scale_error, *misalignment, *range, *resolution;
};

void check_triad(const TriadErrors& triad, const TriadFields& fields, Checker& check) {
  check.not_negative(triad.noise, fields.noise);
  check.not_negative(triad.bias, fields.bias);
  check.not_negative(triad.bias_walk, fields.bias_walk);
  check.not_negative(triad.scale_error, fields.scale_error);
  check.not_negative(triad.misalignment_rad, fields.misalignment);
  check.not_negative(triad.range, fields.range);
  check.not_negative(triad.resolution, fields.resolution);
}

void check_estimation(const BallParams& ball, const EstimationParams& estimation, Checker& check) {
  constexpr TriadFields kGyro{"estimation.gyro.noise",        "estimation.gyro.bias",
                              "estimation.gyro.bias_walk",    "estimation.gyro.scale_error",
                              "estimation.gyro.misalignment", "estimation.gyro.range",
                              "estimation.gyro.resolution"};
  constexpr TriadFields kAccelerometer{"estimation.accelerometer.noise",        "estimation.accelerometer.bias",
                                       "estimation.accelerometer.bias_walk",    "estimation.accelerometer.scale_error",
                                       "estimation.accelerometer.misalignment", "estimation.accelerometer.range",
                                       "estimation.accelerometer.resolution"};
  check.require(estimation.measures_contact || !estimation.estimated, "estimation.measures_contact", -1, 0,
                "true where the attitude is estimated");
  check_sample_ticks(estimation.imu_period_ticks, 1, "estimation.imu_period_ticks", check);
  check_sample_ticks(estimation.imu_latency_ticks, 0, "estimation.imu_latency_ticks", check);
  check_sample_ticks(estimation.fix_delay_ticks, 0, "estimation.fix_delay_ticks", check);
  check_triad(estimation.gyro, kGyro, check);
  check_triad(estimation.accelerometer, kAccelerometer, check);
  check.finite(estimation.accelerometer_position_B_m, "estimation.accelerometer_position_B_m");
  const Real off_centre = estimation.accelerometer_position_B_m.norm();
  check.require(off_centre <= ball.radius_m, "estimation.accelerometer_position_B_m", -1, off_centre,
                "at most ball.radius_m");
  check.not_negative(estimation.fix_noise_m, "estimation.fix_noise_m");
  for (const Real resolution : estimation.encoder_resolution) {
    check.not_negative(resolution, "estimation.encoder_resolution");
  }
  check.unit(estimation.initial_orientation, "estimation.initial_orientation");
  check.finite(estimation.initial_angular_velocity_B_radps, "estimation.initial_angular_velocity");
  for (int j = 0; j < 2; ++j) {
    const Real place = estimation.initial_position_W_m[j];
    check.require(std::isfinite(place), "estimation.initial_position_W_m", -1, place, "finite");
  }
}

void check_swing(const MotorSwing& swing, int i, Checker& check) {
  check.not_negative(swing.natural_radps, "governor.swing.natural_radps", i);
  check.not_negative(swing.damping_ratio, "governor.swing.damping_ratio", i);
  check.not_negative(swing.microstep, "governor.swing.microstep", i);
  check.not_negative(swing.full_step, "governor.swing.full_step", i);
  check.not_negative(swing.step_error, "governor.swing.step_error", i);
  check.not_negative(swing.detent, "governor.swing.detent", i);
  const bool swings = swing.natural_radps > 0;
  check.require(!swings || swing.microstep > 0, "governor.swing.microstep", i, swing.microstep,
                "> 0 where the motor swings");
  check.require(!swings || swing.full_step > 0, "governor.swing.full_step", i, swing.full_step,
                "> 0 where the motor swings");
}

// The robot's own parameters have been accepted.
void check_governor(const ControllerParams& params, Checker& check) {
  const GovernorSettings& governor = params.governor;
  if (!governor.on) return;
  check.require(governor.friction > 0, "governor.friction", -1, governor.friction, "> 0, infinity: perfect friction");
  check.require(governor.friction_use > 0 && governor.friction_use <= 1, "governor.friction_use", -1,
                governor.friction_use, "> 0, at most 1");
  check.not_negative(governor.min_normal_force_n, "governor.min_normal_force_n");
  check.require(governor.belief_error.mass_share >= 0 && governor.belief_error.mass_share < 1,
                "governor.belief_error.mass_share", -1, governor.belief_error.mass_share, ">= 0, below 1");
  check.not_negative(governor.belief_error.center_of_mass_m, "governor.belief_error.center_of_mass_m");
  for (int i = 0; i < params.ball.mass_count; ++i) check_swing(governor.swing[static_cast<std::size_t>(i)], i, check);
  if (!check.error().ok()) return;
  // A rollout is complete while its predecessor holds: set_times() finds no such time for longer ticks.
  check.require(governor_params(params).search_ticks > 0, "control_period_s", -1, params.control_period_s,
                "for the governor: below 0.03 sqrt(r / g)");
}

}  // namespace

MotionLimits motion_limits(const ControllerParams& params, int mass) {
  const MotorParams& motor = params.motor[static_cast<std::size_t>(mass)];
  return {motor.max_step_rate_hz / std::fabs(motor.steps_per_unit), motor.max_acceleration, motor.max_jerk};
}

ParamError validate(const ControllerParams& params) {
  Checker check;
  check.positive(params.control_period_s, "control_period_s");
  check.require(params.timer_frequency_hz >= 1e6 && params.timer_frequency_hz <= 1e8, "timer_frequency_hz", -1,
                params.timer_frequency_hz, "1e6..1e8");
  const Wide ticks = params.control_period_s * params.timer_frequency_hz;
  check.require(ticks >= 2 && ticks <= 1e9, "control_period_s", -1, params.control_period_s, "2..1e9 timer ticks");
  check.require(params.static_friction > 0, "static_friction", -1, params.static_friction,
                "> 0, infinity: perfect friction");
  check.require(params.sensor_stale_ticks >= 0 && params.sensor_stale_ticks <= 1000, "sensor_stale_ticks", -1,
                params.sensor_stale_ticks, "0..1000");
  check.require(params.monitor_stale_ticks >= 0 && params.monitor_stale_ticks <= 1000, "monitor_stale_ticks", -1,
                params.monitor_stale_ticks, "0..1000");
  check_ball(params.ball, check);
  check_estimation(params.ball, params.estimation, check);

  const int count = params.ball.mass_count;
  check.require(count >= 0 && count <= kMaxMasses, "ball.mass_count", -1, count, "0..8");
  for (int i = 0; i < count && i < kMaxMasses; ++i) {
    const auto k = static_cast<std::size_t>(i);
    check.positive(params.ball.mass_kg[k], "ball.mass_kg", i);
    check_rail(params.ball.rail[k], i, check);
    const MotorParams& motor = params.motor[k];
    check.require(std::isfinite(motor.steps_per_unit) && motor.steps_per_unit != 0, "motor.steps_per_unit", i,
                  motor.steps_per_unit, "finite, not 0");
    check.require(motor.max_step_rate_hz > 0 && motor.max_step_rate_hz <= params.timer_frequency_hz,
                  "motor.max_step_rate_hz", i, motor.max_step_rate_hz, "> 0, at most timer_frequency_hz");
    const Wide sure_rate_hz = (sure_steps_per_tick(count) - 1) / params.control_period_s;
    check.require(motor.max_step_rate_hz <= sure_rate_hz, "motor.max_step_rate_hz", i, motor.max_step_rate_hz,
                  "at most what the motor's share of the 32 bursts of a tick surely carries", sure_rate_hz);
    check.positive(motor.max_acceleration, "motor.max_acceleration", i);
    check.require(motor.direction_setup_s >= 0 && motor.direction_setup_s <= 1e-3, "motor.direction_setup_s", i,
                  motor.direction_setup_s, "0..1e-3");
    check.positive(motor.max_jerk, "motor.max_jerk", i);
    check.require(std::isfinite(motor.swing) && motor.swing >= 0, "motor.swing", i, motor.swing, "finite, >= 0");
    // Profile::set() refuses numbers that are not finite. The step count at the start must fit as well.
    const Wide start = params.motion[k].at(0).position;
    check.require(std::fabs(start * motor.steps_per_unit) <= 1e15, "motion", i, start,
                  "initial position within 1e15 microsteps of 0");
    if (check.error().ok()) {
      check.require(on_rail(params.ball, i, start), "motion", i, start, "initial position between its rail's ends");
    }
    if (check.error().ok()) check.motion(params.motion[k], motion_limits(params, i), i);
    if (check.error().ok()) check.reversals(params, i);
    if (check.error().ok()) check.ends(params.ball, params.motion[k], i);
  }
  if (check.error().ok()) check_tracking(params.tracking, count, check);
  if (check.error().ok()) check_governor(params, check);
  return check.error();
}

}  // namespace ballast::firmware
