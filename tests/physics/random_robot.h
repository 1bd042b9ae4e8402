// Robots, floors, forces and motions that nobody designed, for tests. Everything comes from one seed.
#pragma once

#include <cmath>
#include <random>

#include "sim/scenario/scenario.h"

namespace ballast::test {

class RandomRobot {
 public:
  explicit RandomRobot(std::uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine_); }
  int integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }
  Eigen::Vector3d vector(double size) { return {uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }
  Eigen::Vector3d direction() {
    for (;;) {
      const Eigen::Vector3d v = vector(1);
      if (v.norm() > 0.1 && v.norm() < 1) return v.normalized();
    }
  }
  Eigen::Quaterniond attitude() { return Eigen::Quaterniond(Eigen::AngleAxisd(uniform(0, 3), direction())); }

  // A circle or a line inside a ball of this radius.
  firmware::Rail rail(double ball_radius_m) {
    if (integer(0, 2) == 0) return firmware::line(0.3 * ball_radius_m * direction(), direction());
    const Eigen::Vector3d x = direction();
    const Eigen::Vector3d y = x.cross(direction()).normalized();
    return firmware::circle(0.2 * ball_radius_m * direction(), ball_radius_m * uniform(0.1, 0.75), x, y);
  }

  // Makes the floor slope and resist. Every second robot has a creep rate near its own rates.
  void make_floor_real(sim::Scenario& s) {
    const double r = s.ball.radius_m;
    s.surface.rolling_resistance = uniform(0.005, 0.1);
    s.surface.spin_friction_m = r * uniform(0.001, 0.05);
    s.surface.creep_radps = integer(0, 1) == 0 ? 0 : uniform(0.1, 1) * std::sqrt(s.gravity_mps2 / r);
    s.surface.slope_rad = uniform(0.02, 0.4);
    s.surface.downhill_rad = uniform(-4, 4);
  }

  // A robot with `mass_count` masses, at rest or slowly turning, pushed by a small force; its motion is gentle enough
  // to keep it on the ground most of the time. Perfect friction.
  sim::Scenario scenario(int mass_count) {
    sim::Scenario s;
    s.name = "random";
    s.duration_s = uniform(1, 4);
    s.run.control_period_s = uniform(0.0005, 0.05);
    s.run.actuation = sim::Actuation::kPrescribed;
    s.ball.radius_m = uniform(0.08, 1.2);
    s.gravity_mps2 = uniform(1, 12);
    const double r = s.ball.radius_m;
    s.ball.mass_kg = uniform(0.3, 2);
    // Three principal moments of some body always satisfy the triangle inequality: sums of pairs of positive numbers.
    const double a = uniform(0.1, 0.4), b = uniform(0.1, 0.4), c = uniform(0.1, 0.4);
    s.ball.inertia_kgm2 = s.ball.mass_kg * r * r * Eigen::Vector3d(a + b, b + c, a + c);
    s.ball.center_of_mass_B_m = 0.1 * r * direction();
    const double rate = std::sqrt(s.gravity_mps2 / r);  // of the ball as a pendulum
    for (int i = 0; i < mass_count; ++i) {
      sim::Mass m;
      m.mass_kg = uniform(0.02, 0.3);
      m.rail = rail(r);
      const bool circle = m.rail.shape == firmware::RailShape::kCircle;
      const double unit = circle ? 1 : 0.2 * r;
      m.initial_position = unit * uniform(-1, 1);
      m.initial_velocity = circle ? rate * uniform(-0.2, 0.2) : 0;
      const int pieces = integer(0, 4);
      for (int p = 0; p < pieces; ++p) {
        const double jump = rate * rate * unit;
        m.motion.push_back({uniform(0.02, 0.5), jump * uniform(-0.3, 0.3), jump * uniform(-0.3, 0.3)});
      }
      // The motors only matter to driven runs; here any sound one will do.
      m.motor.shaft_ratio = 1;
      m.motor.holding_torque_nm = m.mass_kg * s.gravity_mps2 * 10;
      m.motor.rotor_inertia_kgm2 = 0.1 * m.mass_kg * unit * unit;
      m.motor.corner_speed_radps = 1e3;
      m.motor.max_step_rate_hz = 1e5;
      m.motor.max_acceleration = 10 * rate * rate * unit;
      s.masses.push_back(m);
    }
    s.external_force_W_n = 0.05 * s.ball.mass_kg * s.gravity_mps2 * vector(1);
    s.initial.orientation = attitude();
    s.initial.angular_velocity_B_radps = rate * vector(0.3);
    s.initial.position_W_m = vector(1).head<2>();
    return s;
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace ballast::test
