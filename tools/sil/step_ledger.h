// Compares the steps that the motors have been given with the controller's count. A command lost on the way leaves no
// other trace: motors have no encoders, and the controller takes its steps as made.
#pragma once

#include <ballast/step_command_t.hpp>
#include <cstdint>
#include <span>
#include <string>

#include "sim/plant/plant.h"

namespace ballast::sil {

class StepLedger {
 public:
  // Returns an error unless the command's counts match its pulses, and these are in order and inside their tick. A
  // command with an error must not be executed. `timer_ticks`: in a control period.
  [[nodiscard]] static std::string fault_of(const step_command_t& command, double timer_ticks);

  // Whether `pulses` are those of a command without error: in order, and per motor and direction as many, with the same
  // sum of times. Compares sums in closed form, not single pulses.
  [[nodiscard]] static bool gives(const step_command_t& command, double timer_frequency_hz,
                                  std::span<const sim::StepPulse> pulses);

  // Enters a command. False: before it the controller counts other steps than the motors have been given. text() then
  // names the first such command.
  bool enter(const step_command_t& command);

  [[nodiscard]] const std::string& text() const { return text_; }
  // Microsteps that the controller counts and the motor has not been given, as of the last command.
  [[nodiscard]] std::int64_t missing(std::size_t motor) const { return missing_[motor]; }

 private:
  std::int64_t given_[8]{};
  std::int64_t missing_[8]{};
  std::string text_;
};

}  // namespace ballast::sil
