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
#include "sim/scenario.h"
#include "tools/monitor/monitor.h"
#include "tools/sil/lap.h"

namespace ballast::sil {

// One channel on its way to one who hears it. Counts what arrives and is no message.
template <class M>
class InjuredLink {
 public:
  InjuredLink(const sim::Scenario& scenario, const char* channel, std::optional<sim::FaultPeer> to);

  void send(const M& message, std::int64_t tick, double time_s);
  // What has arrived by this tick, in the order of arrival.
  [[nodiscard]] std::vector<M> arrive(std::int64_t tick);
  [[nodiscard]] std::int64_t malformed() const { return malformed_; }

 private:
  struct OnItsWay {
    std::int64_t due_tick;
    double order;
    std::vector<std::uint8_t> bytes;
  };
  [[nodiscard]] bool strikes(const sim::Fault& fault);

  std::vector<sim::Fault> faults_;
  std::uint64_t random_;
  std::vector<OnItsWay> on_its_way_;
  std::int64_t sent_ = 0;
  std::int64_t malformed_ = 0;
};

// Controller and monitor in this process: InProcessPeers, or FaultyPeers if the scenario needs them. Arguments as
// theirs; the scenario must outlive the peers.
std::unique_ptr<Peers> peers_in_process(const sim::Scenario& scenario, const firmware::ControllerParams* params,
                                        const monitor::MonitorLimits& limits, hal::Bus* operator_bus = nullptr);

class FaultyPeers : public Peers {
 public:
  // Whether a scenario has faults that take these peers; those of plant and sensors, and the full disk, do not.
  [[nodiscard]] static bool needed(const sim::Scenario& scenario);
  // Of a run that has its peers elsewhere, or is not a run: the first fault that cannot be had there, and why. Empty:
  // there is none. `where`: "with --processes".
  [[nodiscard]] static std::string not_possible(const sim::Scenario& scenario, const std::string& where);

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

  // What the monitor, and the controller, find in one tick.
  struct MonitorInbox {
    std::vector<contact_t> contact;
    std::vector<plant_state_t> state;
    std::vector<sensors_t> sensors;
    std::optional<std::int64_t> controller_tick;
    std::optional<monitor::Estimate> estimate;
  };
  struct ControllerInbox {
    std::int64_t tick;
    bool last;
    std::vector<sensors_t> sensors;
    std::vector<trip_t> verdicts;
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
  trip_t judge(const MonitorInbox& inbox);
  hal::Status ask_controller(Lap& lap, double time_s);
  hal::Status serve(const ControllerInbox& inbox, std::int64_t due_tick);
  hal::Status hear_operators(Lap& lap, ControllerInbox& inbox);
  void deliver_steps(Lap& lap);

  const sim::Scenario& scenario_;
  const firmware::ControllerParams* params_;
  monitor::MonitorLimits limits_;
  double before_s_ = -1;  // time of the tick before

  InjuredLink<contact_t> contact_to_monitor_;
  InjuredLink<plant_state_t> state_to_monitor_;
  InjuredLink<sensors_t> sensors_to_monitor_, sensors_to_controller_;
  InjuredLink<trip_t> trip_to_controller_;
  InjuredLink<controller_status_t> status_to_monitor_;
  InjuredLink<step_command_t> steps_to_plant_;

  monitor::Monitor monitor_;
  std::deque<MonitorInbox> monitor_inbox_;
  std::deque<Verdict> verdicts_;
  std::optional<std::int64_t> controller_tick_;  // of the newest status the monitor has been sent
  std::optional<monitor::Estimate> estimate_;    // in it

  hal::LockstepBoard board_;
  std::optional<hal::ControlLoop<hal::LockstepBoard>> controller_;
  std::deque<ControllerInbox> controller_inbox_;
  std::deque<Answer> answers_;
  std::int64_t newest_sensors_ = hal::kWaitingTick, newest_verdict_ = hal::kWaitingTick;

  hal::Bus* operator_bus_;
  hal::OperatorInbox operator_;
  hal::LinkCounters counters_;
  std::string trouble_ = "the controller did not answer";
  int exit_status_ = program::kExitCouldNotRun;
};

}  // namespace ballast::sil
