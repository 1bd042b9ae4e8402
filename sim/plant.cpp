#include "sim/plant.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ballast::sim {

using Eigen::Vector3d;

namespace {

// Allowed local error of a step, relative to 1 + |component|: some thousand times the rounding of one step, and with
// the error growth of the paper's runs (about 1e3 over 20 time units) far below the 1e-8 they are held to.
constexpr double kTolerance = 1e-12;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Two forces closer than this part of the weight, and two ratios closer than this, differ by rounding only.
constexpr double kNoise = 1e-13;

// Within one call of advance(); a robot at 1 kHz takes a few.
constexpr int kMaxSteps = 2'000'000;

// Whether a smooth function with these values at the start, the middle and the end of a step may have a peak above
// `floor` in between: by the parabola through them, with half its bend as allowance for what a parabola leaves out. A
// few vain searches cost less than a peak missed.
bool may_peak_above(double v0, double vm, double v1, double floor) {
  const double bend = 2 * vm - v0 - v1;  // the parabola rises bend / 4 above its chord's middle
  const double slope_0 = 4 * vm - 3 * v0 - v1, slope_1 = v0 - 4 * vm + 3 * v1;
  if (!(slope_0 > -std::abs(bend) && slope_1 < std::abs(bend))) return false;
  return std::max({v0, vm, v1}) + std::abs(bend) / 2 > floor;
}

// Where in (0, 1) f is greatest, by golden section; f is taken to have one peak there.
template <class F>
double golden_section(F&& f) {
  constexpr double kGolden = 0.6180339887498949;
  double lo = 0, hi = 1;
  double left = hi - kGolden * (hi - lo), right = lo + kGolden * (hi - lo);
  double f_left = f(left), f_right = f(right);
  // 45 shrinkings: 4e-10 of the step, where a smooth peak is flat to rounding.
  for (int i = 0; i < 45; ++i) {
    if (f_left < f_right) {
      lo = left, left = right, f_left = f_right;
      f_right = f(right = lo + kGolden * (hi - lo));
    } else {
      hi = right, right = left, f_right = f_left;
      f_left = f(left = hi - kGolden * (hi - lo));
    }
  }
  return (lo + hi) / 2;
}

double ratio(const Motion& m) { return Plant::mu_required(m.normal_force_n, m.static_friction_n); }

}  // namespace

double Plant::mu_required(double normal_force_n, double static_friction_n) {
  return normal_force_n > 0 ? static_friction_n / normal_force_n : kInfinity;
}

Plant::Plant(const Scenario& scenario)
    : scenario_(scenario),
      body_(scenario),
      driven_(scenario.run.actuation == Actuation::kStepper),
      size_(kTheta + (driven_ ? 2 * scenario.masses.size() : 0)),
      static_friction_(scenario.surface.static_friction),
      step_s_(scenario.run.control_period_s),
      extrema_{{0, -1}, {0, -1}, {0, -1}, {0, -1}},
      tick_normal_force_min_n_(kInfinity),
      tick_mu_required_max_(0),
      noise_n_(kNoise * body_.total_mass_kg * body_.gravity_mps2) {
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
  }
  piece_.assign(n, 0);

  if (driven_) {
    // Each motor stands balanced under the load of the masses held as they are (thetaddot = 0).
    const MassPoint masses = mass_point(0, y_.data());
    const std::array<double, kMaxMasses> held{};
    Motion at_rest;
    rolling_prescribed(body_, &y_[kQ], &y_[kOmega], masses.position.data(), masses.velocity.data(), held.data(),
                       at_rest);
    const PerMass torque = needed_torques(y_.data(), at_rest, masses);
    for (std::size_t i = 0; i < n; ++i) {
      const Motor& motor = scenario.masses[i].motor;
      steppers_[i].balance(torque[i], motor.shaft_ratio * masses.velocity[i]);
    }
  }
  after_jump();
}

Plant::MassPoint Plant::mass_point(double time_s, const double* y) const {
  MassPoint p{};
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    if (driven_) {
      p.position[i] = y[kTheta + i];
      p.velocity[i] = y[kTheta + motion_.size() + i];
    } else {
      const auto point = motion_[i].at(piece_[i], time_s);
      p.position[i] = point.position;
      p.velocity[i] = point.velocity;
      p.acceleration[i] = point.acceleration;
    }
  }
  return p;
}

