#include "tools/integrators/rolling_run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "sim/integrators/step_search.h"
#include "sim/motors/stepper.h"

namespace ballast::integrators {

using sim::MotionOf;
using sim::RollingOde;

namespace {

using Clock = std::chrono::steady_clock;
using Motion = MotionOf<double>;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// As in sim/plant/plant.cpp: two forces closer than this part of the weight, and two ratios closer than this, differ by
// rounding only.
constexpr double kNoise = 1e-13;

// More than any method takes at the tightest tolerance for a run of a day.
constexpr std::int64_t kMostSteps = 200'000'000;

double ratio(const Motion& m) { return sim::mu_required(m.normal_force_n, m.static_friction_n); }

// Drives a method through the stretches between kinks up to end_s. at_start() after each kink, and after_step() after
// each step; false from either ends it. Returns the method's failure.
template <class AtStart, class AfterStep>
std::string drive(RollingProblem& problem, Method& method, double end_s, AtStart at_start, AfterStep after_step) {
  double t = 0;
  State y = problem.ode.initial_state();
  for (;;) {
    problem.ode.begin(t);
    problem.choose_constraint(y.data());
    method.start(t, y);
    if (!at_start() || t >= end_s) return "";
    const double stop = std::min(end_s, problem.ode.end_s());
    while (method.time() < stop) {
      if (!method.step(stop)) return method.failure();
      if (!after_step()) return "";
      if (method.counters().steps > kMostSteps) return "more than " + std::to_string(kMostSteps) + " steps";
      if (problem.choose_constraint(method.state().data())) method.start(method.time(), State(method.state()));
    }
    t = stop;
    y = method.state();
  }
}

class Run {
 public:
  Run(const sim::Scenario& scenario, const MethodInfo& info, const Settings& settings)
      : scenario_(scenario),
        looks_(info.looks),
        mu_s_(scenario.surface.static_friction),
        problem_(scenario, info.form),
        method_(info.make(problem_, settings)),
        noise_n_(kNoise * problem_.ode.body().total_mass_kg * scenario.gravity_mps2) {
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      const sim::Mass& mass = scenario.masses[i];
      steppers_.emplace_back(mass.motor, mass.motor.shaft_ratio * mass.initial_position, scenario.seed);
    }
    out_.result.extrema = {{0, -1}, {0, -1}, {0, -1}, {0, -1}};
    out_.result.regimes = {{sim::Regime::kRolling, 0}};
  }

  RollingRun run() {
    const auto wall_start = Clock::now();
    out_.failure = drive(
        problem_, *method_, scenario_.duration_s, [this] { return start(); }, [this] { return look_inside(); });
    out_.counters = method_->counters();
    sil::RunResult& result = out_.result;
    if (result.end_reason == sil::EndReason::kCompleted) {
      end(method_->time(), method_->state());
      const Motion& m = now_;
      if (!std::isfinite(m.normal_force_n + m.static_friction_n + m.angular_acceleration_B_radps2.sum())) {
        result.end_reason = sil::EndReason::kInconsistent;
        result.end_text = "the contact force stopped being finite";
        out_.failure.clear();
      }
    }
    result.wall_time_s = std::chrono::duration<double>(Clock::now() - wall_start).count();
    return out_;
  }

 private:
  [[nodiscard]] Motion motion(double t, const State& y) const {
    Motion m;
    problem_.ode.motion(t, y.data(), m);
    return m;
  }

  [[nodiscard]] bool violated(const Motion& m) const {
    return !(m.normal_force_n > 0) || m.static_friction_n > mu_s_ * m.normal_force_n;
  }

  bool start() {
    const State& y = method_->state();
    now_ = motion(method_->time(), y);
    note(method_->time(), y, now_);
    if (!violated(now_)) return true;
    leave(method_->time(), y);
    return false;
  }

