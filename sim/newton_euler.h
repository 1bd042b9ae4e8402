// The ball by Newton and Euler: PHYSICS.md section 4 (masses prescribed) and section 5 (masses driven), rolling regime.
//
// All sums over the masses are taken once, about the geometric centre and in the body frame:
//   S = sum m_i zeta_i                                     first moment
//   J = I + sum m_i (|zeta_i|^2 1 - zeta_i zeta_i^T)       inertia about the geometric centre
//   e_i = 2 thetadot_i Omega x zeta_i' + thetadot_i^2 zeta_i'' + thetaddot_i zeta_i'     (c_i without its centripetal
//   part)
// so that section 4 reads, with the centripetal parts gathered in Omega x (Omega x S) and Omega x J Omega,
//   Newton   M a + Omegadot x S + G = R_B,               G = Omega x (Omega x S) + sum m_i e_i + M g Gamma - F_B
//   Euler    J Omegadot + S x a + E = -r Gamma x R_B,    E = Omega x J Omega + g S x Gamma + sum m_i zeta_i x e_i
// and rolling, a = Omegadot x r Gamma, leaves the symmetric positive definite system
//   A Omegadot = -(E + r Gamma x G),   A = J + r (2 S.Gamma 1 - Gamma S^T - S Gamma^T) + M r^2 (1 - Gamma Gamma^T).
// A driven mass adds the unknown thetaddot_i and the row b_i . Omegadot + D_i thetaddot_i = tau_i - m_i zeta_i' . (c'_i
// + g Gamma), b_i = m_i (r Gamma + zeta_i) x zeta_i', D_i = m_i |zeta_i'|^2 + J_i; D is diagonal, so thetaddot is
// eliminated mass by mass.
#pragma once

#include <Eigen/Core>
#include <array>

#include "firmware/model/rail.h"
#include "sim/scenario.h"

namespace ballast::sim {

inline constexpr int kMaxMasses = firmware::kMaxMasses;

// The constants of the equations, unpacked from a scenario.
struct Body {
  explicit Body(const Scenario& scenario);

  double radius_m;
  double gravity_mps2;
  double shell_mass_kg;
  double total_mass_kg;
  Eigen::Vector3d inertia_kgm2;  // of m_0 about its own centre of mass
  Eigen::Vector3d center_of_mass_B_m;
  Eigen::Vector3d external_force_W_n;
  int mass_count;
  std::array<double, kMaxMasses> mass_kg{};
  std::array<firmware::Rail, kMaxMasses> rail{};
  std::array<double, kMaxMasses> reflected_inertia{};  // J_i = rotor inertia * shaft_ratio^2, in rail units
};

// What the equations give at one instant. Body frame; `mass` arrays hold mass_count entries.
struct Motion {
  Eigen::Matrix3d rotation_B_to_W;                // Lambda
  Eigen::Vector3d up_B;                           // Gamma, its last row
  Eigen::Vector3d angular_acceleration_B_radps2;  // Omegadot
  Eigen::Vector3d acceleration_B_mps2;            // a, of the geometric centre
  Eigen::Vector3d contact_force_B_n;              // R_B
  double normal_force_n;                          // N = R_B . Gamma
  double static_friction_n;                       // f_s = |R_B - N Gamma|
  std::array<double, kMaxMasses> mass_acceleration;
  std::array<double, kMaxMasses> generalised_force;  // tau of driven masses; not set by rolling_prescribed()
};

// Lambda of q = (w, x, y, z), unit up to round-off.
Eigen::Matrix3d rotation_B_to_W(const double* q);

// Rolling with thetaddot prescribed.
void rolling_prescribed(const Body& body, const double* q, const double* angular_velocity_B, const double* position,
                        const double* velocity, const double* acceleration, Motion& out);

// Rolling with generalised motor forces tau (N m on a circle, N on a line) given; thetaddot is part of the answer.
void rolling_driven(const Body& body, const double* q, const double* angular_velocity_B, const double* position,
                    const double* velocity, const double* generalised_force, Motion& out);

// The generalised force each motor must supply for the thetaddot in `motion`: section 5's second row turned round. Any
// regime.
void generalised_forces(const Body& body, const double* angular_velocity_B, const double* position,
                        const double* velocity, const Motion& motion, double* generalised_force);

}  // namespace ballast::sim
