// The fields of the messages between controller and world (fields.h): the members of the firmware's structs with their
// ranges and their names in the .lcm files. Structs and members without such a name do not travel on LCM.
#pragma once

#include "firmware/control/inputs.h"
#include "firmware/control/params.h"
#include "firmware/control/status.h"
#include "hal/fields.h"
#include "hal/host_link.h"
#include "hal/status.h"

#define LCM(member)                                        \
  LcmMember {                                              \
#member, [](auto& lcm) -> auto& { return lcm.member; } \
  }

namespace ballast::hal {

// sensors_t
template <class V, Of<firmware::Sensors> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(tick), m.tick, Tick())
      .field(LCM(attitude_valid), m.attitude_valid)
      .field(LCM(orientation), m.orientation)
      .field(LCM(gyro_B_radps), m.gyro_B_radps)
      .field(LCM(accelerometer_B_mps2), m.accelerometer_B_mps2)
      .field(LCM(limit_switch), m.limit_switch, Within(0, 3))
      .field(LCM(imu_count), m.imu_count, Within(0, kFarthestTick))
      .field(LCM(imu_tick), m.imu_tick, Tick())
      .field(LCM(has_encoders), m.has_encoders)
      .field(LCM(encoder), m.encoder)
      .field(LCM(fix_count), m.fix_count, Within(0, kFarthestTick))
      .field(LCM(fix_tick), m.fix_tick, Tick())
      .field(LCM(fix_W_m), m.fix_W_m);
}

// trip_t
template <class V, Of<firmware::MonitorVerdict> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(tick), m.tick, Tick()).field(LCM(tripped), m.tripped);
}

// operator_t
template <class V, Of<firmware::MoveRequest> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(move_masses), m.masses)
      .field(LCM(target_position), m.target_position)
      .field(LCM(speed_fraction), m.speed_fraction);
}

template <class V, Of<firmware::CoursePart> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  constexpr int kMost = firmware::kMostCourseValues;
  return visitor.field(LCM(course), m.course)
      .field(LCM(course_first), m.first, Within(0, kMost))
      .field(LCM(course_total), m.total, Within(0, kMost))
      .field(LCM(course_count), m.count, Within(0, firmware::kCoursePart))
      .field(LCM(course_value), m.value, first(m.count));
}

template <class V, Of<firmware::OperatorInput> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  using enum firmware::OperatorCommand;
  return visitor.field(LCM(command), m.command, Within(kArm, kGo))
      .field(m.move, When{m.command == kMove})
      .field(m.course, When{m.command == kGo});
}

// step_command_t
template <class V, Of<firmware::StepBurst> M>
constexpr decltype(auto) fields(V& visitor, M& m, int motor_count = firmware::kMaxMasses) {
  constexpr int kMaxTicks = 0x7fffffff;
  return visitor.field(LCM(motor), m.motor, Within(0, motor_count - 1))
      .field(LCM(direction), m.direction, Sign())
      .field(LCM(count), m.count, Within(1, 32767))
      .field(LCM(first), m.first_ticks, Within(0, kMaxTicks))
      .field(LCM(interval), m.interval_ticks, Within(0, kMaxTicks))
      .field(LCM(add), m.add_ticks);
}

template <class V, Of<firmware::StepCommand> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(tick), m.tick, Tick())
      .field(LCM(motor_count), m.motor_count, Within(0, firmware::kMaxMasses))
      .field(LCM(steps), m.steps, first(m.motor_count))
      .field(LCM(position_steps), m.position_steps, first(m.motor_count))
      .field(m.last_pulse, Unsent())  // for the firmware's next command
      .field(LCM(burst_count), m.burst_count, Within(0, m.motor_count > 0 ? firmware::kMaxBursts : 0))
      .field(m.bursts, first(m.burst_count, m.motor_count));
}

// controller_status_t
template <class V, Of<firmware::ProfilePoint> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(next_position), m.position)
      .field(LCM(next_velocity), m.velocity)
      .field(LCM(next_acceleration), m.acceleration);
}

template <class V, Of<firmware::RollingForces> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor
      .field(m.angular_acceleration_B_radps2, Unsent())  // both Unsent: for the firmware's own use
      .field(LCM(normal_force_n), m.normal_force_n, Real())
      .field(m.friction_force_W_n, Unsent())
      .field(LCM(static_friction_n), m.static_friction_n, Real());
}

template <class V, Of<firmware::StepTrouble> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(overload_error), m.error, Within(firmware::StepError::kNone, firmware::StepError::kTooFast))
      .field(LCM(overload_value), m.value)
      .field(LCM(overload_limit), m.limit);
}

