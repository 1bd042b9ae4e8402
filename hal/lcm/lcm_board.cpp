#include "hal/lcm/lcm_board.h"

#include <fmt/core.h>

#include <algorithm>

#include "hal/lcm/channels.h"

namespace ballast::hal {
namespace {

constexpr std::chrono::milliseconds kWaitingPeriod{50};
constexpr std::size_t kMostEarly = 64;

}  // namespace

LcmBoard::LcmBoard(Bus& bus, const LcmBoardOptions& options) : bus_(bus), options_(options) {
  bus_.subscribe<sensors_t>(kChannelSensors, [this](const sensors_t& message) { on_sensors(message); });
  bus_.subscribe<trip_t>(kChannelTrip, [this](const trip_t& message) { on_trip(message); });
  bus_.subscribe<operator_t>(kChannelOperator, [this](const operator_t& message) { on_operator(message); });
}

void LcmBoard::join(std::int64_t run_id) {
  bus_.join(run_id);
  if (trip_ && trip_->run_id != run_id) {
    ++counters_.foreign;
    trip_.reset();
  }
  for (const operator_t& message : early_) on_operator(message);
  early_.clear();
}

template <class M>
void LcmBoard::accept(const M& message, std::optional<M>& mailbox) {
  if (mailbox && message.tick == mailbox->tick) {
    ++counters_.repeated;
  } else if (order_.is_next(message.tick, counters_)) {
    mailbox = message;
  }
}

void LcmBoard::on_sensors(const sensors_t& message) {
  if (message.run_id == 0) {
    ++counters_.foreign;
    return;
  }
  if (message.scenario_id != options_.scenario_id) {
    ++counters_.foreign;
    trouble_ = Status::kForeignScenario;
    peer_ = "plant";
    return;
  }
  accept(message, sensors_);
  if (sensors_) operator_.now(sensors_->tick);
  if (bus_.run_id() == 0) join(message.run_id);
}

void LcmBoard::on_trip(const trip_t& message) {
  const bool waits = message.tick == kWaitingTick;
  if (message.scenario_id != options_.scenario_id) {
    ++counters_.foreign;
    if (waits && message.run_id == 0 && order_.begun()) return;  // a monitor that waits for another run
    trouble_ = Status::kForeignScenario;
    peer_ = "monitor";
  } else if (message.run_id == 0) {
    if (!waits) ++counters_.foreign;
  } else if (!waits && !options_.verdicts_name_their_tick) {
    if (trip_) ++counters_.repeated;
    if (!trip_) trip_ = message;
  } else if (!waits) {
    accept(message, trip_);
  }
}

void LcmBoard::on_operator(const operator_t& message) {
  if (bus_.run_id() == 0) {
    // Nothing moves yet. When the list is full, the oldest command goes first, and stops go last.
    early_.push_back(message);
    if (early_.size() <= kMostEarly) return;
    const auto no_stop = [](const operator_t& m) { return m.command != operator_t::COMMAND_STOP; };
    const auto oldest = std::find_if(early_.begin(), early_.end(), no_stop);
    early_.erase(oldest == early_.end() ? early_.begin() : oldest);
    ++counters_.dropped;
  } else if (message.run_id != bus_.run_id()) {
    ++counters_.foreign;
  } else {
    operator_.hear(message);
  }
}

bool LcmBoard::complete() const {
  return sensors_ && trip_ && (!options_.verdicts_name_their_tick || sensors_->tick == trip_->tick);
}

Status LcmBoard::wait_tick(std::int64_t& tick) {
  if (ended_) return Status::kEnded;
  if (trouble_ != Status::kOk) return trouble_;
  if (order_.begun()) {
    sensors_.reset();
    trip_.reset();
  }

  const WallClock::time_point deadline =
      after(WallClock::now(), order_.begun() ? options_.peer_timeout : options_.start_timeout);
  const auto done = [this] { return complete() || trouble_ != Status::kOk; };
  Status status = Status::kEmpty;
  if (order_.begun()) {
    status = bus_.receive_until(deadline, done);
  } else {
    firmware::ControllerStatus waiting;
    waiting.tick = kWaitingTick;
    waiting.scenario_id = options_.scenario_id;
    do {
      trouble_ = write_status(waiting);
      if (trouble_ != Status::kOk) return trouble_;
      status = bus_.receive_until(std::min(deadline, WallClock::now() + kWaitingPeriod), done);
    } while (status == Status::kEmpty && WallClock::now() < deadline);
  }

  if (trouble_ != Status::kOk) return trouble_;
  if (status == Status::kEmpty) {
    peer_ = sensors_ ? "monitor" : "plant";
    status = Status::kPeerLost;
  }
  trouble_ = status;
  if (trouble_ != Status::kOk) return trouble_;

  if (const operator_t* next = operator_.peek(); next != nullptr && next->command == operator_t::COMMAND_RESET) {
    tripped_ = false;
  }
  mail_.sensors = sensors_;
  mail_.trip = trip_;
  order_.begin(sensors_->tick);
  ended_ = sensors_->last == 1;
  tick = order_.newest();
  return Status::kOk;
}

Status LcmBoard::read_sensors(firmware::Sensors& sensors) {
  if (!mail_.sensors) return Status::kEmpty;
  sensors = from_message(*mail_.sensors);
  mail_.sensors.reset();
  return Status::kOk;
}

Status LcmBoard::read_verdict(firmware::MonitorVerdict& verdict) {
  if (!mail_.trip) return Status::kEmpty;
  verdict = from_message(*mail_.trip);
  mail_.trip.reset();
  if (tripped_ && !verdict.tripped) ++counters_.taken_back;
  tripped_ = tripped_ || verdict.tripped;
  verdict.tripped = tripped_;
  return Status::kOk;
}

Status LcmBoard::read_operator(firmware::OperatorInput& command) {
  const std::optional<operator_t> message = operator_.next();
  if (!message) return Status::kEmpty;
  command = from_message(*message);
  return Status::kOk;
}

Status LcmBoard::write_steps(const firmware::StepCommand& steps) {
  return bus_.publish(kChannelStepCommand, to_message(steps, options_.control_period_s));
}

Status LcmBoard::write_status(const firmware::ControllerStatus& status) {
  controller_status_t message = to_message(status, options_.control_period_s);
  message.refused_messages = counters().refused();
  return bus_.publish(kChannelControllerStatus, message);
}

LinkCounters LcmBoard::counters() const {
  LinkCounters counters = counters_;
  counters.malformed += bus_.malformed();
  counters.foreign += bus_.foreign();
  counters.repeated += operator_.counters().repeated;
  counters.old += operator_.counters().old;
  counters.dropped += operator_.counters().dropped;
  counters += mail_.refused;
  return counters;
}

std::string LcmBoard::trouble() const {
  switch (trouble_) {
    case Status::kForeignScenario:
      return std::string(peer_) + " runs another scenario";
    case Status::kPeerLost: {
      const std::string when = order_.begun() ? fmt::format("after tick {}", order_.newest()) : "before the first tick";
      return fmt::format("lost {}: no {} for {:g} s {}", peer_, sensors_ ? "verdict" : "sensors",
                         (order_.begun() ? options_.peer_timeout : options_.start_timeout).count(), when);
    }
    case Status::kInterrupted:
      return "interrupted";
    case Status::kIo:
      return "the bus does not work";
    default:
      return "";
  }
}

}  // namespace ballast::hal
