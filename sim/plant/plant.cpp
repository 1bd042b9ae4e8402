#include "sim/plant/plant.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/integrators/step_search.h"

namespace ballast::sim {

using Eigen::Vector2d;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Relative to the time. The part of a step up to the end of a slip needs no error estimate of its own if it is shorter
// than this.
constexpr double kShortestPart = 1e-13;

// A border counts as crossed this far behind it, relative to the radius or to the place's coordinates: the rounding of
// a place must not cross it back. At a speed of 1e-3 sqrt(g r) it is crossed 1e-10 sqrt(r/g) late.
constexpr double kBorderCrossed = 1e-13;
// Looks at the place in a span that may reach a border. Each is less than the radius over kBorderLooks from the next
// where the ball moves alone (Stepping), and far less within a tick.
constexpr int kBorderLooks = 64;

}  // namespace

Plant::Plant(const PlantModel& model)
    : ahead_s_(model.actuation == Actuation::kPrescribed ? model.duration_s : 0),
      run_(model),
      regimes_(model),
      stepping_(model),
      faults_(model) {
  regimes_.start(model.initial, run_);
}

void Plant::advance(double end_s, std::span<const StepPulse> pulses) {
  const double start_s = time_s();
  stepping_.begin_advance();
  bool jumped = false;
  if (end() == PhysicsEnd::kNone && end_s > start_s) {
    const Instant& now = dynamics().now.motion;
    run_.contact.begin_tick(now.normal_force_n, equations().contact.mu_required(now));
    for (std::size_t i = 0; i < equations().mass_count(); ++i) {
      jumped |= equations().motors.wait(i, start_s);
    }
  }
  if (!equations().driven()) pulses = {};
  while (end() == PhysicsEnd::kNone) {
    // Everything that happens at this instant, before anything is evaluated again.
    jumped |= faults_.update(dynamics());
    if (!equations().driven()) jumped |= equations().prescribed.enter_pieces(time_s());
    jumped |= execute_pulses(start_s, pulses);
    if (jumped) regimes_.continue_after_jump(run_);
    jumped = false;
    if (end() != PhysicsEnd::kNone || time_s() >= end_s) return;

    double smooth_until_s =
        std::min({equations().body.external_force.next_kink_s(time_s()), std::max(end_s, ahead_s_), faults_.next_s()});
    if (!equations().driven()) {
      smooth_until_s = std::min(smooth_until_s, equations().prescribed.smooth_until_s(time_s()));
    }
    double target_s = std::min(end_s, smooth_until_s);
    if (!pulses.empty()) target_s = std::min(target_s, start_s + pulses.front().offset_s);
    integrate_to(target_s, smooth_until_s);
  }
}

void Plant::place_masses(const double* position, const double* velocity, const double* acceleration) {
  MassPoint commanded{};
  const std::size_t n = equations().mass_count();
  std::copy_n(position, n, commanded.position.begin());
  std::copy_n(velocity, n, commanded.velocity.begin());
  std::copy_n(acceleration, n, commanded.acceleration.begin());
  equations().prescribed.place(time_s(), commanded);
  if (end() == PhysicsEnd::kNone) regimes_.continue_after_jump(run_);
}

void Plant::lead_masses(double end_s, const double* position, const double* velocity) {
  PerMass to{}, with{};
  const std::size_t n = equations().mass_count();
  std::copy_n(position, n, to.begin());
  std::copy_n(velocity, n, with.begin());
  const bool jumps = equations().prescribed.lead(time_s(), end_s, to, with);
  if (jumps && end() == PhysicsEnd::kNone) regimes_.continue_after_jump(run_);
}

// Executes the pulses that are due, and takes them from `pulses`. True: there were some.
bool Plant::execute_pulses(double start_s, std::span<const StepPulse>& pulses) {
  bool any = false;
  for (; !pulses.empty() && start_s + pulses.front().offset_s <= time_s(); pulses = pulses.subspan(1)) {
    const StepPulse& pulse = pulses.front();
    equations().motors.stepper(index(pulse.motor)).step(pulse.direction, time_s());
    any = true;
  }
  return any;
}

void Plant::integrate_to(double target_s, double smooth_until_s) {
  while (time_s() < target_s && end() == PhysicsEnd::kNone) {
    const Span span = stepping_.next_span(dynamics(), target_s, smooth_until_s);
    end_by(stepping_.failure());
    if (span.length_s > 0) take_span(span);
  }
}

