// Controller and monitor in this process, made to suffer by the scenario's faults of messages, peers, clock and time:
// what in_process_peers.h does, over channels that lose, delay, double, reorder and injure messages, with peers that
// die, freeze, start again or are slow.
//
// Here time goes on whoever is silent, as it does for a robot: the controller's board has a timer of its own, and the
// motors of a tick without a step command stand. Who hears a channel takes what is new to it and counts the rest; bytes
// are judged as on a bus (hal/lcm/messages.h). All of it follows from the scenario and its seed and from what was said,
// so that the log, which has what each had to say before any harm came to it, can be replayed.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/control_loop.h"
#include "hal/lcm/bus.h"
#include "hal/lcm/operator_inbox.h"
#include "hal/lockstep/lockstep_board.h"
#include "sim/scenario/scenario.h"
#include "tools/monitor/heard.h"
#include "tools/sil/hearing.h"
#include "tools/sil/lap.h"

namespace ballast::sil {

// Controller and monitor in this process: InProcessPeers, or FaultyPeers if the scenario needs them. Arguments as
// theirs; the scenario must outlive the peers.
std::unique_ptr<Peers> peers_in_process(const sim::Scenario& scenario, const firmware::ControllerParams* params,
                                        const monitor::MonitorLimits& limits, hal::Bus* operator_bus = nullptr);

class FaultyPeers : public Peers {
 public:
  // Whether a scenario has faults that take these peers; those of plant and sensors, and the full disk, do not.
  [[nodiscard]] static bool needed(const sim::Scenario& scenario);
  // Of a run that has its peers elsewhere: the first fault that cannot be had there, and why. Empty: there is none.
  // `where`: "with --processes".
  enum class Elsewhere {
    kProcesses,        // started by who can kill them: all but overruns
    kProcessesByHand,  // messages and the clock only
    kNothing,
  };
  [[nodiscard]] static std::string not_possible(const sim::Scenario& scenario, Elsewhere elsewhere,
                                                const std::string& where);

  // As InProcessPeers. The scenario must outlive the peers.
  FaultyPeers(const sim::Scenario& scenario, const firmware::ControllerParams* params,
              const monitor::MonitorLimits& limits, hal::Bus* operator_bus = nullptr);

  hal::Status connect() override { return hal::Status::kOk; }
  hal::Status exchange(Lap& lap) override;
  [[nodiscard]] RefusedMessages refused() const override;
  [[nodiscard]] std::string trouble() const override { return trouble_; }
  [[nodiscard]] int exit_status() const override { return exit_status_; }

 private:
  // What a peer suffers in one tick.
  struct Suffered {
    bool killed = false, frozen = false, restarted = false;
    std::int64_t slow_ticks = 0;
  };
  [[nodiscard]] Suffered suffered(sim::FaultPeer peer, double time_s, double before_s) const;

  // What the controller finds in one tick.
  struct ControllerInbox {
    std::int64_t tick;
    bool last;
    hal::Delivered heard;
    std::vector<operator_t> commands;
  };
  struct Answer {
    std::int64_t due_tick;
    controller_status_t status;
    step_command_t steps;
  };
  struct Verdict {
    std::int64_t due_tick;
    trip_t trip;
  };
  void ask_monitor(Lap& lap, double time_s);
  hal::Status ask_controller(Lap& lap, double time_s);
  hal::Status serve(const ControllerInbox& inbox, std::int64_t due_tick);
  hal::Status hear_operators(Lap& lap, ControllerInbox& inbox);

  const sim::Scenario& scenario_;
  const firmware::ControllerParams* params_;
  monitor::MonitorLimits limits_;
  double before_s_ = -1;  // time of the tick before

  MonitorHearing monitor_hearing_;
  ControllerHearing controller_hearing_;
  MotorHearing motor_hearing_;

  monitor::Monitor monitor_;
  std::deque<monitor::Heard> monitor_inbox_;
  std::deque<Verdict> verdicts_;

  hal::LockstepBoard board_;
  std::optional<hal::ControlLoop<hal::LockstepBoard>> controller_;
  std::deque<ControllerInbox> controller_inbox_;
  std::deque<Answer> answers_;

  hal::Bus* operator_bus_;
  hal::OperatorInbox operator_;
  std::string trouble_ = "the controller did not answer";
  int exit_status_ = program::kExitCouldNotRun;
};

}  // namespace ballast::sil
