#include "tools/plan/search.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "tools/plan/bounds.h"
#include "tools/plan/words.h"

namespace ballast::plan {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kPieces = 32;
constexpr double kQuickPiece = 3.1;                // sqrt(r / g): longer pieces cannot catch the swing of the masses
constexpr int kMostStarts = 24, kQuickStarts = 4;  // until a plan is found
constexpr int kMoreStarts = 2, kCheapIterations = 150;  // after that, for a better one
constexpr double kBrake = 4;                            // sqrt(r / g): time constant of the masses of a first start
constexpr double kFirstCreep = 0.3;                     // sqrt(g / r): as fast as a ball that is driven
constexpr double kQuickNeed = 0.5;                      // of the friction limit: a quick search looks for no less
constexpr int kCalmerIterations = 12;                   // from a plan that does not fit
constexpr int kQuickIterations = 8;                     // from a neighbour's plan, on the coarse grid
// Tolerances on the equalities, as the plant rolls them: half a millimetre, and a tenth of the speed, over sqrt(g r),
// that counts as rest.
constexpr double kPlaceTolerance_m = 5e-4, kRestTolerance = 3e-4;

// Most of these limits keep more room than that (transcription.cpp, sqp.cpp); places are judged as they are.
double limit_tolerance(LimitKind kind) {
  switch (kind) {
    case LimitKind::kSpeed:
      return 1e-3;
    case LimitKind::kTorque:
      return 5e-4;
    case LimitKind::kKeepOut:
    case LimitKind::kFollow:
    case LimitKind::kAcceleration:
    case LimitKind::kJerk:
      return 0;
    default:
      return 1e-4;
  }
}

std::size_t index(int i) { return static_cast<std::size_t>(i); }

// The acceleration at time_s of a motion of linear pieces.
double acceleration_at(const std::vector<sim::MotionPiece>& motion, double time_s) {
  double start_s = 0;
  for (const sim::MotionPiece& piece : motion) {
    if (time_s <= start_s + piece.duration_s) {
      const double part = (time_s - start_s) / piece.duration_s;
      return (1 - part) * piece.acceleration_start + part * piece.acceleration_end;
    }
    start_s += piece.duration_s;
  }
  return 0;
}

// The greatest speed of a mass over its limit, between nodes too.
double greatest_speed(const Problem& problem, const Grid& grid, const std::vector<double>& knots) {
  const std::size_t n = index(problem.masses());
  double greatest = 0;
  for (std::size_t i = 0; i < n; ++i) {
    double speed = problem.start.velocity[i];
    for (std::size_t v = i; v + n < knots.size(); v += n) {
      const double from = knots[v], to = knots[v + n];
      // Within a piece the speed is extreme where the acceleration passes 0.
      const double turn_s = from * to < 0 ? grid.piece_s() * from / (from - to) : 0;
      const double at_turn = speed + from * turn_s / 2;
      speed += (from + to) / 2 * grid.piece_s();
      greatest =
          std::max({greatest, std::abs(at_turn) / problem.limits[i].speed, std::abs(speed) / problem.limits[i].speed});
    }
  }
  return greatest;
}

// How far a mass gets beyond an end of its rail, between nodes too, in parts of the rail. Negative: it stays inside.
double beyond_rail_ends(const Problem& problem, const Grid& grid, const std::vector<double>& knots) {
  const std::size_t n = index(problem.masses());
  const double piece_s = grid.piece_s();
  double most = -kInfinity;
  for (std::size_t i = 0; i < n; ++i) {
    const MassLimits& limits = problem.limits[i];
    const double length = limits.upper - limits.lower;
    if (!std::isfinite(length)) continue;
    double place = problem.start.position[i], speed = problem.start.velocity[i];
    for (std::size_t v = i; v + n < knots.size(); v += n) {
      const double from = knots[v], jerk = (knots[v + n] - from) / piece_s;
      const auto note = [&](double time_s) {
        if (!(time_s >= 0 && time_s <= piece_s)) return;
        const double at = place + time_s * (speed + time_s * (from / 2 + time_s * jerk / 6));
        most = std::max({most, (at - limits.upper) / length, (limits.lower - at) / length});
      };
      note(0);
      note(piece_s);
      // The mass turns where its speed, speed + from t + jerk t^2 / 2, passes 0. The form without cancellation.
      const double root = from * from - 2 * jerk * speed;
      if (root >= 0) {
        const double sum = -(from + std::copysign(std::sqrt(root), from));
        if (jerk != 0) note(sum / jerk);
        if (sum != 0) note(2 * speed / sum);
      }
      place += piece_s * (speed + piece_s * (from / 2 + piece_s * jerk / 6));
      speed += piece_s * (from + piece_s * jerk / 2);
    }
  }
  return most;
}

// A try that failed, for the words that say why.
struct Failure {
  double error = kInfinity;
  Merit merit;
  Eigen::Vector2d reached_m = Eigen::Vector2d::Zero();
  bool friction_only = false;  // all else holds
  std::string at_limits;       // what the motion uses up
};

// The aim of a try, once all limits hold.
struct Aim {
  Objective objective;
  double resonance_weight = 0;
};

class Search {
 public:
  Search(const Problem& problem, const sim::Scenario& scenario, const SearchOptions& options)
      : problem_(problem), scenario_(scenario), options_(options), aim_{problem.task.objective} {
    effort_.stop = [this] { return effort_.iterations >= options_.most_iterations || ended(); };
    effort_.ended = options.stop;
    if (options.progress) {
      effort_.progress = [this](double need, double error) {
        options_.progress(effort_.iterations, best_ ? need_of(*best_) : kInfinity, need, error);
      };
    }
  }