template <class V, Of<firmware::StepOverload> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.trouble)
      .field(LCM(overload_motor), m.motor, Within(-1, firmware::kMaxMasses - 1))
      .field(LCM(overload_tick), m.tick);
}

template <class V, Of<firmware::RefusalReport> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(refusal), m.reason, Within(firmware::Refusal::kNone, firmware::Refusal::kOffCourse))
      .field(LCM(refusal_motor), m.motor, Within(-1, 31))
      .field(LCM(refusal_piece), m.piece, Within(-1, firmware::kMaxPieces))
      .field(LCM(refusal_value), m.value)
      .field(LCM(refusal_time_s), m.time_s);
}

template <class V, Of<firmware::Prediction> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(plan_duration_s), m.duration_s)
      .field(LCM(plan_horizon_s), m.horizon_s)
      .field(LCM(plan_normal_force_min_n), m.normal_force_min_n, Real())
      .field(LCM(plan_mu_required_max), m.mu_required_max, Real())
      .field(LCM(plan_margin_min), m.margin_min, Real());
}

template <class V, Of<firmware::Estimate> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(estimate_valid), m.valid)
      .field(LCM(estimated_orientation), m.orientation)
      .field(LCM(estimated_angular_velocity_B_radps), m.angular_velocity_B_radps)
      .field(LCM(estimated_gyro_bias_B_radps), m.gyro_bias_B_radps)
      .field(LCM(estimated_position_W_m), m.position_W_m)
      .field(LCM(tilt_sigma_rad), m.tilt_sigma_rad, Real())
      .field(LCM(yaw_sigma_rad), m.yaw_sigma_rad, Real())
      .field(LCM(gyro_bias_sigma_radps), m.gyro_bias_sigma_radps, Real())
      .field(LCM(position_sigma_m), m.position_sigma_m, Real());
}

template <class V, Of<firmware::MeasuredContact> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(measured_valid), m.valid)
      .field(LCM(measured_normal_force_n), m.normal_force_n, Real())
      .field(LCM(measured_normal_sigma_n), m.normal_sigma_n, Real())
      .field(LCM(measured_static_friction_n), m.static_friction_n, Real())
      .field(LCM(measured_mu_required), m.mu_required, Real())
      .field(LCM(measured_mu_sigma), m.mu_sigma, Real())
      .field(LCM(measured_slip_mps2), m.slip_mps2, Real())
      .field(LCM(measured_slip_sigma_mps2), m.slip_sigma_mps2, Real())
      .field(LCM(slip_detected), m.slip_detected)
      .field(LCM(light_detected), m.light_detected);
}

template <class V, Of<firmware::GovernorStatus> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(governed), m.governs)
      .field(LCM(command_bent), m.bent)
      .field(LCM(backup_active), m.backup)
      .field(LCM(backup_margin), m.backup_margin, Real())
      .field(LCM(backup_until_tick), m.backup_until_tick, Tick())
      .field(LCM(governor_allowance), m.allowance, Real());
}

template <class V, Of<firmware::HaltStatus> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(halt_said), m.said)
      .field(LCM(halt_tick), m.tick, Tick())
      .field(LCM(halt_distance_m), m.distance_m, Real())
      .field(LCM(halt_duration_s), m.duration_s);
}

template <class V, Of<firmware::CourseStatus> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(course), m.in_force)
      .field(LCM(course_tick), m.tick, Tick())
      .field(LCM(course_coming), m.coming);
}

template <class V, Of<firmware::ControllerStatus> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(LCM(tick), m.tick, Tick())
      .field(LCM(scenario_id), m.scenario_id)
      .field(LCM(mode), m.mode, Within(firmware::Mode::kDisarmed, firmware::Mode::kHalting))
      .field(LCM(at_rest), m.at_rest)
      .field(LCM(faults), m.faults)
      .field(LCM(motor_count), m.motor_count, Within(0, firmware::kMaxMasses))
      .field(LCM(commanded_position), m.commanded_position, first(m.motor_count, Real()))
      .field(LCM(commanded_velocity), m.commanded_velocity, first(m.motor_count, Real()))
      .field(m.next, first(m.motor_count))
      .field(m.predicted)
      .field(LCM(mu_required), m.mu_required, Real())
      .field(LCM(margin), m.margin, Real())
      .field(LCM(overruns), m.overruns)
      .field(LCM(steps_issued), m.steps_issued, first(m.motor_count))
      .field(m.overload)
      .field(LCM(operator_commands), m.operator_commands)
      .field(m.refusal)
      .field(LCM(planned), m.planned)
      .field(LCM(plan_tick), m.plan_tick, Tick())
      .field(m.plan)
      .field(m.estimate)
      .field(m.measured)
      .field(m.governor)
      .field(m.halt)
      .field(LCM(motion_delay_s), m.motion_delay_s)
      .field(LCM(slip_friction), m.slip_friction, Real())
      .field(m.course);
}

