// One step of the explicit Runge-Kutta pair of Dormand and Prince, order 5 with an embedded order 4, and its dense
// output. Tableau: Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", 2nd ed., table 5.2 (p. 178);
// dense output: (6.13).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace ballast::sim {

template <std::size_t kCapacity>
class DormandPrince {
 public:
  using State = std::array<double, kCapacity>;
  static constexpr int kErrorOrder = 5;  // of error() in h

  // Steps from y0 at t0, where the derivative is k1, to t0 + h. rhs(t, y, dydt) is evaluated six times, last at the new
  // state, so that end_derivative() may serve as the next step's k1. Only the first `size` entries of a State are used.
  // `y0` and `k1` must not be this object's own end_state() and end_derivative(). `end_rhs`: evaluated instead at the
  // new state, if its caller wants more from there than the derivative.
  template <class Rhs>
  void step(Rhs&& rhs, double t0, double h, const State& y0, const State& k1, std::size_t size) {
    step(rhs, rhs, t0, h, y0, k1, size);
  }
  template <class Rhs, class EndRhs>
  void step(Rhs&& rhs, EndRhs&& end_rhs, double t0, double h, const State& y0, const State& k1, std::size_t size) {
    size_ = size;
    h_ = h;
    y0_ = &y0;
    k_[0] = k1;
    const auto stage = [&](auto& f, std::size_t target, double c, auto... a) {
      const std::array<double, sizeof...(a)> weight{a...};
      for (std::size_t i = 0; i < size; ++i) {
        double sum = 0;
        for (std::size_t s = 0; s < sizeof...(a); ++s) sum += weight[s] * k_[s][i];
        y1_[i] = y0[i] + h * sum;
      }
      f(t0 + c * h, y1_.data(), k_[target].data());
    };
    stage(rhs, 1, 1. / 5, 1. / 5);
    stage(rhs, 2, 3. / 10, 3. / 40, 9. / 40);
    stage(rhs, 3, 4. / 5, 44. / 45, -56. / 15, 32. / 9);
    stage(rhs, 4, 8. / 9, 19372. / 6561, -25360. / 2187, 64448. / 6561, -212. / 729);
    stage(rhs, 5, 1., 9017. / 3168, -355. / 33, 46732. / 5247, 49. / 176, -5103. / 18656);
    stage(end_rhs, 6, 1., 35. / 384, 0., 500. / 1113, 125. / 192, -2187. / 6784, 11. / 84);
  }

  [[nodiscard]] double length() const { return h_; }
  [[nodiscard]] const State& end_state() const { return y1_; }
  [[nodiscard]] const State& end_derivative() const { return k_[6]; }

  // Largest component of the embedded error estimate, each relative to tolerance * (unit + |y|). NaN if a stage was
  // NaN.
  [[nodiscard]] double error(double tolerance, const State& scale) const {
    double worst = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      const double e = h_ * (71. / 57600 * k_[0][i] - 71. / 16695 * k_[2][i] + 71. / 1920 * k_[3][i] -
                             17253. / 339200 * k_[4][i] + 22. / 525 * k_[5][i] - 1. / 40 * k_[6][i]);
      const double scaled = std::abs(e) / (tolerance * scale[i]);
      if (!(scaled <= worst)) worst = scaled;
    }
    return worst;
  }
  // The same with a scale of 1 + |y|.
  [[nodiscard]] double error(double tolerance) const {
    State scale;
    for (std::size_t i = 0; i < size_; ++i) scale[i] = 1 + std::abs(y1_[i]);
    return error(tolerance, scale);
  }

  // State at t0 + part * h, 0 <= part <= 1, to order 4. The step's `y0` must still be alive.
  void interpolate(double part, State& y) const {
    const double u = part;
    const double u2 = u * u, v = u * (u - 1), v2 = v * v;
    const double b1 =
        u2 * (3 - 2 * u) * (35. / 384) + u * (u - 1) * (u - 1) - v2 * 5 * (2558722523. - 31403016 * u) / 11282082432.;
    const double b3 = u2 * (3 - 2 * u) * (500. / 1113) + v2 * 100 * (882725551. - 15701508 * u) / 32700410799.;
    const double b4 = u2 * (3 - 2 * u) * (125. / 192) - v2 * 25 * (443332067. - 31403016 * u) / 1880347072.;
    const double b5 = u2 * (3 - 2 * u) * (-2187. / 6784) + v2 * 32805 * (23143187. - 3489224 * u) / 199316789632.;
    const double b6 = u2 * (3 - 2 * u) * (11. / 84) - v2 * 55 * (29972135. - 7076736 * u) / 822651844.;
    const double b7 = u2 * (u - 1) + v2 * 10 * (7414447. - 829305 * u) / 29380423.;
    for (std::size_t i = 0; i < size_; ++i) {
      y[i] = (*y0_)[i] +
             h_ * (b1 * k_[0][i] + b3 * k_[2][i] + b4 * k_[3][i] + b5 * k_[4][i] + b6 * k_[5][i] + b7 * k_[6][i]);
    }
  }

 private:
  std::size_t size_ = 0;
  double h_ = 0;
  const State* y0_ = nullptr;
  State y1_{};
  std::array<State, 7> k_{};
};

}  // namespace ballast::sim
