#include "tools/go/go_plan.h"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <future>

#include "firmware/governor/backup.h"
#include "tools/go/standpoint.h"
#include "tools/plan/alternatives.h"
#include "tools/plan/bounds.h"
#include "tools/plan/search.h"
#include "tools/program/params.h"
#include "tools/tracking/followed_plan.h"

namespace ballast::go {

namespace {

// Parts of the motors' limits and of the governor's cone that a plan uses. Feedback and the stops that certify a course
// need the rest: without it the governor bends some of the plans so much that none of its stops is certified.
constexpr double kRoom = 0.75, kUsed = 0.9;

// A time in which a ball surely gets there: a few swings of masses that hang, with half of the motors' power and half
// of the friction that may be used.
double likely_duration_s(const plan::Problem& problem, const GoTask& task) {
  double way_m = 0;
  Eigen::Vector2d from = problem.start_m;
  for (const Eigen::Vector2d& place : task.via_m) {
    way_m += (place - from).norm();
    from = place;
  }
  way_m += (task.to_m - from).norm();
  const firmware::BallParams& ball = problem.robot.ball;
  const double g = std::max(-ball.gravity_mps2 * ball.down_W[2], 1e-9);
  const double friction = std::min(problem.friction_limit, 1.0) / 2;
  const double by_friction_s = std::sqrt(4 * way_m / (g * friction));
  const double by_motors_s = 2 * plan::least_duration_of_motors_s(problem, way_m, true);
  constexpr double kSwings = 45;  // sqrt(r / g)
  return kSwings * plan::time_unit_s(problem) + std::max(by_friction_s, by_motors_s);
}

plan::TaskFile task_file(const sim::Scenario& from, const GoTask& task, double duration_s) {
  plan::TaskFile file;
  file.scenario = from;
  file.scenario.duration_s = duration_s;
  file.task.goal_m = task.to_m;
  file.task.duration_s = duration_s;
  file.task.objective = task.objective;
  for (const Eigen::Vector2d& place : task.via_m) file.task.via.push_back({place, std::nullopt});
  return file;
}

plan::Problem problem_of(const plan::TaskFile& file, const plan::ReferencePoint& at) {
  plan::Problem problem = plan::make_problem(file);
  problem.start.acceleration = at.state.acceleration;
  for (std::size_t i = 0; i < file.scenario.masses.size(); ++i) {
    plan::MassLimits& limits = problem.limits[i];
    limits.speed = std::max(kRoom * limits.speed, std::min(std::fabs(at.state.velocity[i]), limits.speed));
    limits.acceleration *= kRoom;
    limits.jerk *= kRoom;
  }
  return problem;
}

struct Try {
  plan::TaskFile file;
  plan::Problem problem;
  plan::Outcome outcome;
};

Try make_try(const sim::Scenario& from, const plan::ReferencePoint& at, const GoTask& task, double duration_s) {
  Try out{task_file(from, task, duration_s), {}, {}};
  out.problem = problem_of(out.file, at);
  return out;
}

// Whether a moment between two nodes, at this part of its speeds, lies inside the cone that the governor keeps free of
// what the motors may swing: f_s goes with the square of the speeds, the swing by its resonances. `share`: 0 at the
// first node, 1 at the second.
bool fits(const firmware::ControllerParams& params, const firmware::GovernorParams& governor, const plan::Node& node,
          const plan::Node& next, double share, double part) {
  const int n = params.ball.mass_count;
  firmware::RobotState robot;
  const auto& q = node.state.q;
  robot.orientation = firmware::Quaternion(q[0], q[1], q[2], q[3]);
  const plan::Vec& w = node.state.omega_B;
  robot.angular_velocity_B_radps = part * firmware::Vector3(w.x, w.y, w.z);
  firmware::PerMass<firmware::Real> u{};
  const auto between = [&](const plan::PerMass<double>& from, const plan::PerMass<double>& to, std::size_t i) {
    return (1 - share) * from[i] + share * to[i];
  };
  for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
    robot.mass_position[i] = node.state.position[i];
    robot.mass_velocity[i] = part * between(node.state.velocity, next.state.velocity, i);
    robot.mass_acceleration[i] = u[i] = part * part * between(node.state.acceleration, next.state.acceleration, i);
  }
  const firmware::AffineForces forces = firmware::forces_at(params.ball, governor, robot);
  firmware::Cone cone = firmware::cone_of(governor, forces, robot, n);
  cone.friction *= kUsed;
  return firmware::outside_n(cone, forces, n, u) <= 0;
}

// The greatest part of the motion's speeds, up to 1, with which all of it fits.
double fitting_speed(const firmware::ControllerParams& params, const std::vector<plan::Node>& nodes) {
  const firmware::GovernorParams governor = firmware::governor_params(params);
  constexpr double kSlower = 0.95, kSlowest = 0.1;
  constexpr int kLooks = 4;  // a mass passes a resonance within the time between two nodes
  double part = 1;
  for (std::size_t k = 1; k < nodes.size(); ++k) {
    for (int look = 0; look < kLooks; ++look) {
      const double share = static_cast<double>(look) / kLooks;
      while (part > kSlowest && !fits(params, governor, nodes[k - 1], nodes[k], share, part)) part *= kSlower;
    }
  }
  return part;
}

// Searches for all at once, one thread each. The first that finds a plan ends the others. `neighbour`: a plan of the
// same way from which the first of them begins; null: none. `seed`: of the first, counted on.
void race(std::vector<Try>& tries, const Try* neighbour, std::uint64_t seed, const std::function<bool()>& stop) {
  std::atomic<bool> found = false;
  std::vector<std::future<void>> running;
  for (Try& one : tries) {
    const bool first = &one == &tries.front();
    plan::SearchOptions options;
    options.seed = seed++;
    options.quick = true;
    options.stop = [&] { return found || stop(); };
    if (neighbour != nullptr && first) {
      const plan::Plan& plan = *neighbour->outcome.plan;
      options.from = plan::stretched_motion(neighbour->file.scenario, plan.grid, plan.knots, one.file.task.duration_s);
    }
    running.push_back(std::async(std::launch::async, [&one, &found, options] {
      one.outcome = plan::search(one.problem, one.file.scenario, options);
      if (one.outcome.plan) found = true;
    }));
  }
  for (std::future<void>& one : running) one.wait();
}

// A plan's masses stand at its end within a tolerance. They hold for hours where it ends, so they come to rest exactly,
// by the acceleration at the last knot but one.
void stop_exactly(sim::Mass& mass) {
  if (mass.motion.size() < 2) return;
  double velocity = mass.initial_velocity;
  for (const sim::MotionPiece& piece : mass.motion) {
    velocity += piece.duration_s * (piece.acceleration_start + piece.acceleration_end) / 2;
  }
  sim::MotionPiece &before = mass.motion[mass.motion.size() - 2], &last = mass.motion.back();
  const double change = -2 * velocity / (before.duration_s + last.duration_s);
  before.acceleration_end += change;
  last.acceleration_start += change;
}

// Nullopt, and `why`: there is no reference.
std::optional<GoPlan> finished(const Try& found, std::string& why) {
  GoPlan plan;
  plan.moved = plan::with_motion(found.file.scenario, found.outcome.plan->grid, found.outcome.plan->knots);
  for (sim::Mass& mass : plan.moved.masses) stop_exactly(mass);
  plan.need = found.outcome.plan->run.need;
  plan.goal_error_m = found.outcome.plan->goal_error_m;
  if (const auto refused = plan::set_reference(plan.moved, found.problem.robot.ball, plan.reference)) {
    why = "there is no reference: " + *refused;
    return std::nullopt;
  }
  return plan;
}

}  // namespace

