#include "tools/go/go_plan.h"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <future>
#include <limits>

#include "firmware/governor/backup.h"
#include "tools/go/standpoint.h"
#include "tools/plan/bounds.h"
#include "tools/plan/read_task.h"
#include "tools/plan/search.h"
#include "tools/program/params.h"
#include "tools/tracking/followed_plan.h"

namespace ballast::go {

namespace {

// Parts of the motors' limits and of the governor's cone that a plan uses. Feedback and the stops that certify a course
// need the rest: without it the governor bends some of the plans so much that none of its stops is certified.
constexpr double kRoom = 0.75, kUsed = 0.9;
// Tolerance of a plan's place and rest at its end, over r and sqrt(g r): feedback takes the rest away. In speed it is a
// third of what counts as rest.
constexpr double kTolerance = 3e-3;

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

// The friction that the governor would have to use at a moment between two nodes, at this part of its speeds: f_s / N
// with what the motors may swing. f_s goes with the square of the speeds, the swing by its resonances. `share`: 0 at
// the first node, 1 at the second.
double need_with_motors(const firmware::ControllerParams& params, const firmware::GovernorParams& governor,
                        const plan::Node& node, const plan::Node& next, double share, double part) {
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
  const firmware::Vector3 force_n = forces.force(n, u);
  if (!(force_n[2] > governor.min_normal_force_n)) return std::numeric_limits<double>::infinity();
  if (std::isinf(governor.friction)) return force_n.head<2>().norm() / force_n[2];
  firmware::Cone cone = firmware::cone_of(governor, forces, robot, n);
  cone.friction *= kUsed;
  return cone.friction + firmware::outside_n(cone, forces, n, u) / force_n[2];
}

// need_with_motors() of the whole motion, where it is greatest.
double most_need(const firmware::ControllerParams& params, const std::vector<plan::Node>& nodes, double part) {
  const firmware::GovernorParams governor = firmware::governor_params(params);
  constexpr int kLooks = 4;  // a mass passes a resonance within the time between two nodes
  double most = 0;
  for (std::size_t k = 1; k < nodes.size(); ++k) {
    for (int look = 0; look < kLooks; ++look) {
      const double share = static_cast<double>(look) / kLooks;
      most = std::max(most, need_with_motors(params, governor, nodes[k - 1], nodes[k], share, part));
    }
  }
  return most;
}

// The greatest part of the motion's speeds, up to 1, with which all of it fits the governor's cone.
double fitting_speed(const firmware::ControllerParams& params, const std::vector<plan::Node>& nodes) {
  const double allowed = kUsed * firmware::governor_params(params).friction;
  constexpr double kSlower = 0.95, kSlowest = 0.1;
  double part = 1;
  while (part > kSlowest && most_need(params, nodes, part) > allowed) part *= kSlower;
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
    options.equality_tolerance = kTolerance;
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
std::optional<GoPlan> finished(const firmware::ControllerParams& params, const Try& found, std::string& why) {
  GoPlan plan;
  plan.moved = plan::with_motion(found.file.scenario, found.outcome.plan->grid, found.outcome.plan->knots);
  for (sim::Mass& mass : plan.moved.masses) stop_exactly(mass);
  plan.need = found.outcome.plan->run.need;
  plan.most_need = std::max(plan.need, most_need(params, found.outcome.plan->run.nodes, 1));
  plan.goal_error_m = found.outcome.plan->goal_error_m;
  if (const auto refused = plan::set_reference(plan.moved, found.problem.robot.ball, plan.reference)) {
    why = "there is no reference: " + *refused;
    return std::nullopt;
  }
  return plan;
}

// A failed search's words, without keys of a task's file, which the caller of `go` never wrote.
std::string in_words_of_go(std::string text) {
  const auto replace = [&](const std::string& old, const std::string& word) {
    for (std::size_t at = text.find(old); at != std::string::npos; at = text.find(old, at + word.size())) {
      text.replace(at, old.size(), word);
    }
  };
  for (const char* key : {"goal", "at_rest", "duration", "friction_use, surface.static_friction", "avoid_resonance"}) {
    replace(fmt::format(" (task.{})", key), "");
  }
  replace(", task.torque_margin)", ")");
  replace("task.via.", "--via ");
  return text;
}

std::string first_clause(const std::string& text) { return text.substr(0, text.find(';')); }

struct Planner {
  const sim::Scenario& from;
  const firmware::ControllerParams& params;
  const plan::ReferencePoint& at;
  const std::function<bool()>& stop;
  const std::function<void(const std::string&)>& say;

  // In a duration that is given, or in one of at least `least_s` that is chosen.
  [[nodiscard]] GoOutcome plan(const GoTask& task, double least_s = 0) const;
  // A nearer place and a longer duration for which there are plans, in words. Empty: none was found.
  [[nodiscard]] std::string offers(const GoTask& task) const;
};

GoOutcome Planner::plan(const GoTask& task, double least_s) const {
  constexpr double kLonger = 1.35;  // of the second of two searches, and of the next two
  constexpr double kFits = 0.96;    // a part of the speeds that is as good as all of them
  constexpr int kRaces = 12;
  const auto likely = [&] { return likely_duration_s(problem_of(task_file(from, task, 1), at), task); };
  double duration_s = task.duration_s ? *task.duration_s : std::max(likely(), least_s);
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
        out.plan = finished(params, *found, out.why);
        return out;
      }
      const double tried_s = found->file.task.duration_s;
      const double needed_s = tried_s / part;
      out.why = fmt::format("in {:.3g} s its motors would swing so much that the governor bends it", tried_s);
      if (task.duration_s) {
        out.why += fmt::format("; about {:.3g} s would do", needed_s);
        return out;
      }
      say(fmt::format("{}; looks for {:.3g} s", out.why, needed_s));
      fastest = std::move(*found);
      duration_s = needed_s;
      continue;
    }
    const Try& failed = tries.front();
    out.why = in_words_of_go(failed.outcome.binding);
    if (task.duration_s || failed.outcome.status == plan::Status::kInfeasible) return out;
    if (k % 2 == 1) duration_s *= kLonger;
    if (!stop()) say(fmt::format("not in {:.3g} s: {}", failed.file.task.duration_s, first_clause(out.why)));
  }
  return out;
}

