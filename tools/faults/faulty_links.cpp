#include "tools/faults/faulty_links.h"

#include <algorithm>

namespace ballast::sil {
namespace {

using sim::FaultKind;
using sim::FaultPeer;

// Clears the fields that belong to a bus, so that a corrupted message loses the same bits as in one process.
template <class M>
M off_the_bus(M message) {
  message.run_id = 0;
  if constexpr (std::is_same_v<M, controller_status_t>) message.refused_messages = 0;
  return message;
}

// Stamps the message by a clock that may have jumped.
sensors_t stamped(const sim::Scenario& scenario, const sensors_t& sensors) {
  sensors_t message = off_the_bus(sensors);
  for (const sim::Fault& fault : scenario.faults) {
    if (fault.kind != FaultKind::kClockJump || !fault.begun(fault_time_s(scenario, sensors.tick))) continue;
    message.tick += static_cast<std::int64_t>(fault.value);
    message.utime = hal::tick_utime(message.tick, scenario.run.control_period_s);
  }
  return message;
}

// Removes messages of another scenario. Only a corrupted message is one.
template <class M>
void drop_foreign(std::vector<M>& messages, std::int64_t scenario_id, std::int64_t& foreign) {
  foreign += static_cast<std::int64_t>(
      std::erase_if(messages, [scenario_id](const M& message) { return message.scenario_id != scenario_id; }));
}

}  // namespace

bool has_link_faults(const sim::Scenario& scenario) {
  return std::ranges::any_of(scenario.faults, [](const sim::Fault& fault) {
    return fault.of(sim::FaultLayer::kMessage) || fault.kind == FaultKind::kClockJump;
  });
}

// --- monitor ---

MonitorLinks::MonitorLinks(const sim::Scenario& scenario)
    : scenario_(scenario),
      contact_(scenario, hal::kChannelContact, FaultPeer::kMonitor),
      state_(scenario, hal::kChannelPlantState, FaultPeer::kMonitor),
      sensors_(scenario, hal::kChannelSensors, FaultPeer::kMonitor),
      status_(scenario, hal::kChannelControllerStatus, FaultPeer::kMonitor) {}

void MonitorLinks::send(const controller_status_t& status, std::int64_t tick) {
  status_.send(off_the_bus(status), tick, fault_time_s(scenario_, tick));
}

Heard MonitorLinks::deliver(const contact_t& contact, const plant_state_t& state, const sensors_t& sensors) {
  const std::int64_t tick = contact.tick;
  const double time_s = fault_time_s(scenario_, tick);
  contact_.send(off_the_bus(contact), tick, time_s);
  state_.send(off_the_bus(state), tick, time_s);
  sensors_.send(stamped(scenario_, sensors), tick, time_s);
  Heard heard{contact_.arrive(tick), state_.arrive(tick), sensors_.arrive(tick), std::nullopt};
  drop_foreign(heard.sensors, scenario_.id, counters_.foreign);
  for (const controller_status_t& status : status_.arrive(tick - 1)) {
    if (status.scenario_id != scenario_.id) {
      ++counters_.foreign;
    } else if (status.tick > tick) {
      ++counters_.out_of_order;
    } else if (newest_status_ && status.tick == newest_status_->tick) {
      ++counters_.repeated;
    } else if (!newest_status_ || status.tick > newest_status_->tick) {
      newest_status_ = status;
    }
  }
  heard.status = newest_status_;
  return heard;
}

hal::LinkCounters MonitorLinks::counters() const {
  hal::LinkCounters all = counters_;
  all.malformed = contact_.malformed() + state_.malformed() + sensors_.malformed() + status_.malformed();
  return all;
}

// --- controller ---

ControllerLinks::ControllerLinks(const sim::Scenario& scenario)
    : scenario_(scenario),
      sensors_(scenario, hal::kChannelSensors, FaultPeer::kController),
      trip_(scenario, hal::kChannelTrip, FaultPeer::kController) {}

hal::TickMail ControllerLinks::deliver(const sensors_t& sensors, const trip_t* trip) {
  const std::int64_t tick = sensors.tick;
  const double time_s = fault_time_s(scenario_, tick);
  const sensors_t sent = stamped(scenario_, sensors);
  sensors_.send(sent, tick, time_s);
  if (trip != nullptr) trip_.send(off_the_bus(*trip), tick, time_s);
  hal::TickMail mail;
  // A tick still to come is a corrupted one. Taken for the newest, it would make every later message an old one.
  const auto take_newer = [&]<class M>(std::vector<M> messages, std::int64_t latest, std::int64_t& newest,
                                       std::optional<M>& slot) {
    drop_foreign(messages, scenario_.id, counters_.foreign);
    for (const M& message : messages) {
      if (message.tick > latest) {
        ++counters_.out_of_order;
      } else if (message.tick > newest) {
        newest = message.tick;
        slot = message;
      } else {
        ++(message.tick == newest ? counters_.repeated : counters_.old);
      }
    }
  };
  take_newer(sensors_.arrive(tick), sent.tick, newest_sensors_, mail.sensors);
  take_newer(trip_.arrive(tick), tick, newest_trip_, mail.trip);
  mail.refused = counters();
  return mail;
}

hal::LinkCounters ControllerLinks::counters() const {
  hal::LinkCounters all = counters_;
  all.malformed = sensors_.malformed() + trip_.malformed();
  return all;
}

// --- motors ---

MotorLink::MotorLink(const sim::Scenario& scenario)
    : scenario_(scenario), steps_(scenario, hal::kChannelStepCommand, std::nullopt) {}

std::optional<step_command_t> MotorLink::deliver(std::int64_t tick, const step_command_t* steps) {
  if (steps != nullptr) steps_.send(off_the_bus(*steps), tick, fault_time_s(scenario_, tick));
  std::optional<step_command_t> delivered;
  for (const step_command_t& command : steps_.arrive(tick)) {
    if (command.tick == tick + 1 && !delivered) {
      delivered = command;
    } else {
      ++(command.tick == tick + 1 ? counters_.repeated : counters_.old);
    }
  }
  return delivered;
}

hal::LinkCounters MotorLink::counters() const {
  hal::LinkCounters all = counters_;
  all.malformed = steps_.malformed();
  return all;
}

}  // namespace ballast::sil
