// Gives the pulses of a StepCommand from a timer interrupt, burst by burst: no list of pulses is made.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>

#include "hal/target/messages.h"

namespace ballast::hal::target {

// Pins and timer of a board, as static functions (a step is one store, nothing is looked up):
//   span(), left()           a timer that counts down over a control tick: what it begins with, and where it stands
//   arm(counts)              the step interrupt comes after so many counts, at least 1; replaces what was armed
//   cancel()                 nothing comes of what was armed, though it be on its way already, for 2^32 - 1 counts
//   pin(motor)               what step() wants
//   step(pin)                one step
//   turn(motor, direction)   the direction of the motor's steps from now on
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

// The direction changes right after the motor's last pulse the other way or, if that was in an earlier control tick, at
// the beginning of this one.
//
// load() is for the control loop; begin_tick() and on_timer() are for two interrupts of the same priority, so that
// neither can come between the other's lines.
template <StepHardware H>
class StepPlayer {
 public:
  // `counts_per_tick`: hardware counts per tick of the firmware's step timer; 1/32 <= .. < 4096. A control tick has at
  // most 2^24 counts. Then kNever is beyond its end.
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
    // Rounded up: no pulse is early, and exact counts stay what they are. Just under 1 that is 2^32, which has no room.
    const double scaled = counts_per_tick * 4294967296.0;
    auto scale = static_cast<std::uint64_t>(scaled);
    if (static_cast<double>(scale) != scaled) ++scale;
    if (scale >> 32 != 0) {
      scale = (scale + 1) >> 1;
      ++shift_;
    }
    scale_ = static_cast<std::uint32_t>(scale);
  }

  // The pulses of the next control tick. At most one load per control tick. More than kMaxPulses, or counts that no
  // command has: none.
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

  // A control tick begins. A motor's pulse of the one before that is still due is given now: it was due with that
  // tick's last breath, as this interrupt comes first. A second one of the same motor is not given, as it would come
  // closer after the first than the motor can follow: the record does not have it, and who commanded it sees that.
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
    // A device's registers are slow, so few ticks without pulses touch them: the timer goes on counting, and is wound up
    // long before it is through.
    if (!unarmed_ || ++ticks_unarmed_ == kTicksUnarmed) {
      H::cancel();
      ticks_unarmed_ = 0;
    }
    unarmed_ = playing_->end == playing_->tracks.data();
    if (unarmed_) return;
    due_ = std::min(earliest()->due, kNever);
    due_left_ = left_at(due_);
    const std::int32_t wait = difference(H::left(), static_cast<std::uint32_t>(due_left_));
    if (wait > 0) {
      H::arm(static_cast<std::uint32_t>(wait));
    } else {
      on_timer();
    }
  }

  // The step interrupt: what it was armed for is due. Each turn of the loop gives a pulse at least, and there are never
  // more than kMaxPulses: what is due at kNever is always waited for, and never comes. So there is a track, too.
  // Nothing more is asked here, since every instruction counts for every pulse.
  void on_timer() {
    std::uint32_t due = due_;
    std::int32_t due_left = due_left_;
    Given* record = record_;
    Program& program = *playing_;
    for (;;) {
      // All motors whose pulse is due, and when the next one is.
      std::uint32_t next = kNever;
      Track* t = program.tracks.data();
      do {
        if (t->due <= due) {
          H::step(t->pin);
          *record++ = {due, difference(static_cast<std::uint32_t>(due_left), H::left()), t->id};
          if (--t->left != 0) {
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

  // What was given during the control tick before this one.
  void played(PlayedPulses& pulses) const {
    const Record& record = records_[1 - open_];
    pulses.count = 0;
    for (const Given* g = record.pulse.data(); g != record.end; ++g) {
      // None is early: below 0, the timer began anew between the pulse's time and the pulse.
      std::int64_t late = std::int64_t{g->late_counts} + 1;
      if (late < 0) late += last_ + 2;
      pulses.pulse[static_cast<std::size_t>(pulses.count++)] = {
          g->due >> shift_, static_cast<std::uint16_t>(late < 65535 ? late : 65535), static_cast<std::uint8_t>(g->id),
          static_cast<std::int8_t>(g->id >> 8)};
    }
  }
  // Up to the beginning of this control tick.
  [[nodiscard]] std::uint32_t given() const { return given_; }

 private:
  static constexpr int kNone = kMaxPulses + 1;
  static constexpr std::uint32_t kTicksUnarmed = 128;  // of 2^24 counts, half of cancel()'s
  static constexpr std::uint32_t kNever = 0x3fffffff;  // beyond any control tick's end, and its counts are too

  // Times in step timer ticks, shifted so that one multiplication gives counts.
  struct Segment {
    std::uint32_t first, interval, add, count;
    std::uint8_t motor;
    std::int8_t direction;
  };
  // A motor that has pulses left.
  struct Track {
    std::uint32_t due, interval, add, left, pin, id;
    const Segment *next, *end;
  };
  struct Program {
    std::array<Track, firmware::kMaxMasses + 1> tracks{};  // one more for load() to try
    Track* end = nullptr;
    std::array<Segment, firmware::kMaxBursts> segments{};
  };
  struct Given {
    std::uint32_t due;
    std::int32_t late_counts;
    std::uint32_t id;  // motor, and from bit 8 on its direction
  };
  struct Record {
    std::array<Given, kMaxPulses> pulse{};
    const Given* end = nullptr;
  };

  // What left() is when a pulse is given: a count after its time, since the counts of two timers do not begin together,
  // and none may be early. Below 0 after the tick's end.
  [[nodiscard]] std::int32_t left_at(std::uint32_t shifted) const {
    return difference(static_cast<std::uint32_t>(last_),
                      static_cast<std::uint32_t>(static_cast<std::uint64_t>(shifted) * scale_ >> 32));
  }
  // Also of times that no command has: those wrap.
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

  // False: the motor has no more pulses, and another one stands in its place.
  [[gnu::noinline]] static bool advance(Program& program, Track& t) {
    if (t.next != t.end) {
      begin_segment(t);
      return true;
    }
    t = *--program.end;
    return false;
  }

  [[nodiscard]] Track* earliest() const {
    Track* best = playing_->tracks.data();
    for (Track* t = best; t != playing_->end; ++t) {
      if (t->due < best->due) best = t;
    }
    return best;
  }

  // A pulse of the control tick that has just ended.
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
  Given* record_ = nullptr;  // where the next pulse is written down
  std::uint32_t given_ = 0;
  bool unarmed_ = false;   // in this control tick. Before the first: not known, so false
  std::uint32_t ticks_unarmed_ = 0;
  std::uint32_t due_ = 0;  // the pulse waited for
  std::int32_t due_left_ = 0;
  std::int32_t last_ = 0;  // left_at(0)
  std::uint32_t shift_ = 0;
  std::uint32_t scale_ = 0;
};

}  // namespace ballast::hal::target
