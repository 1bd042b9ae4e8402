#include "sim/plant/plant.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "sim/integrators/step_search.h"

namespace ballast::sim {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

// Allowed local error of a step, relative to 1 + |component|: some thousand times the rounding of one step, and with
// the error growth of the paper's runs (about 1e3 over 20 time units) far below the 1e-8 they are held to.
constexpr double kTolerance = 1e-12;
// Of steps that are as long as it allows, and not as short as the ticks make them: the errors come out as estimated.
constexpr double kAheadTolerance = 1e-13;
// Out of rolling: a slip that dies away slowly turns an error of the state into one of the time that is a hundred times
// larger, and that time is to be good to 1e-9.
constexpr double kOpenTolerance = 1e-14;

// In units of sqrt(g r), see plant.h. What they leave undone has little effect: a direction wrong by some 1e-6 for the
// 1e-6 to 1e-4 sqrt(r/g) that a slip mostly takes to reach its threshold. One that creeps to it in 1e-3 sqrt(r/g), with
// a kinetic friction equal to the static one and forces that change slowly, moved the ball by 1e-11 r.
constexpr double kRestSpeed = 1e-6;
constexpr double kSlipBegins = 1e-6;
constexpr double kSlipVanishes = 1e-12;
// Of sqrt(r/g): a slip that begins is looked at as often as that, lest a step go far with a direction that is no longer
// its own, which no error estimate would tell.
constexpr double kSlipBeginsStep = 1e-5;

// Part of the slip at the start of a step below which a stage of that step keeps the direction of the start: the
// direction of what is left of the slip there is rounding.
constexpr double kSlipKept = 1e-3;

// Of the time: a step's part up to the end of a slip shorter than this needs no error estimate of its own.
constexpr double kShortestPart = 1e-13;

// Changes of regime at one instant, each that close to the one before, after which there is no hope of an end.
constexpr int kMostChanges = 16;
constexpr double kOneInstant = 1e-14;

constexpr const char* kPainleve =
    "sliding cannot go on: friction turns pressing the ball into the floor from pushing it out to pulling it in (the "
    "normal force's coefficient is no longer positive: Painleve's paradox)";

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Two forces closer than this part of the weight, and two ratios closer than this, differ by rounding only.
constexpr double kNoise = 1e-13;

// Spans in which a step of DOP853 is judged when advance() is given as much time at once: of a step some three times as
// long as one of Dormand-Prince 5(4) would be.
constexpr double kSpansPerStep = 4;

// Within one call of advance(); a robot at 1 kHz takes a few.
constexpr int kMaxSteps = 2'000'000;

}  // namespace

namespace {

// Of the external force, drag aside.
double greatest_force_n(const Scenario& scenario) {
  double greatest = scenario.external_force_W_n.norm();
  for (const Vector3d& force : scenario.force_table.forces_W_n) greatest = std::max(greatest, force.norm());
  for (const Fault& fault : scenario.faults) {
    if (fault.kind == FaultKind::kPush) greatest += fault.value;
  }
  return greatest;
}

// Stiff enough that motor and weight together move a blocked mass by a hundredth of a tooth, or of the rail's radius.
constexpr double kBlockStiffness = 100;

}  // namespace

// A floor cannot pull: where rolling on would need N < 0 there is none. NaN stays.
double Plant::pushed(double normal_force_n) { return normal_force_n < 0 ? 0 : normal_force_n; }

double Plant::mu_required(double normal_force_n, double static_friction_n) {
  return normal_force_n > 0 ? static_friction_n / normal_force_n : kInfinity;
}

Plant::Plant(const Scenario& scenario)
    : scenario_(scenario),
      body_(scenario),
      driven_(scenario.run.actuation == Actuation::kStepper),
      contact_size_(kTheta + (driven_ ? 2 * scenario.masses.size() : 0)),
      size_(contact_size_),
      static_friction_(scenario.surface.static_friction),
      kinetic_friction_(scenario.surface.kinetic_friction),
      speed_scale_mps_(std::sqrt(std::max(scenario.gravity_mps2, greatest_force_n(scenario) / body_.total_mass_kg) *
                                 scenario.ball.radius_m)),
      step_s_(scenario.run.control_period_s),
      extrema_{{0, -1}, {0, -1}, {0, -1}, {0, -1}},
      tick_normal_force_min_n_(kInfinity),
      tick_mu_required_max_(0),
      noise_n_(kNoise * std::max(body_.total_mass_kg * body_.gravity_mps2, greatest_force_n(scenario))) {
  const auto& initial = scenario.initial;
  y_[kQ] = initial.orientation.w();
  for (int j = 0; j < 3; ++j) {
    y_[kQ + 1 + j] = initial.orientation.vec()[j];
    y_[kOmega + j] = initial.angular_velocity_B_radps[j];
  }
  y_[kZ] = initial.position_W_m[0];
  y_[kZ + 1] = initial.position_W_m[1];
  const std::size_t n = scenario.masses.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Mass& mass = scenario.masses[i];
    motion_.emplace_back(mass);
    // The pattern of tooth errors differs from motor to motor of one seed.
    steppers_.emplace_back(mass.motor, mass.motor.shaft_ratio * mass.initial_position, (scenario.seed << 3) + i);
    y_[kTheta + i] = mass.initial_position;
    y_[kTheta + n + i] = mass.initial_velocity;
    if (driven_) end_stops_[i] = EndStops(mass);
    if (end_stops_[i].present()) with_stops_.push_back(i);
  }
  touch_stops();
  piece_.assign(n, 0);
  suffered_.assign(scenario.faults.size(), 0);
  for (std::size_t k = 0; k < scenario.faults.size(); ++k) {
    const Fault& fault = scenario.faults[k];
    if (!fault.of(FaultLayer::kMotor) && !fault.of(FaultLayer::kWorld)) continue;
    fault_edges_.push_back({fault.time_s, k, true});
    if (fault.end_s > fault.time_s && fault.end_s < kInfinity) fault_edges_.push_back({fault.end_s, k, false});
  }
  std::stable_sort(fault_edges_.begin(), fault_edges_.end(),
                   [](const FaultEdge& a, const FaultEdge& b) { return a.time_s < b.time_s; });

  start_regime();
}