void Plant::end_by(Stepping::Failure failure) {
  switch (failure) {
    case Stepping::Failure::kNone:
      return;
    case Stepping::Failure::kTooSmall:
      return regimes_.end_inconsistent("no step is small enough to follow the motion", run_);
    case Stepping::Failure::kPainleve:
      return regimes_.end_painleve(run_);
    case Stepping::Failure::kNotFinite:
      return regimes_.end_inconsistent("the state stopped being finite", run_);
    case Stepping::Failure::kTooStiff:
      return regimes_.end_inconsistent(
          "the motion is too stiff: more than " + std::to_string(Stepping::kMaxSteps) + " steps in one control period",
          run_);
  }
}

double Plant::stop_overdue_m(std::size_t i, const State& y) const {
  return equations().motors.stop_overdue_m(i, y[kTheta + i], y[kTheta + equations().mass_count() + i]);
}

bool Plant::stops_overdue(const State& y) const {
  const auto& stops = equations().motors.with_stops();
  return std::any_of(stops.begin(), stops.end(), [&](std::size_t i) { return stop_overdue_m(i, y) > 0; });
}

// Whether the contact point is there beyond a border of what the ball stands on. In flight nothing depends on the
// floor.
bool Plant::past_border(const State& y) const {
  const LocalFloor& floor = equations().floor;
  return floor.has_borders() && equations().contact.regime != Regime::kFlight &&
         floor.overdue_m(place_W_m(y)) > border_m_;
}

// Whether the regime, an end stop's push or rest, or the patch of the floor is over there.
bool Plant::event_at(const Point& point) const {
  return equations().contact.over(point.motion) || stops_overdue(point.y) || past_border(point.y);
}

// Returns the place of a value's peak in the span of length h, as a part of it; +infinity if there is no peak above
// `floor`.
template <class Value>
double Plant::find_peak(double h, const Instant& middle, const Instant& end, double floor, Value value) {
  if (!may_peak_above(value(dynamics().now.motion), value(middle), value(end), floor)) return kInfinity;
  Point inside;
  return golden_section([&](double part) {
    stepping_.glance_inside(dynamics(), part * h, inside);
    return value(inside.motion);
  });
}

// A part of the span at which a border is past, before which none is; +infinity: no border. A patch that the ball
// enters and leaves again between two looks is found by its greatest depth.
double Plant::find_border(double h, const Point& middle, const Point& end) {
  const LocalFloor& floor = equations().floor;
  if (!floor.has_borders() || equations().contact.regime == Regime::kFlight) return kInfinity;
  const Point& start = dynamics().now;
  const auto speed_mps = [](const Point& at) { return Vector2d(at.dydt[kZ], at.dydt[kZ + 1]).norm(); };
  const Vector2d from = place_W_m(start.y), to = place_W_m(end.y);
  const double before_m = floor.overdue_m(from);
  // A border just crossed may still be that far ahead, because the crossing was located by dense output.
  const double scale_m = std::max(equations().body.radius_m, from.lpNorm<Eigen::Infinity>());
  border_m_ = std::max(before_m, 0.0) + kBorderCrossed * scale_m;
  // Twice the way at the greatest speed seen bounds the way that the place can stray.
  const double way_m = 2 * std::max({h * speed_mps(start), h * speed_mps(end), (to - from).norm(),
                                     2 * (place_W_m(middle.y) - from).norm(), 2 * (to - place_W_m(middle.y)).norm()});
  if (before_m + way_m < border_m_) return kInfinity;

  Point inside;
  const auto overdue_m = [&](double part) {
    stepping_.glance_inside(dynamics(), part * h, inside);
    return floor.overdue_m(place_W_m(inside.y));
  };
  constexpr double kLook = 1.0 / kBorderLooks;
  double previous_m = -kInfinity, last_m = before_m;
  for (int k = 1; k <= kBorderLooks + 1; ++k) {  // the last one only for a peak before the end
    const double part = std::min(1.0, k * kLook);
    const double now_m = k < kBorderLooks ? overdue_m(part) : k == kBorderLooks ? floor.overdue_m(to) : -kInfinity;
    // As may_peak_above(); no corner of a border pokes out further than that between two looks.
    const double bend_m = 2 * last_m - previous_m - now_m;
    const double highest_m = last_m + std::min(bend_m / 2, 2 * way_m * kLook);
    if (last_m >= previous_m && last_m >= now_m && highest_m > border_m_) {
      const double begin = std::max(0, k - 2) * kLook;
      const double peak =
          begin + (part - begin) * golden_section([&](double at) { return overdue_m(begin + at * (part - begin)); });
      stepping_.look_inside(dynamics(), peak * h, inside);
      if (past_border(inside.y)) return peak;
    }
    if (now_m > border_m_) {
      stepping_.look_inside(dynamics(), part * h, inside);
      if (k == kBorderLooks || past_border(inside.y)) return part;
    }
    previous_m = last_m;
    last_m = now_m;
  }
  return kInfinity;
}

