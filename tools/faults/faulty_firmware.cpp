#include "tools/faults/faulty_firmware.h"

#include <utility>

#include "tools/sil/host_firmware.h"

namespace ballast::sil {

using hal::Status;

FaultyFirmware::FaultyFirmware(const sim::Scenario& scenario, const firmware::ControllerParams& params,
                               FaultyMonitor* monitor)
    : scenario_(scenario),
      params_(params),
      monitor_(monitor),
      links_(scenario),
      faults_(scenario, sim::FaultPeer::kController) {
  loop_.emplace(params_, board_);
}

void FaultyFirmware::restart() {
  board_ = hal::LockstepBoard();
  loop_.emplace(params_, board_);
  links_.restart();
  inbox_.clear();
  answers_.clear();
}

Status FaultyFirmware::send(Lap& lap) {
  now_ = faults_.advance(fault_time_s(scenario_, lap.tick()));
  if (answers_now_) now_ = {.restarted = now_.restarted};
  if (now_.restarted) restart();
  Inbox inbox{lap.tick(), lap.plant.contact.last != 0,
              links_.deliver(lap.plant.sensors, lap.verdict ? &*lap.verdict : nullptr), lap.heard};
  if (lap.command) inbox.commands.push_back(*lap.command);
  inbox_.push_back(std::move(inbox));
  return Status::kOk;
}

Status FaultyFirmware::receive(Lap& lap) {
  const std::int64_t tick = lap.tick();
  if (now_.works()) {
    for (const Inbox& inbox : inbox_) {
      std::optional<Answer> answer;
      if (const Status s = serve_tick(inbox, answer); s != Status::kOk) return s;
      answers_.push_back({tick + now_.slow_ticks, *answer});
    }
    inbox_.clear();
  }
  for (; !now_.killed && !answers_.empty() && answers_.front().due_tick <= tick; answers_.pop_front()) {
    lap.answer = answers_.front().answer;
    if (monitor_ != nullptr) monitor_->hear_status(lap.answer->status, tick);
  }
  const std::int64_t late = overruns(fault_time_s(scenario_, tick));
  if (late == 0) return Status::kOk;
  trouble_ = "the firmware is late at tick " + std::to_string(tick) + ": its board has counted " +
             std::to_string(late) + " overruns";
  failure_ = PeerFailure::kLate;
  return Status::kIo;
}

Status FaultyFirmware::serve_tick(const Inbox& inbox, std::optional<Answer>& answer) {
  if (inbox.mail.sensors) board_.give_sensors(hal::from_message(*inbox.mail.sensors));
  if (inbox.mail.trip) board_.give_verdict(hal::from_message(*inbox.mail.trip));
  for (const operator_t& message : inbox.commands) {
    if (const Status s = board_.give_operator(hal::from_message(message)); s != Status::kOk) return s;
  }
  board_.release_tick(inbox.tick, inbox.last);
  return serve(*loop_, board_, scenario_.run.control_period_s, answer);
}

std::int64_t FaultyFirmware::overruns(double time_s) const {
  std::int64_t late = 0;
  for (const sim::Fault& fault : scenario_.faults) {
    if (fault.kind == sim::FaultKind::kControllerOverrun && fault.begun(time_s)) {
      late += static_cast<std::int64_t>(fault.value);
    }
  }
  return late;
}

}  // namespace ballast::sil
