// A prescribed run integrated by an independent program: SUNDIALS CVODE (Adams) on the firmware's closed forms and
// profiles. Nothing of sim/ but the scenario is used, and for masses on trajectories their curve (cubic_spline.h).
#pragma once

#include <Eigen/Core>

#include "firmware/model/rolling.h"
#include "sim/scenario.h"

namespace ballast::test {

// What the firmware would be told of this ball, its masses on their rails. Throws what it was refused for.
firmware::BallParams ball_on_rails(const sim::Scenario& scenario);

class TrajectoryRun {
 public:
  explicit TrajectoryRun(const sim::Scenario& scenario);
  ~TrajectoryRun();
  TrajectoryRun(const TrajectoryRun&) = delete;
  TrajectoryRun& operator=(const TrajectoryRun&) = delete;

  // Integrates on to time_s, restarting where a motion piece ends or a table has a row. False if CVODE gave up.
  bool advance(double time_s);

  Eigen::Vector4d orientation() const;  // w, x, y, z, normalised
  Eigen::Vector3d angular_velocity_B() const;
  Eigen::Vector2d position_W() const;
  firmware::RollingForces forces() const;  // at a jump: after it

 private:
  struct Impl;
  Impl* impl_;
};

}  // namespace ballast::test
