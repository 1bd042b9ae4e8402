// An embedded pair of explicit Runge-Kutta methods with the error control of Hairer's dopri5.f and dop853.f.
#pragma once

#include <algorithm>
#include <cmath>

#include "tools/integrators/methods.h"
#include "tools/integrators/step_control.h"

namespace ballast::integrators {

// `Step` makes one step with kCalls calls of the right-hand side. `System` has size() and rhs(t, y, f), as a Problem
// does. The local error is O(h^kOrder).
template <class System, class Step, int kCalls>
class EmbeddedPair final : public Method {
 public:
  EmbeddedPair(const System& problem, const Settings& settings)
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
        h_ = next.h;
        last = next.last;
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
      h_ *= growth > kLeast ? growth : kLeast;  // an error that is NaN shortens the step too
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
  static constexpr int kOrder = Step::kErrorOrder;  // dopri5: 4 + 1
  static constexpr double kMost = kOrder == 8 ? 6 : 10, kLeast = kOrder == 8 ? 0.333 : 0.2;

  auto rhs() const {
    return [this](double t, const double* y, double* f) { problem_.rhs(t, y, f); };
  }

  const System& problem_;
  double tolerance_;
  bool fixed_;
  EvenSteps steps_;
  double h_ = 0;
  bool dense_ready_ = false;
  State k_{}, start_{}, start_k_{};
  Step step_, probe_;
};

}  // namespace ballast::integrators
