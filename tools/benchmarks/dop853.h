// The explicit Runge-Kutta method of Dormand and Prince of order 8 with error estimates of orders 5 and 3, for the
// benchmarks' yardstick (limit.h). Not used by the plant.
//
// Coefficients, error estimate, choice of steps and first step are those of DOP853 by Hairer and Wanner (dop853.f with
// its default settings, no dense output); Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", 2nd
// ed., section II.10.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace ballast::benchmarks {

template <std::size_t kSize>
class Dop853 {
 public:
  using State = std::array<double, kSize>;

  // From y at t0 to t1 > t0 with local errors of about tolerance * (1 + |y|). rhs(t, y, dydt) must be smooth in
  // between. False if the steps become too small to go on; y is then where it got to.
  template <class Rhs>
  [[nodiscard]] bool integrate(Rhs&& rhs, double t0, double t1, double tolerance, State& y) {
    double t = t0;
    evaluate(rhs, t, y, k_[0]);
    double h = first_step(rhs, t, t1 - t0, tolerance, y);
    bool rejected = false;
    while (true) {
      if (0.1 * h <= t * kRounding) return false;
      const bool last = t + 1.01 * h >= t1;
      if (last) h = t1 - t;
      const double error = step(rhs, t, h, tolerance, y);
      const double root = std::pow(error, 1. / 8) / kSafety;
      const double next = h / std::clamp(root, 1 / kMostGrowth, 1 / kLeastGrowth);
      if (error <= 1) {
        t += h;
        y = y1_;
        if (last) return true;
        evaluate(rhs, t, y, k_[0]);
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

  template <class Rhs>
  void evaluate(Rhs&& rhs, double t, const State& y, State& dydt) {
    rhs(t, y.data(), dydt.data());
    ++evaluations_;
  }

  // The state at t + h into y1_; answers with the error estimate, in units of the tolerance.
  template <class Rhs>
  double step(Rhs&& rhs, double t, double h, double tolerance, const State& y) {
    const auto stage = [&](std::size_t target, double c, auto slope) {
      for (std::size_t i = 0; i < kSize; ++i) y1_[i] = y[i] + h * slope(i);
      evaluate(rhs, t + c * h, y1_, k_[target]);
    };
    stage(1, 0.526001519587677318785587544488e-01,
          [&](std::size_t i) { return 5.26001519587677318785587544488e-2 * k_[0][i]; });
    stage(2, 0.789002279381515978178381316732e-01, [&](std::size_t i) {
      return 1.97250569845378994544595329183e-2 * k_[0][i] + 5.91751709536136983633785987549e-2 * k_[1][i];
    });
    stage(3, 0.118350341907227396726757197510, [&](std::size_t i) {
      return 2.95875854768068491816892993775e-2 * k_[0][i] + 8.87627564304205475450678981324e-2 * k_[2][i];
    });
    stage(4, 0.281649658092772603273242802490, [&](std::size_t i) {
      return 2.41365134159266685502369798665e-1 * k_[0][i] - 8.84549479328286085344864962717e-1 * k_[2][i] +
             9.24834003261792003115737966543e-1 * k_[3][i];
    });
    stage(5, 1. / 3, [&](std::size_t i) {
      return 3.7037037037037037037037037037e-2 * k_[0][i] + 1.70828608729473871279604482173e-1 * k_[3][i] +
             1.25467687566822425016691814123e-1 * k_[4][i];
    });
    stage(6, 0.25, [&](std::size_t i) {
      return 3.7109375e-2 * k_[0][i] + 1.70252211019544039314978060272e-1 * k_[3][i] +
             6.02165389804559606850219397283e-2 * k_[4][i] - 1.7578125e-2 * k_[5][i];
    });
    stage(7, 4. / 13, [&](std::size_t i) {
      return 3.70920001185047927108779319836e-2 * k_[0][i] + 1.70383925712239993810214054705e-1 * k_[3][i] +
             1.07262030446373284651809199168e-1 * k_[4][i] - 1.53194377486244017527936158236e-2 * k_[5][i] +
             8.27378916381402288758473766002e-3 * k_[6][i];
    });
    stage(8, 0.651282051282051282051282051282, [&](std::size_t i) {
      return 6.24110958716075717114429577812e-1 * k_[0][i] - 3.36089262944694129406857109825 * k_[3][i] -
             8.68219346841726006818189891453e-1 * k_[4][i] + 2.75920996994467083049415600797e1 * k_[5][i] +
             2.01540675504778934086186788979e1 * k_[6][i] - 4.34898841810699588477366255144e1 * k_[7][i];
    });
    stage(9, 0.6, [&](std::size_t i) {
      return 4.77662536438264365890433908527e-1 * k_[0][i] - 2.48811461997166764192642586468 * k_[3][i] -
             5.90290826836842996371446475743e-1 * k_[4][i] + 2.12300514481811942347288949897e1 * k_[5][i] +
             1.52792336328824235832596922938e1 * k_[6][i] - 3.32882109689848629194453265587e1 * k_[7][i] -
             2.03312017085086261358222928593e-2 * k_[8][i];
    });
    stage(10, 6. / 7, [&](std::size_t i) {
      return -9.3714243008598732571704021658e-1 * k_[0][i] + 5.18637242884406370830023853209 * k_[3][i] +
             1.09143734899672957818500254654 * k_[4][i] - 8.14978701074692612513997267357 * k_[5][i] -
             1.85200656599969598641566180701e1 * k_[6][i] + 2.27394870993505042818970056734e1 * k_[7][i] +
             2.49360555267965238987089396762 * k_[8][i] - 3.0467644718982195003823669022 * k_[9][i];
    });
    stage(11, 1.0, [&](std::size_t i) {
      return 2.27331014751653820792359768449 * k_[0][i] - 1.05344954667372501984066689879e1 * k_[3][i] -
             2.00087205822486249909675718444 * k_[4][i] - 1.79589318631187989172765950534e1 * k_[5][i] +
             2.79488845294199600508499808837e1 * k_[6][i] - 2.85899827713502369474065508674 * k_[7][i] -
             8.87285693353062954433549289258 * k_[8][i] + 1.23605671757943030647266201528e1 * k_[9][i] +
             6.43392746015763530355970484046e-1 * k_[10][i];
    });
    double sum5 = 0, sum3 = 0;
    for (std::size_t i = 0; i < kSize; ++i) {
      const double slope =
          5.42937341165687622380535766363e-2 * k_[0][i] + 4.45031289275240888144113950566 * k_[5][i] +
          1.89151789931450038304281599044 * k_[6][i] - 5.8012039600105847814672114227 * k_[7][i] +
          3.1116436695781989440891606237e-1 * k_[8][i] - 1.52160949662516078556178806805e-1 * k_[9][i] +
          2.01365400804030348374776537501e-1 * k_[10][i] + 4.47106157277725905176885569043e-2 * k_[11][i];
      const double error5 = 0.1312004499419488073250102996e-1 * k_[0][i] - 0.1225156446376204440720569753e1 * k_[5][i] -
                            0.4957589496572501915214079952 * k_[6][i] + 0.1664377182454986536961530415e1 * k_[7][i] -
                            0.3503288487499736816886487290 * k_[8][i] + 0.3341791187130174790297318841 * k_[9][i] +
                            0.8192320648511571246570742613e-1 * k_[10][i] -
                            0.2235530786388629525884427845e-1 * k_[11][i];
      const double error3 = slope - 0.244094488188976377952755905512 * k_[0][i] -
                            0.733846688281611857341361741547 * k_[8][i] -
                            0.220588235294117647058823529412e-1 * k_[11][i];
      y1_[i] = y[i] + h * slope;
      const double inverse_scale = 1 / (tolerance * (1 + std::max(std::abs(y[i]), std::abs(y1_[i]))));
      sum5 += error5 * inverse_scale * error5 * inverse_scale;
      sum3 += error3 * inverse_scale * error3 * inverse_scale;
    }
    const double denominator = sum5 + 0.01 * sum3;
    return denominator > 0 ? h * sum5 / std::sqrt(static_cast<double>(kSize) * denominator) : 0;
  }

  // Hairer's HINIT: a step for which one of Euler would err by a hundredth, with what it says of the second derivative.
  template <class Rhs>
  double first_step(Rhs&& rhs, double t, double longest, double tolerance, const State& y) {
    double slopes = 0, values = 0;
    for (std::size_t i = 0; i < kSize; ++i) {
      const double scale = tolerance * (1 + std::abs(y[i]));
      slopes += k_[0][i] / scale * (k_[0][i] / scale);
      values += y[i] / scale * (y[i] / scale);
    }
    const double h = std::min(longest, slopes <= 1e-10 || values <= 1e-10 ? 1e-6 : 0.01 * std::sqrt(values / slopes));
    for (std::size_t i = 0; i < kSize; ++i) y1_[i] = y[i] + h * k_[0][i];
    evaluate(rhs, t + h, y1_, k_[1]);
    double changes = 0;
    for (std::size_t i = 0; i < kSize; ++i) {
      const double change = (k_[1][i] - k_[0][i]) / (tolerance * (1 + std::abs(y[i])));
      changes += change * change;
    }
    const double second = std::max(std::sqrt(changes) / h, std::sqrt(slopes));
    const double h1 = second <= 1e-15 ? std::max(1e-6, h * 1e-3) : std::pow(0.01 / second, 1. / 8);
    return std::min({100 * h, h1, longest});
  }

  std::array<State, 12> k_;
  State y1_;
  long evaluations_ = 0;
};

}  // namespace ballast::benchmarks
