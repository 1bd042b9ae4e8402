#include "sim/plant/stepping.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/plant/contact.h"

namespace ballast::sim {

using Eigen::Vector2d;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Bounds of the allowed local error of a step, relative to 1 + |component|, where PlantModel::tolerance would allow
// more. Steps ahead are as long as this tolerance allows, not as short as pulses and ticks make them, so their errors
// come out as estimated; with the error growth of the paper's runs (about 1e3 over 20 time units) they stay far below
// the 1e-8 that these runs are held to.
constexpr double kAheadTolerance = 1e-13;
// Outside rolling, an error of the state grows about 100-fold in the time at which a slip ends, which must be good to
// 1e-9.
constexpr double kOpenTolerance = 1e-14;

// Longest step while a slip begins, in units of sqrt(r/g). A longer one would go far with an outdated direction, which
// the error estimate does not show.
constexpr double kSlipBeginsStep = 1e-5;

// Weights that a motor's force may change by when its mass is one scale off: 1e-8 of the weight at a
// tolerance of 1e-10. A scale is at most a radian or the ball's radius, and not much less where nothing weighs
// anything.
constexpr double kWeightsPerScale = 100;
constexpr double kLeastScale = 1e-3;

// Spans in which a step of DOP853 is judged when advance() is given as much time at once. Such a step is about three
// times as long as one of Dormand-Prince 5(4).
constexpr double kSpansPerStep = 4;

// Bounds of the growth from a step to the next, and the growth of a length that no error estimate has renewed.
constexpr double kLeastGrowth = 0.2, kMostGrowth = 5, kRetryGrowth = 1.02;
// A step that much longer than allowed is taken rather than leave a sliver for the last one.
constexpr double kSliver = 1.001;

// A controller's next commands are not known, and where a slip ends its direction is no smooth function of time.
bool steps_ahead(const Equations& equations) {
  return equations.known_ahead() && equations.contact.regime != Regime::kSliding;
}

// For stages of a step. `motion` is undefined afterwards.
auto right_hand_side(const Equations& equations, Instant& motion) {
  return [&equations, &motion](double t, const double* y, double* dydt) {
    equations.derivative_alone(t, y, dydt, motion);
  };
}

// For the end of a step: sets the motion there too.
auto end_of_step(const Equations& equations, Instant& motion) {
  return [&equations, &motion](double t, const double* y, double* dydt) { equations.derivative(t, y, dydt, motion); };
}

}  // namespace

// An error of a position counts as the force by which its motor answers, an error of a rate as the position
// that it swings out to. So a step's error at `tolerance` changes no force by more than kWeightsPerScale * tolerance of
// the weight.
Stepping::Stepping(const PlantModel& model)
    : tolerance_(model.tolerance),
      control_period_s_(model.control_period_s),
      fifth_step_s_(model.control_period_s),
      eighth_step_s_(model.control_period_s) {
  const double weight_n = Body(model).total_mass_kg * model.gravity_mps2;
  const std::size_t n = model.masses.size();
  for (std::size_t i = 0; i < n && model.actuation == Actuation::kStepper; ++i) {
    const Mass& mass = model.masses[i];
    const double size = mass.rail.shape == firmware::RailShape::kCircle ? 1 : model.ball.radius_m;
    const double held = kWeightsPerScale * weight_n * mass.metres_per_rail_unit() / mass.motor.rail_stiffness();
    const double scale = std::clamp(held, kLeastScale * size, size);
    mass_scale_[kTheta + i] = scale;
    mass_scale_[kTheta + n + i] = scale * std::max(1.0, mass.swing_radps());
  }
}

void Stepping::begin_advance() { steps_left_ = kMaxSteps; }

void Stepping::normalise(State& y) {
  const double length = std::sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2] + y[3] * y[3]);
  for (std::size_t i = 0; i < 4; ++i) y[i] /= length;
}

Span Stepping::next_span(Dynamics& dynamics, double target_s, double smooth_until_s) {
  if (!steps_ahead(dynamics.equations)) return next_driven_span(dynamics, target_s);
  const double time_s = dynamics.time_s;
  if (!(time_s < ahead_end_s_)) {
    const double left_s = smooth_until_s - time_s;
    const double h = try_step(eighth_, eighth_step_s_, dynamics, left_s);
    if (h <= 0) return {};
    eighth_.prepare_dense(right_hand_side(dynamics.equations, scratch_));
    ahead_start_s_ = time_s;
    ahead_end_s_ = h >= left_s ? smooth_until_s : time_s + h;
  }
  // A whole step of this integrator is too long to be judged by its ends and its middle.
  double longest_s = (ahead_end_s_ - ahead_start_s_) / kSpansPerStep;
  if (dynamics.equations.floor.has_borders()) {
    // No more than a radius of the floor, so that its patches are looked for as finely as that.
    const double speed_mps = std::hypot(dynamics.now.dydt[kZ], dynamics.now.dydt[kZ + 1]);
    longest_s = std::min(longest_s, dynamics.equations.body.radius_m / speed_mps);
  }
  const double end_s = std::min(target_s, ahead_end_s_);
  if (end_s - time_s > 1.001 * longest_s && time_s + longest_s > time_s) return {longest_s, false, 0};
  return {end_s - time_s, true, end_s};
}

