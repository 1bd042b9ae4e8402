// A scenario: one run of one robot on one floor, read from TOML and checked once. Format: sim/README.md; units
// consistent.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/model/rail.h"
#include "sim/scenario/fault.h"

namespace ballast::sim {

// What the controller can take, repeated here because a scenario knows only the firmware's model.
// tools/program/params.cpp asserts that the first two are the firmware's; the third is that of its validate().
inline constexpr int kMaxMotionPieces = 128;
inline constexpr int kMaxStepsPerControlPeriod = 64;   // per motor
inline constexpr double kMaxInitialMicrosteps = 1e15;  // of a mass from 0; below 2^53, so that they can be counted

// theta'' goes linearly from acceleration_start to acceleration_end over duration_s.
struct MotionPiece {
  double duration_s = 0;
  double acceleration_start = 0;
  double acceleration_end = 0;
};

// Hybrid stepper with current control, PHYSICS.md section 5. `shaft_ratio` turns rail units into motor angle: phi =
// shaft_ratio * theta. How the holding torque falls with speed follows from winding and supply (phase_current.h) where
// they are given, else from corner_speed.
struct Motor {
  int steps_per_revolution = 200;    // full steps, a multiple of 4; rotor teeth N_r = steps / 4
  int microsteps = 16;               // 1..256
  double gear_ratio = 1.0;           // motor turns per turn of a circle rail; circles only
  double travel_per_revolution = 0;  // m of rail per motor turn; lines and splines only
  double holding_torque_nm = 0;      // tau_hold at standstill, at the shaft
  double detent_torque_nm = 0;
  double rotor_inertia_kgm2 = 0;
  double viscous_damping_nms = 0;   // b
  double corner_speed_radps = 0;    // up to it tau_hold is there in full; above it falls as corner / speed, or, with a
                                    // winding, as its currents do (derived, then)
  double rated_current_a = 0;       // rms, per phase, both phases on; 0: no winding given, nor the three below
  double resistance_ohm = 0;        // per phase
  double inductance_h = 0;          // per phase
  double supply_voltage_v = 0;      // of the driver
  double step_error = 0.015;        // largest position error of a full step, as a part of the step angle
  double max_step_rate_hz = 0;      // microsteps per second the driver accepts
  double direction_setup_s = 2e-6;  // least time between two opposite pulses
  double max_acceleration = 0;      // rail unit / s^2, of the motion, moves and stops
  double max_jerk = 0;              // rail unit / s^3, likewise; in the motion's pieces, not where they meet
  double shaft_ratio = 0;           // derived: gear_ratio, or 2 pi / travel_per_revolution

  [[nodiscard]] bool has_winding() const { return rated_current_a > 0; }
};

// chi(t) itself, in place of a rail and a motion along it: the paper's section 3. Prescribed runs only.
struct Trajectory {
  std::vector<double> times_s;  // increasing; empty: none, the mass is on its rail
  std::vector<Eigen::Vector3d> points_B_m;
  bool periodic = false;  // the table repeats for ever; its last point is its first
};

// Spring and damper at the ends of a rail that has ends (firmware::Rail): sim/motors/end_stop.h.
struct EndStopMaterial {
  double stiffness_npm = 0;
  double restitution = 0.5;  // 0.01..1, of the mass and its rotor against a ball held fast
};

struct Mass {
  double mass_kg = 0;
  firmware::Rail rail;
  EndStopMaterial end_stops;  // where the rail has ends
  Trajectory trajectory;
  double initial_position = 0;  // rad or m; this and what follows: of a mass on its rail
  double initial_velocity = 0;
  std::vector<MotionPiece> motion;
  Motor motor;
};

enum class Actuation { kPrescribed, kStepper };
enum class OnViolation { kStop, kContinue };

struct Scenario {
  std::string name;
  double duration_s = 0;
  double gravity_mps2 = 0;

