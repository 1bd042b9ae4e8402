#include "firmware/estimation/error_covariance.h"

namespace ballast::firmware::estimation {

namespace {

// Rows of the transition that are not the identity: attitude, then place.
constexpr std::size_t kTurned = 5;
constexpr std::array<std::size_t, kTurned> kTurnedRow{0, 1, 2, kPlace, kPlace + 1};

// A column or a row of what the transition adds to a covariance: its part of attitude and place, for given attitude,
// gyro bias, gyro scale and gyro axes.
struct Added {
  std::array<Real, kTurned> value;
};

[[gnu::always_inline]] inline Added added(const Transition& t, const Real* attitude, const Real* bias,
                                          const Real* scale, const Real* axes) {
  std::array<Real, 3> u;
  for (int j = 0; j < 3; ++j) {
    Real sum = 0;
    for (int k = 0; k < 3; ++k) {
      sum += t.by_gyro_axes(j, k) * axes[k] - t.by_gyro_bias(j, k) * bias[k] - t.by_gyro_scale(j, k) * scale[k];
    }
    u[static_cast<std::size_t>(j)] = sum;
  }
  // zdot = r (omega_2, -omega_1), and an error of the attitude turns omega with it: on average that of half-way.
  const Vector3& turn = t.turn_W_rad;
  const Real half_0 = attitude[0] + u[0] / 2, half_1 = attitude[1] + u[1] / 2, half_2 = attitude[2] + u[2] / 2;
  const Real turned_1 = half_1 * turn[2] - half_2 * turn[1] + u[0];
  const Real turned_2 = half_2 * turn[0] - half_0 * turn[2] + u[1];
  return {{u[0], u[1], u[2], t.radius_m * turned_2, -t.radius_m * turned_1}};
}

}  // namespace

void advance(const Transition& t, Covariance& covariance) {
  auto& [xx, xc, cc] = covariance;
  // F_x P + F_c C^T, then F_x C + F_c cc, then both times F^T from the right.
  for (std::size_t j = 0; j < kErrors; ++j) {
    const std::array<Real, 3> attitude{xx[0][j], xx[1][j], xx[2][j]}, bias{xx[3][j], xx[4][j], xx[5][j]};
    const Added add = added(t, attitude.data(), bias.data(), &xc[j][kGyroScale], &xc[j][kGyroAxes]);
    for (std::size_t i = 0; i < kTurned; ++i) xx[kTurnedRow[i]][j] += add.value[i];
  }
  for (std::size_t j = 0; j < kConsidered; ++j) {
    const std::array<Real, 3> attitude{xc[0][j], xc[1][j], xc[2][j]}, bias{xc[3][j], xc[4][j], xc[5][j]};
    std::array<Real, 6> own{};
    if (j < own.size()) own[j] = cc[j];
    const Added add = added(t, attitude.data(), bias.data(), own.data(), &own[3]);
    for (std::size_t i = 0; i < kTurned; ++i) xc[kTurnedRow[i]][j] += add.value[i];
  }
  for (std::size_t i = 0; i < kErrors; ++i) {
    const Added add = added(t, &xx[i][kAttitude], &xx[i][kGyroBias], &xc[i][kGyroScale], &xc[i][kGyroAxes]);
    for (std::size_t j = 0; j < kTurned; ++j) xx[i][kTurnedRow[j]] += add.value[j];
  }
  // The noise n of the turn: attitude n, place r (n_2, -n_1).
  const Real q = t.turn_variance, rq = t.radius_m * q, rrq = t.radius_m * rq;
  for (std::size_t j = 0; j < 3; ++j) xx[j][j] += q;
  xx[1][kPlace] += rq;
  xx[0][kPlace + 1] -= rq;
  xx[kPlace][kPlace] += rrq;
  xx[kPlace + 1][kPlace + 1] += rrq;
  for (std::size_t i = 1; i < kErrors; ++i) {
    for (std::size_t j = 0; j < i; ++j) xx[i][j] = xx[j][i];
  }
}

bool correct(const Measurement& m, Real most_sigmas, Covariance& covariance, Errors& errors) {
  auto& [xx, xc, cc] = covariance;
  // Covariance of x and of c with the innovation.
  Errors with_x{};
  Considered with_c;
  for (std::size_t j = 0; j < kConsidered; ++j) with_c[j] = cc[j] * m.hc[j];
  for (std::size_t i = 0; i < kErrors; ++i) {
    for (std::size_t j = 0; j < kConsidered; ++j) with_x[i] += xc[i][j] * m.hc[j];
    if (m.hx[i] == 0) continue;
    for (std::size_t j = 0; j < kConsidered; ++j) with_c[j] += m.hx[i] * xc[i][j];
  }
  for (std::size_t j = 0; j < kErrors; ++j) {
    if (m.hx[j] == 0) continue;
    for (std::size_t i = 0; i < kErrors; ++i) with_x[i] += xx[j][i] * m.hx[j];
  }
  Real s = m.variance, left = m.innovation;
  for (std::size_t i = 0; i < kErrors; ++i) {
    s += m.hx[i] * with_x[i];
    left -= m.hx[i] * errors[i];
  }
  for (std::size_t j = 0; j < kConsidered; ++j) s += m.hc[j] * with_c[j];
  if (!(left * left <= most_sigmas * most_sigmas * s)) return false;
  if (!(s > 0)) return true;

  const Real per_s = 1 / s;
  for (std::size_t i = 0; i < kErrors; ++i) {
    const Real gain = with_x[i] * per_s;
    errors[i] += gain * left;
    for (std::size_t j = 0; j <= i; ++j) xx[i][j] = xx[j][i] = xx[j][i] - gain * with_x[j];
    // Rounding of two nearly equal variances.
    if (xx[i][i] < 0) xx[i][i] = 0;
    for (std::size_t j = 0; j < kConsidered; ++j) xc[i][j] -= gain * with_c[j];
  }
  return true;
}

void turn_errors(const Vector3& turn_W_rad, Covariance& covariance) {
  auto& [xx, xc, cc] = covariance;
  // I + turn^ / 2 on the attitude's rows, then on its columns.
  const Vector3 half = turn_W_rad / 2;
  const auto turned = [&half](Real& a, Real& b, Real& c) {
    const Real x = a, y = b, z = c;
    a += half[1] * z - half[2] * y;
    b += half[2] * x - half[0] * z;
    c += half[0] * y - half[1] * x;
  };
  for (std::size_t j = 0; j < kErrors; ++j) turned(xx[0][j], xx[1][j], xx[2][j]);
  for (std::size_t j = 0; j < kConsidered; ++j) turned(xc[0][j], xc[1][j], xc[2][j]);
  for (std::size_t i = 0; i < kErrors; ++i) turned(xx[i][0], xx[i][1], xx[i][2]);
  for (std::size_t i = 1; i < kErrors; ++i) {
    for (std::size_t j = 0; j < 3 && j < i; ++j) xx[i][j] = xx[j][i];
  }
}

void limit(std::size_t error, Real most, Covariance& covariance) {
  if (!(covariance.xx[error][error] <= most)) forget(error, most, covariance);
}

void forget(std::size_t error, Real variance, Covariance& covariance) {
  for (std::size_t j = 0; j < kErrors; ++j) covariance.xx[error][j] = covariance.xx[j][error] = 0;
  covariance.xc[error].fill(0);
  covariance.xx[error][error] = variance;
}

}  // namespace ballast::firmware::estimation