  Outcome run() {
    Outcome out;
    if (std::string why = impossible(); !why.empty()) {
      out.status = Status::kInfeasible;
      out.binding = why;
      return out;
    }
    find(problem_.task.duration_s);
    if (best_ && problem_.task.objective == Objective::kTime) shorten();
    if (best_ && problem_.task.avoid_resonance && driven()) avoid_resonance();
    out.iterations = effort_.iterations;
    if (best_) {
      out.status = Status::kFound;
      out.plan = best_;
      out.binding = binding_;
    } else {
      out.unfit = unfit_;
      out.binding = failure_words();
      // No other floor is looked for where it changes with place: which part of it would have to hold more?
      out.friction_alone =
          !problem_.floor.has_patches() && failure_.friction_only && failure_.merit.need > problem_.friction_limit;
    }
    return out;
  }

 private:
  static double need_of(const Plan& plan) { return plan.run.need; }

  // The friction that carries the whole robot over the distance in the time, at constant acceleration: 4 d / (g T^2)
  // from rest to rest. No plan needs much less. On a slope g is the weight's part along the normal, and friction holds
  // the weight's part in the floor too, on average over a motion to rest.
  [[nodiscard]] double least_need(double duration_s) const {
    const firmware::BallParams& ball = problem_.robot.ball;
    const Eigen::Vector2d way = problem_.task.goal_m - problem_.start_m;
    const double of_rest = problem_.task.at_rest ? 4 : 2;
    const double gravity = -ball.gravity_mps2 * ball.down_W[2];
    const double need = of_rest * way.norm() / (gravity * duration_s * duration_s);
    if (!slopes(ball)) return need;
    const Eigen::Vector2d downhill = ball.gravity_mps2 / gravity * ball.down_W.head<2>();
    if (problem_.task.at_rest) return std::hypot(need, downhill.norm());
    return (2 / (gravity * duration_s * duration_s) * way - downhill).norm();
  }

  // Neither ball nor masses move, but for a turn of the ball about the vertical that it may keep.
  [[nodiscard]] bool starts_at_rest() const {
    const Vec& w = problem_.start.omega_B;
    const Vec up = to_body(problem_.start.q, {0, 0, 1});
    const double spin = dot(w, up);
    const Vec rolling = w - spin * up;
    constexpr double kRounding = 1e-12;  // of a rotation
    bool at_rest = std::abs(spin) <= problem_.task.rest_spin_radps &&
                   std::sqrt(dot(rolling, rolling)) <= kRounding * std::abs(spin);
    for (int i = 0; i < problem_.masses(); ++i) at_rest = at_rest && problem_.start.velocity[index(i)] == 0;
    return at_rest;
  }

