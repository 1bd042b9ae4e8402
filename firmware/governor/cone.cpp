#include "firmware/governor/cone.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ballast::firmware {

namespace {

// Part of f_s + kappa N: rounding of the forces, and what the last round of the search for the direction leaves.
constexpr Real kConeTolerance = std::max(Real(1e-9), 64 * std::numeric_limits<Real>::epsilon());

struct Plane {
  Real x, y;
};

Real friction_n(const Vector3& force) { return std::sqrt(force[0] * force[0] + force[1] * force[1]); }

Real clipped(Real value, Real lower, Real upper) { return value < lower ? lower : (value > upper ? upper : value); }

class Projector {
 public:
  Projector(const AffineForces& forces, int mass_count, const Box& box, const PerMass<Real>& unit,
            const PerMass<Real>& nominal)
      : forces_(forces), n_(static_cast<std::size_t>(mass_count)), box_(box), unit_(unit) {
    for (std::size_t i = 0; i < n_; ++i) nominal_[i] = clipped(nominal[i], box.lower[i], box.upper[i]);
  }

  [[nodiscard]] const PerMass<Real>& nominal() const { return nominal_; }
  [[nodiscard]] Vector3 force(const PerMass<Real>& u) const { return forces_.force(static_cast<int>(n_), u); }

  // The nearest u of the box with level + sum gradient_i u_i >= 0. u(m) = nominal + m unit^2 gradient inside the box
  // makes the sum a rising, concave, piecewise linear function of m. Newton's method from m = 0 therefore never passes
  // the root, and each step but the last passes a corner: n + 1 steps are enough. No root: the u with the greatest sum.
  [[nodiscard]] PerMass<Real> nearest(Real level, const PerMass<Real>& gradient) const {
    PerMass<Real> u = nominal_;
    Real multiplier = 0;
    for (std::size_t step = 0; step <= n_; ++step) {
      Real value = level, slope = 0;
      for (std::size_t i = 0; i < n_; ++i) {
        value += gradient[i] * u[i];
        const bool rises = gradient[i] > 0 ? u[i] < box_.upper[i] : u[i] > box_.lower[i];
        if (rises) slope += unit_[i] * unit_[i] * gradient[i] * gradient[i];
      }
      if (!(value < 0) || !(slope > 0)) break;
      multiplier -= value / slope;
      for (std::size_t i = 0; i < n_; ++i) {
        u[i] = clipped(nominal_[i] + multiplier * unit_[i] * unit_[i] * gradient[i], box_.lower[i], box_.upper[i]);
      }
    }
    return u;
  }

  // N >= least_n.
  [[nodiscard]] PerMass<Real> pressed(Real least_n) const {
    PerMass<Real> gradient{};
    for (std::size_t i = 0; i < n_; ++i) gradient[i] = forces_.force_per_unit[i][2];
    return nearest(forces_.force_W_n[2] - least_n, gradient);
  }

  // friction N - e . f >= slack for one direction e of the floor.
  [[nodiscard]] PerMass<Real> held(const Plane& e, Real friction, Real slack_n) const {
    const auto level = [&](const Vector3& f) { return friction * f[2] - e.x * f[0] - e.y * f[1]; };
    PerMass<Real> gradient{};
    for (std::size_t i = 0; i < n_; ++i) gradient[i] = level(forces_.force_per_unit[i]);
    return nearest(level(forces_.force_W_n) - slack_n, gradient);
  }

 private:
  const AffineForces& forces_;
  std::size_t n_;
  const Box& box_;
  const PerMass<Real>& unit_;
  PerMass<Real> nominal_{};
};

// The u with the least violation so far.
struct Best {
  PerMass<Real> u{};
  Real violation_n = std::numeric_limits<Real>::infinity();

