// One step of the explicit Runge-Kutta method of order 8 by Dormand and Prince with Hairer's error estimate (orders 5
// and 3) and his dense output of order 7. Coefficients: E. Hairer and G. Wanner, dop853.f (version of April 25, 1996),
// whose subscripts are kept; described in Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", 2nd
// ed., sections II.5, II.6 and II.10.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace ballast::sim {

template <std::size_t kCapacity>
class Dop853 {
 public:
  using State = std::array<double, kCapacity>;
  static constexpr int kErrorOrder = 8;  // of error() in h

  // Steps from y0 at t0, where the derivative is k1, to t0 + h. rhs(t, y, dydt) is evaluated twelve times, last at the
  // new state, so that end_derivative() may serve as the next step's k1. Only the first `size` entries of a State are
  // used. `y0` and `k1` must not be this object's own end_state() and end_derivative(). `end_rhs`: evaluated instead at
  // the new state, if its caller wants more from there than the derivative.
  template <class Rhs>
  void step(Rhs&& rhs, double t0, double h, const State& y0, const State& k1, std::size_t size) {
    step(rhs, rhs, t0, h, y0, k1, size);
  }
  template <class Rhs, class EndRhs>
  void step(Rhs&& rhs, EndRhs&& end_rhs, double t0, double h, const State& y0, const State& k1, std::size_t size) {
    size_ = size;
    t0_ = t0;
    h_ = h;
    y0_ = &y0;
    k_[0] = k1;
    stage<1>(rhs, 2, .526001519587677318785587544488e-01, {5.26001519587677318785587544488e-2});
    stage<1, 2>(rhs, 3, .789002279381515978178381316732e-01,
                {1.97250569845378994544595329183e-2, 5.91751709536136983633785987549e-2});
    stage<1, 3>(rhs, 4, .118350341907227396726757197510,
                {2.95875854768068491816892993775e-2, 8.87627564304205475450678981324e-2});
    stage<1, 3, 4>(
        rhs, 5, .281649658092772603273242802490,
        {2.41365134159266685502369798665e-1, -8.84549479328286085344864962717e-1, 9.24834003261792003115737966543e-1});
    stage<1, 4, 5>(
        rhs, 6, .333333333333333333333333333333,
        {3.7037037037037037037037037037e-2, 1.70828608729473871279604482173e-1, 1.25467687566822425016691814123e-1});
    stage<1, 4, 5, 6>(
        rhs, 7, .25,
        {3.7109375e-2, 1.70252211019544039314978060272e-1, 6.02165389804559606850219397283e-2, -1.7578125e-2});
    stage<1, 4, 5, 6, 7>(
        rhs, 8, .307692307692307692307692307692,
        {3.70920001185047927108779319836e-2, 1.70383925712239993810214054705e-1, 1.07262030446373284651809199168e-1,
         -1.53194377486244017527936158236e-2, 8.27378916381402288758473766002e-3});
    stage<1, 4, 5, 6, 7, 8>(
        rhs, 9, .651282051282051282051282051282,
        {6.24110958716075717114429577812e-1, -3.36089262944694129406857109825, -8.68219346841726006818189891453e-1,
         2.75920996994467083049415600797e1, 2.01540675504778934086186788979e1, -4.34898841810699588477366255144e1});
    stage<1, 4, 5, 6, 7, 8, 9>(
        rhs, 10, .6,
        {4.77662536438264365890433908527e-1, -2.48811461997166764192642586468, -5.90290826836842996371446475743e-1,
         2.12300514481811942347288949897e1, 1.52792336328824235832596922938e1, -3.32882109689848629194453265587e1,
         -2.03312017085086261358222928593e-2});
    stage<1, 4, 5, 6, 7, 8, 9, 10>(
        rhs, 11, .857142857142857142857142857142,
        {-9.3714243008598732571704021658e-1, 5.18637242884406370830023853209, 1.09143734899672957818500254654,
         -8.14978701074692612513997267357, -1.85200656599969598641566180701e1, 2.27394870993505042818970056734e1,
         2.49360555267965238987089396762, -3.0467644718982195003823669022});
    stage<1, 4, 5, 6, 7, 8, 9, 10, 11>(
        rhs, 12, 1,
        {2.27331014751653820792359768449, -1.05344954667372501984066689879e1, -2.00087205822486249909675718444,
         -1.79589318631187989172765950534e1, 2.79488845294199600508499808837e1, -2.85899827713502369474065508674,
         -8.87285693353062954433549289258, 1.23605671757943030647266201528e1, 6.43392746015763530355970484046e-1});
    stage<1, 6, 7, 8, 9, 10, 11, 12>(end_rhs, 13, 1, kWeights);
    y1_ = at_;
  }