  // False: rolling ends inside the last step.
  bool look_inside() {
    const State& end_state = method_->state();
    double length = -1;
    for (std::size_t j = 0; j < 4; ++j) length += end_state[j] * end_state[j];
    out_.constraint_error = std::max(out_.constraint_error, std::abs(length));

    const double start = method_->step_start(), whole = method_->time() - start;
    for (int k = 0; k < looks_; ++k) {
      const bool last = k + 1 == looks_;
      const double t = start + whole * k / looks_;
      const double h = last ? method_->time() - t : whole / looks_;
      const double end_s = last ? method_->time() : t + h;
      State middle{}, right = end_state;
      method_->dense(t + h / 2, middle);
      if (!last) method_->dense(end_s, right);
      const Motion middle_motion = motion(t + h / 2, middle), right_motion = motion(end_s, right);
      if (!look(t, h, middle, middle_motion, right, right_motion)) return false;
      now_ = right_motion;
    }
    return true;
  }

  [[nodiscard]] Motion dense_motion(double t) const {
    State y{};
    method_->dense(t, y);
    return motion(t, y);
  }
  [[nodiscard]] Motion exact_motion(double t) const {
    State y{};
    method_->exact(t, y);
    return motion(t, y);
  }

  // From t, where the motion is now_, by h.
  bool look(double t, double h, const State& middle, const Motion& middle_motion, const State& right,
            const Motion& right_motion) {
    // Where in it a value that may rise above `floor` has its peak; +infinity if it has none.
    const auto peak = [&](double floor, auto value) {
      if (!sim::may_peak_above(value(now_), value(middle_motion), value(right_motion), floor)) return kInfinity;
      return sim::golden_section([&](double part) { return value(dense_motion(t + part * h)); });
    };

    double broken = violated(middle_motion) ? 0.5 : violated(right_motion) ? 1 : kInfinity;
    const auto search = [&](double limit, auto value) {
      const double part = peak(limit, value);
      if (part < broken && violated(dense_motion(t + part * h))) broken = part;
    };
    if (mu_s_ < kInfinity) search(mu_s_, ratio);
    search(0, [](const Motion& m) { return -m.normal_force_n; });

    // The interpolant has seen it; the method has the last word on whether and where.
    if (broken <= 1 && violated(exact_motion(t + broken * h))) {
      const double part = sim::first_broken(t, h, broken, [&](double p) { return violated(exact_motion(t + p * h)); });
      const double end_s = t + part * h;
      State y{};
      method_->exact(end_s, y);
      look_for_extrema(t, part * h, dense_motion(t + part * h / 2), motion(end_s, y));
      note(end_s, y, motion(end_s, y));
      leave(end_s, y);
      return false;
    }

    look_for_extrema(t, h, middle_motion, right_motion);
    note_motors(t + h / 2, middle, middle_motion);
    // Inside a step what the interpolant says is good enough to search by, not to be noted.
    if (t + h >= method_->time()) note(t + h, right, right_motion);
    return true;
  }

  // Only a peak that may beat the best so far is worth finding.
  void look_for_extrema(double t, double h, const Motion& middle, const Motion& right) {
    const auto look_for = [&](double best, auto value) {
      if (!sim::may_peak_above(value(now_), value(middle), value(right), best)) return;
      const double part = sim::golden_section([&](double p) { return value(dense_motion(t + p * h)); });
      State y{};
      method_->exact(t + part * h, y);
      note(t + part * h, y, motion(t + part * h, y));
    };
    const sim::ContactExtrema& x = out_.result.extrema;
    look_for(x.normal_force_max.value, [](const Motion& m) { return m.normal_force_n; });
    look_for(-x.normal_force_min.value, [](const Motion& m) { return -m.normal_force_n; });
    look_for(x.static_friction_max.value, [](const Motion& m) { return m.static_friction_n; });
    if (right.normal_force_n > 0) look_for(x.mu_required_max.value, ratio);
  }

