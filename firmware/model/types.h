// Scalars and small fixed vectors of the firmware. Everything is sized at compile time.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>

namespace ballast::firmware {

using Real = double;
using Vector2 = Eigen::Matrix<Real, 2, 1>;
using Vector3 = Eigen::Matrix<Real, 3, 1>;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;
using Quaternion = Eigen::Quaternion<Real>;

inline constexpr int kMaxMasses = 8;

template <class T>
using PerMass = std::array<T, kMaxMasses>;

}  // namespace ballast::firmware
