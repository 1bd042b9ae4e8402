#include "sim/plant/newton_euler.h"

#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <limits>

namespace ballast::sim {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// Lambda by its rows; the third is Gamma.
template <class T>
struct Attitude {
  [[gnu::always_inline]] explicit Attitude(const T* q) {
    const T w = q[0], x = q[1], y = q[2], z = q[3];
    const T x2 = x + x, y2 = y + y, z2 = z + z;
    const T xx = x2 * x, yy = y2 * y, zz = z2 * z, xy = x2 * y, xz = x2 * z, yz = y2 * z;
    const T wx = x2 * w, wy = y2 * w, wz = z2 * w;
    row1 = {1. - (yy + zz), xy - wz, xz + wy};
    row2 = {xy + wz, 1. - (xx + zz), yz - wx};
    up = {xz - wy, yz + wx, 1. - (xx + yy)};
  }
  [[nodiscard, gnu::always_inline]] Vec3<T> to_W(const Vec3<T>& v_B) const {
    return {dot(row1, v_B), dot(row2, v_B), dot(up, v_B)};
  }
  template <class U>
  [[nodiscard, gnu::always_inline]] Vec3<T> to_B(const Vec3<U>& v_W) const {
    return v_W.x * row1 + v_W.y * row2 + v_W.z * up;
  }
  Vec3<T> row1, row2, up;
};

// -Lambda^T g_W / g.
template <class T>
[[gnu::always_inline]] inline Vec3<T> against_weight(const Floor& floor, const Attitude<T>& lambda) {
  if (!floor.slopes) [[likely]] {
    return lambda.up;
  }
  return lambda.to_B(floor.against_weight_W);
}

// Writes three values without the temporary that Eigen's assignment would make.
template <class T>
[[gnu::always_inline]] inline void store(const Vec3<T>& v, T* out, std::ptrdiff_t stride = 1) {
  out[0] = v.x;
  out[stride] = v.y;
  out[2 * stride] = v.z;
}

template <class T>
struct Symmetric {
  T xx, xy, xz, yy, yz, zz;
};

template <class T>
Symmetric<T> operator-(const Symmetric<T>& a, const Symmetric<T>& b) {
  return {a.xx - b.xx, a.xy - b.xy, a.xz - b.xz, a.yy - b.yy, a.yz - b.yz, a.zz - b.zz};
}

// a x = b by the adjugate of a.
template <class T>
[[gnu::always_inline]] inline Vec3<T> solve(const Symmetric<T>& a, const Vec3<T>& b) {
  const T c00 = a.yy * a.zz - a.yz * a.yz;
  const T c01 = a.xz * a.yz - a.xy * a.zz;
  const T c02 = a.xy * a.yz - a.xz * a.yy;
  const T c11 = a.xx * a.zz - a.xz * a.xz;
  const T c12 = a.xy * a.xz - a.xx * a.yz;
  const T c22 = a.xx * a.yy - a.xy * a.xy;
  const T inverse = 1. / (a.xx * c00 + a.xy * c01 + a.xz * c02);
  return {inverse * (c00 * b.x + c01 * b.y + c02 * b.z), inverse * (c01 * b.x + c11 * b.y + c12 * b.z),
          inverse * (c02 * b.x + c12 * b.y + c22 * b.z)};
}

// The sums of the header over shell and masses. Sums of positions alone stay real.
template <class T>
struct Sums {
  [[gnu::always_inline]] explicit Sums(const Body& body)
      : first_moment(body.shell_first_moment),
        xx(body.shell_second_moment[0]),
        xy(body.shell_second_moment[1]),
        xz(body.shell_second_moment[2]),
        yy(body.shell_second_moment[3]),
        yz(body.shell_second_moment[4]),
        zz(body.shell_second_moment[5]) {}

  // Returns e_i.
  [[gnu::always_inline]] Vec3<T> add(double m, const Vec3<T>& omega, const CarriedMass& mass) {
    const Vec3<double> moment = m * mass.position_B_m;
    first_moment = first_moment + moment;
    xx += moment.x * mass.position_B_m.x;
    xy += moment.x * mass.position_B_m.y;
    xz += moment.x * mass.position_B_m.z;
    yy += moment.y * mass.position_B_m.y;
    yz += moment.y * mass.position_B_m.z;
    zz += moment.z * mass.position_B_m.z;
    const Vec3<T> e = cross(omega, 2. * mass.velocity_B_mps) + mass.acceleration_B_mps2;
    sum_e = sum_e + m * e;
    sum_zeta_e = sum_zeta_e + cross(moment, e);
    return e;
  }

