// Courses that operators hand over: their arrival in parts, their check, and their beginning.
#include "firmware/control/course.h"

#include <cmath>

#include "firmware/control/parts.h"
#include "firmware/motion/motion_limits.h"
#include "firmware/motion/rail_ends.h"

namespace ballast::firmware {

namespace {

// Numbers of ticks and counts travel as numbers: whole, and exact below 2^53.
bool whole(Wide value, Wide least, Wide most) { return value >= least && value <= most && value == std::floor(value); }

// The first numbers are complete.
bool take_head(const ControllerParams& params, CourseReader& reader, CourseState& course) {
  const int n = params.ball.mass_count;
  const auto& [from_tick, masses, rows, period_s, holds] = reader.head;
  const int most_rows = n > 0 ? kMostReferenceFloats / reference_row(n) : 0;
  if (!whole(from_tick, 0, 9e15) || masses != n || n == 0 || !whole(rows, 2, most_rows)) return false;
  if (!(period_s > 0) || !whole(holds, 0, 1)) return false;
  course.from_tick = static_cast<std::int64_t>(from_tick);
  ReferenceTable& reference = course.coming().reference;
  reference.samples = static_cast<int>(rows);
  reference.period_s = period_s;
  reference.holds = holds == 1;
  return true;
}

bool take_mass_head(int place, Wide value, CourseReader& reader) {
  const std::size_t mass = at(place / kCourseMassHead);
  switch (place % kCourseMassHead) {
    case 0:
      if (!whole(value, 0, kMaxPieces)) return false;
      reader.pieces[mass] = static_cast<int>(value);
      return true;
    case 1:
      reader.position[mass] = value;
      return true;
    default:
      reader.velocity[mass] = value;
      return true;
  }
}

// Builds the motions whose pieces are complete.
bool build_motions(int count, CourseReader& reader, Course& course) {
  while (reader.mass < count && reader.values == kCoursePieceValues * reader.pieces[at(reader.mass)]) {
    const std::size_t i = at(reader.mass);
    if (!course.motion[i].set(reader.position[i], reader.velocity[i], reader.piece.data(), reader.pieces[i])) {
      return false;
    }
    ++reader.mass;
    reader.values = 0;
  }
  return true;
}

void take_piece_value(Wide value, CourseReader& reader) {
  ProfilePiece& piece = reader.piece[at(reader.values / kCoursePieceValues)];
  switch (reader.values % kCoursePieceValues) {
    case 0:
      piece.duration_s = value;
      break;
    case 1:
      piece.acceleration_start = value;
      break;
    default:
      piece.acceleration_end = value;
      break;
  }
  ++reader.values;
}

// Takes a value of the reference. Attitudes have unit length up to the rounding to floats.
bool take_reference_value(int count, Wide value, CourseReader& reader, ReferenceTable& reference) {
  if (reader.reference >= reference.samples * reference_row(count)) return false;
  const auto number = static_cast<float>(value);
  if (!std::isfinite(number)) return false;
  float* const all = reference.values.data();
  all[reader.reference] = number;
  const int place = reader.reference % reference_row(count);
  if (place == 3) {
    const float* q = all + (reader.reference - 3);
    if (!(std::fabs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1) <= 1e-5F)) return false;
  }
  ++reader.reference;
  return true;
}

bool take_value(const ControllerParams& params, Wide value, CourseState& course) {
  if (!std::isfinite(value)) return false;
  const int n = params.ball.mass_count;
  CourseReader& reader = course.reader;
  Course& coming = course.coming();
  const int place = reader.taken;
  if (place < kCourseHead) {
    reader.head[at(place)] = value;
    if (place + 1 == kCourseHead && !take_head(params, reader, course)) return false;
  } else if (place < kCourseHead + n * kCourseMassHead) {
    if (!take_mass_head(place - kCourseHead, value, reader)) return false;
    if (place + 1 == kCourseHead + n * kCourseMassHead && !build_motions(n, reader, coming)) return false;
  } else if (reader.mass < n) {
    take_piece_value(value, reader);
    if (!build_motions(n, reader, coming)) return false;
  } else if (!take_reference_value(n, value, reader, coming.reference)) {
    return false;
  }
  ++reader.taken;
  return true;
}

bool complete(const ControllerParams& params, const CourseState& course) {
  const int n = params.ball.mass_count;
  const ReferenceTable& reference = course.coming().reference;
  return course.reader.mass == n && course.reader.reference == reference.samples * reference_row(n);
}

void begin_reader(std::int64_t number, CourseState& course) {
  course.stage = CourseStage::kArriving;
  course.number = number;
  course.place = course.in_force == 0 ? 1 : 0;
  course.from_tick = 0;
  course.checked = 0;
  CourseReader& reader = course.reader;  // member by member: its pieces are not read before they are written
  reader.taken = reader.mass = reader.values = reader.reference = 0;
}

RefusalReport refuse(Refusal reason, int motor = -1, Wide value = 0, int piece = -1) {
  return {reason, motor, piece, value, 0};
}

// Checks the motion of mass i: limits, rail, and that it is where the masses will be.
RefusalReport check_motion(const ControllerParams& params, const ControllerState& state, int i) {
  const Profile& motion = state.course.coming().motion[at(i)];
  const LimitBreach breach = check_limits(motion, motion_limits(params, i));
  if (breach.what == Limited::kVelocity) return refuse(Refusal::kVelocity, i, breach.value, breach.piece);
  if (breach.what == Limited::kAcceleration) return refuse(Refusal::kAcceleration, i, breach.value, breach.piece);
  if (breach.what == Limited::kJerk) return refuse(Refusal::kJerk, i, breach.value, breach.piece);
  const LeavesRail leaves = leaves_rail(params.ball, i, motion);
  if (leaves.piece >= 0) return refuse(Refusal::kRailEnd, i, leaves.position, leaves.piece);
  for (int piece = 0; piece <= motion.piece_count(); ++piece) {
    const Wide position = motion.cubic(piece).position;
    if (!countable_steps(params, i, position)) return refuse(Refusal::kTarget, i, position, piece);
  }
  // The feedback takes up what it can at once: the distance by which a rotor may lag, a microstep at least, and a
  // hundredth of the speed.
  const ProfilePoint first = motion.at(0);
  const ProfilePoint there = motion_at_course(params, state, i);
  const Wide off = first.position - there.position;
  const MotorParams& motor = params.motor[at(i)];
  const Wide most = std::fmax(motor.swing, 1 / std::fabs(motor.steps_per_unit));
  if (!(std::fabs(off) <= most)) return refuse(Refusal::kOffCourse, i, off);
  constexpr Wide kSameSpeed = 0.01;
  const Wide off_speed = first.velocity - there.velocity;
  if (!(std::fabs(off_speed) <= kSameSpeed * motion_limits(params, i).max_velocity)) {
    return refuse(Refusal::kOffCourse, i, off_speed);
  }
  return {};
}

// Ticks after its beginning at which the course rests; 0: it does not.
std::int64_t rest_ticks(const ControllerParams& params, const Course& course) {
  Wide end_s = 0;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    const Profile& profile = course.motion[at(i)];
    if (profile.final_velocity() != 0) return 0;
    end_s = std::fmax(end_s, profile.end_s());
  }
  const Wide ticks = end_s / params.control_period_s;
  constexpr Wide kMostTicks = 1e9;  // that can be counted
  return ticks <= kMostTicks ? static_cast<std::int64_t>(ticks) + 1 : 0;
}

