// The ball by Newton and Euler: physics.md section 4 (masses prescribed) and section 5 (masses driven), in every
// regime.
//
// All sums over the masses are taken once, about the geometric centre and in the body frame:
//   S = sum m_i zeta_i                                     first moment
//   J = I + sum m_i (|zeta_i|^2 1 - zeta_i zeta_i^T)       inertia about the geometric centre
//   e_i = 2 thetadot_i Omega x zeta_i' + thetadot_i^2 zeta_i'' + thetaddot_i zeta_i'     (c_i without its centripetal
//   part; for a mass carried along any curve chi_i(t) it is 2 Omega x chidot_i + chiddot_i)
// so that section 4 reads, with the centripetal parts gathered in Omega x (Omega x S) and Omega x J Omega,
//   Newton   M a + Omegadot x S + G = R_B,               G = Omega x (Omega x S) + sum m_i e_i + M g Gamma - F_B
//   Euler    J Omegadot + S x a + E = -r Gamma x R_B,    E = Omega x J Omega + g S x Gamma + sum m_i zeta_i x e_i
// and rolling, a = Omegadot x r Gamma, leaves the symmetric positive definite system
//   A Omegadot = -(E + r Gamma x G),   A = J + r (2 S.Gamma 1 - Gamma S^T - S Gamma^T) + M r^2 (1 - Gamma Gamma^T).
// A driven mass adds the unknown thetaddot_i and the row b_i . Omegadot + D_i thetaddot_i = tau_i - m_i zeta_i' . (c'_i
// + g Gamma), b_i = m_i (r Gamma + zeta_i) x zeta_i', D_i = m_i |zeta_i'|^2 + J_i; D is diagonal, so thetaddot is
// eliminated mass by mass.
//
// With the contact force R_B left open, u = (a, Omegadot) obeys the symmetric positive definite
//   [ M 1   -S^ ] u = (-G, -E) + W^T R_B,   W u = a - Omegadot x r Gamma
//   [ S^     J  ]
// (S^ the cross-product matrix of S). W u is the rate, seen in space, of the slip velocity zdot - omega x r e3, so that
//   rate of slip = (W u at R = 0) + C R,   C = W [..]^-1 W^T symmetric positive definite,
// contains everything that the contact regimes need (contact.h). A driven mass adds l_i . u + D_i thetaddot_i = tau_i -
// m_i zeta_i' . (c'_i + g Gamma) with l_i = (m_i zeta_i', m_i zeta_i x zeta_i'), and thetaddot_i is eliminated as
// above. An impulse changes the velocities by the same matrices; motor forces are finite, so a driven mass yields to it
// along its rail.
//
// Real floors (physics.md, "Real floors"). On a slope the space frame is the floor's, so every g Gamma above that comes
// from weight is g times the upward vertical `against_weight`, and every r Gamma stays. The floor's moment t N with
// t = Lambda^T T_W / N joins the right side of Euler's equation. In rolling N = n_0 + n . Omegadot, with n = S x Gamma
// and n_0 = Gamma . G before the elimination of driven masses, which changes both, so
//   (A - t n^T) Omegadot = rhs + t n_0,   solved by Sherman and Morrison's formula from the symmetric solution.
// With the contact force open, u gains N [..]^-1 (0, t), and C that response's slip rate in the column of N.
#pragma once

#include <Eigen/Core>
#include <array>

#include "firmware/model/rail.h"
#include "sim/masses/cubic_spline.h"
#include "sim/plant/external_force.h"
#include "sim/plant/floor.h"
#include "sim/plant/world.h"

namespace ballast::sim {

// The constants of the equations, unpacked from the world.
struct Body {
  explicit Body(const World& world);

  double radius_m;
  double gravity_mps2;
  double shell_mass_kg;
  double total_mass_kg;
  Eigen::Vector3d inertia_kgm2;  // of m_0 about its own centre of mass
  Eigen::Vector3d center_of_mass_B_m;
  Vec3<double> shell_first_moment;            // m_0 chi_0
  std::array<double, 6> shell_second_moment;  // m_0 chi_0 chi_0^T: xx, xy, xz, yy, yz, zz
  ExternalForce external_force;
  Floor floor;
  int mass_count;
  std::array<double, kMaxMasses> mass_kg{};
  std::array<firmware::Rail, kMaxMasses> rail{};
  std::array<CubicSpline, kMaxMasses> trajectory;      // for prescribed masses without a rail, else empty
  std::array<double, kMaxMasses> reflected_inertia{};  // J_i = rotor inertia * shaft_ratio^2, in rail units