void Plant::evaluate(double time_s, const double* y, Motion& motion) const {
  const MassPoint p = mass_point(time_s, y);
  if (!driven_) {
    rolling_prescribed(body_, y + kQ, y + kOmega, p.position.data(), p.velocity.data(), p.acceleration.data(), motion);
    return;
  }
  std::array<double, kMaxMasses> force{};
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    const double shaft = scenario_.masses[i].motor.shaft_ratio;
    force[i] = shaft * steppers_[i].torque_nm(shaft * p.position[i], shaft * p.velocity[i]);
  }
  rolling_driven(body_, y + kQ, y + kOmega, p.position.data(), p.velocity.data(), force.data(), motion);
}

void Plant::derivative(double time_s, const double* y, double* dydt) {
  evaluate(time_s, y, scratch_);
  const double w = y[kQ], qx = y[kQ + 1], qy = y[kQ + 2], qz = y[kQ + 3];
  const double ox = y[kOmega], oy = y[kOmega + 1], oz = y[kOmega + 2];
  // qdot = q Omega / 2 (rolling_ball_ode_f)
  dydt[kQ] = -0.5 * (qx * ox + qy * oy + qz * oz);
  dydt[kQ + 1] = 0.5 * (w * ox + qy * oz - qz * oy);
  dydt[kQ + 2] = 0.5 * (w * oy + qz * ox - qx * oz);
  dydt[kQ + 3] = 0.5 * (w * oz + qx * oy - qy * ox);
  for (int j = 0; j < 3; ++j) dydt[kOmega + j] = scratch_.angular_acceleration_B_radps2[j];
  // zdot = omega x r e3 = r (omega_2, -omega_1)
  const Vector3d omega_W = scratch_.rotation_B_to_W * Vector3d(ox, oy, oz);
  dydt[kZ] = body_.radius_m * omega_W[1];
  dydt[kZ + 1] = -body_.radius_m * omega_W[0];
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
  if (end_ == PhysicsEnd::kNone && end_s > time_s_) {
    tick_normal_force_min_n_ = now_.normal_force_n;
    tick_mu_required_max_ = ratio(now_);
  }
  std::size_t next_pulse = 0;
  while (end_ == PhysicsEnd::kNone) {
    // What happens at this instant, all of it, before anything is looked at again.
    bool jumped = false;
    for (std::size_t i = 0; i < motion_.size() && !driven_; ++i) {
      while (motion_[i].end_s(piece_[i]) <= time_s_) ++piece_[i], jumped = true;
    }
    for (; driven_ && next_pulse < pulses.size() && start_s + pulses[next_pulse].offset_s <= time_s_; ++next_pulse) {
      steppers_[static_cast<std::size_t>(pulses[next_pulse].motor)].step(pulses[next_pulse].direction);
      jumped = true;
    }
    if (jumped) after_jump();
    if (end_ != PhysicsEnd::kNone || time_s_ >= end_s) return;

    double target_s = end_s;
    for (std::size_t i = 0; i < motion_.size() && !driven_; ++i)
      target_s = std::min(target_s, motion_[i].end_s(piece_[i]));
    if (driven_ && next_pulse < pulses.size()) target_s = std::min(target_s, start_s + pulses[next_pulse].offset_s);
    integrate_to(target_s);
  }
}

void Plant::after_jump() {
  derivative(time_s_, y_.data(), dydt_.data());
  now_ = scratch_;
  note(time_s_, now_);
  note_motors();
  if (violated(now_)) set_end(now_);
}

void Plant::integrate_to(double target_s) {
  while (time_s_ < target_s && end_ == PhysicsEnd::kNone) {
    const double left_s = target_s - time_s_;
    const bool whole = left_s <= step_s_ * 1.001;  // no sliver for the last step
    const double h = whole ? left_s : step_s_;
    integrator_.step([this](double t, const double* y, double* d) { derivative(t, y, d); }, time_s_, h, y_, dydt_,
                     size_);
    const double error = integrator_.error(kTolerance);
    // 0.9 error^(-1/5), between 0.2 and 5; far below the tolerance the power need not be computed. A trial step that
    // went to where numbers end is too long, like any other.
    const double growth = error < 1e-4 ? 5.0 : error < kInfinity ? std::max(0.2, 0.9 * std::pow(error, -0.2)) : 0.2;
    const double allowed_s = h * growth;
    if (error <= 1) {
      take_step(h);
      if (whole && end_ == PhysicsEnd::kNone) time_s_ = target_s;
      step_s_ = whole ? std::max(step_s_, allowed_s) : allowed_s;
    } else {
      step_s_ = allowed_s;
    }
    if (error > 1 && allowed_s < 1e-14 * std::max(1.0, time_s_)) {
      end_ = PhysicsEnd::kInconsistent;
      end_text_ = "no step is small enough to follow the motion";
    } else if (!(error < kInfinity) && allowed_s < 1e-9 * scenario_.run.control_period_s) {
      end_ = PhysicsEnd::kInconsistent;
      end_text_ = "the state stopped being finite";
    } else if (--steps_left_ == 0) {
      end_ = PhysicsEnd::kInconsistent;
      end_text_ = "the motion is too stiff: more than " + std::to_string(kMaxSteps) + " steps in one control period";
    }
  }
}

