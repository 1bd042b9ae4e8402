// Covariance of the filter's errors: 11 estimated ones and 12 that are considered.
//
// Errors are truth minus estimate. `x`: attitude (3, space frame: tilt about e1 and e2, yaw about e3), bias of gyro (3)
// and accelerometer (3, both body frame), place (2, in the floor). `c`: scale errors and misalignments of the gyro (3 +
// 3) and of the accelerometer (3 + 3). They stay what they are for a whole run, so that no noise has their effect; the
// filter carries their correlation with x and never estimates them (Schmidt's consider filter). A filter that wanted to
// would be as large, and sure of what it is not.
//
// x xT is kept symmetric to the bit: corrections subtract K S K^T from one triangle and mirror it.
//
// Source: S. F. Schmidt, "Application of State-Space Methods to Navigation Problems" (1966); estimation.md.
#pragma once

#include "firmware/model/types.h"

namespace ballast::firmware::estimation {

inline constexpr std::size_t kAttitude = 0, kGyroBias = 3, kAccelerometerBias = 6, kPlace = 9, kErrors = 11;
inline constexpr std::size_t kGyroScale = 0, kGyroAxes = 3, kAccelerometerScale = 6, kAccelerometerAxes = 9,
                             kConsidered = 12;

using Errors = std::array<Real, kErrors>;
using Considered = std::array<Real, kConsidered>;

struct Covariance {
  std::array<Errors, kErrors> xx{};
  std::array<Considered, kErrors> xc{};
  Considered cc{};  // diagonal
};

// A scalar measurement: z = hx . x + hc . c + noise.
struct Measurement {
  Errors hx{};
  Considered hc{};
  Real innovation = 0;  // z of the estimate
  Real variance = 0;    // of the noise, >= 0
};

// Turn of the attitude and travel over some time, as they depend on the errors.
struct Transition {
  Matrix3 by_gyro_bias;   // integral of Lambda, s
  Matrix3 by_gyro_scale;  // integral of Lambda diag(Omega), 1
  Matrix3 by_gyro_axes;   // integral of Lambda Omega^ = Lambda at the end less that at the start
  Vector3 turn_W_rad;     // integral of omega
  Real radius_m;
  Real turn_variance;  // noise of the turn about each axis, rad^2; the place has its share
};

// x becomes that after the transition.
void advance(const Transition& transition, Covariance& covariance);

// Takes the measurement in; `errors` collects what is to be added to the estimate, and is what the measurement's
// innovation does not know of yet. Returns false, and changes nothing, where the innovation is more than `most_sigmas`
// off.
[[nodiscard]] bool correct(const Measurement& measurement, Real most_sigmas, Covariance& covariance, Errors& errors);

// After the estimated attitude has been turned by this, errors are about the new one: exp(x') = exp(x) exp(-turn), so
// that x' = x - turn + turn x x / 2. A tilt's correction makes yaw uncertain by half of itself times the tilt's band.
void turn_errors(const Vector3& turn_W_rad, Covariance& covariance);

// Keeps a variance at or below `most`; beyond it the error is as good as unknown and correlated with nothing.
void limit(std::size_t error, Real most, Covariance& covariance);

// Forgets what is known of an error.
void forget(std::size_t error, Real variance, Covariance& covariance);

}  // namespace ballast::firmware::estimation
