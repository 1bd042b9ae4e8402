// hal::Board on a microcontroller: one exchange over the link per control tick. See hal/README.md for how the board's
// time and the world's go together.
#pragma once

#include "hal/board.h"
#include "hal/operator_queue.h"
#include "hal/target/link.h"

namespace ballast::hal::target {

template <Machine M>
class LinkBoard {
 public:
  LinkBoard(M& machine, Link<M>& link) : machine_(machine), link_(link) {}
  LinkBoard(const LinkBoard&) = delete;
  LinkBoard& operator=(const LinkBoard&) = delete;

  // First the board's own tick, then the world's message about it.
  Status wait_tick(std::int64_t& tick) {
    if (last_) return Status::kEnded;
    // Of the ticks that have begun by now none was waited for; of those that begin while it waits all but one are late.
    const bool late = machine_.tick_due();
    const std::uint32_t begun = machine_.wait_tick();
    if (ticked_) overruns_ += late ? begun : begun - 1;
    for (;;) {
      Frame frame;
      if (const Status s = link_.receive(frame); s != Status::kOk) return s;
      world_.command_count = 0;
      if (!decode(frame, world_) || frame.tick < -kFarthestTick || frame.tick > kFarthestTick) {
        ++counters_.malformed;
        return Status::kIo;
      }
      if (ticked_ && frame.tick == tick_) {
        ++counters_.repeated;
      } else if (ticked_ && frame.tick != tick_ + 1) {
        ++counters_.out_of_order;
      } else {
        tick_ = frame.tick;
        break;
      }
    }
    ticked_ = true;
    last_ = world_.last;
    has_sensors_ = true;
    has_verdict_ = world_.has_verdict;
    for (std::size_t i = 0; i < static_cast<std::size_t>(world_.command_count); ++i) {
      const firmware::OperatorInput& command = world_.commands[i];
      static_cast<void>(commands_.push(command, command.command == firmware::OperatorCommand::kStop));  // it counts
    }
    tick = tick_;
    counted_from_ = machine_.counter();
    return Status::kOk;
  }
  [[nodiscard]] std::int64_t overruns() const { return overruns_ + (machine_.tick_due() ? 1 : 0); }

  Status read_sensors(firmware::Sensors& sensors) {
    if (!has_sensors_) return Status::kEmpty;
    sensors = world_.sensors;
    has_sensors_ = false;
    return Status::kOk;
  }
  Status read_verdict(firmware::MonitorVerdict& verdict) {
    if (!has_verdict_) return Status::kEmpty;
    verdict = world_.verdict;
    has_verdict_ = false;
    return Status::kOk;
  }
  Status read_operator(firmware::OperatorInput& command) {
    if (commands_.front() == nullptr) return Status::kEmpty;
    command = *commands_.front();
    commands_.pop();
    return Status::kOk;
  }

  Status write_steps(const firmware::StepCommand& steps) {
    tick_counts_ = machine_.counter() - counted_from_;
    machine_.load(steps);
    steps_ = steps;
    counted_from_ = machine_.counter();
    return Status::kOk;
  }
  Status write_status(const firmware::ControllerStatus& status) {
    tick_counts_ += machine_.counter() - counted_from_;
    machine_.played(played_);
    return link_.send(ReplyView{status, steps_, tick_counts_, played_}, tick_);
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
  [[nodiscard]] std::int64_t tick() const { return tick_; }

 private:
  static constexpr std::int64_t kFarthestTick = (std::int64_t{1} << 62) - 1;  // there is always a next one

  M& machine_;
  Link<M>& link_;
  World world_;
  bool ticked_ = false;
  bool last_ = false;
  std::int64_t tick_ = 0;
  std::int64_t overruns_ = 0;
  bool has_sensors_ = false, has_verdict_ = false;
  OperatorQueue<firmware::OperatorInput, kMaxCommands> commands_;
  std::uint32_t counted_from_ = 0;  // counter
  std::uint32_t tick_counts_ = 0;   // of the controller in this tick: up to its steps, and from there to its status
  firmware::StepCommand steps_;
  PlayedPulses played_;
  LinkCounters counters_;
  std::int64_t watchdog_kicks_ = 0;
};

}  // namespace ballast::hal::target
