// DOP853 run as Hairer's own program runs it, for the benchmarks' yardstick (limit.h): the plant's step without its
// dense output, and the choice of steps and of the first one of dop853.f with its default settings; Hairer, Norsett,
// Wanner, "Solving Ordinary Differential Equations I", 2nd ed., sections II.4 and II.10.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "sim/integrators/dop853.h"

namespace ballast::benchmarks {

template <std::size_t kSize>
class Dop853 {
 public:
  using State = typename sim::Dop853<kSize>::State;

  // From y at t0 to t1 > t0 with local errors of about tolerance * (1 + |y|). rhs(t, y, dydt) must be smooth in
  // between. False if the steps become too small to go on; y is then where it got to.
  template <class Rhs>
  [[nodiscard]] bool integrate(Rhs&& rhs, double t0, double t1, double tolerance, State& y) {
    const auto counted = [&](double at, const double* state, double* dydt) {
      rhs(at, state, dydt);
      ++evaluations_;
    };
    double t = t0;
    State k1, y0;
    counted(t, y.data(), k1.data());
    double h = first_step(counted, t, t1 - t0, tolerance, y, k1);
    bool rejected = false;
    while (true) {
      if (0.1 * h <= t * kRounding) return false;
      const bool last = t + 1.01 * h >= t1;
      if (last) h = t1 - t;
      y0 = y;
      method_.step(counted, t, h, y0, k1, kSize);
      const double error = method_.error(tolerance);
      const double root = std::pow(error, 1. / 8) / kSafety;
      const double next = h / std::clamp(root, 1 / kMostGrowth, 1 / kLeastGrowth);
      if (error <= 1) {
        t += h;
        y = method_.end_state();
        if (last) return true;
        k1 = method_.end_derivative();
        h = rejected ? std::min(next, h) : next;
        rejected = false;
      } else {
        if (!(error < 1e300)) return false;
        h /= std::min(1 / kLeastGrowth, root);
        rejected = true;
      }
    }
  }

  [[nodiscard]] long right_hand_sides() const { return evaluations_; }

 private:
  static constexpr double kRounding = 2.3e-16, kSafety = 0.9, kLeastGrowth = 0.333, kMostGrowth = 6;  // Hairer's

  // Hairer's HINIT: a step for which one of Euler would err by a hundredth, with what it says of the second derivative.
  template <class Rhs>
  double first_step(Rhs&& rhs, double t, double longest, double tolerance, const State& y, const State& k1) {
    double slopes = 0, values = 0;
    for (std::size_t i = 0; i < kSize; ++i) {
      const double scale = tolerance * (1 + std::abs(y[i]));
      slopes += k1[i] / scale * (k1[i] / scale);
      values += y[i] / scale * (y[i] / scale);
    }
    const double h = std::min(longest, slopes <= 1e-10 || values <= 1e-10 ? 1e-6 : 0.01 * std::sqrt(values / slopes));
    State euler, k2;
    for (std::size_t i = 0; i < kSize; ++i) euler[i] = y[i] + h * k1[i];
    rhs(t + h, euler.data(), k2.data());
    double changes = 0;
    for (std::size_t i = 0; i < kSize; ++i) {
      const double change = (k2[i] - k1[i]) / (tolerance * (1 + std::abs(y[i])));
      changes += change * change;
    }
    const double second = std::max(std::sqrt(changes) / h, std::sqrt(slopes));
    const double h1 = second <= 1e-15 ? std::max(1e-6, h * 1e-3) : std::pow(0.01 / second, 1. / 8);
    return std::min({100 * h, h1, longest});
  }

  sim::Dop853<kSize> method_;
  long evaluations_ = 0;
};

}  // namespace ballast::benchmarks
