#include "tools/integrators/rolling_run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "sim/integrators/step_search.h"
#include "sim/plant/progress.h"
#include "sim/plant/stepping.h"

namespace ballast::integrators {

using sim::Point;

namespace {

using Clock = std::chrono::steady_clock;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

constexpr const char* kNotFinite = "the contact force stopped being finite";

// More than any method takes at the tightest tolerance for a run of a day.
constexpr std::int64_t kMostSteps = 200'000'000;

double ratio(const sim::Instant& m) { return sim::mu_required(m.normal_force_n, m.static_friction_n); }

// Drives a method through the stretches between kinks up to end_s. Calls at_start() after each kink and after_step()
// after each step; false from either ends it. Returns the method's failure, or that the run was interrupted.
template <class AtStart, class AfterStep>
std::string drive(RollingProblem& problem, Method& method, const Settings& settings, double end_s, AtStart at_start,
                  AfterStep after_step) {
  double t = 0;
  State y = problem.ode.initial_state();
  for (;;) {
    problem.ode.begin(t);
    problem.choose_constraint(y.data());
    method.start(t, y);
    if (!at_start() || t >= end_s) return "";
    const double stop = std::min(end_s, problem.ode.end_s());
    while (method.time() < stop) {
      if (settings.interrupted != nullptr && *settings.interrupted != 0) return "interrupted";
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
      : looks_(info.looks),
        duration_s_(scenario.duration_s),
        problem_(scenario, info.form),
        settings_(settings),
        method_(info.make(problem_, settings)),
        progress_(scenario) {
    out_.result.regimes = {{sim::Regime::kRolling, 0}};
  }

  RollingRun run() {
    const auto wall_start = Clock::now();
    out_.failure = drive(
        problem_, *method_, settings_, duration_s_, [this] { return start(); }, [this] { return look_inside(); });
    out_.counters = method_->counters();
    sil::RunResult& result = out_.result;
    if (result.end_reason == sil::EndReason::kCompleted) {
      end(method_->time(), method_->state());
      const sim::Instant& m = now();
      if (!std::isfinite(m.normal_force_n + m.static_friction_n + m.angular_acceleration_B_radps2.sum())) {
        result.end_reason = sil::EndReason::kInconsistent;
        result.end_text = kNotFinite;
        out_.failure.clear();
      }
    }
    result.extrema = progress_.contact.extrema();
    for (std::size_t i = 0; i < equations().mass_count(); ++i) result.motor_extrema[i] = progress_.motors.extrema(i);
    result.wall_time_s = std::chrono::duration<double>(Clock::now() - wall_start).count();
    return out_;
  }

 private:
  [[nodiscard]] sim::Equations& equations() { return progress_.dynamics.equations; }
  [[nodiscard]] const sim::Equations& equations() const { return progress_.dynamics.equations; }
  [[nodiscard]] const sim::Instant& now() const { return progress_.dynamics.now.motion; }
  [[nodiscard]] bool violated(const Point& point) const { return equations().contact.over(point.motion); }

  [[nodiscard]] Point point(double t, const State& y) const {
    Point p{};
    std::copy(y.begin(), y.end(), p.y.begin());
    sim::Stepping::normalise(p.y);
    equations().derivative(t, p.y.data(), p.dydt.data(), p.motion);
    return p;
  }
  [[nodiscard]] Point dense_point(double t) const {
    State y{};
    method_->dense(t, y);
    return point(t, y);
  }
  [[nodiscard]] Point exact_point(double t) const {
    State y{};
    method_->exact(t, y);
    return point(t, y);
  }

  void move_to(double t, const Point& point) {
    progress_.dynamics.time_s = t;
    progress_.dynamics.now = point;
  }

  bool start() {
    equations().prescribed.enter_pieces(method_->time());
    const Point here = point(method_->time(), method_->state());
    move_to(method_->time(), here);
    progress_.record();
    if (!violated(here)) return true;
    leave(method_->time(), method_->state());
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
      if (!look(t, h, dense_point(t + h / 2), last ? point(end_s, end_state) : dense_point(end_s))) return false;
      if (last) travel(end_state);
    }
    return true;
  }

  // Looks into the part of the step from t, where the motion is now(), by h.
  bool look(double t, double h, const Point& middle, const Point& right) {
    double broken = violated(middle) ? 0.5 : violated(right) ? 1 : kInfinity;
    const auto search = [&](double limit, auto value) {
      const double part = peak(t, h, middle, right, limit, value);
      if (part < broken && violated(dense_point(t + part * h))) broken = part;
    };
    const double mu_s = equations().contact.static_friction;
    if (mu_s < kInfinity) search(mu_s, ratio);
    search(0, [](const sim::Instant& m) { return -m.normal_force_n; });

    // The interpolant suggests the end of rolling. The method itself confirms it and gives its time.
    if (broken <= 1 && violated(exact_point(t + broken * h))) {
      const double part = sim::first_broken(t, h, broken, [&](double p) { return violated(exact_point(t + p * h)); });
      const double end_s = t + part * h;
      State y{};
      method_->exact(end_s, y);
      const Point end = point(end_s, y);
      record_peaks(t, part * h, dense_point(t + part * h / 2), end);
      move_to(end_s, end);
      progress_.record();
      leave(end_s, y);
      return false;
    }

    record_peaks(t, h, middle, right);
    move_to(t + h / 2, middle);
    progress_.motors.record(progress_.dynamics);
    // Inside a step the interpolant is good enough to search by, and not to be recorded.
    move_to(t + h, right);
    if (t + h >= method_->time()) progress_.record();
    return true;
  }

  // The place of a peak above `floor` in the part of the step from t, where the motion is now(), by h. +infinity: none.
  template <class Value>
  [[nodiscard]] double peak(double t, double h, const Point& middle, const Point& right, double floor,
                            Value value) const {
    if (!sim::may_peak_above(value(now()), value(middle.motion), value(right.motion), floor)) return kInfinity;
    return sim::golden_section([&](double part) { return value(dense_point(t + part * h).motion); });
  }

  // Records extrema inside the part. Only a peak that may beat the best so far is worth finding.
  void record_peaks(double t, double h, const Point& middle, const Point& right) {
    const auto search = [&](double best, auto value) {
      const double part = peak(t, h, middle, right, best, value);
      if (!(part < 1)) return;
      const Point found = exact_point(t + part * h);
      progress_.contact.record(equations(), t + part * h, found.y, found.motion);
    };
    const sim::ContactExtrema& best = progress_.contact.extrema();
    search(best.normal_force_max.value, [](const sim::Instant& m) { return m.normal_force_n; });
    search(-best.normal_force_min.value, [](const sim::Instant& m) { return -m.normal_force_n; });
    search(best.static_friction_max.value, [](const sim::Instant& m) { return m.static_friction_n; });
    if (right.motion.normal_force_n > 0) search(best.mu_required_max.value, ratio);
  }

  void leave(double t, const State& y) {
    end(t, y);
    if (!std::isfinite(now().normal_force_n + now().static_friction_n)) {
      out_.result.end_reason = sil::EndReason::kInconsistent;
      out_.result.end_text = kNotFinite;
    } else {
      out_.result.end_reason = now().normal_force_n > 0 ? sil::EndReason::kSlipped : sil::EndReason::kDetached;
      out_.result.rolling_lost = true;
    }
  }

  void travel(const State& y) {
    const Eigen::Vector2d place_W_m(y[sim::RollingOde::kZ], y[sim::RollingOde::kZ + 1]);
    out_.result.distance_m += (place_W_m - place_W_m_).norm();
    place_W_m_ = place_W_m;
  }

  void end(double t, const State& y) {
    travel(y);
    move_to(t, point(t, y));
    progress_.contact.begin_tick(now().normal_force_n, ratio(now()));
    out_.end_state = y;
    out_.result.final_sample = progress_.sample();
  }

  int looks_;
  double duration_s_;
  RollingProblem problem_;
  Settings settings_;
  std::unique_ptr<Method> method_;
  sim::Progress progress_;                               // up to where the steps have been looked into
  Eigen::Vector2d place_W_m_ = Eigen::Vector2d::Zero();  // of the ball, at the last step
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
  if (slip_W.norm() <= sim::kSlipVanishes * std::sqrt(scenario.gravity_mps2 * scenario.ball.radius_m)) return "";
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
      problem, *method, settings, end_s, [] { return true; }, [] { return true; });
  out.wall_time_s = std::chrono::duration<double>(Clock::now() - wall_start).count();
  out.counters = method->counters();
  out.end_state = method->state();
  return out;
}

}  // namespace ballast::integrators
