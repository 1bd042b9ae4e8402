// The scenarios that ship: readable, and the paper's are the paper's, number by number.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "tests/scenario/scenario_texts.h"

namespace ballast::sim {
namespace {

using std::numbers::pi;

const std::filesystem::path kShipped = BALLAST_SHIPPED_SCENARIOS;

Scenario shipped(const std::string& name) {
  const ScenarioResult result = read_scenario(find_scenario(name, kShipped));
  EXPECT_TRUE(result.ok()) << all_errors(result);
  return result.scenario;
}

// eq_prescribed_u_ball, and with sign -1 the odd masses of eq_prescribed_u_disk.
void expect_the_papers_push(const Mass& mass, double sign) {
  ASSERT_EQ(mass.motion.size(), 2u);
  EXPECT_EQ(mass.motion[0].duration_s, 0.1);
  EXPECT_EQ(mass.motion[0].acceleration_start, sign);
  EXPECT_EQ(mass.motion[0].acceleration_end, sign);
  EXPECT_EQ(mass.motion[1].duration_s, 0.1);
  EXPECT_EQ(mass.motion[1].acceleration_start, sign);
  EXPECT_EQ(mass.motion[1].acceleration_end, 0);
  EXPECT_EQ(mass.initial_velocity, 0);
}

void expect_at_rest_at_the_origin(const Scenario& s) {
  EXPECT_EQ(s.duration_s, 20);
  EXPECT_EQ(s.gravity_mps2, 1);
  EXPECT_EQ(s.external_force_W_n, Eigen::Vector3d::Zero());
  EXPECT_EQ(s.ball.radius_m, 1);
  EXPECT_EQ(s.initial.orientation.coeffs(), Eigen::Vector4d(0, 0, 0, 1));
  EXPECT_EQ(s.initial.angular_velocity_B_radps, Eigen::Vector3d::Zero());
  EXPECT_EQ(s.initial.position_W_m, Eigen::Vector2d::Zero());
}

void expect_the_papers_ball(const Scenario& s) {
  expect_at_rest_at_the_origin(s);
  EXPECT_EQ(s.ball.inertia_kgm2, Eigen::Vector3d(0.9, 1, 1.1));
  EXPECT_EQ(s.ball.center_of_mass_B_m, Eigen::Vector3d(0, 0, -0.05));
  ASSERT_EQ(s.masses.size(), 3u);
  const double radius[] = {0.95, 0.9, 0.85}, position[] = {0, 2.0369, 0.7044};
  const double azimuth[] = {0, pi / 2, pi / 4}, elevation[] = {0, 0, pi / 4};
  for (std::size_t i = 0; i < 3; ++i) {
    const Mass& mass = s.masses[i];
    EXPECT_EQ(mass.rail.shape, firmware::RailShape::kCircle);
    EXPECT_EQ(mass.rail.radius_m, radius[i]);
    EXPECT_EQ(mass.rail.origin_B_m, Eigen::Vector3d::Zero());
    // theta = 0 lies on n = (cos el cos az, cos el sin az, sin el); a rounding or two of sines.
    const Eigen::Vector3d n(std::cos(elevation[i]) * std::cos(azimuth[i]),
                            std::cos(elevation[i]) * std::sin(azimuth[i]), std::sin(elevation[i]));
    EXPECT_LT((mass.rail.axis_cos_B - n).norm(), 1e-15);
    EXPECT_EQ(mass.initial_position, position[i]);
    expect_the_papers_push(mass, 1);
  }
}

void expect_published(const Scenario& s, const char* quantity, double value) {
  ASSERT_EQ(s.published.size(), 1u);
  EXPECT_EQ(s.published[0].quantity, quantity);
  EXPECT_EQ(s.published[0].value, value);
}

// Whole system, from the geometric centre, at t = 0.
Eigen::Vector3d center_of_mass(const Scenario& s) {
  double total = s.ball.mass_kg;
  Eigen::Vector3d moment = s.ball.mass_kg * s.ball.center_of_mass_B_m;
  for (const Mass& mass : s.masses) {
    total += mass.mass_kg;
    moment += mass.mass_kg * firmware::evaluate(mass.rail, mass.initial_position).position;
  }
  return moment / total;
}

TEST(Shipped, ExactlyThese) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(kShipped)) {
    EXPECT_EQ(entry.path().extension(), ".toml");
    const std::string name = entry.path().stem().string();
    names.insert(name);
    EXPECT_EQ(shipped(name).name, name);  // results land in runs/NAME
  }
  for (const char* name : {"desk_ball", "hop", "paper_ball", "paper_detach", "paper_detach_flight", "paper_disk",
                           "seam_ball", "slide_to_roll", "tumbleweed"})
    EXPECT_TRUE(names.count(name)) << name;
}

TEST(Shipped, RunWithMotorsAndPrescribed) {
  for (const char* name : {"desk_ball", "paper_ball", "paper_detach", "paper_disk", "seam_ball"}) {
    for (const char* actuation : {"run.actuation=stepper", "run.actuation=prescribed"}) {
      const ScenarioResult result = read_scenario(find_scenario(name, kShipped), {actuation});
      EXPECT_TRUE(result.ok()) << name << " " << actuation << "\n" << all_errors(result);
    }
  }
}

