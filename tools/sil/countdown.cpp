#include "tools/sil/countdown.h"

namespace ballast::sil {

std::optional<operator_t> Countdown::command(std::int64_t tick) const {
  if (tick >= 0 || tick < -kTicks || (options_.by_hand && tick > -kTicks)) return std::nullopt;
  firmware::OperatorInput input = firmware::OperatorCommand::kArm;
  if (tick > -kTicks) input = firmware::OperatorCommand::kStart;
  if (tick > -kTicks && options_.move) input = *options_.move;
  return hal::to_message(input, tick, tick + kTicks + 1, period_s_);
}

bool Countdown::refuses(const Lap& lap) const {
  if (lap.tick() != -1 || arms(lap.tick()) || !lap.answer) return false;
  const controller_status_t& status = lap.answer->status;
  const bool tripped = lap.verdict && lap.verdict->tripped != 0;
  return status.refusal != controller_status_t::REFUSAL_NONE && !tripped && status.faults == 0;
}

bool Countdown::ignores_command(const Lap& lap) const {
  if (lap.tick() >= 0 || lap.tick() < -kTicks) return false;
  if (!lap.answer) return true;
  const controller_status_t& status = lap.answer->status;
  if (status.faults != 0 || (lap.verdict && lap.verdict->tripped != 0)) return false;
  if (arms(lap.tick())) return status.mode != controller_status_t::MODE_ARMED;
  return status.mode != (options_.move ? controller_status_t::MODE_PENDING : controller_status_t::MODE_RUNNING);
}

std::string Countdown::ignored_text(const Lap& lap) const {
  const char* command = arms(lap.tick()) ? "arm" : "start";
  if (lap.answer && lap.answer->status.refusal == controller_status_t::REFUSAL_NO_ESTIMATE) {
    return "the controller has no estimate of its attitude and does not obey the operator's " + std::string(command) +
           ": no sample before it could be used, because each was missing, not finite, or at the end of the gyro's or "
           "the accelerometer's range (sensors.gyro, sensors.accelerometer), or the tilt found is too uncertain";
  }
  return "the controller did not obey the operator's " + std::string(command);
}

}  // namespace ballast::sil
