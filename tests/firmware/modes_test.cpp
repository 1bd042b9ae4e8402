#include "firmware/safety/modes.h"

#include <gtest/gtest.h>

#include <array>

namespace ballast::firmware {
namespace {

constexpr std::array kModes{Mode::kDisarmed, Mode::kArmed,  Mode::kRunning, Mode::kStopping,
                            Mode::kTripped,  Mode::kMoving, Mode::kPending, Mode::kHalting};
constexpr std::array kEvents{Event::kFault, Event::kStop, Event::kStart,  Event::kArm, Event::kReset,
                             Event::kMove,  Event::kHalt, Event::kGo,    Event::kAtRest,
                             Event::kDue,   Event::kCourse};

// The supervisor once more, as prose would say it.
Mode expected(Mode mode, Event event, const GuardState& g) {
  if (event == Event::kFault) return mode == Mode::kDisarmed ? Mode::kDisarmed : Mode::kTripped;
  if (mode == Mode::kDisarmed && event == Event::kArm && g.healthy) return Mode::kArmed;
  if (mode == Mode::kArmed && event == Event::kStart && g.healthy) return Mode::kRunning;
  if (mode == Mode::kArmed && event == Event::kStop) return Mode::kDisarmed;
  if (mode == Mode::kArmed && event == Event::kMove && g.healthy) return Mode::kPending;
  if (mode == Mode::kArmed && event == Event::kHalt && g.healthy) return Mode::kHalting;
  if (mode == Mode::kArmed && event == Event::kGo && g.healthy) return Mode::kPending;
  if (mode == Mode::kPending && event == Event::kCourse) return Mode::kRunning;
  if (mode == Mode::kPending && event == Event::kStop) return Mode::kArmed;
  if (mode == Mode::kPending && event == Event::kDue) return Mode::kMoving;
  if (mode == Mode::kMoving && event == Event::kStop) return Mode::kStopping;
  if (mode == Mode::kMoving && event == Event::kAtRest) return Mode::kArmed;
  if (mode == Mode::kRunning && event == Event::kStop) return Mode::kStopping;
  if (mode == Mode::kRunning && event == Event::kHalt) return Mode::kHalting;
  if (mode == Mode::kHalting && (event == Event::kStop || event == Event::kDue)) return Mode::kStopping;
  if (mode == Mode::kStopping && event == Event::kAtRest) return Mode::kArmed;
  if (mode == Mode::kTripped && event == Event::kReset && g.at_rest && !g.cause_present) return Mode::kDisarmed;
  return mode;
}

TEST(Modes, EveryModeEventAndGuard) {
  int moves = 0;
  for (const Mode mode : kModes) {
    for (const Event event : kEvents) {
      for (int bits = 0; bits < 8; ++bits) {
        const GuardState guards{(bits & 1) != 0, (bits & 2) != 0, (bits & 4) != 0};
        const Mode next = next_mode(mode, event, guards);
        EXPECT_EQ(next, expected(mode, event, guards))
            << "mode " << static_cast<int>(mode) << " event " << static_cast<int>(event) << " guards " << bits;
        moves += next != mode;
      }
    }
  }
  EXPECT_GT(moves, 0);
}

TEST(Modes, EveryRowFiresAndIsReachable) {
  for (const Transition& row : transition_table()) {
    GuardState met;
    met.healthy = row.guard == Guard::kHealthy;
    met.at_rest = row.guard == Guard::kAtRestAndClear;
    EXPECT_EQ(next_mode(row.from, row.event, met), row.to)
        << "from " << static_cast<int>(row.from) << " event " << static_cast<int>(row.event);
    if (row.guard != Guard::kAlways) {
      const GuardState unmet{false, false, true};
      EXPECT_EQ(next_mode(row.from, row.event, unmet), row.from) << "the guard has to hold";
    }
    EXPECT_NE(row.from, row.to);
  }
}

TEST(Modes, ATripIsLeftByResetOnly) {
  for (const Transition& row : transition_table()) {
    if (row.from != Mode::kTripped) continue;
    EXPECT_EQ(row.event, Event::kReset);
    EXPECT_EQ(row.guard, Guard::kAtRestAndClear);
    EXPECT_EQ(row.to, Mode::kDisarmed);
  }
}

TEST(Modes, NumbersAreThoseOfTheStatusMessage) {
  EXPECT_EQ(static_cast<int>(Mode::kDisarmed), 0);
  EXPECT_EQ(static_cast<int>(Mode::kArmed), 1);
  EXPECT_EQ(static_cast<int>(Mode::kRunning), 2);
  EXPECT_EQ(static_cast<int>(Mode::kStopping), 3);
  EXPECT_EQ(static_cast<int>(Mode::kTripped), 4);
  EXPECT_EQ(static_cast<int>(Mode::kMoving), 5);
  EXPECT_EQ(static_cast<int>(Mode::kPending), 6);
}

}  // namespace
}  // namespace ballast::firmware
