// A controller, a monitor and a planner that believe another robot than the plant has.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/sil/kept_laps.h"
#include "tools/summary/summary.h"
#include "tools/summary/summary_tree.h"

namespace ballast::sil {
namespace {

sim::ScenarioResult read(const std::string& name, const std::vector<std::string>& overrides) {
  return sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + name + ".toml", overrides);
}

sim::Scenario load(const std::string& name, const std::vector<std::string>& overrides) {
  const auto found = read(name, overrides);
  for (const auto& error : found.errors) ADD_FAILURE() << to_string(error);
  return found.scenario;
}

const std::vector<std::string> kWrong{"duration=3",
                                      "believed.ball.mass=1.4",
                                      "believed.ball.inertia=[1.2,1.3,1.4]",
                                      "believed.ball.center_of_mass=[0.02,0,-0.02]",
                                      "believed.surface.static_friction=0.6",
                                      "believed.surface.rolling_resistance=0.02",
                                      "believed.surface.slope.angle=0.03",
                                      "believed.mass=[{mass=1.3},{},{mass=0.7}]"};

TEST(Belief, WithoutItEverythingIsTheTruth) {
  const sim::Scenario s = load("paper_ball", {});
  EXPECT_FALSE(s.believed);
  EXPECT_EQ(&s.belief(), static_cast<const sim::World*>(&s));
  EXPECT_FALSE(roll(load("paper_ball", {"duration=0.1"})).result.belief);
}

TEST(Belief, KeysThatAreNotWrittenKeepTheTruth) {
  const sim::Scenario s = load("paper_ball", kWrong);
  ASSERT_TRUE(s.believed);
  EXPECT_EQ(s.belief().ball.mass_kg, 1.4);
  EXPECT_EQ(s.belief().ball.radius_m, s.ball.radius_m);
  EXPECT_EQ(s.belief().masses[0].mass_kg, 1.3);
  EXPECT_EQ(s.belief().masses[1].mass_kg, s.masses[1].mass_kg);
  EXPECT_EQ(s.belief().surface.kinetic_friction, s.surface.kinetic_friction);
  EXPECT_EQ(s.ball.mass_kg, 1);
  // --set of the truth comes through where the belief says nothing.
  EXPECT_EQ(load("paper_ball", {"believed.ball.mass=2", "mass.1.mass=3"}).belief().masses[1].mass_kg, 3);
  // A floor believed to be smoother than the truth's kinetic friction.
  EXPECT_EQ(load("paper_ball", {"believed.surface.static_friction=0.1"}).belief().surface.kinetic_friction, 0.1);
}

// A belief that equals the truth changes no message but the fingerprint.
TEST(Belief, OfTheTruthChangesNothing) {
  const Rolled with = roll(load("desk_ball", {"duration=0.4", "believed={}"})),
               without = roll(load("desk_ball", {"duration=0.4"}));
  ASSERT_EQ(with.laps.size(), without.laps.size());
  for (std::size_t k = 0; k < with.laps.size(); ++k) {
    const contact_t &a = with.laps[k].plant.contact, &b = without.laps[k].plant.contact;
    ASSERT_EQ(a.normal_force_n, b.normal_force_n) << k;
    ASSERT_EQ(a.margin, b.margin) << k;
    if (k > 2) {
      ASSERT_EQ(a.commanded_normal_force_n, b.commanded_normal_force_n) << k;
    }
    ASSERT_EQ(with.laps[k].answer->status.normal_force_n, without.laps[k].answer->status.normal_force_n) << k;
  }
  ASSERT_TRUE(with.result.belief);
  EXPECT_EQ(with.result.belief->time_s, 0.4);
}

// The guard stays at rounding however wrong the belief is: 1e-9 of the weight, as without one.
TEST(Belief, CommandedForcesAreThoseOfTheController) {
  const sim::Scenario scenario = load("paper_ball", kWrong);
  const Rolled run = roll(scenario);
  EXPECT_EQ(run.result.trip.tripped, 0);
  double apart = 0, of_truth = 0;
  for (std::size_t k = 3; k < run.laps.size(); ++k) {
    const contact_t& contact = run.laps[k].plant.contact;
    const controller_status_t& status = run.laps[k].answer->status;
    apart = std::max({apart, std::abs(contact.commanded_normal_force_n - status.normal_force_n),
                      std::abs(contact.commanded_static_friction_n - status.static_friction_n)});
    of_truth = std::max(of_truth, std::abs(contact.normal_force_n - status.normal_force_n));
  }
  EXPECT_LT(apart, 1e-8);
  EXPECT_GT(of_truth, 0.1) << "the belief is no other";
}

// The true floor is worse than believed: the plant slips, and the monitor sees the slide. The margin is the truth's.
TEST(Belief, OfABetterFloorDoesNotHideASlip) {
  const Rolled run = roll(load("paper_ball", {"surface.static_friction=0.12", "run.on_violation=continue",
                                              "believed.surface.static_friction=0.5"}));
  EXPECT_EQ(run.result.end_reason, EndReason::kTripped);
  EXPECT_EQ(run.result.trip.cause, trip_t::CAUSE_FRICTION);
  EXPECT_EQ(run.result.trip.limit, 0.5);
  for (std::size_t k = 3; k < run.laps.size() && run.laps[k].plant.contact.regime == 0; ++k) {
    const contact_t& c = run.laps[k].plant.contact;
    ASSERT_NEAR(c.margin, 1 - c.static_friction_n / (0.12 * c.normal_force_n), 1e-12);
    const controller_status_t& s = run.laps[k].answer->status;
    ASSERT_NEAR(s.margin, 1 - s.static_friction_n / (0.5 * s.normal_force_n), 1e-12);
  }
}

// A floor with patches: margins are those of the place, controller and monitor take the floor between the patches, and
// the guard of their disagreement stays at rounding all the same.
TEST(Belief, OfAFloorWithPatchesIsTheFloorBetweenThem) {
  for (const char* actuation : {"stepper", "ideal"}) {
    SCOPED_TRACE(actuation);
    const sim::Scenario s = load(
        "paper_ball", {"duration=8", "surface.static_friction=0.5", std::string("run.actuation=") + actuation,
                       "surface.patch=[{ circle = { center = [0, 0], radius = 0.5 }, static_friction = 0.9, "
                       "rolling_resistance = 0.05 }, { circle = { center = [0, 0], radius = 0.2 }, static_friction = "
                       "0.4 }]"});
    const Rolled run = roll(s);
    EXPECT_EQ(run.result.trip.tripped, 0) << "cause " << static_cast<int>(run.result.trip.cause);
    ASSERT_TRUE(run.result.belief);
    std::array<int, 3> seen{};
    double apart = 0;
    for (std::size_t k = 3; k < run.laps.size(); ++k) {
      const contact_t& c = run.laps[k].plant.contact;
      const controller_status_t& status = run.laps[k].answer->status;
      const double* z = run.laps[k].plant.state.position_W_m;
      const double away = std::hypot(z[0], z[1]);
      const std::size_t where = away < 0.2 ? 0 : away < 0.5 ? 1 : 2;
      ++seen[where];
      ASSERT_NEAR(c.margin, 1 - c.static_friction_n / (std::array{0.4, 0.9, 0.5}[where] * c.normal_force_n), 1e-12);
      ASSERT_NEAR(status.margin, 1 - status.static_friction_n / (0.5 * status.normal_force_n), 1e-12);
      apart = std::max({apart, std::abs(c.commanded_normal_force_n - status.normal_force_n),
                        std::abs(c.commanded_static_friction_n - status.static_friction_n)});
    }
    for (const int ticks : seen) EXPECT_GT(ticks, 100);
    EXPECT_LT(apart, 1e-8);  // 1e-9 of the weight, as without patches
  }
}

// A patch that nobody is told of: the ball slips there, and the monitor sees the slide.
TEST(Belief, OfNoPatchDoesNotHideASlipOnOne) {
  const Rolled run = roll(load(
      "paper_ball", {"surface.static_friction=0.5", "run.on_violation=continue",
                     "surface.patch=[{ polygon = [[0.3, -9], [9, -9], [9, 9], [0.3, 9]], static_friction = "
                     "0.02 }, { polygon = [[-0.3, -9], [-9, -9], [-9, 9], [-0.3, 9]], static_friction = 0.02 }]"}));
  EXPECT_EQ(run.result.end_reason, EndReason::kTripped);
  EXPECT_EQ(run.result.trip.cause, trip_t::CAUSE_FRICTION);
  EXPECT_EQ(run.result.trip.limit, 0.5);
  EXPECT_TRUE(run.result.rolling_lost);
}

// Set down on a floor that slips at once.
TEST(Belief, OfABetterFloorDoesNotHideASlipAtTheStart) {
  const Rolled run = roll(
      load("paper_ball", {"surface.static_friction=0.01", "run.on_violation=continue", "duration=1",
                          "initial.orientation=[0.9,0.4358898943540674,0,0]", "believed.surface.static_friction=0.9"}));
  EXPECT_EQ(run.laps.back().plant.contact.regime, contact_t::REGIME_SLIDING);
  ASSERT_EQ(run.result.trip.tripped, 1);
  EXPECT_EQ(run.result.trip.cause, trip_t::CAUSE_FRICTION);
  EXPECT_EQ(run.result.trip.trip_time_s, 0);
}

// The monitor judges by a worse floor than there is, and takes no margin of the true one for a lie.
TEST(Belief, OfAWorseFloorTripsEarlier) {
  const RunResult result = roll(load("paper_ball", {"believed.surface.static_friction=0.1"})).result;
  EXPECT_EQ(result.end_reason, EndReason::kTripped);
  EXPECT_EQ(result.trip.cause, trip_t::CAUSE_FRICTION);
  EXPECT_EQ(result.trip.limit, 0.1);
  EXPECT_FALSE(result.rolling_lost);
}

// The prediction is the run of a scenario in which the belief is true, with ideal masses.
TEST(Belief, IsPredictedBesideTheTruth) {
  std::vector<std::string> overrides = kWrong;
  overrides[0] = "duration=4";
  const sim::Scenario scenario = load("paper_ball", overrides);
  const RunResult run = roll(scenario).result;
  sim::Scenario as_true = sim::as_believed(scenario);
  EXPECT_FALSE(as_true.believed);
  as_true.run.actuation = sim::Actuation::kPrescribed;
  const RunResult other = roll(as_true).result;
  ASSERT_TRUE(run.belief);
  EXPECT_EQ(run.belief->time_s, 4);
  EXPECT_NEAR(run.belief->extrema.mu_required_max.value, other.extrema.mu_required_max.value, 1e-9);
  EXPECT_NEAR(run.belief->extrema.normal_force_min.value, other.extrema.normal_force_min.value, 1e-9);
  EXPECT_LT((run.belief->position_W_m - other.final_sample.position_W_m).norm(), 1e-9);
  EXPECT_GT((run.belief->position_W_m - run.final_sample.position_W_m).norm(), 1e-3);
  // The rows for pictures run from the start to the end, and their least N is no less than the located one.
  const std::vector<BeliefRow>& rows = run.belief->rows;
  ASSERT_GE(rows.size(), 1000);
  EXPECT_LE(rows.size(), 2001);
  EXPECT_EQ(rows.front().time_s, 0);
  EXPECT_EQ(rows.back().time_s, 4);
  EXPECT_EQ(rows.back().position_W_m, Eigen::Vector2d(run.belief->position_W_m.head<2>()));
  for (std::size_t i = 1; i < rows.size(); ++i) {
    EXPECT_GT(rows[i].time_s, rows[i - 1].time_s);
    EXPECT_GE(rows[i].normal_force_n, run.belief->extrema.normal_force_min.value - 1e-9);
  }
  const std::string table = belief_csv(run);
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 1 + static_cast<std::ptrdiff_t>(rows.size()));
  const auto summary = summary_tree(scenario, run);
  EXPECT_EQ(summary["belief"]["time"], 4.0);
  EXPECT_NE(summary_text(scenario, run, "runs/x").find("\n  believed    "), std::string::npos);
  RunOptions without;
  without.predict_belief = false;
  EXPECT_FALSE(roll(scenario, without).result.belief);
}