  // Why no motion can do it; empty if that is not certain.
  [[nodiscard]] std::string impossible() const {
    const double distance_m = (problem_.task.goal_m - problem_.start_m).norm();
    if (problem_.task.at_rest) {
      if (std::string why = no_rest(problem_); !why.empty()) return why;
    }
    if (!starts_at_rest()) return "";
    const std::string stuck = distance_m > 0.1 * problem_.robot.ball.radius_m ? immobile(problem_) : "";
    if (!stuck.empty()) return stuck;
    if (std::string why = mass_too_far(problem_); !why.empty()) return why;
    if (std::string why = beyond_motors(distance_m); !why.empty()) return why;
    if (!std::isfinite(problem_.friction_limit) || std::isinf(scenario_.surface.static_friction)) return "";
    for (std::size_t v = 0; v < problem_.task.via.size(); ++v) {
      const Via& via = problem_.task.via[v];
      if (!via.time_s) continue;
      const std::string why = too_far(fmt::format("task.via.{}, ", v), via.position_m, *via.time_s, false);
      if (!why.empty()) return why;
    }
    return too_far("", problem_.task.goal_m, problem_.task.duration_s, problem_.task.at_rest);
  }

  [[nodiscard]] std::string too_far(const std::string& what, const Eigen::Vector2d& place_m, double duration_s,
                                    bool to_rest) const {
    const double distance_m = (place_m - problem_.start_m).norm(), limit = problem_.friction_limit;
    const Reach far = reach_of_friction(problem_, duration_s, to_rest);
    if (distance_m <= far.at(limit)) return "";
    return fmt::format(
        "friction stands in the way: {}{:.4g} m in {:.4g} s, needs f_s/N of at least {:.3g}, and friction_use mu_s is "
        "{:.3g}; in that time the ball gets at most {:.3g} m far, and this far takes at least {:.3g} s",
        what, distance_m, duration_s, far.need(distance_m), limit, std::max(0.0, far.at(limit)),
        far.least_duration_s(distance_m, limit));
  }

  [[nodiscard]] std::string beyond_motors(double distance_m) const {
    const double duration_s = problem_.task.duration_s;
    const auto reach = reach_of_motors(problem_, duration_s, problem_.task.at_rest);
    if (!reach || distance_m <= reach->distance_m) return "";
    return fmt::format(
        "{} stands in the way: {:.4g} m in {:.4g} s; with the power of its motors the ball gets at most {:.3g} m far "
        "in "
        "that time, and this far takes at least {:.3g} s",
        limit_words(reach->limit), distance_m, duration_s, reach->distance_m,
        least_duration_of_motors_s(problem_, distance_m, problem_.task.at_rest));
  }

  [[nodiscard]] bool warm() const { return !options_.from.empty(); }
  [[nodiscard]] bool takes_first() const { return options_.quick && !warm(); }
  [[nodiscard]] int pieces(double duration_s) const {
    if (!takes_first()) return kPieces;
    const double pieces = std::ceil(duration_s / (kQuickPiece * time_unit_s(problem_)));
    return static_cast<int>(std::clamp(pieces, double{kLeastQuickPieces}, 2.0 * kPieces));
  }

  // By the caller, or with its iterations used up.
  [[nodiscard]] bool stopped() const { return effort_.stop(); }
  [[nodiscard]] bool ended() const { return options_.stop && options_.stop(); }

  // Best of several starts.
  void find(double duration_s) {
    int more = kMoreStarts;
    const int usual = takes_first() ? kQuickStarts : kMostStarts;
    for (int k = 0; k < (options_.most_starts > 0 ? options_.most_starts : usual) && !stopped(); ++k) {
      if (best_) {
        const bool good = need_of(*best_) < 1.3 * least_need(duration_s);
        const bool enough = problem_.task.objective != Objective::kFriction || warm() || options_.quick;
        if (good || enough || more-- <= 0 || effort_.iterations > kCheapIterations) return;
      }
      try_start(duration_s, k);
    }
  }

  // Start 0 brakes the masses, or leaves them as they move in the given motion. The others are smooth random
  // accelerations of low frequency.
  [[nodiscard]] std::vector<double> initial_knots(const Grid& grid, int start) const {
    std::vector<double> knots = wished_knots(grid, start);
    set_first_knots(knots);
    return knots;
  }

  // A motor must not jump at the start.
  void set_first_knots(std::vector<double>& knots) const {
    for (int i = 0; i < problem_.masses(); ++i) {
      if (problem_.limits[index(i)].motor) knots[index(i)] = problem_.start.acceleration[index(i)];
    }
  }

