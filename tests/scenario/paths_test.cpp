// Spline rails, trajectories and external forces as scenarios say them.
#include <cmath>
#include <numbers>
#include <set>

#include "tests/scenario/scenario_texts.h"

namespace ballast::sim {
namespace {

using Eigen::Vector3d;
using std::numbers::pi;

const std::string kSpline = kMinimal + R"([[mass]]
mass = 1
rail = { shape = "spline", closed = true, points = [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]] }
initial_position = 100
)";

const std::string kOpenSpline = kMinimal + R"([[mass]]
mass = 1
rail = { shape = "spline", points = [[-1, 0, 0.5], [0, 0, 0], [1, 0, 0.5]] }
initial_position = 0.5
initial_velocity = 0.25
)";

const std::string kTrajectory = kMinimal + R"([[mass]]
mass = 1
trajectory = { times = [-1, 0, 2, 4.5], points = [[0, 0, 0], [0, 0, 0.5], [0, 0.5, 0], [0.5, 0, 0]] }
[run]
actuation = "prescribed"
)";

struct Refusal {
  std::vector<std::string> change;
  std::string key, part;
};

void expect_refused(const std::string& text, const Refusal& refusal) {
  SCOPED_TRACE(refusal.change.front());
  const ScenarioError error = only_error(text, refusal.change);
  EXPECT_EQ(error.key, refusal.key);
  EXPECT_TRUE(contains(error.message, refusal.part));
}

TEST(SplineScenario, IsReadAndPassesItsPoints) {
  const Scenario s = accepted(kSpline);
  const firmware::Rail& rail = s.masses[0].rail;
  EXPECT_EQ(rail.shape, firmware::RailShape::kSpline);
  EXPECT_TRUE(rail.closed);
  const double length = firmware::length_m(rail);
  // A periodic cubic through four points of the unit circle: the circle to 3 %.
  EXPECT_NEAR(length, 2 * pi, 0.03 * 2 * pi);
  const Vector3d points[] = {{1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
  for (int i = 0; i < 4; ++i) {
    EXPECT_LT((firmware::evaluate(rail, i * length / 4).position - points[i]).norm(), 1e-3 * length);
  }
  EXPECT_EQ(s.masses[0].initial_position, 100);  // round and round
  EXPECT_EQ(s.masses[0].motor.shaft_ratio, 2 * pi / s.masses[0].motor.travel_per_revolution);
  EXPECT_EQ(accepted(kSpline, {"mass.0.motor.travel_per_revolution=0.5"}).masses[0].motor.shaft_ratio, 4 * pi);

  const firmware::Rail open = accepted(kOpenSpline).masses[0].rail;
  EXPECT_FALSE(open.closed);
  EXPECT_EQ(firmware::evaluate(open, 0.0).position, Vector3d(-1, 0, 0.5));
  EXPECT_LT((firmware::evaluate(open, firmware::length_m(open)).position - Vector3d(1, 0, 0.5)).norm(), 1e-14);
}

TEST(SplineScenario, PointsCanBeSet) {
  const std::string other = "mass.0.rail.points=[[0, 0, 1], [0, 1, 0], [0, 0, -1], [0, -1, 0]]";
  EXPECT_EQ(firmware::evaluate(accepted(kSpline, {other}).masses[0].rail, 0.0).position, Vector3d(0, 0, 1));
  EXPECT_EQ(firmware::evaluate(accepted(kSpline, {"mass.0.rail.points.0=[1.1, 0, 0]"}).masses[0].rail, 0.0).position,
            Vector3d(1.1, 0, 0));
}

TEST(SplineScenario, FaultsAreNamed) {
  const std::string zigzag = [] {
    std::string text = "mass.0.rail.points=[";
    for (int i = 0; i < 60; ++i) text += "[" + std::to_string(i * 0.02) + "," + (i % 2 == 0 ? "0" : "0.2") + ",0],";
    return text + "[0,0,1]]";
  }();
  for (const Refusal& refusal : std::vector<Refusal>{
           {{"mass.0.rail.points=[[0,0,0],[1,0,0]]"}, "mass.0.rail.points", "3 to 10000 vectors"},
           {{"mass.0.rail.points=3"}, "mass.0.rail.points", "array"},
           {{"mass.0.rail.points.1=[0,1]"}, "mass.0.rail.points.1", "array of 3"},
           {{"mass.0.rail.points.1=[0,inf,0]"}, "mass.0.rail.points.1.1", "finite"},
           {{"mass.0.rail.points.1=[1,0,0]"}, "mass.0.rail.points.1", "neighbours that differ"},
           {{"mass.0.rail.points.3=[1,0,0]"}, "mass.0.rail.points.3", "repeats the first point"},
           {{"mass.0.rail.points.2=[-2.1,0,0]"}, "mass.0.rail.points.2", "ball.radius = 2"},
           {{"mass.0.rail.closed=1"}, "mass.0.rail.closed", "true or false"},
           {{"mass.0.rail.radius=1"}, "mass.0.rail.radius", "unknown key"},
           {{"mass.0.motor.gear_ratio=1"}, "mass.0.motor.gear_ratio", "on a line or a spline: travel_per_revolution"},
           {{"mass.0.rail.points=[[1e-200,0,0],[2e-200,0,0],[0,1,0]]"}, "mass.0.rail.points", "less extreme"},
           {{zigzag}, "mass.0.rail.points", "too sharp a curve"},
           // The points are inside, the curve between them is not.
           {{"mass.0.rail.points=[[1.9,0.5,0],[1.9,-0.5,0],[-1,-1,0],[-1,1,0]]"},
            "mass.0.rail.points",
            "m from the geometric centre at theta"}}) {
    expect_refused(kSpline, refusal);
  }
  // Two points are enough for an open one.
  EXPECT_TRUE(parse(kOpenSpline, {"mass.0.rail.points=[[-1,0,0],[1,0,0]]"}).ok());
  expect_refused(kOpenSpline, {{"mass.0.rail.points=[[-1,0,0]]"}, "mass.0.rail.points", "2 to 10000"});
}

const std::string kCircle = kMinimal + R"([[mass]]
mass = 1
rail = { shape = "circle", radius = 0.5, direction = { azimuth = 0, elevation = 0 } }
)";

const std::string kLine = kMinimal + R"([[mass]]
mass = 1
rail = { shape = "line", origin = [0.5, 0, 1.2], direction = [1, 0, 0] }
motion = [ { duration = 1, acceleration = [0.5, 0.5] }, { duration = 1, acceleration = [-0.5, -0.5] } ]
)";