// The parameters. Those of a mass are Unsent here: they travel mass by mass (target::MassParams).
template <class V, Of<firmware::BallParams> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.radius_m, Real())
      .field(m.gravity_mps2, Real())
      .field(m.shell_mass_kg, Real())
      .all(m.inertia_kgm2, m.center_of_mass_B_m, m.external_force_W_n, m.down_W)
      .field(m.rolling_resistance, Real())
      .field(m.spin_friction_m, Real())
      .field(m.creep_radps, Real())
      .field(m.mass_count, Within(0, firmware::kMaxMasses))
      .field(m.mass_kg, Unsent())
      .field(m.rail, Unsent());
}

template <class V, Of<firmware::TriadErrors> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.noise, Real())
      .field(m.bias, Real())
      .field(m.bias_walk, Real())
      .field(m.scale_error, Real())
      .field(m.misalignment_rad, Real())
      .field(m.range, Real())
      .field(m.resolution, Real());
}

template <class V, Of<firmware::EstimationParams> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor
      .all(m.estimated, m.measures_contact, m.imu_period_ticks, m.imu_latency_ticks, m.gyro, m.accelerometer,
           m.accelerometer_position_B_m, m.fix_delay_ticks)
      .field(m.fix_noise_m, Real())
      .field(m.has_encoders)
      .field(m.encoder_resolution, Real())
      .all(m.initial_orientation, m.initial_angular_velocity_B_radps, m.initial_position_W_m);
}

template <class V, Of<firmware::ControllerParams> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.all(m.scenario_id, m.control_period_s, m.timer_frequency_hz)
      .field(m.static_friction, Real())
      .all(m.sensor_stale_ticks, m.monitor_stale_ticks, m.ball, m.estimation)
      .field(m.motor, Unsent())
      .field(m.motion, Unsent())
      .all(m.tracking, m.governor);
}

template <class V, Of<firmware::MotorSwing> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.natural_radps, Real())
      .field(m.damping_ratio, Real())
      .field(m.microstep, Real())
      .field(m.full_step, Real())
      .field(m.step_error, Real())
      .field(m.detent, Real());
}

template <class V, Of<firmware::GovernorSettings> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.on)
      .field(m.friction, Real())
      .field(m.friction_use, Real())
      .field(m.min_normal_force_n, Real())
      .all(m.swing, m.belief_error);
}

template <class V, Of<firmware::BeliefErrors> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.mass_share, Real()).field(m.center_of_mass_m, Real());
}

// Its values travel in parts (target::ReferencePart).
template <class V, Of<firmware::ReferenceTable> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.field(m.samples, Within(0, firmware::kMostReferenceFloats))
      .all(m.period_s, m.holds)
      .field(m.values, Unsent());
}

template <class V, Of<firmware::RailKnot> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.all(m.position_B_m, m.d2_B_per_m);
}

template <class V, Of<firmware::Rail> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  using enum firmware::RailShape;
  return visitor.field(m.shape, Within(kCircle, kSpline))
      .all(m.origin_B_m, m.axis_cos_B, m.axis_sin_B)
      .field(m.radius_m, Real())
      .field(m.lower_end, Real())
      .field(m.upper_end, Real())
      .field(m.closed)
      .field(m.piece_count, Within(0, firmware::kMaxRailPieces))
      .field(m.piece_length_m, Real())
      .field(m.knots, first(m.shape == kSpline ? m.piece_count + 1 : 0));
}

template <class V, Of<firmware::MotorParams> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.all(m.steps_per_unit, m.max_step_rate_hz, m.max_acceleration, m.max_jerk, m.direction_setup_s,
                     m.swing);
}

template <class V, Of<firmware::ProfilePiece> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.all(m.duration_s, m.acceleration_start, m.acceleration_end);
}

// A piece of a motion as Profile keeps it.
template <class V, Of<firmware::Cubic> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.all(m.duration_s, m.position, m.velocity, m.acceleration, m.jerk);
}

// Counters of a link.
template <class V, Of<LinkCounters> M>
constexpr decltype(auto) fields(V& visitor, M& m) {
  return visitor.all(m.malformed, m.repeated, m.out_of_order, m.foreign, m.old, m.dropped, m.taken_back);
}

}  // namespace ballast::hal

#undef LCM
