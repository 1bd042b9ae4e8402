#include "tests/governor/random_robot.h"

#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>

#include "sim/scenario/fingerprint.h"

namespace ballast::governor_test {

namespace {

using Uniform = std::uniform_real_distribution<double>;

class Drawing {
 public:
  Drawing(const Draw& draw, sim::Scenario& scenario, bool desk, std::mt19937_64& random)
      : draw_(draw), out_(scenario), desk_(desk), random_(random) {
    unit_s_ = std::sqrt(out_.ball.radius_m / out_.gravity_mps2);
  }

  void robot() {
    out_.ball.mass_kg *= 1 + has(kShell) * uniform(-0.3, 0.4);
    out_.ball.center_of_mass_B_m += has(kCenter) * vector(0.03 * out_.ball.radius_m);
    for (sim::Mass& mass : out_.masses) mass.mass_kg *= 1 + has(kMasses) * uniform(-0.3, 0.4);
    const Eigen::Vector3d turn = has(kTurn) * vector(desk_ ? 0.3 : 0.1);
    out_.initial.orientation =
        (out_.initial.orientation * Eigen::Quaterniond(1, turn[0] / 2, turn[1] / 2, turn[2] / 2)).normalized();
    const double spin = uniform(0, 0.3) / unit_s_;
    out_.initial.angular_velocity_B_radps = has(kSpin) * vector(spin);
  }

  void floor() {
    sim::Surface& floor = out_.surface;
    // Steppers swing: on less, most starts are refused.
    floor.static_friction =
        std::exp(uniform(std::log(draw_.steppers ? 0.06 : 0.02), std::log(draw_.steppers ? 0.8 : 0.4)));
    floor.kinetic_friction = 0.9 * floor.static_friction;
    const double slope_rad = uniform(0, 2) * std::numbers::pi / 180, downhill_rad = uniform(-3.1, 3.1);
    if (uniform(0, 1) < 0.25 && has(kSlope) > 0) {
      floor.slope_rad = slope_rad;
      floor.downhill_rad = downhill_rad;
    }
    const double resistance = uniform(0.001, 0.02);
    if (uniform(0, 1) < 0.25 && has(kResistance) > 0) floor.rolling_resistance = resistance;
  }

  // A push up to a speed and, for some, back to rest; within the limits of the motors.
  void motion() {
    double speed = uniform(0.1, 0.6) / unit_s_;
    double acceleration = speed / (uniform(0.2, 1) * unit_s_);
    const double ramp_s = uniform(0.02, 0.5) * unit_s_;
    for (std::size_t i = 0; i < out_.masses.size() && draw_.steppers; ++i) {
      // A motor that needs most of its torque loses steps: at most a third is for the acceleration, and 0.4 for
      // friction.
      const sim::Mass& mass = out_.masses[i];
      const sim::Motor& motor = mass.motor;
      acceleration = std::fmin(acceleration, motor.holding_torque_nm * motor.shaft_ratio / 3 / mass.moving_inertia());
      speed = std::fmin(speed, 0.4 * motor.holding_torque_nm / (motor.viscous_damping_nms * motor.shaft_ratio));
    }
    for (std::size_t i = 0; i < out_.masses.size(); ++i) {
      sim::Mass& mass = out_.masses[i];
      sim::Motor& motor = mass.motor;
      const double jerk = acceleration / ramp_s;
      motor.max_step_rate_hz = speed * motor.microsteps_per_rail_unit();
      motor.max_acceleration = acceleration;
      motor.max_jerk = jerk;
      motor.detent_torque_nm *= has(kDetent);
      const double a = uniform(-0.9, 0.9) * acceleration, s = std::fabs(a) / jerk * uniform(1, 3);
      const double longest = 0.9 * speed / std::fabs(a) - s;
      const double hold = longest > 0 ? uniform(0, longest) : 0, wait = uniform(0, 4) * unit_s_;
      const double b = uniform(0, 1) < 0.5 && has(kBrakes) > 0 ? a : 0;
      mass.motion.clear();
      if (!(longest > 0) || !(has(kFirstMotion << i) > 0)) continue;
      mass.motion = {{wait, 0, 0},        {s, 0, a},  {hold, a, a},   {s, a, 0},
                     {3 * unit_s_, 0, 0}, {s, 0, -b}, {hold, -b, -b}, {s, -b, 0}};
    }
  }

  // The controller believes what was drawn so far; the true robot is another one.
  void errors() {
    if (!(draw_.mass_error > 0) && !(draw_.center_error > 0)) return;
    if (draw_.declared) out_.control.belief_error = {draw_.mass_error, draw_.center_error * out_.ball.radius_m};
    out_.believed = static_cast<const sim::World&>(out_);
    out_.belief_is_written = true;
    out_.ball.mass_kg *= 1 + uniform(-1, 1) * draw_.mass_error;
    for (sim::Mass& mass : out_.masses) mass.mass_kg *= 1 + uniform(-1, 1) * draw_.mass_error;
    out_.ball.center_of_mass_B_m += vector(draw_.center_error * out_.ball.radius_m);
    for (int k = 0; k < 3; ++k) out_.ball.inertia_kgm2[k] *= 1 + uniform(-1, 1) * draw_.mass_error;
  }

  [[nodiscard]] double unit_s() const { return unit_s_; }
  double uniform(double least, double most) { return Uniform(least, most)(random_); }

 private:
  Eigen::Vector3d vector(double size) {
    const double x = uniform(-size, size), y = uniform(-size, size), z = uniform(-size, size);
    return {x, y, z};
  }
  [[nodiscard]] double has(unsigned part) const { return (draw_.without & part) == 0 ? 1 : 0; }

  const Draw& draw_;
  sim::Scenario& out_;
  bool desk_;
  std::mt19937_64& random_;
  double unit_s_ = 0;
};

}  // namespace

sim::Scenario random_robot(const Draw& draw) {
  std::mt19937_64 random(draw.seed);
  const bool desk = Uniform(0, 1)(random) < 0.5;
  // 1, 2, 4 or 8 ms for the paper's ball, whose sqrt(r / g) is 1 s; desk_ball's 1 ms are .008 of its own.
  const double period_s = 0.001 * std::exp2(std::floor(Uniform(0, 4)(random)));
  sim::ScenarioResult read =
      sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + (desk ? "/desk_ball.toml" : "/paper_ball.toml"),
                         {draw.steppers ? "run.actuation=stepper" : "run.actuation=ideal"});
  if (!read.ok()) throw std::runtime_error(sim::to_string(read.errors.front()));
  sim::Scenario out = std::move(read.scenario);
  Drawing drawing(draw, out, desk, random);
  drawing.robot();
  drawing.floor();
  drawing.motion();
  drawing.errors();
  if (!desk) out.run.control_period_s = period_s;
  out.duration_s = 15 * drawing.unit_s();
  out.control.governor = true;
  out.control.friction_use = draw.friction_use;
  out.published.clear();
  out.seed = draw.seed;
  out.id = sim::fingerprint(out);
  return out;
}

std::string to_string(unsigned parts) {
  std::string out;
  for (const Part& part : kParts) {
    if ((parts & part.bit) != 0) out += (out.empty() ? "" : ",") + std::string(part.name);
  }
  return out;
}

}  // namespace ballast::governor_test