  Vec3<double> first_moment;      // S
  double xx, xy, xz, yy, yz, zz;  // sum m_i zeta_i zeta_i^T, the shell's too
  Vec3<T> sum_e{};                // sum m_i e_i
  Vec3<T> sum_zeta_e{};           // sum m_i zeta_i x e_i
};

// A Omegadot = rhs, and the contact force that goes with it.
template <class T>
struct RollingEquations {
  [[gnu::always_inline]] RollingEquations(const Body& b, double time_s, const Attitude<T>& attitude,
                                          const Vec3<T>& omega, const Sums<T>& s)
      : body(b), lambda(attitude), sums(s) {
    const double r = body.radius_m, g = body.gravity_mps2;
    const Vec3<T>& up = lambda.up;
    const Vec3<double>& first_moment = sums.first_moment;
    velocity_1 = r * dot(lambda.row2, omega);
    velocity_2 = -r * dot(lambda.row1, omega);
    // J about the geometric centre: the shell's inertia is about its own centre of mass, hence the parallel-axis terms.
    const double j00 = body.inertia_kgm2[0] + sums.yy + sums.zz, j11 = body.inertia_kgm2[1] + sums.xx + sums.zz,
                 j22 = body.inertia_kgm2[2] + sums.xx + sums.yy;
    const Vec3<T> j_omega{j00 * omega.x - sums.xy * omega.y - sums.xz * omega.z,
                          -sums.xy * omega.x + j11 * omega.y - sums.yz * omega.z,
                          -sums.xz * omega.x - sums.yz * omega.y + j22 * omega.z};
    // Omega x (Omega x S) = Omega (Omega.S) - S |Omega|^2.
    const Vec3<T> against = against_weight(body.floor, lambda);
    newton = dot(omega, first_moment) * omega - dot(omega, omega) * first_moment + sums.sum_e +
             (body.total_mass_kg * g) * against;
    if (body.external_force.present()) {
      const Vec3<T> force_W = body.external_force.at(time_s, Vec3<T>{velocity_1, velocity_2, T(0)});
      newton = newton - (force_W.x * lambda.row1 + force_W.y * lambda.row2 + force_W.z * up);
    }
    // E + r Gamma x G, with g S x Gamma drawn into the second product.
    rhs = cross(r * newton - g * first_moment, up) - (cross(omega, j_omega) + sums.sum_zeta_e);
    if (body.floor.slopes) [[unlikely]] {
      rhs = rhs - cross(g * first_moment, against - up);
    }

    // A = J + 2 (v . Gamma) 1 - Gamma v^T - v Gamma^T with v = r S + M r^2 Gamma / 2.
    const Vec3<T> v = r * first_moment + (0.5 * body.total_mass_kg * r * r) * up;
    const T x = up.x * v.x, y = up.y * v.y, z = up.z * v.z;
    matrix = {j00 + 2. * (y + z), -(sums.xy + up.x * v.y + v.x * up.y), -(sums.xz + up.x * v.z + v.x * up.z),
              j11 + 2. * (x + z), -(sums.yz + up.y * v.z + v.y * up.z), j22 + 2. * (x + y)};
  }

  [[nodiscard, gnu::always_inline]] Vec3<T> solve() const { return sim::solve(matrix, rhs); }

  // Omegadot with the floor's moment, from `free` without it. `driven_n` and `driven_n0` are what the elimination of
  // driven masses takes from n and adds to n_0.
  [[nodiscard, gnu::always_inline]] Vec3<T> resisted(const Vec3<T>& omega, const Vec3<T>& driven_n, const T& driven_n0,
                                                     const Vec3<T>& free) const {
    const Vec3<T> n = cross(sums.first_moment, lambda.up) - driven_n;
    const T normal = dot(lambda.up, newton) + driven_n0 + dot(n, free);
    if (!(std::real(normal) > 0)) return free;
    const Vec3<T> of_moment = sim::solve(matrix, lambda.to_B(body.floor.moment_W_m(lambda.to_W(omega))));
    const T determinant = 1. - dot(n, of_moment);
    constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
    if (!(std::real(determinant) > 0)) return {T(kNothing), T(kNothing), T(kNothing)};
    return free + (normal / determinant) * of_moment;
  }

