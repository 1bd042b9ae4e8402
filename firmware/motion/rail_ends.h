// Where rails end.
#pragma once

#include "firmware/model/rolling.h"

namespace ballast::firmware {

// Lines end where the ball does or at their stops, open splines at their ends or their stops; no other rail has an end.
// What is beyond one by rounding is on the rail. `rail_coordinate` of mass `mass`, finite.
[[nodiscard]] bool on_rail(const BallParams& ball, int mass, Wide rail_coordinate);

}  // namespace ballast::firmware
