// A prescribed run integrated by an independent program: CVODE on the firmware's closed forms and profiles.
#pragma once

#include <Eigen/Core>

#include "firmware/model/rolling.h"
#include "tests/physics/prescribed_run.h"

namespace ballast::test {

// Rolling: eq_Om_1d.
class ClosedFormRun {
 public:
  explicit ClosedFormRun(const sim::Scenario& scenario);

  bool advance(double time_s) { return run_.advance(time_s); }

  Eigen::Vector4d orientation() const;  // w, x, y, z, normalised
  Eigen::Vector3d angular_velocity_B() const;
  Eigen::Vector2d position_W() const;
  firmware::RollingForces forces() const;  // at a jump: after it

 private:
  firmware::BallParams ball_;
  PrescribedRun run_;
};

// In the air: eq_detach_ball_1d. The scenario starts there (velocity given).
class ClosedFormFlight {
 public:
  explicit ClosedFormFlight(const sim::Scenario& scenario);

  bool advance(double time_s) { return run_.advance(time_s); }

  Eigen::Vector4d orientation() const;  // w, x, y, z, normalised
  Eigen::Vector3d angular_velocity_B() const;
  Eigen::Vector3d position_W() const;
  Eigen::Vector3d velocity_W() const;

 private:
  firmware::BallParams ball_;
  PrescribedRun run_;
};

}  // namespace ballast::test
