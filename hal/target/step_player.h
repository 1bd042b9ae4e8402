// Gives the pulses of a StepCommand from a timer interrupt, burst by burst: no list of pulses is made.
#pragma once

#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>

#include "hal/target/messages.h"

namespace ballast::hal::target {

// Pins and timer of a board, as static functions (a pin is one store, nothing is looked up):
//   now()                     counts since the control tick began
//   period()                  of a control tick, counts
//   arm(counts)               the step interrupt comes after so many counts, at least 1; replaces what was armed
//   disarm()                  it does not come
//   pulse(motor, direction)   one step
template <class H>
concept StepHardware = requires(std::uint32_t counts, std::uint8_t motor, std::int8_t direction) {
  { H::now() } -> std::same_as<std::uint32_t>;
  { H::period() } -> std::same_as<std::uint32_t>;
  H::arm(counts);
  H::disarm();
  H::pulse(motor, direction);
};

// load() is for the control loop; begin_tick() and on_timer() are for two interrupts of the same priority, so that
// neither can come between the other's lines.
template <StepHardware H>
class StepPlayer {
 public:
  // `counts_per_tick`: hardware counts per tick of the firmware's step timer; 0 < .. < 4096.
  void configure(double counts_per_tick) {
    shift_ = 0;
    while (counts_per_tick >= 1) {
      counts_per_tick /= 2;
      ++shift_;
    }
    scale_ = static_cast<std::uint32_t>(counts_per_tick * 4294967296.0);
    if (static_cast<double>(scale_) != counts_per_tick * 4294967296.0) ++scale_;  // exact counts stay what they are
  }

  // The pulses of the next control tick. At most one load per control tick.
  void load(const firmware::StepCommand& command) {
    Program& program = programs_[1 - active_];
    std::uint32_t segment = 0, track = 0;
    for (int motor = 0; motor < command.motor_count; ++motor) {
      const std::uint32_t begin = segment;
      for (std::size_t b = 0; b < static_cast<std::size_t>(command.burst_count); ++b) {
        const firmware::StepBurst& burst = command.bursts[b];
        if (burst.motor != motor) continue;
        program.segments[segment++] = {static_cast<std::uint32_t>(burst.first_ticks) << shift_,
                                       static_cast<std::uint32_t>(burst.interval_ticks) << shift_,
                                       static_cast<std::uint32_t>(burst.add_ticks) << shift_,
                                       static_cast<std::uint32_t>(burst.count),
                                       static_cast<std::uint8_t>(motor),
                                       burst.direction};
      }
      if (segment == begin) continue;
      Track& t = program.tracks[track++];
      t.next = &program.segments[begin];
      t.end = &program.segments[segment];
      begin_segment(t);
    }
    program.track_count = track;
    std::atomic_signal_fence(std::memory_order_release);
    ready_ = true;
  }

  // A control tick begins. Pulses of the one before that are still due are given now: one that was due with its last
  // breath, as this interrupt comes first.
  void begin_tick() {
    Program& ending = programs_[active_];
    while (ending.track_count != 0 && earliest(ending)->due != kNever) {
      Track* t = earliest(ending);
      give(*t, H::period() + H::now() - counts(t->due));
    }
    open_ = 1 - open_;
    records_[open_].count = 0;
    programs_[active_].track_count = 0;
    if (ready_) {
      active_ = 1 - active_;
      ready_ = false;
    }
    on_timer();
  }

  // The step interrupt.
  void on_timer() {
    for (;;) {
      Program& program = programs_[active_];
      if (program.track_count == 0) {
        H::disarm();
        return;
      }
      Track* t = earliest(program);
      if (t->due == kNever) {
        H::disarm();
        return;
      }
      const std::uint32_t due = counts(t->due);
      const std::uint32_t now = H::now();
      if (now < due) {
        H::arm(due - now);
        return;
      }
      give(*t, now - due);
    }
  }

  // What was given during the control tick before this one.
  [[nodiscard]] const PlayedPulses& played() const { return records_[1 - open_]; }
  [[nodiscard]] std::uint32_t max_late_counts() const { return max_late_counts_; }

 private:
  static constexpr std::uint32_t kNever = 0xffffffff;

  // Times in step timer ticks, shifted so that one multiplication gives counts.
  struct Segment {
    std::uint32_t first, interval, add, count;
    std::uint8_t motor;
    std::int8_t direction;
  };
  struct Track {
    std::uint32_t due = 0, interval = 0, add = 0, left = 0;
    std::uint8_t motor = 0;
    std::int8_t direction = 1;
    const Segment *next = nullptr, *end = nullptr;
  };
  struct Program {
    std::uint32_t track_count = 0;
    std::array<Track, firmware::kMaxMasses> tracks{};
    std::array<Segment, firmware::kMaxBursts> segments{};
  };

  [[nodiscard]] std::uint32_t counts(std::uint32_t shifted) const {
    return static_cast<std::uint32_t>(std::uint64_t{shifted} * scale_ >> 32);
  }

  static void begin_segment(Track& t) {
    if (t.next == t.end) {
      t.due = kNever;
      return;
    }
    const Segment& s = *t.next++;
    t.due = s.first;
    t.interval = s.interval;
    t.add = s.add;
    t.left = s.count;
    t.motor = s.motor;
    t.direction = s.direction;
  }

  // Equal times: the first motor.
  static Track* earliest(Program& program) {
    Track* best = program.tracks.data();
    for (std::uint32_t i = 1; i < program.track_count; ++i) {
      if (program.tracks[i].due < best->due) best = &program.tracks[i];
    }
    return best;
  }

  void give(Track& t, std::uint32_t late_counts) {
    H::pulse(t.motor, t.direction);
    PlayedPulses& record = records_[open_];
    PlayedPulse& pulse = record.pulse[static_cast<std::size_t>(record.count)];
    if (record.count < kMaxPulses - 1) ++record.count;
    pulse.due_ticks = t.due >> shift_;
    pulse.late_counts = static_cast<std::uint16_t>(late_counts < 65535 ? late_counts : 65535);
    pulse.motor = t.motor;
    pulse.direction = t.direction;
    if (late_counts > max_late_counts_) max_late_counts_ = late_counts;
    if (--t.left == 0) {
      begin_segment(t);
      return;
    }
    t.due += t.interval;
    t.interval += t.add;
  }

  std::array<Program, 2> programs_{};
  std::uint32_t active_ = 0;
  volatile bool ready_ = false;
  std::array<PlayedPulses, 2> records_{};
  std::uint32_t open_ = 0;
  std::uint32_t max_late_counts_ = 0;
  std::uint32_t shift_ = 0;
  std::uint32_t scale_ = 0;
};

}  // namespace ballast::hal::target
