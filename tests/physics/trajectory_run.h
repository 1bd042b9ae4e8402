// The paper's 3-d closed forms (rolling_forces_3d) integrated by an independent program (prescribed_run.h): masses on
// trajectories and on rails, under forces of time and drag. Nothing of sim/ is used but the scenario and, of masses on
// trajectories, their curve (cubic_spline.h).
#pragma once

#include "sim/masses/cubic_spline.h"
#include "tests/physics/prescribed_run.h"

namespace ballast::test {

// The firmware's parameters of this ball, its masses on their rails. Throws the reason of a refusal.
firmware::BallParams ball_on_rails(const sim::Scenario& scenario);

class TrajectoryRun {
 public:
  explicit TrajectoryRun(const sim::Scenario& scenario);
  TrajectoryRun(const TrajectoryRun&) = delete;
  TrajectoryRun& operator=(const TrajectoryRun&) = delete;

  // Integrates on to time_s, restarting where a motion piece ends or a table has a row. False if CVODE gave up.
  bool advance(double time_s) { return run_.advance(time_s); }

  Eigen::Vector4d orientation() const;  // w, x, y, z, normalised
  Eigen::Vector3d angular_velocity_B() const;
  Eigen::Vector2d position_W() const;
  firmware::RollingForces forces() const;  // at a jump: after it

 private:
  firmware::RollingForces forces_at(double time_s, const firmware::MassMotion& masses, const double* y) const;
  Eigen::Vector3d force_W(double time_s, const Eigen::Vector3d& velocity_W) const;

  firmware::BallParams ball_;
  std::vector<sim::CubicSpline> trajectories_;  // per mass; empty where it is on its rail
  sim::ForceTable table_;
  sim::Drag drag_;
  PrescribedRun run_;
};

}  // namespace ballast::test
