#include "firmware/governor/cone.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ballast::firmware {

namespace {

// Part of f_s + kappa N: rounding of the forces, and what the last round of the search for the direction leaves.
constexpr Real kConeTolerance = std::max(Real(1e-9), 64 * std::numeric_limits<Real>::epsilon());

// The secant in the search for the direction goes further by the factor kBeyond, and at most kFarthest times the last
// step.
constexpr Real kBeyond = Real(1.05);
constexpr Real kFarthest = 8;
// Beyond so many rounds every third one halves the bracket, whatever the forces look like.
constexpr int kUsualSteps = 12;
// Rounds of a search that has met a half space without a point of the box: nothing is inside, and these find nearly the
// least violation.
constexpr int kEmptySteps = 8;

// Part of the bound of all errors that is kept free across the friction: the errors of several masses, each the sum of
// three of different frequencies, are not all greatest at once. Along it, where they are first order, it is all.
constexpr Real kWorstPhases = Real(0.9);

struct Plane {
  Real x, y;
};

Real along(const Plane& e, Real friction, const Vector3& force) {
  return e.x * force[0] + e.y * force[1] - friction * force[2];
}

// Slack for a direction of the friction.
Real slack_along(const Cone& cone, const AffineForces& forces, std::size_t n, const Plane& e) {
  Real slack_n = cone.slack_n;
  for (std::size_t i = 0; i < n; ++i) {
    if (cone.error[i] > 0) slack_n += cone.error[i] * std::fabs(along(e, cone.friction, forces.force_per_unit[i]));
  }
  return slack_n;
}

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

  // A projector whose nominal is the u with the greatest N.
  [[nodiscard]] Projector from_most_pressed() const {
    Real least_n = 1 + std::fabs(forces_.force_W_n[2]);
    for (std::size_t i = 0; i < n_; ++i) {
      const Real far = std::fmax(std::fabs(box_.lower[i]), std::fabs(box_.upper[i]));
      least_n += 2 * far * std::fabs(forces_.force_per_unit[i][2]);
    }
    Projector out = *this;
    out.nominal_ = pressed(least_n);
    return out;
  }

  // N >= least_n.
  [[nodiscard]] PerMass<Real> pressed(Real least_n) const {
    PerMass<Real> gradient{};
    for (std::size_t i = 0; i < n_; ++i) gradient[i] = forces_.force_per_unit[i][2];
    return nearest(forces_.force_W_n[2] - least_n, gradient);
  }

  // The cone's half space for one direction e of the floor.
  [[nodiscard]] PerMass<Real> held(const Plane& e, const Cone& cone) const {
    PerMass<Real> gradient{};
    for (std::size_t i = 0; i < n_; ++i) gradient[i] = -along(e, cone.friction, forces_.force_per_unit[i]);
    return nearest(-along(e, cone.friction, forces_.force_W_n) - slack_along(cone, forces_, n_, e), gradient);
  }

  // By how much a force is outside of it.
  [[nodiscard]] Real beyond(const Plane& e, const Cone& cone, const Vector3& force) const {
    return along(e, cone.friction, force) + slack_along(cone, forces_, n_, e);
  }

  [[nodiscard]] Real outside(const Cone& cone, const PerMass<Real>& u) const {
    return outside_n(cone, forces_, static_cast<int>(n_), u);
  }

