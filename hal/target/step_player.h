// StepPlayer gives the pulses of a StepCommand from a timer interrupt, burst by burst, without a list of pulses.
//
// A burst's pulse times are those of firmware::pulse_ticks(). The interrupt computes them by two additions per pulse,
// because the formula's 64-bit products would take longer than the rest of it. The host compares the pulses with the
// formula.
//
// The pulses of control tick k are loaded during tick k - 1 and given during tick k, each at its count of the hardware
// timer: never early, late by the instructions of the interrupt before it. Every pulse given is recorded with its
// lateness, so that the host can compare the record with the command.
//
// The control loop calls configure(), load(), played() and given(). Two interrupts of the same priority call
// begin_tick() and on_timer(), so neither interrupts the other. Nothing allocates; loops are bounded by kMaxPulses and
// kMaxBursts.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>

#include "hal/target/messages.h"

namespace ballast::hal::target {

// Pins and timer of a board. The functions are static, so that a step is one store without a look-up.
//   span(), left()           start value and present value of a timer that counts down over a control tick
//   arm(counts)              requests the step interrupt after `counts` >= 1 counts, in place of an earlier request
//   cancel()                 withdraws the request, even if the interrupt is already pending; lasts 2^32 - 1 counts
//   pin(motor)               the argument of step() for a motor
//   step(pin)                gives one step
//   turn(motor, direction)   sets the direction of the motor's next steps
template <class H>
concept StepHardware = requires(std::uint32_t counts, std::uint8_t motor, std::int8_t direction) {
  { H::span() } -> std::same_as<std::uint32_t>;
  { H::left() } -> std::same_as<std::uint32_t>;
  H::arm(counts);
  H::cancel();
  { H::pin(motor) } -> std::same_as<std::uint32_t>;
  H::step(counts);
  H::turn(motor, direction);
};

// A motor's direction changes right after its last pulse the other way or, if that was in an earlier control tick, at
// the beginning of this one.
template <StepHardware H>
class StepPlayer {
 public:
  // `counts_per_tick`: hardware counts per tick of the firmware's step timer, from 1/32 to below 4096. A control tick
  // has at most 2^24 counts, so kNever lies beyond its end.
  void configure(double counts_per_tick) {
    playing_ = &programs_[0];
    loading_ = &programs_[1];
    for (Program& program : programs_) program.end = program.tracks.data();
    for (Record& record : records_) record.end = record.pulse.data();
    record_ = records_[open_].pulse.data();
    unarmed_ = false;
    shift_ = 0;
    while (counts_per_tick >= 1) {
      counts_per_tick /= 2;
      ++shift_;
    }
    // Rounding up keeps exact counts exact and makes no pulse early. A result of 2^32 does not fit and is halved.
    const double scaled = counts_per_tick * 4294967296.0;
    auto scale = static_cast<std::uint64_t>(scaled);
    if (static_cast<double>(scale) != scaled) ++scale;
    if (scale >> 32 != 0) {
      scale = (scale + 1) >> 1;
      ++shift_;
    }
    scale_ = static_cast<std::uint32_t>(scale);
  }

  // Takes the pulses of the next control tick; at most one call per tick. A command with more than kMaxPulses, or with
  // counts out of range, gives no pulses.
  void load(const firmware::StepCommand& command) {
    Program& program = *loading_;
    Segment* segment = program.segments.data();
    Track* track = program.tracks.data();
    int pulses = command.motor_count > firmware::kMaxMasses || command.burst_count > firmware::kMaxBursts ? kNone : 0;
    for (int motor = 0; pulses != kNone && motor < command.motor_count; ++motor) {
      track->next = segment;
      for (int b = 0; b < command.burst_count; ++b) {
        const firmware::StepBurst& burst = command.bursts[static_cast<std::size_t>(b)];
        if (burst.motor != motor) continue;
        if (burst.count < 1) {
          pulses = kNone;
          break;
        }
        pulses += burst.count;
        *segment++ = {static_cast<std::uint32_t>(burst.first_ticks) << shift_,
                      static_cast<std::uint32_t>(burst.interval_ticks) << shift_,
                      static_cast<std::uint32_t>(burst.add_ticks) << shift_,
                      static_cast<std::uint32_t>(burst.count),
                      static_cast<std::uint8_t>(motor),
                      burst.direction};
      }
      if (segment == track->next) continue;
      track->end = segment;
      track->pin = H::pin(static_cast<std::uint8_t>(motor));
      ++track;
    }
    program.end = pulses <= kMaxPulses ? track : program.tracks.data();
    std::atomic_signal_fence(std::memory_order_release);
    ready_ = true;
  }

