// The equations of motion in the regime at hand: rolling, sliding or flight, with masses prescribed or driven.
//
// Choices that physics.md section 4 leaves open:
//   - While a slip that has just begun is slower than 1e-6 sqrt(g r), its direction follows from the contact's
//     accelerations (contact.h). The velocity's direction is mostly rounding at first, and its equation is stiff.
//   - A slip that is about to vanish keeps its direction below 1e-3 of its speed at the start of the integrator's step,
//     or 1e-12 sqrt(g r).
#pragma once

#include "sim/masses/motion.h"
#include "sim/plant/contact_regime.h"
#include "sim/plant/driven_lanes.h"
#include "sim/plant/local_floor.h"
#include "sim/plant/motor_drives.h"
#include "sim/plant/newton_euler.h"
#include "sim/plant/plant_model.h"
#include "sim/plant/state.h"

namespace ballast::sim {

// Place of the contact point.
inline Eigen::Vector2d place_W_m(const State& y) { return {y[kZ], y[kZ + 1]}; }

class Equations {
 public:
  explicit Equations(const PlantModel& model);

  // These parts change between two steps of the integrator, never inside one.
  Body body;
  PrescribedMasses prescribed;
  MotorDrives motors;
  ContactRegime contact;
  LocalFloor floor;
  // Gives body and contact what the floor has where the ball stands.
  void lay_floor();

  [[nodiscard]] bool driven() const { return driven_; }
  // Whether the motion of the masses is known to the end of the run.
  [[nodiscard]] bool known_ahead() const { return known_ahead_; }
  [[nodiscard]] std::size_t mass_count() const { return motors.size(); }
  // The place in the state where height and velocity of the geometric centre begin.
  [[nodiscard]] std::size_t contact_start() const { return contact_start_; }
  // The part of the state in use.
  [[nodiscard]] std::size_t size() const { return contact_start_ + (contact.regime == Regime::kRolling ? 0 : 4); }

  // The masses where the state (driven) or their motion (prescribed) has them. Driven masses leave acceleration at 0.
  [[nodiscard]] MassPoint mass_point(double time_s, const double* y) const;
  [[nodiscard]] CarriedMasses carried(const MassPoint& masses) const;

  void evaluate(double time_s, const double* y, Instant& motion) const;
  void evaluate_prescribed(double time_s, const double* y, const CarriedMasses& masses, Instant& motion) const {
    evaluate_prescribed(body, time_s, y, masses, motion);
  }
  // The same for another body, whose masses `masses` are. In a slide the slip stays this body's.
  void evaluate_prescribed(const Body& other, double time_s, const double* y, const CarriedMasses& masses,
                           Instant& motion) const;
  void derivative(double time_s, const double* y, double* dydt, Instant& motion) const;
  // The same derivative, where the motion is not wanted: `motion` is undefined.
  void derivative_alone(double time_s, const double* y, double* dydt, Instant& motion) const;

  // The equations with the contact force left open. The state has to hold the geometric centre's velocity, whatever the
  // regime.
  [[nodiscard]] OpenContact open_contact(double time_s, const double* y) const;
  // Velocity of the contact point; its third entry is the height's rate. Likewise.
  [[nodiscard]] Eigen::Vector3d slip_W_mps(const double* y) const;

  // The torques that the motors have to give, rotor inertia included, for the masses to move as `masses` says and the
  // ball as `motion` does. 0 for a mass on a trajectory.
  [[nodiscard]] PerMass needed_torques(const double* y, const MotionOf<double>& motion, const MassPoint& masses) const;

  // The robot for driven_lanes().
  [[nodiscard]] const LaneBody& lane_body() const { return lane_body_; }

 private:
  [[nodiscard]] Eigen::Vector3d velocity_W_mps(const double* y) const;
  [[nodiscard]] OpenContact open_contact_driven_at(double time_s, const double* y, const PerMass& force) const;
  void evaluate_open(const Body& of, const double* y, const OpenContact& open, Instant& motion) const;
  [[nodiscard]] PerMass holding_forces(const double* y) const;
  [[nodiscard]] bool evaluate_lanes(const double* y, Instant& motion) const;

  bool driven_, known_ahead_;
  std::size_t contact_start_;
  bool lanes_suit_;                            // the robot is one for driven_lanes()
  const DrivenLanes* driven_lanes_ = nullptr;  // null too while the floor is none for them
  LaneBody lane_body_;
};

// The equations and the state that the plant has reached.
struct Dynamics {
  explicit Dynamics(const PlantModel& model);

  // Sets derivative and motion of `now` by its state.
  void evaluate() { equations.derivative(time_s, now.y.data(), now.dydt.data(), now.motion); }
  [[nodiscard]] MassPoint masses() const { return equations.mass_point(time_s, now.y.data()); }
  [[nodiscard]] OpenContact open_contact() const { return equations.open_contact(time_s, now.y.data()); }
  [[nodiscard]] Eigen::Vector3d slip_W_mps() const { return equations.slip_W_mps(now.y.data()); }
  // Height and velocity of the geometric centre: part of the state in use outside rolling.
  [[nodiscard]] double* center() { return &now.y[equations.contact_start()]; }
  // Lays the floor that is under the ball in this state.
  void stand_at(const State& y);

  Equations equations;
  double time_s = 0;
  Point now{};  // where something jumps at time_s, the values after the jump
};

}  // namespace ballast::sim