  [[nodiscard]] std::vector<double> wished_knots(const Grid& grid, int start) const {
    const int n = problem_.masses();
    std::vector<double> knots(index(grid.knots() * n), 0);
    if (start == 0) {
      for (std::size_t v = 0; v < knots.size() && !options_.from.empty(); ++v) {
        const std::size_t knot = v / index(n);
        const double time_s = static_cast<double>(knot) * grid.piece_s();
        knots[v] = acceleration_at(options_.from[v % index(n)], time_s);
      }
      if (options_.from.empty()) brake(grid, knots);
      return knots;
    }
    std::mt19937_64 random(options_.seed * 1000003 + static_cast<std::uint64_t>(start));
    // Uniform in [-1, 1), the same on every platform.
    const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-52 - 1; };
    for (int i = 0; i < n; ++i) {
      for (int wave = 1; wave <= 3; ++wave) {
        const double rate = wave * std::numbers::pi / grid.duration_s;
        const double travel = 0.5 * problem_.robot.ball.radius_m / problem_.metres_per_unit[i] * uniform();
        for (int j = 0; j < grid.knots(); ++j) {
          knots[index(j * n + i)] += travel * rate * rate * std::sin(rate * j * grid.piece_s());
        }
      }
    }
    return knots;
  }

  // Masses that move come to rest.
  void brake(const Grid& grid, std::vector<double>& knots) const {
    const double time_constant_s = std::max(kBrake * time_unit_s(problem_), grid.piece_s());
    const std::size_t n = index(problem_.masses());
    for (int j = 0; j < grid.knots(); ++j) {
      const double part = std::exp(-j * grid.piece_s() / time_constant_s) / time_constant_s;
      for (std::size_t i = 0; i < n; ++i) knots[index(j) * n + i] = -part * problem_.start.velocity[i];
    }
  }

  // The end of a motion has acceleration 0, so that f_s / N does not jump there; set_first_knots() has the start.
  [[nodiscard]] std::vector<bool> fixed_knots(const Grid& grid) const {
    const int n = problem_.masses();
    std::vector<bool> fixed(index(grid.knots() * n), false);
    for (int i = 0; i < n; ++i) {
      fixed[index(i)] = problem_.limits[index(i)].motor.has_value();
      fixed[index((grid.knots() - 1) * n + i)] = true;
    }
    return fixed;
  }

  [[nodiscard]] SqpSettings settings() const {
    SqpSettings settings;
    settings.friction_limit = problem_.friction_limit;
    if (takes_first() && aim_.objective == Objective::kFriction) {
      settings.objective = Objective::kEffort;
      settings.good_enough = kQuickNeed * problem_.friction_limit;
    }
    settings.gives_up = options_.quick;
    if (aim_.objective == Objective::kTime) settings.good_enough = 0.97 * problem_.friction_limit;
    if (aim_.objective == Objective::kEffort) settings.good_enough = 0.9 * problem_.friction_limit;
    return settings;
  }

  // Quickly from a neighbour's plan: a few iterations on the coarse grid, which cost half as much, bring all but a few
  // percent. The polish against the plant then only has to meet what does not hold there. Equalities nearly met are
  // enough to end, since improve() meets them afterwards.
  [[nodiscard]] SqpSettings quick_settings(int most_iterations) const {
    SqpSettings quick = settings();
    quick.most_iterations = most_iterations;
    quick.short_steps = true;
    quick.most_equality = 1e-3;
    return quick;
  }

  // The task on the way to the whole one: goal and via places at the part `part` of their distance from the start,
  // obstacles as small, a path to follow as wide.
  [[nodiscard]] Problem partial(double part) const {
    Problem staged = problem_;
    const auto nearer = [&](const Eigen::Vector2d& place) {
      return Eigen::Vector2d(problem_.start_m + part * (place - problem_.start_m));
    };
    staged.task.goal_m = nearer(staged.task.goal_m);
    for (Via& via : staged.task.via) via.position_m = nearer(via.position_m);
    for (KeepOut& circle : staged.task.keep_out) {
      circle.radius_m = part * (circle.radius_m + problem_.robot.ball.radius_m) - problem_.robot.ball.radius_m;
    }
    if (staged.task.follow) staged.task.follow->tolerance_m /= part;
    return fading_at(kFirstCreep, staged);
  }