  // `driven`: sum m_i thetaddot_i zeta_i' of driven masses, which `newton` lacks.
  [[gnu::always_inline]] void close(const Vec3<T>& omega_dot, const Vec3<T>& driven, MotionOf<T>& out) const {
    using std::sqrt;
    const Vec3<T>& up = lambda.up;
    const Vec3<T> acceleration = cross(body.radius_m * omega_dot, up);
    const Vec3<T> force = body.total_mass_kg * acceleration + cross(omega_dot, sums.first_moment) + newton + driven;
    const T normal = dot(force, up);
    const Vec3<T> friction = force - normal * up;
    store(lambda.row1, out.rotation_B_to_W.data(), 3);
    store(lambda.row2, out.rotation_B_to_W.data() + 1, 3);
    store(up, out.rotation_B_to_W.data() + 2, 3);
    store(up, out.up_B.data());
    store(omega_dot, out.angular_acceleration_B_radps2.data());
    store(acceleration, out.acceleration_B_mps2.data());
    store(force, out.contact_force_B_n.data());
    out.normal_force_n = normal;
    out.static_friction_n = sqrt(dot(friction, friction));
    out.rolling_velocity_W_mps[0] = velocity_1;
    out.rolling_velocity_W_mps[1] = velocity_2;
  }

  const Body& body;
  const Attitude<T>& lambda;
  const Sums<T>& sums;
  T velocity_1, velocity_2;  // of the geometric centre, omega x r e3
  Vec3<T> newton;            // G
  Symmetric<T> matrix;       // A
  Vec3<T> rhs;
};

}  // namespace

Body::Body(const World& world)
    : radius_m(world.ball.radius_m),
      gravity_mps2(world.gravity_mps2),
      shell_mass_kg(world.ball.mass_kg),
      total_mass_kg(world.ball.mass_kg),
      inertia_kgm2(world.ball.inertia_kgm2),
      center_of_mass_B_m(world.ball.center_of_mass_B_m),
      shell_first_moment(shell_mass_kg * vec3(center_of_mass_B_m)),
      external_force(world),
      floor(world),
      mass_count(static_cast<int>(world.masses.size())) {
  const Vec3<double>& moment = shell_first_moment;
  const Vector3d& chi = center_of_mass_B_m;
  shell_second_moment = {moment.x * chi[0], moment.x * chi[1], moment.x * chi[2],
                         moment.y * chi[1], moment.y * chi[2], moment.z * chi[2]};
  for (std::size_t i = 0; i < world.masses.size(); ++i) {
    const Mass& mass = world.masses[i];
    mass_kg[i] = mass.mass_kg;
    const Trajectory& table = mass.trajectory;
    if (table.times_s.empty()) {
      rail[i] = mass.rail;
    } else {
      trajectory[i] = table.periodic ? CubicSpline::closed(table.times_s, table.points_B_m)
                                     : CubicSpline::open(table.times_s, table.points_B_m);
    }
    reflected_inertia[i] = mass.motor.rail_inertia();
    total_mass_kg += mass.mass_kg;
  }
}

namespace {

void carry_along_path(const Body& body, std::size_t i, double position, double velocity, double acceleration,
                      CarriedMass& out) {
  const auto p = body.path(i, position);
  const double squared = velocity * velocity;
  out.position_B_m = vec3(p.position);
  out.velocity_B_mps = velocity * vec3(p.d1);
  out.acceleration_B_mps2 = acceleration * vec3(p.d1) + squared * vec3(p.d2);
}

}  // namespace

