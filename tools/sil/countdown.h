// The last ticks before t = 0 of a run with a controller: the ball is held at its initial state, the run arms and
// starts the controller as its operator, and the controller computes the steps of tick 0. The scenario's `hold` may
// begin before them; the countdown gives no command there.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "sim/scenario/scenario.h"
#include "tools/sil/lap.h"
#include "tools/sil/run_options.h"

namespace ballast::sil {

class Countdown {
 public:
  static constexpr std::int64_t kTicks = sim::kCountdownTicks;

  Countdown(const RunOptions& options, double period_s) : options_(options), period_s_(period_s) {}

  // The run's command in this tick. None before the countdown and after it; by hand only arm.
  [[nodiscard]] std::optional<operator_t> command(std::int64_t tick) const;
  // Whether the controller has refused the move or the start in this lap.
  [[nodiscard]] bool refuses(const Lap& lap) const;
  // Whether the controller has ignored the command of this lap. A trip or a fault excuses it.
  [[nodiscard]] bool ignores_command(const Lap& lap) const;
  // The reason, for a command that was ignored in this lap.
  [[nodiscard]] std::string ignored_text(const Lap& lap) const;

 private:
  [[nodiscard]] bool arms(std::int64_t tick) const { return tick == -kTicks || options_.by_hand; }

  const RunOptions& options_;
  double period_s_;
};

}  // namespace ballast::sil
