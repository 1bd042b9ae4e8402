// What the firmware and the monitor are told of a scenario.
#pragma once

#include <optional>
#include <string>

#include "firmware/control/controller.h"
#include "sim/scenario/scenario.h"
#include "tools/monitor/monitor.h"

namespace ballast::program {

// The ball with its rails, whatever moves the masses: what the paper's closed forms take. nullopt: `ball` is set;
// otherwise what the firmware has no words for, and `ball` is untouched.
[[nodiscard]] std::optional<std::string> to_ball_params(const sim::Scenario& scenario, firmware::BallParams& ball);

// Motor, rail and motion data as the firmware wants them. nullopt: `params` is set and firmware::validate() accepts it;
// otherwise what was refused, with field, value and allowed range, and `params` is untouched.
[[nodiscard]] std::optional<std::string> to_controller_params(const sim::Scenario& scenario,
                                                              firmware::ControllerParams& params);

monitor::MonitorLimits to_monitor_limits(const sim::Scenario& scenario);

}  // namespace ballast::program
