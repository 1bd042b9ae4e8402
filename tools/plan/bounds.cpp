#include "tools/plan/bounds.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tools/plan/words.h"

namespace ballast::plan {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

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

// Mass of ball and masses, and their moment about the geometric centre at the start, space frame.
struct Balance {
  double mass_kg = 0;
  Eigen::Vector3d moment_W;
};

Balance balance_at_start(const Problem& problem) {
  const firmware::BallParams& ball = problem.robot.ball;
  Balance out;
  out.mass_kg = ball.shell_mass_kg;
  Eigen::Vector3d moment = ball.shell_mass_kg * Eigen::Vector3d(ball.center_of_mass_B_m);
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto point = firmware::evaluate<double>(ball.rail[index(i)], problem.start.position[index(i)]);
    out.mass_kg += ball.mass_kg[index(i)];
    moment += ball.mass_kg[index(i)] * Eigen::Vector3d(point.position);
  }
  const auto& q = problem.start.q;
  out.moment_W = Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * moment;
  return out;
}

// Weight and external force: their part in the floor, and the part that presses the ball to it.
Eigen::Vector2d in_the_floor_n(const firmware::BallParams& ball, double mass_kg) {
  return mass_kg * ball.gravity_mps2 * ball.down_W.head<2>() + ball.external_force_W_n.head<2>();
}

double pressing_n(const firmware::BallParams& ball, double mass_kg) {
  return -mass_kg * ball.gravity_mps2 * ball.down_W[2] - ball.external_force_W_n[2];
}

// The longest path of a mass along its rail, in rail units.
double longest_path(const MassLimits& limits, double duration_s) {
  return std::min(limits.speed * duration_s, limits.acceleration * duration_s * duration_s / 2);
}

// The farthest that a rail gets in the direction u. A piece of a spline leaves its chord by at most an eighth of its
// squared length by the greatest |zeta''|, which is linear between its knots.
double farthest_along(const firmware::Rail& rail, double radius_m, const Eigen::Vector3d& u) {
  switch (rail.shape) {
    case firmware::RailShape::kCircle:
      return u.dot(Eigen::Vector3d(rail.origin_B_m)) +
             rail.radius_m *
                 std::hypot(u.dot(Eigen::Vector3d(rail.axis_cos_B)), u.dot(Eigen::Vector3d(rail.axis_sin_B)));
    case firmware::RailShape::kLine:
      if (!std::isfinite(rail.lower_end) || !std::isfinite(rail.upper_end)) return radius_m;
      return std::max(u.dot(firmware::evaluate<double>(rail, rail.lower_end).position),
                      u.dot(firmware::evaluate<double>(rail, rail.upper_end).position));
    case firmware::RailShape::kSpline:
      break;
  }
  double farthest_m = -kInfinity, bend = 0;
  for (std::size_t k = 0; k <= index(rail.piece_count); ++k) {
    farthest_m = std::max(farthest_m, u.dot(Eigen::Vector3d(rail.knots[k].position_B_m)));
    bend = std::max(bend, Eigen::Vector3d(rail.knots[k].d2_B_per_m).norm());
  }
  return farthest_m + rail.piece_length_m * rail.piece_length_m / 8 * bend;
}

// Upper bound of |moment about the geometric centre| over all places that the masses can reach: the greatest of the
// support function over directions a few degrees apart. Between two of them it is off by the cosine at most.
double greatest_moment(const Problem& problem, double duration_s) {
  constexpr int kCircles = 60;  // 3 degrees apart
  constexpr double kApart = std::numbers::pi / kCircles;
  const firmware::BallParams& ball = problem.robot.ball;
  PerMass<Eigen::Vector3d> from;
  for (int i = 0; i < ball.mass_count; ++i) {
    from[index(i)] = firmware::evaluate<double>(ball.rail[index(i)], problem.start.position[index(i)]).position;
  }
  double greatest = 0;
  for (int a = 0; a <= kCircles; ++a) {
    for (int b = 0; b < 2 * kCircles; ++b) {
      const double polar = a * kApart, around = b * kApart;
      const Eigen::Vector3d u(std::sin(polar) * std::cos(around), std::sin(polar) * std::sin(around), std::cos(polar));
      double moment = ball.shell_mass_kg * u.dot(Eigen::Vector3d(ball.center_of_mass_B_m));
      for (int i = 0; i < ball.mass_count; ++i) {
        const firmware::Rail& rail = ball.rail[index(i)];
        const double far_m = std::min(farthest_along(rail, ball.radius_m, u), static_cast<double>(ball.radius_m));
        const double path_m = longest_path(problem.limits[index(i)], duration_s) * problem.metres_per_unit[i];
        moment += ball.mass_kg[index(i)] * std::min(far_m, u.dot(from[index(i)]) + path_m);
      }
      greatest = std::max(greatest, moment);
    }
  }
  return greatest / std::cos(std::numbers::sqrt2 / 2 * kApart);
}

