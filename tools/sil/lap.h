// One lap of the data flow: everything that is said in one control tick.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "hal/lcm/bus.h"
#include "hal/lcm/operator_inbox.h"
#include "hal/status.h"
#include "tools/program/program.h"
#include "tools/sil/plant_messages.h"

namespace ballast::sil {

struct Lap {
  std::optional<operator_t> command;  // what the run itself says as operator in this tick
  std::vector<operator_t> heard;      // what people and tools on the bus said since the last
  PlantMessages plant;
  bool replayed = false;          // no monitor of today's is asked:
  std::optional<trip_t> verdict;  // in a replay: what the monitor said; none: nothing
  bool answered = false;          // in a replay: the controller answered this very tick
  trip_t trip{};
  bool has_controller = true;  // false in prescribed runs: the next two stay empty
  controller_status_t status{};
  step_command_t steps{};  // of the next tick

  // Peers made to suffer (faulty_peers.h). Who is silent has said nothing in this tick: trip, or status and steps, mean
  // nothing. Who is slow says now what belongs to an earlier tick.
  bool monitor_silent = false, controller_silent = false;
  bool steps_injured = false;               // on their way to the motors; then
  std::optional<step_command_t> delivered;  // is what came of them: of the next tick, or nothing

  std::function<void()> meanwhile = [] {};  // Peers::are_waited_for()
};

// What came over a bus and was not used.
struct RefusedMessages {
  hal::LinkCounters here;          // by this process
  std::int64_t by_controller = 0;  // by the controller, if it has a bus of its own
};

// Of peers that hear operators, and nobody else, on a bus; null: they do not.
inline RefusedMessages refused_operators(const hal::Bus* bus, const hal::OperatorInbox& inbox) {
  RefusedMessages refused{inbox.counters(), 0};
  if (bus == nullptr) return refused;
  refused.here.malformed = bus->malformed();
  refused.here.foreign = bus->foreign();
  return refused;
}

// Whoever answers the plant: monitor and controller, in this process or in others.
class Peers {
 public:
  virtual ~Peers() = default;
  // Until both are there and run the same scenario.
  virtual hal::Status connect() = 0;
  // Hands out command and plant, and fills in what was heard, trip, status and steps. In this process the controller is
  // given what was heard in this very tick; over LCM it hears it itself, in this tick or a neighbouring one.
  virtual hal::Status exchange(Lap& lap) = 0;
  // True: every exchange() that succeeds has called lap.meanwhile once, between having handed out and having heard; one
  // that fails, at most once. What the run does in there takes no time of its own.
  [[nodiscard]] virtual bool are_waited_for() const { return false; }
  // After a failure, the whole story in one line.
  [[nodiscard]] virtual std::string trouble() const = 0;
  [[nodiscard]] virtual RefusedMessages refused() const { return {}; }
  // And the program's exit status for it.
  [[nodiscard]] virtual int exit_status() const { return program::kExitCouldNotRun; }
};

}  // namespace ballast::sil