  // On a floor that resists: with a moment that fades at the rate `creep`, in sqrt(g / r), or that of the floor if it
  // is higher. A ball that hardly moves is braked so much that its motion says little of what a greater one of the
  // masses would do.
  [[nodiscard]] Problem fading_at(double creep, Problem problem) const {
    double& rate_radps = problem.robot.ball.creep_radps;
    if (resists(problem)) rate_radps = std::max(rate_radps, creep / time_unit_s(problem));
    return problem;
  }

  void try_start(double duration_s, int start) {
    const Grid grid = make_grid(problem_, duration_s, pieces(duration_s));
    std::vector<double> knots = initial_knots(grid, start);
    std::vector<double> via_time_s;
    const std::vector<bool> fixed = fixed_knots(grid);
    for (std::size_t v = 0; v < knots.size(); ++v) {
      if (fixed[v]) knots[v] = 0;
    }
    if (warm() && start == 0) {
      // A copy, since the start as it was given is a better one for the whole search.
      std::vector<double> neighbour = knots, passes_s;
      if (options_.quick) improve_on(problem_, grid, fixed, quick_settings(kQuickIterations), neighbour, passes_s);
      if (refine(grid, fixed, neighbour, passes_s)) return;
    }
    if (start % 2 == 1) {
      for (const double part : {0.25, 0.5, 0.75}) {
        if (ended()) break;
        const Problem staged = partial(part);
        SqpSettings s = settings();
        s.most_iterations = 10;
        s.good_enough = kInfinity;
        improve_on(staged, grid, fixed, s, knots, via_time_s);
      }
    }
    if (resists(problem_)) approach_standstill(grid, fixed, knots, via_time_s);
    approach_path(grid, fixed, knots, via_time_s);
    SqpSettings s = settings();
    s.most_iterations = takes_first() ? 30 : 60;
    const Merit merit = improve_on(problem_, grid, fixed, s, knots, via_time_s);
    if (merit.error() > 1e-2) return fail(grid, knots, merit);
    const bool held = refine(grid, fixed, knots, via_time_s);
    if (held && !best_ && !ended()) {
      // One that needs less friction may fit.
      SqpSettings calmer = quick_settings(kCalmerIterations);
      calmer.objective = Objective::kFriction;
      calmer.good_enough = 0;
      improve_on(problem_, grid, fixed, calmer, knots, via_time_s);
      refine(grid, fixed, knots, via_time_s);
    }
    if (!held && ended() && merit.error() > kRestTolerance) fail(grid, knots, merit);
  }

  // The rate at which the floor's moment fades is lowered step by step to the floor's own.
  void approach_standstill(const Grid& grid, const std::vector<bool>& fixed, std::vector<double>& knots,
                           std::vector<double>& via_time_s) {
    SqpSettings s = settings();
    s.most_iterations = 15;
    s.good_enough = kInfinity;
    for (const double creep : {kFirstCreep, 0.05, 0.01}) {
      if (ended()) break;
      Problem staged = fading_at(creep, problem_);
      staged.task.follow.reset();
      improve_on(staged, grid, fixed, s, knots, via_time_s);
    }
  }

  // A path to follow is tightened step by step: the nearest point of a polyline means little to a motion far from it.
  void approach_path(const Grid& grid, const std::vector<bool>& fixed, std::vector<double>& knots,
                     std::vector<double>& via_time_s) {
    if (!problem_.task.follow) return;
    SqpSettings s = settings();
    s.most_iterations = 15;
    s.good_enough = kInfinity;
    Problem staged = problem_;
    staged.task.follow.reset();
    improve_on(staged, grid, fixed, s, knots, via_time_s);
    for (double tolerance = 0.5 * problem_.robot.ball.radius_m;
         tolerance > problem_.task.follow->tolerance_m && !ended(); tolerance *= 0.7) {
      staged.task.follow = problem_.task.follow;
      staged.task.follow->tolerance_m = tolerance;
      improve_on(staged, grid, fixed, s, knots, via_time_s);
    }
  }