// The integrator has gone from time_s_ by h. Looks inside, then moves there, or to where the envelope is first broken.
void Plant::take_step(double h) {
  const Motion end_motion = scratch_;
  State middle;
  integrator_.interpolate(0.5, middle);
  Motion middle_motion;
  evaluate(time_s_ + h / 2, middle.data(), middle_motion);

  // The first part of the step at whose end the envelope is found broken: its middle, its end, or a peak inside it.
  double broken = violated(middle_motion) ? 0.5 : violated(end_motion) ? 1 : kInfinity;
  const auto search = [&](double limit, auto value) {
    const double part = find_peak(h, 1, middle_motion, end_motion, limit, value);
    if (part < broken && violated(motion_inside(h, part))) broken = part;
  };
  if (static_friction_ < kInfinity) search(static_friction_, ratio);
  search(0, [](const Motion& m) { return -m.normal_force_n; });

  State end_state = integrator_.end_state();
  State end_derivative = integrator_.end_derivative();
  Motion final_motion = end_motion;
  double part = 1;
  if (broken <= 1) {
    part = first_violation(h, broken);
    final_motion = motion_inside(h, part);
    end_state = probe_.end_state();
    end_derivative = probe_.end_derivative();
    evaluate(time_s_ + 0.5 * part * h, (probe_.interpolate(0.5, middle), middle).data(), middle_motion);
  }

  // Extrema inside: only a peak that may beat the best so far is worth finding.
  const auto look = [&](double best, auto value) {
    const double at = find_peak(h, part, middle_motion, final_motion, best, value);
    if (at < part) note(time_s_ + at * h, motion_inside(h, at));
  };
  look(extrema_.normal_force_max.value, [](const Motion& m) { return m.normal_force_n; });
  look(-extrema_.normal_force_min.value, [](const Motion& m) { return -m.normal_force_n; });
  look(extrema_.static_friction_max.value, [](const Motion& m) { return m.static_friction_n; });
  if (final_motion.normal_force_n > 0) look(extrema_.mu_required_max.value, ratio);

  time_s_ += part * h;
  y_ = end_state;
  dydt_ = end_derivative;
  now_ = final_motion;
  const double length = std::sqrt(y_[0] * y_[0] + y_[1] * y_[1] + y_[2] * y_[2] + y_[3] * y_[3]);
  for (std::size_t i = 0; i < 4; ++i) y_[i] /= length;
  note(time_s_, now_);
  note_motors();
  if (broken <= 1) set_end(now_);
}

// Where in the first `part` of the step from time_s_ by h a value that may rise above `floor` has its peak; +infinity
// if it has none there. `middle` and `end` are what holds at half and at the whole of that part.
template <class Value>
double Plant::find_peak(double h, double part, const Motion& middle, const Motion& end, double floor, Value value) {
  if (!may_peak_above(value(now_), value(middle), value(end), floor)) return kInfinity;
  return part * golden_section([&](double p) { return value(motion_inside(h, part * p)); });
}

bool Plant::violated(const Motion& m) const {
  return !(m.normal_force_n > 0) || m.static_friction_n > static_friction_ * m.normal_force_n;
}

void Plant::set_end(const Motion& m) {
  end_ = !(m.normal_force_n > 0) ? PhysicsEnd::kDetached : PhysicsEnd::kSlipped;
  if (!std::isfinite(m.normal_force_n) || !std::isfinite(m.static_friction_n)) {
    end_ = PhysicsEnd::kInconsistent;
    end_text_ = "the contact force stopped being finite";
  }
}

// What holds at time_s_ + part * h, by one integrator step from time_s_; the state is left in probe_.
Motion Plant::motion_inside(double h, double part) {
  probe_.step([this](double t, const double* y, double* d) { derivative(t, y, d); }, time_s_, part * h, y_, dydt_,
              size_);
  return scratch_;
}