// The modes in which a course can be where it is. In any other it is dropped.
bool lives_in(CourseStage stage, Mode mode) {
  switch (stage) {
    case CourseStage::kNone:
      return true;
    case CourseStage::kArriving:
    case CourseStage::kChecking:
      return mode == Mode::kArmed || mode == Mode::kRunning;
    case CourseStage::kSearching:
      return mode == Mode::kPending;
    case CourseStage::kAwaited:
      return mode == Mode::kRunning;
  }
  return false;
}

// Nothing moves: the stages before the search end so.
void give_up(const RefusalReport& refusal, ControllerState& state) {
  state.course.stage = CourseStage::kNone;
  state.refusal = refusal;
}

// Continues the check. Complete, the course waits for its certificate.
void check_course(const ControllerParams& params, const Inputs& inputs, const GuardState& guards,
                  ControllerState& state) {
  CourseState& course = state.course;
  const std::int64_t next = plus(inputs.tick, 1);
  if (course.from_tick != 0 && next >= course.from_tick) {
    give_up(refuse(Refusal::kLate, -1, static_cast<Wide>(course.from_tick)), state);
    return;
  }
  if (course.checked < params.ball.mass_count) {
    const RefusalReport refusal = check_motion(params, state, course.checked);
    ++course.checked;
    if (refusal.reason != Refusal::kNone) give_up(refusal, state);
    return;
  }
  course.rest_ticks = rest_ticks(params, course.coming());
  if (state.mode == Mode::kRunning) {
    // Masses that move cannot wait for a certificate of unknown length.
    if (course.from_tick == 0 || !state.governing.governs) {
      give_up(refuse(course.from_tick == 0 ? Refusal::kLate : Refusal::kMode), state);
      return;
    }
    if (const std::int64_t left = course.from_tick - next; left < ticks_of_course_search(state.governing, left)) {
      give_up(refuse(Refusal::kLate, -1, static_cast<Wide>(course.from_tick)), state);
      return;
    }
    course.stage = CourseStage::kAwaited;
    await_course(params, state);
    return;
  }
  const Mode after = next_mode(state.mode, Event::kGo, guards);
  if (after != Mode::kPending || !search_course(params, inputs, state)) {
    give_up(refuse(after != Mode::kPending ? Refusal::kMode : Refusal::kNoEstimate), state);
    return;
  }
  course.stage = CourseStage::kSearching;
  state.mode = after;
}

}  // namespace

