// Bounds that no motion of a robot passes, so that an impossible task is refused without a search.
#pragma once

#include <optional>
#include <string>

#include "tools/plan/transcription.h"

namespace ballast::plan {

// How far friction carries a ball that starts at rest, in a given time: at f_s <= mu N by at most
// offset_m + mu * per_friction_m.
//
// The centre of mass, at height z above the geometric centre, moves horizontally by the integral of (T/2 - t) f / M
// from rest to rest, and of (T - t) f / M if it only passes. With f <= mu N, N = M (g + z'') and partial integration
// this is at most mu (g T^2 / 4 + 2 z(T/2) - z(0) - z(T)) and mu (g T^2 / 2 + z(T) - z(0)).
//
// On a slope g is the weight's part along the normal. Its part in the floor is one more constant force: from rest to
// rest it cancels, else it carries the ball g sin(angle) T^2 / 2 far. The floor's moment moves no centre of mass.
struct Reach {
  double offset_m = 0;        // of the centre of mass from the geometric centre at both ends, and of constant forces
  double per_friction_m = 0;  // > 0
  double height_m = 0;        // part of per_friction_m that does not grow with the time
  double gravity_mps2 = 0;    // the rest of it is gravity_mps2 T^2 / divisor
  double divisor = 4;

  [[nodiscard]] double at(double friction) const { return offset_m + friction * per_friction_m; }
  [[nodiscard]] double need(double distance_m) const { return (distance_m - offset_m) / per_friction_m; }
  [[nodiscard]] double least_duration_s(double distance_m, double friction) const;
};

[[nodiscard]] Reach reach_of_friction(const Problem& problem, double duration_s, bool to_rest);

// How far motors carry a ball that starts at rest, by their power: rates, accelerations and torques.
//
// Rolling without slipping, the floor does no work. So the kinetic energy E of ball and masses is at most the potential
// energy that they can still give and the motors' work, and before the end of a motion to rest it is at most what
// potential energy and motors can take up again, unless the floor resists. A motor's work is at most its greatest power
// by the time, and its greatest force by the path of its mass. E >= M v^2 / 2 for the centre of mass, and E >= (m + I /
// r^2) v^2 / 2 for the shell and the geometric centre.
struct MotorReach {
  double distance_m = 0;
  Limit limit{};  // what limits the strongest motor
};

// None: a mass has no motor, or an external force or the weight on a slope does work.
[[nodiscard]] std::optional<MotorReach> reach_of_motors(const Problem& problem, double duration_s, bool to_rest);

// The shortest duration in which motors may get so far, within a percent from below.
[[nodiscard]] double least_duration_of_motors_s(const Problem& problem, double distance_m, bool to_rest);

// Why no place of the masses lets the ball rest in equilibrium, by physics.md ("Rest"): the centre of mass does not get
// far enough from the geometric centre, friction does not hold the ball, or a force across the slope spins it. Empty if
// that is not certain.
[[nodiscard]] std::string no_rest(const Problem& problem);

// The limits that keep all masses within a thousandth of the radius; empty if one can move farther, or if the ball does
// not hang at rest on a level floor at the start.
[[nodiscard]] std::string immobile(const Problem& problem);

// The limit that keeps a mass from its place in task.mass_position; empty if none surely does.
[[nodiscard]] std::string mass_too_far(const Problem& problem);

}  // namespace ballast::plan