// Bisection between the start of the step, where the envelope holds, and a part where it does not: down to rounding,
// and the side where it is broken, so that whoever judges the result sees a violation.
double Plant::first_violation(double h, double violated_part) {
  double good = 0, bad = violated_part;
  while (bad - good > 1e-14 && (bad - good) * h > 1e-15 * std::max(1.0, time_s_)) {
    const double half = 0.5 * (good + bad);
    (violated(motion_inside(h, half)) ? bad : good) = half;
  }
  return bad;
}

void Plant::note(double time_s, const Motion& m) {
  // An extremum moves only if it is beaten by more than rounding, so that a constant keeps its first time.
  const auto raise = [time_s](Extremum& best, double value, double noise) {
    if (value > best.value + noise || best.time_s < 0) best = {value, time_s};
  };
  raise(extrema_.mu_required_max, ratio(m), kNoise);
  raise(extrema_.normal_force_max, m.normal_force_n, noise_n_);
  raise(extrema_.static_friction_max, m.static_friction_n, noise_n_);
  Extremum least{-extrema_.normal_force_min.value, extrema_.normal_force_min.time_s};
  raise(least, -m.normal_force_n, noise_n_);
  extrema_.normal_force_min = {-least.value, least.time_s};
  tick_normal_force_min_n_ = std::min(tick_normal_force_min_n_, m.normal_force_n);
  tick_mu_required_max_ = std::max(tick_mu_required_max_, ratio(m));
}

Plant::PerMass Plant::needed_torques(const double* y, const Motion& motion, const MassPoint& masses) const {
  PerMass torque{};
  generalised_forces(body_, y + kOmega, masses.position.data(), masses.velocity.data(), motion, torque.data());
  for (std::size_t i = 0; i < motion_.size(); ++i) torque[i] /= scenario_.masses[i].motor.shaft_ratio;
  return torque;
}

void Plant::note_motors() {
  if (motion_.empty()) return;
  const MassPoint masses = mass_point(time_s_, y_.data());
  if (!driven_) torque_nm_ = needed_torques(y_.data(), now_, masses);
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    const Motor& motor = scenario_.masses[i].motor;
    const double angle = motor.shaft_ratio * masses.position[i];
    const double speed = motor.shaft_ratio * masses.velocity[i];
    MotorExtrema& extrema = motor_extrema_[i];
    if (driven_) torque_nm_[i] = now_.generalised_force[i] / motor.shaft_ratio;
    extrema.max_torque_nm = std::max(extrema.max_torque_nm, std::abs(torque_nm_[i]));
    double margin;
    if (driven_) {
      steppers_[i].count_slips(angle);
      margin = steppers_[i].torque_margin(angle);
    } else {
      margin =
          1 - std::abs(torque_nm_[i] + motor.viscous_damping_nms * speed) / steppers_[i].available_torque_nm(speed);
    }
    extrema.torque_margin = std::min(extrema.torque_margin, margin);
  }
}

Plant::Sample Plant::sample() const {
  const MassPoint masses = mass_point(time_s_, y_.data());
  Sample s{};
  s.time_s = time_s_;
  s.orientation = {y_[0], y_[1], y_[2], y_[3]};
  s.angular_velocity_B_radps = {y_[kOmega], y_[kOmega + 1], y_[kOmega + 2]};
  s.position_W_m = {y_[kZ], y_[kZ + 1], 0};
  s.velocity_W_mps = {dydt_[kZ], dydt_[kZ + 1], 0};
  s.acceleration_B_mps2 = now_.acceleration_B_mps2;
  s.up_B = now_.up_B;
  s.normal_force_n = now_.normal_force_n;
  s.static_friction_n = now_.static_friction_n;
  s.normal_force_min_n = tick_normal_force_min_n_;
  s.mu_required_max = tick_mu_required_max_;
  s.friction_force_W_n = (now_.rotation_B_to_W * now_.contact_force_B_n).head<2>();
  s.center_of_mass_B_m = body_.shell_mass_kg * body_.center_of_mass_B_m;
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    s.mass_position[i] = masses.position[i];
    s.mass_velocity[i] = masses.velocity[i];
    s.mass_position_B_m[i] = firmware::evaluate(body_.rail[i], masses.position[i]).position;
    s.center_of_mass_B_m += body_.mass_kg[i] * s.mass_position_B_m[i];
    s.motor_torque_nm[i] = torque_nm_[i];
    s.lost_steps[i] = steppers_[i].lost_steps();
  }
  s.center_of_mass_B_m /= body_.total_mass_kg;
  return s;
}

}  // namespace ballast::sim
