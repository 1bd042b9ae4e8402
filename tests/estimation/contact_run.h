// Runs with the true contact force, recorded tick by tick as the robot sees them, and the meters over them. No monitor
// looks on, so that a ball that slides goes on with its motion.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "firmware/estimation/measured_contact.h"
#include "firmware/estimation/measured_masses.h"
#include "sim/scenario/scenario.h"

namespace ballast::test {

struct ContactTick {
  firmware::Sensors sensors;
  firmware::MassMotion commanded;  // at the start of the tick
  firmware::PerMass<double> mass_position{};
  Eigen::Quaterniond orientation;
  double normal_force_n = 0;
  double static_friction_n = 0;
  double slip_mps = 0;  // speed of the contact point; 0 where it rolls
  int regime = 0;       // contact_t::REGIME_
};

struct ContactRun {
  firmware::BallParams ball;
  firmware::EstimationParams params;
  double control_period_s = 0;
  std::vector<ContactTick> ticks;
};

// Runs the scenario sim/scenarios/NAME.toml in this process, as `ballast run --set .. --fault ..` does.
ContactRun record_contact(const std::string& name, const std::vector<std::string>& overrides,
                          const std::vector<std::string>& faults = {});
ContactRun record_contact(const sim::Scenario& scenario);

// The robot's measurements of a tick.
struct MeasuredTick {
  const ContactTick& truth;
  const firmware::Estimate& estimate;
  const firmware::MassMotion& masses;
  const firmware::ContactMeter& meter;
  const firmware::MeasuredContact& measured;
};

// Runs filter and meters over a run. `disturb` may change what the sensors say in a tick; null: nothing does.
void measure(const ContactRun& run, const std::function<void(const MeasuredTick&)>& look,
             const std::function<void(std::int64_t tick, firmware::Sensors&)>& disturb = {});

// Errors of the measured f_s/N from tick 0 on, where the floor presses.
struct FrictionErrors {
  static constexpr std::array<double, 7> kEdges_hz{0, 10, 20, 40, 80, 160, 500};
  double rms = 0, most = 0;
  std::array<double, 6> band_rms{};  // between the edges; their squares add up to that of rms
  double inside = 0;                 // share of the ticks within 1.96 sigma of the truth at the sample's tick
  double inside_now = 0;             // the same of the truth at the tick in which the measurement is known
  double true_most = 0;              // greatest true f_s/N
};
FrictionErrors friction_errors(const ContactRun& run);

// Slides of a run, and what became of them.
struct SlideCount {
  int slides = 0;                                        // longer than 100 ms, in which the slip passes 0.05 m/s
  int in_time = 0;                                       // of them flagged by 100 ms later
  bool false_flag = false;                               // a flag before the first slide
  double score = 0;                                      // greatest ContactMeter::slip_score before it
  double slowest_missed_s = 0, quickest_missed_s = 1e9;  // of slides missed: time to 0.05 m/s
};
SlideCount count_slides(const ContactRun& run);

// By how much the robot that runs may be off the believed one, uniform within these.
struct BeliefErrors {
  double mass = 0;                // of each mass and moment of inertia, the shell's included: parts of it
  double center_of_mass = 0;      // of the shell, each axis, in parts of the radius
  double rolling_resistance = 0;  // from 0 up; the floor is believed not to resist
  [[nodiscard]] bool none() const { return mass == 0 && center_of_mass == 0 && rolling_resistance == 0; }
};

// A kind of runs.
struct DeskBall {
  bool falls = false;    // the friction falls at a random time to 0.001 to 0.012; the run ends within 4 s of that
  bool excited = false;  // the motion is one that `ballast identify --excite` tries
  bool tracked = false;  // feedback follows the motion, and the governor bends it
  BeliefErrors errors = {};
};

// desk_ball with its motion's accelerations between 0.6 and 1.2 of the scenario's, drawn from the seed, and calibrated
// BMI088. A tracked run that does not fall has an estimated attitude, and ends where the controller flags a slip.
ContactRun random_desk_ball(std::uint64_t seed, const DeskBall& kind);

}  // namespace ballast::test
