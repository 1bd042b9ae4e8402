// The plant: the true ball, its masses prescribed or driven by steppers, integrated from one control tick to the next,
// through the contact regimes of PHYSICS.md section 4: rolling, sliding, flight, with impacts between them.
//
// No step of an integrator crosses an instant at which a `motion` piece changes, a prescribed mass passes a knot of its
// spline rail, a trajectory or the table of the external force has a row, or a step pulse comes. (Where a driven mass
// passes a knot, and zeta''' jumps, the error estimate sees to it.) Accelerations may jump at those instants; the value
// after the jump counts (PHYSICS.md section 4). Driven masses, and slides, are integrated from pulse to pulse and tick
// to tick with Dormand-Prince 5(4). Rolling and flying with prescribed masses are smooth and known in advance: DOP853
// steps ahead as far as its error estimate allows, whatever the ticks are, and what lies inside a step is seen by its
// dense output. Faults (fault.h) begin and end between two steps, as pulses come. The quaternion is brought back to
// unit length after each step.
//
// Extrema of N, f_s and f_s/N, and the instants at which a regime ends, are looked for between the ticks: inside every
// step, by integrating again from its start or by dense output.
//
// A run ends where rolling ends (N <= 0, or f_s > mu_s N) if the scenario says on_violation = "stop", and goes on into
// sliding or flight if it says "continue". A run that starts sliding or in flight, which is no violation, goes through
// its regimes either way, and "stop" means where rolling ends after that.
//
// Choices that section 4 leaves open:
//   - In an impact prescribed masses keep their rail velocity; driven ones yield along their rails with their rotors,
//     because the motors' forces are finite.
//   - An impact slower than 1e-6 sqrt(g r) leaves no normal velocity: bouncing ends.
//   - While a slip that has just begun is slower than 1e-6 sqrt(g r), its direction is taken from the contact's
//     accelerations (contact.h): the velocity's is rounding at first, and then so stiff that it is that one; one that
//     is about to vanish keeps its direction below 1e-3 of what the slip was as the integrator's step began, or 1e-12
//     sqrt(g r).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sim/plant/contact.h"
#include "sim/plant/contact_shares.h"
#include "sim/integrators/dop853.h"
#include "sim/integrators/dormand_prince.h"
#include "sim/motors/end_stop.h"
#include "sim/masses/motion.h"
#include "sim/plant/newton_euler.h"
#include "sim/scenario/scenario.h"
#include "sim/motors/stepper.h"

namespace ballast::sim {

// One pulse of a step input: `offset_s` after the start of the interval given to advance().
struct StepPulse {
  double offset_s;
  int motor;
  int direction;  // +1 or -1
};

enum class Regime { kRolling, kSliding, kFlight };

// A stretch of one regime; it ends where the next one starts, or where the run ends. Flight goes on through impacts
// that throw the ball up again.
struct RegimeStart {
  Regime regime;
  double time_s;
};

struct ImpactRecord {
  double time_s;
  double normal_impulse_ns;
  double friction_impulse_ns;  // its magnitude
  bool sticking;
};

enum class PhysicsEnd {
  kNone,          // the model goes on
  kSlipped,       // f_s > mu_s N, and the run was to stop there
  kDetached,      // N <= 0, likewise
  kInconsistent,  // the state is not finite or cannot be continued
};

// A value and when it was taken.
struct Extremum {
  double value;
  double time_s;
};

// Over the whole run; the very end of a slide, where the direction of the slip has no limit that a step could follow,
// is left out. In sliding f_s is the kinetic friction, so f_s / N is mu_k; in flight N = f_s = 0 and no friction is
// required. Impulses are not forces and do not count.
struct ContactExtrema {
  Extremum mu_required_max;  // f_s / N; +infinity once rolling would need N <= 0
  Extremum normal_force_min;
  Extremum normal_force_max;
  Extremum static_friction_max;
};

// Taken at the ends of ticks and of the integrator's steps, not located between them.
struct MotorExtrema {
  double max_torque_nm = 0;  // largest |torque| at the shaft (prescribed: needed, rotor inertia included)
  double torque_margin = 1;  // least part of the available torque left unused; below 0: more was needed than there is
};

// Of a stepper over the whole run, in J: what went in is what came out. Integrals over the integrator's steps by
// Simpson's rule. electrical = copper + friction + work + stored; without a winding electrical and copper are 0 and
// mean nothing.
struct MotorEnergy {
  double electrical_j = 0;  // through the terminals
  double copper_j = 0;      // heat of the winding
  double friction_j = 0;    // heat of the viscous damping
  double work_j = 0;        // on rotor, mass and ball
  double stored_j = 0;      // change of what the winding's field and the detent hold
};

// Of a driven mass at the ends of its rail. The touches are located; the rest is taken where the motors' torques are.
struct EndStopRecord {
  int touches = 0;         // times a stop began to push
  double first_s = -1;     // the first of them; before the start: none
  double max_force_n = 0;  // greatest push
  // A soft stop gives way further than the shell would, of which the model knows nothing.
  double outside_ball_m = 0;   // greatest distance of the mass outside the ball
  double outside_ball_s = -1;  // when it was first seen there
};

class Plant {
 public:
  explicit Plant(const Scenario& scenario);

