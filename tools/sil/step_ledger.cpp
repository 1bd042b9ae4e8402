#include "tools/sil/step_ledger.h"

namespace ballast::sil {

std::string StepLedger::fault_of(const step_command_t& command) {
  std::int64_t sum[8]{};
  for (int b = 0; b < command.burst_count; ++b) sum[command.motor[b]] += command.direction[b] * command.count[b];
  for (int i = 0; i < command.motor_count; ++i) {
    if (sum[i] == command.steps[i]) continue;
    return "the step command of tick " + std::to_string(command.tick) + " speaks of " +
           std::to_string(command.steps[i]) + " microsteps of motor " + std::to_string(i) + ", its pulses make " +
           std::to_string(sum[i]);
  }
  return "";
}

bool StepLedger::enter(const step_command_t& command) {
  bool agrees = true;
  for (int i = 0; i < command.motor_count; ++i) {
    const std::int64_t before = command.position_steps[i] - command.steps[i];
    const std::int64_t missing = before - given_[i];
    agrees = agrees && missing == missing_[i];
    if (missing != missing_[i] && text_.empty()) {
      text_ = "not all steps reach the motors: before tick " + std::to_string(command.tick) +
              " the controller counts motor " + std::to_string(i) + " at " + std::to_string(before) +
              " microsteps, and the motor has been given " + std::to_string(given_[i]);
    }
    missing_[i] = missing;
    given_[i] += command.steps[i];
  }
  return agrees;
}

}  // namespace ballast::sil
