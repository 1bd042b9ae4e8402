#include "sim/scenario/fingerprint.h"

#include <charconv>
#include <cmath>

namespace ballast::sim {
namespace {

class CanonicalText {
 public:
  void add(const char* field, double value) {
    char buffer[64];
    // + 0.0 makes -0 and +0 the same text.
    const auto end = std::to_chars(buffer, buffer + sizeof buffer, value + 0.0, std::chars_format::hex).ptr;
    line(field, std::string_view(buffer, static_cast<std::size_t>(end - buffer)));
  }
  void add(const char* field, std::uint64_t value) { line(field, std::to_string(value)); }
  void add(const char* field, int value) { line(field, std::to_string(value)); }
  void add(const char* field, const std::string& value) { line(field, std::to_string(value.size()) + ":" + value); }
  template <int kSize>
  void add(const char* field, const Eigen::Matrix<double, kSize, 1>& value) {
    for (int j = 0; j < kSize; ++j) add(field, value[j]);
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  void line(const char* field, std::string_view value) {
    text_ += field;
    text_ += '=';
    text_ += value;
    text_ += '\n';
  }
  std::string text_;
};

// Rails without ends add no lines.
void add_ends(CanonicalText& text, const Mass& mass) {
  if (!std::isfinite(mass.rail.lower_end) && !std::isfinite(mass.rail.upper_end)) return;
  text.add("rail.lower_end", mass.rail.lower_end);
  text.add("rail.upper_end", mass.rail.upper_end);
  text.add("end_stops.stiffness", mass.end_stops.stiffness_npm);
  text.add("end_stops.restitution", mass.end_stops.restitution);
}

// A spline, a trajectory, a table of forces, drag and a winding add lines only where they are used.
void add_spline(CanonicalText& text, const firmware::Rail& rail) {
  if (rail.shape != firmware::RailShape::kSpline) return;
  text.add("rail.closed", static_cast<int>(rail.closed));
  text.add("rail.pieces", rail.piece_count);
  text.add("rail.piece_length", rail.piece_length_m);
  for (int k = 0; k <= rail.piece_count; ++k) {
    text.add("rail.knot", rail.knots[static_cast<std::size_t>(k)].position_B_m);
    text.add("rail.knot_d2", rail.knots[static_cast<std::size_t>(k)].d2_B_per_m);
  }
}

void add_table(CanonicalText& text, const char* name, const std::vector<double>& times_s,
               const std::vector<Eigen::Vector3d>& values) {
  text.add(name, static_cast<std::uint64_t>(times_s.size()));
  for (const double time : times_s) text.add("time", time);
  for (const Eigen::Vector3d& value : values) text.add("value", value);
}

void add_mass(CanonicalText& text, const Mass& mass) {
  text.add("mass", mass.mass_kg);
  text.add("rail.shape", static_cast<int>(mass.rail.shape));
  text.add("rail.origin", mass.rail.origin_B_m);
  text.add("rail.axis_cos", mass.rail.axis_cos_B);
  text.add("rail.axis_sin", mass.rail.axis_sin_B);
  text.add("rail.radius", mass.rail.radius_m);
  add_spline(text, mass.rail);
  add_ends(text, mass);
  if (!mass.trajectory.times_s.empty()) {
    add_table(text, "trajectory", mass.trajectory.times_s, mass.trajectory.points_B_m);
    text.add("trajectory.periodic", static_cast<int>(mass.trajectory.periodic));
  }
  text.add("initial_position", mass.initial_position);
  text.add("initial_velocity", mass.initial_velocity);
  text.add("pieces", static_cast<std::uint64_t>(mass.motion.size()));
  for (const MotionPiece& piece : mass.motion) {
    text.add("duration", piece.duration_s);
    text.add("acceleration_start", piece.acceleration_start);
    text.add("acceleration_end", piece.acceleration_end);
  }
  const Motor& motor = mass.motor;
  text.add("steps_per_revolution", motor.steps_per_revolution);
  text.add("microsteps", motor.microsteps);
  text.add("gear_ratio", motor.gear_ratio);
  text.add("travel_per_revolution", motor.travel_per_revolution);
  text.add("holding_torque", motor.holding_torque_nm);
  text.add("detent_torque", motor.detent_torque_nm);
  text.add("rotor_inertia", motor.rotor_inertia_kgm2);
  text.add("viscous_damping", motor.viscous_damping_nms);
  text.add("corner_speed", motor.corner_speed_radps);
  if (motor.has_winding()) {
    text.add("rated_current", motor.rated_current_a);
    text.add("resistance", motor.resistance_ohm);
    text.add("inductance", motor.inductance_h);
    text.add("supply_voltage", motor.supply_voltage_v);
  }
  text.add("step_error", motor.step_error);
  text.add("max_step_rate", motor.max_step_rate_hz);
  text.add("direction_setup", motor.direction_setup_s);
  text.add("max_acceleration", motor.max_acceleration);
  text.add("max_jerk", motor.max_jerk);
  text.add("shaft_ratio", motor.shaft_ratio);
}

// An ideal floor adds no lines.
void add_real_floor(CanonicalText& text, const Surface& surface) {
  if (surface.rolling_resistance > 0 || surface.spin_friction_m > 0) {
    text.add("surface.rolling_resistance", surface.rolling_resistance);
    text.add("surface.spin_friction", surface.spin_friction_m);
    text.add("surface.creep", surface.creep_radps);
  }
  if (surface.slope_rad == 0) return;
  text.add("surface.slope.angle", surface.slope_rad);
  text.add("surface.slope.downhill", surface.downhill_rad);
}

// A floor without patches adds no lines.
void add_patches(CanonicalText& text, const Surface& surface) {
  for (const SurfacePatch& patch : surface.patches) {
    text.add("surface.patch.corners", static_cast<std::uint64_t>(patch.polygon_W_m.size()));
    for (const Eigen::Vector2d& corner : patch.polygon_W_m) text.add("surface.patch.polygon", corner);
    text.add("surface.patch.circle.center", patch.center_W_m);
    text.add("surface.patch.circle.radius", patch.radius_m);
    text.add("surface.patch.static_friction", patch.static_friction);
    text.add("surface.patch.kinetic_friction", patch.kinetic_friction);
    text.add("surface.patch.rolling_resistance", patch.rolling_resistance);
  }
  // The creep matters where some patch resists, though the floor may not.
  if (!surface.patches.empty()) text.add("surface.patch.creep", surface.creep_radps);
}

void add_triad(CanonicalText& text, const char* name, const ImuTriad& triad) {
  text.add("sensors.triad", std::string(name));
  text.add("noise_density", triad.noise_density);
  text.add("bias", triad.bias);
  text.add("bias_walk", triad.bias_walk);
  text.add("scale_error", triad.scale_error);
  text.add("misalignment", triad.misalignment_rad);
  text.add("range", triad.range);
  text.add("resolution", triad.resolution);
}

// Scenarios with ideal sensors add no lines.
void add_sensors(CanonicalText& text, const SensorModel& sensors) {
  if (sensors.attitude_estimated) text.add("sensors.attitude", std::string("estimated"));
  text.add("sensors.rate", sensors.rate_hz);
  text.add("sensors.latency", sensors.latency_s);
  add_triad(text, "gyro", sensors.gyro);
  add_triad(text, "accelerometer", sensors.accelerometer);
  text.add("sensors.accelerometer.position", sensors.accelerometer_position_B_m);
  text.add("sensors.position_fix.rate", sensors.fix.rate_hz);
  text.add("sensors.position_fix.noise", sensors.fix.noise_m);
  text.add("sensors.position_fix.delay", sensors.fix.delay_s);
  for (const double resolution : sensors.encoder_resolution) text.add("sensors.encoder.resolution", resolution);
}

// Scenarios without faults add no lines.
void add_fault(CanonicalText& text, const Fault& fault) {
  text.add("fault", std::string(info(fault.kind).name));
  text.add("fault.time", fault.time_s);
  text.add("fault.end", fault.end_s);
  text.add("fault.value", fault.value);
  text.add("fault.channel", fault.channel);
  text.add("fault.peer", fault.peer ? static_cast<int>(*fault.peer) : -1);
  text.add("fault.sensor", static_cast<int>(fault.sensor));
  text.add("fault.axis", fault.axis);
  text.add("fault.mass", fault.mass);
  text.add("fault.direction", fault.direction_W);
}

void add_believed(CanonicalText& text, const World& believed) {
  text.add("believed.ball.radius", believed.ball.radius_m);
  text.add("believed.ball.mass", believed.ball.mass_kg);
  text.add("believed.ball.inertia", believed.ball.inertia_kgm2);
  text.add("believed.ball.center_of_mass", believed.ball.center_of_mass_B_m);
  text.add("believed.surface.static_friction", believed.surface.static_friction);
  text.add("believed.surface.kinetic_friction", believed.surface.kinetic_friction);
  add_real_floor(text, believed.surface);
  for (const Mass& mass : believed.masses) text.add("believed.mass", mass.mass_kg);
}

// Scenarios whose controller is not governed add no lines.
void add_governor(CanonicalText& text, const Scenario& scenario) {
  if (!scenario.control.governor || !has_controller(scenario.run.actuation)) return;
  text.add("control.governor", 1);
  text.add("control.friction_use", scenario.control.friction_use);
  const Scenario::Control::BeliefError& error = scenario.control.belief_error;
  if (error.mass_share > 0) text.add("control.belief_error.mass", error.mass_share);
  if (error.center_of_mass_m > 0) text.add("control.belief_error.center_of_mass", error.center_of_mass_m);
}

// Scenarios without a controller that tracks add no lines.
void add_tracking(CanonicalText& text, const Scenario& scenario) {
  if (!scenario.control.tracking || !has_controller(scenario.run.actuation)) return;
  text.add("control.tracking", 1);
  if (!scenario.plan.start) return;
  const InitialState& start = *scenario.plan.start;
  const Eigen::Quaterniond& q = start.orientation;
  text.add("plan.start.orientation", Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()));
  text.add("plan.start.angular_velocity", start.angular_velocity_B_radps);
  text.add("plan.start.position", start.position_W_m);
}

}  // namespace

std::int64_t fingerprint(const Scenario& scenario) {
  CanonicalText text;
  text.add("name", scenario.name);
  text.add("duration", scenario.duration_s);
  text.add("gravity", scenario.gravity_mps2);
  text.add("external_force", scenario.external_force_W_n);
  if (!scenario.force_table.times_s.empty()) {
    add_table(text, "external_force.table", scenario.force_table.times_s, scenario.force_table.forces_W_n);
  }
  if (scenario.drag.coefficient_kgpm != 0) {
    text.add("drag.coefficient", scenario.drag.coefficient_kgpm);
    text.add("drag.wind", scenario.drag.wind_W_mps);
  }
  text.add("ball.radius", scenario.ball.radius_m);
  text.add("ball.mass", scenario.ball.mass_kg);
  text.add("ball.inertia", scenario.ball.inertia_kgm2);
  text.add("ball.center_of_mass", scenario.ball.center_of_mass_B_m);
  text.add("surface.static_friction", scenario.surface.static_friction);
  text.add("surface.kinetic_friction", scenario.surface.kinetic_friction);
  text.add("surface.restitution", scenario.surface.restitution);
  add_real_floor(text, scenario.surface);
  add_patches(text, scenario.surface);
  text.add("masses", static_cast<std::uint64_t>(scenario.masses.size()));
  for (const Mass& mass : scenario.masses) add_mass(text, mass);
  const Eigen::Quaterniond& q = scenario.initial.orientation;
  text.add("initial.orientation", Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()));
  text.add("initial.angular_velocity", scenario.initial.angular_velocity_B_radps);
  text.add("initial.position", scenario.initial.position_W_m);
  text.add("initial.has_velocity", static_cast<int>(scenario.initial.has_velocity));
  text.add("initial.velocity", scenario.initial.velocity_W_mps);
  text.add("initial.height", scenario.initial.height_m);
  text.add("run.actuation", static_cast<int>(scenario.run.actuation));
  text.add("run.control_period", scenario.run.control_period_s);
  text.add("run.timer_frequency", scenario.run.timer_frequency_hz);
  text.add("run.on_violation", static_cast<int>(scenario.run.on_violation));
  text.add("run.tolerance", scenario.run.tolerance);
  if (scenario.run.hold_s > 0) text.add("run.hold", scenario.run.hold_s);
  text.add("envelope.min_normal_force", scenario.envelope.min_normal_force_n);
  text.add("envelope.friction_use", scenario.envelope.friction_use);
  add_tracking(text, scenario);
  add_governor(text, scenario);
  if (scenario.sensors.present) add_sensors(text, scenario.sensors);
  if (scenario.believed) add_believed(text, *scenario.believed);
  text.add("seed", scenario.seed);
  for (const Fault& fault : scenario.faults) add_fault(text, fault);

  std::uint64_t hash = 14695981039346656037u;
  for (const char c : text.text()) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211u;
  return hash == 0 ? 1 : static_cast<std::int64_t>(hash);
}

}  // namespace ballast::sim
