// The ball of a prescribed scenario as Simbody, an independent multibody program, sees it: a peer to verify the plant
// against, and to measure speed beside.
//
// Nothing in it is this project's mechanics. Simbody is told of bodies and joints and finds the motion by itself:
//   shell   a free body, origin at the geometric centre, with m_0, its centre of mass and inertia; a sphere of the
//           ball's radius that rolls on the plane z = -r: Constraint::SphereOnPlaneContact, three equations that hold
//           it down and keep the contact point from slipping. It pulls as well as it pushes, so N may turn negative.
//   mass i  a point mass on a pin joint through the centre of its circle, or on a slider along its line, the joint's
//           position prescribed as the scenario's `motion` says (Motion::Custom).
//   force   the scenario's, on the shell at the geometric centre: constant, a table, drag (Force::Custom).
// N and friction are the force that the constraint's multipliers put on the sphere. The rails' geometry is the
// scenario's.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>

#include "sim/scenario/scenario.h"

namespace ballast::peer {

class SimbodyBall {
 public:
  // `accuracy` is Simbody's own: the local error it allows the state in a step of its Runge-Kutta-Merson integrator.
  // Throws std::invalid_argument for a start that does not roll.
  SimbodyBall(const sim::Scenario& scenario, double accuracy);
  ~SimbodyBall();

  // Integrates to end_s >= time_s(). The integrator starts anew where a motion piece ends and at the times of the
  // force's table, because the accelerations have a kink or a jump there.
  void advance(double end_s);

  [[nodiscard]] double time_s() const;

  // The state now. Where something jumps now, the value after the jump.
  struct Sample {
    Eigen::Vector4d orientation;               // w, x, y, z, body to space
    Eigen::Vector3d angular_velocity_B_radps;  // body frame
    Eigen::Vector3d position_W_m;              // of the geometric centre
    double normal_force_n;
    Eigen::Vector2d friction_force_W_n;  // of the surface on the ball
    std::array<double, firmware::kMaxMasses> mass_position{};
    std::array<double, firmware::kMaxMasses> mass_velocity{};
  };
  [[nodiscard]] Sample sample() const;

  // To come back to an instant and integrate from there again.
  class Snapshot;
  [[nodiscard]] std::shared_ptr<const Snapshot> snapshot() const;
  void restore(const Snapshot& snapshot);

 private:
  struct Model;
  std::unique_ptr<Model> model_;
};

}  // namespace ballast::peer
