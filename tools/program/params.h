// The parameters of firmware and monitor for a scenario.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "firmware/control/params.h"
#include "sim/scenario/scenario.h"
#include "tools/monitor/monitor.h"

namespace ballast::program {

// Sets the ball and its rails, which the paper's closed forms take. Returns nullopt, or the reason why the firmware
// cannot represent the world; `ball` is then unchanged.
[[nodiscard]] std::optional<std::string> to_ball_params(const sim::World& world, firmware::BallParams& ball);

// Sets the controller's parameters, as the scenario believes the robot, which firmware::validate() then accepts.
// Returns nullopt, or field, value and allowed range of what is refused; `params` is then unchanged.
[[nodiscard]] std::optional<std::string> to_controller_params(const sim::Scenario& scenario,
                                                              firmware::ControllerParams& params);

// The controller's parameters. Null: they are refused, and why is printed after `program_name`.
[[nodiscard]] std::unique_ptr<firmware::ControllerParams> make_controller_params(const char* program_name,
                                                                                 const sim::Scenario& scenario);

// The limits are those of the believed floor.
monitor::MonitorLimits to_monitor_limits(const sim::Scenario& scenario);

}  // namespace ballast::program