RefusalReport take_part(const ControllerParams& params, const CoursePart& part, ControllerState& state) {
  CourseState& course = state.course;
  if (!params.governor.on || !lives_in(CourseStage::kArriving, state.mode)) {
    return refuse(Refusal::kMode);
  }
  if (part.first == 0) {
    drop_course(state);
    begin_reader(part.course, course);
  }
  const int expected = course.stage == CourseStage::kArriving ? course.reader.taken : 0;
  const bool follows = course.stage == CourseStage::kArriving && part.course == course.number && part.course != 0 &&
                       part.first == expected && part.count >= 1 && part.count <= kCoursePart &&
                       part.total <= kMostCourseValues && part.count <= part.total - part.first;
  bool good = follows;
  for (int j = 0; j < kCoursePart && good && j < part.count; ++j) good = take_value(params, part.value[at(j)], course);
  const bool last = good && part.first + part.count == part.total;
  if (!good || (last && !complete(params, course))) {
    const int place = follows ? course.reader.taken : expected;
    // A part that does not fit leaves the one that arrives alone, unless it spoils it.
    if (follows || part.course == course.number) drop_course(state);
    return refuse(Refusal::kCourse, -1, place);
  }
  if (last) course.stage = CourseStage::kChecking;
  return {};
}

void drop_course(ControllerState& state) {
  if (state.course.stage == CourseStage::kAwaited) forget_course(state.governing);
  state.course.stage = CourseStage::kNone;
}

void put_in_force(ControllerState& state, std::int64_t tick) {
  CourseState& course = state.course;
  course.in_force = static_cast<int>(course.place);
  course.number_in_force = course.number;
  course.tick_in_force = tick;
  course.stage = CourseStage::kNone;
  TrackingState& tracking = state.tracking;
  tracking.feeds = true;
  tracking.start_tick = tick;
  tracking.rebased = false;
  tracking.clock = {};
  tracking.rest = {};
  GovernorState& governor = state.governing.governor;
  governor.nominal_end_tick = course.rest_ticks > 0 ? tick + course.rest_ticks : 0;
  governor.extend_from_tick = tick;
  state.governing.params.jumps = false;
}

void advance_course(const ControllerParams& params, const Inputs& inputs, const GuardState& guards,
                    ControllerState& state) {
  CourseState& course = state.course;
  if (!lives_in(course.stage, state.mode)) {
    drop_course(state);
    return;
  }
  const std::int64_t next = plus(inputs.tick, 1);
  switch (course.stage) {
    case CourseStage::kNone:
    case CourseStage::kArriving:
      return;
    case CourseStage::kChecking:
      check_course(params, inputs, guards, state);
      return;
    case CourseStage::kSearching:
      if (const CourseVerdict verdict = judge_course(params, inputs, state); verdict.decided) {
        if (verdict.refusal.reason == Refusal::kNone) {
          state.mode = next_mode(state.mode, Event::kCourse, guards);
          set_out(params, state, next);
        } else {
          state.refusal = verdict.refusal;
          state.mode = next_mode(state.mode, Event::kStop, guards);
          drop_course(state);
        }
      }
      return;
    case CourseStage::kAwaited:
      if (const RefusalReport refusal = watch_course(state, next); refusal.reason != Refusal::kNone) {
        state.refusal = refusal;
        drop_course(state);
      }
      return;
  }
}

}  // namespace ballast::firmware
