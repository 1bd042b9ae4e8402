// Three components of any scalar, for the equations of motion: real, or complex for derivatives by complex step, where
// a product must never conjugate. They are plain scalars, because a matrix library's temporaries would double the cost.
#pragma once

#include <Eigen/Core>

namespace ballast::sim {

template <class T>
struct Vec3 {
  T x, y, z;
};

[[gnu::always_inline]] inline Vec3<double> vec3(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }
[[gnu::always_inline]] inline Eigen::Vector3d eigen(const Vec3<double>& v) { return {v.x, v.y, v.z}; }

template <class A, class B>
[[gnu::always_inline]] inline auto operator+(const Vec3<A>& a, const Vec3<B>& b) -> Vec3<decltype(a.x + b.x)> {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class A, class B>
[[gnu::always_inline]] inline auto operator-(const Vec3<A>& a, const Vec3<B>& b) -> Vec3<decltype(a.x - b.x)> {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class K, class T>
[[gnu::always_inline]] inline auto operator*(const K& k, const Vec3<T>& a) -> Vec3<decltype(k * a.x)> {
  return {k * a.x, k * a.y, k * a.z};
}
template <class A, class B>
[[gnu::always_inline]] inline auto dot(const Vec3<A>& a, const Vec3<B>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class A, class B>
[[gnu::always_inline]] inline auto cross(const Vec3<A>& a, const Vec3<B>& b) -> Vec3<decltype(a.x * b.x)> {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

}  // namespace ballast::sim