// Where the scenario puts the ball: rolling, sliding or in the air. The motors stand balanced in that regime.
void Plant::start_regime() {
  const auto& initial = scenario_.initial;
  double* extra = &y_[contact_size_];
  const Vector3d omega_W = rotation_B_to_W(&y_[kQ]) * Vector3d(y_[kOmega], y_[kOmega + 1], y_[kOmega + 2]);
  Vector3d velocity_W = omega_W.cross(Vector3d(0, 0, body_.radius_m));
  if (initial.has_velocity) velocity_W = initial.velocity_W_mps;
  extra[0] = initial.height_m;
  for (int j = 0; j < 3; ++j) extra[1 + j] = velocity_W[j];
  const bool flies = initial.height_m > 0 || velocity_W[2] > 0;
  const bool lands = !flies && velocity_W[2] < 0;
  const bool slides = !flies && !lands && initial.has_velocity;

  if (driven_) {
    // Each motor stands balanced under the load of the masses held as they are (thetaddot = 0), in flight or in
    // contact; a slip does not last long enough to be balanced for.
    const MassPoint masses = mass_point(0, y_.data());
    const CarriedMasses held = carried(masses);
    Motion at_rest;
    if (flies) {
      OpenContact open;
      open_contact_prescribed(body_, 0, &y_[kQ], &y_[kOmega], velocity_W, held, open);
      close_contact(body_, open, Vector3d::Zero(), at_rest);
    } else {
      rolling_prescribed(body_, 0, &y_[kQ], &y_[kOmega], held, at_rest);
    }
    const PerMass torque = needed_torques(y_.data(), at_rest, masses);
    for (std::size_t i = 0; i < motion_.size(); ++i) {
      steppers_[i].balance(torque[i], scenario_.masses[i].motor.shaft_ratio * masses.velocity[i]);
      stored_at_start_[i] = stored_energy(i, masses);
    }
  }
  if (flies) {
    enter(Regime::kFlight);
  } else if (lands) {
    regime_ = Regime::kFlight;  // up to the impact
    size_ = contact_size_ + 4;
    regimes_.push_back({Regime::kFlight, 0});
    derivative(0, y_.data(), dydt_.data());
    now_ = scratch_;
    land();
  } else if (slides) {
    touch(slip_W_mps(y_.data()).head<2>());
  } else {
    regimes_.push_back({Regime::kRolling, 0});
    after_jump();
  }
}

Plant::MassPoint Plant::mass_point(double time_s, const double* y, const std::size_t* piece) const {
  MassPoint p{};
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    if (driven_) {
      p.position[i] = y[kTheta + i];
      p.velocity[i] = y[kTheta + motion_.size() + i];
    } else {
      const auto point = motion_[i].at(piece[i], time_s);
      p.position[i] = point.position;
      p.velocity[i] = point.velocity;
      p.acceleration[i] = point.acceleration;
    }
  }
  return p;
}

CarriedMasses Plant::carried(const MassPoint& masses) const {
  CarriedMasses out;
  carry_along(body_, masses.position.data(), masses.velocity.data(), masses.acceleration.data(), out);
  return out;
}

Plant::PerMass Plant::rail_forces(const MassPoint& masses) const {
  PerMass force{};
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    const double shaft = scenario_.masses[i].motor.shaft_ratio;
    force[i] = shaft * steppers_[i].torque_nm(shaft * masses.position[i], shaft * masses.velocity[i]);
  }
  if (fault_edges_.empty()) {
    for (const std::size_t i : with_stops_) force[i] += held_n(i, masses.position[i], masses.velocity[i]);
  } else {
    for (std::size_t i = 0; i < motion_.size(); ++i) force[i] += held_n(i, masses.position[i], masses.velocity[i]);
  }
  return force;
}

double Plant::held_n(std::size_t i, double position, double velocity) const {
  const Block& block = blocks_[i];
  const double stop_n = end_stops_[i].force_n(stop_side_[i], position, velocity);
  return block.on ? stop_n - block.stiffness * (position - block.position) - block.damping * velocity : stop_n;
}

// Those that are due; false: none is.
bool Plant::begin_and_end_faults() {
  const std::size_t first = next_edge_;
  for (; next_edge_ < fault_edges_.size() && fault_edges_[next_edge_].time_s <= time_s_; ++next_edge_) {
    const FaultEdge& edge = fault_edges_[next_edge_];
    const Fault& fault = scenario_.faults[edge.fault];
    suffered_[edge.fault] = static_cast<char>(edge.begins);
    if (!edge.begins) continue;
    const auto i = static_cast<std::size_t>(fault.mass);
    if (fault.kind == FaultKind::kLostSteps) steppers_[i].swallow(static_cast<std::int64_t>(fault.value));
    if (fault.kind != FaultKind::kBlockedRail || blocks_[i].on) continue;
    const Mass& mass = scenario_.masses[i];
    const bool circle = mass.rail.shape == firmware::RailShape::kCircle;
    const double lever = circle ? mass.rail.radius_m : 1, shaft = mass.motor.shaft_ratio;
    const double inertia = mass.mass_kg * lever * lever + mass.motor.rotor_inertia_kgm2 * shaft * shaft;
    const double motor = mass.motor.steps_per_revolution / 4.0 * mass.motor.holding_torque_nm * shaft * shaft;
    const double weight = mass.mass_kg * scenario_.gravity_mps2 * (circle ? lever : 1 / body_.radius_m);
    const double stiffness = kBlockStiffness * (motor + weight);
    blocks_[i] = {true, y_[kTheta + i], stiffness, 2 * std::sqrt(stiffness * inertia)};
  }
  if (next_edge_ == first) return false;
  suffer_active_faults();
  return true;
}

