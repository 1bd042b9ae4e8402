// Checks the step pulses of all motors of a run against the motions of their masses (tools/stepcheck).
//
// The motions follow from the messages. A start runs the scenario's motion: the first start from the scenario's initial
// state, a later one at rest from the positions in the status. A stop or a move is known only by the positions and
// velocities that the status gives at every tick's start; its pulses are checked against the cubics between those
// (stepcheck::SampledMotion). Whether the plan itself keeps the limits and ends at its target is not checked here.
// Spacing, set-up and counts alone are checked of the pulses of a tracked motion and of a stop after a step overload,
// which may come late, and of a plan that the run does not follow to its end, from the last touch on.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "hal/lcm/messages.h"
#include "sim/scenario/scenario.h"
#include "tools/stepcheck/step_check.h"

namespace ballast::sil {

struct StepTimingRecord {
  std::vector<stepcheck::Statistics> motors;
  std::int64_t plan_steps = 0;                   // checked steps of stops and moves
  std::optional<std::int64_t> motion_left_tick;  // the first tick with pulses not of the scenario's motion
  std::optional<stepcheck::Violation> violation;
  int violation_motor = -1;
};

class StepTimingCheck {
 public:
  explicit StepTimingCheck(const sim::Scenario& scenario);
  StepTimingCheck(const StepTimingCheck&) = delete;
  StepTimingCheck& operator=(const StepTimingCheck&) = delete;

  // A lap's answer: its status and the steps for the tick after. False: record() holds a violation.
  bool observe(const controller_status_t& status, const step_command_t& steps);
  // Call after the last lap. False: as above.
  bool finish();
  [[nodiscard]] StepTimingRecord record() const;

 private:
  enum class Kind { kMotion, kPlan, kUnknown };
  // From the start of a tick to the start of the next stretch.
  struct Stretch {
    Kind kind;
    std::int64_t start_tick;
    bool followed = false;                       // the checks have been told
    std::vector<step_command_t> commands;        // not checked yet
    std::vector<stepcheck::MotionInSteps> what;  // per motor; of a plan: once it is known
    std::vector<controller_status_t> samples;    // of a plan: from the start tick on
    std::optional<std::int64_t> rests_tick;      // of a plan: the masses rest from the start of the next tick on
  };

  void begin(Kind kind, std::int64_t tick, const controller_status_t& status);
  [[nodiscard]] std::vector<stepcheck::MotionInSteps> motions(const controller_status_t* stand) const;
  [[nodiscard]] std::vector<stepcheck::MotionInSteps> sampled(const Stretch& plan) const;
  bool check(Stretch& stretch);
  bool check_command(const step_command_t& command);

  const sim::Scenario& scenario_;
  std::deque<stepcheck::MotorCheck> checks_;
  std::deque<Stretch> stretches_;  // two at most: a plan whose last tick is not known yet, and what comes after it
  std::int8_t mode_ = controller_status_t::MODE_DISARMED;
  bool started_ = false;  // a motion or a move has begun
  bool overloaded_ = false;
  StepTimingRecord record_;
  std::vector<stepcheck::Burst> bursts_;
};

}  // namespace ballast::sil
