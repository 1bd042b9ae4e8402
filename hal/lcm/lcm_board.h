// The board of a controller in a process of its own. Plant, monitor and operator are on an LCM bus.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "hal/board.h"
#include "hal/board_parts.h"
#include "hal/lcm/bus.h"
#include "hal/lcm/operator_inbox.h"

namespace ballast::hal {

// The messages of a tick that the firmware has not read yet.
struct TickMail {
  std::optional<sensors_t> sensors;
  std::optional<trip_t> trip;
  LinkCounters refused{};  // since the start, by a handler of the mail before the board
};

struct LcmBoardOptions {
  std::int64_t scenario_id = 0;
  double control_period_s = 0;
  Seconds start_timeout{30};  // until the first complete tick
  Seconds peer_timeout{2};    // from one tick to the next
  // False: a verdict answers the sensors before it, whatever tick it names.
  bool verdicts_name_their_tick = true;
};

// A tick k is due when sensors(k) and trip(k) have both arrived. The first tick may have any number. After it, messages
// of any other tick than the next are counted and ignored. The first sensors of this scenario determine the run, which
// the bus joins (bus.h). Messages without a run are never used.
//
// A verdict that takes back a trip, as of a restarted monitor, is counted and used as if it did not, until an operator
// commands a reset; the firmware then judges whether it may be obeyed. Before the first tick the board publishes a
// controller_status_t with tick = kWaitingTick every 50 ms, so that the plant can begin. The bus must outlive the
// board.
class LcmBoard {
 public:
  LcmBoard(Bus& bus, const LcmBoardOptions& options);
  LcmBoard(const LcmBoard&) = delete;
  LcmBoard& operator=(const LcmBoard&) = delete;

  Status wait_tick(std::int64_t& tick);
  [[nodiscard]] std::int64_t overruns() const { return 0; }  // in lockstep the world waits
  Status read_sensors(firmware::Sensors& sensors);
  Status read_verdict(firmware::MonitorVerdict& verdict);
  Status read_operator(firmware::OperatorInput& command);
  Status write_steps(const firmware::StepCommand& steps);
  Status write_status(const firmware::ControllerStatus& status);
  void kick_watchdog() { ++watchdog_kicks_; }

  [[nodiscard]] LinkCounters counters() const;
  [[nodiscard]] std::int64_t watchdog_kicks() const { return watchdog_kicks_; }

  // After kPeerLost or kForeignScenario: the peer ("plant" or "monitor"), and the reason in one line.
  [[nodiscard]] const char* peer() const { return peer_; }
  [[nodiscard]] std::string trouble() const;

 protected:
  // Between wait_tick() and the reads of its tick, a subclass may change the mail.
  [[nodiscard]] TickMail& mail() { return mail_; }

 private:
  void on_sensors(const sensors_t& message);
  void on_trip(const trip_t& message);
  void on_operator(const operator_t& message);
  void join(std::int64_t run_id);
  template <class M>
  void accept(const M& message, std::optional<M>& mailbox);
  [[nodiscard]] bool complete() const;

  Bus& bus_;
  LcmBoardOptions options_;

  TickOrder order_;  // of the ticks served
  bool ended_ = false;
  std::optional<sensors_t> sensors_;  // of the tick waited for
  std::optional<trip_t> trip_;
  TickMail mail_;
  bool tripped_ = false;  // by a verdict of this run, without a reset since
  OperatorInbox operator_;
  std::deque<operator_t> early_;  // commands received before the run was known

  LinkCounters counters_;
  std::int64_t watchdog_kicks_ = 0;
  Status trouble_ = Status::kOk;
  const char* peer_ = "";
};

static_assert(Board<LcmBoard>);

}  // namespace ballast::hal