// What several of one kind do at once: the worst, and pushes add up.
void Plant::suffer_active_faults() {
  std::array<bool, kMaxMasses> stalled{}, reversed{}, blocked{};
  PerMass coil{};
  coil.fill(1);
  push_W_n_.setZero();
  static_friction_ = scenario_.surface.static_friction;
  for (std::size_t k = 0; k < scenario_.faults.size(); ++k) {
    if (suffered_[k] == 0) continue;
    const Fault& fault = scenario_.faults[k];
    const auto i = static_cast<std::size_t>(fault.mass);
    if (fault.kind == FaultKind::kMotorStall) stalled[i] = true;
    if (fault.kind == FaultKind::kReversedWiring) reversed[i] = true;
    if (fault.kind == FaultKind::kBlockedRail) blocked[i] = true;
    if (fault.kind == FaultKind::kWeakCoil) coil[i] = std::min(coil[i], fault.value);
    if (fault.kind == FaultKind::kFrictionFalls) static_friction_ = std::min(static_friction_, fault.value);
    if (fault.kind == FaultKind::kPush) push_W_n_ += fault.value * fault.direction_W;
  }
  for (std::size_t i = 0; i < motion_.size() && driven_; ++i) {
    steppers_[i].power(!stalled[i]);
    steppers_[i].reverse(reversed[i]);
    steppers_[i].weaken_coil(coil[i]);
    blocks_[i].on = blocked[i];
  }
  const auto& dry = scenario_.surface;
  kinetic_friction_ = dry.kinetic_friction;
  if (static_friction_ < dry.static_friction) {
    kinetic_friction_ = std::isinf(dry.static_friction)
                            ? std::min(dry.kinetic_friction, static_friction_)
                            : dry.kinetic_friction * (static_friction_ / dry.static_friction);
  }
  body_.external_force.set_push(push_W_n_);
}

double Plant::overdue_m(std::size_t i, const State& y) const {
  return end_stops_[i].overdue_m(stop_side_[i], y[kTheta + i], y[kTheta + motion_.size() + i]);
}

bool Plant::stops_overdue(const State& y) const {
  return std::any_of(with_stops_.begin(), with_stops_.end(), [&](std::size_t i) { return overdue_m(i, y) > 0; });
}

// Which stops push from time_s_ on.
void Plant::touch_stops() {
  for (const std::size_t i : with_stops_) {
    const int side = end_stops_[i].touched(y_[kTheta + i], y_[kTheta + motion_.size() + i]);
    EndStopRecord& record = end_stop_record_[i];
    if (side != 0 && side != stop_side_[i] && record.touches++ == 0) record.first_s = time_s_;
    stop_side_[i] = side;
  }
}

void Plant::evaluate(double time_s, const double* y, Instant& motion) const {
  const MassPoint p = mass_point(time_s, y);
  if (!driven_) return evaluate_prescribed(time_s, y, carried(p), motion);
  const PerMass force = rail_forces(p);
  if (regime_ == Regime::kRolling) {
    rolling_driven(body_, time_s, y + kQ, y + kOmega, p.position.data(), p.velocity.data(), force.data(), motion);
  } else {
    evaluate_open(y, open_contact_at(time_s, y, p, force), motion);
    motion.generalised_force = force;
  }
}

void Plant::evaluate_prescribed(double time_s, const double* y, const CarriedMasses& masses, Instant& motion) const {
  if (regime_ == Regime::kRolling) return rolling_prescribed(body_, time_s, y + kQ, y + kOmega, masses, motion);
  OpenContact open;
  open_contact_prescribed(body_, time_s, y + kQ, y + kOmega, velocity_W_mps(y), masses, open);
  evaluate_open(y, open, motion);
}

// Of a state that has the geometric centre's velocity: any but a rolling one.
Vector3d Plant::velocity_W_mps(const double* y) const {
  return {y[contact_size_ + 1], y[contact_size_ + 2], y[contact_size_ + 3]};
}

// Likewise.
OpenContact Plant::open_contact_at(double time_s, const double* y, const MassPoint& masses,
                                   const PerMass& motor_force) const {
  OpenContact open;
  if (driven_) {
    open_contact_driven(body_, time_s, y + kQ, y + kOmega, velocity_W_mps(y), masses.position.data(),
                        masses.velocity.data(), motor_force.data(), open);
  } else {
    open_contact_prescribed(body_, time_s, y + kQ, y + kOmega, velocity_W_mps(y), carried(masses), open);
  }
  return open;
}

// Sliding and flight.
void Plant::evaluate_open(const double* y, const OpenContact& open, Instant& motion) const {
  if (regime_ == Regime::kFlight) {
    close_contact(body_, open, Vector3d::Zero(), motion);
    motion.left = y[contact_size_];
    motion.climb_mps = y[contact_size_ + 3];
    return;
  }
  const ContactRelation contact{open.free_slip_rate_W_mps2, open.compliance_W};
  const Vector2d slip = slip_W_mps(y).head<2>();
  motion.left = slip.dot(slip_direction_W_);
  Vector2d e = slip_direction_W_;
  if (slip_begins_) {
    e = follow_slip_direction(contact, kinetic_friction_, slip_direction_W_);
  } else if (motion.left > slip_kept_mps_) {
    e = slip.normalized();
  }
  if (normal_coefficient(contact, kinetic_friction_, e) > 0) {
    close_contact(body_, open, sliding_force(contact, kinetic_friction_, e), motion);
    motion.static_friction_n = kinetic_friction_ * motion.normal_force_n;  // not a rounding more than that
  } else {
    close_contact(body_, open, Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()), motion);
  }
}

OpenContact Plant::open_contact_now() const {
  const MassPoint p = mass_point(time_s_, y_.data());
  return open_contact_at(time_s_, y_.data(), p, driven_ ? rail_forces(p) : PerMass{});
}

Vector3d Plant::slip_W_mps(const double* y) const {
  const Vector3d omega_W = rotation_B_to_W(y + kQ) * Vector3d(y[kOmega], y[kOmega + 1], y[kOmega + 2]);
  return velocity_W_mps(y) - omega_W.cross(Vector3d(0, 0, body_.radius_m));
}

void Plant::derivative(double time_s, const double* y, double* dydt) {
  evaluate(time_s, y, scratch_);
  quaternion_rate(y + kQ, y + kOmega, dydt + kQ);
  for (int j = 0; j < 3; ++j) dydt[kOmega + j] = scratch_.angular_acceleration_B_radps2[j];
  if (regime_ == Regime::kRolling) {
    dydt[kZ] = scratch_.rolling_velocity_W_mps[0];
    dydt[kZ + 1] = scratch_.rolling_velocity_W_mps[1];
  } else {
    const Vector3d acceleration_W = scratch_.rotation_B_to_W * scratch_.acceleration_B_mps2;
    const bool flies = regime_ == Regime::kFlight;
    const std::size_t c = contact_size_;
    dydt[kZ] = y[c + 1];
    dydt[kZ + 1] = y[c + 2];
    dydt[c] = flies ? y[c + 3] : 0;
    dydt[c + 1] = acceleration_W[0];
    dydt[c + 2] = acceleration_W[1];
    dydt[c + 3] = flies ? acceleration_W[2] : 0;
  }
  if (driven_) {
    for (std::size_t i = 0; i < motion_.size(); ++i) {
      dydt[kTheta + i] = y[kTheta + motion_.size() + i];
      dydt[kTheta + motion_.size() + i] = scratch_.mass_acceleration[i];
    }
  }
}

