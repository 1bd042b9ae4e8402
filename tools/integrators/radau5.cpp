// Radau IIA of order 5, three stages, for M y' = f(t, y): own code after E. Hairer and G. Wanner, "Solving Ordinary
// Differential Equations II", 2nd ed., section IV.8, and their radau5.f (version of 1996), whose constants, transformed
// simplified Newton iteration (one real and one complex system of size n instead of one of 3 n), error estimate with
// gamma_0, predictive step control and tolerance transformation are kept. The dense output is the collocation
// polynomial, of order 3; exact() goes by a step of its own.
//
// With a 0 on M's diagonal nothing changes but that: the method is stiffly accurate, so that a constraint of index 1
// holds at the end of each step to the tolerance of Newton's iteration.
#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <limits>

#include "tools/integrators/methods.h"
#include "tools/integrators/step_control.h"

namespace ballast::integrators {

namespace {

using Complex = std::complex<double>;
template <class T>
using Vector = Eigen::Matrix<T, Eigen::Dynamic, 1, 0, static_cast<int>(kMaxSize), 1>;
template <class T>
using Matrix =
    Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, 0, static_cast<int>(kMaxSize), static_cast<int>(kMaxSize)>;
using Real = Vector<double>;

const double kRoot6 = std::sqrt(6.0);
const double kC1 = (4 - kRoot6) / 10, kC2 = (4 + kRoot6) / 10;

// The eigenvalues of A^-1, gamma and alpha + i beta: radau5.f's U1, ALPH, BETA.
const double kThird3 = std::cbrt(3.0), kThird9 = std::cbrt(9.0);
const double kGamma = 3 + kThird9 - kThird3;
const Complex kAlphaBeta(3 + (kThird3 - kThird9) / 2, std::sqrt(3.0) * (kThird3 + kThird9) / 2);

// T and T^-1 of A^-1 = T diag T^-1: radau5.f's T and TI.
constexpr double kT[3][3] = {{9.1232394870892942792e-2, -0.14125529502095420843, -3.0029194105147424492e-2},
                             {0.24171793270710701896, 0.20412935229379993199, 0.38294211275726193779},
                             {0.96604818261509293619, 1, 0}};
constexpr double kTi[3][3] = {{4.3255798900631553510, 0.33919925181580986954, 0.54177053993587487119},
                              {-4.1787185915519047273, -0.32768282076106238708, 0.47662355450055045196},
                              {-0.50287263494578687595, 2.5719269498556054292, -0.59603920482822492497}};

// Coefficients of the error estimate: radau5.f's DD1, DD2, DD3.
const double kError[3] = {-(13 + 7 * kRoot6) / 3, (-13 + 7 * kRoot6) / 3, -1.0 / 3};

constexpr double kSafety = 0.9;
constexpr double kSlowNewton = 1e-3;  // a convergence rate above it asks for a new Jacobian
constexpr double kRounding = std::numeric_limits<double>::epsilon();

// The stages' distances from the step's start, z_i = Y_i - y0.
struct Stages {
  Real z[3];
};

class Radau5 : public Method {
 public:
  Radau5(Problem& problem, const Settings& settings)
      : problem_(problem),
        n_(static_cast<Eigen::Index>(problem.size())),
        fixed_(settings.fixed_step_s > 0),
        steps_(settings.fixed_step_s),
        newton_most_(fixed_ ? 50 : 7),
        tolerance_(0.1 * std::pow(settings.tolerance, 2.0 / 3)),
        newton_tolerance_(std::max(10 * kRounding / tolerance_, std::min(0.03, std::sqrt(tolerance_)))) {}

  void start(double t, const State& y) override {
    time_ = step_start_ = t;
    y_ = y;
    State slope{};
    problem_.slope(t, y.data(), slope.data());
    h_ = first_step([this](double at, const double* v, double* f) { problem_.slope(at, v, f); }, t, y, slope, 3,
                    tolerance_, problem_.size());
    f_.resize(n_);
    problem_.rhs(t, y_.data(), f_.data());
    counters_.right_hand_sides += 3;
    mass_ = Real::Ones(n_);
    if (problem_.constraint() >= 0) mass_[problem_.constraint()] = 0;
    steps_.start();
    first_ = true;
    jacobian_here_ = decomposed_ = false;
    jacobian_wanted_ = true;
    faccon_ = 1;
  }

