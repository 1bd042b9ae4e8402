// Where rails end.
#pragma once

#include "firmware/model/rolling.h"
#include "firmware/motion/profile.h"

namespace ballast::firmware {

// Lines end where the ball does or at their stops, open splines at their ends or their stops; no other rail has an end.
// A position beyond an end by rounding is on the rail. `rail_coordinate` of mass `mass`, finite.
[[nodiscard]] bool on_rail(const BallParams& ball, int mass, Wide rail_coordinate);

// The rail coordinates of those ends; infinite where there is none, and where the line does not meet the ball both NaN.
struct RailEnds {
  Wide lower, upper;
};
[[nodiscard]] RailEnds rail_ends(const BallParams& ball, int mass);

// The first piece in which mass `mass` leaves its rail, and how far it goes there. What follows the last piece is not
// looked at: how long it lasts is not known.
struct LeavesRail {
  int piece = -1;  // counted from 0; -1: none
  Wide position = 0;
};
[[nodiscard]] LeavesRail leaves_rail(const BallParams& ball, int mass, const Profile& profile);

}  // namespace ballast::firmware
