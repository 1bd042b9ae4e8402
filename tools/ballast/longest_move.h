// The longest move that is made without --force.
#pragma once

namespace ballast {

// A run without --lcm records 2.4 MB a second at 1 kHz, so a longer move is probably a mistake.
inline constexpr double kLongestMove_s = 600;

}  // namespace ballast