  bool step(double stop) override {
    bool rejected = false;
    step_start_ = time_;
    start_ = y_;
    start_f_ = f_;
    const EvenSteps::Next even = fixed_ ? steps_.next(time_, stop) : EvenSteps::Next{};
    for (;;) {
      if (h_ < least_step(time_)) {
        failure_ = too_small(h_);
        return false;
      }
      bool last = time_ + h_ * 1.0001 >= stop;
      double h = last ? stop - time_ : h_;
      if (fixed_) {
        h = even.h;
        last = even.last;
      }
      decomposed_ = decomposed_ && h == h_;
      h_ = h;
      if (jacobian_wanted_ && !jacobian_here_) {
        jacobian_.resize(n_, n_);
        problem_.jacobian(time_, y_.data(), jacobian_.data());
        ++counters_.jacobians;
        jacobian_here_ = true;
        decomposed_ = false;
      }
      if (!decomposed_) decompose(h_, e1_, e2_);
      decomposed_ = true;

      Stages stages = first_ ? at_rest() : extrapolated(h_);
      Newton newton = iterate(h_, e1_, e2_, stages, faccon_);
      if (!newton.converged && fixed_ && jacobian_here_) {
        failure_ = "Newton's iteration does not converge: the fixed step is too long";
        return false;
      }
      if (!newton.converged) {
        h_ *= newton.shrink;
        reject(rejected);
        continue;
      }
      const double error = fixed_ ? 0 : estimate(stages, first_ || rejected);
      // Fewer iterations allow a bolder step.
      const double factor =
          std::min(kSafety, kSafety * (1 + 2 * newton_most_) / (newton.iterations + 2 * newton_most_));
      double quotient = std::clamp(std::pow(error, 0.25) / factor, 1.0 / 8, 5.0);
      if (!(error < 1)) {
        h_ = first_ ? 0.1 * h_ : error < std::numeric_limits<double>::infinity() ? h_ / quotient : 0.2 * h_;
        reject(rejected);
        continue;
      }

      if (!first_) {  // Gustafsson's predictive controller
        const double predicted = last_h_ / h_ * std::pow(error * error / last_error_, 0.25) / kSafety;
        quotient = std::max(quotient, std::clamp(predicted, 1.0 / 8, 5.0));
      }
      last_error_ = std::max(1e-2, error);
      last_h_ = h_;
      first_ = false;
      keep_polynomial(stages);
      for (Eigen::Index i = 0; i < n_; ++i) y_[static_cast<std::size_t>(i)] += stages.z[2][i];
      time_ = last ? stop : time_ + h_;
      problem_.rhs(time_, y_.data(), f_.data());
      ++counters_.right_hand_sides;
      ++counters_.steps;
      double next = h_ / quotient;
      if (rejected) next = std::min(next, h_);
      jacobian_here_ = false;
      jacobian_wanted_ = newton.rate > kSlowNewton;
      // The factors serve again if the step hardly changes.
      if (jacobian_wanted_ || next < h_ || next > 1.2 * h_) {
        decomposed_ = false;
        h_ = next;
      }
      return true;
    }
  }

  void dense(double t, State& y) override {
    const double s = (t - time_) / (time_ - step_start_);  // from -1 to 0
    for (Eigen::Index i = 0; i < n_; ++i) y[static_cast<std::size_t>(i)] = y_[static_cast<std::size_t>(i)] + rise(s, i);
  }

  void exact(double t, State& y) override {
    dense(t, y);
    const double h = t - step_start_;
    if (h <= 0 || t >= time_) return;
    const Counters before = counters_;
    Stages stages;
    for (int k = 0; k < 3; ++k) {
      const double c = k == 0 ? kC1 : k == 1 ? kC2 : 1;
      State at{};
      dense(step_start_ + c * h, at);
      stages.z[k].resize(n_);
      for (Eigen::Index i = 0; i < n_; ++i)
        stages.z[k][i] = at[static_cast<std::size_t>(i)] - start_[static_cast<std::size_t>(i)];
    }
    Eigen::PartialPivLU<Matrix<double>> e1;
    Eigen::PartialPivLU<Matrix<Complex>> e2;
    decompose(h, e1, e2);
    double faccon = 1;
    const Newton newton = iterate(h, e1, e2, stages, faccon);
    for (Eigen::Index i = 0; newton.converged && i < n_; ++i)
      y[static_cast<std::size_t>(i)] = start_[static_cast<std::size_t>(i)] + stages.z[2][i];
    counters_ = before;
  }