  // Integrates from time_s() to end_s >= time_s(), or to where the physics ends; after that it does nothing. `pulses`
  // are in order of time; prescribed runs ignore them.
  void advance(double end_s, std::span<const StepPulse> pulses);

  [[nodiscard]] double time_s() const { return time_s_; }
  [[nodiscard]] PhysicsEnd end() const { return end_; }
  [[nodiscard]] const std::string& end_text() const { return end_text_; }             // why it is inconsistent
  [[nodiscard]] const std::vector<RegimeStart>& regimes() const { return regimes_; }  // neighbours differ
  [[nodiscard]] const std::vector<ImpactRecord>& impacts() const { return impacts_; }
  // Rolling has ended, by slip or detachment, at least once. Ending a run counts too.
  [[nodiscard]] bool rolling_lost() const { return rolling_lost_; }
  [[nodiscard]] const ContactExtrema& extrema() const { return extrema_; }
  [[nodiscard]] const MotorExtrema& motor_extrema(int i) const { return motor_extrema_[static_cast<std::size_t>(i)]; }
  // Stepper runs only.
  [[nodiscard]] MotorEnergy motor_energy(int i) const;
  [[nodiscard]] double motor_steps_behind(int i) const;  // microsteps, of the true angle behind the commanded one
  [[nodiscard]] std::int64_t motor_slips(int i) const { return steppers_[static_cast<std::size_t>(i)].slips(); }
  // Whose doing mu_required_max is; none if it was not needed by rolling.
  [[nodiscard]] std::optional<ContactShares> shares_at_mu_required_max() const;
  [[nodiscard]] const EndStopRecord& end_stop(int i) const { return end_stop_record_[static_cast<std::size_t>(i)]; }

  // The state now. Where something jumps now, the value after the jump.
  struct Sample {
    double time_s;
    Regime regime;  // sliding too where rolling ends by slip, and the run with it; N and f_s are then still rolling's
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
    std::array<double, kMaxMasses> mass_position{};  // of one on a trajectory: the time, its rate 1, its torque 0
    std::array<double, kMaxMasses> mass_velocity{};
    std::array<Eigen::Vector3d, kMaxMasses> mass_position_B_m;
    std::array<double, kMaxMasses> motor_torque_nm{};
    std::array<std::int64_t, kMaxMasses> lost_steps{};
    double floor_static_friction;  // of the floor under the ball: the scenario's, unless a fault has changed it
    std::array<int, kMaxMasses> end_switches{};  // bit 0: at or beyond the lower end of its rail, bit 1: the upper
  };
  [[nodiscard]] Sample sample() const;

  // N and f_s as the ball's attitude, angular velocity and regime now would have them if the masses moved like this:
  // rail coordinates, their rates and those' rates. (In sliding with the slip as it is, in flight 0.)
  struct ContactForces {
    double normal_force_n;
    double static_friction_n;
  };
  [[nodiscard]] ContactForces contact_forces(const double* position, const double* velocity,
                                             const double* acceleration) const;

