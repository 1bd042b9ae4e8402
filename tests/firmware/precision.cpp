// Compiled twice: with each of the firmware's two libraries.
#include "tests/firmware/precision.h"

#include <memory>

#include "firmware/model/rolling.h"
#include "tests/firmware/paper_ball.h"
#include "tests/firmware/whole_tick.h"

namespace precision {

namespace firmware = ballast::firmware;
using firmware::Real;

namespace {

Real real(double x) { return static_cast<Real>(x); }
firmware::Vector3 vector(const std::array<double, 3>& v) { return {real(v[0]), real(v[1]), real(v[2])}; }
firmware::Quaternion quaternion(const std::array<double, 4>& q) {
  return {real(q[0]), real(q[1]), real(q[2]), real(q[3])};
}

Envelope envelope(const firmware::RollingForces& f) {
  Real mu = 0, margin = 0;
  firmware::friction_use(f, real(0.35), mu, margin);
  return {f.normal_force_n, f.static_friction_n, mu};
}

}  // namespace

template <>
Envelope envelope_of<Real>(const State& s) {
  firmware::BallParams ball;
  ball.radius_m = real(s.radius_m);
  ball.gravity_mps2 = real(s.gravity_mps2);
  ball.shell_mass_kg = real(s.shell_mass_kg);
  ball.inertia_kgm2 = vector(s.inertia_kgm2);
  ball.center_of_mass_B_m = vector(s.center_of_mass_B_m);
  ball.external_force_W_n = vector(s.force_W_n);
  ball.mass_count = 3;
  firmware::MassMotion masses;
  for (std::size_t i = 0; i < 3; ++i) {
    ball.mass_kg[i] = real(s.mass_kg[i]);
    ball.rail[i] = firmware::circle_about(real(s.rail_radius_m[i]), real(s.azimuth_rad[i]), real(s.elevation_rad[i]));
    masses.position[i] = real(s.position_rad[i]);
    masses.velocity[i] = real(s.velocity_radps[i]);
    masses.acceleration[i] = real(s.acceleration_radps2[i]);
  }
  return envelope(firmware::rolling_forces(ball, quaternion(s.orientation), vector(s.omega_B_radps), masses));
}

template <>
PaperRun paper_run<Real>(int ticks, int stop_tick) {
  PaperRun run;
  const auto params = std::make_unique<firmware::ControllerParams>(firmware::testing::paper_params());
  const auto state = std::make_unique<firmware::ControllerState>();
  const auto out = std::make_unique<firmware::Outputs>();
  run.accepted = validate(*params).ok();
  if (!run.accepted) return run;
  reset(*params, *state);
  firmware::Inputs in;
  for (int k = 0; k < ticks; ++k) {
    const double t = k * 1e-3;
    in.tick = in.sensors.tick = in.monitor.tick = k;
    in.sensors.orientation = quaternion({std::cos(t / 3), std::sin(t / 3), 0, 0});
    in.sensors.gyro_B_radps = vector({2.0 / 3, 0, 0});
    in.operator_command = firmware::OperatorCommand::kNone;
    if (k == 1) in.operator_command = firmware::OperatorCommand::kArm;
    if (k == 2) in.operator_command = firmware::OperatorCommand::kStart;
    if (k == stop_tick) in.operator_command = firmware::OperatorCommand::kStop;
    if (stop_tick >= 0 && k > stop_tick && state->mode == firmware::Mode::kArmed) {
      firmware::MoveRequest move;
      move.masses = 7;
      move.target_position = {0.5, 2.5, -1.25};
      if (k < stop_tick + 5000) in.operator_command = move;
    }
    whole_tick(*params, *state, in, *out);
    run.envelope.push_back(envelope(out->status.predicted));
    for (int b = 0; b < out->steps.burst_count; ++b) {
      const firmware::StepBurst& burst = out->steps.bursts[static_cast<std::size_t>(b)];
      run.pulses.push_back({out->steps.tick, burst.motor, burst.direction, burst.count, burst.first_ticks,
                            burst.interval_ticks, burst.add_ticks});
    }
    if (out->status.planned && out->status.plan_tick == k + 1) {
      const firmware::Prediction& p = out->status.plan;
      run.plans.push_back({p.duration_s, p.normal_force_min_n, p.mu_required_max, p.margin_min, static_cast<double>(k),
                           static_cast<double>(out->status.mode)});
    }
  }
  return run;
}

}  // namespace precision
