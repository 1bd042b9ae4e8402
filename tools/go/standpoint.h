// Where a course can begin: the robot at a tick that is still to come.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "hal/lcm/messages.h"
#include "sim/scenario/scenario.h"
#include "tools/go/course_parts.h"
#include "tools/tracking/reference.h"

namespace ballast::go {

// The newest messages of a run, and what its controller follows.
struct Heard {
  const sim::Scenario& scenario;  // of the run
  controller_status_t status{};
  plant_state_t plant{};
  std::optional<HostCourse> course;  // that the controller follows; none: the scenario's motion, or nothing
};

struct Standpoint {
  plan::ReferencePoint at;
  bool rests = false;  // it serves for every later tick, too
  bool hangs = false;  // the ball rests, under masses that stay where they are; it may turn about the vertical
};

// A ball whose geometric centre is slower counts as resting.
[[nodiscard]] double rest_speed_mps(const sim::Scenario& scenario);

// sqrt(g / r): a slower turn about the vertical is none.
inline constexpr double kHardlyTurns = 1e-3;

// The robot as the controller knows it: its estimate, or what is sensed (the plant's state), with the commanded masses.
[[nodiscard]] plan::ReferencePoint now(const Heard& heard);

// The ball is slower than what counts as rest. It may turn about the vertical.
[[nodiscard]] bool ball_rests(const Heard& heard);

// The ball is on its backup, or has lost the motion that the controller follows: it has to be halted before a course
// can begin.
[[nodiscard]] bool needs_halt(const Heard& heard);

// The robot at the start of `tick`, later than the newest status: on the motion that the controller follows, or rolled
// on under masses that hold. None, and `why`: it is not known.
[[nodiscard]] std::optional<Standpoint> standpoint_at(const Heard& heard, std::int64_t tick, std::string& why);

// The scenario as its controller believes it, set down at a standpoint, without motion, plan and faults.
[[nodiscard]] sim::Scenario set_down(const sim::Scenario& scenario, const plan::ReferencePoint& at);

// The scenario of a course: set down where it begins, with its motion.
[[nodiscard]] sim::Scenario scenario_of(const sim::Scenario& scenario, const HostCourse& course);

}  // namespace ballast::go
