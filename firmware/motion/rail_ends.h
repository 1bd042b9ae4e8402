// Ends of the rails.
#pragma once

#include "firmware/model/rolling.h"
#include "firmware/motion/profile.h"

namespace ballast::firmware {

// Whether a finite rail coordinate of mass `mass` lies on its rail, up to rounding. A line ends at the ball's surface
// or at its stops, an open spline at its ends or its stops. Other rails have no ends.
[[nodiscard]] bool on_rail(const BallParams& ball, int mass, Wide rail_coordinate);

// The rail coordinates of the ends. Infinite: no end. Both NaN: the line does not meet the ball.
struct RailEnds {
  Wide lower, upper;
};
[[nodiscard]] RailEnds rail_ends(const BallParams& ball, int mass);

// The first piece in which mass `mass` leaves its rail, and how far it goes there. The constant velocity after the last
// piece is not judged, because its duration is unknown here.
struct LeavesRail {
  int piece = -1;  // counted from 0; -1: none
  Wide position = 0;
};
[[nodiscard]] LeavesRail leaves_rail(const BallParams& ball, int mass, const Profile& profile);

}  // namespace ballast::firmware
