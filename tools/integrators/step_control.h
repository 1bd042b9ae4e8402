// Shared by the one-step methods: the first step's length, the cubic through a step's ends, and when to give up.
#pragma once

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include "tools/integrators/problem.h"

namespace ballast::integrators {

// Root mean square of v, each component measured against tolerance * (1 + |y|).
inline double scaled_norm(const State& v, const State& y, double tolerance, std::size_t size) {
  double sum = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const double part = v[i] / (tolerance * (1 + std::abs(y[i])));
    sum += part * part;
  }
  return std::sqrt(sum / static_cast<double>(size));
}

// Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", 2nd ed., section II.4, "starting step size". f0
// is the slope at (t, y); rhs is evaluated once.
template <class Rhs>
double first_step(Rhs&& rhs, double t, const State& y, const State& f0, int order, double tolerance, std::size_t size) {
  const double d0 = scaled_norm(y, y, tolerance, size), d1 = scaled_norm(f0, y, tolerance, size);
  const double h0 = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
  State y1{}, f1{}, change{};
  for (std::size_t i = 0; i < size; ++i) y1[i] = y[i] + h0 * f0[i];
  rhs(t + h0, y1.data(), f1.data());
  for (std::size_t i = 0; i < size; ++i) change[i] = f1[i] - f0[i];
  const double d2 = scaled_norm(change, y, tolerance, size) / h0;
  const double steepest = std::max(d1, d2);
  const double h1 = steepest <= 1e-15 ? std::max(1e-6, h0 * 1e-3) : std::pow(0.01 / steepest, 1.0 / (order + 1));
  return std::min(100 * h0, h1);
}

// The cubic with these values and slopes at both ends of a step h, at `part` of it.
inline void hermite(double part, double h, const State& y0, const State& f0, const State& y1, const State& f1,
                    std::size_t size, State& out) {
  const double u = part, v = 1 - part;
  for (std::size_t i = 0; i < size; ++i) {
    const double rise = y1[i] - y0[i];
    out[i] = v * y0[i] + u * y1[i] + u * v * (v * (h * f0[i] - rise) - u * (h * f1[i] - rise));
  }
}

// Steps of equal length between kinks, at most the one asked for.
class EvenSteps {
 public:
  explicit EvenSteps(double longest) : longest_(longest) {}

  void start() { left_ = 0; }

  // Length of the next step from t, `last` if it ends at `stop`.
  struct Next {
    double h = 0;
    bool last = false;
  };
  Next next(double t, double stop) {
    if (left_ == 0) {
      left_ = std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil((stop - t) / longest_ * (1 - 1e-12))));
      h_ = (stop - t) / static_cast<double>(left_);
    }
    --left_;
    return {left_ == 0 ? stop - t : h_, left_ == 0};
  }

 private:
  double longest_;
  double h_ = 0;
  std::int64_t left_ = 0;
};

// Below this a step changes nothing but the rounding of the time.
inline double least_step(double t) { return 1e-15 * std::max(1.0, std::abs(t)); }

inline std::string too_small(double h) {
  return fmt::format("no step is small enough to meet the tolerance (down to {:.1e})", h);
}

}  // namespace ballast::integrators
