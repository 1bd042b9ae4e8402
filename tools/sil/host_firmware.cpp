#include "tools/sil/host_firmware.h"

namespace ballast::sil {

using hal::Status;

// Commands are given in the order of the log, which is the order of a replay.
Status HostFirmware::send(Lap& lap) {
  if (lap.command) {
    if (const Status s = board_.give_operator(hal::from_message(*lap.command)); s != Status::kOk) return s;
  }
  for (const operator_t& message : lap.heard) {
    if (const Status s = board_.give_operator(hal::from_message(message)); s != Status::kOk) return s;
  }
  board_.give_sensors(hal::from_message(lap.plant.sensors));
  if (lap.verdict) board_.give_verdict(hal::from_message(*lap.verdict));
  board_.release_tick(lap.plant.sensors.tick, lap.plant.sensors.last != 0);
  return Status::kOk;
}

Status HostFirmware::receive(Lap& lap) { return serve(loop_, board_, control_period_s_, lap.answer); }

Status serve(hal::ControlLoop<hal::LockstepBoard>& loop, hal::LockstepBoard& board, double control_period_s,
             std::optional<Answer>& answer) {
  if (const Status s = loop.step(); s != Status::kOk) return s;
  firmware::ControllerStatus status;
  firmware::StepCommand steps;
  if (const Status s = board.take_status(status); s != Status::kOk) return s;
  if (const Status s = board.take_steps(steps); s != Status::kOk) return s;
  answer = Answer{hal::to_message(status, control_period_s), hal::to_message(steps, control_period_s)};
  return Status::kOk;
}

}  // namespace ballast::sil
