#include "sim/newton_euler.h"

#include <Eigen/Cholesky>
#include <cmath>

namespace ballast::sim {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Body::Body(const Scenario& scenario)
    : radius_m(scenario.ball.radius_m),
      gravity_mps2(scenario.gravity_mps2),
      shell_mass_kg(scenario.ball.mass_kg),
      total_mass_kg(scenario.ball.mass_kg),
      inertia_kgm2(scenario.ball.inertia_kgm2),
      center_of_mass_B_m(scenario.ball.center_of_mass_B_m),
      external_force_W_n(scenario.external_force_W_n),
      mass_count(static_cast<int>(scenario.masses.size())) {
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const Mass& mass = scenario.masses[i];
    mass_kg[i] = mass.mass_kg;
    rail[i] = mass.rail;
    reflected_inertia[i] = mass.motor.rotor_inertia_kgm2 * mass.motor.shaft_ratio * mass.motor.shaft_ratio;
    total_mass_kg += mass.mass_kg;
  }
}

Matrix3d rotation_B_to_W(const double* q) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  Matrix3d lambda;
  lambda << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),  //
      2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),        //
      2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y);
  return lambda;
}

namespace {

// Solves the symmetric system [a00 a01 a02; . a11 a12; . . a22] x = b by its adjugate.
Vector3d solve_symmetric(double a00, double a01, double a02, double a11, double a12, double a22, const Vector3d& b) {
  const double c00 = a11 * a22 - a12 * a12;
  const double c01 = a02 * a12 - a01 * a22;
  const double c02 = a01 * a12 - a02 * a11;
  const double c11 = a00 * a22 - a02 * a02;
  const double c12 = a01 * a02 - a00 * a12;
  const double c22 = a00 * a11 - a01 * a01;
  const double inverse = 1 / (a00 * c00 + a01 * c01 + a02 * c02);
  return inverse * Vector3d(c00 * b[0] + c01 * b[1] + c02 * b[2], c01 * b[0] + c11 * b[1] + c12 * b[2],
                            c02 * b[0] + c12 * b[1] + c22 * b[2]);
}

template <bool kDriven>
void rolling(const Body& body, const double* q, const double* angular_velocity_B, const double* position,
             const double* velocity, const double* drive, Motion& out) {
  const Matrix3d lambda = rotation_B_to_W(q);
  const Vector3d up = lambda.row(2);
  const Vector3d omega(angular_velocity_B[0], angular_velocity_B[1], angular_velocity_B[2]);
  const double r = body.radius_m;
  const double g = body.gravity_mps2;
  const double omega_squared = omega.squaredNorm();

  // The shell, index 0: its inertia is about its own centre of mass, hence the parallel-axis terms in xx...zz.
  Vector3d first_moment = body.shell_mass_kg * body.center_of_mass_B_m;
  const Vector3d& chi = body.center_of_mass_B_m;
  double xx = first_moment[0] * chi[0], xy = first_moment[0] * chi[1], xz = first_moment[0] * chi[2];
  double yy = first_moment[1] * chi[1], yz = first_moment[1] * chi[2], zz = first_moment[2] * chi[2];
  Vector3d sum_e = Vector3d::Zero();       // sum m_i e_i
  Vector3d sum_zeta_e = Vector3d::Zero();  // sum m_i zeta_i x e_i

  // What the elimination of driven thetaddot_i takes from A and from the right-hand side.
  double b00 = 0, b01 = 0, b02 = 0, b11 = 0, b12 = 0, b22 = 0;
  Vector3d b_rhs = Vector3d::Zero();
  std::array<Vector3d, kMaxMasses> tangent;        // zeta_i'
  std::array<Vector3d, kMaxMasses> lever;          // b_i
  std::array<double, kMaxMasses> inverse_inertia;  // 1 / D_i
  std::array<double, kMaxMasses> force;            // tau_i - m_i zeta_i' . (c'_i + g Gamma)

  for (int i = 0; i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    const auto rail = firmware::evaluate(body.rail[j], position[i]);
    const Vector3d& zeta = rail.position;
    const double m = body.mass_kg[j];
    const double rate = velocity[i];
    Vector3d e = 2 * rate * omega.cross(rail.d1) + rate * rate * rail.d2;
    if constexpr (!kDriven) e += drive[i] * rail.d1;
    const Vector3d m_zeta = m * zeta;
    first_moment += m_zeta;
    xx += m_zeta[0] * zeta[0], xy += m_zeta[0] * zeta[1], xz += m_zeta[0] * zeta[2];
    yy += m_zeta[1] * zeta[1], yz += m_zeta[1] * zeta[2], zz += m_zeta[2] * zeta[2];
    sum_e += m * e;
    sum_zeta_e += m_zeta.cross(e);
    if constexpr (kDriven) {
      const Vector3d b = m * (r * up + zeta).cross(rail.d1);
      const double inverse_d = 1 / (m * rail.d1.squaredNorm() + body.reflected_inertia[j]);
      // zeta' . (Omega x (Omega x zeta)), written out.
      const double centripetal = omega.dot(zeta) * omega.dot(rail.d1) - omega_squared * zeta.dot(rail.d1);
      const double t = drive[i] - m * (centripetal + rail.d1.dot(e + g * up));
      const Vector3d scaled = inverse_d * b;
      b00 += scaled[0] * b[0], b01 += scaled[0] * b[1], b02 += scaled[0] * b[2];
      b11 += scaled[1] * b[1], b12 += scaled[1] * b[2], b22 += scaled[2] * b[2];
      b_rhs += t * scaled;
      tangent[j] = rail.d1;
      lever[j] = b;
      inverse_inertia[j] = inverse_d;
      force[j] = t;
    }
  }

  // J about the geometric centre.
  const double j00 = body.inertia_kgm2[0] + yy + zz, j11 = body.inertia_kgm2[1] + xx + zz,
               j22 = body.inertia_kgm2[2] + xx + yy;
  const Vector3d j_omega(j00 * omega[0] - xy * omega[1] - xz * omega[2],
                         -xy * omega[0] + j11 * omega[1] - yz * omega[2],
                         -xz * omega[0] - yz * omega[1] + j22 * omega[2]);

  const Vector3d force_B = lambda.transpose() * body.external_force_W_n;
  Vector3d newton = omega.cross(omega.cross(first_moment)) + sum_e + body.total_mass_kg * g * up - force_B;  // G
  const Vector3d euler = omega.cross(j_omega) + g * first_moment.cross(up) + sum_zeta_e;                     // E

  const double m_r2 = body.total_mass_kg * r * r;
  const double diagonal = 2 * r * first_moment.dot(up) + m_r2;
  const Vector3d u = r * first_moment;
  const auto off = [&](int i, int j) { return -(up[i] * u[j] + u[i] * up[j] + m_r2 * up[i] * up[j]); };
  const Vector3d rhs = -(euler + r * up.cross(newton)) - b_rhs;
  const Vector3d omega_dot =
      solve_symmetric(j00 + diagonal + off(0, 0) - b00, -xy + off(0, 1) - b01, -xz + off(0, 2) - b02,
                      j11 + diagonal + off(1, 1) - b11, -yz + off(1, 2) - b12, j22 + diagonal + off(2, 2) - b22, rhs);
  for (int i = 0; i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    if constexpr (kDriven) {
      out.mass_acceleration[j] = (force[j] - lever[j].dot(omega_dot)) * inverse_inertia[j];
      out.generalised_force[j] = drive[i];
      newton += body.mass_kg[j] * out.mass_acceleration[j] * tangent[j];
    } else {
      out.mass_acceleration[j] = drive[i];
    }
  }

  out.rotation_B_to_W = lambda;
  out.up_B = up;
  out.angular_acceleration_B_radps2 = omega_dot;
  out.acceleration_B_mps2 = r * omega_dot.cross(up);
  out.contact_force_B_n = body.total_mass_kg * out.acceleration_B_mps2 + omega_dot.cross(first_moment) + newton;
  out.normal_force_n = out.contact_force_B_n.dot(up);
  out.static_friction_n = (out.contact_force_B_n - out.normal_force_n * up).norm();
}

}  // namespace

