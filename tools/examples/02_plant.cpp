// 02: the plant alone, without controller and monitor. A ball with a heavy mass at its side is let go and rocks. It
// rolls without loss, so its energy stays what it was. Prints the time, the energy, the greatest change of it, and the
// least normal force.
#include <cmath>
#include <cstdio>

#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"

using namespace ballast;

// A scenario file as text. read_scenario() reads one from a file.
constexpr const char* kBall = R"(
  name = "pendulum"
  duration = 10.0
  gravity = 9.81
  [ball]
  radius = 0.15
  mass = 0.8
  inertia = [0.012, 0.012, 0.012]
  [surface]
  static_friction = 0.8
  [[mass]]
  mass = 0.4
  rail = { shape = "circle", radius = 0.1, center = [0, 0, 0], axes = [[0, 0, -1], [1, 0, 0]] }
  initial_position = 0.5
  [run]
  actuation = "prescribed"
)";

// Kinetic and potential energy in J. The mass does not move in its rail, so it moves with the shell.
double energy_j(const sim::World& world, const sim::Plant::Sample& now) {
  const Eigen::Vector4d q = now.orientation;
  const Eigen::Matrix3d to_body = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix().transpose();
  const Eigen::Vector3d velocity_B = to_body * now.velocity_W_mps, rate_B = now.angular_velocity_B_radps;
  const sim::Mass& mass = world.masses[0];
  const Eigen::Vector3d place_B = now.mass_position_B_m[0];
  return 0.5 * rate_B.dot(world.ball.inertia_kgm2.cwiseProduct(rate_B)) +
         0.5 * world.ball.mass_kg * velocity_B.squaredNorm() +
         0.5 * mass.mass_kg * (velocity_B + rate_B.cross(place_B)).squaredNorm() +
         mass.mass_kg * world.gravity_mps2 * now.up_B.dot(place_B);
}

int main() {
  const sim::ScenarioResult read = sim::parse_scenario(kBall, "pendulum");
  for (const sim::ScenarioError& error : read.errors) std::printf("%s\n", to_string(error).c_str());
  if (!read.ok()) return 1;

  sim::Plant plant(read.scenario);
  const double before_j = energy_j(read.scenario, plant.sample());
  double greatest_j = 0;
  for (int tick = 1; tick <= 10000 && plant.end() == sim::PhysicsEnd::kNone; ++tick) {
    plant.advance(tick * 0.001, {});  // no step pulses: the mass stays where it is
    greatest_j = std::fmax(greatest_j, std::abs(energy_j(read.scenario, plant.sample()) - before_j));
  }
  std::printf("t %g s, energy %.9g J, changed by %.3g J, least N %.9g N\n", plant.time_s(), before_j, greatest_j,
              plant.extrema().normal_force_min.value);
  return 0;
}