void carry_along(const Body& body, const double* position, const double* velocity, const double* acceleration,
                 CarriedMasses& out) {
  const auto n = static_cast<std::size_t>(body.mass_count);
  for (std::size_t i = 0; i < n; ++i) {
    const firmware::Rail& rail = body.rail[i];
    if (rail.shape != firmware::RailShape::kCircle) {
      carry_along_path(body, i, position[i], velocity[i], acceleration[i], out[i]);
      continue;
    }
    // A circle written out, which most robots have, takes two thirds of the instructions of the general path.
    const firmware::SinCos<double> angle = firmware::sin_cos(position[i]);
    const double c = rail.radius_m * angle.cos, s = rail.radius_m * angle.sin;
    const double squared = velocity[i] * velocity[i];
    const double c2 = acceleration[i] * c - squared * s, s2 = acceleration[i] * s + squared * c;
    const double c1 = velocity[i] * c, s1 = velocity[i] * s;
    const Vec3<double> x = vec3(rail.axis_cos_B), y = vec3(rail.axis_sin_B);
    out[i].position_B_m = vec3(rail.origin_B_m) + c * x + s * y;
    out[i].velocity_B_mps = c1 * y - s1 * x;
    out[i].acceleration_B_mps2 = c2 * y - s2 * x;
  }
}

Matrix3d rotation_B_to_W(const double* q) {
  const Attitude<double> lambda(q);
  Matrix3d out;
  out << lambda.row1.x, lambda.row1.y, lambda.row1.z, lambda.row2.x, lambda.row2.y, lambda.row2.z, lambda.up.x,
      lambda.up.y, lambda.up.z;
  return out;
}

firmware::RailPoint<double> Body::path(std::size_t i, double position) const {
  if (trajectory[i].empty()) return firmware::evaluate(rail[i], position);
  const CubicSpline::Point p = trajectory[i].at(position);
  return {p.position, p.d1, p.d2};
}

template <class T>
void quaternion_rate(const T* q, const T* o, T* out) {
  out[0] = -0.5 * (q[1] * o[0] + q[2] * o[1] + q[3] * o[2]);
  out[1] = 0.5 * (q[0] * o[0] + q[2] * o[2] - q[3] * o[1]);
  out[2] = 0.5 * (q[0] * o[1] + q[3] * o[0] - q[1] * o[2]);
  out[3] = 0.5 * (q[0] * o[2] + q[1] * o[1] - q[2] * o[0]);
}
template void quaternion_rate(const double*, const double*, double*);
template void quaternion_rate(const std::complex<double>*, const std::complex<double>*, std::complex<double>*);

namespace {

template <class T>
[[gnu::always_inline]] inline void roll(const Body& body, double time_s, const T* q, const T* angular_velocity_B,
                                        const CarriedMasses& masses, MotionOf<T>& out) {
  const Attitude<T> lambda(q);
  const Vec3<T> omega{angular_velocity_B[0], angular_velocity_B[1], angular_velocity_B[2]};
  Sums<T> sums(body);
  for (int i = 0; i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    sums.add(body.mass_kg[j], omega, masses[j]);
  }
  RollingEquations<T> equations(body, time_s, lambda, omega, sums);
  Vec3<T> omega_dot = equations.solve();
  if (body.floor.resists) [[unlikely]] {
    omega_dot = equations.resisted(omega, Vec3<T>{}, T(0), omega_dot);
  }
  equations.close(omega_dot, Vec3<T>{}, out);
}

#ifdef __x86_64__
// AVX does the same operations in the same order, so the bits are the same; it takes a sixth fewer instructions.
const bool kHasAvx = __builtin_cpu_supports("avx") != 0;

[[gnu::target("avx")]] void roll_avx(const Body& body, double time_s, const double* q, const double* angular_velocity_B,
                                     const CarriedMasses& masses, MotionOf<double>& out) {
  roll(body, time_s, q, angular_velocity_B, masses, out);
}
#endif

}  // namespace

template <>
void rolling_prescribed(const Body& body, double time_s, const double* q, const double* angular_velocity_B,
                        const CarriedMasses& masses, MotionOf<double>& out) {
#ifdef __x86_64__
  if (kHasAvx) return roll_avx(body, time_s, q, angular_velocity_B, masses, out);
#endif
  roll(body, time_s, q, angular_velocity_B, masses, out);
}

template <>
void rolling_prescribed(const Body& body, double time_s, const std::complex<double>* q,
                        const std::complex<double>* angular_velocity_B, const CarriedMasses& masses,
                        MotionOf<std::complex<double>>& out) {
  roll(body, time_s, q, angular_velocity_B, masses, out);
}