// Limits of a motor: its greatest power, its greatest force in rail units, and where the power is greatest.
struct Strength {
  double power_w = 0, force = 0;
  bool at_most_speed = false;
};

Strength strength_of(const MassLimits& limits, double torque_margin) {
  constexpr int kSpeeds = 100;
  constexpr double kBetween = 1.02;  // power between two of the speeds, torque between two nodes of a plan
  const double ratio = limits.motor->motor().shaft_ratio;
  Strength out;
  out.force = kBetween * (1 - torque_margin) * limits.motor->motor().holding_torque_nm * ratio;
  for (int k = 1; k <= kSpeeds; ++k) {
    const double speed = ratio * limits.speed * k / kSpeeds;
    const double power = kBetween * (1 - torque_margin) * limits.motor->available_torque_nm(speed) * speed;
    if (power < out.power_w) continue;
    out.power_w = power;
    out.at_most_speed = k == kSpeeds;
  }
  return out;
}

// The work of a motor up to a time, and what limits it.
struct Work {
  double joules;
  LimitKind kind;
};

Work work_of(const MassLimits& limits, const Strength& strength, double time_s) {
  const Work by_power{strength.power_w * time_s, strength.at_most_speed ? LimitKind::kSpeed : LimitKind::kTorque};
  const Work by_acceleration{strength.force * limits.acceleration * time_s * time_s / 2, LimitKind::kAcceleration};
  return by_power.joules < by_acceleration.joules ? by_power : by_acceleration;
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
  const Balance balance = balance_at_start(problem);
  const double mass_kg = balance.mass_kg;
  const Eigen::Vector3d center = balance.moment_W / mass_kg;
  const double farthest_m = farthest_center_m(ball, mass_kg), aside_m = center.head<2>().norm();
  const Eigen::Vector3d force(ball.external_force_W_n);
  const double sideways_mps2 = in_the_floor_n(ball, mass_kg).norm() / mass_kg;
  Reach reach;
  reach.gravity_mps2 = std::max(pressing_n(ball, mass_kg) / mass_kg, 1e-9);
  reach.divisor = to_rest ? 4 : 2;
  reach.height_m = (to_rest ? 3 : 1) * farthest_m - center[2];
  reach.per_friction_m = reach.gravity_mps2 * duration_s * duration_s / reach.divisor + reach.height_m;
  reach.offset_m = aside_m + (to_rest && sideways_mps2 == 0 ? 0 : farthest_m);
  if (!to_rest) reach.offset_m += sideways_mps2 * duration_s * duration_s / 2;
  return reach;
}

std::optional<MotorReach> reach_of_motors(const Problem& problem, double duration_s, bool to_rest) {
  const firmware::BallParams& ball = problem.robot.ball;
  if (Eigen::Vector3d(ball.external_force_W_n).norm() > 0 || slopes(ball)) return std::nullopt;
  PerMass<Strength> strength;
  for (int i = 0; i < ball.mass_count; ++i) {
    const MassLimits& limits = problem.limits[index(i)];
    if (!limits.motor || !std::isfinite(limits.speed) || !std::isfinite(limits.acceleration)) return std::nullopt;
    strength[index(i)] = strength_of(limits, problem.task.torque_margin);
  }
  const auto work_j = [&](double time_s) {
    double sum = 0;
    for (int i = 0; i < ball.mass_count; ++i) {
      sum += work_of(problem.limits[index(i)], strength[index(i)], time_s).joules;
    }
    return sum;
  };
  const Balance balance = balance_at_start(problem);
  const double most = greatest_moment(problem, duration_s);
  // Potential energies over the least that there is: at the start, and at a stable rest, where the centre of mass is
  // not above the geometric centre.
  const double at_start_j = ball.gravity_mps2 * std::max(0.0, most + balance.moment_W[2]);
  const double at_rest_j = ball.gravity_mps2 * most;

  constexpr int kSteps = 400;
  const double step_s = duration_s / kSteps;
  double root_j = 0;  // integral of sqrt(E)
  for (int k = 0; k < kSteps; ++k) {
    double energy = at_start_j + work_j((k + 1) * step_s);
    if (to_rest && !resists(problem)) energy = std::min(energy, at_rest_j + work_j(duration_s - k * step_s));
    root_j += std::sqrt(energy) * step_s;
  }
  const double r = ball.radius_m, aside_m = balance.moment_W.head<2>().norm() / balance.mass_kg;
  const double by_all = root_j * std::sqrt(2 / balance.mass_kg) + aside_m + (to_rest ? 0 : most / balance.mass_kg);
  // The centre of mass of a shell that is not balanced may stand still for a moment.
  const bool balanced = Eigen::Vector3d(ball.center_of_mass_B_m).norm() == 0;
  const double shell_kg = (balanced ? ball.shell_mass_kg : 0) + Eigen::Vector3d(ball.inertia_kgm2).minCoeff() / (r * r);
  MotorReach out;
  out.distance_m = shell_kg > 0 ? std::min(by_all, root_j * std::sqrt(2 / shell_kg)) : by_all;
  double strongest_j = -1;
  for (int i = 0; i < ball.mass_count; ++i) {
    const Work work = work_of(problem.limits[index(i)], strength[index(i)], duration_s);
    if (work.joules <= strongest_j) continue;
    strongest_j = work.joules;
    out.limit = {work.kind, i, 0, 0, 0, 0};
  }
  return out;
}