// The ball comes onto what lies beyond the border that this state is past.
void Plant::cross_border(const State& y) {
  dynamics().stand_at(y);
  const ContactRegime& contact = equations().contact;
  if (contact.regime == Regime::kSliding && std::isinf(contact.kinetic_friction)) {
    return regimes_.end_inconsistent("the ball slides onto a patch of the floor that has infinite friction", run_);
  }
  regimes_.continue_after_jump(run_);
}

// A part of the span at whose end an event is past: its middle, its end, or a peak inside it. +infinity: no event.
double Plant::find_event(double h, const Point& middle, const Point& end) {
  const ContactRegime& contact = equations().contact;
  Point inside;
  const auto over = [&](const Point& at) { return contact.over(at.motion) || stops_overdue(at.y); };
  double past = over(middle) ? 0.5 : over(end) ? 1 : kInfinity;
  const auto search = [&](double limit, auto value) {
    const double part = find_peak(h, middle.motion, end.motion, limit, value);
    if (!(part < past)) return;
    stepping_.look_inside(dynamics(), part * h, inside);
    if (contact.over(inside.motion)) past = part;
  };
  if (contact.regime == Regime::kRolling && contact.static_friction < kInfinity) {
    search(contact.static_friction, [&](const Instant& m) { return contact.mu_required(m); });
  }
  if (contact.regime != Regime::kFlight) search(0, [](const Instant& m) { return -m.normal_force_n; });
  if (contact.regime != Regime::kRolling) search(0, [](const Instant& m) { return -m.remaining; });
  for (const std::size_t i : equations().motors.with_stops()) {
    const auto overdue_m = [&](const State& y) { return stop_overdue_m(i, y); };
    if (!may_peak_above(overdue_m(dynamics().now.y), overdue_m(middle.y), overdue_m(end.y), 0)) continue;
    const double part = golden_section([&](double at) {
      stepping_.look_inside(dynamics(), at * h, inside);
      return overdue_m(inside.y);
    });
    if (!(part < past)) continue;
    stepping_.look_inside(dynamics(), part * h, inside);
    if (stops_overdue(inside.y)) past = part;
  }
  return std::min(past, find_border(h, middle, end));
}

// Records extrema inside the span. Only a peak that may beat the best so far is worth finding.
void Plant::record_peaks(double h, const Point& middle, const Point& end) {
  Point inside;
  const auto look = [&](double best, auto value) {
    const double part = find_peak(h, middle.motion, end.motion, best, value);
    if (!(part < 1)) return;
    stepping_.look_inside(dynamics(), part * h, inside);
    run_.contact.record(equations(), time_s() + part * h, inside.y, inside.motion);
  };
  const ContactExtrema& extrema = run_.contact.extrema();
  look(extrema.normal_force_max.value, [](const Instant& m) { return m.normal_force_n; });
  look(-extrema.normal_force_min.value, [](const Instant& m) { return -m.normal_force_n; });
  look(extrema.static_friction_max.value, [](const Instant& m) { return m.static_friction_n; });
  const auto mu_required = [this](const Instant& m) { return equations().contact.mu_required(m); };
  if (end.motion.normal_force_n > 0) look(extrema.mu_required_max.value, mu_required);
  if (equations().known_ahead()) return;
  // Steps of masses under a controller are so long that the tick's extrema come from between their ends too.
  const auto peak = [&](auto value) {
    return parabola_peak(value(dynamics().now.motion), value(middle.motion), value(end.motion));
  };
  run_.contact.record_tick(-peak([](const Instant& m) { return -m.normal_force_n; }), peak(mu_required));
}