void Plant::advance(double end_s, std::span<const StepPulse> pulses) {
  const double start_s = time_s_;
  steps_left_ = kMaxSteps;
  bool jumped = false;
  if (end_ == PhysicsEnd::kNone && end_s > time_s_) {
    tick_normal_force_min_n_ = pushed(now_.normal_force_n);
    tick_mu_required_max_ = ratio(now_);
    for (Stepper& stepper : steppers_) jumped = stepper.wait(time_s_) || jumped;
  }
  std::size_t next_pulse = 0;
  while (end_ == PhysicsEnd::kNone) {
    // What happens at this instant, all of it, before anything is looked at again.
    jumped = begin_and_end_faults() || jumped;
    for (std::size_t i = 0; i < motion_.size() && !driven_; ++i) {
      while (motion_[i].end_s(piece_[i]) <= time_s_) ++piece_[i], jumped = true;
    }
    for (; driven_ && next_pulse < pulses.size() && start_s + pulses[next_pulse].offset_s <= time_s_; ++next_pulse) {
      steppers_[static_cast<std::size_t>(pulses[next_pulse].motor)].step(pulses[next_pulse].direction, time_s_);
      jumped = true;
    }
    if (std::exchange(jumped, false)) after_jump();
    if (end_ != PhysicsEnd::kNone || time_s_ >= end_s) return;

    double target_s = end_s;
    smooth_until_s_ = std::min(body_.external_force.next_kink_s(time_s_), std::max(end_s, scenario_.duration_s));
    if (next_edge_ < fault_edges_.size()) {
      smooth_until_s_ = std::min(smooth_until_s_, fault_edges_[next_edge_].time_s);
    }
    for (std::size_t i = 0; i < motion_.size() && !driven_; ++i) {
      smooth_until_s_ = std::min(smooth_until_s_, motion_[i].smooth_until_s(piece_[i], time_s_));
    }
    target_s = std::min(target_s, smooth_until_s_);
    if (driven_ && next_pulse < pulses.size()) target_s = std::min(target_s, start_s + pulses[next_pulse].offset_s);
    integrate_to(target_s);
  }
}

void Plant::after_jump() {
  derivative(time_s_, y_.data(), dydt_.data());
  now_ = scratch_;
  const bool goes_on =
      violated(now_) && (regime_ != Regime::kRolling || scenario_.run.on_violation == OnViolation::kContinue);
  if (goes_on) {
    // Its N and f_s do not come about; what rolling on would have needed is worth saying.
    if (regime_ == Regime::kRolling) note_mu(time_s_, y_, now_);
  } else {
    note(time_s_, y_, now_);
    note_motors();
  }
  if (violated(now_)) leave_regime();
}

// The direction of the slip as a step begins.
void Plant::aim_slip() {
  const Vector2d slip = slip_W_mps(y_.data()).head<2>();
  const double speed = slip.norm();
  if (slip_begins_ && speed < kSlipBegins * speed_scale_mps_) {
    const OpenContact open = open_contact_now();
    slip_direction_W_ =
        follow_slip_direction({open.free_slip_rate_W_mps2, open.compliance_W}, kinetic_friction_, slip_direction_W_);
  } else if (speed > kSlipVanishes * speed_scale_mps_) {
    const bool same_law = !slip_begins_ && speed > slip_kept_mps_;
    slip_direction_W_ = slip / speed;
    slip_kept_mps_ = std::max(kSlipVanishes * speed_scale_mps_, kSlipKept * speed);
    slip_begins_ = false;
    if (!same_law) derivative(time_s_, y_.data(), dydt_.data());
  }
}

void Plant::integrate_to(double target_s) {
  while (time_s_ < target_s && end_ == PhysicsEnd::kNone) {
    if (!steps_ahead()) {
      const double left_s = target_s - time_s_;
      if (const double h = try_step(pulsed_, left_s); h > 0) take_span(h, h >= left_s, target_s);
      continue;
    }
    if (!(time_s_ < ahead_end_s_)) {
      const double left_s = smooth_until_s_ - time_s_;
      const double h = try_step(ahead_, left_s);
      if (h <= 0) continue;
      ahead_.prepare_dense([this](double t, const double* y, double* d) { derivative(t, y, d); });
      ahead_start_s_ = time_s_;
      ahead_end_s_ = h >= left_s ? smooth_until_s_ : time_s_ + h;
    }
    // A whole step of this integrator is too long to be judged by its ends and its middle.
    const double longest_s = (ahead_end_s_ - ahead_start_s_) / kSpansPerStep;
    const double end_s = std::min(target_s, ahead_end_s_);
    if (end_s - time_s_ > 1.001 * longest_s && time_s_ + longest_s > time_s_) {
      take_span(longest_s, false, 0);
    } else {
      take_span(end_s - time_s_, true, end_s);
    }
  }
}

