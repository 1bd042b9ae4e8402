// What the motors have been given, held against what the controller counts. A command that is lost on the way leaves
// no trace anywhere else: motors have no encoders, and the controller believes that its steps are made.
#pragma once

#include <ballast/step_command_t.hpp>
#include <cstdint>
#include <span>
#include <string>

#include "sim/plant/plant.h"

namespace ballast::sil {

class StepLedger {
 public:
  // The command whose pulses the motors are given next. Empty, or what is wrong with it: then it is not to be executed.
  // What is looked at is that it says of its pulses what they are, and that they come in order and inside their tick:
  // no others are ever made. `timer_ticks`: of a control period.
  [[nodiscard]] static std::string fault_of(const step_command_t& command, double timer_ticks);

  // Whether the motors are given the pulses that a command without fault speaks of: of each motor as many in each
  // direction, at times with the same sum, in order. By sums in closed form; which pulse is which is not looked at.
  [[nodiscard]] static bool gives(const step_command_t& command, double timer_frequency_hz,
                                  std::span<const sim::StepPulse> pulses);

  // Enters it. False: the controller counts other steps before this command than the motors have been given; text()
  // says which, of the first such command.
  bool enter(const step_command_t& command);

  [[nodiscard]] const std::string& text() const { return text_; }
  // Microsteps of a motor that the controller counts and the motor has not been given, as of the last command.
  [[nodiscard]] std::int64_t missing(std::size_t motor) const { return missing_[motor]; }

 private:
  std::int64_t given_[8]{};
  std::int64_t missing_[8]{};
  std::string text_;
};

}  // namespace ballast::sil