void rolling_driven(const Body& body, double time_s, const double* q, const double* angular_velocity_B,
                    const double* position, const double* velocity, const double* generalised_force, Motion& out) {
  const Attitude<double> lambda(q);
  const Vec3<double> omega{angular_velocity_B[0], angular_velocity_B[1], angular_velocity_B[2]};
  const double r = body.radius_m;
  Sums<double> sums(body);
  // Sums that the elimination of thetaddot_i subtracts from A and from the right-hand side.
  Symmetric<double> taken{};
  Vec3<double> taken_rhs{};
  std::array<Vec3<double>, kMaxMasses> tangent;    // zeta_i'
  std::array<Vec3<double>, kMaxMasses> lever;      // b_i
  std::array<double, kMaxMasses> inverse_inertia;  // 1 / D_i
  std::array<double, kMaxMasses> force;            // tau_i - m_i zeta_i' . (c'_i + g Gamma)
  const Vec3<double> weight = body.gravity_mps2 * against_weight(body.floor, lambda);
  // Parts of n and n_0 that the elimination changes.
  Vec3<double> driven_n{};
  double driven_n0 = 0;
  for (int i = 0; i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    const auto rail = firmware::evaluate(body.rail[j], position[i]);
    const double m = body.mass_kg[j], rate = velocity[i];
    const Vec3<double> zeta = vec3(rail.position), d1 = vec3(rail.d1);
    const Vec3<double> e = sums.add(m, omega, {zeta, rate * d1, rate * rate * vec3(rail.d2)});
    const Vec3<double> b = m * cross(r * lambda.up + zeta, d1);
    const double inverse_d = 1 / (m * dot(d1, d1) + body.reflected_inertia[j]);
    // zeta' . (Omega x (Omega x zeta)), written out.
    const double centripetal = dot(omega, zeta) * dot(omega, d1) - dot(omega, omega) * dot(zeta, d1);
    const double t = generalised_force[i] - m * (centripetal + dot(d1, e + weight));
    const Vec3<double> scaled = inverse_d * b;
    taken.xx += scaled.x * b.x;
    taken.xy += scaled.x * b.y;
    taken.xz += scaled.x * b.z;
    taken.yy += scaled.y * b.y;
    taken.yz += scaled.y * b.z;
    taken.zz += scaled.z * b.z;
    taken_rhs = taken_rhs + t * scaled;
    if (body.floor.resists) {
      const double rise = m * dot(d1, lambda.up);  // of N, per thetaddot_i
      driven_n = driven_n + rise * scaled;
      driven_n0 += rise * t * inverse_d;
    }
    tangent[j] = d1;
    lever[j] = b;
    inverse_inertia[j] = inverse_d;
    force[j] = t;
  }
  RollingEquations<double> equations(body, time_s, lambda, omega, sums);
  equations.matrix = equations.matrix - taken;
  equations.rhs = equations.rhs - taken_rhs;
  Vec3<double> omega_dot = equations.solve();
  if (body.floor.resists) omega_dot = equations.resisted(omega, driven_n, driven_n0, omega_dot);
  Vec3<double> driven{};  // sum m_i thetaddot_i zeta_i'
  for (int i = 0; i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    out.mass_acceleration[j] = (force[j] - dot(lever[j], omega_dot)) * inverse_inertia[j];
    out.generalised_force[j] = generalised_force[i];
    driven = driven + (body.mass_kg[j] * out.mass_acceleration[j]) * tangent[j];
  }
  equations.close(omega_dot, driven, out);
}

namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return m;
}

// The six rows, after the elimination of driven masses.
struct OpenSums {
  OpenSums(const Body& body, double time_s, const double* q, const double* angular_velocity_B,
           const Vector3d& velocity_W_mps)
      : lambda(rotation_B_to_W(q)),
        omega(angular_velocity_B[0], angular_velocity_B[1], angular_velocity_B[2]),
        first_moment(Vector3d::Zero()),
        inertia(body.inertia_kgm2.asDiagonal()) {
    add_mass(body.shell_mass_kg, body.center_of_mass_B_m);
    const Vec3<double> force = body.external_force.at(time_s, vec3(velocity_W_mps));
    rhs << lambda.transpose() * Vector3d(force.x, force.y, force.z), Vector3d::Zero();
  }

