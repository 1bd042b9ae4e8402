#include "tools/plan/bounds.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "tools/plan/words.h"

namespace ballast::plan {
namespace {

std::size_t index(int i) { return static_cast<std::size_t>(i); }

// The farthest that the centre of mass gets from the geometric centre.
double farthest_center_m(const firmware::BallParams& ball, double mass_kg) {
  double moment = ball.shell_mass_kg * Eigen::Vector3d(ball.center_of_mass_B_m).norm();
  for (int i = 0; i < ball.mass_count; ++i) {
    const firmware::Rail& rail = ball.rail[index(i)];
    const bool circle = rail.shape == firmware::RailShape::kCircle;
    const double far_m =
        circle ? rail.origin_B_m.norm() + rail.radius_m : ball.radius_m;  // all rails are inside the ball
    moment += ball.mass_kg[index(i)] * std::min(far_m, static_cast<double>(ball.radius_m));
  }
  return moment / mass_kg;
}

// The least time in which a mass gets over the distance, and the limit that says so.
struct Crossing {
  double least_s = 0;
  LimitKind kind = LimitKind::kSpeed;
};

Crossing cross(const MassLimits& limits, double distance, bool to_rest) {
  const Crossing by_speed{distance / limits.speed, LimitKind::kSpeed};
  const Crossing by_acceleration{std::sqrt((to_rest ? 4 : 2) * distance / limits.acceleration),
                                 LimitKind::kAcceleration};
  return by_speed.least_s > by_acceleration.least_s ? by_speed : by_acceleration;
}

}  // namespace

double Reach::least_duration_s(double distance_m, double friction) const {
  return std::sqrt(std::max(0.0, ((distance_m - offset_m) / friction - height_m) * divisor / gravity_mps2));
}

Reach reach_of_friction(const Problem& problem, double duration_s, bool to_rest) {
  const firmware::BallParams& ball = problem.robot.ball;
  double mass_kg = ball.shell_mass_kg;
  Eigen::Vector3d moment = ball.shell_mass_kg * Eigen::Vector3d(ball.center_of_mass_B_m);
  for (int i = 0; i < ball.mass_count; ++i) {
    mass_kg += ball.mass_kg[index(i)];
    moment +=
        ball.mass_kg[index(i)] *
        Eigen::Vector3d(firmware::evaluate<double>(ball.rail[index(i)], problem.start.position[index(i)]).position);
  }
  const auto& q = problem.start.q;
  const Eigen::Vector3d center = Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * moment / mass_kg;
  const double farthest_m = farthest_center_m(ball, mass_kg), aside_m = center.head<2>().norm();
  const Eigen::Vector3d force(ball.external_force_W_n);
  const double sideways_mps2 = force.head<2>().norm() / mass_kg;
  Reach reach;
  reach.gravity_mps2 = std::max(ball.gravity_mps2 - force[2] / mass_kg, 1e-9);
  reach.divisor = to_rest ? 4 : 2;
  reach.height_m = (to_rest ? 3 : 1) * farthest_m - center[2];
  reach.per_friction_m = reach.gravity_mps2 * duration_s * duration_s / reach.divisor + reach.height_m;
  reach.offset_m = aside_m + (to_rest && sideways_mps2 == 0 ? 0 : farthest_m);
  if (!to_rest) reach.offset_m += sideways_mps2 * duration_s * duration_s / 2;
  return reach;
}

std::string immobile(const Problem& problem) {
  constexpr double kLeastTravel = 1e-3;  // of r: moves a ball at rest by less than that
  const double duration_s = problem.task.duration_s;
  std::string why;
  for (int i = 0; i < problem.masses(); ++i) {
    const MassLimits& limits = problem.limits[index(i)];
    const double by_acceleration = limits.acceleration * duration_s * duration_s / 4;
    const double by_speed = limits.speed * duration_s, by_ends = limits.upper - limits.lower;
    const double travel = std::min({by_acceleration, by_speed, by_ends});
    if (!(travel * problem.metres_per_unit[i] < kLeastTravel * problem.robot.ball.radius_m)) return "";
    const LimitKind kind = travel == by_ends    ? LimitKind::kRailEnd
                           : travel == by_speed ? LimitKind::kSpeed
                                                : LimitKind::kAcceleration;
    why += fmt::format("{}{} lets it travel at most {:.2g} m", why.empty() ? "" : ", ",
                       limit_words({kind, i, 0, 0, 0, 0}), travel * problem.metres_per_unit[i]);
  }
  return "no mass can move: " + why + "; the nearest place is the start";
}

std::string mass_too_far(const Problem& problem) {
  for (std::size_t i = 0; i < problem.task.mass_position.size(); ++i) {
    const double travel = std::abs(problem.task.mass_position[i] - problem.start.position[i]);
    const Crossing least = cross(problem.limits[i], travel, problem.task.at_rest);
    if (least.least_s <= problem.task.duration_s) continue;
    return fmt::format(
        "{} stands in the way of task.mass_position.{}: the mass takes at least {:.3g} s to get there, and "
        "task.duration is {:.4g} s",
        limit_words({least.kind, static_cast<int>(i), 0, 0, 0, 0}), i, least.least_s, problem.task.duration_s);
  }
  return "";
}

}  // namespace ballast::plan