TEST(EndStopScenario, DefaultsAreTheBallAndTheSplinesEnds) {
  // At height 1.2 in a ball of radius 2 the line is inside from -1.6 to 1.6 in the space of its direction.
  const Mass line = accepted(kLine).masses[0];
  EXPECT_NEAR(line.rail.lower_end, -2.1, 1e-15);
  EXPECT_NEAR(line.rail.upper_end, 1.1, 1e-15);
  EXPECT_EQ(line.end_stops.restitution, 0.5);
  // The motor's greatest force presses the mass in by a thousandth of the way.
  EXPECT_NEAR(line.end_stops.stiffness_npm * 1e-3 * 3.2 / (line.motor.holding_torque_nm * line.motor.shaft_ratio), 1,
              1e-12);
  const Mass open = accepted(kOpenSpline).masses[0];
  EXPECT_EQ(open.rail.lower_end, 0);
  EXPECT_EQ(open.rail.upper_end, firmware::length_m(open.rail));
  EXPECT_GT(open.end_stops.stiffness_npm, 0);
  for (const std::string& endless : {kSpline, kCircle}) {
    EXPECT_EQ(accepted(endless).masses[0].rail.lower_end, -std::numeric_limits<double>::infinity());
    EXPECT_EQ(accepted(endless).masses[0].rail.upper_end, std::numeric_limits<double>::infinity());
  }
}

TEST(EndStopScenario, AreReadAndMakeAnotherScenario) {
  const std::vector<std::string> keys{"mass.0.rail.end_stops=[-0.25, 0.75]", "mass.0.rail.end_stop_stiffness=2e4",
                                      "mass.0.rail.end_stop_restitution=1"};
  const Scenario s = accepted(kLine, keys);
  EXPECT_EQ(s.masses[0].rail.lower_end, -0.25);
  EXPECT_EQ(s.masses[0].rail.upper_end, 0.75);
  EXPECT_EQ(s.masses[0].end_stops.stiffness_npm, 2e4);
  EXPECT_EQ(s.masses[0].end_stops.restitution, 1);
  std::set<std::int64_t> ids{accepted(kLine).id};
  for (const std::string& key : keys) ids.insert(accepted(kLine, {key}).id);
  EXPECT_EQ(ids.size(), 4u);
  EXPECT_EQ(accepted(kOpenSpline, {"mass.0.rail.end_stops=[0.25, 1.75]"}).masses[0].rail.upper_end, 1.75);
}

