#include "tools/go/standpoint.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "firmware/tracking/tracker.h"
#include "tools/tracking/followed_plan.h"

namespace ballast::go {

namespace {

constexpr double kRestSpeed = 0.01;  // sqrt(g r): that of the firmware's halt
// sqrt(g r): a ball that turns slower is the same for the controller when it has found a certificate.
constexpr double kStill = 0.0025;

Eigen::Quaterniond orientation_of(const plan::ReferencePoint& at) {
  const auto& q = at.state.q;
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
}

Eigen::Vector3d angular_velocity_W_radps(const plan::ReferencePoint& at) {
  const plan::Vec& w = at.state.omega_B;
  return orientation_of(at) * Eigen::Vector3d(w.x, w.y, w.z);
}

// The geometric centre's: a turn about the vertical does not carry the ball on.
double speed_mps(const sim::Scenario& scenario, const plan::ReferencePoint& at) {
  return scenario.ball.radius_m * angular_velocity_W_radps(at).head<2>().norm();
}

// Turns the ball about the vertical.
void turn(plan::ReferencePoint& at, double angle_rad) {
  const Eigen::Quaterniond q = Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ()) * orientation_of(at);
  at.state.q = {q.w(), q.x(), q.y(), q.z()};
}

// Lets a ball that hangs turn about the vertical for a time, as nothing brakes it.
void settle(plan::ReferencePoint& at, double spin_radps, double time_s) {
  turn(at, spin_radps * time_s);
  const Eigen::Vector3d omega_B = orientation_of(at).conjugate() * Eigen::Vector3d(0, 0, spin_radps);
  at.state.omega_B = {omega_B[0], omega_B[1], omega_B[2]};
}

// How far `to` is turned about the vertical from `from`.
double yaw_rad(const plan::ReferencePoint& from, const plan::ReferencePoint& to) {
  const Eigen::Quaterniond q = orientation_of(to) * orientation_of(from).conjugate();
  return 2 * std::atan2(q.z(), q.w());
}

// The ball neither rolls nor turns about the vertical.
bool stands_still(const sim::Scenario& scenario, const plan::ReferencePoint& at) {
  const double turns_mps = scenario.ball.radius_m * angular_velocity_W_radps(at).norm();
  return turns_mps < kStill / kRestSpeed * rest_speed_mps(scenario);
}

bool masses_stand(const plan::ReferencePoint& at, std::size_t masses) {
  constexpr double kRounding = 1e-9;  // of a motion's sums
  for (std::size_t i = 0; i < masses; ++i) {
    if (std::fabs(at.state.velocity[i]) > kRounding || std::fabs(at.state.acceleration[i]) > kRounding) return false;
  }
  return true;
}

// The plant's state of a motion at time_s; before its start the one there.
std::optional<plan::ReferencePoint> roll_to(sim::Scenario moved, double time_s) {
  if (!(time_s > 0)) {
    const auto points = plan::roll_motion(moved, 1);
    if (points.empty()) return std::nullopt;
    return points.front();
  }
  moved.duration_s = time_s;
  const auto points = plan::roll_motion(moved, 1);
  if (points.size() != 2) return std::nullopt;
  return points.back();
}

// The point of the motion that the controller follows at the start of `tick`. One that has come to rest is held at its
// end, whatever its plan has left of speed there.
std::optional<plan::ReferencePoint> on_motion(const Heard& heard, std::int64_t tick, bool& rests) {
  const sim::Scenario moved =
      heard.course ? scenario_of(heard.scenario, *heard.course) : plan::as_planned(heard.scenario);
  const std::int64_t start = heard.status.course_tick;
  const double period_s = heard.scenario.run.control_period_s;
  const auto motion_s = [&](std::int64_t at_tick) {
    return static_cast<double>(at_tick - start) * period_s - heard.status.motion_delay_s;
  };
  const double end_s = plan::motion_end_s(moved);
  const auto comes_to_rest = [&](const plan::ReferencePoint& at) {
    return masses_stand(at, moved.masses.size()) && speed_mps(moved, at) < rest_speed_mps(moved);
  };
  rests = false;
  if (motion_s(heard.status.tick) >= end_s) {
    const auto end = roll_to(moved, end_s);
    rests = end && comes_to_rest(*end);
    if (rests) return end;
  }
  return roll_to(moved, motion_s(tick));
}

// Further off, feedback does not lead it back as the gains say.
double most_off_m(const sim::Scenario& scenario) {
  return static_cast<double>(firmware::kMostPlaceError) * scenario.ball.radius_m;
}

// The turn about the vertical, in rad/s, that a ball which hangs keeps. 0: it hardly turns, or the floor ends it. On a
// slope a ball that turned would no longer hang.
double lasting_spin_radps(const sim::Scenario& scenario, const plan::ReferencePoint& here) {
  if (scenario.surface.slope_rad != 0 || scenario.surface.spin_friction_m > 0) return 0;
  const double spin_radps = angular_velocity_W_radps(here)[2];
  const double least_radps = kHardlyTurns / kRestSpeed * rest_speed_mps(scenario) / scenario.ball.radius_m;
  return std::fabs(spin_radps) < least_radps ? 0 : spin_radps;
}

double off_m(const plan::ReferencePoint& here, const plan::ReferencePoint& expected) {
  return std::hypot(here.place_m[0] - expected.place_m[0], here.place_m[1] - expected.place_m[1]);
}

}  // namespace

double rest_speed_mps(const sim::Scenario& scenario) {
  const double g = scenario.gravity_mps2, r = scenario.ball.radius_m;
  return kRestSpeed * (g > 0 ? std::sqrt(g * r) : r);
}

