// A run with firmware and steppers in this process, of which only the result is kept.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "tools/plan/write_plan.h"
#include "tools/sil/lap.h"
#include "tools/sil/run_result.h"

namespace ballast {

struct SteppedRun {
  std::optional<sil::RunResult> result;
  std::string refusal;  // without a result: why the firmware does not take the scenario, or what broke the run off
};

using Stop = std::function<bool()>;
using Observer = std::function<void(const sil::Lap&, const sim::Plant::Sample& truth)>;

// `stop` is asked before the run and at each tick; true interrupts it. `observe` is called once per tick.
[[nodiscard]] SteppedRun run_with_steppers(const sim::Scenario& scenario, const Stop& stop,
                                           const Observer& observe = {});

// The scenario on a floor of infinite friction and without a limit on N: the motion is rolled to its end, whatever it
// needs.
[[nodiscard]] sim::Scenario on_perfect_floor(const sim::Scenario& scenario);

[[nodiscard]] plan::StepperRun need_of(const sil::RunResult& result);

}  // namespace ballast