  Merit improve_on(const Problem& problem, const Grid& grid, const std::vector<bool>& fixed, const SqpSettings& s,
                   std::vector<double>& knots, std::vector<double>& via_time_s) {
    Rollout rollout(problem, grid);
    Transcription transcription = transcribe(problem, rollout, via_time_s);
    const Merit merit = improve(rollout, transcription, fixed, s, knots, effort_);
    via_time_s = transcription.via_time_s;
    return merit;
  }

  Transcription transcribe(const Problem& problem, const Rollout& rollout,
                           const std::vector<double>& via_time_s) const {
    Transcription transcription(problem, rollout);
    transcription.friction_unit = std::clamp(least_need(rollout.grid().duration_s), 0.005, 1.0);
    transcription.resonance_weight = aim_.resonance_weight;
    transcription.corrections.room = 2e-3;  // the ball bends by less than that from its chord between two nodes
    if (!via_time_s.empty()) transcription.via_time_s = via_time_s;
    return transcription;
  }

  // The last part: nodes twice as dense, so that little happens between them, and the plant as the judge. True: a plan.
  bool refine(const Grid& coarse, const std::vector<bool>& fixed, std::vector<double> knots,
              const std::vector<double>& via_time_s) {
    const Grid grid{coarse.duration_s, coarse.pieces, 2 * coarse.steps_per_piece};
    Rollout rollout(problem_, grid);
    Transcription transcription = transcribe(problem_, rollout, via_time_s);
    SqpSettings s = settings();
    s.most_iterations = 20;
    s.short_steps = warm();
    if (warm()) s.most_iterations = 8;  // a neighbour's plan: the rest gains a few percent
    if (options_.quick) s = quick_settings(0);
    Merit merit = improve(rollout, transcription, fixed, s, knots, effort_);
    if (aim_.objective == Objective::kEffort) {
      s.objective = Objective::kEffort;
      s.good_enough = 0;
      s.most_iterations = 40;
      merit = improve(rollout, transcription, fixed, s, knots, effort_);
    }
    for (int round = 0; round < 4 && !ended(); ++round) {
      PlantRun run = roll_by_plant(problem_, scenario_, grid, knots, options_.stop);
      Plan plan{grid, knots, std::move(run), transcription.via_time_s, 0};
      if (!plan.run.rolled || plan.run.nodes.size() != index(grid.nodes())) return false;
      Rollout rolled(problem_, grid);
      rolled.adopt(plan.run.nodes);
      Transcription truth = transcribe(problem_, rolled, transcription.via_time_s);
      truth.corrections.room = 0;
      const double over = greatest_speed(problem_, grid, plan.knots) - 1;
      const double beyond = beyond_rail_ends(problem_, grid, plan.knots);
      if (over <= 0 && beyond <= 0 && accept(plan, truth, merit)) return true;
      if (over > 0) transcription.corrections.speed_room += over + 1e-4;
      if (beyond > 0) transcription.corrections.rail_room += beyond + 1e-4;
      transcription.corrections.room += 1.2 * beyond_;
      // The model's errors, which hardly change with the motion, are moved into its equalities.
      transcription.corrections.equality.clear();
      const auto model = transcription.equalities(false), plant = truth.equalities(false);
      std::vector<double> correction;
      for (std::size_t k = 0; k < model.size(); ++k) correction.push_back(plant[k].value - model[k].value);
      transcription.corrections.equality = correction;
      s.most_iterations = 8;
      s.good_enough = options_.quick ? kInfinity : 0;
      merit = improve(rollout, transcription, fixed, s, knots, effort_);
    }
    return false;
  }

  // Keeps the plan if it holds by the plant and is better than the best. True: it holds.
  bool accept(Plan& plan, const Transcription& truth, const Merit& model) {
    const Eigen::Vector2d end(plan.run.nodes.back().place_m[0], plan.run.nodes.back().place_m[1]);
    plan.goal_error_m = (end - problem_.task.goal_m).norm();
    Merit merit = judge(truth, plan.knots, limit_tolerance);
    merit.need = need_of(plan);
    Limit between{};
    beyond_ = truth.beyond_between_nodes(between);
    if (beyond_ > merit.limit) {
      merit.limit = beyond_;
      merit.worst_limit = between;
    }
    const double of_plans = std::min(kPlaceTolerance_m / problem_.robot.ball.radius_m, kRestTolerance);
    const double equality = options_.equality_tolerance.value_or(of_plans);
    if (merit.equality > equality || merit.limit > 0 || merit.need > problem_.friction_limit || plan.run.slips) {
      merit.need = std::max(merit.need, model.need);
      fail(plan.grid, plan.knots, merit);
      return false;
    }
    plan.near_resonance = truth.time_near_resonance();
    if (options_.fits && !options_.fits(plan)) {
      unfit_ = plan;
      return true;
    }
    if (by_steppers_) plan.stepper_need = stepper_need(plan);
    if (!best_ || better(plan, merit)) {
      best_ = plan;
      best_effort_ = merit.effort;
      binding_ = binding_words(truth, plan.knots, problem_.task.objective);
    }
    return true;
  }

