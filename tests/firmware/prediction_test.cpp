// The controller's prediction of a stop against the plant that then executes it: another derivation,
// integrated to 1e-13. The masses are prescribed, so that the motors' swinging, which the prediction leaves out, is
// left out here too.
#include "firmware/control/prediction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "firmware/control/controller.h"
#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"
#include "tests/firmware/paper_ball.h"
#include "tests/firmware/whole_tick.h"

namespace ballast::firmware {
namespace {

sim::Scenario paper_scenario(double duration_s) {
  const BallParams ball = testing::paper_ball();
  sim::Scenario s;
  s.duration_s = duration_s;
  s.gravity_mps2 = ball.gravity_mps2;
  s.ball.radius_m = ball.radius_m;
  s.ball.mass_kg = ball.shell_mass_kg;
  s.ball.inertia_kgm2 = ball.inertia_kgm2;
  s.ball.center_of_mass_B_m = ball.center_of_mass_B_m;
  // Perfect friction, the default: the closed forms know of no slip, and some of these stops would cause it.
  s.run.actuation = sim::Actuation::kPrescribed;
  s.run.on_violation = sim::OnViolation::kContinue;
  for (std::size_t i = 0; i < 3; ++i) {
    sim::Mass m;
    m.mass_kg = 1;
    m.rail = ball.rail[i];
    m.initial_position = testing::kPaperStart[i];
    for (const ProfilePiece& p : testing::kPaperMotion) {
      m.motion.push_back({p.duration_s, p.acceleration_start, p.acceleration_end});
    }
    s.masses.push_back(m);
  }
  return s;
}

// The whole prediction at once. `count`: how many steps it took.
Prediction predict_motion(const BallParams& ball, const Quaternion& orientation, const MassMotion& masses,
                          const PerMass<Profile>& profiles, int steps_at_once = 1, int* count = nullptr) {
  Predictor predictor;
  predictor.begin(orientation, Vector3::Zero(), masses, 0.001, 1, profiles, ball.mass_count);
  EXPECT_FALSE(predictor.complete());
  int steps = 0;
  for (; !predictor.complete() && steps < 1000; ++steps) predictor.advance(ball, 0.35, profiles, steps_at_once);
  EXPECT_TRUE(predictor.complete());
  if (count != nullptr) *count = steps;
  return predictor.result();
}

void expect_prediction_is_what_the_plant_shows(int stop_tick) {
  SCOPED_TRACE(::testing::Message() << "stop in tick " << stop_tick);
  const double start_s = (stop_tick + 1) * 0.001;
  sim::Scenario scenario = paper_scenario(100);
  sim::Plant plant(scenario);
  const auto params = std::make_unique<ControllerParams>(testing::paper_params());
  const auto state = std::make_unique<ControllerState>();
  reset(*params, *state);
  Inputs in;
  Outputs out;
  for (std::int64_t k = -2; k <= stop_tick; ++k) {
    if (k > 0) plant.advance(static_cast<double>(k) * 0.001, {});
    const sim::Plant::Sample sample = plant.sample();
    in.tick = in.sensors.tick = in.monitor.tick = k;
    const auto& q = sample.orientation;
    in.sensors.orientation = Quaternion(q[0], q[1], q[2], q[3]);
    for (int j = 0; j < 3; ++j) in.sensors.gyro_B_radps[j] = sample.angular_velocity_B_radps[j];
    in.operator_command = k == -2          ? OperatorCommand::kArm
                          : k == -1        ? OperatorCommand::kStart
                          : k == stop_tick ? OperatorCommand::kStop
                                           : OperatorCommand::kNone;
    whole_tick(*params, *state, in, out);
  }
  ASSERT_EQ(out.status.mode, Mode::kStopping);
  // The prediction goes on by itself, from what was sensed in the tick of the stop.
  for (int k = 0; !out.status.planned; ++k) {
    ASSERT_LT(k, 14) << "27 steps, 2 a tick";
    ++in.tick;
    in.sensors = Sensors();
    in.sensors.tick = in.monitor.tick = in.tick;
    in.operator_command = OperatorCommand::kNone;
    whole_tick(*params, *state, in, out);
  }
  const Prediction& plan = out.status.plan;

  // The same run once more with the stop as part of what is prescribed: the paper's pieces cut off at its start (they
  // are over by then), the stop's own appended.
  for (std::size_t i = 0; i < 3; ++i) {
    scenario.masses[i].motion.push_back({start_s - 0.2, 0, 0});
    const Profile& stop = state->active[i];
    for (int p = 0; p < stop.piece_count(); ++p) {
      const Cubic& c = stop.cubic(p);
      scenario.masses[i].motion.push_back({c.duration_s, c.acceleration, c.acceleration + c.duration_s * c.jerk});
    }
  }
  scenario.duration_s = start_s + plan.duration_s;
  sim::Plant truth(scenario);
  truth.advance(start_s, {});
  double n_min = 1e300, mu_max = 0;
  constexpr int kSamples = 2000;
  for (int k = 0; k <= kSamples; ++k) {
    if (k > 0) truth.advance(start_s + plan.duration_s * k / kSamples, {});
    const sim::Plant::Sample sample = truth.sample();
    n_min = std::min(n_min, sample.normal_force_n);
    mu_max = std::max(mu_max, sample.static_friction_n / sample.normal_force_n);
  }
  // Along the stop the ball turns at up to 1 rad/s. An interval is 11 ms: the midpoint rule's error of the attitude is
  // about (1 rad/s * 0.011 s)^3 / 12 an interval, 2e-6 in all; what counts is the maximum missed between the points,
  // (h/2)^2 / 2 of a second derivative that, N and f_s having corners at the pieces' borders only, is that of the
  // attitude's and the masses' motion: up to 100 /s^2, so 1.5e-3 at most.
  EXPECT_NEAR(plan.normal_force_min_n, n_min, 1.5e-3 * n_min);
  EXPECT_NEAR(plan.mu_required_max, mu_max, 1.5e-3);
  EXPECT_NEAR(plan.margin_min, 1 - mu_max / 0.35, 1.5e-3 / 0.35);
}

TEST(Prediction, OfAStopIsWhatThePlantThenShows) {
  for (const int tick : {210, 1000, 3000, 5765, 9000, 14000}) expect_prediction_is_what_the_plant_shows(tick);
}

// A ball set down askew rolls to and fro for as long as nothing happens. A prediction looks as far ahead as its few
// steps carry, and says how far.
TEST(Prediction, OfALongMoveEndsAtItsHorizon) {
  const Quaternion askew(std::cos(0.2), std::sin(0.2), 0, 0);
  sim::Scenario scenario = paper_scenario(100);
  for (sim::Mass& mass : scenario.masses) mass.motion.clear();
  scenario.initial.orientation = askew;
  PerMass<Profile> profiles;
  MassMotion now;
  for (std::size_t i = 0; i < 3; ++i) now.position[i] = testing::kPaperStart[i];
  for (const double duration_s : {1.0, 5.0, 100.0, 1e5}) {
    // At rest for so long.
    const ProfilePiece resting[] = {{duration_s, 0, 0}};
    for (std::size_t i = 0; i < 3; ++i) ASSERT_TRUE(profiles[i].set(testing::kPaperStart[i], 0, resting, 1));
    const Prediction p = predict_motion(testing::paper_ball(), askew, now, profiles);
    EXPECT_EQ(p.duration_s, duration_s);
    // 16 intervals and 3 borders: 19 steps of 0.5 sqrt(r / g) or less.
    EXPECT_LE(p.horizon_s, std::min(duration_s, 9.5));
    EXPECT_GT(p.horizon_s, std::min(duration_s, 4.0) - 1e-12);
    sim::Plant truth(scenario);
    double n_min = 1e300, mu_max = 0;
    for (int k = 0; k <= 1000; ++k) {
      if (k > 0) truth.advance(0.001 + p.horizon_s * k / 1000, {});
      const sim::Plant::Sample sample = truth.sample();
      n_min = std::min(n_min, sample.normal_force_n);
      mu_max = std::max(mu_max, sample.static_friction_n / sample.normal_force_n);
    }
    // The rule's error is (h w)^2 / 24 of the phase; what an extremum between two points loses, (h w)^2 / 8 of the
    // swing: 3 % with h w = 0.5, of N - weight and of f_s/N.
    EXPECT_NEAR(p.normal_force_min_n, n_min, 0.05 * (4 - n_min)) << duration_s;
    EXPECT_NEAR(p.mu_required_max, mu_max, 0.05 * mu_max) << duration_s;
  }
}

bool same(const Prediction& a, const Prediction& b) {
  return a.duration_s == b.duration_s && a.horizon_s == b.horizon_s && a.normal_force_min_n == b.normal_force_min_n &&
         a.mu_required_max == b.mu_required_max && a.margin_min == b.margin_min;
}

// How many steps are done at once changes nothing, and there are never more than stated.
TEST(Prediction, DoesNotDependOnItsSlices) {
  PerMass<Profile> profiles;
  MassMotion now;
  int borders = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const Wide flat = 0.3 + 0.15 * static_cast<Wide>(i);
    const ProfilePiece pieces[] = {{0.2, 0, -1}, {flat, -1, -1}, {0.2, -1, 0}};
    ASSERT_TRUE(profiles[i].set(testing::kPaperStart[i], 0.2 + flat, pieces, 3));
    borders += profiles[i].piece_count();
    put(profiles[i].at(0), i, now);
  }
  const Quaternion askew(std::cos(0.2), std::sin(0.2), 0, 0);
  int steps = 0;
  const Prediction one = predict_motion(testing::paper_ball(), askew, now, profiles, 1, &steps);
  EXPECT_EQ(one.horizon_s, 1.0);
  EXPECT_GT(steps, kPredictionIntervals);
  EXPECT_LE(steps, most_prediction_steps(1, borders));
  for (const int at_once : {2, 6, 1000}) {
    int calls = 0;
    EXPECT_TRUE(same(predict_motion(testing::paper_ball(), askew, now, profiles, at_once, &calls), one)) << at_once;
    EXPECT_EQ(calls, (steps + at_once - 1) / at_once);
  }
}

TEST(Prediction, DroppedItEndsAndBegunAgainItStartsAnew) {
  PerMass<Profile> profiles, others;
  MassMotion now;
  for (std::size_t i = 0; i < 3; ++i) {
    const ProfilePiece pieces[] = {{0.3, -1, 0}};
    ASSERT_TRUE(profiles[i].set(testing::kPaperStart[i], 0.15, pieces, 1));
    ASSERT_TRUE(others[i].set(testing::kPaperStart[i], 0, nullptr, 0));
    put(profiles[i].at(0), i, now);
  }
  const BallParams ball = testing::paper_ball();
  Predictor predictor;
  EXPECT_FALSE(predictor.complete());
  predictor.advance(ball, 0.35, others, 5);
  EXPECT_FALSE(predictor.complete()) << "nothing has begun";
  predictor.begin(Quaternion(1, 0, 0, 0), Vector3(0, 1, 0), now, 0.001, 1, others, 3);
  predictor.advance(ball, 0.35, others, 1);
  predictor.drop();
  predictor.advance(ball, 0.35, others, 1000);
  EXPECT_FALSE(predictor.complete());
  predictor.begin(Quaternion(1, 0, 0, 0), Vector3::Zero(), now, 0.001, 1, profiles, 3);
  predictor.advance(ball, 0.35, profiles, 3);
  predictor.begin(Quaternion(1, 0, 0, 0), Vector3::Zero(), now, 0.001, 1, profiles, 3);
  predictor.advance(ball, 0.35, profiles, 1000);
  ASSERT_TRUE(predictor.complete());
  const Prediction result = predictor.result();
  EXPECT_TRUE(same(result, predict_motion(ball, Quaternion(1, 0, 0, 0), now, profiles)));
  predictor.advance(ball, 0.35, others, 1000);
  EXPECT_TRUE(same(predictor.result(), result)) << "complete";
}

TEST(Prediction, OfABallAtRestIsItsWeight) {
  BallParams ball = testing::paper_ball();
  ball.mass_count = 0;
  ball.center_of_mass_B_m = Vector3::Zero();
  const Prediction p = predict_motion(ball, Quaternion(1, 0, 0, 0), {}, {});
  EXPECT_NEAR(p.normal_force_min_n, 1, 1e-15);
  EXPECT_NEAR(p.mu_required_max, 0, 1e-15);
  EXPECT_NEAR(p.margin_min, 1, 1e-15);
}

TEST(Prediction, WithoutNormalForceTheMarginIsGone) {
  BallParams ball = testing::paper_ball();
  ball.mass_count = 0;
  ball.external_force_W_n = Vector3(0, 0, 10);
  const Prediction p = predict_motion(ball, Quaternion(1, 0, 0, 0), {}, {});
  EXPECT_LT(p.normal_force_min_n, 0);
  EXPECT_TRUE(std::isinf(p.mu_required_max));
  EXPECT_EQ(p.margin_min, -1);
}

}  // namespace
}  // namespace ballast::firmware