  // Begins a control tick. Emits one overdue pulse per motor of the tick that ends: this interrupt may come just before
  // the pulse's own. A second is dropped and left out of the record, so the host detects it: it would follow the first
  // more closely than the motor can.
  void begin_tick() {
    for (const Track* t = playing_->tracks.data(); t != playing_->end; ++t) finish(*t);
    playing_->end = playing_->tracks.data();
    Record& ended = records_[open_];
    ended.end = record_;
    given_ += static_cast<std::uint32_t>(ended.end - ended.pulse.data());
    open_ = 1 - open_;
    record_ = records_[open_].pulse.data();
    if (ready_) {
      Program* ready = loading_;
      loading_ = playing_;
      playing_ = ready;
      ready_ = false;
      for (Track* t = ready->tracks.data(); t != ready->end; ++t) begin_segment(*t);
    }
    last_ = static_cast<std::int32_t>(H::span()) - 1;
    // Device registers are slow, so most ticks without pulses leave the timer alone. It is rewound every kTicksUnarmed
    // ticks, long before it expires.
    if (unarmed_) ++ticks_unarmed_;
    if (!unarmed_ || ticks_unarmed_ == kTicksUnarmed) {
      H::cancel();
      ticks_unarmed_ = 0;
    }
    unarmed_ = playing_->end == playing_->tracks.data();
    if (!unarmed_) begin_pulses();
  }

  // The step interrupt: gives every pulse that is due and arms the timer for the next. There is at least one track when
  // it comes, because the timer is armed only then, and a time of kNever is waited for in vain. The loop gives at least
  // one pulse a turn, so it has at most kMaxPulses turns. Every instruction here counts for every pulse.
  void on_timer() {
    std::uint32_t due = due_;
    std::int32_t due_left = due_left_;
    Given* record = record_;
    Program& program = *playing_;
    for (;;) {
      // Steps all motors whose pulse is due, and finds the time of the next one.
      std::uint32_t next = kNever;
      Track* t = program.tracks.data();
      do {
        if (t->due <= due) {
          H::step(t->pin);
          *record++ = {due, difference(static_cast<std::uint32_t>(due_left), H::left()), t->id};
          --t->left;
          if (t->left != 0) {
            t->due += t->interval;
            t->interval += t->add;
          } else if (!advance(program, *t)) {
            continue;
          }
        }
        if (t->due < next) next = t->due;
        ++t;
      } while (t != program.end);
      due = next;
      due_left = left_at(due);
      const std::int32_t wait = difference(H::left(), static_cast<std::uint32_t>(due_left));
      if (wait > 0) {
        H::arm(static_cast<std::uint32_t>(wait));
        break;
      }
    }
    due_ = due;
    due_left_ = due_left;
    record_ = record;
  }

  // Writes the pulses given during the previous control tick.
  void played(PlayedPulses& pulses) const {
    const Record& record = records_[1 - open_];
    pulses.count = 0;
    for (const Given* g = record.pulse.data(); g != record.end; ++g) {
      // No pulse is early. A value below 0 says that the timer restarted between the pulse's time and the pulse.
      std::int64_t late = std::int64_t{g->late_counts} + 1;
      if (late < 0) late += last_ + 2;
      pulses.pulse[static_cast<std::size_t>(pulses.count++)] = {
          g->due >> shift_, static_cast<std::uint16_t>(late < 65535 ? late : 65535), static_cast<std::uint8_t>(g->id),
          static_cast<std::int8_t>(g->id >> 8)};
    }
  }
  // Pulses given up to the beginning of this control tick, in all.
  [[nodiscard]] std::uint32_t given() const { return given_; }