  // N as results and messages state it: 0 where rolling on would need the floor to pull.
  static double pushed(double normal_force_n);
  // f_s / N as results and messages state it in contact: +infinity where N <= 0.
  static double mu_required(double normal_force_n, double static_friction_n);

 private:
  // Layout of the integrator's state: q, Omega, z, then with driven masses theta and thetadot, then, unless it rolls,
  // height and velocity of the geometric centre (space frame), from contact_size_ on.
  static constexpr std::size_t kQ = 0, kOmega = 4, kZ = 7, kTheta = 9;
  static constexpr std::size_t kCapacity = kTheta + 2 * std::size_t{kMaxMasses} + 4;
  using State = std::array<double, kCapacity>;

  // The equations' answer, and what else decides whether a regime goes on: the slip velocity along the direction of the
  // slip while it slides, the height in flight. Rolling sets neither.
  struct Instant : Motion {
    double left = 0;
    double climb_mps = 0;  // flight: the height's rate
  };

  struct MassPoint {
    std::array<double, kMaxMasses> position, velocity, acceleration;  // acceleration: prescribed masses only
  };

  using PerMass = std::array<double, kMaxMasses>;
  MassPoint mass_point(double time_s, const double* y) const { return mass_point(time_s, y, piece_.data()); }
  MassPoint mass_point(double time_s, const double* y, const std::size_t* piece) const;
  CarriedMasses carried(const MassPoint& masses) const;
  // Of motors and end stops.
  PerMass rail_forces(const MassPoint& masses) const;
  // Of what holds a mass beside its motor: end stop and blocked rail.
  [[nodiscard]] double held_n(std::size_t i, double position, double velocity) const;
  bool begin_and_end_faults();
  void suffer_active_faults();
  // Whether the stops that push are others than stop_side_ says.
  [[nodiscard]] double overdue_m(std::size_t i, const State& y) const;
  [[nodiscard]] bool stops_overdue(const State& y) const;
  void touch_stops();
  void evaluate(double time_s, const double* y, Instant& motion) const;
  void evaluate_prescribed(double time_s, const double* y, const CarriedMasses& masses, Instant& motion) const;
  void evaluate_open(const double* y, const OpenContact& open, Instant& motion) const;
  OpenContact open_contact_at(double time_s, const double* y, const MassPoint& masses,
                              const PerMass& motor_force) const;
  // At the state reached, whatever the regime.
  OpenContact open_contact_now() const;
  Eigen::Vector3d velocity_W_mps(const double* y) const;
  Eigen::Vector3d slip_W_mps(const double* y) const;  // of the contact point; third entry: the height's rate
  void derivative(double time_s, const double* y, double* dydt);
  // What the motors must give, rotor inertia included, for the masses to move as `motion` has them.
  PerMass needed_torques(const double* y, const MotionOf<double>& motion, const MassPoint& masses) const;

  void start_regime();
  void after_jump();
  void aim_slip();
  // The state at one instant and what the equations make of it.
  struct Point {
    State y, dydt;
    Instant motion;
  };
  void integrate_to(double target_s);
  template <class Method>
  double try_step(Method& method, double longest_s);
  void look_inside(double offset_s, Point& out);
  void look_at_span(double h, bool to_step_end, Point& middle, Point& end);
  void take_span(double h, bool exactly, double end_s);
  [[nodiscard]] bool steps_ahead() const;
  static void normalise(State& y);
  template <class Value>
  double find_peak(double h, const Instant& middle, const Instant& end, double floor, Value value);
  bool violated(const Instant& motion) const;
  double ratio(const Instant& motion) const;
  void note(double time_s, const State& y, const Instant& motion);
  void note_mu(double time_s, const State& y, const Instant& motion);
  void note_motors();
  void note_energy(double h, const Point& middle, const Point& end);
  struct StoredEnergy {
    double winding_j = 0, detent_j = 0;
  };
  [[nodiscard]] StoredEnergy stored_energy(std::size_t i, const MassPoint& masses) const;

