#include "tools/sil/in_process_peers.h"

#include "hal/lcm/channels.h"

namespace ballast::sil {

InProcessPeers::InProcessPeers(const firmware::ControllerParams* params, const monitor::MonitorLimits& limits,
                               double control_period_s, hal::Bus* operator_bus)
    : control_period_s_(control_period_s), monitor_(limits), operator_bus_(operator_bus) {
  if (params != nullptr) controller_.emplace(*params, board_);
  if (operator_bus_ == nullptr) return;
  operator_bus_->subscribe<operator_t>(hal::kChannelOperator, [this](const operator_t& m) { operator_.hear(m); });
}

hal::Status InProcessPeers::exchange(Lap& lap) {
  lap.trip =
      lap.replayed
          ? *lap.verdict
          : monitor_.judge({&lap.plant.contact, &lap.plant.state, &lap.plant.sensors, controller_tick_, estimate_});
  if (!controller_) return hal::Status::kOk;

  // In the order of the log, by which a replay gives them.
  if (lap.command) {
    if (const hal::Status s = board_.give_operator(hal::from_message(*lap.command)); s != hal::Status::kOk) return s;
  }
  if (operator_bus_ != nullptr) {
    operator_.now(lap.plant.contact.tick);
    if (lap.command) operator_.know(*lap.command);
    const hal::Status s = operator_bus_->receive_until(hal::WallClock::now(), [] { return false; });
    if (s == hal::Status::kIo) return s;
    // One a tick, as the controller obeys them; the countdown is the run's own.
    const auto message = lap.plant.contact.tick < 0 ? std::nullopt : operator_.next();
    if (message) {
      lap.heard.push_back(*message);
      lap.heard.back().run_id = 0;
      if (const hal::Status given = board_.give_operator(hal::from_message(*message)); given != hal::Status::kOk)
        return given;
    }
  }
  board_.give_sensors(hal::from_message(lap.plant.sensors));
  board_.give_verdict(hal::from_message(lap.trip));
  board_.release_tick(lap.plant.sensors.tick, lap.plant.sensors.last != 0);
  if (const hal::Status s = controller_->step(); s != hal::Status::kOk) return s;

  firmware::ControllerStatus status;
  firmware::StepCommand steps;
  if (const hal::Status s = board_.take_status(status); s != hal::Status::kOk) return s;
  if (const hal::Status s = board_.take_steps(steps); s != hal::Status::kOk) return s;
  lap.status = hal::to_message(status, control_period_s_);
  lap.steps = hal::to_message(steps, control_period_s_);
  controller_tick_ = status.tick;
  estimate_ = {lap.status.normal_force_n, lap.status.static_friction_n};
  return hal::Status::kOk;
}

}  // namespace ballast::sil
