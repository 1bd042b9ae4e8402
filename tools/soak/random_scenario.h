// Robots, floors, motions and starts that nobody designed; everything comes from one seed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sim/scenario/scenario.h"
#include "tools/soak/random_faults.h"

namespace ballast::soak {

struct RandomScenario {
  sim::Scenario scenario;           // accepted by `ballast check`, and by the controller if there is one
  std::string toml;                 // a scenario file that gives it
  std::vector<RandomFault> faults;  // those that are in it
  int refused = 0;                  // drawn before it, and refused by the check, with reason
  std::string trouble;              // not empty: none was accepted, and this is why the last was not
};

// Between them, balls to hold in a hand and balls to sit in; 0 to 8 masses on circles, lines and splines; motors by
// default, by preset and too weak; motions from rest to rest and wild ones; smooth and rough floors; wide and narrow
// envelopes; starts at rest, rolling, sliding and in the air; control periods of 0.5 to 20 ms; runs of 0.2 to 2 s.
RandomScenario random_scenario(std::uint64_t seed);

// A robot that nothing happens to but one fault: from rest, masses on motors that carry them well and move all the
// while, gently and from rest to rest, on a rough floor.
RandomScenario calm_scenario(std::uint64_t seed, sim::FaultKind kind, int severity);

}  // namespace ballast::soak