// One step of driven masses or of a slide. The order whose length comes from steps of long ago may try a longer one.
Span Stepping::next_driven_span(Dynamics& dynamics, double target_s) {
  const double left_s = target_s - dynamics.time_s;
  by_eighth_ = dynamics.equations.contact.regime != Regime::kSliding &&
               std::min(left_s, eighth_step_s_) > kSliver * fifth_step_s_;
  dense_ = false;
  const double h = by_eighth_ ? try_step(eighth_, eighth_step_s_, dynamics, left_s)
                              : try_step(fifth_, fifth_step_s_, dynamics, left_s);
  double& other_s = by_eighth_ ? fifth_step_s_ : eighth_step_s_;
  if (other_s < kMostGrowth * h) other_s *= kRetryGrowth;
  return {h, h >= left_s, target_s};
}

// Determines the direction of the slip as a step begins.
void Stepping::aim_slip(Dynamics& dynamics) {
  ContactRegime& contact = dynamics.equations.contact;
  const Vector2d slip = dynamics.slip_W_mps().head<2>();
  const double speed = slip.norm();
  if (contact.slip_begins && speed < kSlipBegins * contact.speed_scale_mps) {
    const OpenContact open = dynamics.open_contact();
    contact.slip_direction_W = follow_slip_direction({open.free_slip_rate_W_mps2, open.compliance_W},
                                                     contact.kinetic_friction, contact.slip_direction_W);
  } else if (speed > kSlipVanishes * contact.speed_scale_mps) {
    const bool same_law = !contact.slip_begins && speed > contact.slip_kept_mps;
    contact.slip_direction_W = slip / speed;
    contact.slip_kept_mps = std::max(kSlipVanishes * contact.speed_scale_mps, kSlipKept * speed);
    contact.slip_begins = false;
    if (!same_law) {
      dynamics.equations.derivative(dynamics.time_s, dynamics.now.y.data(), dynamics.now.dydt.data(), scratch_);
    }
  }
}

// The error estimate of the latest step as a part of what is allowed.
template <class Method>
double Stepping::relative_error(const Method& method, const Equations& equations) const {
  const bool rolls = equations.contact.regime == Regime::kRolling;
  if (!rolls) return method.error(std::min(tolerance_, kOpenTolerance));
  if (steps_ahead(equations)) return method.error(std::min(tolerance_, kAheadTolerance));
  State scale = mass_scale_;
  for (std::size_t i = 0; i < kTheta; ++i) scale[i] = 1 + std::abs(method.end_state()[i]);
  return method.error(tolerance_, scale);
}

// Tries a step by at most longest_s and returns its length; 0 if it was too long, or failure() tells why no step is
// possible. `allowed_s` is the length that the error estimate last allowed.
template <class Method>
double Stepping::try_step(Method& method, double& allowed_s, Dynamics& dynamics, double longest_s) {
  const Equations& equations = dynamics.equations;
  const ContactRegime& contact = equations.contact;
  const double time_s = dynamics.time_s;
  failure_ = steps_left_ > 0 ? Failure::kNone : Failure::kTooStiff;
  if (failure_ != Failure::kNone) return 0;
  --steps_left_;
  if (contact.regime == Regime::kSliding) {
    aim_slip(dynamics);
    if (contact.slip_begins) {
      longest_s = std::min(longest_s, kSlipBeginsStep * contact.radius_m / contact.speed_scale_mps);
    }
  }
  const bool whole = longest_s <= kSliver * allowed_s;
  const double h = whole ? longest_s : allowed_s;
  step_y_ = dynamics.now.y;
  step_dydt_ = dynamics.now.dydt;
  method.step(right_hand_side(equations, scratch_), end_of_step(equations, scratch_), time_s, h, step_y_, step_dydt_,
              equations.size());
  const double error = relative_error(method, equations);
  // 0.9 error^(-1/order), between 0.2 and 5; far below the tolerance the power need not be computed. A trial step that
  // overflows is too long, like any other.
  const double growth = error < 1e-6 ? kMostGrowth
                        : error < kInfinity
                            ? std::clamp(0.9 * std::pow(error, -1. / Method::kErrorOrder), kLeastGrowth, kMostGrowth)
                            : kLeastGrowth;
  const double next_s = h * growth;
  allowed_s = error <= 1 && whole ? std::max(allowed_s, next_s) : next_s;
  if (!(error <= 1)) {
    if (next_s < 1e-14 * std::max(1.0, time_s)) failure_ = Failure::kTooSmall;
  }
  if (!(error < kInfinity) && next_s < 1e-9 * control_period_s_) {
    // While sliding, a NaN means that the normal coefficient is not positive.
    failure_ = contact.regime == Regime::kSliding ? Failure::kPainleve : Failure::kNotFinite;
  }
  return error <= 1 ? h : 0;
}

