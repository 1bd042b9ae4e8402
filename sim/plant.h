// The plant: the true ball, rolling, its masses prescribed or driven by steppers, integrated from one control tick to
// the next.
//
// Within a tick the integration stops at every instant at which a `motion` piece changes or a step pulse comes, so no
// step of the integrator crosses a jump. Between them it takes the whole way in one step of Dormand-Prince 5(4) unless
// the embedded error estimate asks for smaller ones; the quaternion is brought back to unit length after each.
// Accelerations may jump at those instants; the value after the jump counts (PHYSICS.md section 4).
//
// Extrema of N, f_s and f_s/N, and the first instant at which N <= 0 or f_s > mu_s N, are looked for inside every
// integrator step and found by integrating again from its start, so they are as accurate as the state itself.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "sim/dormand_prince.h"
#include "sim/motion.h"
#include "sim/newton_euler.h"
#include "sim/scenario.h"
#include "sim/stepper.h"

namespace ballast::sim {

// One pulse of a step input: `offset_s` after the start of the interval given to advance().
struct StepPulse {
  double offset_s;
  int motor;
  int direction;  // +1 or -1
};

enum class PhysicsEnd {
  kNone,          // the model goes on
  kSlipped,       // f_s > mu_s N
  kDetached,      // N <= 0
  kInconsistent,  // the state is not finite or cannot be continued
};

// A value and when it was taken.
struct Extremum {
  double value;
  double time_s;
};

struct ContactExtrema {
  Extremum mu_required_max;  // f_s / N; +infinity once N <= 0
  Extremum normal_force_min;
  Extremum normal_force_max;
  Extremum static_friction_max;
};

struct MotorExtrema {
  double max_torque_nm = 0;  // largest |torque| at the shaft (prescribed: needed, rotor inertia included)
  double torque_margin = 1;  // least part of the available torque left unused; below 0: more was needed than there is
};

class Plant {
 public:
  explicit Plant(const Scenario& scenario);

  // Integrates from time_s() to end_s >= time_s(), or to where the physics ends; after that it does nothing. `pulses`
  // are in order of time; prescribed runs ignore them.
  void advance(double end_s, std::span<const StepPulse> pulses);

  [[nodiscard]] double time_s() const { return time_s_; }
  [[nodiscard]] PhysicsEnd end() const { return end_; }
  [[nodiscard]] const std::string& end_text() const { return end_text_; }  // why it is inconsistent
  [[nodiscard]] const ContactExtrema& extrema() const { return extrema_; }
  [[nodiscard]] const MotorExtrema& motor_extrema(int i) const { return motor_extrema_[static_cast<std::size_t>(i)]; }

  // The state now. Where something jumps now, the value after the jump.
  struct Sample {
    double time_s;
    Eigen::Vector4d orientation;  // w, x, y, z
    Eigen::Vector3d angular_velocity_B_radps;
    Eigen::Vector3d position_W_m;
    Eigen::Vector3d velocity_W_mps;
    Eigen::Vector3d acceleration_B_mps2;  // of the geometric centre
    Eigen::Vector3d up_B;
    double normal_force_n;
    double static_friction_n;
    double normal_force_min_n;  // least, and greatest f_s / N, since advance() was last called
    double mu_required_max;
    Eigen::Vector2d friction_force_W_n;
    Eigen::Vector3d center_of_mass_B_m;
    std::array<double, kMaxMasses> mass_position{};
    std::array<double, kMaxMasses> mass_velocity{};
    std::array<Eigen::Vector3d, kMaxMasses> mass_position_B_m;
    std::array<double, kMaxMasses> motor_torque_nm{};
    std::array<std::int64_t, kMaxMasses> lost_steps{};
  };
  [[nodiscard]] Sample sample() const;

  // f_s / N as results and messages state it: +infinity where N <= 0.
  static double mu_required(double normal_force_n, double static_friction_n);

 private:
  // Layout of the integrator's state: q, Omega, z, then with driven masses theta and thetadot.
  static constexpr std::size_t kQ = 0, kOmega = 4, kZ = 7, kTheta = 9;
  using Integrator = DormandPrince<kTheta + 2 * kMaxMasses>;
  using State = Integrator::State;

  struct MassPoint {
    std::array<double, kMaxMasses> position, velocity, acceleration;  // acceleration: prescribed masses only
  };

  MassPoint mass_point(double time_s, const double* y) const;
  void evaluate(double time_s, const double* y, Motion& motion) const;
  void derivative(double time_s, const double* y, double* dydt);
  using PerMass = std::array<double, kMaxMasses>;
  // What the motors must give, rotor inertia included, for the masses to move as `motion` has them.
  PerMass needed_torques(const double* y, const Motion& motion, const MassPoint& masses) const;

  void after_jump();
  void integrate_to(double target_s);
  void take_step(double h);
  template <class Value>
  double find_peak(double h, double part, const Motion& middle, const Motion& end, double floor, Value value);
  bool violated(const Motion& motion) const;
  void set_end(const Motion& motion);
  Motion motion_inside(double h, double part);
  double first_violation(double h, double violated_part);
  void note(double time_s, const Motion& motion);
  void note_motors();

  Scenario scenario_;
  Body body_;
  bool driven_;
  std::size_t size_;  // of the state in use
  double static_friction_;
  std::vector<PrescribedMotion> motion_;
  std::vector<std::size_t> piece_;
  std::vector<Stepper> steppers_;

  double time_s_ = 0;
  State y_{};
  State dydt_{};         // at time_s_, after any jump
  Motion now_{};         // likewise
  PerMass torque_nm_{};  // of the motors' shafts, likewise
  Motion scratch_{};     // of the latest derivative()
  double step_s_;        // what the error estimate last allowed
  int steps_left_ = 0;   // of this call of advance()
  Integrator integrator_;
  Integrator probe_;  // for looking inside a step
  PhysicsEnd end_ = PhysicsEnd::kNone;
  std::string end_text_;
  ContactExtrema extrema_;
  double tick_normal_force_min_n_;  // since advance() was last called
  double tick_mu_required_max_;
  double noise_n_;  // forces closer than this are the same: rounding
  std::array<MotorExtrema, kMaxMasses> motor_extrema_{};
};

}  // namespace ballast::sim
