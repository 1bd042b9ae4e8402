// Step pulses to the motor drivers.
#pragma once

#include <concepts>

#include "firmware/motion/step_command.h"
#include "hal/status.h"

namespace ballast::hal {

// write_steps(steps): hands over the pulses of control tick `steps.tick`, the one after the tick being served.
template <class B>
concept StepOutput = requires(B& board, const firmware::StepCommand& steps) {
  { board.write_steps(steps) } -> std::same_as<Status>;
};

}  // namespace ballast::hal