GoOutcome plan_course(const sim::Scenario& scenario, const firmware::ControllerParams& params,
                      const plan::ReferencePoint& at, const GoTask& task, const std::function<bool()>& stop) {
  const sim::Scenario from = set_down(scenario, at);
  constexpr double kLonger = 1.35;  // of the second of two searches, and of the next two
  constexpr double kFits = 0.96;    // a part of the speeds that is as good as all of them
  constexpr int kRaces = 12;
  double duration_s =
      task.duration_s ? *task.duration_s : likely_duration_s(problem_of(task_file(from, task, 1), at), task);
  GoOutcome out;
  std::optional<Try> fastest;  // found, and too fast for the governor
  for (int k = 0; k < kRaces && !stop(); ++k) {
    std::vector<Try> tries{make_try(from, at, task, duration_s)};
    tries.push_back(make_try(from, at, task, task.duration_s ? duration_s : kLonger * duration_s));
    race(tries, fastest ? &*fastest : nullptr, tries.size() * static_cast<std::uint64_t>(k), stop);
    const auto found = std::find_if(tries.begin(), tries.end(), [](const Try& one) { return one.outcome.plan; });
    if (found != tries.end()) {
      const double part = fitting_speed(params, found->outcome.plan->run.nodes);
      if (part >= kFits) {
        out.plan = finished(*found, out.why);
        return out;
      }
      const double needed_s = found->file.task.duration_s / part;
      if (task.duration_s) {
        out.why =
            fmt::format("in {:.3g} s its motors swing so much that the governor would bend it; about {:.3g} s would do",
                        *task.duration_s, needed_s);
        return out;
      }
      fastest = std::move(*found);
      duration_s = needed_s;
      continue;
    }
    const Try& failed = tries.front();
    out.why = failed.outcome.binding;
    if (task.duration_s && failed.outcome.status == plan::Status::kNotFound && !stop()) {
      plan::SearchOptions options;
      options.quick = true;
      options.stop = stop;
      out.why += plan::alternatives_text(
          failed.file, plan::find_alternatives(failed.file, failed.outcome, options, [](const std::string&) {}));
    }
    if (task.duration_s || failed.outcome.status == plan::Status::kInfeasible) return out;
    if (k % 2 == 1) duration_s *= kLonger;
  }
  if (fastest && out.why.empty()) {
    out.why = "its motors swing so much at every duration tried that the governor would bend it";
  }
  return out;
}

}  // namespace ballast::go
