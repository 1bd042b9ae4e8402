#include "sim/plant/contact_shares.h"

#include <Eigen/Dense>
#include <limits>

namespace ballast::sim {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// The contact force that a load on the ball causes. A load is its part of G and E of newton_euler.h.
class Response {
 public:
  Response(const Body& body, const Matrix3d& rotation_B_to_W, const CarriedMasses& masses)
      : lambda_(rotation_B_to_W), contact_B_m_(body.radius_m * rotation_B_to_W.row(2).transpose()) {
    // About the contact point: A = I + sum m_i (|s_i|^2 1 - s_i s_i^T), s_i = r Gamma + zeta_i.
    matrix_ = body.inertia_kgm2.asDiagonal();
    add(body.shell_mass_kg, body.center_of_mass_B_m);
    for (int i = 0; i < body.mass_count; ++i) {
      const auto j = static_cast<std::size_t>(i);
      add(body.mass_kg[j], eigen(masses[j].position_B_m));
    }
    factor_.compute(matrix_);
  }

  // Contact force, space frame.
  [[nodiscard]] Vector3d force_W_n(const Vector3d& newton, const Vector3d& euler) const {
    const Vector3d omega_dot = -factor_.solve(euler + contact_B_m_.cross(newton));
    return lambda_ * (omega_dot.cross(moment_) + newton);
  }
  // The same for m times an acceleration at zeta.
  [[nodiscard]] Vector3d force_W_n(double m, const Vector3d& zeta, const Vector3d& acceleration) const {
    return force_W_n(m * acceleration, m * zeta.cross(acceleration));
  }

 private:
  void add(double m, const Vector3d& zeta) {
    const Vector3d s = contact_B_m_ + zeta;
    matrix_ += m * (s.squaredNorm() * Matrix3d::Identity() - s * s.transpose());
    moment_ += m * s;
  }

  Matrix3d lambda_;
  Vector3d contact_B_m_;                // r Gamma
  Matrix3d matrix_;                     // A
  Vector3d moment_ = Vector3d::Zero();  // sum m_i s_i
  Eigen::LDLT<Matrix3d> factor_;
};

}  // namespace

double part_of_friction(const ContactShares& shares, const Vector3d& part_W_n, double static_weight_n) {
  if (!(shares.static_weight_n > 0)) return std::numeric_limits<double>::quiet_NaN();
  const double normal_n = shares.force_W_n[2];
  const Eigen::Vector2d friction_W_n = shares.force_W_n.head<2>();
  const double lifted_n = static_weight_n - part_W_n[2];
  if (!(normal_n > 0)) return lifted_n / (shares.static_weight_n - normal_n);
  const double pushed_n = part_W_n.head<2>().dot(friction_W_n) * normal_n / friction_W_n.squaredNorm();
  return (pushed_n + lifted_n) / shares.static_weight_n;
}

ContactShares contact_shares(const Body& body, double time_s, const double* q, const double* angular_velocity_B,
                             const CarriedMasses& masses) {
  const Matrix3d lambda = rotation_B_to_W(q);
  const Vector3d omega(angular_velocity_B[0], angular_velocity_B[1], angular_velocity_B[2]);
  const Vector3d against_weight_W = eigen(body.floor.against_weight_W);
  Vector3d weight_B = body.gravity_mps2 * lambda.row(2).transpose();
  if (body.floor.slopes) weight_B = body.gravity_mps2 * (lambda.transpose() * against_weight_W);
  const double pressing_mps2 = body.gravity_mps2 * against_weight_W[2];
  const Response response(body, lambda, masses);

  ContactShares out;
  out.mass_count = body.mass_count;
  const auto sum_up = [&out](const LoadShare& share) {
    out.force_W_n += share.total_W_n();
    out.static_weight_n += share.static_weight_n;
  };
  for (int i = 0; i < body.mass_count; ++i) {
    const auto j = static_cast<std::size_t>(i);
    const double m = body.mass_kg[j];
    const Vector3d zeta = eigen(masses[j].position_B_m);
    LoadShare& share = out.mass[j];
    share.weight_W_n = response.force_W_n(m, zeta, weight_B);
    share.motion_W_n = response.force_W_n(
        m, zeta, 2 * omega.cross(eigen(masses[j].velocity_B_mps)) + eigen(masses[j].acceleration_B_mps2));
    share.turning_W_n = response.force_W_n(m, zeta, omega.cross(omega.cross(zeta)));
    share.static_weight_n = m * pressing_mps2;
    sum_up(share);
  }

  const double m_0 = body.shell_mass_kg;
  const Vector3d& chi_0 = body.center_of_mass_B_m;
  out.shell.weight_W_n = response.force_W_n(m_0, chi_0, weight_B);
  const Vector3d gyroscopic = omega.cross(body.inertia_kgm2.cwiseProduct(omega));
  out.shell.turning_W_n = response.force_W_n(m_0, chi_0, omega.cross(omega.cross(chi_0))) +
                          response.force_W_n(Vector3d::Zero(), gyroscopic);
  out.shell.static_weight_n = m_0 * pressing_mps2;
  sum_up(out.shell);

  if (body.external_force.present()) {
    // In rolling the geometric centre moves at omega x r e3.
    const Vector3d velocity_W = (lambda * omega).cross(Vector3d(0, 0, body.radius_m));
    const Vector3d force_W = eigen(body.external_force.at(time_s, vec3(velocity_W)));
    out.outside.weight_W_n = response.force_W_n(-(lambda.transpose() * force_W), Vector3d::Zero());
    out.outside.static_weight_n = -force_W[2];
    sum_up(out.outside);
  }
  if (body.floor.resists && out.force_W_n[2] > 0) {
    // The moment is in proportion to N, which it changes in proportion.
    const Vector3d moment_B_m = lambda.transpose() * eigen(body.floor.moment_W_m(vec3(lambda * omega)));
    const Vector3d per_n = response.force_W_n(Vector3d::Zero(), -moment_B_m);
    out.floor.turning_W_n = out.force_W_n[2] / (1 - per_n[2]) * per_n;
    sum_up(out.floor);
  }
  return out;
}

}  // namespace ballast::sim