  [[nodiscard]] Real cost(const PerMass<Real>& u) const {
    Real sum = 0;
    for (std::size_t i = 0; i < n_; ++i) {
      const Real off = (u[i] - nominal_[i]) / unit_[i];
      sum += off * off;
    }
    return sum;
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
  bool inside = false;
  bool empty = false;  // some half space has no point of the box
  int steps = 0;       // of the search

  void take(const PerMass<Real>& candidate, Real candidate_violation_n, Real tolerance_n) {
    if (!(candidate_violation_n < violation_n)) return;
    u = candidate;
    violation_n = candidate_violation_n;
    inside = violation_n <= tolerance_n;
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
//
// `e` is the direction to begin with.
void search_direction(const Projector& projector, const Cone& cone, Plane e, Best& best) {
  Plane left = e, right = e, last = e;  // the root lies counter-clockwise of right and clockwise of left
  Real at_left = 0, at_right = 0;       // friction across them; 0: that end is not known yet
  Real at_last = 0;
  int last_side = 0;
  for (int step = 0; step < kMostConeSteps; ++step) {
    ++best.steps;
    const PerMass<Real> u = projector.held(e, cone);
    const Vector3 force = projector.force(u);
    const Real size_n = friction_n(force);
    const Real tolerance_n = kConeTolerance * (size_n + std::fabs(cone.friction * force[2]));
    best.take(u, projector.outside(cone, u), tolerance_n);
    if (best.inside || !(size_n > 0)) return;
    best.empty |= projector.beyond(e, cone, force) > 4 * tolerance_n;
    if (best.empty && step + 1 >= kEmptySteps) return;
    const Real across = e.x * force[1] - e.y * force[0];
    const int side = across > 0 ? 1 : -1;
    if (side > 0) {
      if (side == last_side) at_left /= 2;
      right = e, at_right = across;
    } else {
      if (side == last_side) at_right /= 2;
      left = e, at_left = across;
    }
    last_side = side;
    const Plane here = e;
    if (at_right > 0 && at_left < 0) {
      e = step > kUsualSteps && step % 3 == 0 ? between(right, 1, left, 1) : between(right, -at_left, left, at_right);
    } else {
      // One-sided so far: the secant through the last two, a little further so that the root comes between; first the
      // direction of the friction itself.
      const Real ahead = step > 0 ? kBeyond * across / (at_last - across) : 0;
      const bool usable = ahead > 0 && ahead < kFarthest;
      e = usable ? between(here, 1 + ahead, last, -ahead) : Plane{force[0] / size_n, force[1] / size_n};
    }
    last = here;
    at_last = across;
  }
}

// The search begins along the nominal's friction. Where N falls to 0 on the way its distance may have two maxima, and
// the search may not end; the farthest of eight half spaces is then a better beginning.
PerMass<Real> nearest_in_cone(const Projector& projector, const Cone& cone, int most_steps, int& steps) {
  Best best;
  const auto answer = [&] {
    steps += best.steps;
    return best.u;
  };
  const Vector3 first = projector.force(projector.nominal());
  const Real first_n = friction_n(first);
  search_direction(projector, cone, first_n > 0 ? Plane{first[0] / first_n, first[1] / first_n} : Plane{1, 0}, best);
  if (best.inside || best.empty || steps + best.steps >= most_steps) return answer();
  constexpr Real kHalf = Real(0.70710678118654752);
  constexpr Plane kAround[8] = {{1, 0},  {kHalf, kHalf},   {0, 1},  {-kHalf, kHalf},
                                {-1, 0}, {-kHalf, -kHalf}, {0, -1}, {kHalf, -kHalf}};
  Real farthest = -1;
  Plane begin = kAround[0];
  for (const Plane& e : kAround) {
    const Real cost = projector.cost(projector.held(e, cone));
    if (!(cost > farthest)) continue;
    farthest = cost;
    begin = e;
  }
  best.steps += 8;
  search_direction(projector, cone, begin, best);
  return answer();
}

}  // namespace

Real outside_n(const Cone& cone, const AffineForces& forces, int mass_count, const PerMass<Real>& u) {
  const Vector3 force = forces.force(mass_count, u);
  const Real lifted_n = cone.min_normal_force_n - force[2];
  if (std::isinf(cone.friction)) return lifted_n;
  const Real size_n = friction_n(force);
  const Plane e = size_n > 0 ? Plane{force[0] / size_n, force[1] / size_n} : Plane{1, 0};
  const Real slips_n =
      size_n - cone.friction * force[2] + slack_along(cone, forces, static_cast<std::size_t>(mass_count), e);
  return lifted_n > slips_n ? lifted_n : slips_n;
}

namespace {

// One mass's error adds this to the friction, and to kappa N.
struct Addition {
  Plane friction_n{0, 0};
  Real pressed_n = 0;
};

Addition addition_of(const Cone& cone, const AffineForces& forces, std::size_t i) {
  const Vector3& per_unit = forces.force_per_unit[i];
  const Real error = cone.error[i];
  return {{error * per_unit[0], error * per_unit[1]}, error * cone.friction * per_unit[2]};
}

bool has_errors(const Cone& cone, std::size_t n) {
  bool any = false;
  for (std::size_t i = 0; i < n; ++i) any |= cone.error[i] > 0;
  return any;
}

// Adds all errors but that of `skipped`, each with the sign that adds along e.
Addition sum_along(const Cone& cone, const AffineForces& forces, std::size_t n, std::size_t skipped, const Plane& e) {
  Addition sum;
  for (std::size_t i = 0; i < n; ++i) {
    if (i == skipped || !(cone.error[i] > 0)) continue;
    const Addition one = addition_of(cone, forces, i);
    const Real sign = e.x * one.friction_n.x + e.y * one.friction_n.y >= one.pressed_n ? Real(1) : Real(-1);
    sum.friction_n.x += sign * one.friction_n.x;
    sum.friction_n.y += sign * one.friction_n.y;
    sum.pressed_n += sign * one.pressed_n;
  }
  return sum;
}

// f_s - kappa N less kappa times the N without the addition.
Real used_n(const Vector3& force, const Addition& added, Real sign, const Addition& last) {
  const Real x = force[0] + added.friction_n.x + sign * last.friction_n.x;
  const Real y = force[1] + added.friction_n.y + sign * last.friction_n.y;
  return std::sqrt(x * x + y * y) - added.pressed_n - sign * last.pressed_n;
}

}  // namespace

// f_s - kappa N is a convex function of the errors, so it is greatest where each of them is at one of its bounds: with
// the sign that adds along some direction e. These signs change with e only where an error adds nothing. All of them
// are therefore found next to those directions, of which there are two per mass.
Real errors_n(const Cone& cone, const AffineForces& forces, int mass_count, const PerMass<Real>& u) {
  const auto n = static_cast<std::size_t>(mass_count);
  if (std::isinf(cone.friction) || !has_errors(cone, n)) return 0;
  const Vector3 force = forces.force(mass_count, u);
  const Real size_n = friction_n(force);
  const Plane own = size_n > 0 ? Plane{force[0] / size_n, force[1] / size_n} : Plane{1, 0};
  Real most_n = used_n(force, sum_along(cone, forces, n, n, own), 0, {});
  for (std::size_t i = 0; i < n; ++i) {
    if (!(cone.error[i] > 0)) continue;
    const Addition one = addition_of(cone, forces, i);
    const Plane& a = one.friction_n;
    const Real square = a.x * a.x + a.y * a.y, left = square - one.pressed_n * one.pressed_n;
    if (!(left > 0)) continue;  // the sign is the same for all e
    const Real part = one.pressed_n / square, across = std::sqrt(left) / square;
    for (const Real side : {across, -across}) {
      const Plane e{part * a.x - side * a.y, part * a.y + side * a.x};
      const Addition others = sum_along(cone, forces, n, i, e);
      most_n = std::fmax(most_n, used_n(force, others, 1, one));
      most_n = std::fmax(most_n, used_n(force, others, -1, one));
    }
  }
  const Real along_n = slack_along(cone, forces, n, own) - cone.slack_n;
  return std::fmax(along_n, kWorstPhases * (most_n - size_n));
}

Real most_outside_n(const Cone& cone, const AffineForces& forces, int mass_count, const PerMass<Real>& u,
                    Real added_n) {
  const Vector3 force = forces.force(mass_count, u);
  const Real lifted_n = cone.min_normal_force_n - force[2];
  if (std::isinf(cone.friction)) return lifted_n;
  const Real slips_n = friction_n(force) - cone.friction * force[2] + cone.slack_n + added_n;
  return lifted_n > slips_n ? lifted_n : slips_n;
}

Cone with_turning(const Cone& cone, const AffineForces& forces, int mass_count, const PerMass<Real>& u, Real added_n) {
  const auto n = static_cast<std::size_t>(mass_count);
  if (std::isinf(cone.friction) || !has_errors(cone, n)) return cone;
  const Vector3 force = forces.force(mass_count, u);
  const Real size_n = friction_n(force);
  const Plane own = size_n > 0 ? Plane{force[0] / size_n, force[1] / size_n} : Plane{1, 0};
  const Real more_n = added_n - (slack_along(cone, forces, n, own) - cone.slack_n);
  Cone out = cone;
  if (more_n > 0) out.slack_n += more_n;
  return out;
}

namespace {

// Up to what the search leaves.
bool inside(const Projector& projector, const Cone& cone, const PerMass<Real>& u) {
  const Vector3 force = projector.force(u);
  const Real size_n = friction_n(force) + std::fabs(force[2]) + cone.min_normal_force_n;
  return projector.outside(cone, u) <= 4 * kConeTolerance * size_n;
}

}  // namespace

Projection project(const AffineForces& forces, int mass_count, const Cone& cone, const Box& box,
                   const PerMass<Real>& unit, const PerMass<Real>& nominal, int most_steps) {
  const Projector projector(forces, mass_count, box, unit, nominal);
  Projection out;
  out.u = projector.nominal();
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) out.bent |= out.u[i] != nominal[i];
  const Real outside = projector.outside(cone, out.u);
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
    out.u = nearest_in_cone(projector, cone, most_steps, out.steps);
    const bool wrong = projector.force(out.u)[2] < cone.min_normal_force_n || !inside(projector, cone, out.u);
    if (wrong && out.steps < most_steps) {
      Cone tip = cone;
      tip.slack_n = std::fmax(cone.friction * cone.min_normal_force_n, cone.slack_n);
      const PerMass<Real> safer = nearest_in_cone(projector, tip, most_steps, out.steps);
      if (inside(projector, cone, safer)) {
        out.u = safer;
      } else if (out.steps < most_steps) {
        // From there the direction is known well enough to find the nominal's own nearest point, as a rule.
        out.u = nearest_in_cone(projector.from_most_pressed(), tip, most_steps, out.steps);
        const Vector3 force = projector.force(out.u);
        const Real size_n = friction_n(force);
        Best best;
        if (size_n > 0 && out.steps < most_steps) {
          search_direction(projector, tip, {force[0] / size_n, force[1] / size_n}, best);
          out.steps += best.steps;
        }
        if (best.inside && inside(projector, cone, best.u)) out.u = best.u;
      }
    }
  }
  out.empty = !inside(projector, cone, out.u);
  out.violation_n = out.empty ? projector.outside(cone, out.u) : 0;
  return out;
}

}  // namespace ballast::firmware
