// How far the ball would coast, against a plant that rolls it to rest.
#include "tools/summary/coast.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "sim/plant/plant.h"

namespace ballast::sil {
namespace {

constexpr double kResistance = 0.02;

// A ball of 0.1 m with a held mass off its centre, turning about e2.
sim::Scenario rolling_ball(double turning_radps) {
  sim::Scenario s;
  s.gravity_mps2 = 9.81;
  s.ball.radius_m = 0.1;
  s.ball.mass_kg = 1;
  s.ball.inertia_kgm2 = {0.004, 0.004, 0.004};
  s.surface.rolling_resistance = kResistance;
  s.initial.angular_velocity_B_radps = {0, turning_radps, 0};
  s.run.actuation = sim::Actuation::kPrescribed;
  s.duration_s = 60;
  sim::Mass mass;
  mass.mass_kg = 0.1;
  mass.rail = firmware::circle(Eigen::Vector3d::Zero(), 0.03, -Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitX());
  s.masses = {mass};
  return s;
}

double rolled_m(sim::Plant& plant, double end_s) {
  double path_m = 0;
  Eigen::Vector3d from = plant.sample().position_W_m;
  for (int i = 1; i <= 6000; ++i) {
    plant.advance(end_s * i / 6000, {});
    const Eigen::Vector3d at = plant.sample().position_W_m;
    path_m += (at - from).norm();
    from = at;
  }
  return path_m;
}

// N is the weight on the mean of a turn. The path is 23 turns long, and over a part of one N differs from the weight by
// a few times c / r = 0.027 of it: less than 0.01 of the path.
TEST(Coast, IsThePathThatThePlantRollsToRest) {
  const sim::Scenario s = rolling_ball(20);
  sim::Plant plant(s);
  const auto found = coast(s, plant.sample());
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->turns_over);
  EXPECT_EQ(found->own_distance_m, found->distance_m(kResistance));
  EXPECT_GT(found->own_distance_m / (2 * std::numbers::pi * s.ball.radius_m), 20);
  EXPECT_NEAR(rolled_m(plant, s.duration_s), found->own_distance_m, 0.01 * found->own_distance_m);
  const auto rest = coast(s, plant.sample());
  ASSERT_TRUE(rest);
  EXPECT_LT(rest->energy_j, 1e-3 * found->energy_j);
}

// The mass hangs 0.03 m below the centre; over the top it would be 0.06 m higher: 0.0589 J.
TEST(Coast, TellsRollingOverFromRocking) {
  const double held_kgm2 = 1 * 0.01 + 0.004 + 0.1 * 0.07 * 0.07;  // about the contact point
  const double just_over_radps = std::sqrt(2 * 0.1 * 9.81 * 0.06 / held_kgm2);
  for (const double part : {0.99, 1.01}) {
    const sim::Scenario s = rolling_ball(part * just_over_radps);
    const auto found = coast(s, sim::Plant(s).sample());
    ASSERT_TRUE(found);
    EXPECT_EQ(found->turns_over, part > 1) << part;
    EXPECT_NEAR(found->energy_j, part * part * 0.1 * 9.81 * 0.06, 1e-12);  // the centre of mass is at its lowest
  }
}

TEST(Coast, IsUnboundedWhereNothingResistsAndNothingAtRest) {
  sim::Scenario s = rolling_ball(20);
  s.surface.rolling_resistance = 0;
  const auto rolling = coast(s, sim::Plant(s).sample());
  ASSERT_TRUE(rolling);
  EXPECT_TRUE(std::isinf(rolling->own_distance_m));
  s = rolling_ball(0);
  const auto at_rest = coast(s, sim::Plant(s).sample());
  ASSERT_TRUE(at_rest);
  EXPECT_NEAR(at_rest->own_distance_m, 0, 1e-12);
}

// Spin about the vertical does not carry the ball on.
TEST(Coast, LeavesSpinAboutTheVerticalOut) {
  sim::Scenario s = rolling_ball(20);
  const double without_j = coast(s, sim::Plant(s).sample())->energy_j;
  s.initial.angular_velocity_B_radps[2] = 50;
  EXPECT_NEAR(coast(s, sim::Plant(s).sample())->energy_j, without_j, 1e-12);
}

TEST(Coast, IsNothingOnASlopeWithoutGravityAndInTheAir) {
  sim::Scenario slope = rolling_ball(20);
  slope.surface.slope_rad = 0.1;
  EXPECT_FALSE(coast(slope, sim::Plant(slope).sample()));
  sim::Scenario air = rolling_ball(20);
  air.initial.height_m = 1;
  EXPECT_FALSE(coast(air, sim::Plant(air).sample()));
  const sim::Plant::Sample end = sim::Plant(rolling_ball(20)).sample();
  sim::Scenario weightless = rolling_ball(20);
  weightless.gravity_mps2 = 0;
  EXPECT_FALSE(coast(weightless, end));
  RunResult result{};
  result.final_sample = end;
  EXPECT_TRUE(coast_json(weightless, result).is_null());
  EXPECT_EQ(coast_line(weightless, result), "");
}

TEST(Coast, ListsFloorsFromTheirRanges) {
  const sim::Scenario s = rolling_ball(20);
  RunResult result{};
  result.final_sample = sim::Plant(s).sample();
  const auto json = coast_json(s, result);
  ASSERT_EQ(json["floors"].size(), kResistingFloors.size());
  for (const auto& floor : json["floors"]) {
    const double least = floor["rolling_resistance"][0], most = floor["rolling_resistance"][1];
    EXPECT_LT(least, most) << floor["name"];
    const double shortest = floor["distance"][0], longest = floor["distance"][1];
    EXPECT_NEAR(shortest * most, longest * least, 1e-12 * shortest);
    EXPECT_NEAR(shortest * most, json["distance"].get<double>() * kResistance, 1e-12 * shortest);
  }
  const std::string line = coast_line(s, result);
  EXPECT_NE(line.find("on this floor"), std::string::npos) << line;
  EXPECT_NE(line.find("on carpet"), std::string::npos) << line;
}

}  // namespace
}  // namespace ballast::sil
