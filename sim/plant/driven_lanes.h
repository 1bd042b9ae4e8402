// Rolling with driven masses on circles under stepper motors, four masses to a vector register: what
// MotorDrives::forces() and rolling_driven() compute one after the other, in half their instructions. Most robots spend
// most of a run here.
//
// Plain data and no other header of the plant: the source is compiled for AVX2 as well, and no inline function of
// another header may become one for AVX2 only.
#pragma once

#include <array>
#include <cstddef>

namespace ballast::sim {

inline constexpr std::size_t kLaneCapacity = 8;
using PerLane = std::array<double, kLaneCapacity>;  // lanes without a mass are 0 unless a comment says otherwise

struct LaneVectors {
  PerLane x{}, y{}, z{};
};

// The robot. Symbols as in newton_euler.h.
struct LaneBody {
  std::size_t mass_count = 0;
  double radius_m = 0;
  double gravity_mps2 = 0;
  double total_mass_kg = 0;
  std::array<double, 3> inertia_kgm2{};
  std::array<double, 3> shell_first_moment{};
  std::array<double, 6> shell_second_moment{};  // xx, xy, xz, yy, yz, zz
  PerLane mass_kg{};
  PerLane reflected_inertia{};                         // without a mass 1
  LaneVectors center_B_m, axis_cos_B_m, axis_sin_B_m;  // of the circles; the axes are as long as the radius
};

// The motors with their fields as they are between two pulses. Angles are the shaft's, lags electrical.
struct LaneMotors {
  PerLane shaft_ratio{};
  PerLane teeth{};            // N_r
  PerLane viscous_damping{};  // N m s
  PerLane torque_nm{};        // of the field at a lag of a quarter turn and no more speed than corner_radps
  PerLane corner_radps{};     // above it the torque falls as corner / speed; without a mass or with a winding 1e300
  PerLane field_rad{};
  PerLane detent_sin_nm{}, detent_cos_nm{};  // detent torque times sine and cosine of 4 N_r field_rad
  // Windings; without one, 0.
  PerLane resistance_v{}, reactance_v{};  // times the amplitude of the current: R A, X A
  PerLane back_emf_vs{};                  // K
  PerLane supply_v2{};                    // squared; without a winding 1e300
};

struct LaneMotion {
  std::array<double, 9> rotation_B_to_W;  // by rows
  std::array<double, 3> angular_acceleration_B_radps2, acceleration_B_mps2, contact_force_B_n;
  double normal_force_n, static_friction_n;
  std::array<double, 2> rolling_velocity_W_mps;
  PerLane mass_acceleration, generalised_force;
};

// False, and `out` undefined, where a winding runs short of voltage, or a lag or position is beyond the range of
// sin_cos(). `other_force`: what end stops and blocks add to the motors' generalised forces.
using DrivenLanes = bool (*)(const LaneBody& body, const LaneMotors& motors, const double* q,
                             const double* angular_velocity_B, const double* position, const double* velocity,
                             const PerLane& other_force, LaneMotion& out);

// The one for this processor, and the one for every processor. They give the same bits.
DrivenLanes driven_lanes();
DrivenLanes portable_driven_lanes();

}  // namespace ballast::sim
