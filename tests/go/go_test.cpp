// Courses that are planned, handed over and followed while a run is under way.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "hal/lcm/messages.h"
#include "tests/go/clicked_run.h"
#include "tools/go/course_parts.h"
#include "tools/go/go_plan.h"
#include "tools/go/lost_course.h"
#include "tools/go/standpoint.h"
#include "tools/program/params.h"
#include "tools/tracking/followed_plan.h"

namespace ballast::go_test {
namespace {

constexpr int kLatency = 300;  // ticks that a planner takes here

void expect_there(const Clicked& c) {
  ASSERT_TRUE(c.planned) << c.why;
  ASSERT_TRUE(c.in_force) << "refusal " << c.refusal;
  // 1 % of the path: issue 23. The way is at most as long.
  EXPECT_LE(c.off_m, 0.01 * c.way_m);
}

void expect_safe(const ClickedRun& run) {
  EXPECT_EQ(run.result.end_reason, sil::EndReason::kCompleted);
  EXPECT_FALSE(run.result.rolling_lost);
  EXPECT_LE(run.greatest_jerk_use, 1 + 1e-9);  // rounding of the difference of two accelerations
}

// Masses that are exactly where they are commanded need no slow courses.
sim::Scenario ideal(double duration_s) { return clickable(duration_s, {"run.actuation=ideal"}); }

TEST(Go, FromRest) {
  const auto run = run_clicked(ideal(25), {{100, {0.6, 0.3}}}, kLatency);
  expect_safe(run);
  expect_there(run.clicked[0]);
}

TEST(Go, WithSteppers) {
  const auto run = run_clicked(clickable(40), {{100, {0.6, 0}}}, kLatency);
  expect_safe(run);
  expect_there(run.clicked[0]);
  for (const sil::MotorRecord& motor : run.result.motors) EXPECT_EQ(motor.slips, 0);
}

// A ball rocks on a slope, above masses that are too slow to stay behind it for certain. Then a halt that is not known
// to end sets it rolling downhill, ever faster.
TEST(Go, AHaltOnASlopeRestsOrIsRefused) {
  std::vector<std::string> sets{"run.actuation=ideal", "surface.slope.angle=0.1"};
  for (int i = 0; i < 3; ++i) sets.push_back("mass." + std::to_string(i) + ".motor.max_acceleration=2");
  int begun = 0;
  for (std::int64_t tick = 2700; tick <= 3300; tick += 40) {
    SCOPED_TRACE(tick);
    const auto run = run_clicked(clickable(25, sets), {{.tick = tick, .halt = true}}, kLatency);
    expect_safe(run);
    begun += run.halted[0].said;
    // It rocks with a little less. Balls that were set rolling were ten times as fast by then.
    EXPECT_LT(run.result.final_sample.velocity_W_mps.norm(), 0.25);
  }
  EXPECT_GT(begun, 0);
}

// On this way a stop after some seconds would break the cone. The course needs none: it is certified up to its end
// while the first certificate, of its first seconds, holds.
TEST(Go, WhereNoStopHolds) {
  const auto run = run_clicked(clickable(60), {{100, {1.073, -0.743}}}, kLatency);
  expect_safe(run);
  expect_there(run.clicked[0]);
}

// A way on which the search for a single motion mostly fails: with rests on it. Masses are ideal, because with steppers
// one course in twenty goes over to its backup.
TEST(Go, AFarPlace) {
  const auto run = run_clicked(ideal(60), {{100, {-2.2, 1.1}}}, kLatency);
  expect_safe(run);
  expect_there(run.clicked[0]);
}

// On a long way the ball sets out to a rest on it, and goes on from there.
TEST(Go, SetsOutToARestOnALongWay) {
  const auto run = run_clicked(ideal(60), {{.tick = 100, .to_m = {-1.3, 0.5}, .sets_out = true}}, kLatency);
  expect_safe(run);
  expect_there(run.clicked[0]);
  EXPECT_EQ(run.clicked[0].courses, 2);
}

// desk_ball at rest in the middle.
plan::ReferencePoint at_rest(sim::Scenario scenario) {
  scenario.duration_s = 0.001;
  return plan::roll_motion(plan::as_planned(scenario), 1).front();
}

go::GoOutcome plan_at_rest(const sim::Scenario& scenario, const go::GoTask& task) {
  const auto params = program::make_controller_params("go_test", scenario);
  if (params == nullptr) return {};
  return go::plan_course(
      scenario, *params, at_rest(scenario), task, [] { return false; }, [](const std::string&) {});
}

// A plan that came too late leaves its rest on the way, and its duration, to the next.
TEST(Go, BeginsASearchWithAPlanThatCameTooLate) {
  const sim::Scenario scenario = ideal(20);
  go::GoTask task;
  task.to_m = {0.3, 0.2};
  const go::GoOutcome first = plan_at_rest(scenario, task);
  ASSERT_TRUE(first.plan) << first.why;
  EXPECT_FALSE(first.plan->on_the_way);
  EXPECT_EQ(first.plan->end_m, task.to_m);
  auto late = std::make_shared<go::GoPlan>(*first.plan);
  late->on_the_way = true;
  task.to_m = {1.2, 0.8};
  task.sets_out = true;
  task.late = late;
  const go::GoOutcome next = plan_at_rest(scenario, task);
  ASSERT_TRUE(next.plan) << next.why;
  EXPECT_TRUE(next.plan->on_the_way);
  EXPECT_EQ(next.plan->end_m, first.plan->end_m);
}

double fastest(const sil::RunResult& result) {
  double most = 0;
  for (const double velocity : result.final_sample.mass_velocity) most = std::max(most, std::fabs(velocity));
  return most;
}

// A ball that is there stands still, and so do its masses, for as long as nothing moves it. Feedback alone would shake
// them at most of these places.
TEST(Go, RestsWhereItArrives) {
  constexpr double kSlow_radps = 1e-4;
  for (const Eigen::Vector2d& to_m : {Eigen::Vector2d(-0.471, 0.584), {-0.633, -0.812}, {0.336, 0.423}}) {
    const auto run = run_clicked(clickable(80), {{100, to_m}}, kLatency);
    expect_safe(run);
    expect_there(run.clicked[0]);
    EXPECT_LE(fastest(run.result), kSlow_radps);
    // Rest is slower than 0.01 sqrt(g / r).
    EXPECT_LE(run.result.final_sample.angular_velocity_B_radps.norm(), 0.081);
  }
}

// A ball that was halted may turn about the vertical for ever. It need not be stopped from that.
TEST(Go, FromABallThatTurnsWhereItRests) {
  for (const double spin_radps : {0.02, 0.06, -0.09}) {
    SCOPED_TRACE(spin_radps);
    sim::Scenario scenario = ideal(60);
    scenario.initial.angular_velocity_B_radps.z() = spin_radps;
    const auto run = run_clicked(scenario, {{100, {0.5, 0.4}}}, kLatency);
    expect_safe(run);
    expect_there(run.clicked[0]);
    // It rocks with a tenth of what counts as rest, 0.01 sqrt(g / r).
    EXPECT_LE(run.result.final_sample.angular_velocity_B_radps.norm(), std::abs(spin_radps) + 0.01);
  }
}

// A faster turn may stay, too. The ball is held where it arrives.
TEST(Go, HoldsABallThatTurnsFast) {
  const sim::Scenario scenario = ideal(20);
  const auto params = program::make_controller_params("go_test", scenario);
  ASSERT_NE(params, nullptr);
  plan::ReferencePoint at = at_rest(scenario);
  at.state.omega_B.z = 0.3;
  go::GoTask task;
  task.to_m = {0.3, 0.2};
  const go::GoOutcome outcome = go::plan_course(
      scenario, *params, at, task, [] { return false; }, [](const std::string&) {});
  ASSERT_TRUE(outcome.plan) << outcome.why;
  EXPECT_TRUE(outcome.plan->reference.holds);
}

// A small push wakes the masses of a ball that rests. Left alone it would rock for ever.
TEST(Go, ComesBackFromASmallPush) {
  sim::Scenario scenario = ideal(100);
  sim::Fault push;
  push.kind = sim::FaultKind::kPush;
  push.time_s = 50;
  push.end_s = 50.1;
  push.value = 0.2;  // N
  scenario.faults.push_back(push);
  const auto run = run_clicked(scenario, {{100, {0.5, 0.2}}}, kLatency);
  expect_safe(run);
  expect_there(run.clicked[0]);
  // A tenth of what counts as rest, 0.01 sqrt(g r).
  EXPECT_LE(run.result.final_sample.velocity_W_mps.norm(), 0.0012);
}

// The second click replaces the first course while the ball rolls.
TEST(Go, WhileRolling) {
  const auto run = run_clicked(ideal(40), {{100, {0.8, 0.2}}, {4000, {0.6, 0.4}}}, kLatency);
  expect_safe(run);
  ASSERT_TRUE(run.clicked[0].in_force);
  EXPECT_TRUE(run.clicked[1].rolling);
  expect_there(run.clicked[1]);
}

// From a place where a course has ended, the controller still on it.
TEST(Go, FromTheEndOfACourse) {
  const auto run = run_clicked(ideal(60), {{100, {0.5, 0.1}}, {30000, {0, 0}}}, kLatency);
  expect_safe(run);
  expect_there(run.clicked[0]);
  EXPECT_FALSE(run.clicked[1].rolling);
  expect_there(run.clicked[1]);
}

// A link that drops a part: the course is refused, and the one in force goes on to its end.
TEST(Go, APartThatIsLost) {
  for (const int part : {0, 1, 40}) {
    const auto run = run_clicked(ideal(30), {{100, {0.8, 0}}, {3000, {0.9, 0.1}, part}}, kLatency);
    expect_safe(run);
    EXPECT_TRUE(run.clicked[1].planned) << run.clicked[1].why;
    EXPECT_FALSE(run.clicked[1].in_force);
    EXPECT_EQ(run.clicked[1].refusal, controller_status_t::REFUSAL_COURSE);
    const Eigen::Vector2d place = run.result.final_sample.position_W_m.head<2>();
    EXPECT_LE((place - Eigen::Vector2d(0.8, 0)).norm(), 0.01 * 0.8);
  }
}

// A planner that takes longer than it said: the course is refused as late, and the ball goes on.
TEST(Go, ALateCourse) {
  auto clicks = std::vector<Click>{{100, {0.8, 0}}, {3000, {0.9, 0.1}}};
  clicks[1].delayed_ticks = 4000;
  const auto run = run_clicked(ideal(30), clicks, kLatency);
  expect_safe(run);
  EXPECT_FALSE(run.clicked[1].in_force);
  EXPECT_EQ(run.clicked[1].refusal, controller_status_t::REFUSAL_LATE);
  const Eigen::Vector2d place = run.result.final_sample.position_W_m.head<2>();
  EXPECT_LE((place - Eigen::Vector2d(0.8, 0)).norm(), 0.01 * 0.8);
}

// A place that no motion of this robot reaches in the time is refused with what stands in the way.
TEST(Go, TooFarInTheTime) {
  constexpr double kTimeLimit_s = 5;
  const auto run = run_clicked(clickable(2), {{100, {50, 0}, -1, 0, 2.0}}, kLatency, kTimeLimit_s);
  EXPECT_FALSE(run.clicked[0].planned);
  EXPECT_NE(run.clicked[0].why.find("stands in the way"), std::string::npos) << run.clicked[0].why;
}

// A duration that is too short is refused with a nearer place and a longer duration, in words of `go`.
TEST(Go, SaysWhatCanBeDoneInstead) {
  const auto run = run_clicked(clickable(1), {{100, {0.6, 0}, -1, 0, 2.0}}, kLatency);
  const std::string& why = run.clicked[0].why;
  EXPECT_FALSE(run.clicked[0].planned);
  EXPECT_NE(why.find("it could go to ("), std::string::npos) << why;
  EXPECT_NE(why.find("it could be there in "), std::string::npos) << why;
  EXPECT_EQ(why.find("task."), std::string::npos) << why;
}

// A way or a time that no course can have is refused before any search.
TEST(Go, SaysAtOnceWhatIsBeyondOneCourse) {
  plan::ReferencePoint at{};
  at.state.q = {1, 0, 0, 0};
  const auto beyond = [&](const Eigen::Vector2d& to_m, std::optional<double> duration_s,
                          std::vector<Eigen::Vector2d> via_m = {}) {
    go::GoTask task;
    task.to_m = to_m;
    task.via_m = std::move(via_m);
    task.duration_s = duration_s;
    return go::beyond_one_course(clickable(1), at, task);
  };
  EXPECT_EQ(beyond({7, 0}, std::nullopt), "");
  EXPECT_EQ(beyond({0.6, 0}, 240), "");
  EXPECT_EQ(beyond({10, 0}, std::nullopt),
            "the way is 10 m long, and one course reaches at most 7.2 m: 6 legs of 8 radii (with --time it is tried "
            "without rests); it could go to (6.48, 0) m "
            "first");
  EXPECT_NE(beyond({1, 0}, std::nullopt, {{5, 0}}).find("the way is 9 m long"), std::string::npos);
  EXPECT_EQ(beyond({0.6, 0}, 300), "it would take 300 s, and one course takes at most 247 s");
  const auto run = run_clicked(clickable(0.5), {{100, {50, 0}}}, kLatency);
  EXPECT_FALSE(run.clicked[0].planned);
  EXPECT_LT(run.clicked[0].plan_s, 1);
}

// The shortest time is searched from a quick plan, whatever the number of its pieces.
TEST(Go, PlansTheShortestTime) {
  double duration_s[2] = {};
  for (const bool shortest : {false, true}) {
    go::GoTask task;
    task.to_m = {0.5, 0};
    if (shortest) task.objective = plan::Objective::kTime;
    const go::GoOutcome outcome = plan_at_rest(ideal(20), task);
    ASSERT_TRUE(outcome.plan) << outcome.why;
    duration_s[shortest ? 1 : 0] = outcome.plan->moved.duration_s;
  }
  EXPECT_LT(duration_s[1], duration_s[0]);
}

// desk_ball under masses that hold, at this Omega.
go::Heard armed(const sim::Scenario& scenario, double omega_radps) {
  go::Heard heard{scenario, {}, {}, std::nullopt};
  heard.status.mode = controller_status_t::MODE_ARMED;
  heard.status.motor_count = static_cast<std::int8_t>(scenario.masses.size());
  heard.plant.orientation[0] = 1;
  heard.plant.angular_velocity_B_radps[1] = omega_radps;
  return heard;
}

// A ball that rocks is another one by the time that a certificate is found, so its course begins at a tick.
TEST(Standpoint, OfABallThatRocksIsOfItsTick) {
  const sim::Scenario scenario = clickable(1);
  std::string why;
  const auto still = go::standpoint_at(armed(scenario, 0.01), 500, why);
  ASSERT_TRUE(still) << why;
  EXPECT_TRUE(still->rests);
  EXPECT_EQ(still->at.state.omega_B.y, 0);
  const auto rocks = go::standpoint_at(armed(scenario, 0.05), 500, why);
  ASSERT_TRUE(rocks) << why;
  EXPECT_FALSE(rocks->rests);
  EXPECT_NE(rocks->at.place_m[0], 0);
}

// A ball that turns about the vertical is another one later, too.
TEST(Standpoint, OfABallThatTurnsIsOfItsTick) {
  const sim::Scenario scenario = clickable(1);
  go::Heard heard = armed(scenario, 0);
  heard.plant.angular_velocity_B_radps[2] = 0.06;
  std::string why;
  const auto turns = go::standpoint_at(heard, 500, why);
  ASSERT_TRUE(turns) << why;
  EXPECT_FALSE(turns->rests);
  EXPECT_TRUE(go::ball_rests(heard));
  EXPECT_NEAR(turns->at.state.omega_B.z, 0.06, 1e-9);
  EXPECT_NEAR(2 * std::asin(turns->at.state.q[3]), 0.06 * 0.5, 1e-9);  // rad, after 500 ticks
  EXPECT_NEAR(turns->at.place_m[0], 0, 1e-9);
}

// A turn that rounding has left is none. A plan from there is refused as one from rest.
TEST(Standpoint, OfABallThatHardlyTurnsIsAtRest) {
  const sim::Scenario scenario = clickable(1);
  go::Heard heard = armed(scenario, 0);
  heard.plant.angular_velocity_B_radps[2] = 1e-5;
  std::string why;
  const auto still = go::standpoint_at(heard, 500, why);
  ASSERT_TRUE(still) << why;
  EXPECT_TRUE(still->rests);
  EXPECT_EQ(still->at.state.omega_B.z, 0);
  EXPECT_EQ(still->at.state.q[3], 0);
}

// Spin friction ends a turn, and on a slope a ball that turned about the normal would not hang.
TEST(Standpoint, KeepsNoTurnThatEnds) {
  for (const std::string set : {"surface.slope.angle=0.05", "surface.spin_friction=1e-4"}) {
    SCOPED_TRACE(set);
    const sim::Scenario scenario = clickable(1, {set});
    go::Heard heard = armed(scenario, 0);
    heard.plant.angular_velocity_B_radps[2] = 0.015;
    std::string why;
    const auto at = go::standpoint_at(heard, 500, why);
    ASSERT_TRUE(at) << why;
    EXPECT_TRUE(at->rests);
    EXPECT_EQ(at->at.state.omega_B.z, 0);
  }
}

// Where a motion has ended the ball hangs, and turns on.
TEST(Standpoint, AfterAMotionHasItsTurn) {
  const sim::Scenario scenario = clickable(60);
  go::Heard heard = armed(scenario, 0);
  heard.status.mode = controller_status_t::MODE_RUNNING;
  heard.status.tick = 50'000;
  heard.status.course_tick = 1;
  const double end_s = plan::motion_end_s(plan::as_planned(scenario));
  ASSERT_LT(end_s, 49);
  auto moved = plan::as_planned(scenario);
  moved.duration_s = end_s;
  const plan::ReferencePoint end = plan::roll_motion(moved, 1).back();
  std::copy(end.state.q.begin(), end.state.q.end(), heard.plant.orientation);
  std::copy(end.place_m.begin(), end.place_m.end(), heard.plant.position_W_m);
  const Eigen::Quaterniond q(end.state.q[0], end.state.q[1], end.state.q[2], end.state.q[3]);
  const Eigen::Vector3d omega_B = q.conjugate() * Eigen::Vector3d(0, 0, 0.05);
  std::copy(omega_B.begin(), omega_B.end(), heard.plant.angular_velocity_B_radps);
  std::string why;
  const auto at = go::standpoint_at(heard, heard.status.tick + 400, why);
  ASSERT_TRUE(at) << why;
  EXPECT_FALSE(at->rests);
  EXPECT_TRUE(at->hangs);
  const auto& turned = at->at.state.q;
  const Eigen::Quaterniond now(turned[0], turned[1], turned[2], turned[3]);
  EXPECT_NEAR(now.angularDistance(q), 0.05 * 0.4, 1e-6);  // rad, after 400 ticks
}

// In the first tick after a stop the commanded velocity is that of the tick before.
TEST(Standpoint, HasMassesThatHold) {
  const sim::Scenario scenario = clickable(1);
  go::Heard heard = armed(scenario, 0);
  heard.status.commanded_position[0] = 0.3;
  heard.status.commanded_velocity[0] = -0.02;
  heard.status.next_position[0] = 0.2999;
  std::string why;
  const auto at = go::standpoint_at(heard, 500, why);
  ASSERT_TRUE(at) << why;
  EXPECT_EQ(at->at.state.position[0], 0.2999);
  EXPECT_EQ(at->at.state.velocity[0], 0);
}

// desk_ball's own motion, started 5 s after the run. In its first second the ball has hardly moved.
TEST(Standpoint, OfAMotionIsCountedFromItsStart) {
  const sim::Scenario scenario = clickable(10);
  go::Heard heard = armed(scenario, 0);
  heard.status.mode = controller_status_t::MODE_RUNNING;
  heard.status.tick = 5500;
  heard.status.course_tick = 5000;
  std::string why;
  const auto at = go::standpoint_at(heard, 8000, why);
  ASSERT_TRUE(at) << why;
  // Mass 0 after 3 s: 0.64 rad/s at 1.6 s, then 0.8 rad/s^2 that fall to 0.1.
  EXPECT_NEAR(at->at.state.velocity[0], 1.27, 1e-9);
  EXPECT_FALSE(at->rests);
  heard.status.course_tick = 0;
  EXPECT_FALSE(go::standpoint_at(heard, 8000, why));
  EXPECT_NE(why.find("off its motion"), std::string::npos) << why;
}

TEST(LostCourse, IsOneThatStaysOnTheBackup) {
  go::LostCourse watch;
  controller_status_t status{};
  status.mode = controller_status_t::MODE_RUNNING;
  const auto after = [&](double time_s, int backup) {
    status.utime = static_cast<std::int64_t>(1e6 * time_s);
    status.backup_active = static_cast<std::int8_t>(backup);
    return watch.lost(status);
  };
  EXPECT_FALSE(after(10, 1));
  EXPECT_FALSE(after(12.9, 1));
  EXPECT_FALSE(after(12.95, 0));  // it has returned
  EXPECT_FALSE(after(13.5, 1));
  EXPECT_FALSE(after(16.4, 1));
  EXPECT_TRUE(after(16.6, 1));
  status.mode = controller_status_t::MODE_HALTING;
  EXPECT_FALSE(after(17, 1));
}

go::HostCourse small_course() {
  go::HostCourse course;
  course.number = 7;
  course.from_tick = 1234;
  course.mass.push_back({0.5, -0.25, {{0.1, 0, 1}, {0.2, 1, 0}}});
  course.mass.push_back({-1, 0, {}});
  course.reference.samples = 3;
  course.reference.period_s = 0.125;
  course.reference.holds = true;
  const int values = 3 * firmware::reference_row(2);
  for (int k = 0; k < values; ++k) course.reference.values[static_cast<std::size_t>(k)] = 0.5F * static_cast<float>(k);
  return course;
}

TEST(CourseParts, GiveTheCourseBack) {
  const go::HostCourse course = small_course();
  go::CourseParts parts;
  std::optional<go::HostCourse> back;
  for (const firmware::CoursePart& part : go::parts_of(course)) {
    EXPECT_FALSE(back.has_value());
    const operator_t message = hal::to_message(firmware::OperatorInput(part), 0, 1, 1e-3);
    EXPECT_TRUE(hal::in_range(message));
    back = parts.take(message);
  }
  ASSERT_TRUE(back.has_value());
  EXPECT_EQ(back->number, course.number);
  EXPECT_EQ(back->from_tick, course.from_tick);
  ASSERT_EQ(back->mass.size(), 2U);
  EXPECT_EQ(back->mass[0].velocity, -0.25);
  ASSERT_EQ(back->mass[0].motion.size(), 2U);
  EXPECT_EQ(back->mass[0].motion[1].duration_s, 0.2);
  EXPECT_EQ(back->reference.values, course.reference.values);
  EXPECT_TRUE(back->reference.holds);
}

TEST(CourseParts, MayComeInAnyOrder) {
  const auto sent = go::parts_of(small_course());
  ASSERT_GT(sent.size(), 1U);
  go::CourseParts parts;
  const auto message = [&](std::size_t k) { return hal::to_message(firmware::OperatorInput(sent[k]), 0, 1, 1e-3); };
  operator_t other = message(1);  // of another course, which stays incomplete
  other.course = 8;
  EXPECT_FALSE(parts.take(other).has_value());
  for (std::size_t k = sent.size(); k-- > 1;) {
    EXPECT_FALSE(parts.take(message(k)).has_value());
    EXPECT_FALSE(parts.take(message(k)).has_value());
  }
  const auto course = parts.take(message(0));
  ASSERT_TRUE(course.has_value());
  EXPECT_EQ(course->reference.values, small_course().reference.values);
  EXPECT_FALSE(parts.take(message(0)).has_value());  // it is complete
}

}  // namespace
}  // namespace ballast::go_test