TEST(EndStopScenario, FaultsAreNamed) {
  for (const Refusal& refusal : std::vector<Refusal>{
           {{"mass.0.rail.end_stops=[0.75]"}, "mass.0.rail.end_stops", "array of 2"},
           {{"mass.0.rail.end_stops=[-0.25, nan]"}, "mass.0.rail.end_stops.1", "finite"},
           {{"mass.0.rail.end_stops=[-0.25, -0.25]"}, "mass.0.rail.end_stops.1", "allowed: > -0.25"},
           {{"mass.0.rail.end_stops=[-2.2, 1]"}, "mass.0.rail.end_stops.0", "allowed: <= ball.radius = 2"},
           {{"mass.0.rail.end_stops=[-1, 1.2]"}, "mass.0.rail.end_stops.1", "allowed: <= ball.radius = 2"},
           {{"mass.0.rail.end_stop_stiffness=0"}, "mass.0.rail.end_stop_stiffness", "finite number > 0, in N/m"},
           // Holding torque 3 N m, 0.05 m a turn: 377 N press the mass 0.38 m past the shell, to hypot(1.977, 1.2) m.
           {{"mass.0.rail.end_stop_stiffness=1000", "mass.0.motor.holding_torque=3",
             "mass.0.motor.travel_per_revolution=0.05"},
            "mass.0.rail.end_stop_stiffness",
            "press the mass to theta"},
           {{"mass.0.rail.end_stop_restitution=0"}, "mass.0.rail.end_stop_restitution", "[0.01, 1]"},
           {{"mass.0.rail.end_stop_restitution=1.1"}, "mass.0.rail.end_stop_restitution", "[0.01, 1]"},
           {{"mass.0.rail.end_stop=[0,1]"}, "mass.0.rail.end_stop", "end_stops"},
           // The motion is at 0.5 from t = 2 on, and nowhere beyond.
           {{"mass.0.rail.end_stops=[-0.25, 0.49]"},
            "mass.0.motion.1",
            "to theta = 0.5 m at t = 2 s; allowed: between"},
           {{"mass.0.rail.end_stops=[0.1, 0.75]"}, "mass.0.initial_position", "0.1 to 0.75 m"}}) {
    expect_refused(kLine, refusal);
  }
  EXPECT_TRUE(parse(kLine, {"mass.0.rail.end_stops=[0, 0.5]"}).ok());
  expect_refused(kOpenSpline, {{"mass.0.rail.end_stops=[-0.1, 1]"}, "mass.0.rail.end_stops.0", "0 to its length"});
  expect_refused(kOpenSpline, {{"mass.0.rail.end_stops=[0.1, 9]"}, "mass.0.rail.end_stops.1", "0 to its length"});
  expect_refused(kOpenSpline, {{"mass.0.rail.end_stops=[0.1, 1.4]"}, "mass.0.initial_velocity", "0.1 to 1.4 m"});
  expect_refused(kSpline, {{"mass.0.rail.end_stops=[0, 1]"}, "mass.0.rail.end_stops", "on a line or an open spline"});
  expect_refused(
      kCircle, {{"mass.0.rail.end_stop_stiffness=1"}, "mass.0.rail.end_stop_stiffness", "on a line or an open spline"});
}

TEST(SplineScenario, TheMotionStaysOnAnOpenRail) {
  // About 2.3 m long; 0.5 + 0.25 t for 4 s ends at 1.5.
  EXPECT_TRUE(parse(kOpenSpline).ok());
  expect_refused(kOpenSpline, {{"mass.0.initial_position=-0.001"}, "mass.0.initial_position", "on the rail, 0 to"});
  expect_refused(
      kOpenSpline,
      {{"mass.0.initial_position=3", "mass.0.initial_velocity=0"}, "mass.0.initial_position", "on the rail, 0 to"});
  expect_refused(kOpenSpline, {{"mass.0.initial_velocity=0.6"}, "mass.0.initial_velocity", "at t = 4 s"});
  expect_refused(kOpenSpline, {{"mass.0.initial_velocity=-0.5"}, "mass.0.initial_velocity", "to theta = -1.5 m"});
  // The turning point counts: 0.5 - 1.25 t + t^2 is least at t = 0.625.
  expect_refused(kOpenSpline, {{"mass.0.initial_velocity=-1.5",
                                "mass.0.motion=[{duration=1.5,acceleration=[1,1]},{duration=0.1,acceleration=[0,0]}]"},
                               "mass.0.motion.0",
                               "to theta = -0.625 m at t = 1.5 s"});
}

