// Compiled with AVX-512 and contraction of products and sums (CMakeLists.txt).
#include "tools/benchmarks/batch_limit.h"

#include <cmath>

#pragma GCC diagnostic ignored "-Wpsabi"

namespace ballast::benchmarks {
namespace {

constexpr std::size_t kMasses = 3, kLanes = sweep::kLanes;
using V = double __attribute__((vector_size(8 * kLanes)));

struct V3 {
  V x, y, z;
};

#define INLINE [[gnu::always_inline]] inline
INLINE V3 operator+(const V3& a, const V3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
INLINE V3 operator*(const V& k, const V3& a) { return {k * a.x, k * a.y, k * a.z}; }
INLINE V dot(const V3& a, const V3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
INLINE V3 cross(const V3& a, const V3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

struct Balls {
  V m[kMasses], mass_rr;
  V3 shell_p;
  V jxx, jyy, jzz, jxy, jxz, jyz;  // of the shell, and sum m R^2
  double radius, gravity;
};

// Sums over the masses at one time: P, 2 sum m chi', sum m chi'', sum m chi x chi'', J; and the points.
struct Sums {
  V3 p, d2, a, h;
  V jxx, jyy, jzz, jxy, jxz, jyz;
  const sweep::CurvePoint* points;
};

struct State {
  V w, x, y, z;
  V3 omega;
  V px, py;
};

INLINE Sums sums_of(const Balls& balls, const sweep::CurvePoint* points) {
  Sums s{balls.shell_p, {}, {}, {}, balls.jxx, balls.jyy, balls.jzz, balls.jxy, balls.jxz, balls.jyz, points};
  for (std::size_t i = 0; i < kMasses; ++i) {
    const auto &c = points[i].position_m, &d2 = points[i].twice_rate_mps, &a = points[i].acceleration_mps2;
    const V m = balls.m[i];
    s.p = s.p + V3{m * c[0], m * c[1], m * c[2]};
    s.d2 = s.d2 + V3{m * d2[0], m * d2[1], m * d2[2]};
    s.a = s.a + V3{m * a[0], m * a[1], m * a[2]};
    s.h = s.h + V3{m * (c[1] * a[2] - c[2] * a[1]), m * (c[2] * a[0] - c[0] * a[2]), m * (c[0] * a[1] - c[1] * a[0])};
    s.jxx -= m * (c[0] * c[0]);
    s.jyy -= m * (c[1] * c[1]);
    s.jzz -= m * (c[2] * c[2]);
    s.jxy -= m * (c[0] * c[1]);
    s.jxz -= m * (c[0] * c[2]);
    s.jyz -= m * (c[1] * c[2]);
  }
  return s;
}

INLINE State derivative(const Balls& balls, const Sums& s, const State& y) {
  const V r = V{} + balls.radius;
  const V3& omega = y.omega;
  const V3 gamma{2 * (y.x * y.z - y.w * y.y), 2 * (y.y * y.z + y.w * y.x), 1 - 2 * (y.x * y.x + y.y * y.y)};
  const V3 momentum{s.jxx * omega.x + s.jxy * omega.y + s.jxz * omega.z,
                    s.jxy * omega.x + s.jyy * omega.y + s.jyz * omega.z,
                    s.jxz * omega.x + s.jyz * omega.y + s.jzz * omega.z};
  const V3 pushed = r * (cross(omega, cross(omega, s.p) + s.d2) + s.a);
  V3 b = cross(omega, momentum) + s.h +
         cross(gamma, V3{pushed.x - balls.gravity * s.p.x, pushed.y - balls.gravity * s.p.y,
                         pushed.z - balls.gravity * s.p.z});
  for (std::size_t i = 0; i < kMasses; ++i) {
    const auto &c = s.points[i].position_m, &d2 = s.points[i].twice_rate_mps;
    const V k = -balls.m[i] * (c[0] * omega.x + c[1] * omega.y + c[2] * omega.z);
    b = b + V3{k * d2[0], k * d2[1], k * d2[2]};
  }
  const V3 rp = r * s.p;
  const V base = balls.mass_rr + 2 * dot(gamma, rp);
  const V3 g{balls.mass_rr * gamma.x + 2 * rp.x, balls.mass_rr * gamma.y + 2 * rp.y,
             balls.mass_rr * gamma.z + 2 * rp.z};
  const V xx = s.jxx + base - g.x * gamma.x, yy = s.jyy + base - g.y * gamma.y, zz = s.jzz + base - g.z * gamma.z;
  const V3 q = balls.mass_rr * gamma + rp;
  const V xy = s.jxy - q.x * gamma.y - gamma.x * rp.y, xz = s.jxz - q.x * gamma.z - gamma.x * rp.z,
          yz = s.jyz - q.y * gamma.z - gamma.y * rp.z;
  const V axx = yy * zz - yz * yz, axy = xz * yz - xy * zz, axz = xy * yz - xz * yy;
  const V ayy = xx * zz - xz * xz, ayz = xy * xz - xx * yz, azz = xx * yy - xy * xy;
  const V minus = -1 / (xx * axx + xy * axy + xz * axz), half = V{} + 0.5;
  State dy;
  dy.omega = minus * V3{dot({axx, axy, axz}, b), dot({axy, ayy, ayz}, b), dot({axz, ayz, azz}, b)};
  const V3 o = half * omega;
  dy.w = -(y.x * o.x + y.y * o.y + y.z * o.z);
  dy.x = y.w * o.x + y.y * o.z - y.z * o.y;
  dy.y = y.w * o.y + y.z * o.x - y.x * o.z;
  dy.z = y.w * o.z + y.x * o.y - y.y * o.x;
  // Twice the products of quaternions that move the centre: r (e_3 x Omega in space).
  const V3 row1{1 - 2 * (y.y * y.y + y.z * y.z), 2 * (y.x * y.y - y.w * y.z), 2 * (y.x * y.z + y.w * y.y)};
  const V3 row2{2 * (y.x * y.y + y.w * y.z), 1 - 2 * (y.x * y.x + y.z * y.z), 2 * (y.y * y.z - y.w * y.x)};
  dy.px = r * dot(row2, omega);
  dy.py = -r * dot(row1, omega);
  return dy;
}

INLINE State moved(const State& y, double h, const State& dy) {
  const V k = V{} + h;
  return {y.w + k * dy.w,         y.x + k * dy.x,   y.y + k * dy.y,  y.z + k * dy.z,
          y.omega + k * dy.omega, y.px + k * dy.px, y.py + k * dy.py};
}

INLINE State load(const sweep::MotionTable& table, const std::array<sweep::BatchBall, kLanes>& given, Balls& balls) {
  State y{};
  balls.radius = table.radius_m();
  balls.gravity = table.gravity_mps2();
  const sweep::CurvePoint* points = table.points(table.segments().front(), 0);
  for (std::size_t l = 0; l < kLanes; ++l) {
    const sweep::BatchBall& ball = given[l];
    const double m0 = ball.shell_mass_kg;
    const auto& c = ball.center_of_mass_B_m;
    double mass = m0, mrr = 0;
    for (std::size_t i = 0; i < kMasses; ++i) {
      const auto& at = points[i].position_m;
      balls.m[i][l] = ball.mass_kg[i];
      mass += ball.mass_kg[i];
      mrr += ball.mass_kg[i] * (at[0] * at[0] + at[1] * at[1] + at[2] * at[2]);
    }
    balls.mass_rr[l] = mass * balls.radius * balls.radius;
    balls.shell_p.x[l] = m0 * c[0], balls.shell_p.y[l] = m0 * c[1], balls.shell_p.z[l] = m0 * c[2];
    balls.jxx[l] = ball.inertia_kgm2[0] + m0 * (c[1] * c[1] + c[2] * c[2]) + mrr;
    balls.jyy[l] = ball.inertia_kgm2[1] + m0 * (c[0] * c[0] + c[2] * c[2]) + mrr;
    balls.jzz[l] = ball.inertia_kgm2[2] + m0 * (c[0] * c[0] + c[1] * c[1]) + mrr;
    balls.jxy[l] = -m0 * c[0] * c[1], balls.jxz[l] = -m0 * c[0] * c[2], balls.jyz[l] = -m0 * c[1] * c[2];
    y.w[l] = ball.orientation[0], y.x[l] = ball.orientation[1];
    y.y[l] = ball.orientation[2], y.z[l] = ball.orientation[3];
    y.omega.x[l] = ball.angular_velocity_B_radps[0], y.omega.y[l] = ball.angular_velocity_B_radps[1];
    y.omega.z[l] = ball.angular_velocity_B_radps[2];
  }
  return y;
}

}  // namespace

bool batch_limit_runs() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("fma");
}

BatchAttitudes roll_batch_limit(const sweep::MotionTable& table, const std::array<sweep::BatchBall, kLanes>& given) {
  Balls balls{};
  State y = load(table, given, balls);
  for (const auto& part : table.segments()) {
    const double h = part.step_s;
    Sums start = sums_of(balls, table.points(part, 0));
    for (std::size_t k = 0; k < part.steps; ++k) {
      const Sums middle = sums_of(balls, table.points(part, 2 * k + 1));
      const Sums end = sums_of(balls, table.points(part, 2 * k + 2));
      const State k1 = derivative(balls, start, y), k2 = derivative(balls, middle, moved(y, h / 2, k1));
      const State k3 = derivative(balls, middle, moved(y, h / 2, k2)), k4 = derivative(balls, end, moved(y, h, k3));
      y = moved(moved(moved(moved(y, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4);
      start = end;
    }
  }
  BatchAttitudes q;
  for (std::size_t l = 0; l < kLanes; ++l) q[0][l] = y.w[l], q[1][l] = y.x[l], q[2][l] = y.y[l], q[3][l] = y.z[l];
  return q;
}

}  // namespace ballast::benchmarks
