// Random motions with a motor and a clock, for the step generator and the checker.
#pragma once

#include <random>
#include <vector>

#include "firmware/motion/step_generator.h"
#include "tools/stepcheck/step_check.h"

namespace ballast::stepcheck {

enum class Shape { kSCurves, kAtTheLimit, kCreep, kQuiver };
inline constexpr Shape kShapes[] = {Shape::kSCurves, Shape::kAtTheLimit, Shape::kCreep, Shape::kQuiver};
const char* to_string(Shape shape);

// Speeds up to the motor's step rate, which is at most 60 per control period and a quarter of the timer's frequency.
// S-curves: velocity to velocity with ramps of acceleration, reversals, pauses, pieces shorter than a tick. At the
// limit: stretches of constant speed at exactly the step rate. Creep: fractions of a step per second. Quiver: to and
// fro by a few microsteps or less, so that reversals lie close to the levels.
Drive random_drive(Shape shape, std::mt19937_64& random);

// The firmware on a drive, tick by tick.
class Generator {
 public:
  explicit Generator(const Drive& drive);
  // Pulses of the next tick; its bursts for the checker are then in bursts().
  firmware::StepError tick();
  [[nodiscard]] std::vector<Burst>& bursts() { return bursts_; }
  [[nodiscard]] const firmware::StepCommand& command() const { return command_; }
  [[nodiscard]] const firmware::StepTrouble& trouble() const { return trouble_; }
  [[nodiscard]] std::int64_t last_tick() const { return tick_; }  // made so far; -1: none
  [[nodiscard]] double end_s() const { return profile_.end_s(); }

 private:
  firmware::Profile profile_;
  const Drive& drive_;
  firmware::StepTiming timing_;
  firmware::StepCommand command_;
  firmware::StepTrouble trouble_;
  std::vector<Burst> bursts_;
  std::int64_t tick_ = -1;
};

}  // namespace ballast::stepcheck