void rolling_prescribed(const Body& body, const double* q, const double* angular_velocity_B, const double* position,
                        const double* velocity, const double* acceleration, Motion& out) {
  rolling<false>(body, q, angular_velocity_B, position, velocity, acceleration, out);
}

void rolling_driven(const Body& body, const double* q, const double* angular_velocity_B, const double* position,
                    const double* velocity, const double* generalised_force, Motion& out) {
  rolling<true>(body, q, angular_velocity_B, position, velocity, generalised_force, out);
}

namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

Matrix3d cross_matrix(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return m;
}

}  // namespace

void open_contact(const Body& body, bool driven, const double* q, const double* angular_velocity_B,
                  const double* position, const double* velocity, const double* drive, OpenContact& out) {
  const Matrix3d lambda = rotation_B_to_W(q);
  const Vector3d up = lambda.row(2);
  const Vector3d omega(angular_velocity_B[0], angular_velocity_B[1], angular_velocity_B[2]);
  const double g = body.gravity_mps2;
  Vector3d first_moment = body.shell_mass_kg * body.center_of_mass_B_m;
  Matrix3d inertia = body.inertia_kgm2.asDiagonal();
  const auto add_inertia = [&](double m, const Vector3d& at) {
    inertia += m * (at.squaredNorm() * Matrix3d::Identity() - at * at.transpose());
  };
  add_inertia(body.shell_mass_kg, body.center_of_mass_B_m);

  // rhs = (-G, -E); what the masses take from matrix and right-hand side comes first.
  Eigen::Matrix<double, 6, 6> matrix = Eigen::Matrix<double, 6, 6>::Zero();
  Vector6d rhs = Vector6d::Zero();
  for (int i = 0; i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    const auto rail = firmware::evaluate(body.rail[j], position[i]);
    const Vector3d& zeta = rail.position;
    const double m = body.mass_kg[j];
    const double rate = velocity[i];
    const Vector3d e = 2 * rate * omega.cross(rail.d1) + rate * rate * rail.d2;  // without thetaddot
    first_moment += m * zeta;
    add_inertia(m, zeta);
    Vector6d& coupling = out.coupling[j];
    coupling << m * rail.d1, m * zeta.cross(rail.d1);
    out.drive[j] = drive[i];
    rhs.head<3>() -= m * e;
    rhs.tail<3>() -= m * zeta.cross(e);
    if (driven) {
      out.inverse_inertia[j] = 1 / (m * rail.d1.squaredNorm() + body.reflected_inertia[j]);
      out.drive[j] -= m * rail.d1.dot(omega.cross(omega.cross(zeta)) + e + g * up);
      matrix -= out.inverse_inertia[j] * coupling * coupling.transpose();
      rhs -= out.inverse_inertia[j] * out.drive[j] * coupling;
    } else {
      rhs -= drive[i] * coupling;
    }
  }
  const Matrix3d s_cross = cross_matrix(first_moment);
  matrix.topLeftCorner<3, 3>() += body.total_mass_kg * Matrix3d::Identity();
  matrix.topRightCorner<3, 3>() -= s_cross;
  matrix.bottomLeftCorner<3, 3>() += s_cross;
  matrix.bottomRightCorner<3, 3>() += inertia;
  rhs.head<3>() -= omega.cross(omega.cross(first_moment)) + body.total_mass_kg * g * up -
                   lambda.transpose() * body.external_force_W_n;
  rhs.tail<3>() -= omega.cross(inertia * omega) + g * first_moment.cross(up);

  Eigen::Matrix<double, 3, 6> slip;  // W
  slip << Matrix3d::Identity(), body.radius_m * cross_matrix(up);
  const Eigen::LLT<Eigen::Matrix<double, 6, 6>> factor(matrix);
  out.rotation_B_to_W = lambda;
  out.up_B = up;
  out.driven = driven;
  out.free_acceleration = factor.solve(rhs);
  out.response = factor.solve(slip.transpose());
  out.free_slip_rate_W_mps2 = lambda * (slip * out.free_acceleration);
  out.compliance_W = lambda * (slip * out.response) * lambda.transpose();
}

