// The record of motors and end stops over a run: torques, margins, energies, touches.
#pragma once

#include <array>

#include "sim/plant/equations.h"

namespace ballast::sim {

// Taken at the ends of ticks and of the integrator's steps, not located between them.
struct MotorExtrema {
  double max_torque_nm = 0;  // largest |torque| at the shaft (prescribed: needed, rotor inertia included)
  double torque_margin = 1;  // least part of the available torque left unused; below 0: more was needed than there is
};

// The energies of a stepper over the whole run, in J: electrical + (that from the load) = copper + friction + work +
// stored. Integrals over the integrator's steps to order 6. Without a winding, electrical and copper are 0 and
// mean nothing.
struct MotorEnergy {
  double electrical_j = 0;  // through the terminals
  double copper_j = 0;      // heat of the winding
  double friction_j = 0;    // heat of the viscous damping
  double work_j = 0;        // on rotor, mass and ball
  double stored_j = 0;      // change of the energy in the winding's field and the detent
};

// A driven mass at the ends of its rail. The touches are located in time; the other values are taken with the motors'
// torques.
struct EndStopRecord {
  int touches = 0;         // times a stop began to push
  double first_s = -1;     // the first touch; before the start: none
  double max_force_n = 0;  // greatest push
  // A soft stop gives way further than the shell would, which the model does not know.
  double outside_ball_m = 0;   // greatest distance of the mass outside the ball
  double outside_ball_s = -1;  // when the mass was first outside
};

class MotorRecord {
 public:
  // The energies count from here.
  void start(const Equations& equations, const MassPoint& masses);
  // Torques, margins and pushes now. Counts the motors' slips.
  void record(Dynamics& dynamics);
  // The energies of the span of length h from where `dynamics` is.
  void record_energy(const Dynamics& dynamics, double h, const Point& end);
  void record_touch(std::size_t i, double time_s);

  [[nodiscard]] double torque_nm(std::size_t i) const { return torque_nm_[i]; }  // of the shaft, at the last record()
  [[nodiscard]] const MotorExtrema& extrema(std::size_t i) const { return extrema_[i]; }
  [[nodiscard]] const EndStopRecord& end_stop(std::size_t i) const { return end_stop_[i]; }
  [[nodiscard]] MotorEnergy energy(std::size_t i, const Dynamics& dynamics) const;

 private:
  void record_driven(Dynamics& dynamics, std::size_t i, const MassPoint& masses);

  struct StoredEnergy {
    double winding_j = 0, detent_j = 0;
  };
  [[nodiscard]] static StoredEnergy stored_energy(const Stepper& stepper, double position, double velocity);

  PerMass torque_nm_{};
  std::array<MotorExtrema, kMaxMasses> extrema_{};
  // The energies are the sums of both; `energy_` without the stored energy.
  std::array<MotorEnergy, kMaxMasses> energy_{};
  LaneEnergies lane_energies_{};
  std::array<StoredEnergy, kMaxMasses> stored_at_start_{};
  std::array<EndStopRecord, kMaxMasses> end_stop_{};
};

}  // namespace ballast::sim