  void add_mass(double m, const Vector3d& at) {
    first_moment += m * at;
    inertia += m * (at.squaredNorm() * Matrix3d::Identity() - at * at.transpose());
  }

  // A mass at zeta with e; a driven mass's e is without its thetaddot.
  void add_moving_mass(double m, const Vector3d& zeta, const Vector3d& e) {
    add_mass(m, zeta);
    rhs.head<3>() -= m * e;
    rhs.tail<3>() -= m * zeta.cross(e);
  }

  // -Lambda^T g_W / g.
  [[nodiscard]] Vector3d against_weight(const Body& body) const {
    if (body.floor.slopes) return lambda.transpose() * eigen(body.floor.against_weight_W);
    return lambda.row(2);
  }

  // By blocks of three: inverses of such small matrices are closed forms.
  void solve(const Body& body, OpenContact& out) {
    const Vector3d up = lambda.row(2), against = against_weight(body);
    const double g = body.gravity_mps2;
    const Matrix3d s_cross = cross_matrix(first_moment);
    rhs.head<3>() -= omega.cross(omega.cross(first_moment)) + body.total_mass_kg * g * against;
    rhs.tail<3>() -= omega.cross(inertia * omega) + g * first_moment.cross(against);
    const Matrix3d mass = matrix.topLeftCorner<3, 3>() + body.total_mass_kg * Matrix3d::Identity();
    const Matrix3d mixed = matrix.topRightCorner<3, 3>() - s_cross;
    const Matrix3d inverse_mass = mass.inverse();
    const Matrix3d carried = inverse_mass * mixed;  // a for an Omegadot of -1
    // The inertia that a torque alone meets, for then the ball moves as well.
    const Matrix3d free_inertia = matrix.bottomRightCorner<3, 3>() + inertia - mixed.transpose() * carried;
    const Matrix3d inverse_inertia = free_inertia.inverse();
    const auto response_to = [&](const auto& force, const auto& torque, auto&& u) {
      const auto spin = (inverse_inertia * (torque - carried.transpose() * force)).eval();
      u.template topRows<3>() = inverse_mass * force - carried * spin;
      u.template bottomRows<3>() = spin;
    };

    const Matrix3d arm = body.radius_m * cross_matrix(up);
    out.rotation_B_to_W = lambda;
    out.up_B = up;
    response_to(rhs.head<3>(), rhs.tail<3>(), out.free_acceleration);
    response_to(Matrix3d::Identity(), arm.transpose(), out.response);
    const auto slip_rate = [&](const auto& u) {
      return (u.template topRows<3>() + arm * u.template bottomRows<3>()).eval();
    };
    out.free_slip_rate_W_mps2 = lambda * slip_rate(out.free_acceleration);
    out.impulse_compliance_W = lambda * slip_rate(out.response) * lambda.transpose();
    out.compliance_W = out.impulse_compliance_W;
    out.moment_response.setZero();
    if (!body.floor.resists) return;
    const Vector3d moment_m = lambda.transpose() * eigen(body.floor.moment_W_m(vec3(lambda * omega)));
    response_to(Vector3d::Zero(), moment_m, out.moment_response);
    out.compliance_W.col(2) += lambda * slip_rate(out.moment_response);
  }

  Matrix3d lambda;
  Vector3d omega;
  Vector3d first_moment;  // S
  Matrix3d inertia;       // J
  Eigen::Matrix<double, 6, 6> matrix = Eigen::Matrix<double, 6, 6>::Zero();
  Vector6d rhs;  // (-G, -E)
};

}  // namespace

void open_contact_prescribed(const Body& body, double time_s, const double* q, const double* angular_velocity_B,
                             const Vector3d& velocity_W_mps, const CarriedMasses& masses, OpenContact& out) {
  OpenSums sums(body, time_s, q, angular_velocity_B, velocity_W_mps);
  for (int i = 0; i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    const CarriedMass& mass = masses[j];
    sums.add_moving_mass(body.mass_kg[j], eigen(mass.position_B_m),
                         2 * sums.omega.cross(eigen(mass.velocity_B_mps)) + eigen(mass.acceleration_B_mps2));
  }
  out.driven = false;
  sums.solve(body, out);
}

