// A run on a floor that holds whatever the ball needs, which tells how much that is: for `ballast friction`.
#pragma once

#include <csignal>
#include <functional>
#include <string>

#include "tools/sil/run.h"

namespace ballast::sil {

struct FrictionRun {
  std::string refusal;     // not empty: the scenario cannot be examined, and the rest is not there
  sim::Scenario scenario;  // the one that was run, on perfect friction
  RunResult result{};
  std::string patches_text;  // a line about the scenario's own floor; empty if it has no patches
};

// Runs the scenario without its limits. `progress` is called now and then.
FrictionRun run_for_friction(sim::Scenario scenario, const volatile std::sig_atomic_t* interrupted,
                             std::function<void(double time_s, double end_s)> progress = {});

// The page that `ballast friction` prints, ending in a newline.
std::string friction_run_text(const FrictionRun& run);

}  // namespace ballast::sil