std::string Planner::offers(const GoTask& task) const {
  std::string text;
  const Eigen::Vector2d start_m(at.place_m[0], at.place_m[1]);
  for (const double part : {0.8, 0.5, 0.25, 0.1}) {
    if (stop() || !task.via_m.empty()) break;
    GoTask nearer = task;
    nearer.to_m = start_m + part * (task.to_m - start_m);
    if (!plan(nearer).plan) continue;
    text += fmt::format("; it could go to ({:.3g}, {:.3g}) m in {:.3g} s", nearer.to_m[0], nearer.to_m[1],
                        *task.duration_s);
    break;
  }
  constexpr double kLeastLonger = 1.1;
  GoTask longer = task;
  longer.duration_s.reset();
  if (const GoOutcome out = plan(longer, kLeastLonger * *task.duration_s); out.plan) {
    text += fmt::format("; it could be there in {:.3g} s", out.plan->moved.duration_s);
  }
  return text;
}

}  // namespace

GoOutcome plan_course(const sim::Scenario& scenario, const firmware::ControllerParams& params,
                      const plan::ReferencePoint& at, const GoTask& task, const std::function<bool()>& stop,
                      const std::function<void(const std::string&)>& say) {
  const sim::Scenario from = set_down(scenario, at);
  const Planner planner{from, params, at, stop, say};
  GoOutcome out = planner.plan(task);
  if (out.plan || !task.duration_s || stop()) return out;
  say(fmt::format("not in {:.3g} s: {}; looks for what can be done", *task.duration_s, first_clause(out.why)));
  const std::function<void(const std::string&)> quiet = [](const std::string&) {};
  out.why += Planner{from, params, at, stop, quiet}.offers(task);
  return out;
}

}  // namespace ballast::go