  // On the ball at its geometric centre, space frame: a constant force, or instead of it a table, linear between its
  // times and constant before and after them; and drag, -c |v| v, v the centre's velocity relative to the wind.
  Eigen::Vector3d external_force_W_n = Eigen::Vector3d::Zero();
  struct ForceTable {
    std::vector<double> times_s;  // increasing; empty: no table
    std::vector<Eigen::Vector3d> forces_W_n;
  } force_table;
  struct Drag {
    double coefficient_kgpm = 0;  // c: N at 1 m/s
    Eigen::Vector3d wind_W_mps = Eigen::Vector3d::Zero();
  } drag;

  struct Ball {
    double radius_m = 0;
    double mass_kg = 0;
    Eigen::Vector3d inertia_kgm2 = Eigen::Vector3d::Zero();        // principal, about m_0's own centre of mass
    Eigen::Vector3d center_of_mass_B_m = Eigen::Vector3d::Zero();  // from the geometric centre
  } ball;

  struct Surface {
    double static_friction = std::numeric_limits<double>::infinity();
    double kinetic_friction = std::numeric_limits<double>::infinity();  // default: = static
    double restitution = 0;
  } surface;

  std::vector<Mass> masses;  // 0..8

  struct Initial {
    Eigen::Quaterniond orientation{1, 0, 0, 0};
    Eigen::Vector3d angular_velocity_B_radps = Eigen::Vector3d::Zero();
    Eigen::Vector2d position_W_m = Eigen::Vector2d::Zero();
    bool has_velocity = false;  // false: the rolling velocity
    Eigen::Vector3d velocity_W_mps = Eigen::Vector3d::Zero();
    double height_m = 0;
  } initial;

  struct Run {
    Actuation actuation = Actuation::kStepper;
    double control_period_s = 0.001;
    double timer_frequency_hz = 1e7;  // step timer of the controller
    OnViolation on_violation = OnViolation::kStop;
  } run;

  struct Envelope {
    double min_normal_force_n = 0;
    double friction_use = 1.0;
  } envelope;

  std::vector<Fault> faults;  // what the run is made to suffer; in order of time, those of one time as written

  // A number somebody has printed for the scenario as it is in the file, to be stated beside what the run gives. Empty
  // if an override has changed the robot. Never used otherwise.
  struct Published {
    std::string quantity;  // "mu_required.max", "normal_force.min" or "end.time"
    double value = 0;
    std::string source;
  };
  std::vector<Published> published;

  std::uint64_t seed = 0;
  std::int64_t id = 0;  // fingerprint of everything above but `published`, equal for equal scenarios; never 0

  std::string toml;  // a scenario file that gives this very scenario, overrides applied, wherever it lies
};

// One fault found in a scenario.
struct ScenarioError {
  std::string source;   // file name, "--set" or "--fault"
  int line = 0;         // 0: not known (a missing key)
  std::string key;      // dotted, e.g. mass.2.rail.radius
  std::string value;    // as written; empty if the key is missing
  std::string message;  // what is wrong and what is allowed
};

// "file:line: key = value: message"
std::string to_string(const ScenarioError& error);

struct ScenarioResult {
  Scenario scenario;                  // meaningful only if errors is empty
  std::vector<ScenarioError> errors;  // every fault found
  [[nodiscard]] bool ok() const { return errors.empty(); }
};

// `overrides` are "dotted.key=value" of --set, applied before anything is checked; the value is TOML, or a bare string.
// `actuation` and `seed` from the command line are passed as overrides too ("run.actuation=...", "seed=...").
// `faults` are "KIND@TIME[:PARAM]" of --fault (read_fault.h), each one more [[fault]].
ScenarioResult read_scenario(const std::filesystem::path& file, const std::vector<std::string>& overrides = {},
                             const std::vector<std::string>& faults = {});
ScenarioResult parse_scenario(std::string_view toml, std::string_view source_name,
                              const std::vector<std::string>& overrides = {},
                              const std::vector<std::string>& faults = {});

// A path that exists, or the name of a scenario that ships (in `shipped_dir`, "NAME.toml"); empty if neither. A path
// that may not be looked at is given back: read_scenario() says why.
std::filesystem::path find_scenario(const std::string& name_or_path, const std::filesystem::path& shipped_dir);

}  // namespace ballast::sim