// Tries a step from time_s_ by at most longest_s and returns its length; 0 if it was too long, or no step will do.
template <class Method>
double Plant::try_step(Method& method, double longest_s) {
  if (regime_ == Regime::kSliding) {
    aim_slip();
    if (slip_begins_) longest_s = std::min(longest_s, kSlipBeginsStep * body_.radius_m / speed_scale_mps_);
  }
  const bool whole = longest_s <= step_s_ * 1.001;  // no sliver for the last step
  const double h = whole ? longest_s : step_s_;
  step_y_ = y_;
  step_dydt_ = dydt_;
  method.step([this](double t, const double* y, double* d) { derivative(t, y, d); }, time_s_, h, step_y_, step_dydt_,
              size_);
  const double error = method.error(regime_ != Regime::kRolling ? kOpenTolerance
                                    : steps_ahead()             ? kAheadTolerance
                                                                : kTolerance);
  // 0.9 error^(-1/order), between 0.2 and 5; far below the tolerance the power need not be computed. A trial step that
  // went to where numbers end is too long, like any other.
  const double growth = error < 1e-6        ? 5.0
                        : error < kInfinity ? std::clamp(0.9 * std::pow(error, -1. / Method::kErrorOrder), 0.2, 5.0)
                                            : 0.2;
  const double allowed_s = h * growth;
  if (error <= 1) {
    step_s_ = whole ? std::max(step_s_, allowed_s) : allowed_s;
  } else {
    step_s_ = allowed_s;
    if (allowed_s < 1e-14 * std::max(1.0, time_s_)) end_inconsistent("no step is small enough to follow the motion");
  }
  if (!(error < kInfinity) && allowed_s < 1e-9 * scenario_.run.control_period_s) {
    // While sliding a NaN says that the normal coefficient is not positive.
    end_inconsistent(regime_ == Regime::kSliding ? kPainleve : "the state stopped being finite");
  } else if (--steps_left_ == 0) {
    end_inconsistent("the motion is too stiff: more than " + std::to_string(kMaxSteps) +
                     " steps in one control period");
  }
  return error <= 1 ? h : 0;
}

// What holds at time_s_ + offset_s, inside the step that was tried last, and all of it but the motion in `y`, `dydt`.
void Plant::look_inside(double offset_s, Point& out) {
  const auto rhs = [this](double t, const double* y, double* d) { derivative(t, y, d); };
  if (!steps_ahead()) {
    probe_.step(rhs, time_s_, offset_s, step_y_, step_dydt_, size_);
    out.y = probe_.end_state();
    out.dydt = probe_.end_derivative();
  } else {
    ahead_.interpolate((time_s_ + offset_s - ahead_start_s_) / (ahead_end_s_ - ahead_start_s_), out.y);
    normalise(out.y);
    derivative(time_s_ + offset_s, out.y.data(), out.dydt.data());
  }
  out.motion = scratch_;
}

// The ends of a span of length h from time_s_ that has been integrated; of its middle only the motion is wanted.
void Plant::look_at_span(double h, bool to_step_end, Point& middle, Point& end) {
  if (steps_ahead()) {
    look_inside(h / 2, middle);
    if (!to_step_end) return look_inside(h, end);
    end.y = ahead_.end_state();
    normalise(end.y);
    derivative(ahead_end_s_, end.y.data(), end.dydt.data());
    end.motion = scratch_;
    return;
  }
  end.y = pulsed_.end_state();
  end.dydt = pulsed_.end_derivative();
  end.motion = scratch_;
  pulsed_.interpolate(0.5, middle.y);
  evaluate(time_s_ + h / 2, middle.y.data(), middle.motion);
}

// The motors' next pulses are not known, and where a slip ends its direction is no smooth function of time.
bool Plant::steps_ahead() const { return !driven_ && regime_ != Regime::kSliding; }

void Plant::normalise(State& y) {
  const double length = std::sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2] + y[3] * y[3]);
  for (std::size_t i = 0; i < 4; ++i) y[i] /= length;
}

// The span of length h from time_s_ has been integrated. Looks inside, then moves to its end, or to where the regime
// ends. `exactly`: its end is to be called end_s, whatever rounding makes of time_s_ + h.
void Plant::take_span(double h, bool exactly, double end_s) {
  Point middle, end, inside;
  look_at_span(h, exactly && end_s == ahead_end_s_, middle, end);

  // The first part of the span at whose end the regime, or a stop's push or rest, is found over: its middle, its end,
  // or a peak inside it.
  const auto over = [this](const Point& p) { return violated(p.motion) || stops_overdue(p.y); };
  double broken = over(middle) ? 0.5 : over(end) ? 1 : kInfinity;
  const auto search = [&](double limit, auto value) {
    const double part = find_peak(h, middle.motion, end.motion, limit, value);
    if (part < broken && (look_inside(part * h, inside), violated(inside.motion))) broken = part;
  };
  if (regime_ == Regime::kRolling && static_friction_ < kInfinity) {
    search(static_friction_, [this](const Instant& m) { return ratio(m); });
  }
  if (regime_ != Regime::kFlight) search(0, [](const Instant& m) { return -m.normal_force_n; });
  if (regime_ != Regime::kRolling) search(0, [](const Instant& m) { return -m.left; });
  for (const std::size_t i : with_stops_) {
    if (!may_peak_above(overdue_m(i, y_), overdue_m(i, middle.y), overdue_m(i, end.y), 0)) continue;
    const double part = golden_section([&](double at) { return look_inside(at * h, inside), overdue_m(i, inside.y); });
    if (part < broken && (look_inside(part * h, inside), stops_overdue(inside.y))) broken = part;
  }

  if (broken <= 1) {
    h *= first_broken(time_s_, h, broken, [&](double part) { return look_inside(part * h, inside), over(inside); });
    look_inside(h, end);
    // A step over the end of a slip is smooth past it, where the direction is kept, and its error estimate knows
    // nothing of how the direction turns before; the part up to the end is held to the tolerance by an estimate of its
    // own.
    if (regime_ == Regime::kSliding && h > kShortestPart * std::max(1.0, time_s_)) {
      const double error = probe_.error(kOpenTolerance);
      if (!(error <= 1)) {
        step_s_ = h * (error < kInfinity ? std::clamp(0.9 * std::pow(error, -0.2), 0.2, 0.9) : 0.2);
        return;
      }
    }
    look_inside(h / 2, middle);
  }

  // Extrema inside: only a peak that may beat the best so far is worth finding.
  // Where a slip ends its direction is that of the step's start, and so are the forces there: they do not count.
  const bool regime_over = broken <= 1 && violated(end.motion);
  const bool slip_ends = regime_over && regime_ == Regime::kSliding && end.motion.normal_force_n > 0;
  const auto look = [&](double best, auto value) {
    const double part = find_peak(h, middle.motion, end.motion, best, value);
    if (part < 1) look_inside(part * h, inside), note(time_s_ + part * h, inside.y, inside.motion);
  };
  if (regime_ != Regime::kFlight && !slip_ends) {
    look(extrema_.normal_force_max.value, [](const Instant& m) { return m.normal_force_n; });
    look(-extrema_.normal_force_min.value, [](const Instant& m) { return -m.normal_force_n; });
    look(extrema_.static_friction_max.value, [](const Instant& m) { return m.static_friction_n; });
    if (end.motion.normal_force_n > 0) {
      look(extrema_.mu_required_max.value, [this](const Instant& m) { return ratio(m); });
    }
  }

  if (driven_) note_energy(h, middle, end);
  time_s_ = exactly && broken > 1 ? end_s : time_s_ + h;
  y_ = end.y;
  dydt_ = end.dydt;
  now_ = end.motion;
  normalise(y_);
  if (!slip_ends) {
    note(time_s_, y_, now_);
    note_motors();
  }
  if (broken <= 1 && !regime_over) {
    touch_stops();
    after_jump();
  } else if (regime_over) {
    if (steps_ahead()) {
      // What comes next starts from a step to here, which is better than the dense output.
      const auto rhs = [this](double t, const double* y, double* d) { derivative(t, y, d); };
      ahead_.step(rhs, ahead_start_s_, time_s_ - ahead_start_s_, step_y_, step_dydt_, size_);
      y_ = ahead_.end_state();
      normalise(y_);
      derivative(time_s_, y_.data(), dydt_.data());
    }
    ahead_end_s_ = time_s_;  // the rest of the step is of a regime that is over
    leave_regime();
  }
}