  // An extremum moves only if it is beaten by more than rounding, so that a constant keeps its first time.
  void note(double t, const State& y, const Motion& m) {
    sim::ContactExtrema& x = out_.result.extrema;
    const auto raise = [t](sim::Extremum& best, double value, double noise) {
      if (value > best.value + noise || best.time_s < 0) best = {value, t};
    };
    raise(x.mu_required_max, ratio(m), kNoise);
    const double normal_force_n = sim::reported_normal_n(m.normal_force_n);
    raise(x.normal_force_max, normal_force_n, noise_n_);
    raise(x.static_friction_max, m.static_friction_n, noise_n_);
    sim::Extremum least{-x.normal_force_min.value, x.normal_force_min.time_s};
    raise(least, -normal_force_n, noise_n_);
    x.normal_force_min = {-least.value, least.time_s};
    note_motors(t, y, m);
  }

  // A mass on a trajectory has none.
  [[nodiscard]] bool has_motor(std::size_t i) const { return scenario_.masses[i].trajectory.times_s.empty(); }

  // Needed torque at the shaft, rotor inertia included.
  std::array<double, sim::kMaxMasses> needed_torques(double t, const State& y, const Motion& m) const {
    std::array<double, sim::kMaxMasses> torque{};
    const sim::MassPoint masses = problem_.ode.masses(t);
    sim::generalised_forces(problem_.ode.body(), &y[RollingOde::kOmega], masses.position.data(), masses.velocity.data(),
                            masses.acceleration.data(), m, torque.data());
    for (std::size_t i = 0; i < steppers_.size(); ++i) {
      torque[i] = has_motor(i) ? torque[i] / scenario_.masses[i].motor.shaft_ratio : 0;
    }
    return torque;
  }

  void note_motors(double t, const State& y, const Motion& m) {
    if (steppers_.empty()) return;
    const sim::MassPoint masses = problem_.ode.masses(t);
    const auto torque = needed_torques(t, y, m);
    for (std::size_t i = 0; i < steppers_.size(); ++i) {
      if (!has_motor(i)) continue;
      const sim::Motor& motor = scenario_.masses[i].motor;
      const double speed = motor.shaft_ratio * masses.velocity[i];
      sim::MotorExtrema& x = out_.result.motor_extrema[i];
      x.max_torque_nm = std::max(x.max_torque_nm, std::abs(torque[i]));
      const double needed = std::abs(torque[i] + motor.viscous_damping_nms * speed);
      x.torque_margin = std::min(x.torque_margin, 1 - needed / steppers_[i].available_torque_nm(speed));
    }
  }

  void leave(double t, const State& y) {
    end(t, y);
    const Motion& m = now_;
    if (!std::isfinite(m.normal_force_n + m.static_friction_n)) {
      out_.result.end_reason = sil::EndReason::kInconsistent;
      out_.result.end_text = "the contact force stopped being finite";
    } else {
      out_.result.end_reason = m.normal_force_n > 0 ? sil::EndReason::kSlipped : sil::EndReason::kDetached;
      out_.result.rolling_lost = true;
    }
  }

  // The final sample.
  void end(double t, const State& y) {
    now_ = motion(t, y);
    out_.end_state = y;
    const sim::Body& body = problem_.ode.body();
    const sim::MassPoint masses = problem_.ode.masses(t);
    const auto torque = needed_torques(t, y, now_);
    sim::Plant::Sample s{};
    s.time_s = t;
    s.regime = sim::Regime::kRolling;
    s.orientation = Eigen::Vector4d(y[0], y[1], y[2], y[3]).normalized();
    s.angular_velocity_B_radps = {y[RollingOde::kOmega], y[RollingOde::kOmega + 1], y[RollingOde::kOmega + 2]};
    s.position_W_m = {y[RollingOde::kZ], y[RollingOde::kZ + 1], 0};
    s.velocity_W_mps = {now_.rolling_velocity_W_mps[0], now_.rolling_velocity_W_mps[1], 0};
    s.acceleration_B_mps2 = now_.acceleration_B_mps2;
    s.up_B = now_.up_B;
    s.normal_force_n = s.normal_force_min_n = sim::reported_normal_n(now_.normal_force_n);
    s.static_friction_n = now_.static_friction_n;
    s.mu_required_max = ratio(now_);
    s.friction_force_W_n = (now_.rotation_B_to_W * now_.contact_force_B_n).head<2>();
    s.center_of_mass_B_m = body.shell_mass_kg * body.center_of_mass_B_m;
    for (std::size_t i = 0; i < steppers_.size(); ++i) {
      s.mass_position[i] = masses.position[i];
      s.mass_velocity[i] = masses.velocity[i];
      s.mass_position_B_m[i] = body.path(i, masses.position[i]).position;
      s.center_of_mass_B_m += body.mass_kg[i] * s.mass_position_B_m[i];
      s.motor_torque_nm[i] = torque[i];
    }
    s.center_of_mass_B_m /= body.total_mass_kg;
    out_.result.final_sample = s;
  }