TEST(TrajectoryScenario, IsRead) {
  const Scenario s = accepted(kTrajectory);
  const Trajectory& t = s.masses[0].trajectory;
  EXPECT_EQ(t.times_s, (std::vector<double>{-1, 0, 2, 4.5}));
  EXPECT_EQ(t.points_B_m[2], Vector3d(0, 0.5, 0));
  EXPECT_FALSE(t.periodic);
  EXPECT_EQ(s.masses[0].mass_kg, 1);
  const std::vector<std::string> periodic = {"mass.0.trajectory.periodic=true", "mass.0.trajectory.points.3=[0,0,0]",
                                             "mass.0.trajectory.times=[10, 10.5, 11, 12]"};
  EXPECT_TRUE(accepted(kTrajectory, periodic).masses[0].trajectory.periodic);
}

TEST(TrajectoryScenario, FaultsAreNamed) {
  for (const Refusal& refusal : std::vector<Refusal>{
           {{"run.actuation=stepper"}, "mass.0.trajectory", "run.actuation = \"prescribed\""},
           {{"mass.0.rail={shape=\"line\",origin=[0,0,0],direction=[1,0,0]}"}, "mass.0.rail", "one of the two"},
           {{"mass.0.motion=[]"}, "mass.0.motion", "belongs to a mass on a rail"},
           {{"mass.0.initial_position=0"}, "mass.0.initial_position", "belongs to a mass on a rail"},
           {{"mass.0.initial_velocity=0"}, "mass.0.initial_velocity", "belongs to a mass on a rail"},
           {{"mass.0.motor.microsteps=8"}, "mass.0.motor", "belongs to a mass on a rail"},
           {{"mass.0.trajectory.speed=8"}, "mass.0.trajectory.speed", "unknown key"},
           {{"mass.0.trajectory=3"}, "mass.0.trajectory", "a table"},
           {{"mass.0.trajectory.times=[0]"}, "mass.0.trajectory.times", "2 to 10000"},
           {{"mass.0.trajectory.times=[-1, 0, 5]"}, "mass.0.trajectory.points", "one for each of the 3 times"},
           {{"mass.0.trajectory.times.2=0"}, "mass.0.trajectory.times.2", "times that increase"},
           {{"mass.0.trajectory.times.2=nan"}, "mass.0.trajectory.times.2", "finite"},
           {{"mass.0.trajectory.times=[0.1, 1, 2, 5]"}, "mass.0.trajectory.times.0", "<= 0, or periodic = true"},
           {{"mass.0.trajectory.times.3=3.9"}, "mass.0.trajectory.times.3", ">= duration = 4"},
           {{"duration=5"}, "mass.0.trajectory.times.3", ">= duration = 5"},
           {{"mass.0.trajectory.points.3=[2.1,0,0]"}, "mass.0.trajectory.points", "ball.radius = 2"},
           {{"mass.0.trajectory.points.1=[1e14,0,0]"}, "mass.0.trajectory.points", "ball.radius = 2"},
           // In a ball large enough for it, 1e11 m in 1e-8 s.
           {{"ball.radius=1e12", "mass.0.trajectory.times.1=-1e-8", "mass.0.trajectory.times.2=0",
             "mass.0.trajectory.points.1=[1e11,0,0]"},
            "mass.0.trajectory.times",
            "less extreme"},
           {{"mass.0.trajectory.periodic=true"}, "mass.0.trajectory.points.3", "ends where it starts"}}) {
    expect_refused(kTrajectory, refusal);
  }
  const std::string misspelt = all_errors(parse(replaced(kTrajectory, "trajectory = {", "trajectori = {")));
  EXPECT_TRUE(contains(misspelt, "did you mean trajectory?"));
}