  // zeta_i(theta) and its derivatives. A trajectory chi_i(t) is a curve whose coordinate is the time: theta = t,
  // thetadot = 1.
  [[nodiscard]] firmware::RailPoint<double> path(std::size_t i, double position) const;
};

// The place of a prescribed mass: chi_i from the geometric centre, and its derivatives in the body frame.
struct CarriedMass {
  Vec3<double> position_B_m, velocity_B_mps, acceleration_B_mps2;
};
using CarriedMasses = std::array<CarriedMass, kMaxMasses>;

// eq_1d_param: the masses at theta, with thetadot and thetaddot.
void carry_along(const Body& body, const double* position, const double* velocity, const double* acceleration,
                 CarriedMasses& out);

// The solution of the equations at one instant. Body frame; arrays per mass hold mass_count entries. In flight R_B = N
// = f_s = 0; in sliding f_s is the kinetic friction. On a floor that resists, NaN where the
// moment of each newton of N raises N by a newton or more: no N balances the ball.
template <class T>
struct MotionOf {
  using Vector3 = Eigen::Matrix<T, 3, 1>;
  Eigen::Matrix<T, 3, 3> rotation_B_to_W;         // Lambda
  Vector3 up_B;                                   // Gamma, its last row
  Vector3 angular_acceleration_B_radps2;          // Omegadot
  Vector3 acceleration_B_mps2;                    // a, of the geometric centre
  Vector3 contact_force_B_n;                      // R_B
  T normal_force_n;                               // N = R_B . Gamma
  T static_friction_n;                            // f_s = |R_B - N Gamma|
  Eigen::Matrix<T, 2, 1> rolling_velocity_W_mps;  // of the geometric centre, omega x r e3; rolling only
};
struct Motion : MotionOf<double> {
  // Driven masses only.
  std::array<double, kMaxMasses> mass_acceleration;
  std::array<double, kMaxMasses> generalised_force;  // tau
};

// The equations at one instant with the contact force left open.
struct OpenContact {
  Eigen::Matrix3d rotation_B_to_W;
  Eigen::Vector3d up_B;
  bool driven;
  Eigen::Matrix<double, 6, 1> free_acceleration;  // u = (a, Omegadot) where R = 0, body frame
  Eigen::Matrix<double, 6, 3> response;           // of u to R_B, and of the velocities to an impulse, body frame
  Eigen::Vector3d free_slip_rate_W_mps2;          // rate of the slip velocity where R = 0; its third entry is zddot's
  Eigen::Matrix3d compliance_W;                   // C, of that rate to R with the floor's moment of N = R_3: 1/kg
  Eigen::Matrix3d impulse_compliance_W;           // the same of the slip velocity to an impulse, which has no moment
  Eigen::Matrix<double, 6, 1> moment_response;    // of u to N by the floor's moment; 0 where the floor does not resist
  std::array<Eigen::Matrix<double, 6, 1>, kMaxMasses> coupling;  // l_i of driven masses
  std::array<double, kMaxMasses> inverse_inertia;                // 1 / D_i
  std::array<double, kMaxMasses> drive;                          // the row's right-hand side
};

// Lambda for q = (w, x, y, z), unit up to round-off.
Eigen::Matrix3d rotation_B_to_W(const double* q);

// Rolling with the masses prescribed. T: double, or std::complex<double> for derivatives by complex step.
template <class T>
void rolling_prescribed(const Body& body, double time_s, const T* q, const T* angular_velocity_B,
                        const CarriedMasses& masses, MotionOf<T>& out);

// Rolling with generalised motor forces tau (N m on a circle, N on a line) given; thetaddot is part of the answer.
void rolling_driven(const Body& body, double time_s, const double* q, const double* angular_velocity_B,
                    const double* position, const double* velocity, const double* generalised_force, Motion& out);

// qdot = q Omega / 2 (rolling_ball_ode_f), 4 entries.
template <class T>
void quaternion_rate(const T* q, const T* angular_velocity_B, T* out);

// Any regime; velocity_W_mps is the geometric centre's (drag).
void open_contact_prescribed(const Body& body, double time_s, const double* q, const double* angular_velocity_B,
                             const Eigen::Vector3d& velocity_W_mps, const CarriedMasses& masses, OpenContact& out);
void open_contact_driven(const Body& body, double time_s, const double* q, const double* angular_velocity_B,
                         const Eigen::Vector3d& velocity_W_mps, const double* position, const double* velocity,
                         const double* generalised_force, OpenContact& out);

// The motion under a contact force R, space frame, and under the floor's moment where N > 0. Sets everything in `out`
// but generalised_force.
void close_contact(const Body& body, const OpenContact& open, const Eigen::Vector3d& contact_force_W_n, Motion& out);

// The changes of the velocities by an impulse at the contact point (N s, space frame).
struct VelocityJump {
  Eigen::Vector3d velocity_W_mps;  // of the geometric centre
  Eigen::Vector3d angular_velocity_B_radps;
  std::array<double, kMaxMasses> mass_velocity{};  // 0 for prescribed masses
};
VelocityJump apply_impulse(const Body& body, const OpenContact& open, const Eigen::Vector3d& impulse_W_ns);

// The generalised force that each motor must supply for thetaddot = `acceleration`: section 5's second row solved for
// tau. Any regime.
void generalised_forces(const Body& body, const double* angular_velocity_B, const double* position,
                        const double* velocity, const double* acceleration, const MotionOf<double>& motion,
                        double* generalised_force);

}  // namespace ballast::sim
