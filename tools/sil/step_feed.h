// Feeds the motors with the controller's step commands: takes the command of the next tick, holds it against what the
// controller counts, and expands it into pulses.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "hal/lcm/messages.h"
#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"
#include "tools/sil/step_ledger.h"

namespace ballast::sil {

// Consecutive step commands that may be lost. The next command's step count reveals the gap.
inline constexpr std::int64_t kAllowedMissedCommands = 1;

class StepFeed {
 public:
  // The scenario must outlive the feed.
  explicit StepFeed(const sim::Scenario& scenario) : run_(scenario.run) {}

  // Once per tick, with the command that has reached the motors for the next tick; null: none. Motors stand in a tick
  // without a good command of its own. Returns empty, or why the motors no longer do what the controller counts.
  std::string take(std::int64_t tick, const step_command_t* command);
  // After take(): the pulses of this tick, from the command taken in the tick before. False: they are not those of the
  // command, which is a fault of this program.
  bool expand();

  [[nodiscard]] std::span<const sim::StepPulse> pulses() const { return pulses_; }
  [[nodiscard]] std::int64_t missing_commands() const { return missing_commands_; }
  [[nodiscard]] std::int64_t undelivered_steps(std::size_t motor) const { return ledger_.missing(motor); }

 private:
  const sim::Scenario::Run& run_;
  StepLedger ledger_;
  step_command_t due_{}, next_{};  // of this tick and of the next
  std::vector<sim::StepPulse> pulses_;
  std::int64_t missing_commands_ = 0;
  std::int64_t consecutive_ = 0;  // of them
};

}  // namespace ballast::sil