  const sim::Scenario& scenario_;
  int looks_;
  double mu_s_;
  RollingProblem problem_;
  std::unique_ptr<Method> method_;
  double noise_n_;
  std::vector<sim::Stepper> steppers_;
  Motion now_{};  // where the looking has come to
  RollingRun out_;
};

}  // namespace

std::string why_not_rolling(const sim::Scenario& scenario) {
  const auto& initial = scenario.initial;
  if (initial.height_m > 0) return "in the air (initial.height)";
  if (!initial.has_velocity) return "";
  const Eigen::Vector3d omega_W = initial.orientation * initial.angular_velocity_B_radps;
  const Eigen::Vector3d rolling_W = omega_W.cross(Eigen::Vector3d(0, 0, scenario.ball.radius_m));
  const Eigen::Vector3d slip_W = initial.velocity_W_mps - rolling_W;
  // The speed below which sim/plant/plant.cpp, too, takes a slip for rounding.
  if (slip_W.norm() <= 1e-12 * std::sqrt(scenario.gravity_mps2 * scenario.ball.radius_m)) return "";
  if (slip_W[2] > 0) return "leaving the ground (initial.velocity)";
  if (slip_W[2] < 0) return "landing (initial.velocity)";
  return "sliding (initial.velocity is not the rolling velocity)";
}

double fixed_step_for(const sim::Scenario& scenario, double tolerance) {
  return std::sqrt(scenario.ball.radius_m / scenario.gravity_mps2) * std::pow(tolerance, 0.25);
}

void RollingProblem::rhs(double t, const double* y, double* f) const {
  ode.derivative(t, y, f);
  if (constraint_ >= 0) f[constraint_] = y[0] * y[0] + y[1] * y[1] + y[2] * y[2] + y[3] * y[3] - 1;
}

void RollingProblem::jacobian(double t, const double* y, double* out) const {
  ode.jacobian(t, y, out);
  if (constraint_ < 0) return;
  for (std::size_t k = 0; k < size(); ++k) {
    out[static_cast<std::size_t>(constraint_) + size() * k] = k < 4 ? 2 * y[k] : 0;
  }
}

bool RollingProblem::choose_constraint(const double* y) {
  if (form_ == Form::kOde || (constraint_ >= 0 && std::abs(y[constraint_]) >= 0.4)) return false;
  constraint_ = 0;
  for (int j = 1; j < 4; ++j) {
    if (std::abs(y[j]) > std::abs(y[constraint_])) constraint_ = j;
  }
  return true;
}

RollingRun run_rolling(const sim::Scenario& scenario, const MethodInfo& method, const Settings& settings) {
  return Run(scenario, method, settings).run();
}

BareRun integrate_only(const sim::Scenario& scenario, const MethodInfo& info, const Settings& settings, double end_s) {
  BareRun out;
  const auto wall_start = Clock::now();
  RollingProblem problem(scenario, info.form);
  const auto method = info.make(problem, settings);
  drive(
      problem, *method, end_s, [] { return true; }, [] { return true; });
  out.wall_time_s = std::chrono::duration<double>(Clock::now() - wall_start).count();
  out.counters = method->counters();
  out.end_state = method->state();
  return out;
}

}  // namespace ballast::integrators