  [[nodiscard]] bool better(const Plan& plan, const Merit& merit) const {
    if (by_steppers_) return plan.stepper_need < best_->stepper_need;
    if (by_resonance_) {
      constexpr double kHardly = 1.1;
      const bool dear = problem_.task.objective == Objective::kEffort ? merit.effort > kHardly * best_effort_
                                                                      : need_of(plan) > kHardly * need_of(*best_);
      return !dear && plan.near_resonance < most_resonance_;
    }
    if (problem_.task.objective == Objective::kTime) return plan.grid.duration_s < best_->grid.duration_s;
    if (problem_.task.objective == Objective::kEffort) return merit.effort < best_effort_;
    return need_of(plan) < need_of(*best_);
  }

  // Shorter and shorter durations, each from the best plan, until the next one fails within a percent.
  void shorten() {
    double failed_s = 0;
    for (int k = 0; k < 16 && !stopped(); ++k) {
      const double held_s = best_->grid.duration_s;
      if (held_s < 1.01 * failed_s) return;
      const double ratio = std::clamp(std::sqrt(need_of(*best_) / problem_.friction_limit) * 1.02, 0.6, 0.985);
      const double next_s = failed_s > 0 ? std::sqrt(failed_s * held_s) : ratio * held_s;
      const Grid grid = make_grid(problem_, next_s, best_->grid.pieces);
      std::vector<double> knots = best_->knots, via_time_s = best_->via_time_s;
      for (double& knot : knots) knot *= (held_s / next_s) * (held_s / next_s);
      set_first_knots(knots);
      for (std::size_t v = 0; v < via_time_s.size(); ++v) {
        const auto& given = problem_.task.via[v].time_s;
        via_time_s[v] = given ? *given : via_time_s[v] * next_s / held_s;
      }
      const std::vector<bool> fixed = fixed_knots(grid);
      SqpSettings s = settings();
      s.most_iterations = 50;
      const Merit merit = improve_on(problem_, grid, fixed, s, knots, via_time_s);
      if (merit.error() > 1e-2 || !refine(grid, fixed, knots, via_time_s)) failed_s = next_s;
    }
  }

  [[nodiscard]] bool driven() const {
    bool any = false;
    for (int i = 0; i < problem_.masses(); ++i) any = any || problem_.limits[index(i)].motor.has_value();
    return any;
  }

  void avoid_resonance() {
    if (scenario_.run.actuation != sim::Actuation::kStepper) return leave_resonance();
    if (options_.stepper_need && !warm()) calm_motors();
  }

  // Masses that are prescribed here and have motors elsewhere: no run says what the motors add. A variant that stays
  // away from the resonances for longer is taken if its friction (or effort) is hardly greater.
  void leave_resonance() {
    constexpr double kGain = 0.02;  // of the duration
    if (warm() || best_->near_resonance < kGain) return;
    const Plan first = *best_;
    by_resonance_ = true;
    for (const double weight : {3.0, 30.0}) {
      if (stopped()) return;
      aim_ = {problem_.task.objective, weight};
      most_resonance_ = best_->near_resonance - kGain;
      refine(make_grid(problem_, first.grid.duration_s, first.grid.pieces), fixed_knots(first.grid), first.knots,
             first.via_time_s);
    }
  }

  [[nodiscard]] double stepper_need(const Plan& plan) const {
    sim::Scenario moved = with_motion(scenario_, plan.grid, plan.knots);
    moved.run.actuation = sim::Actuation::kStepper;
    return options_.stepper_need(moved);
  }