TEST(Shipped, PaperBall) {
  const Scenario s = shipped("paper_ball");
  expect_the_papers_ball(s);
  expect_published(s, "mu_required.max", 0.19);
  EXPECT_EQ(s.ball.mass_kg, 1);
  for (const Mass& mass : s.masses) EXPECT_EQ(mass.mass_kg, 1);
  EXPECT_EQ(s.surface.static_friction, 0.35);
  EXPECT_EQ(s.surface.kinetic_friction, 0.30);
  // The paper: the centre of mass starts above the geometric centre. physics.md section 2: 1e-5 aside, 0.1708 up.
  const Eigen::Vector3d c = center_of_mass(s);
  EXPECT_LT(c.head<2>().norm(), 1.5e-5);  // theta_a has 4 decimals
  EXPECT_NEAR(c[2], 0.1708, 5e-5);        // 4 decimals
}

TEST(Shipped, PaperBallOnGlass) {
  const ScenarioResult result = read_scenario(find_scenario("paper_ball", kShipped), {"surface.static_friction=0.17"});
  ASSERT_TRUE(result.ok()) << all_errors(result);
  EXPECT_EQ(result.scenario.surface.static_friction, 0.17);
  EXPECT_EQ(result.scenario.surface.kinetic_friction, 0.17);
}

TEST(Shipped, PaperDetach) {
  const Scenario s = shipped("paper_detach");
  expect_the_papers_ball(s);
  expect_published(s, "end.time", 3.7358);
  EXPECT_EQ(s.ball.mass_kg, 0.1);
  EXPECT_EQ(s.masses[0].mass_kg, 0.1);
  EXPECT_EQ(s.masses[1].mass_kg, 0.1);
  EXPECT_EQ(s.masses[2].mass_kg, 60);
  EXPECT_TRUE(std::isinf(s.surface.static_friction));
}

TEST(Shipped, ThoseThatShowTheRegimesGoOn) {
  for (const char* name : {"hop", "paper_detach_flight", "slide_to_roll"}) {
    EXPECT_EQ(shipped(name).run.on_violation, OnViolation::kContinue) << name;
    EXPECT_EQ(shipped(name).run.actuation, Actuation::kPrescribed) << name;
  }
}

TEST(Shipped, PaperDisk) {
  const Scenario s = shipped("paper_disk");
  expect_at_rest_at_the_origin(s);
  expect_published(s, "mu_required.max", 0.2951);
  EXPECT_EQ(s.ball.mass_kg, 1);
  EXPECT_EQ(s.ball.inertia_kgm2[1], 1);
  EXPECT_EQ(s.ball.center_of_mass_B_m, Eigen::Vector3d::Zero());
  EXPECT_EQ(s.surface.static_friction, 0.35);
  ASSERT_EQ(s.masses.size(), 4u);
  const double radius[] = {0.9, 19.0 / 30, 11.0 / 30, 0.1};  // .9, .6333.., .3666.., .1
  for (std::size_t i = 0; i < 4; ++i) {
    const Mass& mass = s.masses[i];
    EXPECT_EQ(mass.mass_kg, 1);
    EXPECT_EQ(mass.rail.radius_m, radius[i]);
    EXPECT_EQ(mass.rail.axis_cos_B, Eigen::Vector3d(1, 0, 0));
    EXPECT_EQ(mass.rail.axis_sin_B, Eigen::Vector3d(0, 0, 1));
    EXPECT_EQ(mass.initial_position, -pi / 2);
    expect_the_papers_push(mass, i % 2 == 0 ? -1 : 1);  // (-1)^i, i from 1
  }
}

TEST(Shipped, DeskBallStartsInAStableEquilibriumAndStopsItsMasses) {
  const Scenario s = shipped("desk_ball");
  EXPECT_EQ(s.run.actuation, Actuation::kStepper);
  EXPECT_EQ(s.initial.angular_velocity_B_radps, Eigen::Vector3d::Zero());
  const Eigen::Vector3d c = s.initial.orientation * center_of_mass(s);
  EXPECT_LT(c.head<2>().norm(), 1e-15);  // sums of a few numbers of 0.1 that cancel
  EXPECT_LT(c[2], -0.03);
  for (const Mass& mass : s.masses) EXPECT_EQ(mass.motor.holding_torque_nm, 0.35);  // the preset's
  // The shell's inertia is that of a thin hollow sphere within the ball, to the three digits given.
  EXPECT_NEAR(s.ball.inertia_kgm2[0], 2.0 / 3 * 0.8 * 0.149 * 0.149, 5e-5);
  for (const Mass& mass : s.masses) {
    double velocity = mass.initial_velocity, end = 0;
    for (const MotionPiece& piece : mass.motion) {
      velocity += piece.duration_s * (piece.acceleration_start + piece.acceleration_end) / 2;
      end += piece.duration_s;
    }
    EXPECT_NEAR(velocity, 0, 1e-15);  // rounding of a few terms of about 1
    EXPECT_LT(end, s.duration_s);
  }
}