 private:
  static constexpr int kNone = kMaxPulses + 1;
  static constexpr std::uint32_t kTicksUnarmed = 128;  // 2^31 counts, half of the time cancel() lasts
  static constexpr std::uint32_t kNever = 0x3fffffff;  // a time beyond the end of every control tick

  // A burst. Times are in step timer ticks, shifted left by shift_, so that one multiplication gives counts.
  struct Segment {
    std::uint32_t first, interval, add, count;
    std::uint8_t motor;
    std::int8_t direction;
  };
  // A motor with pulses left: its next pulse, and its bursts after this one.
  struct Track {
    std::uint32_t due, interval, add, left, pin, id;
    const Segment *next, *end;
  };
  struct Program {
    std::array<Track, firmware::kMaxMasses + 1> tracks{};  // one more, which load() may begin and not use
    Track* end = nullptr;
    std::array<Segment, firmware::kMaxBursts> segments{};
  };
  struct Given {
    std::uint32_t due;
    std::int32_t late_counts;
    std::uint32_t id;  // motor in bits 0..7, direction in bits 8..15
  };
  struct Record {
    std::array<Given, kMaxPulses> pulse{};
    const Given* end = nullptr;
  };

  // The value of left() at which a pulse is given: one count after its time, because the counts of two timers do not
  // begin together and no pulse may be early. Below 0 after the tick's end.
  [[nodiscard]] std::int32_t left_at(std::uint32_t shifted) const {
    return difference(static_cast<std::uint32_t>(last_),
                      static_cast<std::uint32_t>(static_cast<std::uint64_t>(shifted) * scale_ >> 32));
  }
  // a - b with wrap-around, so that times that no command has are harmless, too.
  static std::int32_t difference(std::uint32_t a, std::uint32_t b) { return static_cast<std::int32_t>(a - b); }

  static void begin_segment(Track& t) {
    const Segment& s = *t.next++;
    t.due = s.first;
    t.interval = s.interval;
    t.add = s.add;
    t.left = s.count;
    t.id = static_cast<std::uint32_t>(s.motor | static_cast<std::uint8_t>(s.direction) << 8);
    H::turn(s.motor, s.direction);
  }

  // Begins the motor's next burst. False: it has none, and another track has taken its place.
  [[gnu::noinline]] static bool advance(Program& program, Track& t) {
    if (t.next != t.end) {
      begin_segment(t);
      return true;
    }
    t = *--program.end;
    return false;
  }

  // Arms the timer for the tick's first pulse, or gives it if it is due now. There is at least one track.
  void begin_pulses() {
    due_ = kNever;
    for (const Track* t = playing_->tracks.data(); t != playing_->end; ++t) due_ = std::min(due_, t->due);
    due_left_ = left_at(due_);
    const std::int32_t wait = difference(H::left(), static_cast<std::uint32_t>(due_left_));
    if (wait > 0) {
      H::arm(static_cast<std::uint32_t>(wait));
    } else {
      on_timer();
    }
  }

  // Gives an overdue pulse of the control tick that has just ended.
  void finish(const Track& t) {
    H::step(t.pin);
    const auto left = static_cast<std::uint32_t>(left_at(t.due)) + static_cast<std::uint32_t>(last_) + 2;
    *record_++ = {t.due, difference(left, H::left()), t.id};
  }

  std::array<Program, 2> programs_{};
  Program *playing_ = nullptr, *loading_ = nullptr;
  volatile bool ready_ = false;
  std::array<Record, 2> records_{};
  std::uint32_t open_ = 0;
  Given* record_ = nullptr;  // place of the next pulse's record
  std::uint32_t given_ = 0;
  bool unarmed_ = false;  // this control tick has no pulses; false before the first tick, where the timer may be armed
  std::uint32_t ticks_unarmed_ = 0;
  std::uint32_t due_ = 0;  // time of the pulse the timer is armed for
  std::int32_t due_left_ = 0;
  std::int32_t last_ = 0;  // left_at(0)
  std::uint32_t shift_ = 0;
  std::uint32_t scale_ = 0;
};

}  // namespace ballast::hal::target