template <class Method>
void Stepping::look_again(Method& probe, const Dynamics& dynamics, double offset_s, Point& out) {
  const Equations& equations = dynamics.equations;
  probe.step(right_hand_side(equations, scratch_), end_of_step(equations, scratch_), dynamics.time_s, offset_s, step_y_,
             step_dydt_, equations.size());
  out.y = probe.end_state();
  out.dydt = probe.end_derivative();
  out.motion = scratch_;
}

void Stepping::look_inside(const Dynamics& dynamics, double offset_s, Point& out) {
  const Equations& equations = dynamics.equations;
  if (!steps_ahead(equations)) {
    if (by_eighth_) return look_again(eighth_probe_, dynamics, offset_s, out);
    return look_again(fifth_probe_, dynamics, offset_s, out);
  }
  const double time_s = dynamics.time_s;
  eighth_.interpolate((time_s + offset_s - ahead_start_s_) / (ahead_end_s_ - ahead_start_s_), out.y);
  normalise(out.y);
  equations.derivative(time_s + offset_s, out.y.data(), out.dydt.data(), out.motion);
}

void Stepping::glance_inside(const Dynamics& dynamics, double offset_s, Point& out) {
  const Equations& equations = dynamics.equations;
  if (steps_ahead(equations) || equations.contact.regime != Regime::kRolling) {
    return look_inside(dynamics, offset_s, out);
  }
  if (by_eighth_) {
    if (!dense_) eighth_.prepare_dense(right_hand_side(equations, scratch_));
    dense_ = true;
    eighth_.interpolate(offset_s / eighth_.length(), out.y);
  } else {
    fifth_.interpolate(offset_s / fifth_.length(), out.y);
  }
  equations.evaluate(dynamics.time_s + offset_s, out.y.data(), out.motion);
}

void Stepping::look_at_span(const Dynamics& dynamics, const Span& span, Point& middle, Point& end) {
  const Equations& equations = dynamics.equations;
  if (steps_ahead(equations)) {
    look_inside(dynamics, span.length_s / 2, middle);
    if (!(span.exact && span.end_s == ahead_end_s_)) return look_inside(dynamics, span.length_s, end);
    end.y = eighth_.end_state();
    normalise(end.y);
    equations.derivative(ahead_end_s_, end.y.data(), end.dydt.data(), end.motion);
    return;
  }
  end.y = by_eighth_ ? eighth_.end_state() : fifth_.end_state();
  end.dydt = by_eighth_ ? eighth_.end_derivative() : fifth_.end_derivative();
  end.motion = scratch_;
  if (by_eighth_) {
    // The cubic of both ends costs no evaluation.
    for (std::size_t i = 0; i < equations.size(); ++i) {
      middle.y[i] = (step_y_[i] + end.y[i]) / 2 + span.length_s / 8 * (step_dydt_[i] - end.dydt[i]);
    }
  } else {
    fifth_.interpolate(0.5, middle.y);
  }
  equations.evaluate(dynamics.time_s + span.length_s / 2, middle.y.data(), middle.motion);
}

bool Stepping::slide_part_holds(double part_s) {
  const double error = fifth_probe_.error(std::min(tolerance_, kOpenTolerance));
  if (error <= 1) return true;
  fifth_step_s_ =
      part_s * (error < kInfinity ? std::clamp(0.9 * std::pow(error, -0.2), kLeastGrowth, 0.9) : kLeastGrowth);
  return false;
}

void Stepping::cut_step(Dynamics& dynamics) {
  if (steps_ahead(dynamics.equations)) {
    // A step that ends here is better than the dense output.
    const Equations& equations = dynamics.equations;
    State& y = dynamics.now.y;
    eighth_.step(right_hand_side(equations, scratch_), ahead_start_s_, dynamics.time_s - ahead_start_s_, step_y_,
                 step_dydt_, equations.size());
    y = eighth_.end_state();
    normalise(y);
    equations.derivative(dynamics.time_s, y.data(), dynamics.now.dydt.data(), scratch_);
  }
  ahead_end_s_ = dynamics.time_s;  // the rest of the step belongs to a regime that is over
}

}  // namespace ballast::sim
