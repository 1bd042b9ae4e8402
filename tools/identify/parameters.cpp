#include "tools/identify/parameters.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace ballast::identify {

namespace {

constexpr double kCenterScale = 0.1;       // of the radius
constexpr double kResistanceScale = 0.01;  // rubber on linoleum (floors.md)

}  // namespace

Parameters::Parameters(const Known& known, double total_mass_kg)
    : masses_(known.robot.ball.mass_count), total_mass_kg_(total_mass_kg), robot_(known.robot) {
  const firmware::BallParams& ball = known.robot.ball;
  double believed_kg = ball.shell_mass_kg;
  for (int i = 0; i < masses_; ++i) believed_kg += ball.mass_kg[static_cast<std::size_t>(i)];
  const double factor = total_mass_kg / believed_kg;
  believed_.resize(count());
  for (int i = 0; i < masses_; ++i) believed_[i] = factor * ball.mass_kg[static_cast<std::size_t>(i)];
  believed_.segment<3>(center_of_mass()) = ball.center_of_mass_B_m;
  believed_.segment<3>(inertia()) = factor * ball.inertia_kgm2;
  believed_[rolling_resistance()] = ball.rolling_resistance;
  scale_ = believed_;
  scale_.segment<3>(center_of_mass()).setConstant(kCenterScale * ball.radius_m);
  scale_[rolling_resistance()] = kResistanceScale;
}

double Parameters::time_unit_s() const { return std::sqrt(robot_.ball.radius_m / robot_.ball.gravity_mps2); }

std::string Parameters::name(int parameter) const {
  if (parameter < masses_) return fmt::format("mass.{}.mass", parameter);
  if (parameter < inertia()) return fmt::format("ball.center_of_mass.{}", parameter - center_of_mass());
  if (parameter < rolling_resistance()) return fmt::format("ball.inertia.{}", parameter - inertia());
  return "surface.rolling_resistance";
}

std::string Parameters::unit(int parameter) const {
  if (parameter < masses_) return "kg";
  if (parameter < inertia()) return "m";
  return parameter < rolling_resistance() ? "kg m^2" : "";
}

bool Parameters::possible(const Eigen::VectorXd& values) const {
  if (!values.allFinite() || !(values.head(masses_).minCoeff() > 0) || !(shell_mass_kg(values) > 0)) return false;
  if (!(values.segment<3>(inertia()).minCoeff() > 0)) return false;
  return values.segment<3>(center_of_mass()).norm() < robot_.ball.radius_m;
}

plan::Robot Parameters::robot(const Eigen::VectorXd& values) const {
  plan::Robot robot = robot_;
  for (int i = 0; i < masses_; ++i) robot.ball.mass_kg[static_cast<std::size_t>(i)] = values[i];
  robot.ball.shell_mass_kg = shell_mass_kg(values);
  robot.ball.center_of_mass_B_m = values.segment<3>(center_of_mass());
  robot.ball.inertia_kgm2 = values.segment<3>(inertia());
  robot.ball.rolling_resistance = std::max(0.0, values[rolling_resistance()]);
  return robot;
}

}  // namespace ballast::identify