// A run that is cut short says how far the prediction went.
TEST(Belief, IsPredictedAsFarAsTheRunWent) {
  const RunResult run =
      roll(load("paper_ball", {"surface.static_friction=0.12", "believed.surface.static_friction=0.5"})).result;
  EXPECT_EQ(run.end_reason, EndReason::kSlipped);
  ASSERT_TRUE(run.belief);
  EXPECT_EQ(run.belief->end, sim::PhysicsEnd::kNone);
  EXPECT_NEAR(run.belief->time_s, run.final_sample.time_s, 1e-12);
}

TEST(Belief, RefusesWhatCannotBeBelieved) {
  struct Case {
    std::vector<std::string> overrides;
    const char *key, *why;
  };
  const Case cases[] = {
      {{"believed=1"}, "believed", "a table"},
      {{"believed.ball=1"}, "believed.ball", "a table"},
      {{"believed.ball.mass=0"}, "believed.ball.mass", "> 0"},
      {{"believed.ball.mass=nan"}, "believed.ball.mass", "finite"},
      {{"believed.ball.mass=heavy"}, "believed.ball.mass", "number"},
      {{"believed.ball.inertia=[1,1]"}, "believed.ball.inertia", "array of 3"},
      {{"believed.ball.inertia=[5,1,1]"}, "believed.ball.inertia.0", "sum of the other two"},
      {{"believed.ball.center_of_mass=[0,0,1.5]"}, "believed.ball.center_of_mass", "inside the ball"},
      {{"believed.ball.radius=0.9"}, "believed.ball.radius", "leaves the rails no room: mass.0.rail.radius"},
      {{"believed.ball.restitution=0.5"}, "believed.ball.restitution", "unknown key"},
      {{"believed.surface.static_friction=-1"}, "believed.surface.static_friction", "> 0"},
      {{"believed.surface.static_friction=0.2", "believed.surface.kinetic_friction=0.3"},
       "believed.surface.kinetic_friction",
       "<= believed.surface.static_friction = 0.2"},
      {{"believed.surface.rolling_resistance=-1"}, "believed.surface.rolling_resistance", ">= 0"},
      {{"believed.surface.spin_friction=nan"}, "believed.surface.spin_friction", "finite"},
      {{"believed.surface.slope.angle=2"}, "believed.surface.slope.angle", ">= 0 and < 1.57"},
      {{"believed.surface.restitution=0.5"}, "believed.surface.restitution", "unknown key"},
      {{"believed.mass=[{},{},{},{mass=1}]"}, "believed.mass", "has 4 entries"},
      {{"believed.mass=[{mass=-1}]"}, "believed.mass.0.mass", "> 0"},
      {{"believed.mass=[{rail=1}]"}, "believed.mass.0.rail", "unknown key"},
      {{"believed.gravity=1"}, "believed.gravity", "unknown key"},
  };
  for (const Case& bad : cases) {
    const auto found = read("paper_ball", bad.overrides);
    ASSERT_EQ(found.errors.size(), 1u) << bad.key << (found.errors.empty() ? "" : to_string(found.errors.back()));
    EXPECT_EQ(found.errors[0].key, bad.key);
    EXPECT_NE(found.errors[0].message.find(bad.why), std::string::npos) << to_string(found.errors[0]);
  }
}

TEST(Belief, IsInTheFingerprint) {
  const std::int64_t truth = load("paper_ball", {}).id;
  std::vector<std::int64_t> ids{truth};
  for (std::size_t k = 1; k < kWrong.size(); ++k) {
    ids.push_back(load("paper_ball", {kWrong[k]}).id);
    for (std::size_t j = 0; j + 1 < ids.size(); ++j) EXPECT_NE(ids.back(), ids[j]) << kWrong[k];
  }
}

}  // namespace
}  // namespace ballast::sil
