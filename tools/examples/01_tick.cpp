// 01: the controller by hand. It is a function that is called once per control tick: inputs in, step pulses out.
//
// Here the ball is held upright, the sensors are healthy, and the pulses go nowhere. The controller is armed, started,
// and runs its motion. Prints:
//   tick 0: running, N 11.772 N
//   at the end: running, mass at 0.2 rad, 102 pulses
#include <cstdio>
#include <memory>

#include "firmware/control/controller.h"
#include "one_mass.h"

using namespace ballast::firmware;

int main() {
  // Parameters and state are large, so they are not on the stack.
  const auto params = std::make_unique<ControllerParams>(one_mass());
  if (const ParamError error = validate(*params); !error.ok()) {
    std::printf("%s = %g; allowed: %s\n", error.field, error.value, error.allowed);
    return 1;
  }
  const auto state = std::make_unique<ControllerState>();
  reset(*params, *state);

  Inputs inputs;
  StepCommand steps;        // of the next tick
  ControllerStatus status;  // of this tick
  for (inputs.tick = -2; inputs.tick <= 2002; ++inputs.tick) {
    inputs.sensors.tick = inputs.tick;  // an upright ball at rest; another tick would make the sample old
    inputs.monitor.tick = inputs.tick;  // the monitor says: not tripped
    inputs.operator_command = inputs.tick == -2   ? OperatorCommand::kArm
                              : inputs.tick == -1 ? OperatorCommand::kStart
                                                  : OperatorCommand::kNone;

    tick(*params, *state, inputs, steps);  // steps.bursts are for the motor's timer
    predict(*params, *state);
    measure(*params, inputs, *state);
    report(*params, *state, inputs, status);

    if (inputs.tick == 0)
      std::printf("tick 0: %s, N %.3f N\n", status.mode == Mode::kRunning ? "running" : "not running",
                  static_cast<double>(status.predicted.normal_force_n));
  }
  std::printf("at the end: %s, mass at %.9g rad, %lld pulses\n",
              status.mode == Mode::kRunning ? "running" : "not running",
              static_cast<double>(status.commanded_position[0]), static_cast<long long>(steps.position_steps[0]));
  return status.faults == 0 ? 0 : 1;
}
