// Explicit Runge-Kutta methods: the classical one with fixed steps, and the two pairs of sim/ with error control as in
// Hairer's dopri5.f and dop853.f.
#include <cmath>

#include "sim/integrators/dop853.h"
#include "sim/integrators/dormand_prince.h"
#include "tools/integrators/methods.h"
#include "tools/integrators/step_control.h"

namespace ballast::integrators {

namespace {

class Rk4 : public Method {
 public:
  Rk4(Problem& problem, double step) : problem_(problem), steps_(step) {}

  void start(double t, const State& y) override {
    time_ = step_start_ = t;
    y_ = y;
    slope(t, y_, k_);
    ++counters_.right_hand_sides;
    steps_.start();
  }

  bool step(double stop) override {
    const auto [h, last] = steps_.next(time_, stop);
    step_start_ = time_;
    start_ = y_;
    start_k_ = k_;
    advance(h, y_);
    time_ = last ? stop : time_ + h;
    slope(time_, y_, k_);
    counters_.right_hand_sides += 4;
    ++counters_.steps;
    for (std::size_t i = 0; i < problem_.size(); ++i) {
      if (std::isfinite(y_[i])) continue;
      failure_ = "the state stopped being finite: the step is too long";
      return false;
    }
    return true;
  }

  void dense(double t, State& y) override {
    const double h = time_ - step_start_;
    hermite((t - step_start_) / h, h, start_, start_k_, y_, k_, problem_.size(), y);
  }
  void exact(double t, State& y) override { advance(t - step_start_, y); }

 private:
  void slope(double t, const State& y, State& k) const { problem_.rhs(t, y.data(), k.data()); }

  // From start_, where the slope is start_k_.
  void advance(double h, State& out) const {
    State at{}, k2{}, k3{}, k4{};
    const std::size_t n = problem_.size();
    for (std::size_t i = 0; i < n; ++i) at[i] = start_[i] + h / 2 * start_k_[i];
    slope(step_start_ + h / 2, at, k2);
    for (std::size_t i = 0; i < n; ++i) at[i] = start_[i] + h / 2 * k2[i];
    slope(step_start_ + h / 2, at, k3);
    for (std::size_t i = 0; i < n; ++i) at[i] = start_[i] + h * k3[i];
    slope(step_start_ + h, at, k4);
    for (std::size_t i = 0; i < n; ++i) out[i] = start_[i] + h / 6 * (start_k_[i] + 2 * (k2[i] + k3[i]) + k4[i]);
  }

  Problem& problem_;
  EvenSteps steps_;
  State k_{}, start_{}, start_k_{};
};

// kCalls: of the right-hand side in a step. The solution is of the order of the error estimate in h (dopri5: 4 + 1).
template <class Step, int kCalls>
class Pair : public Method {
 public:
  Pair(Problem& problem, const Settings& settings)
      : problem_(problem),
        tolerance_(settings.tolerance),
        fixed_(settings.fixed_step_s > 0),
        steps_(settings.fixed_step_s) {}

  void start(double t, const State& y) override {
    time_ = step_start_ = t;
    y_ = y;
    k_ = {};
    problem_.rhs(t, y_.data(), k_.data());
    steps_.start();
    h_ = first_step(rhs(), t, y_, k_, kOrder, tolerance_, problem_.size());
    counters_.right_hand_sides += 2;
  }

  bool step(double stop) override {
    step_start_ = time_;
    start_ = y_;
    start_k_ = k_;
    dense_ready_ = false;
    bool rejected = false;
    for (;;) {
      bool last = time_ + 1.01 * h_ >= stop;
      if (fixed_) {
        const auto next = steps_.next(time_, stop);
        h_ = next.h, last = next.last;
      } else if (last) {
        h_ = stop - time_;
      }
      step_.step(rhs(), time_, h_, start_, start_k_, problem_.size());
      counters_.right_hand_sides += kCalls;
      const double error = fixed_ ? 0 : step_.error(tolerance_);
      const double growth = error < 1e-8 ? kMost : 0.9 * std::pow(error, -1.0 / kOrder);
      if (error <= 1) {
        time_ = last ? stop : time_ + h_;
        y_ = step_.end_state();
        k_ = step_.end_derivative();
        h_ *= std::min(rejected ? 1.0 : kMost, std::max(kLeast, growth));
        ++counters_.steps;
        return true;
      }
      rejected = true;
      ++counters_.rejected;
      h_ *= growth > kLeast ? growth : kLeast;  // an error that is not a number: the step went where numbers end
      if (h_ < least_step(time_)) {
        failure_ = too_small(h_);
        return false;
      }
    }
  }

  void dense(double t, State& y) override {
    if constexpr (requires { step_.prepare_dense(rhs()); }) {
      if (!dense_ready_) step_.prepare_dense(rhs());
      dense_ready_ = true;
    }
    step_.interpolate((t - step_start_) / (time_ - step_start_), y);
  }

  void exact(double t, State& y) override {
    probe_.step(rhs(), step_start_, t - step_start_, start_, start_k_, problem_.size());
    y = probe_.end_state();
  }

 private:
  static constexpr int kOrder = Step::kErrorOrder;
  static constexpr double kMost = kOrder == 8 ? 6 : 10, kLeast = kOrder == 8 ? 0.333 : 0.2;

  auto rhs() const {
    return [this](double t, const double* y, double* f) { problem_.rhs(t, y, f); };
  }

  Problem& problem_;
  double tolerance_;
  bool fixed_;
  EvenSteps steps_;
  double h_ = 0;
  bool dense_ready_ = false;
  State k_{}, start_{}, start_k_{};
  Step step_, probe_;
};

}  // namespace

std::unique_ptr<Method> make_rk4(Problem& problem, const Settings& settings) {
  return std::make_unique<Rk4>(problem, settings.fixed_step_s);
}
std::unique_ptr<Method> make_dopri5(Problem& problem, const Settings& settings) {
  return std::make_unique<Pair<sim::DormandPrince<kMaxSize>, 6>>(problem, settings);
}
std::unique_ptr<Method> make_dop853(Problem& problem, const Settings& settings) {
  return std::make_unique<Pair<sim::Dop853<kMaxSize>, 12>>(problem, settings);
}

}  // namespace ballast::integrators
