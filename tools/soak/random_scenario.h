// Random robots, floors, motions and starts, all from one seed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sim/scenario/scenario.h"
#include "tools/soak/operator_script.h"
#include "tools/soak/random_faults.h"

namespace ballast::soak {

struct RandomScenario {
  sim::Scenario scenario;           // accepted by `ballast check`, and by the controller if there is one
  std::string toml;                 // a scenario file that gives it
  std::vector<RandomFault> faults;  // the faults in the scenario
  OperatorScript script;            // not part of the scenario file, which has it as comments
  int refused = 0;                  // number of scenarios drawn before it that the check refused
  std::string trouble;              // not empty: none was accepted; the reason for the last refusal
};

// Balls of 6 cm to 1.5 m; 0 to 8 masses on circles, lines and splines; default motors, presets and motors that are too
// weak; motions from rest to rest and violent ones; smooth and rough floors; wide and narrow envelopes; starts at rest,
// rolling, sliding and in the air; control periods of 0.5 to 20 ms; runs of 0.2 to 2 s.
RandomScenario random_scenario(std::uint64_t seed);

// A robot with one fault that completes its run without it: it starts at rest on a rough floor, and strong motors move
// its masses gently from rest to rest for the whole run.
RandomScenario calm_scenario(std::uint64_t seed, sim::FaultKind kind, int severity);

}  // namespace ballast::soak