// Judges a span that has been integrated, then moves to its end, or to the first event in it.
void Plant::take_span(const Span& span) {
  Point middle, end, inside;
  stepping_.look_at_span(dynamics(), span, middle, end);
  double h = span.length_s;
  const double past = find_event(h, middle, end);
  const bool event = past <= 1;
  const Regime regime = equations().contact.regime;
  if (event) {
    h *= first_broken(time_s(), h, past, [&](double part) {
      stepping_.look_inside(dynamics(), part * h, inside);
      return event_at(inside);
    });
    stepping_.look_inside(dynamics(), h, end);
    // A step over the end of a slip is smooth past it, where the direction is kept, so its error estimate does not show
    // how the direction turns before. The part up to the end is held to the tolerance by an estimate of its own.
    const bool long_enough = h > kShortestPart * std::max(1.0, time_s());
    if (regime == Regime::kSliding && long_enough && !stepping_.slide_part_holds(h)) return;
    // As the normal coefficient vanishes, N grows beyond bounds, and the shortest part may end where there is no force.
    if (!std::all_of(end.y.begin(), end.y.begin() + equations().size(), [](double v) { return std::isfinite(v); })) {
      return end_by(regime == Regime::kSliding ? Stepping::Failure::kPainleve : Stepping::Failure::kNotFinite);
    }
    stepping_.look_inside(dynamics(), h / 2, middle);
  }

  // At the end of a slip, direction and forces are those of the step's start, so they do not count.
  const bool crossed = event && past_border(end.y);
  const bool regime_over = event && equations().contact.over(end.motion);
  const bool slip_ends = regime_over && regime == Regime::kSliding && end.motion.normal_force_n > 0;
  if (regime != Regime::kFlight && !slip_ends) record_peaks(h, middle, end);
  if (equations().driven()) run_.motors.record_energy(dynamics(), h, end);
  dynamics().time_s = span.exact && !event ? span.end_s : time_s() + h;
  dynamics().now = end;
  Stepping::normalise(dynamics().now.y);
  if (!slip_ends) run_.record();
  if (crossed) {
    stepping_.cut_step(dynamics());
    cross_border(end.y);
  } else if (regime_over) {
    stepping_.cut_step(dynamics());
    regimes_.leave(run_);
  } else if (event) {
    run_.update_stops();
    regimes_.continue_after_jump(run_);
  }
  if (regime == Regime::kFlight && equations().floor.has_borders()) dynamics().stand_at(dynamics().now.y);
}

double Plant::motor_steps_behind(int i) const {
  if (!equations().driven()) return 0;
  const Stepper& stepper = equations().motors.stepper(index(i));
  return stepper.steps_behind(stepper.motor().shaft_ratio * dynamics().now.y[kTheta + index(i)]);
}

Sample Plant::sample() const {
  Sample s = run_.sample();
  if (end() == PhysicsEnd::kSlipped) s.regime = Regime::kSliding;
  return s;
}

Plant::ContactForces Plant::contact_forces(const double* position, const double* velocity, const double* acceleration,
                                           Forces forces) const {
  if (forces == Forces::kTold && has_untold_forces()) {
    return contact_forces(equations().body, position, velocity, acceleration);
  }
  CarriedMasses masses;
  carry_along(equations().body, position, velocity, acceleration, masses);
  Instant motion;
  equations().evaluate_prescribed(time_s(), dynamics().now.y.data(), masses, motion);
  return {reported_normal_n(motion.normal_force_n), motion.static_friction_n};
}

Plant::ContactForces Plant::contact_forces(const Body& believed, const double* position, const double* velocity,
                                           const double* acceleration) const {
  CarriedMasses masses;
  carry_along(believed, position, velocity, acceleration, masses);
  Body told = believed;
  told.external_force.keep_told();
  Instant motion;
  equations().evaluate_prescribed(told, time_s(), dynamics().now.y.data(), masses, motion);
  return {reported_normal_n(motion.normal_force_n), motion.static_friction_n};
}

Plant::ContactForces Plant::rolling_forces(const Body* believed, const double* orientation,
                                           const double* angular_velocity_B_radps, const double* position,
                                           const double* velocity, const double* acceleration) const {
  Body told = believed != nullptr ? *believed : equations().body;
  told.external_force.keep_told();
  CarriedMasses masses;
  carry_along(told, position, velocity, acceleration, masses);
  Motion motion;
  rolling_prescribed(told, time_s(), orientation, angular_velocity_B_radps, masses, motion);
  return {reported_normal_n(motion.normal_force_n), motion.static_friction_n};
}

}  // namespace ballast::sim