  void take(const PerMass<Real>& candidate, Real candidate_violation_n) {
    if (!(candidate_violation_n < violation_n)) return;
    u = candidate;
    violation_n = candidate_violation_n;
  }
};

Plane between(const Plane& a, Real of_a, const Plane& b, Real of_b) {
  const Real x = of_a * a.x + of_b * b.x, y = of_a * a.y + of_b * b.y;
  const Real length = std::sqrt(x * x + y * y);
  if (!(length > 0)) return a;
  return {x / length, y / length};
}

// The cone is the intersection of the half spaces friction N - e . f >= slack over all directions e, and the nearest
// point of the cone is that of one of them: of the e along which its own friction lies. The distance to a half space
// has one maximum over e, and rises towards the side on which the friction of its nearest point lies. So the direction
// is a root that a bracket closes in on; Illinois' rule on the chord between the bracket's ends.
Best nearest_in_cone(const Projector& projector, Real friction, Real slack_n) {
  Best best;
  const Vector3 first = projector.force(projector.nominal());
  const Real first_n = friction_n(first);
  Plane e = first_n > 0 ? Plane{first[0] / first_n, first[1] / first_n} : Plane{1, 0};
  Plane left = e, right = e;       // the root lies counter-clockwise of right and clockwise of left
  Real at_left = 0, at_right = 0;  // friction across them; 0: that end is not known yet
  for (int step = 0; step < kMostConeSteps; ++step) {
    const PerMass<Real> u = projector.held(e, friction, slack_n);
    const Vector3 force = projector.force(u);
    const Real size_n = friction_n(force), tolerance_n = kConeTolerance * (size_n + std::fabs(friction * force[2]));
    best.take(u, size_n - (friction * force[2] - slack_n));
    if (!(best.violation_n > tolerance_n)) break;
    const Real across = e.x * force[1] - e.y * force[0];
    if (across > 0) {
      if (at_right > 0) at_left /= 2;
      right = e, at_right = across;
    } else {
      if (at_left < 0) at_right /= 2;
      left = e, at_left = across;
    }
    if (at_right > 0 && at_left < 0) {
      e = between(right, -at_left, left, at_right);
    } else {
      if (!(size_n > 0)) break;
      e = {force[0] / size_n, force[1] / size_n};
    }
  }
  return best;
}

}  // namespace

Real outside_n(const Cone& cone, const Vector3& force_W_n) {
  const Real lifted_n = cone.min_normal_force_n - force_W_n[2];
  if (std::isinf(cone.friction)) return lifted_n;
  const Real slips_n = friction_n(force_W_n) - cone.friction * force_W_n[2] + cone.slack_n;
  return lifted_n > slips_n ? lifted_n : slips_n;
}

Projection project(const AffineForces& forces, int mass_count, const Cone& cone, const Box& box,
                   const PerMass<Real>& unit, const PerMass<Real>& nominal) {
  const Projector projector(forces, mass_count, box, unit, nominal);
  Projection out;
  out.u = projector.nominal();
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) out.bent |= out.u[i] != nominal[i];
  const Real outside = outside_n(cone, projector.force(out.u));
  if (outside <= 0) return out;
  out.bent = true;
  if (std::isnan(outside)) {
    out.empty = true;
    out.violation_n = std::numeric_limits<Real>::infinity();
    return out;
  }
  if (std::isinf(cone.friction)) {
    out.u = projector.pressed(cone.min_normal_force_n);
  } else {
    out.u = nearest_in_cone(projector, cone.friction, cone.slack_n).u;
    if (projector.force(out.u)[2] < cone.min_normal_force_n) {
      const Real tip_n = cone.friction * cone.min_normal_force_n;
      out.u = nearest_in_cone(projector, cone.friction, tip_n > cone.slack_n ? tip_n : cone.slack_n).u;
    }
  }
  const Vector3 force = projector.force(out.u);
  const Real still_n = outside_n(cone, force);
  const Real size_n = friction_n(force) + std::fabs(force[2]) + std::fabs(cone.min_normal_force_n);
  out.empty = !(still_n <= 4 * kConeTolerance * size_n);
  out.violation_n = out.empty ? still_n : 0;
  return out;
}

}  // namespace ballast::firmware
