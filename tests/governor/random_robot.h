// Random robots, motions and floors under the governor: one per seed, from `paper_ball` or `desk_ball`.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "sim/scenario/scenario.h"

namespace ballast::governor_test {

// Parts of a robot that a seed draws. Leaving one out changes none of the others.
struct Part {
  const char* name;
  unsigned bit;
};
inline constexpr unsigned kTurn = 1, kSpin = 2, kCenter = 4, kShell = 8, kMasses = 16, kSlope = 32, kResistance = 64,
                          kBrakes = 128, kDetent = 256,
                          kFirstMotion = 512;  // and two more for masses 1 and 2
inline constexpr Part kParts[] = {
    {"turn", kTurn},                // the start is turned
    {"spin", kSpin},                // the ball turns at the start
    {"center", kCenter},            // the shell's centre of mass is moved
    {"shell", kShell},              // the shell is heavier or lighter
    {"masses", kMasses},            // so are the masses
    {"slope", kSlope},              // of a quarter of the floors, at most 2 degrees
    {"resistance", kResistance},    // rolling resistance of a quarter of the floors
    {"brakes", kBrakes},            // half of the motions come back to rest
    {"detent", kDetent},            // the motors' detent torque
    {"motion0", kFirstMotion},      // mass 0 moves
    {"motion1", 2 * kFirstMotion},  // mass 1
    {"motion2", 4 * kFirstMotion},  // mass 2
};

struct Draw {
  std::uint64_t seed = 0;
  bool steppers = false;
  // Bounds of what the controller believes: of every mass and moment of inertia as a part of it, and of each axis
  // of the shell's centre of mass as a part of the radius.
  double mass_error = 0;
  double center_error = 0;
  bool declared = false;    // these bounds are the scenario's control.belief_error
  double friction_use = 1;  // control.friction_use
  unsigned without = 0;     // parts left out
};

// A scenario that lasts 15 sqrt(r / g), with the governor on.
[[nodiscard]] sim::Scenario random_robot(const Draw& draw);

// "name,name"
[[nodiscard]] std::string to_string(unsigned parts);

}  // namespace ballast::governor_test