  // Motors shake the ball more than a plan itself needs, most of all where they dwell at a resonance. Variants of the
  // best plan trade some of its friction for calmer motors. The run with motors tells which one needs least.
  void calm_motors() {
    constexpr double kCalm = 0.5;  // of the friction limit: little is gained below
    constexpr Aim kAims[] = {{Objective::kEffort, 3},
                             {Objective::kEffort, 30},
                             {Objective::kFriction, 30},
                             {Objective::kEffort, 100},
                             {Objective::kFriction, 3}};
    const Plan first = *best_;
    const Grid grid = make_grid(problem_, first.grid.duration_s, first.grid.pieces);
    best_->stepper_need = stepper_need(first);
    by_steppers_ = true;
    for (const Aim& aim : kAims) {
      if (stopped() || best_->stepper_need <= kCalm * problem_.friction_limit) return;
      aim_ = aim;
      refine(grid, fixed_knots(grid), first.knots, first.via_time_s);
    }
  }

  void fail(const Grid& grid, const std::vector<double>& knots, const Merit& merit) {
    const double over = std::max(0.0, merit.need / problem_.friction_limit - 1);
    const double error = merit.error() + over;
    if (error >= failure_.error) return;
    Rollout rollout(problem_, grid);
    if (!rollout.roll(knots)) return;
    const auto& end = rollout.nodes().back().place_m;
    const Transcription transcription = transcribe(problem_, rollout, {});
    failure_ = {
        error, merit, {end[0], end[1]}, merit.error() <= 1e-3, binding_words(transcription, knots, Objective::kEffort)};
  }

  [[nodiscard]] std::string failure_words() const {
    if (!ended()) return nearest_words();
    const std::string text = "the search was ended before it had found one";
    return std::isfinite(failure_.error) ? text + "; so far " + nearest_words() : text;
  }

  // Names the limit that the nearest motion does not meet.
  [[nodiscard]] std::string nearest_words() const {
    if (!std::isfinite(failure_.error)) return "no motion that was tried kept the ball rolling";
    const double limit = problem_.friction_limit;
    if (failure_.friction_only && failure_.merit.need > limit && problem_.floor.has_patches()) {
      return fmt::format(
          "friction stands in the way: the best motion found needs {:.4g} of mu_s at some place (surface.patch), and "
          "friction_use is {:.4g}; a duration of about {:.3g} s would do",
          failure_.merit.need / problem_.floor.reference_friction(), limit / problem_.floor.reference_friction(),
          problem_.task.duration_s * std::sqrt(failure_.merit.need / limit));
    }
    if (failure_.friction_only && failure_.merit.need > limit) {
      return fmt::format(
          "friction stands in the way: the best motion found needs f_s/N = {:.4g}, and friction_use mu_s is {:.4g}; a "
          "duration of about {:.3g} s, or mu_s = {:.3g}, would do",
          failure_.merit.need, limit, problem_.task.duration_s * std::sqrt(failure_.merit.need / limit),
          failure_.merit.need / (limit / scenario_.surface.static_friction));
    }
    const std::string what = failure_.merit.equality >= failure_.merit.limit
                                 ? equality_words(failure_.merit.worst_equality)
                                 : limit_words(failure_.merit.worst_limit);
    return fmt::format(
        "{} could not be met; the nearest motion found ends at ({:.4g}, {:.4g}) m, {:.3g} m from the goal, and "
        "has at their limits: {}",
        what, failure_.reached_m[0], failure_.reached_m[1], (failure_.reached_m - problem_.task.goal_m).norm(),
        failure_.at_limits);
  }

  const Problem& problem_;
  const sim::Scenario& scenario_;
  const SearchOptions& options_;
  Effort effort_;
  std::optional<Plan> best_, unfit_;
  double best_effort_ = 0;
  Aim aim_;
  bool by_steppers_ = false;   // judges plans by the run with their motors
  bool by_resonance_ = false;  // judges plans by the time near a resonance, which has to be below most_resonance_
  double most_resonance_ = 0;
  double beyond_ = 0;  // by how much the last plan passed a circle or left the path between nodes, in radii
  std::string binding_;
  Failure failure_;
};

}  // namespace

Outcome search(const Problem& problem, const sim::Scenario& scenario, const SearchOptions& options) {
  return Search(problem, scenario, options).run();
}

}  // namespace ballast::plan
