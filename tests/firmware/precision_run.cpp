// precision_run states SEED | motion | stop: results of the firmware as rows of numbers, one row a line: its name, then
// the numbers in hexadecimal. Built with the model in double and in single precision, so that a test can compare the
// two.
#include <fmt/core.h>

#include <cmath>
#include <cstdlib>
#include <memory>
#include <random>
#include <string_view>

#include "firmware/model/rolling.h"
#include "tests/firmware/paper_ball.h"
#include "tests/firmware/whole_tick.h"

namespace ballast::firmware {
namespace {

Real real(double x) { return static_cast<Real>(x); }

template <class... Numbers>
void row(std::string_view name, Numbers... numbers) {
  fmt::print("{}", name);
  for (const double number : {static_cast<double>(numbers)...}) fmt::print(" {:a}", number);
  fmt::print("\n");
}

void row_of(std::string_view name, const RollingForces& forces, double scale_n) {
  Real mu = 0, margin = 0;
  friction_use(forces, real(0.35), mu, margin);
  row(name, forces.normal_force_n, forces.static_friction_n, mu, scale_n);
}

// A ball with three masses on circles in a random state. `scale_n`: the sum of the terms of its forces, which are the
// weight and the centripetal and tangential force of every mass.
void random_state(std::mt19937_64& random) {
  const auto in = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  const auto three = [&](double size) {
    const double x = in(-size, size), y = in(-size, size), z = in(-size, size);
    return Vector3(real(x), real(y), real(z));
  };
  const double radius_m = in(0.1, 1), gravity_mps2 = 9.81, shell_kg = in(0.5, 2);
  const double moment = 2. / 3 * shell_kg * radius_m * radius_m;
  BallParams ball;
  ball.radius_m = real(radius_m);
  ball.gravity_mps2 = real(gravity_mps2);
  ball.shell_mass_kg = real(shell_kg);
  for (int j = 0; j < 3; ++j) ball.inertia_kgm2[j] = real(moment * in(0.9, 1.1));
  ball.center_of_mass_B_m = three(0.1 * radius_m);
  ball.external_force_W_n = three(0.5);
  ball.mass_count = 3;
  const Vector3 omega = three(3);
  const double spin = std::sqrt(static_cast<double>(omega.dot(omega)));
  double scale_n = shell_kg * gravity_mps2 + 1;
  MassMotion masses;
  for (std::size_t i = 0; i < 3; ++i) {
    const double mass_kg = in(0.1, 1), rail_m = radius_m * in(0.5, 0.95), azimuth = in(-3, 3);
    const double elevation = in(-1, 1.5);  // near the pole Frisvad's frame divides by a difference of few digits
    const double position = in(-10, 10), velocity = in(-3, 3), acceleration = in(-10, 10);
    ball.mass_kg[i] = real(mass_kg);
    ball.rail[i] = circle_about(real(rail_m), real(azimuth), real(elevation));
    masses.position[i] = real(position);
    masses.velocity[i] = real(velocity);
    masses.acceleration[i] = real(acceleration);
    const double rate = spin + std::fabs(velocity);
    scale_n += mass_kg * (gravity_mps2 + radius_m * (rate * rate + std::fabs(acceleration)));
  }
  std::normal_distribution<double> normal;
  const double w = normal(random), x = normal(random), y = normal(random), z = normal(random);
  const double length = std::sqrt(w * w + x * x + y * y + z * z);
  const Quaternion q(real(w / length), real(x / length), real(y / length), real(z / length));
  row_of("state", rolling_forces(ball, q, omega, masses), scale_n);
}

// The paper's ball and motion in ticks of 1 ms: armed, started, stopped at stop_tick (-1: not), then moved. The sensed
// attitude turns as the sines and cosines of the time.
int paper_run(int ticks, int stop_tick) {
  const auto params = std::make_unique<ControllerParams>(testing::paper_params());
  const auto state = std::make_unique<ControllerState>();
  const auto out = std::make_unique<Outputs>();
  if (!validate(*params).ok()) return 1;
  reset(*params, *state);
  Inputs in;
  for (int k = 0; k < ticks; ++k) {
    const double t = k * 1e-3;
    in.tick = in.sensors.tick = in.monitor.tick = k;
    in.sensors.orientation = Quaternion(real(std::cos(t / 3)), real(std::sin(t / 3)), 0, 0);
    in.sensors.gyro_B_radps = Vector3(real(2.0 / 3), 0, 0);
    in.operator_command = OperatorCommand::kNone;
    if (k == 1) in.operator_command = OperatorCommand::kArm;
    if (k == 2) in.operator_command = OperatorCommand::kStart;
    if (k == stop_tick) in.operator_command = OperatorCommand::kStop;
    if (stop_tick >= 0 && k > stop_tick && k < stop_tick + 5000 && state->mode == Mode::kArmed) {
      MoveRequest move;
      move.masses = 7;
      move.target_position = {0.5, 2.5, -1.25};
      in.operator_command = move;
    }
    whole_tick(*params, *state, in, *out);
    row_of("tick", out->status.predicted, 8);  // the weight is 4 N, the terms together up to 8 N
    for (int b = 0; b < out->steps.burst_count; ++b) {
      const StepBurst& burst = out->steps.bursts[static_cast<std::size_t>(b)];
      row("burst", out->steps.tick, burst.motor, burst.direction, burst.count, burst.first_ticks, burst.interval_ticks,
          burst.add_ticks);
    }
    if (out->status.planned && out->status.plan_tick == k + 1) {
      const Prediction& p = out->status.plan;
      row("plan", p.duration_s, p.normal_force_min_n, p.mu_required_max, p.margin_min, k,
          static_cast<int>(out->status.mode));
    }
  }
  return 0;
}

}  // namespace
}  // namespace ballast::firmware

int main(int argc, char** argv) {
  const std::string_view what = argc >= 2 ? argv[1] : "";
  if (what == "motion") return ballast::firmware::paper_run(20'000, -1);
  if (what == "stop") return ballast::firmware::paper_run(12'000, 3'000);
  if (what != "states" || argc != 3) return 2;
  std::mt19937_64 random(std::strtoull(argv[2], nullptr, 10));
  for (int k = 0; k < 20'000; ++k) ballast::firmware::random_state(random);
  return 0;
}