// Where in the span from time_s_ by h a value that may rise above `floor` has its peak, as a part of it; +infinity if
// it has none there. `middle` and `end` are what holds in the middle and at the end.
template <class Value>
double Plant::find_peak(double h, const Instant& middle, const Instant& end, double floor, Value value) {
  if (!may_peak_above(value(now_), value(middle), value(end), floor)) return kInfinity;
  Point inside;
  return golden_section([&](double part) { return look_inside(part * h, inside), value(inside.motion); });
}

// Whether the regime is over.
bool Plant::violated(const Instant& m) const {
  switch (regime_) {
    case Regime::kRolling:
      return !(m.normal_force_n > 0) || m.static_friction_n > static_friction_ * m.normal_force_n;
    case Regime::kSliding:
      return !(m.normal_force_n > 0) || m.left < 0;
    case Regime::kFlight:
      // As flight begins height and climb are 0 up to rounding of either sign.
      return m.left < 0 && (m.climb_mps < -kSlipVanishes * speed_scale_mps_ || m.left < -1e-12 * body_.radius_m);
  }
  return false;
}

double Plant::ratio(const Instant& m) const {
  if (regime_ == Regime::kFlight) return 0;
  if (regime_ == Regime::kSliding) return kinetic_friction_;
  return mu_required(m.normal_force_n, m.static_friction_n);
}

void Plant::end_inconsistent(std::string text) {
  if (extrema_.normal_force_min.time_s < 0) note(time_s_, y_, now_);  // as it starts: there is nothing else to say
  end_ = PhysicsEnd::kInconsistent;
  end_text_ = std::move(text);
}

void Plant::leave_regime() {
  if (!std::isfinite(now_.normal_force_n) || !std::isfinite(now_.static_friction_n)) {
    end_inconsistent(regime_ == Regime::kSliding ? kPainleve : "the contact force stopped being finite");
    return;
  }
  if (time_s_ - last_change_s_ > kOneInstant * std::max(1.0, time_s_)) changes_here_ = 0;
  last_change_s_ = time_s_;
  if (++changes_here_ > kMostChanges) {
    end_inconsistent("the contact changes between its regimes without end at one instant");
    return;
  }
  double* extra = &y_[contact_size_];
  switch (regime_) {
    case Regime::kRolling:
      rolling_lost_ = true;
      if (scenario_.run.on_violation == OnViolation::kStop) {
        end_ = !(now_.normal_force_n > 0) ? PhysicsEnd::kDetached : PhysicsEnd::kSlipped;
        return;
      }
      extra[0] = extra[3] = 0;
      extra[1] = dydt_[kZ];
      extra[2] = dydt_[kZ + 1];
      touch(Vector2d::Zero());
      return;
    case Regime::kSliding:
      if (!(now_.normal_force_n > 0)) {
        enter(Regime::kFlight);
      } else {
        touch(Vector2d::Zero());
      }
      return;
    case Regime::kFlight:
      land();
      return;
  }
}

// At time_s_, with the state complete.
void Plant::enter(Regime regime) {
  regime_ = regime;
  size_ = contact_size_ + (regime == Regime::kRolling ? 0 : 4);
  if (!regimes_.empty() && regimes_.back().time_s == time_s_) regimes_.pop_back();
  if (regimes_.empty() || regimes_.back().regime != regime) regimes_.push_back({regime, time_s_});
  derivative(time_s_, y_.data(), dydt_.data());
  now_ = scratch_;
  if (regime == Regime::kSliding && !std::isfinite(now_.normal_force_n)) {
    end_inconsistent(kPainleve);
    return;
  }
  if (violated(now_)) {
    leave_regime();  // its N and f_s do not come about
    return;
  }
  note(time_s_, y_, now_);
  note_motors();
}

// The height is 0 and falling: one impulse, PHYSICS.md section 4.
void Plant::land() {
  double* extra = &y_[contact_size_];
  extra[0] = 0;
  const Vector3d before = slip_W_mps(y_.data());
  const double arriving = -before[2];
  const double leaving = arriving > kRestSpeed * speed_scale_mps_ ? scenario_.surface.restitution * arriving : 0.0;
  const OpenContact open = open_contact_now();
  std::string why;
  const auto impact = impact_impulse(before, open.compliance_W, static_friction_, kinetic_friction_, leaving, why);
  if (!impact) {
    end_inconsistent(why);
    return;
  }
  const Vector3d& impulse = impact->impulse_W_ns;
  const Vector3d after(impact->slip_W_mps[0], impact->slip_W_mps[1], leaving);
  // The work of an impulse is its product with the mean velocity of the point it acts on.
  if (impulse.dot(before + after) > 1e-9 * impulse.norm() * (before.norm() + after.norm())) {
    end_inconsistent("Newton's restitution would make energy out of nothing in this impact: it reverses the slip");
    return;
  }
  const VelocityJump jump = apply_impulse(body_, open, impulse);
  for (int j = 0; j < 3; ++j) {
    extra[1 + j] += jump.velocity_W_mps[j];
    y_[kOmega + static_cast<std::size_t>(j)] += jump.angular_velocity_B_radps[j];
  }
  for (std::size_t i = 0; driven_ && i < motion_.size(); ++i) {
    y_[kTheta + motion_.size() + i] += jump.mass_velocity[i];
  }
  touch_stops();
  extra[3] = leaving;
  impacts_.push_back({time_s_, impulse[2], impulse.head<2>().norm(), impact->sticking});
  if (leaving > 0) {
    enter(Regime::kFlight);
  } else {
    touch(impact->slip_W_mps);
  }
}

