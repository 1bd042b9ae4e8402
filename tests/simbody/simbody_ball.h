// The ball of a prescribed scenario in Simbody, an independent multibody program: a peer to verify the plant against,
// and to measure speed beside.
//
// Nothing in it is this project's mechanics. Simbody is told of bodies and joints and finds the motion by itself:
//   shell   a free body, origin at the geometric centre, with m_0, its centre of mass and inertia; a sphere of the
//           ball's radius that rolls on the plane z = -r: Constraint::SphereOnPlaneContact, three equations that hold
//           it down and keep the contact point from slipping. It pulls as well as it pushes, so N may turn negative.
//   mass i  a point mass on a pin joint through the centre of its circle, or on a slider along its line, the joint's
//           position prescribed as the scenario's `motion` says (Motion::Custom).
//   force   the scenario's, on the shell at the geometric centre: constant, a table, drag (Force::Custom).
// N and friction are the force that the constraint's multipliers put on the sphere.
//
// Simbody 3.7's headers need C++17 and the project's need C++20, so this header and its source see plain data only.
// robot_of.h makes that data from a scenario.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <memory>
#include <vector>

namespace ballast::peer {

inline constexpr std::size_t kMaxMasses = 8;

// A rolling ball with prescribed masses, SI units. The rails are circles and lines; the start rolls.
struct Robot {
  double radius_m = 0, gravity_mps2 = 0;
  double shell_mass_kg = 0;
  Eigen::Vector3d inertia_kgm2 = Eigen::Vector3d::Zero();  // principal, about the shell's own centre of mass
  Eigen::Vector3d center_of_mass_B_m = Eigen::Vector3d::Zero();

  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  // body to space
  Eigen::Vector3d angular_velocity_B_radps = Eigen::Vector3d::Zero();
  Eigen::Vector2d position_W_m = Eigen::Vector2d::Zero();

  // The rail acceleration goes linearly from start to end; after the last piece it is 0.
  struct Piece {
    double duration_s, acceleration_start, acceleration_end;
  };
  struct Mass {
    double mass_kg = 0;
    bool on_circle = false;  // else on a line
    double circle_radius_m = 0;
    Eigen::Vector3d origin_B_m, axis_cos_B, axis_sin_B;  // as firmware::Rail has them
    double initial_position = 0, initial_velocity = 0;   // rad or m, and per s
    std::vector<Piece> motion;
  };
  std::vector<Mass> masses;

  // On the geometric centre: constant, or a table that is linear between its times; and drag in a wind.
  Eigen::Vector3d force_W_n = Eigen::Vector3d::Zero();
  std::vector<double> force_times_s;
  std::vector<Eigen::Vector3d> forces_W_n;
  double drag_kgpm = 0;
  Eigen::Vector3d wind_W_mps = Eigen::Vector3d::Zero();
};

class SimbodyBall {
 public:
  // `accuracy` is Simbody's own: the local error it allows the state in a step of its Runge-Kutta-Merson integrator.
  SimbodyBall(const Robot& robot, double accuracy);
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
    std::array<double, kMaxMasses> mass_position{};
    std::array<double, kMaxMasses> mass_velocity{};
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
