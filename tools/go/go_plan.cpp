#include "tools/go/go_plan.h"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <deque>
#include <future>
#include <limits>
#include <memory>
#include <mutex>

#include "firmware/governor/rollout.h"
#include "tools/go/standpoint.h"
#include "tools/plan/bounds.h"
#include "tools/plan/read_task.h"
#include "tools/plan/search.h"
#include "tools/program/params.h"
#include "tools/program/short_number.h"
#include "tools/tracking/followed_plan.h"

namespace ballast::go {

namespace {

// Parts of the motors' limits and of the governor's cone that a plan uses. Feedback and the stops that certify a course
// need the rest: without it the governor bends some of the plans so much that none of its stops is certified.
constexpr double kRoom = 0.75, kUsed = 0.9;
// Tolerance of a plan's place and rest at its end, over r and sqrt(g r): feedback takes the rest away. In speed it is a
// third of what counts as rest.
constexpr double kTolerance = 3e-3;
// sqrt(g / r): the fastest turn about the vertical at a plan's end. Faster, a ball is not held there (reference.cpp).
constexpr double kMostTurn = 0.04;
constexpr double kLonger = 1.35;  // than searches before
// Radii. Of the searches for a leg of up to kLeg more than half succeed, in a quarter of a second; of those for twice
// as much one in five. A long way gets legs of up to kLongestLeg, so that one course holds them.
constexpr double kLeg = 4, kLongestLeg = 8;
constexpr int kMostLegs = firmware::kMaxPieces / plan::kLeastQuickPieces;

// The reference of a course has room for so long.
double longest_course_s(const sim::Scenario& scenario) {
  const double g = scenario.gravity_mps2, unit_s = g > 0 ? std::sqrt(scenario.ball.radius_m / g) : 1;
  return plan::TrackingOptions::kMostSteps * plan::TrackingOptions().step * unit_s;
}

// A time in which a ball surely gets there: a few swings of masses that hang, with half of the motors' power and half
// of the friction that may be used.
double likely_duration_s(const plan::Problem& problem, const GoTask& task) {
  const double length_m = way_m(problem.start_m, task);
  const firmware::BallParams& ball = problem.robot.ball;
  const double g = std::max(-ball.gravity_mps2 * ball.down_W[2], 1e-9);
  const double friction = std::min(problem.friction_limit, 1.0) / 2;
  const double by_friction_s = std::sqrt(4 * length_m / (g * friction));
  const double by_motors_s = 2 * plan::least_duration_of_motors_s(problem, length_m, true);
  constexpr double kSwings = 36;  // sqrt(r / g)
  return kSwings * plan::time_unit_s(problem) + std::max(by_friction_s, by_motors_s);
}

// A ball that turns about the vertical where it rests may turn as fast at the end. One that hardly does, or rolls, may
// not: 0.
double rest_spin_radps(const sim::Scenario& from) {
  const sim::InitialState& initial = from.initial;
  const Eigen::Vector3d omega_W = initial.orientation * initial.angular_velocity_B_radps;
  const double r = from.ball.radius_m, unit_radps = from.gravity_mps2 > 0 ? std::sqrt(from.gravity_mps2 / r) : 1;
  constexpr double kStands = 1e-6;  // rail units/s: a plan's masses stop exactly
  const bool rests = r * omega_W.head<2>().norm() < rest_speed_mps(from) &&
                     std::all_of(from.masses.begin(), from.masses.end(),
                                 [](const sim::Mass& mass) { return std::fabs(mass.initial_velocity) < kStands; });
  const double spin_radps = std::fabs(omega_W[2]);
  return rests && spin_radps >= kHardlyTurns * unit_radps ? std::min(spin_radps, kMostTurn * unit_radps) : 0;
}

plan::TaskFile task_file(const sim::Scenario& from, const GoTask& task, double duration_s) {
  plan::TaskFile file;
  file.scenario = from;
  file.scenario.duration_s = duration_s;
  file.task.goal_m = task.to_m;
  file.task.duration_s = duration_s;
  file.task.objective = task.objective;
  file.task.rest_spin_radps = rest_spin_radps(from);
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

// A whole way, found in one search or in one for each of its legs.
struct Motion {
  sim::Scenario moved;
  firmware::BallParams ball;
  std::vector<plan::Node> nodes;
  double need = 0, goal_error_m = 0;
  Eigen::Vector2d end_m = Eigen::Vector2d::Zero();
  bool on_the_way = false;
};

Motion motion_of(const Try& found) {
  const plan::Plan& plan = *found.outcome.plan;
  return {plan::with_motion(found.file.scenario, plan.grid, plan.knots),
          found.problem.robot.ball,
          plan.run.nodes,
          plan.run.need,
          plan.goal_error_m,
          found.file.task.goal_m};
}

// The robot at the end of a motion, as the plant rolls it.
plan::ReferencePoint end_of(const Motion& motion) { return {motion.nodes.back().state, motion.nodes.back().place_m}; }

void append(const Motion& leg, Motion& way) {
  for (std::size_t i = 0; i < way.moved.masses.size(); ++i) {
    auto& pieces = way.moved.masses[i].motion;
    const auto& more = leg.moved.masses[i].motion;
    pieces.insert(pieces.end(), more.begin(), more.end());
  }
  way.moved.duration_s += leg.moved.duration_s;
  way.nodes.insert(way.nodes.end(), leg.nodes.begin(), leg.nodes.end());
  way.need = std::max(way.need, leg.need);
  way.goal_error_m = leg.goal_error_m;
  way.end_m = leg.end_m;
}

firmware::RobotState robot_of(const plan::RollingState& state, std::size_t masses) {
  firmware::RobotState robot;
  robot.orientation = firmware::Quaternion(state.q[0], state.q[1], state.q[2], state.q[3]);
  robot.angular_velocity_B_radps = {state.omega_B.x, state.omega_B.y, state.omega_B.z};
  for (std::size_t i = 0; i < masses; ++i) {
    robot.mass_position[i] = state.position[i];
    robot.mass_velocity[i] = state.velocity[i];
    robot.mass_acceleration[i] = state.acceleration[i];
  }
  return robot;
}

// The friction that the governor would have to use at a moment between two nodes, at this part of its speeds: f_s / N
// with what the motors may swing. f_s goes with the square of the speeds, the swing by its resonances. `share`: 0 at
// the first node, 1 at the second.
double need_with_motors(const firmware::ControllerParams& params, const firmware::GovernorParams& governor,
                        const plan::Node& node, const plan::Node& next, double share, double part) {
  const int n = params.ball.mass_count;
  firmware::RobotState robot = robot_of(node.state, static_cast<std::size_t>(n));
  robot.angular_velocity_B_radps *= part;
  firmware::PerMass<firmware::Real> u{};
  const auto between = [&](const plan::PerMass<double>& from, const plan::PerMass<double>& to, std::size_t i) {
    return (1 - share) * from[i] + share * to[i];
  };
  for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
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

// A motion like the one that is searched for.
struct Neighbour {
  std::vector<std::vector<sim::MotionPiece>> motion;  // of each mass
  double duration_s = 0;
};

std::shared_ptr<const Neighbour> neighbour_of(const GoPlan& plan) {
  Neighbour out{{}, plan.moved.duration_s};
  for (const sim::Mass& mass : plan.moved.masses) out.motion.push_back(mass.motion);
  return std::make_shared<const Neighbour>(std::move(out));
}

// The governor's own rollout of the whole motion, with the swing of its motors, keeps the cone without a bend.
bool fits_governor(const firmware::ControllerParams& params, const std::vector<plan::Node>& nodes, double duration_s) {
  firmware::GovernorParams governor = firmware::governor_params(params);
  governor.friction *= kUsed;
  governor.jumps = false;
  const auto n = static_cast<std::size_t>(params.ball.mass_count);
  const double step_s = duration_s / static_cast<double>(nodes.size() - 1);
  const auto wish = [&](double time_s, const firmware::RobotState&) {
    const double at = std::clamp(time_s / step_s, 0.0, static_cast<double>(nodes.size() - 1));
    const std::size_t k = std::min(static_cast<std::size_t>(at), nodes.size() - 2);
    const double share = at - static_cast<double>(k);
    firmware::Wish out;
    for (std::size_t i = 0; i < n; ++i) {
      out.u[i] = (1 - share) * nodes[k].state.acceleration[i] + share * nodes[k + 1].state.acceleration[i];
    }
    out.own = out.u;
    return out;
  };
  firmware::RobotState robot = robot_of(nodes.front().state, n);
  robot.swing_acceleration = robot.mass_acceleration;
  const auto end = static_cast<std::int64_t>(duration_s / params.control_period_s) + 1;
  firmware::Bends none;
  none.clear(0, {});
  firmware::Rollout rollout;
  rollout.begin(governor, robot, 0, {end, end, end});
  rollout.refuse_bends(std::numeric_limits<firmware::Wide>::infinity());
  while (rollout.end() == firmware::RolloutEnd::kUnderWay) rollout.advance(params.ball, governor, wish, none, 1000);
  return rollout.end() != firmware::RolloutEnd::kBroken;
}

// Searches for a plan that fits the governor. `neighbour`: where it begins, alone; null: a few starts by the seed.
void search(const firmware::ControllerParams& params, const Neighbour* neighbour, std::uint64_t seed,
            const std::function<bool()>& stop, Try& one) {
  constexpr int kStarts = 2;
  plan::SearchOptions options;
  options.seed = seed;
  options.quick = true;
  options.most_starts = neighbour == nullptr ? kStarts : 1;
  options.equality_tolerance = kTolerance;
  options.fits = [&](const plan::Plan& plan) {
    return fits_governor(params, plan.run.nodes, one.file.task.duration_s);
  };
  options.stop = stop;
  if (neighbour != nullptr) options.from = neighbour->motion;
  one.outcome = plan::search(one.problem, one.file.scenario, options);
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
std::optional<GoPlan> finished(const firmware::ControllerParams& params, Motion found, std::string& why) {
  GoPlan plan;
  plan.moved = std::move(found.moved);
  for (sim::Mass& mass : plan.moved.masses) stop_exactly(mass);
  plan.need = found.need;
  plan.most_need = std::max(plan.need, most_need(params, found.nodes, 1));
  plan.goal_error_m = found.goal_error_m;
  plan.end_m = found.end_m;
  plan.on_the_way = found.on_the_way;
  if (const auto refused = plan::set_reference(plan.moved, found.ball, plan.reference)) {
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

constexpr int kThreads = 2;
constexpr int kMostTries = 6;
constexpr int kMostHalvings = 2;  // of legs of one way, for which nothing is found

// One motion to search for, between two rests or from where the robot is.
struct Leg {
  sim::Scenario from;
  plan::ReferencePoint begin;
  GoTask task;
  double likely_s = 0;
  bool slows = false;                     // what is too fast for the governor is tried slower
  std::shared_ptr<const Neighbour> late;  // the first try begins with it; null: none
};

// Searches for the whole way, again and again with other parameters.
struct Race {
  double leg_m = 0;   // 0: without a rest on the way
  double longer = 1;  // than a likely duration
  int tries = kMostTries;
  std::uint64_t seed = 0;
};

// Shared by the threads that search for one motion.
struct Tries {
  std::mutex mutex;
  int begun = 0, most = kMostTries;
  std::optional<Motion> found;
  std::string why;  // the first was in vain
  bool infeasible = false;
  // The newest plan that is too fast for the governor, in the time in which it would fit.
  std::shared_ptr<const Neighbour> slower;
  double fast_s = 0;       // duration of that plan
  bool stretches = false;  // that one has not been tried slower
};

struct Planner {
  const sim::Scenario& scenario;
  const firmware::ControllerParams& params;
  const plan::ReferencePoint& at;
  const std::function<bool()>& stop;
  const std::function<void(const std::string&)>& say;

  // Places on the way that are at most leg_m apart; the last is the task's.
  [[nodiscard]] std::deque<Eigen::Vector2d> stops(const GoTask& task, double leg_m) const;
  // How far legs of race k go.
  [[nodiscard]] double leg_m(const GoTask& task, int k) const;
  [[nodiscard]] Leg leg_of(const plan::ReferencePoint& begin, const GoTask& task) const;
  // Searches in `threads` threads, each with a try after the other, until one has found the motion. `seed`: of the
  // first, counted on.
  void search_leg(const Leg& leg, int threads, std::uint64_t seed, const std::function<bool()>& ended,
                  Tries& tries) const;
  void keep_trying(const Leg& leg, std::uint64_t seed, const std::function<bool()>& ended, Tries& tries) const;
  // With a rest at each of its stops, or up to the first of them. None: some leg was not found, `failed`.
  [[nodiscard]] std::optional<Motion> by_legs(const GoTask& task, const Race& race, int threads,
                                              const std::function<bool()>& ended, Tries& failed) const;
  // The whole way at once, or by legs, or both: the first that finds something ends the other.
  [[nodiscard]] std::optional<Motion> find(const Leg& whole, const Race& race, Tries& tries) const;
  // In a duration that is given, or in one of at least `least_s` that is chosen.
  [[nodiscard]] GoOutcome plan(const GoTask& task, double least_s = 0) const;
  // A nearer place and a longer duration for which there are plans, in words. Empty: none was found.
  [[nodiscard]] std::string offers(const GoTask& task, std::optional<double> likely_s) const;
};

std::deque<Eigen::Vector2d> Planner::stops(const GoTask& task, double leg_m) const {
  std::deque<Eigen::Vector2d> ends(task.via_m.begin(), task.via_m.end()), out;
  ends.push_back(task.to_m);
  Eigen::Vector2d begin_m(at.place_m[0], at.place_m[1]);
  for (const Eigen::Vector2d& end_m : ends) {
    const double legs = std::ceil((end_m - begin_m).norm() / leg_m);
    for (double k = 1; k < legs; ++k) out.push_back(begin_m + k / legs * (end_m - begin_m));
    out.push_back(end_m);
    begin_m = end_m;
  }
  return out;
}

double Planner::leg_m(const GoTask& task, int k) const {
  const double least_m = way_m({at.place_m[0], at.place_m[1]}, task) / kMostLegs;
  return std::max(2 * kLeg * scenario.ball.radius_m / (2 + k), least_m);
}

Leg Planner::leg_of(const plan::ReferencePoint& begin, const GoTask& task) const {
  Leg leg{set_down(scenario, begin), begin, task, 0, false, nullptr};
  leg.likely_s =
      task.duration_s ? *task.duration_s : likely_duration_s(problem_of(task_file(leg.from, task, 1), begin), task);
  return leg;
}

// A plan that is too fast for the governor, as slow as it would have to be.
std::shared_ptr<const Neighbour> slowed(const firmware::ControllerParams& params, const Try& one) {
  constexpr double kHardlyFits = 0.9;  // part of the speeds, of a plan whose speeds alone would fit
  const plan::Plan& fast = *one.outcome.unfit;
  const double part = std::min(fitting_speed(params, fast.run.nodes), kHardlyFits);
  const double duration_s = one.file.task.duration_s / part;
  return std::make_shared<const Neighbour>(
      Neighbour{plan::stretched_motion(one.file.scenario, fast.grid, fast.knots, duration_s), duration_s});
}

void Planner::keep_trying(const Leg& leg, std::uint64_t seed, const std::function<bool()>& ended, Tries& tries) const {
  const bool given = leg.task.duration_s.has_value();
  for (;;) {
    std::shared_ptr<const Neighbour> neighbour;
    double duration_s = leg.likely_s;
    std::uint64_t own_seed = seed;
    {
      const std::lock_guard lock(tries.mutex);
      if (tries.found || tries.infeasible || tries.begun >= tries.most || ended()) return;
      if (tries.stretches && leg.slows) {
        neighbour = tries.slower;
        tries.stretches = false;
      } else if (tries.begun == 0 && leg.late) {
        neighbour = leg.late;
      } else if (!given && tries.begun % (2 * kThreads) >= kThreads) {
        duration_s *= kLonger;  // a slow motion stays in the motors' resonances
      }
      own_seed += static_cast<std::uint64_t>(tries.begun++);
    }
    if (neighbour) duration_s = neighbour->duration_s;
    Try one = make_try(leg.from, leg.begin, leg.task, duration_s);
    search(params, neighbour.get(), own_seed, ended, one);
    const bool is_unfit = !one.outcome.plan && one.outcome.unfit;
    const std::string why = in_words_of_go(one.outcome.binding);
    const bool infeasible = one.outcome.status == plan::Status::kInfeasible;
    std::optional<Motion> found;
    std::shared_ptr<const Neighbour> slower;
    if (one.outcome.plan) found = motion_of(one);
    if (is_unfit) slower = slowed(params, one);
    const std::lock_guard lock(tries.mutex);
    tries.infeasible |= infeasible;
    if (found && !tries.found) tries.found = std::move(found);
    if (slower) {
      tries.slower = slower;
      tries.fast_s = duration_s;
    }
    tries.stretches |= is_unfit && slower->duration_s <= longest_course_s(scenario);
    if (tries.why.empty()) tries.why = why;
  }
}

void Planner::search_leg(const Leg& leg, int threads, std::uint64_t seed, const std::function<bool()>& ended,
                         Tries& tries) const {
  std::atomic<bool> found = false;
  const auto over = [&] { return found || ended(); };
  const auto work = [&] {
    keep_trying(leg, seed, over, tries);
    const std::lock_guard lock(tries.mutex);
    if (tries.found) found = true;
  };
  std::vector<std::future<void>> others;
  for (int k = 1; k < threads; ++k) others.push_back(std::async(std::launch::async, work));
  work();
  for (std::future<void>& other : others) other.get();
}

std::optional<Motion> Planner::by_legs(const GoTask& task, const Race& race, int threads,
                                       const std::function<bool()>& ended, Tries& failed) const {
  std::optional<Motion> way;
  std::deque<Eigen::Vector2d> ahead = stops(task, race.leg_m);
  Eigen::Vector2d last_m(at.place_m[0], at.place_m[1]);
  // A plan that came too late is of use up to its own rest, where that still lies ahead.
  const bool late = task.late && task.late->on_the_way && race.seed == 0 &&
                    (task.late->end_m - task.to_m).norm() < (last_m - task.to_m).norm();
  if (late) ahead.push_front(task.late->end_m);
  for (int halvings = 0; !ahead.empty();) {
    const Eigen::Vector2d stop_m = ahead.front();
    GoTask to_stop;
    to_stop.to_m = stop_m;
    to_stop.objective = task.objective;
    Leg leg = leg_of(way ? end_of(*way) : at, to_stop);
    leg.likely_s *= race.longer;
    if (late && stop_m == task.late->end_m) leg.late = neighbour_of(*task.late);
    Tries tries;
    tries.most = race.tries;
    search_leg(leg, threads, race.seed, ended, tries);
    if (!tries.found && !ended() && halvings < kMostHalvings && (stop_m - last_m).norm() > scenario.ball.radius_m) {
      ++halvings;
      ahead.push_front((last_m + stop_m) / 2);
      continue;
    }
    if (!tries.found) {
      const bool asked =
          stop_m == task.to_m || std::find(task.via_m.begin(), task.via_m.end(), stop_m) != task.via_m.end();
      failed.why = fmt::format("on its way, to {}{}: {}", asked ? "" : "a rest at ", place_text(stop_m), tries.why);
      return std::nullopt;
    }
    if (way) {
      append(*tries.found, *way);
      if (way->moved.masses.front().motion.size() > std::size_t{firmware::kMaxPieces}) {
        failed.why = fmt::format("its legs have more than the {} pieces of a motion", firmware::kMaxPieces);
        return std::nullopt;
      }
    } else {
      way = std::move(tries.found);
    }
    last_m = stop_m;
    ahead.pop_front();
    if (task.sets_out && !ahead.empty()) {
      way->on_the_way = true;
      break;
    }
  }
  return way;
}

std::optional<Motion> Planner::find(const Leg& whole, const Race& race, Tries& tries) const {
  if (!(race.leg_m > 0)) {
    search_leg(whole, kThreads, race.seed, stop, tries);
    return tries.found;
  }
  // A straight way is hardly ever found at once where it is worth a rest.
  if (whole.task.via_m.empty() && whole.task.objective != plan::Objective::kTime)
    return by_legs(whole.task, race, kThreads, stop, tries);
  std::atomic<bool> done = false;
  const auto ended = [&] { return done || stop(); };
  auto at_once = std::async(std::launch::async, [&] {
    search_leg(whole, 1, race.seed, ended, tries);
    if (tries.found) done = true;
  });
  Tries legs;
  std::optional<Motion> way = by_legs(whole.task, race, 1, ended, legs);
  if (way) done = true;
  at_once.get();
  return tries.found ? std::move(tries.found) : way;
}

GoOutcome Planner::plan(const GoTask& task, double least_s) const {
  constexpr int kRaces = 12;
  constexpr int kOneMotion = 2;  // races for the shortest time, which legs miss
  const bool given = task.duration_s.has_value();
  Leg whole = leg_of(at, task);
  whole.likely_s = std::max(whole.likely_s, least_s);
  whole.slows = !given;
  Race race;
  GoOutcome out;
  for (int k = 0; k < kRaces && !stop(); ++k) {
    whole.late = k == 0 && task.late && !task.late->on_the_way ? neighbour_of(*task.late) : nullptr;
    const bool legs_serve = !given && least_s == 0 && (task.objective != plan::Objective::kTime || k >= kOneMotion);
    race.tries = legs_serve && k == 0 && stops(task, leg_m(task, 1)).size() > 1 ? kThreads : kMostTries;
    race.leg_m = legs_serve && stops(task, leg_m(task, k)).size() > 1 ? leg_m(task, k) : 0;
    Tries tries;
    tries.most = race.tries;
    if (auto way = find(whole, race, tries)) {
      out.plan = finished(params, std::move(*way), out.why);
      return out;
    }
    out.why = tries.why;
    if (tries.infeasible) return out;
    if (tries.slower) {
      out.why =
          fmt::format("in {:.3g} s its motors would swing so much that the governor bends it, which may use f_s/N = {}",
                      tries.fast_s, program::short_number(firmware::governor_params(params).friction));
      if (given) out.likely_s = tries.slower->duration_s;
    }
    if (given || stop()) return out;
    say(fmt::format("no {} is found yet: {}{}", race.leg_m > 0 ? "way with rests" : "motion", first_clause(out.why),
                    kSearchesOn));
    constexpr std::uint64_t kSeeds = 100;  // more than a race has
    race.seed += kSeeds;
    if (k % 2 == 0) continue;
    whole.likely_s *= kLonger;
    race.longer *= kLonger;
    if (whole.likely_s > longest_course_s(scenario)) return out;
  }
  return out;
}

std::string Planner::offers(const GoTask& task, std::optional<double> likely_s) const {
  std::string text;
  const Eigen::Vector2d start_m(at.place_m[0], at.place_m[1]);
  for (const double part : {0.8, 0.5, 0.25, 0.1}) {
    if (stop() || !task.via_m.empty()) break;
    GoTask nearer = task;
    nearer.late.reset();
    nearer.to_m = start_m + part * (task.to_m - start_m);
    constexpr double kNoWay = 0.1;  // radii: it would be the same place
    if ((nearer.to_m - task.to_m).norm() < kNoWay * scenario.ball.radius_m) continue;
    if (!plan(nearer).plan) continue;
    text +=
        fmt::format("; it could go to {} in {} s", place_text(nearer.to_m), program::short_number(*task.duration_s));
    break;
  }
  constexpr double kLeastLonger = 1.1;
  GoTask longer = task;
  longer.duration_s.reset();
  longer.late.reset();
  if (const std::string why = beyond_one_course(scenario, at, longer); !why.empty()) return text + "; " + why;
  if (const GoOutcome out = plan(longer, kLeastLonger * *task.duration_s); out.plan) {
    text += fmt::format("; it could be there in {} s", program::short_number(out.plan->moved.duration_s));
  } else if (likely_s) {
    text += fmt::format("; it could perhaps be there in {} s", program::short_number(*likely_s));
  }
  return text;
}

}  // namespace

double way_m(const Eigen::Vector2d& start_m, const GoTask& task) {
  double way_m = 0;
  Eigen::Vector2d from = start_m;
  for (const Eigen::Vector2d& place : task.via_m) {
    way_m += (place - from).norm();
    from = place;
  }
  return way_m + (task.to_m - from).norm();
}

std::string place_text(const Eigen::Vector2d& place_m) {
  constexpr double kNegligible_m = 1e-6;
  return fmt::format("({}, {}) m", program::short_number(place_m[0], kNegligible_m),
                     program::short_number(place_m[1], kNegligible_m));
}

std::string beyond_one_course(const sim::Scenario& scenario, const plan::ReferencePoint& at, const GoTask& task) {
  const double radius_m = scenario.ball.radius_m;
  if (task.duration_s) {
    const double longest_s = longest_course_s(scenario);
    if (*task.duration_s <= longest_s) return "";
    return fmt::format("it would take {} s, and one course takes at most {:.0f} s",
                       program::short_number(*task.duration_s), std::floor(longest_s));
  }
  const Eigen::Vector2d start_m(at.place_m[0], at.place_m[1]);
  const double length_m = way_m(start_m, task), reach_m = kMostLegs * kLongestLeg * radius_m;
  if (length_m <= reach_m) return "";
  std::string text = fmt::format(
      "the way is {} m long, and one course reaches at most {} m: {} legs of {:g} radii "
      "(with --time it is tried without rests)",
      program::short_number(length_m), program::short_number(reach_m), kMostLegs, kLongestLeg);
  if (!task.via_m.empty()) return text;
  constexpr double kPart = 0.9;
  return text + "; it could go to " + place_text(start_m + kPart * reach_m / length_m * (task.to_m - start_m)) +
         " first";
}

GoOutcome plan_course(const sim::Scenario& scenario, const firmware::ControllerParams& params,
                      const plan::ReferencePoint& at, const GoTask& task, const std::function<bool()>& stop,
                      const std::function<void(const std::string&)>& say) {
  GoOutcome out;
  out.why = beyond_one_course(scenario, at, task);
  if (!out.why.empty()) return out;
  const Planner planner{scenario, params, at, stop, say};
  out = planner.plan(task);
  if (out.plan || !task.duration_s || stop()) return out;
  say(fmt::format("not in {} s: {}{}", program::short_number(*task.duration_s), first_clause(out.why), kLooksForMore));
  const std::function<void(const std::string&)> quiet = [](const std::string&) {};
  out.why += Planner{scenario, params, at, stop, quiet}.offers(task, out.likely_s);
  return out;
}

}  // namespace ballast::go
