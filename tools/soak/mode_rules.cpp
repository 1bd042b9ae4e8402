#include "tools/soak/mode_rules.h"

namespace ballast::soak {

namespace {

using Status = controller_status_t;

bool moves(std::int8_t mode) {
  return mode == Status::MODE_RUNNING || mode == Status::MODE_MOVING || mode == Status::MODE_HALTING;
}

// A stop, and the end of a stop in the same tick if the masses rest already.
bool may_stop(const ModeStep& step, bool stop) {
  if (step.now.mode == Status::MODE_STOPPING) return stop;
  return step.now.mode == Status::MODE_ARMED && step.now.at_rest != 0 &&
         (stop || step.before.mode == Status::MODE_MOVING);
}

bool follows(const ModeStep& step) {
  const std::int8_t before = step.before.mode, now = step.now.mode;
  if (before == now || now == Status::MODE_TRIPPED) return true;
  // Only a command that was obeyed counts.
  const bool obeyed = step.command && step.now.refusal == Status::REFUSAL_NONE;
  const auto told = [&](std::int8_t command) { return obeyed && step.command->command == command; };
  switch (before) {
    case Status::MODE_DISARMED:
      return now == Status::MODE_ARMED && told(operator_t::COMMAND_ARM);
    case Status::MODE_ARMED:
      return (now == Status::MODE_DISARMED && told(operator_t::COMMAND_STOP)) ||
             (now == Status::MODE_RUNNING && told(operator_t::COMMAND_START)) ||
             (now == Status::MODE_PENDING && (told(operator_t::COMMAND_MOVE) || step.before.course_coming != 0)) ||
             (now == Status::MODE_HALTING && told(operator_t::COMMAND_HALT));
    case Status::MODE_PENDING:
      if (now == Status::MODE_RUNNING) return step.now.course != 0 && step.now.course == step.before.course_coming;
      return now == Status::MODE_ARMED || now == Status::MODE_MOVING;
    case Status::MODE_RUNNING:
      return may_stop(step, told(operator_t::COMMAND_STOP)) ||
             (now == Status::MODE_HALTING && step.before.governed != 0 && told(operator_t::COMMAND_HALT));
    case Status::MODE_HALTING:  // once the ball rests, or cannot be halted, the masses are stopped
      return may_stop(step, true);
    case Status::MODE_MOVING:
      return may_stop(step, told(operator_t::COMMAND_STOP));
    case Status::MODE_STOPPING:
      return now == Status::MODE_ARMED && step.now.at_rest != 0;
    default:
      return false;
  }
}

// A reset releases a trip if the masses rest and nothing is wrong any more.
bool may_release(const ModeStep& step) {
  return step.now.mode == Status::MODE_DISARMED && step.command && step.command->command == operator_t::COMMAND_RESET &&
         step.now.refusal == Status::REFUSAL_NONE && step.now.at_rest != 0 && step.now.faults == 0 &&
         !step.monitor_tripped;
}

}  // namespace

ModeError judge(const ModeStep& step) {
  const std::int8_t before = step.before.mode, now = step.now.mode;
  if (before == Status::MODE_TRIPPED && now != Status::MODE_TRIPPED) {
    return may_release(step) ? ModeError::kNone : ModeError::kTripReleased;
  }
  const bool was_armed = before != Status::MODE_DISARMED && before != Status::MODE_TRIPPED;
  if (was_armed && step.now.faults != 0 && now != Status::MODE_TRIPPED) return ModeError::kFaultWithoutTrip;
  const bool stop = step.command && step.command->command == operator_t::COMMAND_STOP;
  if (stop && moves(before) && moves(now)) return ModeError::kStopIgnored;
  return follows(step) ? ModeError::kNone : ModeError::kNotCommanded;
}

const char* to_string(ModeError error) {
  switch (error) {
    case ModeError::kNone:
      return "as it should be";
    case ModeError::kFaultWithoutTrip:
      return "a fault does not trip it";
    case ModeError::kTripReleased:
      return "a trip is released without a reset at rest with its cause gone";
    case ModeError::kNotCommanded:
      return "nobody has commanded that";
    case ModeError::kStopIgnored:
      return "it ignores the operator's stop";
  }
  return "";
}

}  // namespace ballast::soak
