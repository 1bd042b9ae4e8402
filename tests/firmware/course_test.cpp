// Courses that an operator hands over: their parts, their check and their beginning. Whole ticks with ideal masses.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "tests/firmware/course_numbers.h"
#include "tests/firmware/governed_ball.h"

namespace ballast::firmware {
namespace {

using testing::course_forth;
using testing::CourseNumbers;
using testing::GovernedBall;
using testing::hanging_params;
using testing::parts_of;
using testing::push;

void send(GovernedBall& robot, const std::vector<CoursePart>& parts) {
  for (const CoursePart& part : parts) robot.tick(part);
}

void arm(GovernedBall& robot) {
  robot.tick(OperatorCommand::kArm);
  robot.tick();
  ASSERT_EQ(robot.out.status.mode, Mode::kArmed);
}

// Until the course that was sent is in force, or dropped.
void await(GovernedBall& robot) {
  for (int k = 0; k < 20000 && robot.out.status.course.coming != 0; ++k) robot.tick();
}

// Armed, with course 5 in force. Returns where its first mass ends.
Wide follow_forth(GovernedBall& robot) {
  arm(robot);
  send(robot, parts_of(5, course_forth().values()));
  await(robot);
  return robot.state().course.slot[0].motion[0].final_position();
}

// A course from there that leads mass 0 back.
CourseNumbers course_back(Wide from, std::int64_t from_tick) {
  CourseNumbers back = course_forth();
  back.from_tick = from_tick;
  back.mass[0].position = from;
  back.mass[0].pieces = push(-1);
  return back;
}

TEST(Course, BeginsOnceItIsCertified) {
  GovernedBall robot(hanging_params());
  arm(robot);
  send(robot, parts_of(5, course_forth().values()));
  EXPECT_EQ(robot.out.status.course.coming, 5);
  for (int k = 0; k <= testing::kCourseMasses; ++k) robot.tick();
  EXPECT_EQ(robot.out.status.mode, Mode::kPending);
  await(robot);
  ASSERT_EQ(robot.out.status.mode, Mode::kRunning) << static_cast<int>(robot.out.status.refusal.reason);
  EXPECT_EQ(robot.out.status.course.in_force, 5);
  EXPECT_EQ(robot.out.status.course.tick, robot.in.tick);
  EXPECT_TRUE(robot.out.status.governor.governs);
  const Wide moved = robot.state().course.slot[0].motion[0].final_position();
  EXPECT_GT(moved, 0.004);
  robot.run_until(robot.in.tick + 1500);
  // The commanded mass follows in steps of the control tick, without feedback.
  EXPECT_NEAR(robot.out.status.commanded_position[0], moved, 1e-4);
  EXPECT_LE(robot.most_use, 1);
}

// The second course begins where the first one has ended, at its own tick.
TEST(Course, ReplacesAnother) {
  GovernedBall robot(hanging_params());
  const Wide there = follow_forth(robot);
  robot.run_until(robot.in.tick + 3000);
  const CourseNumbers back = course_back(there, robot.in.tick + 6000);
  send(robot, parts_of(6, back.values()));
  EXPECT_EQ(robot.out.status.course.in_force, 5);
  EXPECT_EQ(robot.out.status.course.coming, 6);
  await(robot);
  ASSERT_EQ(robot.out.status.course.in_force, 6) << static_cast<int>(robot.out.status.refusal.reason);
  EXPECT_EQ(robot.out.status.course.tick, back.from_tick);
  EXPECT_EQ(robot.in.tick, back.from_tick);  // the tick before has commanded its first one
  robot.run_until(back.from_tick + 1500);
  EXPECT_NEAR(robot.out.status.commanded_position[0], 0, 1e-4);
  EXPECT_EQ(robot.out.status.mode, Mode::kRunning);
}

// A third one while the second is still expected takes its place.
TEST(Course, TakesThePlaceOfOneThatIsAwaited) {
  GovernedBall robot(hanging_params());
  const Wide there = follow_forth(robot);
  robot.run_until(robot.in.tick + 3000);
  CourseNumbers next = course_back(there, robot.in.tick + 20000);
  send(robot, parts_of(6, next.values()));
  robot.run_until(robot.in.tick + 100);
  EXPECT_EQ(robot.out.status.course.coming, 6);
  next.from_tick = robot.in.tick + 6000;
  send(robot, parts_of(7, next.values()));
  await(robot);
  EXPECT_EQ(robot.out.status.course.in_force, 7) << static_cast<int>(robot.out.status.refusal.reason);
  EXPECT_EQ(robot.in.tick, next.from_tick);
}

// So `go` takes back what it has handed over.
TEST(Course, ThatWaitsForItsTickIsSpoiltByAPartThatDoesNotFit) {
  GovernedBall robot(hanging_params());
  const Wide there = follow_forth(robot);
  const std::int64_t followed = robot.out.status.course.in_force;
  robot.run_until(robot.in.tick + 3000);
  const CourseNumbers next = course_back(there, robot.in.tick + 6000);
  const auto parts = parts_of(6, next.values());
  send(robot, parts);
  robot.run_until(robot.in.tick + 100);
  ASSERT_EQ(robot.out.status.course.coming, 6);
  CoursePart spoils = parts.front();
  spoils.first = spoils.count = 1;
  robot.tick(spoils);
  EXPECT_EQ(robot.out.status.refusal.reason, Refusal::kCourse);
  EXPECT_EQ(robot.out.status.course.coming, 0);
  robot.run_until(next.from_tick + 100);
  EXPECT_EQ(robot.out.status.course.in_force, followed);
}

struct Spoilt {
  const char* what;
  std::function<void(std::vector<Wide>&)> spoil;
  int place;  // of the value that is refused
};

// Every value that no course can have is refused, and its place said.
TEST(Course, RefusesValuesThatAreNone) {
  const CourseNumbers good = course_forth();
  constexpr Wide kNan = std::numeric_limits<Wide>::quiet_NaN();
  const int pieces_at = kCourseHead + testing::kCourseMasses * kCourseMassHead, reference_at = pieces_at + 12;
  const auto set = [](int place, Wide value) {
    return [place, value](std::vector<Wide>& values) { values[static_cast<std::size_t>(place)] = value; };
  };
  const Spoilt cases[] = {
      {"a tick before 0", set(0, -1), 4},
      {"a broken tick", set(0, 0.5), 4},
      {"another number of masses", set(1, 2), 4},
      {"one row", set(2, 1), 4},
      {"too many rows", set(2, 1e6), 4},
      {"no period", set(3, 0), 4},
      {"a flag of 2", set(4, 2), 4},
      {"not a number", set(3, kNan), 3},
      {"too many pieces", set(kCourseHead, kMaxPieces + 1), kCourseHead},
      {"no duration", set(pieces_at, 0), pieces_at + 11},
      {"an infinite acceleration", set(pieces_at + 1, std::numeric_limits<Wide>::infinity()), pieces_at + 1},
      {"no unit attitude", set(reference_at, 2), reference_at + 3},
      {"more than a float", set(reference_at + 10, 1e300), reference_at + 10},
  };
  for (const Spoilt& c : cases) {
    GovernedBall robot(hanging_params());
    arm(robot);
    std::vector<Wide> values = good.values();
    c.spoil(values);
    for (const CoursePart& part : parts_of(5, values)) {
      robot.tick(part);
      if (robot.out.status.refusal.reason != Refusal::kNone) break;
    }
    EXPECT_EQ(robot.out.status.refusal.reason, Refusal::kCourse) << c.what;
    EXPECT_EQ(robot.out.status.refusal.value, c.place) << c.what;
    EXPECT_EQ(robot.out.status.course.coming, 0) << c.what;
    robot.run_until(3000);
    EXPECT_EQ(robot.out.status.mode, Mode::kArmed) << c.what;
  }
}

TEST(Course, RefusesPartsThatDoNotFit) {
  const auto sent = parts_of(5, course_forth().values());
  ASSERT_GT(sent.size(), 1U);
  struct Case {
    const char* what;
    std::function<void(CoursePart&)> spoil;  // of the second part
  };
  const Case cases[] = {
      {"another course", [](CoursePart& p) { p.course = 6; }},
      {"a gap",
       [](CoursePart& p) {
         p.first += 1;
         p.count -= 1;
       }},
      {"an overlap", [](CoursePart& p) { p.first -= 1; }},
      {"no values", [](CoursePart& p) { p.count = 0; }},
      {"a smaller total", [](CoursePart& p) { p.total = p.first; }},
      {"more values than a part has", [](CoursePart& p) { p.count = kCoursePart + 1; }},
  };
  for (const Case& c : cases) {
    GovernedBall robot(hanging_params());
    arm(robot);
    robot.tick(sent[0]);
    ASSERT_EQ(robot.out.status.refusal.reason, Refusal::kNone);
    CoursePart second = sent[1];
    c.spoil(second);
    robot.tick(second);
    EXPECT_EQ(robot.out.status.refusal.reason, Refusal::kCourse) << c.what;
    EXPECT_EQ(robot.out.status.refusal.value, kCoursePart) << c.what;
  }
  // A course that says it is complete before it is.
  GovernedBall robot(hanging_params());
  arm(robot);
  CoursePart first = sent[0];
  first.total = first.count;
  robot.tick(first);
  EXPECT_EQ(robot.out.status.refusal.reason, Refusal::kCourse);
  EXPECT_EQ(robot.out.status.course.coming, 0);
  // A course without a number.
  first = sent[0];
  first.course = 0;
  robot.tick(first);
  EXPECT_EQ(robot.out.status.refusal.reason, Refusal::kCourse);
}

struct Unfit {
  const char* what;
  std::function<void(CourseNumbers&)> spoil;
  Refusal reason;
};

// A course that this robot cannot follow is refused before anything moves.
TEST(Course, RefusesWhatTheRobotCannot) {
  const Unfit cases[] = {
      {"too fast",
       [](CourseNumbers& c) {
         c.mass[0].pieces = {{1, 0, 1}, {1, 1, 0}, {1, 0, -1}, {1, -1, 0}};
       },
       Refusal::kVelocity},
      {"too much acceleration",
       [](CourseNumbers& c) {
         c.mass[0].pieces = {{0.11, 0, 1.1}, {0.11, 1.1, 0}, {0.11, 0, -1.1}, {0.11, -1.1, 0}};
       },
       Refusal::kAcceleration},
      {"too much jerk",
       [](CourseNumbers& c) {
         c.mass[0].pieces = {{0.01, 0, 0.5}, {0.01, 0.5, -0.5}, {0.01, -0.5, 0}};
       },
       Refusal::kJerk},
      {"from elsewhere", [](CourseNumbers& c) { c.mass[1].position = 0.3; }, Refusal::kOffCourse},
      {"from a mass that moves", [](CourseNumbers& c) { c.mass[1].velocity = 0.1; }, Refusal::kOffCourse},
      {"in the past", [](CourseNumbers& c) { c.from_tick = 1; }, Refusal::kLate},
  };
  for (const Unfit& c : cases) {
    GovernedBall robot(hanging_params());
    arm(robot);
    CourseNumbers course = course_forth();
    c.spoil(course);
    send(robot, parts_of(5, course.values()));
    await(robot);
    EXPECT_EQ(robot.out.status.refusal.reason, c.reason) << c.what;
    EXPECT_EQ(robot.out.status.mode, Mode::kArmed) << c.what;
    EXPECT_FALSE(robot.state().moving) << c.what;
  }
  // The masses' rails end.
  ControllerParams short_rails = hanging_params();
  for (std::size_t i = 0; i < testing::kCourseMasses; ++i) {
    short_rails.ball.rail[i].lower_end = Real(-0.004);
    short_rails.ball.rail[i].upper_end = Real(0.004);
  }
  GovernedBall robot(short_rails);
  arm(robot);
  send(robot, parts_of(5, course_forth().values()));
  await(robot);
  EXPECT_EQ(robot.out.status.refusal.reason, Refusal::kRailEnd);
}

// On ice the paper's ball, which stands on its head, has no certified stop once a mass has moved. It is held before
// tick 0.
TEST(Course, RefusesWhatCannotBeCertified) {
  ControllerParams params = testing::paper_params();
  params.governor.on = true;
  params.governor.friction = Real(0.005);
  GovernedBall robot(params, -3000);
  arm(robot);
  CourseNumbers course = course_forth();
  course.mass[0].pieces = push(10);
  for (std::size_t i = 0; i < testing::kCourseMasses; ++i) course.mass[i].position = params.motion[i].at(0).position;
  send(robot, parts_of(5, course.values()));
  await(robot);
  ASSERT_LT(robot.in.tick, 0);
  EXPECT_EQ(robot.out.status.refusal.reason, Refusal::kNoBackup);
  EXPECT_GT(robot.out.status.refusal.value, 1);  // of the friction that the certificate could use
  EXPECT_EQ(robot.out.status.mode, Mode::kArmed);
}

TEST(Course, NeedsAGovernorAndAnArmedRobot) {
  const auto parts = parts_of(5, course_forth().values());
  ControllerParams free = hanging_params();
  free.governor.on = false;
  GovernedBall ungoverned(free);
  arm(ungoverned);
  ungoverned.tick(parts[0]);
  EXPECT_EQ(ungoverned.out.status.refusal.reason, Refusal::kMode);
  GovernedBall disarmed(hanging_params());
  disarmed.tick(parts[0]);
  EXPECT_EQ(disarmed.out.status.refusal.reason, Refusal::kMode);
}

// A stop and a fault take a course back that has not begun.
TEST(Course, EndsWithAStopOrAFault) {
  const auto parts = parts_of(5, course_forth().values());
  for (const bool stop : {true, false}) {
    GovernedBall robot(hanging_params());
    arm(robot);
    send(robot, parts);
    for (int k = 0; k <= testing::kCourseMasses; ++k) robot.tick();
    ASSERT_EQ(robot.out.status.mode, Mode::kPending);
    if (stop) {
      robot.tick(OperatorCommand::kStop);
      EXPECT_EQ(robot.out.status.mode, Mode::kArmed);
    } else {
      robot.in.monitor.tripped = true;
      robot.tick();
      EXPECT_EQ(robot.out.status.mode, Mode::kTripped);
      EXPECT_EQ(robot.out.status.refusal.reason, Refusal::kCancelled);
    }
    robot.run_until(robot.in.tick + 3000);
    EXPECT_EQ(robot.out.status.course.coming, 0);
    EXPECT_EQ(robot.out.status.course.in_force, 0);
    EXPECT_FALSE(robot.state().moving);
  }
}

// A halt ends the course in force, and one that is awaited.
TEST(Course, EndsWithAHalt) {
  GovernedBall robot(hanging_params());
  const Wide there = follow_forth(robot);
  robot.run_until(robot.in.tick + 500);
  send(robot, parts_of(6, course_back(there, robot.in.tick + 20000).values()));
  robot.run_until(robot.in.tick + 10);
  robot.tick(OperatorCommand::kHalt);
  EXPECT_EQ(robot.out.status.mode, Mode::kHalting);
  EXPECT_EQ(robot.out.status.course.coming, 0);
  for (int k = 0; k < 60000 && robot.out.status.mode != Mode::kArmed; ++k) robot.tick();
  EXPECT_EQ(robot.out.status.mode, Mode::kArmed);
  EXPECT_EQ(robot.out.status.course.in_force, 0);
  EXPECT_LE(robot.most_use, 1);
}

}  // namespace
}  // namespace ballast::firmware