  [[nodiscard]] const State& end_state() const { return y1_; }
  [[nodiscard]] const State& end_derivative() const { return k_[12]; }

  [[nodiscard]] double length() const { return h_; }

  // Root mean square over the components of the error estimate, each relative to tolerance * unit. The order-5 estimate
  // is reduced by its ratio to the order-3 one, which makes the whole of order 7. NaN if a stage was NaN.
  [[nodiscard]] double error(double tolerance, const State& unit) const {
    double fifth = 0, third = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      const double scale = tolerance * unit[i];
      const double e5 =
          sum<1, 6, 7, 8, 9, 10, 11, 12>(
              i, {.1312004499419488073250102996e-1, -.1225156446376204440720569753e1, -.4957589496572501915214079952,
                  .1664377182454986536961530415e1, -.3503288487499736816886487290, .3341791187130174790297318841,
                  .8192320648511571246570742613e-1, -.2235530786388629525884427845e-1}) /
          scale;
      const double e3 = (sum<1, 6, 7, 8, 9, 10, 11, 12>(i, kWeights) -
                         sum<1, 9, 12>(i, {.244094488188976377952755905512, .733846688281611857341361741547,
                                           .220588235294117647058823529412e-1})) /
                        scale;
      fifth += e5 * e5;
      third += e3 * e3;
    }
    const double both = fifth + 0.01 * third;
    return both == 0 ? 0 : std::abs(h_) * fifth / std::sqrt(static_cast<double>(size_) * both);
  }
  // The same with a unit of 1 + |y|.
  [[nodiscard]] double error(double tolerance) const {
    State unit;
    for (std::size_t i = 0; i < size_; ++i) unit[i] = 1 + std::abs(y1_[i]);
    return error(tolerance, unit);
  }

  // To be called before interpolate(). Evaluates rhs three times more. The step's `y0` must still be alive.
  template <class Rhs>
  void prepare_dense(Rhs&& rhs) {
    stage<1, 7, 8, 9, 10, 11, 12, 13>(
        rhs, 14, .1,
        {5.61675022830479523392909219681e-2, 2.53500210216624811088794765333e-1, -2.46239037470802489917441475441e-1,
         -1.24191423263816360469010140626e-1, 1.5329179827876569731206322685e-1, 8.20105229563468988491666602057e-3,
         7.56789766054569976138603589584e-3, -8.298e-3});
    stage<1, 6, 7, 8, 11, 12, 13, 14>(
        rhs, 15, .2,
        {3.18346481635021405060768473261e-2, 2.83009096723667755288322961402e-2, 5.35419883074385676223797384372e-2,
         -5.49237485713909884646569340306e-2, -1.08347328697249322858509316994e-4, 3.82571090835658412954920192323e-4,
         -3.40465008687404560802977114492e-4, 1.41312443674632500278074618366e-1});
    stage<1, 6, 7, 8, 9, 13, 14, 15>(
        rhs, 16, .777777777777777777777777777778,
        {-4.28896301583791923408573538692e-1, -4.69762141536116384314449447206, 7.68342119606259904184240953878,
         4.06898981839711007970213554331, 3.56727187455281109270669543021e-1, -1.39902416515901462129418009734e-3,
         2.9475147891527723389556272149, -9.15095847217987001081870187138});
    for (std::size_t i = 0; i < size_; ++i) {
      const double difference = y1_[i] - (*y0_)[i];
      const double bend = h_ * k_[0][i] - difference;
      dense_[0][i] = (*y0_)[i];
      dense_[1][i] = difference;
      dense_[2][i] = bend;
      dense_[3][i] = difference - h_ * k_[12][i] - bend;
      dense_[4][i] = h_ * sum<1, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16>(
                              i, {-.84289382761090128651353491142e1, .56671495351937776962531783590,
                                  -.30689499459498916912797304727e1, .23846676565120698287728149680e1,
                                  .21170345824450282767155149946e1, -.87139158377797299206789907490,
                                  .22404374302607882758541771650e1, .63157877876946881815570249290,
                                  -.88990336451333310820698117400e-1, .18148505520854727256656404962e2,
                                  -.91946323924783554000451984436e1, -.44360363875948939664310572000e1});
      dense_[5][i] = h_ * sum<1, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16>(
                              i, {.10427508642579134603413151009e2, .24228349177525818288430175319e3,
                                  .16520045171727028198505394887e3, -.37454675472269020279518312152e3,
                                  -.22113666853125306036270938578e2, .77334326684722638389603898808e1,
                                  -.30674084731089398182061213626e2, -.93321305264302278729567221706e1,
                                  .15697238121770843886131091075e2, -.31139403219565177677282850411e2,
                                  -.93529243588444783865713862664e1, .35816841486394083752465898540e2});
      dense_[6][i] = h_ * sum<1, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16>(
                              i, {.19985053242002433820987653617e2, -.38703730874935176555105901742e3,
                                  -.18917813819516756882830838328e3, .52780815920542364900561016686e3,
                                  -.11573902539959630126141871134e2, .68812326946963000169666922661e1,
                                  -.10006050966910838403183860980e1, .77771377980534432092869265740,
                                  -.27782057523535084065932004339e1, -.60196695231264120758267380846e2,
                                  .84320405506677161018159903784e2, .11992291136182789328035130030e2});
      dense_[7][i] = h_ * sum<1, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16>(
                              i, {-.25693933462703749003312586129e2, -.15418974869023643374053993627e3,
                                  -.23152937917604549567536039109e3, .35763911791061412378285349910e3,
                                  .93405324183624310003907691704e2, -.37458323136451633156875139351e2,
                                  .10409964950896230045147246184e3, .29840293426660503123344363579e2,
                                  -.43533456590011143754432175058e2, .96324553959188282948394950600e2,
                                  -.39177261675615439165231486172e2, -.14972683625798562581422125276e3});
    }
  }

  // State at t0 + part * h, 0 <= part <= 1, to order 7.
  void interpolate(double part, State& y) const {
    const double u = part, v = 1 - part;
    for (std::size_t i = 0; i < size_; ++i) {
      const double upper = dense_[4][i] + u * (dense_[5][i] + v * (dense_[6][i] + u * dense_[7][i]));
      y[i] = dense_[0][i] + u * (dense_[1][i] + v * (dense_[2][i] + u * (dense_[3][i] + v * upper)));
    }
  }

 private:
  // b_1, b_6, ..., b_12.
  static constexpr double kWeights[8] = {5.42937341165687622380535766363e-2, 4.45031289275240888144113950566,
                                         1.89151789931450038304281599044,    -5.8012039600105847814672114227,
                                         3.1116436695781989440891606237e-1,  -1.52160949662516078556178806805e-1,
                                         2.01365400804030348374776537501e-1, 4.47106157277725905176885569043e-2};

  // Sum of weight * k over the stages named, counted from 1 as Hairer does.
  template <std::size_t... kStages>
  [[nodiscard, gnu::always_inline]] double sum(std::size_t i, const double (&weight)[sizeof...(kStages)]) const {
    constexpr std::size_t kFrom[] = {kStages...};
    double total = 0;
    for (std::size_t s = 0; s < sizeof...(kStages); ++s) total += weight[s] * k_[kFrom[s] - 1][i];
    return total;
  }

  template <std::size_t... kStages, class Rhs>
  [[gnu::always_inline]] void stage(Rhs&& rhs, std::size_t target, double c,
                                    const double (&weight)[sizeof...(kStages)]) {
    for (std::size_t i = 0; i < size_; ++i) at_[i] = (*y0_)[i] + h_ * sum<kStages...>(i, weight);
    rhs(t0_ + c * h_, at_.data(), k_[target - 1].data());
  }

  std::size_t size_ = 0;
  double t0_ = 0;
  double h_ = 0;
  const State* y0_ = nullptr;
  State at_{};  // where the latest stage was evaluated
  State y1_{};
  std::array<State, 16> k_{};
  std::array<State, 8> dense_{};
};

}  // namespace ballast::sim