TEST(Shipped, SeamBallHangsAndRunsOnceRound) {
  const Scenario s = shipped("seam_ball");
  const Mass& mass = s.masses[0];
  const double length = firmware::length_m(mass.rail);
  // The seam in closed form, at the middle between two of its points; the first curve is off by the fourth power
  // of 22.5 degrees, some parts in a thousand.
  const auto seam = [](double t) {
    return Eigen::Vector3d(0.07 * std::cos(t) + 0.03 * std::cos(3 * t), 0.07 * std::sin(t) - 0.03 * std::sin(3 * t),
                           2 * std::sqrt(0.07 * 0.03) * std::sin(2 * t));
  };
  double nearest = 1;
  for (double theta = 0; theta < length; theta += 1e-4) {
    const Eigen::Vector3d p = firmware::evaluate(mass.rail, theta).position;
    nearest = std::min(nearest, (p - seam(pi / 16)).norm());
    EXPECT_NEAR(p.norm(), 0.1, 3e-4);
  }
  EXPECT_LT(nearest, 3e-4);
  EXPECT_LT((s.initial.orientation * center_of_mass(s)).head<2>().norm(), 1e-8);  // eight decimals of the attitude
  double velocity = 0, end = 0;
  for (const MotionPiece& piece : mass.motion) {
    end +=
        piece.duration_s * (velocity + piece.duration_s * (2 * piece.acceleration_start + piece.acceleration_end) / 6);
    velocity += piece.duration_s * (piece.acceleration_start + piece.acceleration_end) / 2;
  }
  EXPECT_NEAR(velocity, 0, 1e-15);
  EXPECT_NEAR(end, length, 1e-4);
}

// The format's example, every line of it: what the documentation shows has to be accepted.
TEST(Shipped, TheDocumentedExampleIsAccepted) {
  const Scenario s = accepted(R"(
name = "paper-ball"
duration = 20.0                        # s
gravity = 1.0                          # m/s^2
external_force = [0.0, 0.0, 0.0]       # N, spatial, at the geometric centre; default none

[ball]
radius = 1.0
mass = 1.0                             # m_0, the shell with its static internals
inertia = [0.9, 1.0, 1.1]              # principal, about m_0's own centre of mass
center_of_mass = [0.0, 0.0, -0.05]     # from the geometric centre; default 0

[surface]                              # default: perfect friction (infinite), kinetic = static, restitution 0
static_friction = 0.35
kinetic_friction = 0.30
restitution = 0.0

[[mass]]                               # none at all is allowed: a ball with a static inside
mass = 1.0
rail = { shape = "circle", radius = 0.95, direction = { azimuth = 0.0, elevation = 0.0 } }
#      { shape = "circle", radius = 0.3, center = [0, 0, 0.1], axes = [[1,0,0],[0,0,1]] }
initial_position = 0.0                 # theta at t = 0
initial_velocity = 0.0
motion = [ { duration = 0.1, acceleration = [1.0, 1.0] },   # theta'' goes linearly from the first to the second value;
           { duration = 0.1, acceleration = [1.0, 0.0] } ]  # after the last piece it is 0
[mass.motor]                           # used with actuation = "stepper"; sensible defaults for every key
steps_per_revolution = 200
microsteps = 16
gear_ratio = 1.0                       # motor turns per turn of a circle rail; on other rails: travel_per_revolution (m)
holding_torque = 3.0

[initial]
orientation = [1, 0, 0, 0]             # w x y z; normalised if within 1e-6 of unit length, else an error
angular_velocity = [0, 0, 0]           # body frame
position = [0, 0]
velocity = [0, 0, 0]                   # of the geometric centre, spatial; default: the rolling velocity. Any other starts sliding
height = 0.0                           # of the geometric centre above its height in contact; above 0 starts in flight

[run]
actuation = "stepper"                  # or "prescribed": the masses follow `motion` exactly, as in the paper
control_period = 0.001                 # s
on_violation = "stop"                  # physics at slip or detachment: "stop" there, or "continue" into sliding and flight

[envelope]                             # the monitor's limits
min_normal_force = 0.0                 # trips when N <= this
friction_use = 1.0                     # trips when f_s > friction_use * mu_s * N
)");
  EXPECT_EQ(s.name, "paper-ball");
  EXPECT_EQ(s.masses.size(), 1u);
}

// A run leaves the same scenario beside its log, in a file of another name.
TEST(Shipped, TheTextOfAScenarioGivesItAgain) {
  for (const auto& entry : std::filesystem::directory_iterator(kShipped)) {
    const Scenario s = shipped(entry.path().stem().string());
    const ScenarioResult again = parse_scenario(s.toml, "scenario.toml");
    ASSERT_TRUE(again.ok()) << all_errors(again) << s.toml;
    EXPECT_EQ(again.scenario.id, s.id) << s.toml;
    EXPECT_EQ(again.scenario.name, s.name);
    EXPECT_EQ(again.scenario.published.size(), s.published.size());
    EXPECT_EQ(again.scenario.toml, s.toml);
  }
}

}  // namespace
}  // namespace ballast::sim