void open_contact_driven(const Body& body, double time_s, const double* q, const double* angular_velocity_B,
                         const Vector3d& velocity_W_mps, const double* position, const double* velocity,
                         const double* generalised_force, OpenContact& out) {
  OpenSums sums(body, time_s, q, angular_velocity_B, velocity_W_mps);
  const Vector3d& omega = sums.omega;
  const Vector3d weight = body.gravity_mps2 * sums.against_weight(body);
  for (int i = 0; i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    const auto rail = firmware::evaluate(body.rail[j], position[i]);
    const Vector3d& zeta = rail.position;
    const double m = body.mass_kg[j], rate = velocity[i];
    const Vector3d e = 2 * rate * omega.cross(rail.d1) + rate * rate * rail.d2;
    sums.add_moving_mass(m, zeta, e);
    Vector6d& coupling = out.coupling[j];
    coupling << m * rail.d1, m * zeta.cross(rail.d1);
    out.inverse_inertia[j] = 1 / (m * rail.d1.squaredNorm() + body.reflected_inertia[j]);
    out.drive[j] = generalised_force[i] - m * rail.d1.dot(omega.cross(omega.cross(zeta)) + e + weight);
    sums.matrix -= out.inverse_inertia[j] * coupling * coupling.transpose();
    sums.rhs -= out.inverse_inertia[j] * out.drive[j] * coupling;
  }
  out.driven = true;
  sums.solve(body, out);
}

void close_contact(const Body& body, const OpenContact& open, const Vector3d& contact_force_W_n, Motion& out) {
  out.rotation_B_to_W = open.rotation_B_to_W;
  out.up_B = open.up_B;
  out.contact_force_B_n = open.rotation_B_to_W.transpose() * contact_force_W_n;
  Vector6d u = open.free_acceleration + open.response * out.contact_force_B_n;
  if (contact_force_W_n[2] > 0 && body.floor.resists) u += contact_force_W_n[2] * open.moment_response;
  out.acceleration_B_mps2 = u.head<3>();
  out.angular_acceleration_B_radps2 = u.tail<3>();
  out.normal_force_n = contact_force_W_n[2];
  out.static_friction_n = contact_force_W_n.head<2>().norm();
  for (int i = 0; open.driven && i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    out.mass_acceleration[j] = (open.drive[j] - open.coupling[j].dot(u)) * open.inverse_inertia[j];
  }
}

VelocityJump apply_impulse(const Body& body, const OpenContact& open, const Vector3d& impulse_W_ns) {
  const Vector6d jump = open.response * (open.rotation_B_to_W.transpose() * impulse_W_ns);
  VelocityJump out;
  out.velocity_W_mps = open.rotation_B_to_W * jump.head<3>();
  out.angular_velocity_B_radps = jump.tail<3>();
  for (int i = 0; open.driven && i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    out.mass_velocity[j] = -open.coupling[j].dot(jump) * open.inverse_inertia[j];
  }
  return out;
}

void generalised_forces(const Body& body, const double* angular_velocity_B, const double* position,
                        const double* velocity, const double* acceleration, const MotionOf<double>& motion,
                        double* generalised_force) {
  const Vector3d omega(angular_velocity_B[0], angular_velocity_B[1], angular_velocity_B[2]);
  Vector3d weight = body.gravity_mps2 * motion.up_B;
  if (body.floor.slopes) {
    weight = body.gravity_mps2 * (motion.rotation_B_to_W.transpose() * eigen(body.floor.against_weight_W));
  }
  for (int i = 0; i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    const auto rail = body.path(j, position[i]);
    const double rate = velocity[i];
    const Vector3d a = motion.acceleration_B_mps2 + motion.angular_acceleration_B_radps2.cross(rail.position) +
                       omega.cross(omega.cross(rail.position) + 2 * rate * rail.d1) + rate * rate * rail.d2 +
                       acceleration[i] * rail.d1;
    generalised_force[i] = body.mass_kg[j] * rail.d1.dot(a + weight) + body.reflected_inertia[j] * acceleration[i];
  }
}

}  // namespace ballast::sim
