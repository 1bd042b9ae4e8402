#include "sim/plant/contact.h"

#include <Eigen/LU>
#include <cmath>
#include <numbers>

namespace ballast::sim {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

Vector2d unit(double angle) { return {std::cos(angle), std::sin(angle)}; }
Vector2d left_of(const Vector2d& e) { return {-e[1], e[0]}; }

// The horizontal part of y while sliding along e.
Vector2d slip_caused(const ContactRelation& contact, double mu, const Vector2d& e) {
  return (contact.free + contact.compliance * sliding_force(contact, mu, e)).head<2>();
}

}  // namespace

double normal_coefficient(const ContactRelation& contact, double kinetic_friction, const Vector2d& e) {
  return contact.compliance(2, 2) - kinetic_friction * contact.compliance.block<1, 2>(2, 0).dot(e);
}

Vector3d sliding_force(const ContactRelation& contact, double kinetic_friction, const Vector2d& e) {
  const double normal = -contact.free[2] / normal_coefficient(contact, kinetic_friction, e);
  return {-normal * kinetic_friction * e[0], -normal * kinetic_friction * e[1], normal};
}

std::optional<Vector2d> slip_direction(const ContactRelation& contact, double kinetic_friction, const Vector2d& towards,
                                       double negligible) {
  // Finds the roots over the circle of the part of y across e. They are few, and much further apart than 1/360 of it.
  constexpr int kScan = 360;
  constexpr double kStep = 2 * std::numbers::pi / kScan;
  const double start = std::atan2(towards[1], towards[0]);
  const auto across = [&](double angle) {
    const Vector2d e = unit(angle);
    return left_of(e).dot(slip_caused(contact, kinetic_friction, e));
  };
  const auto possible = [&](double angle) { return normal_coefficient(contact, kinetic_friction, unit(angle)) > 0; };
  std::optional<Vector2d> best;
  double best_dot = -2;
  for (int i = 0; i < kScan; ++i) {
    // Intervals begin half a step aside, so that `towards` itself, where the root often is, lies inside one.
    double lo = start + (i - 0.5) * kStep, hi = lo + kStep;
    if (!possible(lo) || !possible(hi)) continue;
    double at_lo = across(lo);
    const double at_hi = across(hi);
    if ((at_lo > 0) == (at_hi > 0) && at_lo != 0 && at_hi != 0) continue;
    for (int bisection = 0; bisection < 60 && hi - lo > 0; ++bisection) {
      const double middle = (lo + hi) / 2;
      const double value = across(middle);
      if ((value > 0) == (at_lo > 0)) {
        lo = middle;
        at_lo = value;
      } else {
        hi = middle;
      }
    }
    const Vector2d e = unit((lo + hi) / 2);
    const double normal = sliding_force(contact, kinetic_friction, e)[2];
    const double along = e.dot(slip_caused(contact, kinetic_friction, e));
    if (!(normal > 0) || along < -negligible) continue;
    if (e.dot(towards) > best_dot) {
      best_dot = e.dot(towards);
      best = e;
    }
  }
  return best;
}

Vector2d follow_slip_direction(const ContactRelation& contact, double kinetic_friction, const Vector2d& from) {
  // Newton's method on the part of y across e; the first angle is nearly right.
  const double mu = kinetic_friction;
  double angle = std::atan2(from[1], from[0]);
  for (int i = 0; i < 8; ++i) {
    const Vector2d e = unit(angle), side = left_of(e);
    const double k = normal_coefficient(contact, mu, e);
    const double normal = -contact.free[2] / k;
    const double normal_rate = normal / k * mu * contact.compliance.block<1, 2>(2, 0).dot(side);
    const Vector3d force(-normal * mu * e[0], -normal * mu * e[1], normal);
    const Vector3d force_rate(-mu * (normal_rate * e[0] + normal * side[0]),
                              -mu * (normal_rate * e[1] + normal * side[1]), normal_rate);
    const Vector2d y = (contact.free + contact.compliance * force).head<2>();
    const Vector2d y_rate = (contact.compliance * force_rate).head<2>();
    const double change = -side.dot(y) / (side.dot(y_rate) - e.dot(y));
    if (!(std::abs(change) < 0.5)) return from;
    angle += change;
    if (std::abs(change) < 1e-15) break;
  }
  return unit(angle);
}

std::optional<ImpactImpulse> impact_impulse(const Vector3d& before_W_mps, const Matrix3d& compliance,
                                            double static_friction, double kinetic_friction, double leaving_mps,
                                            std::string& why) {
  const ContactRelation relation{before_W_mps - Vector3d(0, 0, leaving_mps), compliance};
  const Vector3d sticking = -compliance.inverse() * relation.free;
  if (sticking[2] > 0 && sticking.head<2>().norm() <= static_friction * sticking[2]) {
    return ImpactImpulse{sticking, true, Vector2d::Zero()};
  }
  if (std::isinf(kinetic_friction)) {
    why = "perfect friction admits no impulse that ends this impact: the one that stops the slip would have to pull";
    return std::nullopt;
  }
  const Vector2d slip = before_W_mps.head<2>();
  const Vector2d towards = slip.norm() > 0 ? slip : Vector2d(-sticking.head<2>());
  const auto e = slip_direction(relation, kinetic_friction, towards, 1e-12 * before_W_mps.norm());
  if (!e) {
    why = "no impulse obeys both Coulomb's law and Newton's restitution in this impact (Painleve)";
    return std::nullopt;
  }
  const Vector3d impulse = sliding_force(relation, kinetic_friction, *e);
  const Vector2d after = (relation.free + compliance * impulse).head<2>();
  return ImpactImpulse{impulse, false, std::max(0.0, e->dot(after)) * *e};
}

}  // namespace ballast::sim