  // Where a regime has ended, at time_s_: what comes next.
  void leave_regime();
  void enter(Regime regime);
  void land();
  void touch(const Eigen::Vector2d& slip_W_mps);  // in contact, neither leaving nor arriving
  void end_inconsistent(std::string text);

  Scenario scenario_;
  Body body_;
  bool driven_;
  std::size_t contact_size_;  // of the rolling state
  std::size_t size_;          // of the state in use
  double static_friction_;
  double kinetic_friction_;
  double speed_scale_mps_;  // sqrt(g r), g or what the external force amounts to
  std::vector<PrescribedMotion> motion_;
  std::vector<std::size_t> piece_;
  std::vector<Stepper> steppers_;
  std::array<EndStops, kMaxMasses> end_stops_{};  // of driven masses
  std::vector<std::size_t> with_stops_;           // those that have some
  std::array<int, kMaxMasses> stop_side_{};       // the stop that pushes, EndStops

  // An instant at which a fault of motors, floor or ball begins or ends.
  struct FaultEdge {
    double time_s;
    std::size_t fault;  // of scenario_.faults
    bool begins;
  };
  std::vector<FaultEdge> fault_edges_;  // in order of time
  std::size_t next_edge_ = 0;           // the first that is still to come
  std::vector<char> suffered_;          // per fault of the scenario: now
  // A blocked rail: a spring and its critical damper about where the mass was.
  struct Block {
    bool on = false;
    double position = 0;
    double stiffness = 0, damping = 0;  // N per rail unit, and per its rate
  };
  std::array<Block, kMaxMasses> blocks_{};
  Eigen::Vector3d push_W_n_ = Eigen::Vector3d::Zero();

  double time_s_ = 0;
  State y_{};
  State dydt_{};         // at time_s_, after any jump
  Instant now_{};        // likewise
  PerMass torque_nm_{};  // of the motors' shafts, likewise
  Instant scratch_{};    // of the latest derivative()
  double step_s_;        // what the error estimate last allowed
  int steps_left_ = 0;   // of this call of advance()
  // From where the latest step began. pulsed_ goes no further than is judged at once, and is looked into by integrating
  // again (probe_); ahead_ goes further, and is looked into by dense output.
  State step_y_{};
  State step_dydt_{};
  DormandPrince<kCapacity> pulsed_;
  DormandPrince<kCapacity> probe_;
  Dop853<kCapacity> ahead_;
  double ahead_start_s_ = 0;
  double ahead_end_s_ = -1;    // before time_s_: no step reaches beyond it
  double smooth_until_s_ = 0;  // where the next kink of motion or force is
  Regime regime_ = Regime::kRolling;
  Eigen::Vector2d slip_direction_W_{1, 0};  // sliding: as the step began
  double slip_kept_mps_ = 0;                // slower than that, and the direction stays as the step began
  bool slip_begins_ = false;                // sliding: too slow yet for a direction of its own
  std::vector<RegimeStart> regimes_;
  std::vector<ImpactRecord> impacts_;
  bool rolling_lost_ = false;
  double last_change_s_ = -1;
  int changes_here_ = 0;
  PhysicsEnd end_ = PhysicsEnd::kNone;
  std::string end_text_;
  ContactExtrema extrema_;
  // What held at mu_required_max, as little as everything else follows from.
  struct {
    Regime regime = Regime::kFlight;
    State y{};
    Eigen::Vector3d push_W_n = Eigen::Vector3d::Zero();
    PerMass mass_acceleration{};                  // driven
    std::array<std::size_t, kMaxMasses> piece{};  // prescribed
  } at_mu_max_;
  double tick_normal_force_min_n_;  // since advance() was last called
  double tick_mu_required_max_;
  double noise_n_;  // forces closer than this are the same: rounding
  std::array<MotorExtrema, kMaxMasses> motor_extrema_{};
  std::array<MotorEnergy, kMaxMasses> motor_energy_{};  // but for what is stored
  std::array<StoredEnergy, kMaxMasses> stored_at_start_{};
  std::array<EndStopRecord, kMaxMasses> end_stop_record_{};
};

}  // namespace ballast::sim