TEST(ForceScenario, AConstantATableAndDragAreRead) {
  EXPECT_EQ(accepted(kMinimal, {"external_force=[1,2,3]"}).external_force_W_n, Vector3d(1, 2, 3));
  const std::string table = "external_force = { times = [0, 1.5], forces = [[1, 0, 0], [0, 0, 2]] }\n" + kMinimal +
                            "[drag]\ncoefficient = 0.25\nwind = [3, 0, -1]\n";
  const Scenario s = accepted(table);
  EXPECT_EQ(s.external_force_W_n, Vector3d::Zero());
  EXPECT_EQ(s.force_table.times_s, (std::vector<double>{0, 1.5}));
  EXPECT_EQ(s.force_table.forces_W_n[1], Vector3d(0, 0, 2));
  EXPECT_EQ(s.drag.coefficient_kgpm, 0.25);
  EXPECT_EQ(s.drag.wind_W_mps, Vector3d(3, 0, -1));
  // A constant in place of the file's table, and the other way round.
  EXPECT_TRUE(accepted(table, {"external_force=[1,2,3]"}).force_table.times_s.empty());
  EXPECT_EQ(accepted(kMinimal, {"external_force={times=[0,1],forces=[[0,0,0],[1,0,0]]}"}).force_table.times_s.size(),
            2u);
  EXPECT_EQ(accepted(table, {"drag.coefficient=0"}).drag.coefficient_kgpm, 0);
  for (const Refusal& refusal : std::vector<Refusal>{
           {{"external_force.times=[0]"}, "external_force.times", "2 to 10000"},
           {{"external_force.times=[1, 0]"}, "external_force.times.1", "times that increase"},
           {{"external_force.times=[4000, 4000.000001]"}, "external_force.times.1", "1e-9 of the time"},
           {{"external_force.times=[0, 1, 2]"}, "external_force.forces", "one for each of the 3 times"},
           {{"external_force.times.1=1e-8", "external_force.forces.1=[1e8,0,0]"},
            "external_force.forces.1",
            "changes too fast"},
           {{"external_force={times=[0,1e-8,1],forces=[[0,0,0],[1e8,0,0],[1e8,0,0]]}"},
            "external_force.forces.1",
            "changes too fast"},
           {{"external_force.forces.1=[0,0]"}, "external_force.forces.1", "array of 3"},
           {{"external_force.force=3"}, "external_force.force", "did you mean forces?"},
           {{"external_force=\"x\""}, "external_force", "array of 3"},
           {{"drag.coefficient=-1"}, "drag.coefficient", ">= 0"},
           {{"drag={wind=[1,0,0]}"}, "drag.coefficient", "missing"},
           {{"drag.wind=3"}, "drag.wind", "array of 3"},
           {{"drag.wimd=[1,0,0]"}, "drag.wimd", "did you mean wind?"}}) {
    expect_refused(table, refusal);
  }
}

TEST(PathsId, ChangesWithEveryField) {
  std::set<std::int64_t> ids;
  std::size_t count = 0;
  const auto expect_new = [&](const std::string& text, const std::vector<std::string>& change) {
    const Scenario s = accepted(text, change);
    ids.insert(s.id);
    EXPECT_EQ(ids.size(), ++count) << change.front();
  };
  for (const char* change : {"name=test", "mass.0.rail.points.1=[0, 1.00000000000001, 0]", "mass.0.rail.closed=false",
                             "mass.0.motor.travel_per_revolution=0.5"}) {
    expect_new(std::string(change) == "mass.0.rail.closed=false" ? replaced(kSpline, "= 100", "= 1") : kSpline,
               {change});
  }
  expect_new(kTrajectory, {"name=test"});
  expect_new(kTrajectory, {"mass.0.trajectory.times.2=2.5"});
  expect_new(kTrajectory, {"mass.0.trajectory.points.2=[0, 0.25, 0]"});
  expect_new(kTrajectory, {"mass.0.trajectory.points.3=[0,0,0]"});
  expect_new(kTrajectory, {"mass.0.trajectory.points.3=[0,0,0]", "mass.0.trajectory.periodic=true"});
  const std::string force = "external_force={times=[0,1],forces=[[0,0,0],[1,0,0]]}";
  expect_new(kMinimal, {force});
  expect_new(kMinimal, {force, "external_force.times.1=2"});
  expect_new(kMinimal, {force, "external_force.forces.0=[0,0,1]"});
  expect_new(kMinimal, {"drag={coefficient=1}"});
  expect_new(kMinimal, {"drag={coefficient=2}"});
  expect_new(kMinimal, {"drag={coefficient=2, wind=[0,1,0]}"});
  expect_new(kMinimal, {"name=test"});
  EXPECT_EQ(accepted(kMinimal, {"drag={coefficient=0}"}).id, accepted(kMinimal).id);  // none at all
}

}  // namespace
}  // namespace ballast::sim