void Plant::touch(const Vector2d& slip_W_mps) {
  const double speed = slip_W_mps.norm();
  if (speed > kSlipVanishes * speed_scale_mps_) {
    if (std::isinf(kinetic_friction_)) {
      end_inconsistent("the ball is to slide, and friction is infinite");
      return;
    }
    slip_begins_ = false;
    slip_direction_W_ = slip_W_mps / speed;
    slip_kept_mps_ = kSlipKept * speed;
    enter(Regime::kSliding);
    return;
  }

  // Rolling, if friction and normal force allow it.
  const Regime before = std::exchange(regime_, Regime::kRolling);
  Instant rolling;
  evaluate(time_s_, y_.data(), rolling);
  const bool can_roll = !violated(rolling);
  regime_ = before;
  if (can_roll) {
    enter(Regime::kRolling);
    return;
  }
  // Else flight, if that is where it goes without the floor; else sliding.
  const OpenContact open = open_contact_now();
  const ContactRelation contact{open.free_slip_rate_W_mps2, open.compliance_W};
  // Rounding of f_s makes rolling end that much of N, over mu_s, before N is 0.
  const double negligible = 1e-12 * (body_.gravity_mps2 + contact.free.norm()) / std::min(1.0, static_friction_);
  if (contact.free[2] >= -negligible) {
    enter(Regime::kFlight);
    return;
  }
  if (std::isinf(kinetic_friction_)) {
    end_inconsistent(
        "with perfect friction the ball can neither roll, for the floor would have to pull it, nor leave the ground");
    return;
  }
  const Vector3d sticking_W = rolling.rotation_B_to_W * rolling.contact_force_B_n;
  const auto direction = slip_direction(contact, kinetic_friction_, -sticking_W.head<2>(), 1e-9 * contact.free.norm());
  if (!direction) {
    end_inconsistent("rolling is over, and no direction of slip obeys the laws of friction (Painleve's paradox)");
    return;
  }
  slip_begins_ = true;
  slip_direction_W_ = *direction;
  slip_kept_mps_ = kSlipVanishes * speed_scale_mps_;
  // The contact point's velocity is 0 but for rounding: exactly that of rolling.
  const Vector3d omega_W = open.rotation_B_to_W * Vector3d(y_[kOmega], y_[kOmega + 1], y_[kOmega + 2]);
  y_[contact_size_ + 1] = body_.radius_m * omega_W[1];
  y_[contact_size_ + 2] = -body_.radius_m * omega_W[0];
  enter(Regime::kSliding);
}

void Plant::note_mu(double time_s, const State& y, const Instant& m) {
  const double mu = ratio(m);
  if (mu > extrema_.mu_required_max.value + kNoise || extrema_.mu_required_max.time_s < 0) {
    extrema_.mu_required_max = {mu, time_s};
    at_mu_max_.regime = regime_;
    at_mu_max_.y = y;
    at_mu_max_.push_W_n = push_W_n_;
    if (driven_) {
      at_mu_max_.mass_acceleration = m.mass_acceleration;
    } else {
      std::copy(piece_.begin(), piece_.end(), at_mu_max_.piece.begin());
    }
  }
  tick_mu_required_max_ = std::max(tick_mu_required_max_, mu);
}

void Plant::note(double time_s, const State& y, const Instant& m) {
  // An extremum moves only if it is beaten by more than rounding, so that a constant keeps its first time.
  const auto raise = [time_s](Extremum& best, double value, double noise) {
    if (value > best.value + noise || best.time_s < 0) best = {value, time_s};
  };
  note_mu(time_s, y, m);
  const double normal_force_n = pushed(m.normal_force_n);
  raise(extrema_.normal_force_max, normal_force_n, noise_n_);
  raise(extrema_.static_friction_max, m.static_friction_n, noise_n_);
  Extremum least{-extrema_.normal_force_min.value, extrema_.normal_force_min.time_s};
  raise(least, -normal_force_n, noise_n_);
  extrema_.normal_force_min = {-least.value, least.time_s};
  tick_normal_force_min_n_ = std::min(tick_normal_force_min_n_, normal_force_n);
}

std::optional<ContactShares> Plant::shares_at_mu_required_max() const {
  if (at_mu_max_.regime != Regime::kRolling) return std::nullopt;
  const double time_s = extrema_.mu_required_max.time_s;
  const double* y = at_mu_max_.y.data();
  MassPoint masses = mass_point(time_s, y, at_mu_max_.piece.data());
  if (driven_) masses.acceleration = at_mu_max_.mass_acceleration;
  Body body = body_;
  body.external_force.set_push(at_mu_max_.push_W_n);
  return contact_shares(body, time_s, y + kQ, y + kOmega, carried(masses));
}

Plant::PerMass Plant::needed_torques(const double* y, const MotionOf<double>& motion, const MassPoint& masses) const {
  PerMass torque{};
  generalised_forces(body_, y + kOmega, masses.position.data(), masses.velocity.data(), masses.acceleration.data(),
                     motion, torque.data());
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    torque[i] = body_.trajectory[i].empty() ? torque[i] / scenario_.masses[i].motor.shaft_ratio : 0;
  }
  return torque;
}

