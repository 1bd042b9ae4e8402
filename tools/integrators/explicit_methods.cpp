// Explicit Runge-Kutta methods: the classical one with fixed steps, and the two pairs of sim/.
#include <cmath>

#include "sim/integrators/dop853.h"
#include "sim/integrators/dormand_prince.h"
#include "tools/integrators/embedded_pair.h"
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

}  // namespace

std::unique_ptr<Method> make_rk4(Problem& problem, const Settings& settings) {
  return std::make_unique<Rk4>(problem, settings.fixed_step_s);
}
std::unique_ptr<Method> make_dopri5(Problem& problem, const Settings& settings) {
  return std::make_unique<EmbeddedPair<Problem, sim::DormandPrince<kMaxSize>, 6>>(problem, settings);
}
std::unique_ptr<Method> make_dop853(Problem& problem, const Settings& settings) {
  return std::make_unique<EmbeddedPair<Problem, sim::Dop853<kMaxSize>, 12>>(problem, settings);
}

}  // namespace ballast::integrators
