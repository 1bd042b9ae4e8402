#include "firmware/safety/modes.h"

#include <array>

namespace ballast::firmware {

namespace {

// A fault has no row in kDisarmed: nothing moves there, and what is missing at power-up only keeps the robot from
// arming.
constexpr std::array<Transition, 23> kTable{{
    {Mode::kDisarmed, Event::kArm, Guard::kHealthy, Mode::kArmed},
    {Mode::kArmed, Event::kFault, Guard::kAlways, Mode::kTripped},
    {Mode::kArmed, Event::kStop, Guard::kAlways, Mode::kDisarmed},
    {Mode::kArmed, Event::kStart, Guard::kHealthy, Mode::kRunning},
    {Mode::kArmed, Event::kMove, Guard::kHealthy, Mode::kPending},
    {Mode::kArmed, Event::kHalt, Guard::kHealthy, Mode::kHalting},
    {Mode::kArmed, Event::kGo, Guard::kHealthy, Mode::kPending},
    {Mode::kPending, Event::kFault, Guard::kAlways, Mode::kTripped},
    {Mode::kPending, Event::kStop, Guard::kAlways, Mode::kArmed},
    {Mode::kPending, Event::kDue, Guard::kAlways, Mode::kMoving},
    {Mode::kPending, Event::kCourse, Guard::kAlways, Mode::kRunning},
    {Mode::kRunning, Event::kFault, Guard::kAlways, Mode::kTripped},
    {Mode::kRunning, Event::kStop, Guard::kAlways, Mode::kStopping},
    {Mode::kRunning, Event::kHalt, Guard::kAlways, Mode::kHalting},
    {Mode::kHalting, Event::kFault, Guard::kAlways, Mode::kTripped},
    {Mode::kHalting, Event::kStop, Guard::kAlways, Mode::kStopping},
    {Mode::kHalting, Event::kDue, Guard::kAlways, Mode::kStopping},
    {Mode::kMoving, Event::kFault, Guard::kAlways, Mode::kTripped},
    {Mode::kMoving, Event::kStop, Guard::kAlways, Mode::kStopping},
    {Mode::kMoving, Event::kAtRest, Guard::kAlways, Mode::kArmed},
    {Mode::kStopping, Event::kFault, Guard::kAlways, Mode::kTripped},
    {Mode::kStopping, Event::kAtRest, Guard::kAlways, Mode::kArmed},
    {Mode::kTripped, Event::kReset, Guard::kAtRestAndClear, Mode::kDisarmed},
}};

bool holds(Guard guard, const GuardState& guards) {
  switch (guard) {
    case Guard::kAlways:
      return true;
    case Guard::kHealthy:
      return guards.healthy;
    case Guard::kAtRestAndClear:
      return guards.at_rest && !guards.cause_present;
  }
  return false;
}

}  // namespace

std::span<const Transition> transition_table() { return kTable; }

Mode next_mode(Mode mode, Event event, const GuardState& guards) {
  for (const Transition& row : kTable) {
    if (row.from == mode && row.event == event && holds(row.guard, guards)) return row.to;
  }
  return mode;
}

}  // namespace ballast::firmware