void Plant::note_motors() {
  if (motion_.empty()) return;
  const MassPoint masses = mass_point(time_s_, y_.data());
  if (!driven_) torque_nm_ = needed_torques(y_.data(), now_, masses);
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    if (!body_.trajectory[i].empty()) continue;  // no motor
    const Motor& motor = scenario_.masses[i].motor;
    const double angle = motor.shaft_ratio * masses.position[i];
    const double speed = motor.shaft_ratio * masses.velocity[i];
    MotorExtrema& extrema = motor_extrema_[i];
    if (driven_) {
      const double stop_n = end_stops_[i].force_n(stop_side_[i], masses.position[i], masses.velocity[i]);
      const double beside_n = held_n(i, masses.position[i], masses.velocity[i]);
      torque_nm_[i] = (now_.generalised_force[i] - beside_n) / motor.shaft_ratio;
      EndStopRecord& stop = end_stop_record_[i];
      stop.max_force_n = std::max(stop.max_force_n, std::abs(stop_n));
      if (stop_side_[i] != 0) {
        const double outside_m = body_.path(i, masses.position[i]).position.norm() - body_.radius_m;
        if (outside_m > 0 && stop.outside_ball_s < 0) stop.outside_ball_s = time_s_;
        stop.outside_ball_m = std::max(stop.outside_ball_m, outside_m);
      }
    }
    extrema.max_torque_nm = std::max(extrema.max_torque_nm, std::abs(torque_nm_[i]));
    double margin;
    if (driven_) {
      steppers_[i].count_slips(angle);
      margin = steppers_[i].torque_margin(angle, speed);
    } else {
      margin =
          1 - std::abs(torque_nm_[i] + motor.viscous_damping_nms * speed) / steppers_[i].available_torque_nm(speed);
    }
    extrema.torque_margin = std::min(extrema.torque_margin, margin);
  }
}

// Over the span of length h from time_s_ and y_, before they move on.
void Plant::note_energy(double h, const Point& middle, const Point& end) {
  const std::array<const double*, 3> y{y_.data(), middle.y.data(), end.y.data()};
  const std::array<const Instant*, 3> motion{&now_, &middle.motion, &end.motion};
  constexpr std::array<double, 3> kWeight{1. / 6, 4. / 6, 1. / 6};
  const std::size_t n = motion_.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Motor& motor = scenario_.masses[i].motor;
    const PhaseCurrent& phases = steppers_[i].phases();
    MotorEnergy& energy = motor_energy_[i];
    for (std::size_t k = 0; k < 3; ++k) {
      const double rate = y[k][kTheta + n + i], speed = motor.shaft_ratio * rate, part_s = kWeight[k] * h;
      energy.work_j += part_s * (motion[k]->generalised_force[i] - held_n(i, y[k][kTheta + i], rate)) * rate;
      energy.friction_j += part_s * motor.viscous_damping_nms * speed * speed;
      if (!motor.has_winding()) continue;
      const auto current = steppers_[i].current(motor.shaft_ratio * y[k][kTheta + i], speed);
      energy.copper_j += part_s * phases.copper_loss_w(current);
      energy.electrical_j += part_s * steppers_[i].terminal_power_w(current, speed);
    }
  }
}

Plant::StoredEnergy Plant::stored_energy(std::size_t i, const MassPoint& masses) const {
  const double shaft = scenario_.masses[i].motor.shaft_ratio, angle = shaft * masses.position[i];
  const Stepper& stepper = steppers_[i];
  return {stepper.phases().field_energy_j(stepper.current(angle, shaft * masses.velocity[i])),
          stepper.detent_energy_j(angle)};
}

MotorEnergy Plant::motor_energy(int i) const {
  const auto k = static_cast<std::size_t>(i);
  MotorEnergy energy = motor_energy_[k];
  if (!driven_) return energy;
  const StoredEnergy now = stored_energy(k, mass_point(time_s_, y_.data()));
  const double field_j = now.winding_j - stored_at_start_[k].winding_j;
  energy.electrical_j += field_j;
  energy.stored_j = field_j + now.detent_j - stored_at_start_[k].detent_j;
  return energy;
}

double Plant::motor_steps_behind(int i) const {
  const auto k = static_cast<std::size_t>(i);
  return driven_ ? steppers_[k].steps_behind(scenario_.masses[k].motor.shaft_ratio * y_[kTheta + k]) : 0;
}

Plant::Sample Plant::sample() const {
  const MassPoint masses = mass_point(time_s_, y_.data());
  Sample s{};
  s.time_s = time_s_;
  s.orientation = {y_[0], y_[1], y_[2], y_[3]};
  s.angular_velocity_B_radps = {y_[kOmega], y_[kOmega + 1], y_[kOmega + 2]};
  s.position_W_m = {y_[kZ], y_[kZ + 1], 0};
  s.velocity_W_mps = {dydt_[kZ], dydt_[kZ + 1], 0};
  s.regime = end_ == PhysicsEnd::kSlipped ? Regime::kSliding : regime_;
  s.floor_static_friction = static_friction_;
  if (regime_ != Regime::kRolling) {
    s.position_W_m[2] = y_[contact_size_];
    s.velocity_W_mps[2] = y_[contact_size_ + 3];
  }
  s.acceleration_B_mps2 = now_.acceleration_B_mps2;
  s.up_B = now_.up_B;
  s.normal_force_n = pushed(now_.normal_force_n);
  s.static_friction_n = now_.static_friction_n;
  s.normal_force_min_n = tick_normal_force_min_n_;
  s.mu_required_max = tick_mu_required_max_;
  s.friction_force_W_n = (now_.rotation_B_to_W * now_.contact_force_B_n).head<2>();
  s.center_of_mass_B_m = body_.shell_mass_kg * body_.center_of_mass_B_m;
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    s.mass_position[i] = masses.position[i];
    s.mass_velocity[i] = masses.velocity[i];
    s.mass_position_B_m[i] = body_.path(i, masses.position[i]).position;
    s.center_of_mass_B_m += body_.mass_kg[i] * s.mass_position_B_m[i];
    s.motor_torque_nm[i] = torque_nm_[i];
    s.lost_steps[i] = steppers_[i].lost_steps();
    s.end_switches[i] = body_.rail[i].lower_end >= masses.position[i] ? 1 : 0;
    if (body_.rail[i].upper_end <= masses.position[i]) s.end_switches[i] |= 2;
  }
  s.center_of_mass_B_m /= body_.total_mass_kg;
  return s;
}

Plant::ContactForces Plant::contact_forces(const double* position, const double* velocity,
                                           const double* acceleration) const {
  CarriedMasses masses;
  carry_along(body_, position, velocity, acceleration, masses);
  Instant motion;
  evaluate_prescribed(time_s_, y_.data(), masses, motion);
  return {pushed(motion.normal_force_n), motion.static_friction_n};
}

}  // namespace ballast::sim
