// The links to monitor, controller and motors, with the scenario's faults of messages and of the sensors' clock. Over a
// bus the messages themselves always travel whole, for the lockstep needs them; the faults act in the process of the
// receiver. So in one process and in three the same messages arrive in the same tick.
#pragma once

#include <cstdint>
#include <optional>

#include "hal/lcm/channels.h"
#include "hal/lcm/lcm_board.h"
#include "tools/faults/faulty_link.h"
#include "tools/faults/heard.h"

namespace ballast::sil {

// Whether a scenario has faults that act on these links.
[[nodiscard]] bool has_link_faults(const sim::Scenario& scenario);

// The scenario must outlive the links.
class MonitorLinks {
 public:
  explicit MonitorLinks(const sim::Scenario& scenario);

  // The controller's status of this tick. It arrives in the next.
  void send(const controller_status_t& status, std::int64_t tick);
  // Once per tick, with the plant's messages of that tick.
  Heard deliver(const contact_t& contact, const plant_state_t& state, const sensors_t& sensors);
  [[nodiscard]] hal::LinkCounters counters() const;

 private:
  const sim::Scenario& scenario_;
  FaultyLink<contact_t> contact_;
  FaultyLink<plant_state_t> state_;
  FaultyLink<sensors_t> sensors_;
  FaultyLink<controller_status_t> status_;
  std::optional<controller_status_t> newest_status_;
  hal::LinkCounters counters_;
};

class ControllerLinks {
 public:
  explicit ControllerLinks(const sim::Scenario& scenario);

  // Once per tick; `trip`: null if the monitor has not spoken. Drops messages that are not newer than the last, or
  // whose tick is still to come.
  hal::TickMail deliver(const sensors_t& sensors, const trip_t* trip);
  // For a controller that starts again: any message is new to it.
  void restart() { newest_sensors_ = newest_trip_ = hal::kWaitingTick; }
  [[nodiscard]] hal::LinkCounters counters() const;

 private:
  const sim::Scenario& scenario_;
  FaultyLink<sensors_t> sensors_;
  FaultyLink<trip_t> trip_;
  std::int64_t newest_sensors_ = hal::kWaitingTick, newest_trip_ = hal::kWaitingTick;
  hal::LinkCounters counters_;
};

class MotorLink {
 public:
  explicit MotorLink(const sim::Scenario& scenario);

  // Once per tick, with the command of that tick; null: none. Returns the command that arrives for the next tick. A
  // command of a tick that has begun is of no use to the motors.
  std::optional<step_command_t> deliver(std::int64_t tick, const step_command_t* steps);
  [[nodiscard]] hal::LinkCounters counters() const;

 private:
  const sim::Scenario& scenario_;
  FaultyLink<step_command_t> steps_;
  hal::LinkCounters counters_;
};

}  // namespace ballast::sil