void close_contact(const Body& body, const OpenContact& open, const Vector3d& contact_force_W_n, Motion& out) {
  out.rotation_B_to_W = open.rotation_B_to_W;
  out.up_B = open.up_B;
  out.contact_force_B_n = open.rotation_B_to_W.transpose() * contact_force_W_n;
  const Vector6d u = open.free_acceleration + open.response * out.contact_force_B_n;
  out.acceleration_B_mps2 = u.head<3>();
  out.angular_acceleration_B_radps2 = u.tail<3>();
  out.normal_force_n = contact_force_W_n[2];
  out.static_friction_n = contact_force_W_n.head<2>().norm();
  for (int i = 0; i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    out.mass_acceleration[j] =
        open.driven ? (open.drive[j] - open.coupling[j].dot(u)) * open.inverse_inertia[j] : open.drive[j];
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
                        const double* velocity, const Motion& motion, double* generalised_force) {
  const Vector3d omega(angular_velocity_B[0], angular_velocity_B[1], angular_velocity_B[2]);
  for (int i = 0; i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    const auto rail = firmware::evaluate(body.rail[j], position[i]);
    const double rate = velocity[i];
    const Vector3d acceleration = motion.acceleration_B_mps2 +
                                  motion.angular_acceleration_B_radps2.cross(rail.position) +
                                  omega.cross(omega.cross(rail.position) + 2 * rate * rail.d1) + rate * rate * rail.d2 +
                                  motion.mass_acceleration[j] * rail.d1;
    generalised_force[i] = body.mass_kg[j] * rail.d1.dot(acceleration + body.gravity_mps2 * motion.up_B) +
                           body.reflected_inertia[j] * motion.mass_acceleration[j];
  }
}

}  // namespace ballast::sim
