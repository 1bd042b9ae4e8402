// Rules that the true ball and its true masses set for the plant's messages and for the controller that gets them.
// Written from the .lcm files and physics.md, without the code of plant and firmware.
#pragma once

#include <cstddef>
#include <string>

#include "hal/lcm/messages.h"
#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"

namespace ballast::soak {

// The bits of sensors_t::limit_switch that mass i has to have: bit 0 at or beyond the lower end of its rail, bit 1 at
// or beyond the upper.
[[nodiscard]] int switches_due(const sim::Scenario& scenario, const sim::Plant::Sample& truth, std::size_t i);

// Whether a mass closes the switch at an end of its rail and is commanded on over that end.
[[nodiscard]] bool driven_over_an_end(const sensors_t& sensors, const controller_status_t& status);

// Why the ball is not in the regime that the message says; empty: it is. Rolling moves the geometric centre by
// v = omega x r, the floor gives no more friction than it has, and none in flight. The last message of a run is
// compared with the plant's regime alone: its forces may be those that ended the run.
[[nodiscard]] std::string regime_error(const sim::Scenario& scenario, const contact_t& contact,
                                       const sim::Plant::Sample& truth);

}  // namespace ballast::soak
