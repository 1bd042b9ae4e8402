#include "tools/sil/step_feed.h"

#include <fmt/format.h>

#include "tools/sil/plant_messages.h"

namespace ballast::sil {

std::string StepFeed::take(std::int64_t tick, const step_command_t* command) {
  due_ = next_;
  const bool on_time = command != nullptr && command->tick == tick + 1;
  std::string wrong =
      command == nullptr ? "" : StepLedger::fault_of(*command, run_.control_period_s * run_.timer_frequency_hz);
  if (on_time && wrong.empty()) {
    consecutive_ = 0;
    next_ = *command;
    return ledger_.enter(next_) ? "" : ledger_.text();
  }
  ++missing_commands_;
  next_ = step_command_t{};
  if (!wrong.empty()) return wrong;
  ++consecutive_;
  if (consecutive_ <= kAllowedMissedCommands) return "";
  return fmt::format("no step command has reached the motors for {} ticks at tick {}", consecutive_, tick);
}

bool StepFeed::expand() {
  sil::expand(due_, run_.timer_frequency_hz, pulses_);
  return StepLedger::gives(due_, run_.timer_frequency_hz, pulses_);
}

}  // namespace ballast::sil