 private:
  struct Newton {
    bool converged;
    int iterations;
    double rate;    // theta
    double shrink;  // of the step, if it has not converged
  };

  // Measured where the step begins: start_ is y0.
  [[nodiscard]] double norm(const Real& v) const {
    double sum = 0;
    for (Eigen::Index i = 0; i < n_; ++i) {
      const double part = v[i] / scale(i);
      sum += part * part;
    }
    return sum;
  }
  [[nodiscard]] double scale(Eigen::Index i) const {
    return tolerance_ * (1 + std::abs(start_[static_cast<std::size_t>(i)]));
  }

  void decompose(double h, Eigen::PartialPivLU<Matrix<double>>& e1, Eigen::PartialPivLU<Matrix<Complex>>& e2) const {
    Matrix<double> real = -jacobian_;
    Matrix<Complex> complex = -jacobian_.cast<Complex>();
    for (Eigen::Index i = 0; i < n_; ++i) {
      real(i, i) += kGamma / h * mass_[i];
      complex(i, i) += kAlphaBeta / h * mass_[i];
    }
    e1.compute(real);
    e2.compute(complex);
  }

  [[nodiscard]] Stages at_rest() const {
    Stages stages;
    for (Real& z : stages.z) z = Real::Zero(n_);
    return stages;
  }

  // The last step's polynomial, continued.
  [[nodiscard]] Stages extrapolated(double h) const {
    Stages stages = at_rest();
    for (int k = 0; k < 3; ++k) {
      const double s = (k == 0 ? kC1 : k == 1 ? kC2 : 1) * h / last_h_;
      for (Eigen::Index i = 0; i < n_; ++i) stages.z[k][i] = rise(s, i);
    }
    return stages;
  }

  // The polynomial minus its value at the end of the step it was taken from, s steps after that: radau5.f's CONTR5.
  [[nodiscard]] double rise(double s, Eigen::Index i) const {
    return s * (poly_[0][i] + (s - (kC2 - 1)) * (poly_[1][i] + (s - (kC1 - 1)) * poly_[2][i]));
  }
  void keep_polynomial(const Stages& stages) {
    poly_[0] = (stages.z[1] - stages.z[2]) / (kC2 - 1);
    const Real slope = (stages.z[0] - stages.z[1]) / (kC1 - kC2);
    const Real bend = (slope - stages.z[0] / kC1) / kC2;
    poly_[1] = (slope - poly_[0]) / (kC1 - 1);
    poly_[2] = poly_[1] - bend;
  }

