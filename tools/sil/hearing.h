// What monitor, controller and motors hear of what is said, where the scenario's faults make messages or the sensors'
// clock suffer. In one process (faulty_peers.h) and over a bus the same is heard in the same tick: over a bus a message
// always travels, as it is, for the lockstep goes by it; it suffers in the process of its hearer.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "hal/lcm/channels.h"
#include "hal/lcm/lcm_board.h"
#include "tools/monitor/heard.h"
#include "tools/faults/injured_link.h"
#include "tools/sil/lap.h"

namespace ballast::sil {

// Whether a scenario's faults do anything here.
[[nodiscard]] bool messages_suffer(const sim::Scenario& scenario);

// The scenario must outlive them.
class MonitorHearing {
 public:
  explicit MonitorHearing(const sim::Scenario& scenario);

  // What the controller says in this tick; it is heard in the next.
  void tell(const controller_status_t& status, std::int64_t tick);
  // Once per tick, with what the plant says in it.
  monitor::Heard hear(const contact_t& contact, const plant_state_t& state, const sensors_t& sensors);
  [[nodiscard]] hal::LinkCounters counters() const;

 private:
  const sim::Scenario& scenario_;
  InjuredLink<contact_t> contact_;
  InjuredLink<plant_state_t> state_;
  InjuredLink<sensors_t> sensors_;
  InjuredLink<controller_status_t> status_;
  std::optional<std::int64_t> controller_tick_;  // of the newest status that has come
  std::optional<monitor::Estimate> estimate_;    // in it
  hal::LinkCounters counters_;
};

class ControllerHearing {
 public:
  explicit ControllerHearing(const sim::Scenario& scenario);

  // Once per tick; `trip`: null if the monitor says nothing. Nothing is heard that is not newer than what was.
  hal::Delivered hear(const sensors_t& sensors, const trip_t* trip);
  // A controller that starts again has heard nothing yet.
  void forget() { newest_sensors_ = newest_trip_ = hal::kWaitingTick; }
  [[nodiscard]] hal::LinkCounters counters() const;

 private:
  const sim::Scenario& scenario_;
  InjuredLink<sensors_t> sensors_;
  InjuredLink<trip_t> trip_;
  std::int64_t newest_sensors_ = hal::kWaitingTick, newest_trip_ = hal::kWaitingTick;
  hal::LinkCounters counters_;
};

// The motors take the command of the tick that comes; one of a tick that has begun is of no use to them.
class MotorHearing {
 public:
  explicit MotorHearing(const sim::Scenario& scenario);

  void tell(const step_command_t& steps, std::int64_t tick);
  // Once per tick: fills in steps_injured and delivered.
  void deliver(Lap& lap);
  [[nodiscard]] hal::LinkCounters counters() const;

 private:
  const sim::Scenario& scenario_;
  InjuredLink<step_command_t> steps_;
  hal::LinkCounters counters_;
};

}  // namespace ballast::sil
