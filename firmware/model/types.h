// Scalars and small fixed vectors of the firmware. Everything is sized at compile time.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>

namespace ballast::firmware {

// Real is the scalar of the model: rails, forces, attitude. BALLAST_REAL=float suits a processor whose FPU has single
// precision only; nothing else reads it.
//
// Wide is always double, for values that need more than 24 bits: times (a float of seconds is 2 us off after 20 s, and
// pulses are placed to 0.5 us), rail coordinates over a whole run, and microsteps counted from its start. All of
// motion/ is Wide, in software where the FPU has no double.
#ifndef BALLAST_REAL
#define BALLAST_REAL double
#endif
using Real = BALLAST_REAL;
using Wide = double;
using Vector2 = Eigen::Matrix<Real, 2, 1>;
using Vector3 = Eigen::Matrix<Real, 3, 1>;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;
using Quaternion = Eigen::Quaternion<Real>;

inline constexpr int kMaxMasses = 8;

template <class T>
using PerMass = std::array<T, kMaxMasses>;

}  // namespace ballast::firmware