  // From start_ by h.
  Newton iterate(double h, const Eigen::PartialPivLU<Matrix<double>>& e1,
                 const Eigen::PartialPivLU<Matrix<Complex>>& e2, Stages& stages, double& faccon) {
    Real w[3];  // the stages in the basis in which A is diagonal
    for (int k = 0; k < 3; ++k) w[k] = kTi[k][0] * stages.z[0] + kTi[k][1] * stages.z[1] + kTi[k][2] * stages.z[2];
    faccon = std::pow(std::max(faccon, kRounding), 0.8);
    double rate = kSlowNewton, last_size = 0, last_quotient = 0;
    for (int iteration = 1;; ++iteration) {
      Real f[3];
      for (int k = 0; k < 3; ++k) {
        State at = start_;
        for (Eigen::Index i = 0; i < n_; ++i) at[static_cast<std::size_t>(i)] += stages.z[k][i];
        f[k].resize(n_);
        problem_.rhs(step_start_ + (k == 0 ? kC1 : k == 1 ? kC2 : 1) * h, at.data(), f[k].data());
      }
      counters_.right_hand_sides += 3;
      Real residual[3];
      for (int k = 0; k < 3; ++k) residual[k] = kTi[k][0] * f[0] + kTi[k][1] * f[1] + kTi[k][2] * f[2];
      const Real real_change = e1.solve((residual[0] - kGamma / h * mass_.cwiseProduct(w[0])).eval());
      Vector<Complex> complex_residual(n_);
      for (Eigen::Index i = 0; i < n_; ++i) {
        complex_residual[i] =
            Complex(residual[1][i], residual[2][i]) - kAlphaBeta / h * mass_[i] * Complex(w[1][i], w[2][i]);
      }
      const Vector<Complex> complex_change = e2.solve(complex_residual);
      const Real change[3] = {real_change, complex_change.real(), complex_change.imag()};
      const double size =
          std::sqrt((norm(change[0]) + norm(change[1]) + norm(change[2])) / (3 * static_cast<double>(n_)));
      if (!std::isfinite(size)) return {false, iteration, 1, 0.5};

      if (iteration > 1 && iteration < newton_most_) {
        const double quotient = size / last_size;
        rate = iteration == 2 ? quotient : std::sqrt(quotient * last_quotient);
        last_quotient = quotient;
        if (rate >= 0.99) return {false, iteration, rate, 0.5};
        faccon = rate / (1 - rate);
        const int left = newton_most_ - 1 - iteration;
        const double at_the_end = faccon * size * std::pow(rate, left) / newton_tolerance_;
        if (at_the_end >= 1) {
          return {false, iteration, rate, 0.8 * std::pow(std::clamp(at_the_end, 1e-4, 20.0), -1.0 / (4 + left))};
        }
      }
      last_size = std::max(size, kRounding);
      for (int k = 0; k < 3; ++k) w[k] += change[k];
      for (int k = 0; k < 3; ++k) stages.z[k] = kT[k][0] * w[0] + kT[k][1] * w[1] + kT[k][2] * w[2];
      if (faccon * size <= newton_tolerance_) return {true, iteration, rate, 1};
      if (iteration == newton_most_) return {false, iteration, rate, 0.5};
    }
  }

  // radau5.f's ESTRAD. `careful`: after a rejection and at the start the estimate is filtered once more.
  double estimate(const Stages& stages, bool careful) {
    const Real change = (kError[0] * stages.z[0] + kError[1] * stages.z[1] + kError[2] * stages.z[2]) / h_;
    const Real weighted = mass_.cwiseProduct(change);
    Real error = e1_.solve((weighted + start_f_).eval());
    const auto measure = [&] { return std::max(std::sqrt(norm(error) / static_cast<double>(n_)), 1e-10); };
    double size = measure();
    if (size >= 1 && careful) {
      State at = start_;
      for (Eigen::Index i = 0; i < n_; ++i) at[static_cast<std::size_t>(i)] += error[i];
      Real f(n_);
      problem_.rhs(step_start_, at.data(), f.data());
      ++counters_.right_hand_sides;
      error = e1_.solve((f + weighted).eval());
      size = measure();
    }
    return size;
  }

  void reject(bool& rejected) {
    rejected = true;
    ++counters_.rejected;
    decomposed_ = false;
    jacobian_wanted_ = true;
  }

  Problem& problem_;
  Eigen::Index n_;
  bool fixed_;
  EvenSteps steps_;
  int newton_most_;          // iterations; a fixed step cannot be shortened instead
  double tolerance_;         // of the error estimate, which is of order 3 where the method is of order 5
  double newton_tolerance_;  // relative to that
  double h_ = 0, last_h_ = 1, last_error_ = 1;
  double faccon_ = 1;  // how much of Newton's last change is left after it
  bool first_ = true, jacobian_here_ = false, jacobian_wanted_ = true, decomposed_ = false;
  State start_{};
  Real f_, start_f_, mass_;  // mass_: M's diagonal
  Real poly_[3];
  Matrix<double> jacobian_;
  Eigen::PartialPivLU<Matrix<double>> e1_;
  Eigen::PartialPivLU<Matrix<Complex>> e2_;
};

}  // namespace

std::unique_ptr<Method> make_radau5(Problem& problem, const Settings& settings) {
  return std::make_unique<Radau5>(problem, settings);
}

}  // namespace ballast::integrators
