// Plans on floors with patches. Each plan is rolled by the plant on the floor as it is written.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "sim/plant/local_floor.h"
#include "tests/plan/desk_task.h"
#include "tools/plan/bounds.h"
#include "tools/plan/write_plan.h"

namespace ballast::plan {
namespace {

const std::string kFloor = "static_friction = 0.5\n";

// Across the straight way to (0.5, 0), 0.1 m wide.
std::string strip(const std::string& keys) {
  return "[[surface.patch]]\npolygon = [[0.2, -2], [0.3, -2], [0.3, 2], [0.2, 2]]\n" + keys + "\n";
}

struct Rolled {
  bool found = false;
  double duration_s = 0, mu_required = 0;
  double most_use = 0;      // greatest f_s / (mu_s N), with the mu_s of the place
  double most_on_ice = 0;   // greatest f_s / N where mu_s is below that of the floor
  double goal_error_m = 0;  // at the end
};

// Plans, and rolls the written plan in steps of 1 ms.
Rolled rolled(const std::string& toml) {
  Rolled out;
  const TaskFile task = read_task(toml);
  const Outcome outcome = search(make_problem(task), task.scenario, {});
  EXPECT_TRUE(outcome.plan) << outcome.binding;
  if (!outcome.plan) return out;
  const auto written = sim::parse_scenario(plan_toml(toml, task, *outcome.plan), "plan.toml");
  EXPECT_TRUE(written.ok());
  if (!written.ok()) return out;
  out.found = true;
  out.duration_s = written.scenario.duration_s;
  sim::Plant plant(written.scenario);
  const int steps = static_cast<int>(std::ceil(out.duration_s / 1e-3));
  for (int k = 1; k <= steps; ++k) {
    plant.advance(out.duration_s * k / steps, {});
    const sim::Sample at = plant.sample();
    const double need = at.static_friction_n / at.normal_force_n;
    out.most_use = std::max(out.most_use, need / at.floor_static_friction);
    if (at.floor_static_friction < written.scenario.surface.static_friction)
      out.most_on_ice = std::max(out.most_on_ice, need);
  }
  EXPECT_EQ(plant.end(), sim::PhysicsEnd::kNone);
  out.mu_required = plant.extrema().mu_required_max.value;
  out.goal_error_m = (plant.sample().position_W_m.head<2>() - task.task.goal_m).norm();
  EXPECT_LT(out.goal_error_m, 1e-3);  // the planner's own bar is half of it
  return out;
}

// On a floor that is ice everywhere the task is impossible: 0.5 m in 6 s take f_s/N = 0.0057, and the ice allows
// 0.0032.
TEST(PlanOnPatches, IceAcrossTheWayIsCrossedWithLittleFriction) {
  const std::string task = "goal = [0.5, 0]\nduration = 6.0\n";
  EXPECT_EQ(outcome_of(desk_task("static_friction = 0.004\n", task)).status, Status::kInfeasible);
  const Rolled run = rolled(desk_task(kFloor + strip("static_friction = 0.004"), task));
  ASSERT_TRUE(run.found);
  EXPECT_LE(run.most_on_ice, 0.8 * 0.004);
  EXPECT_GT(run.most_on_ice, 0);
  EXPECT_LE(run.most_use, 0.8);
  EXPECT_GT(run.mu_required, 0.0057);
}

TEST(PlanOnPatches, TheShortestTimeHoldsOnIceToo) {
  const std::string task = "goal = [0.5, 0]\nduration = 6.0\nobjective = \"time\"\n";
  const Rolled run = rolled(desk_task("static_friction = 0.05\n" + strip("static_friction = 0.02"), task));
  ASSERT_TRUE(run.found);
  EXPECT_LE(run.most_use, 0.8);
  EXPECT_LE(run.most_on_ice, 0.8 * 0.02);
  // The ice everywhere would need longer: sqrt(4 d / (0.8 mu_s g)) is 3.6 s, and 2.3 s on the floor.
  EXPECT_LT(run.duration_s, std::sqrt(4 * 0.5 / (0.8 * 0.02 * 9.81)));
}

TEST(PlanOnPatches, ACarpetIsCrossedToTheGoal) {
  const Rolled run =
      rolled(desk_task(kFloor + strip("rolling_resistance = 0.05"), "goal = [0.5, 0]\nduration = 6.0\n"));
  ASSERT_TRUE(run.found);
  EXPECT_LE(run.most_use, 0.8);
}

// 3 degrees need f_s/N = 0.0524 at rest; the patch allows 0.04.
TEST(PlanOnPatches, RestOnASlopeNeedsAPatchThatHolds) {
  const std::string floor =
      kFloor + "slope = { angle = 0.0523598775598, downhill = 0.7 }\n" + strip("static_friction = 0.05");
  const Outcome outcome = outcome_of(desk_task(floor, "goal = [0.25, 0]\nduration = 6.0\n"));
  EXPECT_EQ(outcome.status, Status::kInfeasible);
  EXPECT_NE(outcome.binding.find("friction does not hold"), std::string::npos) << outcome.binding;
  EXPECT_NE(outcome.binding.find("at the goal (surface.patch)"), std::string::npos) << outcome.binding;
  for (const char* possible : {"goal = [0.1, 0]\nduration = 6.0\n", "goal = [0.3, 0]\nduration = 6.0\n"}) {
    EXPECT_EQ(no_rest(make_problem(read_task(desk_task(floor, possible)))), "")
        << possible;  // beside it, and on its border
  }
}

// Patches keep what is written for them; the rest is the believed floor's.
TEST(PlanOnPatches, PatchesAreBelieved) {
  const std::string believed = "[believed.surface]\nstatic_friction = 0.3\nrolling_resistance = 0.02\n";
  const std::string task = "goal = [0.5, 0]\nduration = 6.0\n";
  const TaskFile file = read_task(
      desk_task(kFloor + strip("static_friction = 0.1") + strip("rolling_resistance = 0.05") + believed, task));
  const sim::Surface& floor = file.scenario.surface;
  ASSERT_EQ(floor.patches.size(), 2u);
  EXPECT_EQ(floor.static_friction, 0.3);
  EXPECT_EQ(floor.patches[0].static_friction, 0.1);
  EXPECT_EQ(floor.patches[0].rolling_resistance, 0.02);
  EXPECT_EQ(floor.patches[1].static_friction, 0.3);
  EXPECT_EQ(floor.patches[1].rolling_resistance, 0.05);
  const Problem problem = make_problem(file);
  EXPECT_DOUBLE_EQ(problem.friction_limit, 0.8 * 0.3);
  EXPECT_DOUBLE_EQ(problem.floor.weight_at({0.25, 0}), 1);  // the last patch counts
}

// Overlapping circles and squares: the weight of a place is at least that of every place within the margin, the
// gradient is that of the weight, and no reference is exceeded by grip.
TEST(PatchedFloor, WeightsCoverTheMargin) {
  constexpr unsigned kSeed = 5;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937_64 random(kSeed);
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  constexpr double kMargin_m = 0.02;
  int jumps = 0, sloped = 0;
  for (int floor = 0; floor < 50; ++floor) {
    sim::Surface surface;
    surface.static_friction = 0.5;
    for (int k = 0; k < 4; ++k) {
      sim::SurfacePatch patch;
      const Eigen::Vector2d center(between(-0.3, 0.3), between(-0.3, 0.3));
      const double size = between(0.05, 0.3);
      if (k % 2 == 0) {
        patch.center_W_m = center;
        patch.radius_m = size;
      } else {
        for (const Eigen::Vector2d& corner : {Eigen::Vector2d(-1, -1), {1, -1}, {1, 1}, {-1, 1}})
          patch.polygon_W_m.emplace_back(center + size * corner);
      }
      patch.static_friction = between(0.05, 0.9);
      surface.patches.push_back(patch);
    }
    const PatchedFloor map(surface, 0.15);
    sim::LocalFloor plant_floor(surface);
    for (int draw = 0; draw < 400; ++draw) {
      const Eigen::Vector2d place(between(-0.6, 0.6), between(-0.6, 0.6));
      plant_floor.stand_at(place);
      ASSERT_DOUBLE_EQ(map.weight_at(place), std::max(1.0, 0.5 / plant_floor.static_friction()));
      const PatchedFloor::Weight weight = map.weight(place, kMargin_m);
      const double angle = between(0, 6.3), far_m = between(0, kMargin_m);
      const double near = map.weight_at(place + far_m * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
      EXPECT_GE(weight.value, near * (1 - 1e-12));  // rounding
      jumps += near != map.weight_at(place) ? 1 : 0;
      constexpr double kStep_m = 1e-7;
      const Eigen::Vector2d toward(std::cos(angle), std::sin(angle));
      const double ahead = map.weight(place + kStep_m * toward, kMargin_m).value;
      const double behind = map.weight(place - kStep_m * toward, kMargin_m).value;
      const double slope = (ahead - behind) / (2 * kStep_m);
      if (std::abs(slope) < 1) continue;
      ++sloped;
      // Second differences of a weight of up to 10 over a band of 0.015 m, and the depth's kinks inside its own step.
      EXPECT_NEAR(weight.gradient.dot(toward), slope, 0.02 * weight.gradient.norm() + 1) << place.transpose();
    }
  }
  EXPECT_GT(jumps, 100);
  EXPECT_GT(sloped, 100);
}

}  // namespace
}  // namespace ballast::plan