double least_duration_of_motors_s(const Problem& problem, double distance_m, bool to_rest) {
  const auto reaches = [&](double duration_s) {
    const auto reach = reach_of_motors(problem, duration_s, to_rest);
    return !reach || reach->distance_m >= distance_m;
  };
  double less_s = problem.task.duration_s, more_s = 2 * less_s;
  for (int k = 0; k < 30 && !reaches(more_s); ++k) {
    less_s = more_s;
    more_s *= 2;
  }
  while (more_s > 1.01 * less_s) {
    const double middle_s = std::sqrt(less_s * more_s);
    (reaches(middle_s) ? more_s : less_s) = middle_s;
  }
  return less_s;
}

std::string no_rest(const Problem& problem) {
  const firmware::BallParams& ball = problem.robot.ball;
  if (!slopes(ball)) return "";
  const double mass_kg = balance_at_start(problem).mass_kg, weight_n = mass_kg * ball.gravity_mps2;
  const Eigen::Vector2d pull_n = in_the_floor_n(ball, mass_kg);
  const double slope_rad = std::atan2(ball.down_W.head<2>().norm(), -ball.down_W[2]);
  const std::string floor = fmt::format("on a slope of {:.3g} degrees ", slope_rad * 180 / std::numbers::pi);
  // Both forces are to pass through the contact point's vertical plane, since the floor gives no lasting moment about
  // its normal.
  const Eigen::Vector2d downhill = ball.down_W.head<2>().normalized();
  const Eigen::Vector2d force_n = ball.external_force_W_n.head<2>();
  const double across_n = downhill[0] * force_n[1] - downhill[1] * force_n[0];
  if (std::abs(across_n) > 1e-9 * weight_n) {
    return floor + fmt::format(
                       "external_force, {:.3g} N of which go across the slope, spins the ball: nothing holds "
                       "it at rest (task.at_rest)",
                       std::abs(across_n));
  }
  const double need = pull_n.norm() / std::max(pressing_n(ball, mass_kg), 1e-12 * weight_n);
  // The plan may end a little beside the goal.
  const double weight = problem.floor.has_patches() ? problem.floor.least_weight(problem.task.goal_m, 1e-3) : 1;
  if (weight * need > problem.friction_limit) {
    return floor + fmt::format(
                       "friction does not hold a ball at rest (task.at_rest): it needs f_s/N = {:.4g}, and "
                       "friction_use mu_s is {:.3g}{}",
                       need, problem.friction_limit / weight, weight > 1 ? " at the goal (surface.patch)" : "");
  }
  const double least_m = ball.radius_m * std::abs(std::sin(slope_rad) + downhill.dot(force_n) / weight_n);
  const double most_m = greatest_moment(problem, kInfinity) / mass_kg;
  if (least_m <= most_m) return "";
  return floor + fmt::format(
                     "a ball rests only with its centre of mass {:.3g} m or more from the geometric centre "
                     "(task.at_rest), and the masses bring it at most {:.3g} m far",
                     least_m, most_m);
}

std::string immobile(const Problem& problem) {
  const Balance balance = balance_at_start(problem);
  const double r = problem.robot.ball.radius_m;
  const bool hangs =
      balance.moment_W[2] < 0 && balance.moment_W.head<2>().norm() < 1e-3 * std::abs(balance.moment_W[2]);
  if (!hangs || Eigen::Vector3d(problem.robot.ball.external_force_W_n).norm() > 0 || slopes(problem.robot.ball)) {
    return "";
  }
  // A short stroke without any other limit can still rock the ball, period by period.
  constexpr double kFewPeriods = 50;     // of sqrt(r / g): about eight
  constexpr double kLeastTravel = 1e-3;  // of r: moves a ball at rest by less than that
  const double duration_s = problem.task.duration_s;
  std::string why;
  for (int i = 0; i < problem.masses(); ++i) {
    const MassLimits& limits = problem.limits[index(i)];
    const double by_acceleration = limits.acceleration * duration_s * duration_s / 4;
    const double by_speed = limits.speed * duration_s;
    const bool few = duration_s < kFewPeriods * time_unit_s(problem) || limits.motor;
    const double by_ends = few ? limits.upper - limits.lower : kInfinity;
    const double travel = std::min({by_acceleration, by_speed, by_ends});
    if (!(travel * problem.metres_per_unit[i] < kLeastTravel * r)) return "";
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
