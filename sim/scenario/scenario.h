// A scenario: one run of one robot on one floor, read from TOML and checked once. Keys: tools/docs/scenario.md. Units
// are consistent.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/plant/plant_model.h"
#include "sim/scenario/fault.h"
#include "sim/sensors/sensor_model.h"

namespace ballast::sim {

// Limits of the controller, repeated here because sim/ uses the firmware's rails only. tools/program/params.cpp asserts
// that the first two are the firmware's; the third is that of its validate().
inline constexpr int kMaxMotionPieces = 128;
// Per motor, with so many masses: 32 bursts are shared by all, each has at least three pulses, a reversal costs two.
[[nodiscard]] constexpr int sure_steps_per_control_period(int masses) { return std::min(64, 3 * (32 / masses) - 2); }
inline constexpr int kCountdownTicks = 2;              // before t = 0, in which the controller is armed and started
inline constexpr double kMaxInitialMicrosteps = 1e15;  // of a mass from 0; below 2^53, so that they can be counted

struct Scenario : World {
  std::string name;
  double duration_s = 0;

  struct Run {
    Actuation actuation = Actuation::kStepper;
    double control_period_s = 0.001;
    double timer_frequency_hz = 1e7;  // step timer of the controller
    OnViolation on_violation = OnViolation::kStop;
    double tolerance = PlantModel{}.tolerance;
    double hold_s = 0;  // before t = 0, in which the ball is held still; a whole number of control periods

    [[nodiscard]] std::int64_t hold_ticks() const { return std::llround(hold_s / control_period_s); }
    // Ticks before t = 0 from which sensors count their samples: the hold, and at least the countdown.
    [[nodiscard]] std::int64_t lead_ticks() const { return std::max<std::int64_t>(kCountdownTicks, hold_ticks()); }
    // The run's first tick. Only a controller needs the countdown.
    [[nodiscard]] std::int64_t first_tick() const { return has_controller(actuation) ? -lead_ticks() : -hold_ticks(); }
  } run;

  struct Envelope {
    double min_normal_force_n = 0;
    double friction_use = 1.0;
  } envelope;

  SensorModel sensors;

  // The table [control].
  struct Control {
    bool tracking = false;       // feedback keeps the ball on the motion; default: true where there is a [plan]
    bool governor = false;       // commands are bent into the friction cone; default: as tracking
    double friction_use = 0.95;  // part of envelope.friction_use that the governor uses
    // Bounds within which the governor takes its beliefs for true, each of any sign.
    struct BeliefError {
      static constexpr double kMostMassShare = 0.5;
      double mass_share = 0;        // of each mass and each of the shell's moments of inertia, as a part of it
      double center_of_mass_m = 0;  // of each component of the shell's centre of mass
    } belief_error;
  } control;

  // The world that controller, monitor and planner take for true: [believed], or the floor without its patches, which
  // nobody is told of. None: they know the truth.
  std::optional<World> believed;
  bool belief_is_written = false;  // there is a [believed]
  [[nodiscard]] const World& belief() const { return believed ? *believed : *this; }

  std::vector<Fault> faults;  // injected into the run; in order of time, those of one time as written

  // A number printed for the scenario as it stands in the file; a run states it beside its own. Empty if an override
  // has changed the robot.
  struct Published {
    std::string quantity;  // "mu_required.max", "normal_force.min" or "end.time"
    double value = 0;
    std::string source;
  };
  std::vector<Published> published;

  // The table [plan] of a scenario that `ballast plan` wrote. Anything else in it is ignored.
  struct Plan {
    bool present = false;
    std::optional<Eigen::Vector2d> goal_W_m;  // a run ignores it; its summary does not
    std::optional<InitialState> start;        // attitude, rate and place that the plan begins with; none: `initial`
  } plan;

  std::uint64_t seed = 0;
  // Fingerprint of everything above but `published` and the plan's goal: equal for equal scenarios, never 0.
  std::int64_t id = 0;

  std::string toml;  // a scenario file that gives this scenario, with overrides applied, from any folder

  // The part that the plant takes. Implicit, so that a Plant is made from a scenario directly.
  operator PlantModel() const;  // NOLINT(google-explicit-constructor)
};

// The scenario in which what it believes is true.
[[nodiscard]] Scenario as_believed(Scenario scenario);

// One error found in a scenario.
struct ScenarioError {
  std::string source;   // file name, "--set", or "--fault" with its text
  int line = 0;         // 0: unknown (a missing key)
  std::string key;      // dotted, e.g. mass.2.rail.radius
  std::string value;    // as written; empty if the key is missing
  std::string message;  // what is wrong and what is allowed
};

// "file:line: key = value: message"
std::string to_string(const ScenarioError& error);

struct ScenarioResult {
  Scenario scenario;                  // valid only if `errors` is empty
  std::vector<ScenarioError> errors;  // all errors, in the order of the file
  // Values that are allowed and implausible (plausibility.h), if there are no errors.
  std::vector<ScenarioError> warnings;
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

// Finds a scenario by its path, or by its name in `shipped_dir` ("NAME.toml"). Empty if there is neither. A path that
// cannot be accessed is returned as it is; read_scenario() reports why.
std::filesystem::path find_scenario(const std::string& name_or_path, const std::filesystem::path& shipped_dir);

}  // namespace ballast::sim
