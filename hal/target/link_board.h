// hal::Board on a microcontroller: one exchange over the link per control tick. tools/docs/porting.md (Timing) says
// how the board's time and the world's go together.
#pragma once

#include "hal/board.h"
#include "hal/board_parts.h"
#include "hal/operator_queue.h"
#include "hal/target/link.h"

namespace ballast::hal::target {

template <Machine M>
class LinkBoard {
 public:
  LinkBoard(M& machine, Link<M>& link) : machine_(machine), link_(link) {}
  LinkBoard(const LinkBoard&) = delete;
  LinkBoard& operator=(const LinkBoard&) = delete;

  // Waits for the board's own tick, then for the world's message about it.
  Status wait_tick(std::int64_t& tick) {
    if (last_) return Status::kEnded;
    // A tick that has begun by now is late. If none has, the wait is for the first of those that begin during it.
    const bool late = machine_.tick_due();
    const std::uint32_t begun = machine_.wait_tick();
    if (order_.begun()) overruns_ += late ? begun : begun - 1;
    Frame frame;
    do {
      if (const Status s = link_.receive(frame); s != Status::kOk) return s;
      if (!decode(frame, world_) || frame.tick < -kFarthestTick || frame.tick > kFarthestTick) {
        ++counters_.malformed;
        return Status::kIo;
      }
    } while (!order_.is_next(frame.tick, counters_));
    order_.begin(frame.tick);
    last_ = world_.last;
    has_sensors_ = true;
    has_verdict_ = world_.has_verdict;
    for (std::size_t i = 0; i < static_cast<std::size_t>(world_.command_count); ++i) {
      const firmware::OperatorInput& command = world_.commands[i];
      const bool stop = command.command == firmware::OperatorCommand::kStop;
      static_cast<void>(commands_.push(command, stop));  // the queue counts a refusal
    }
    tick = frame.tick;
    counted_from_ = machine_.counter();
    return Status::kOk;
  }
  [[nodiscard]] std::int64_t overruns() const { return overruns_ + (machine_.tick_due() ? 1 : 0); }

  Status read_sensors(firmware::Sensors& sensors) { return hand_out(has_sensors_, world_.sensors, sensors); }
  Status read_verdict(firmware::MonitorVerdict& verdict) { return hand_out(has_verdict_, world_.verdict, verdict); }
  Status read_operator(firmware::OperatorInput& command) { return commands_.take(command); }

  Status write_steps(const firmware::StepCommand& steps) {
    machine_.load(steps);
    steps_ = steps;
    return Status::kOk;
  }
  Status write_status(const firmware::ControllerStatus& status) {
    const std::uint32_t tick_counts = machine_.counter() - counted_from_;
    machine_.played(played_);
    return link_.send(ReplyView(status, steps_, tick_counts, played_), order_.newest());
  }
  void kick_watchdog() {
    ++watchdog_kicks_;
    machine_.kick_watchdog();
  }

  [[nodiscard]] LinkCounters counters() const {
    LinkCounters counters = counters_;
    counters.dropped = commands_.dropped();
    return counters;
  }
  [[nodiscard]] std::int64_t watchdog_kicks() const { return watchdog_kicks_; }
  [[nodiscard]] std::int64_t tick() const { return order_.newest(); }

 private:
  M& machine_;
  Link<M>& link_;
  World world_;
  TickOrder order_;
  bool last_ = false;  // the newest tick is the last one
  std::int64_t overruns_ = 0;
  bool has_sensors_ = false, has_verdict_ = false;
  OperatorQueue<firmware::OperatorInput, kMaxCommands> commands_;
  std::uint32_t counted_from_ = 0;  // counter
  firmware::StepCommand steps_;
  PlayedPulses played_;
  LinkCounters counters_;
  std::int64_t watchdog_kicks_ = 0;
};

}  // namespace ballast::hal::target
