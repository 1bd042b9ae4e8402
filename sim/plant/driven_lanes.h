// Rolling with driven masses on circles under stepper motors, four masses to a vector register: what
// MotorDrives::forces(), rolling_driven() and the record of the motors' energies compute one after the other, in half
// their instructions. Most robots spend most of a run here.
//
// Plain data and no other header of the plant: the source is compiled for AVX2 as well, and no inline function of
// another header may become one for AVX2 only.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

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
  std::array<std::uint64_t, kLaneCapacity> present{};  // with a mass all bits, else none
  PerLane shaft_ratio{};
  PerLane teeth{};            // N_r
  PerLane viscous_damping{};  // N m s
  PerLane torque_nm{};        // of the field at a lag of a quarter turn and no more speed than corner_radps
  PerLane corner_radps{};     // above it the torque falls as corner / speed; without a mass or with a winding 1e300
  PerLane field_rad{};
  PerLane detent_sin_nm{}, detent_cos_nm{};  // detent torque times sine and cosine of 4 N_r field_rad
  // Windings; without one, 0.
  PerLane resistance_v{}, reactance_v{};  // times the amplitude of the current: R A, X A
  PerLane amplitude_a{};                  // of the current, A
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

// Electrical, copper, friction and work of MotorEnergy, which see.
struct LaneEnergies {
  PerLane electrical_j{}, copper_j{}, friction_j{}, work_j{};
};

// Where Omega, the geometric centre and the masses begin in a state. It starts with q and ends with positions and
// rates.
inline constexpr std::size_t kLaneOmega = 4, kLaneZ = 7, kLaneTheta = 9;
// Every state of the plant has at least these entries.
inline constexpr std::size_t kLaneStateCapacity = kLaneTheta + 2 * kLaneCapacity + 4;

// States and their derivatives at the ends of a span.
struct LaneSpan {
  const double *y0, *dydt0, *y1, *dydt1;
};

// The functions return false, with their results undefined, where a winding runs short of voltage, or a lag or position
// is beyond the range of sin_cos(). `other_force`: what end stops and blocks add to the motors' generalised forces.
// Pointers are to states of kLaneStateCapacity entries, or into them; entries without a mass are read and not used.
struct DrivenLanes {
  bool (*evaluate)(const LaneBody& body, const LaneMotors& motors, const double* q, const double* angular_velocity_B,
                   const double* position, const double* velocity, const PerLane& other_force, LaneMotion& out);
  // The state's derivative alone, to the bit. Entries of `dydt` beyond the state in use are overwritten.
  bool (*derivative)(const LaneBody& body, const LaneMotors& motors, const double* y, const PerLane& other_force,
                     double* dydt);
  // Adds the energies of a span of length h, by Lobatto's rule of order 6. Nothing is added if it returns false. Rails
  // need not be circles.
  bool (*energies)(const LaneMotors& motors, std::size_t count, double h, const LaneSpan& span, LaneEnergies& to);
};

// Those for this processor, and those for every processor. They give the same bits.
const DrivenLanes& driven_lanes();
const DrivenLanes& portable_driven_lanes();

}  // namespace ballast::sim