bool ball_rests(const Heard& heard) { return speed_mps(heard.scenario, now(heard)) < rest_speed_mps(heard.scenario); }

bool needs_halt(const Heard& heard) {
  if (heard.status.mode != controller_status_t::MODE_RUNNING) return false;
  if (heard.status.backup_active != 0) return true;
  bool rests = false;
  const auto expected = on_motion(heard, heard.status.tick, rests);
  return expected && off_m(now(heard), *expected) > most_off_m(heard.scenario);
}

plan::ReferencePoint now(const Heard& heard) {
  plan::ReferencePoint at{};
  const controller_status_t& status = heard.status;
  const bool estimated = status.estimate_valid != 0;
  const double* q = estimated ? status.estimated_orientation : heard.plant.orientation;
  const double* omega = estimated ? status.estimated_angular_velocity_B_radps : heard.plant.angular_velocity_B_radps;
  const double* place = estimated ? status.estimated_position_W_m : heard.plant.position_W_m;
  std::copy_n(q, 4, at.state.q.begin());
  at.state.omega_B = {omega[0], omega[1], omega[2]};
  at.place_m = {place[0], place[1]};
  for (int i = 0; i < status.motor_count; ++i) {
    at.state.position[static_cast<std::size_t>(i)] = status.commanded_position[i];
    at.state.velocity[static_cast<std::size_t>(i)] = status.commanded_velocity[i];
  }
  return at;
}

sim::Scenario set_down(const sim::Scenario& scenario, const plan::ReferencePoint& at) {
  sim::Scenario out = sim::as_believed(scenario);
  out.faults.clear();
  out.plan = {};
  out.published.clear();
  out.run.actuation = sim::Actuation::kStepper;  // the planner keeps the motors' limits
  out.initial.has_velocity = false;
  out.initial.height_m = 0;
  const auto& q = at.state.q;
  out.initial.orientation = {q[0], q[1], q[2], q[3]};
  out.initial.orientation.normalize();
  out.initial.angular_velocity_B_radps = {at.state.omega_B.x, at.state.omega_B.y, at.state.omega_B.z};
  out.initial.position_W_m = {at.place_m[0], at.place_m[1]};
  for (std::size_t i = 0; i < out.masses.size(); ++i) {
    out.masses[i].initial_position = at.state.position[i];
    out.masses[i].initial_velocity = at.state.velocity[i];
    out.masses[i].motion.clear();
  }
  return out;
}

sim::Scenario scenario_of(const sim::Scenario& scenario, const HostCourse& course) {
  plan::ReferencePoint at{};
  const auto& row = course.reference.values;
  std::copy_n(row.begin(), 4, at.state.q.begin());
  at.state.omega_B = {row[4], row[5], row[6]};
  at.place_m = {row[7], row[8]};
  sim::Scenario out = set_down(scenario, at);
  for (std::size_t i = 0; i < std::min(out.masses.size(), course.mass.size()); ++i) {
    out.masses[i].initial_position = course.mass[i].position;
    out.masses[i].initial_velocity = course.mass[i].velocity;
    out.masses[i].motion = course.mass[i].motion;
  }
  out.duration_s = plan::motion_end_s(out);
  return out;
}

std::optional<Standpoint> standpoint_at(const Heard& heard, std::int64_t tick, std::string& why) {
  const plan::ReferencePoint here = now(heard);
  const double spin_radps = lasting_spin_radps(heard.scenario, here);
  const double ahead_s = static_cast<double>(tick - heard.status.tick) * heard.scenario.run.control_period_s;
  Standpoint out;
  if (heard.status.mode == controller_status_t::MODE_RUNNING) {
    const auto at = on_motion(heard, tick, out.rests);
    const auto expected = on_motion(heard, heard.status.tick, out.rests);
    if (!at || !expected) {
      why = "the motion that the controller follows is not known, or leaves the floor";
      return std::nullopt;
    }
    const double most_m = most_off_m(heard.scenario);
    if (const double off = off_m(here, *expected); off > most_m) {
      why = fmt::format("the ball is {:.3g} m off its motion, more than {:.3g} m: halt it first", off, most_m);
      return std::nullopt;
    }
    out.at = *at;
    if (out.rests) {
      // It hangs where it is, and may have turned about the vertical. One that rocks will hang where it is held.
      out.hangs = ball_rests(heard);
      if (out.hangs) {
        out.at.place_m = here.place_m;
        out.at.state.q = here.state.q;
      } else if (heard.scenario.surface.slope_rad == 0) {
        turn(out.at, yaw_rad(out.at, here));
      }
      settle(out.at, spin_radps, ahead_s);
      out.rests = stands_still(heard.scenario, out.at);
    }
    return out;
  }
  out.rests = stands_still(heard.scenario, here);
  out.hangs = heard.status.mode == controller_status_t::MODE_ARMED && heard.status.at_rest != 0 && ball_rests(heard);
  out.at = here;
  // The masses hold from the next tick on, where they have just come to.
  for (int i = 0; i < heard.status.motor_count; ++i) {
    out.at.state.position[static_cast<std::size_t>(i)] = heard.status.next_position[i];
    out.at.state.velocity[static_cast<std::size_t>(i)] = heard.status.next_velocity[i];
  }
  if (out.rests) {
    settle(out.at, spin_radps, ahead_s);
    return out;
  }
  const sim::Scenario held = set_down(heard.scenario, out.at);
  const auto at = roll_to(held, ahead_s);
  if (!at) {
    why = "the ball leaves the floor";
    return std::nullopt;
  }
  out.at = *at;
  return out;
}

}  // namespace ballast::go
