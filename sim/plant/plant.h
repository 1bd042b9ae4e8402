// The plant: the true ball, its masses prescribed or driven by steppers, integrated from one control tick to the next,
// through the contact regimes of tools/docs/physics.md, section 4: rolling, sliding, flight, with impacts between them.
//
// No step of an integrator crosses an instant at which a `motion` piece changes, a prescribed mass passes a knot of its
// spline rail, a trajectory or the table of the external force has a row, a step pulse comes, or an injected fault
// begins or ends. Accelerations may jump at those instants; the value after the jump counts (physics.md section 4).
// They jump too where the contact point crosses the border of a patch of the floor, which is located inside a step.
// Where a driven mass passes a knot, zeta''' jumps, and the error estimate shortens the step.
//
// Extrema of N, f_s and f_s/N, and the instants at which a regime ends, are located inside every step.
//
// A run ends where rolling ends (N <= 0, or f_s > mu_s N) if the scenario says on_violation = "stop", and goes on into
// sliding or flight if it says "continue". A run that starts sliding or in flight, which is no violation, goes through
// its regimes either way; "stop" then applies where rolling ends after that.
//
// The parts: equations.h (motion and forces in a regime), stepping.h (integrators), regimes.h (what follows what),
// extrema.h and motor_record.h (records), injected_faults.h.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sim/plant/injected_faults.h"
#include "sim/plant/plant_model.h"
#include "sim/plant/progress.h"
#include "sim/plant/regimes.h"
#include "sim/plant/stepping.h"

namespace ballast::sim {

// One pulse of a step input: `offset_s` after the start of the interval given to advance().
struct StepPulse {
  double offset_s;
  int motor;
  int direction;  // +1 or -1
};

class Plant {
 public:
  explicit Plant(const PlantModel& model);

  // Integrates from time_s() to end_s >= time_s(), or to where the physics ends; after that it does nothing. `pulses`
  // are in order of time; prescribed runs ignore them.
  void advance(double end_s, std::span<const StepPulse> pulses);

  // Ideal masses. Rail coordinates of all masses, their rates and those' rates.
  //
  // Puts the masses where they are commanded to be now: where lead_masses() led them, up to rounding, with
  // accelerations that may jump here.
  void place_masses(const double* position, const double* velocity, const double* acceleration);
  // Before advance(end_s): leads the masses to where they are commanded to be at end_s > time_s().
  void lead_masses(double end_s, const double* position, const double* velocity);

  [[nodiscard]] double time_s() const { return dynamics().time_s; }
  [[nodiscard]] PhysicsEnd end() const { return regimes_.end(); }
  [[nodiscard]] const std::string& end_text() const { return regimes_.end_text(); }  // why it is inconsistent
  [[nodiscard]] const std::vector<RegimeStart>& regimes() const { return regimes_.starts(); }
  [[nodiscard]] const std::vector<ImpactRecord>& impacts() const { return regimes_.impacts(); }
  // Rolling has ended, by slip or detachment, at least once. Ending a run counts too.
  [[nodiscard]] bool rolling_lost() const { return regimes_.rolling_lost(); }
  [[nodiscard]] const ContactExtrema& extrema() const { return run_.contact.extrema(); }
  // The parts that shell, masses and external force have in mu_required_max; none if it was not needed by rolling.
  [[nodiscard]] std::optional<ContactShares> shares_at_mu_required_max() const {
    return run_.contact.shares_at_mu_required_max(equations());
  }
  [[nodiscard]] const MotorExtrema& motor_extrema(int i) const { return run_.motors.extrema(index(i)); }
  // Stepper runs only.
  [[nodiscard]] MotorEnergy motor_energy(int i) const { return run_.motors.energy(index(i), dynamics()); }
  [[nodiscard]] double motor_steps_behind(int i) const;  // microsteps, of the true angle behind the commanded one
  [[nodiscard]] std::int64_t motor_slips(int i) const { return equations().motors.stepper(index(i)).slips(); }
  [[nodiscard]] const EndStopRecord& end_stop(int i) const { return run_.motors.end_stop(index(i)); }

  using Sample = sim::Sample;
  // The state now. Where something jumps now, the value after the jump.
  [[nodiscard]] Sample sample() const;

  // N and f_s for the ball's attitude, angular velocity and regime now, if the masses moved like this: rail
  // coordinates, their rates and those' rates. In sliding with the slip as it is, and NaN where such masses would leave
  // no N that balances it (Painleve's paradox); in flight 0. `forces` selects the external forces: all, or all but
  // force table and drag, which the controller is not told of.
  enum class Forces { kAll, kTold };
  struct ContactForces {
    double normal_force_n;
    double static_friction_n;
  };
  [[nodiscard]] ContactForces contact_forces(const double* position, const double* velocity, const double* acceleration,
                                             Forces forces = Forces::kAll) const;
  // The same under the told forces for another ball, other masses and another floor, as somebody believes them.
  [[nodiscard]] ContactForces contact_forces(const Body& believed, const double* position, const double* velocity,
                                             const double* acceleration) const;
  // The same under the told forces for a ball that rolls with another attitude (w, x, y, z, unit) and another angular
  // velocity, as somebody estimates them. `believed`: null stands for this plant's own ball.
  [[nodiscard]] ContactForces rolling_forces(const Body* believed, const double* orientation,
                                             const double* angular_velocity_B_radps, const double* position,
                                             const double* velocity, const double* acceleration) const;
  // Whether Forces::kTold differs from kAll.
  [[nodiscard]] bool has_untold_forces() const { return equations().body.external_force.has_untold(); }

 private:
  [[nodiscard]] static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  [[nodiscard]] Dynamics& dynamics() { return run_.dynamics; }
  [[nodiscard]] const Dynamics& dynamics() const { return run_.dynamics; }
  [[nodiscard]] Equations& equations() { return run_.dynamics.equations; }
  [[nodiscard]] const Equations& equations() const { return run_.dynamics.equations; }

  [[nodiscard]] bool execute_pulses(double start_s, std::span<const StepPulse>& pulses);
  void integrate_to(double target_s, double smooth_until_s);
  void end_by(Stepping::Failure failure);
  void take_span(const Span& span);
  [[nodiscard]] double stop_overdue_m(std::size_t i, const State& y) const;
  [[nodiscard]] bool stops_overdue(const State& y) const;
  [[nodiscard]] bool past_border(const State& y) const;
  [[nodiscard]] double find_border(double h, const Point& middle, const Point& end);
  void cross_border(const State& y);
  [[nodiscard]] bool event_at(const Point& point) const;
  [[nodiscard]] double find_event(double h, const Point& middle, const Point& end);
  void record_peaks(double h, const Point& middle, const Point& end);
  template <class Value>
  double find_peak(double h, const Instant& middle, const Instant& end, double floor, Value value);

  double ahead_s_;       // the motion of the masses is known up to here; 0: up to the end of advance()
  double border_m_ = 0;  // how far beyond a border of the floor the span being judged may go
  Progress run_;
  Regimes regimes_;
  Stepping stepping_;
  InjectedFaults faults_;
};

}  // namespace ballast::sim
