// plan_solvers SET [COUNT]: solves the transcribed planning problem of tasks of the committed set by the planner's own
// SQP, by Ipopt and by NLopt's SLSQP, from the same motion (masses at rest), with the same exact derivatives, and
// beside them the planner's whole search. Prints a row per task on stderr, and the table of tools/docs/plan.md.
//
// Ipopt and NLopt get the greatest f_s/N as a variable t, f^2/N^2 - t^2 <= 0 at every node, and the limits as they are.
#include <fmt/core.h>
#include <nlopt.h>

#include <IpIpoptApplication.hpp>
#include <IpTNLP.hpp>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <vector>

#include "tests/plan/task_set.h"
#include "tools/plan/read_task.h"
#include "tools/plan/search.h"

namespace {

using namespace ballast;
using plan::Limit;
using plan::NodeForm;

constexpr int kPieces = 32;          // as the search's
constexpr double kMet = 1e-4;        // greatest violation of a motion that counts as one that meets the limits
constexpr double kMostSeconds = 60;  // CPU, for one task and one solver
constexpr int kMostIterations = 500;

double cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }
std::size_t index(int i) { return static_cast<std::size_t>(i); }

// The transcription as a smooth program in x: the free knots in their units, and last the level t.
class Program {
 public:
  Program(const plan::Problem& problem, double duration_s)
      : problem_(problem),
        rollout_(problem, plan::make_grid(problem, duration_s, kPieces)),
        transcription_(problem, rollout_) {
    const int n = problem.masses();
    const double distance_m = (problem.task.goal_m - problem.start_m).norm();
    const double least =
        (problem.task.at_rest ? 4 : 2) * distance_m / (problem.robot.ball.gravity_mps2 * duration_s * duration_s);
    transcription_.friction_unit = std::clamp(least, 0.005, 1.0);
    transcription_.corrections.room = 2e-3;
    knots_.assign(index(rollout_.variables()), 0);
    fixed_.assign(knots_.size(), false);
    for (int i = 0; i < n; ++i) {
      fixed_[index(i)] = problem.limits[index(i)].motor.has_value();
      fixed_[index((rollout_.grid().knots() - 1) * n + i)] = true;
    }
    for (int v = 0; v < rollout_.variables(); ++v) {
      unit_.push_back(plan::acceleration_unit(problem, v % n));
      if (!fixed_[index(v)]) free_.push_back(v);
    }
    evaluate(start());
    equalities_ = static_cast<int>(transcription_.equalities(false).size());
    rows_ = count_rows();
  }

  [[nodiscard]] int size() const { return static_cast<int>(free_.size()) + 1; }
  [[nodiscard]] int equalities() const { return equalities_; }
  [[nodiscard]] int inequalities() const { return rows_; }
  [[nodiscard]] int evaluations() const { return evaluations_; }

  // The masses keep their motion; t is its greatest ratio.
  std::vector<double> start() {
    std::vector<double> x(index(size()), 0);
    if (rollout_.roll(knots_)) {
      for (const double ratio : transcription_.ratios()) x.back() = std::max(x.back(), ratio);
    }
    return x;
  }

  // False: the motion does not stay finite.
  bool evaluate(const std::vector<double>& x) {
    if (x == x_) return good_;
    x_ = x;
    ++evaluations_;
    for (std::size_t k = 0; k < free_.size(); ++k) knots_[index(free_[k])] = x[k] * unit_[index(free_[k])];
    good_ = rollout_.roll(knots_);
    if (good_) rollout_.differentiate();
    return good_;
  }

  // t, and the regularisation that the planner uses.
  double objective(double* gradient) const {
    double value = x_.back();
    if (gradient != nullptr) std::fill_n(gradient, x_.size(), 0.0);
    bool driven = false;
    for (int i = 0; i < problem_.masses(); ++i) driven = driven || problem_.limits[index(i)].motor;
    const double weight = (driven ? 0.01 : 1e-4) / rollout_.grid().knots();
    for (std::size_t k = 0; k < free_.size(); ++k) {
      value += 0.5 * weight * x_[k] * x_[k];
      if (gradient != nullptr) gradient[k] = weight * x_[k];
    }
    if (gradient != nullptr) gradient[x_.size() - 1] = 1;
    return value;
  }

  void equality(double* values, double* jacobian) {
    const auto found = transcription_.equalities(jacobian != nullptr);
    for (std::size_t k = 0; k < found.size(); ++k) {
      values[k] = found[k].value;
      if (jacobian == nullptr) continue;
      begin_row();
      for (int f = 0; f < found[k].forms; ++f) transcription_.expand(found[k].form[index(f)], 1, row_.data());
      end_row(jacobian + k * x_.size(), 1);
    }
  }

  // Rows that are to be at most 0.
  void inequality(double* values, double* jacobian) {
    std::size_t at = 0;
    const double t = x_.back();
    for (int node = 0; node < rollout_.grid().nodes(); ++node) {
      std::array<double, 2> q{};
      std::array<NodeForm, 2> form{};
      transcription_.ratio_forms(node, q, form);
      values[at] = q[0] * q[0] + q[1] * q[1] - t * t;
      if (jacobian != nullptr) {
        begin_row();
        for (std::size_t c = 0; c < 2; ++c) transcription_.expand(form[c], 2 * q[c], row_.data());
        end_row(jacobian + at * x_.size(), 1);
        jacobian[(at + 1) * x_.size() - 1] = -2 * t;
      }
      ++at;
    }
    const auto both_sides = [&](const Limit& limit, auto expand) {
      if (!std::isfinite(limit.lower) && !std::isfinite(limit.upper)) return;
      begin_row();
      if (jacobian != nullptr) expand();
      if (std::isfinite(limit.upper)) {
        values[at] = limit.value - limit.upper;
        if (jacobian != nullptr) end_row(jacobian + at * x_.size(), 1);
        ++at;
      }
      if (std::isfinite(limit.lower)) {
        values[at] = limit.lower - limit.value;
        if (jacobian != nullptr) end_row(jacobian + at * x_.size(), -1);
        ++at;
      }
    };
    transcription_.limits(jacobian != nullptr, [&](const Limit& limit, const NodeForm& form) {
      both_sides(limit, [&] { transcription_.expand(form, 1, row_.data()); });
    });
    knot_limits(both_sides);
  }

  [[nodiscard]] plan::Merit merit(const std::vector<double>& x) {
    if (!evaluate(x)) return {1e9, 0, 1e9, 1e9, {}, {}};
    return plan::judge(transcription_, knots_);
  }

  // The planner's own solver, from the same motion.
  plan::Merit improve() {
    std::fill(knots_.begin(), knots_.end(), 0);
    plan::SqpSettings settings;
    settings.friction_limit = problem_.friction_limit;
    plan::Effort effort;
    const double start_s = cpu_s();
    effort.stop = [start_s] { return cpu_s() - start_s > kMostSeconds; };
    return plan::improve(rollout_, transcription_, fixed_, settings, knots_, effort);
  }

 private:
  template <class BothSides>
  void knot_limits(const BothSides& both_sides) {
    const int n = problem_.masses();
    for (int v = 0; v < rollout_.variables(); ++v) {
      const plan::MassLimits& limits = problem_.limits[index(v % n)];
      if (std::isfinite(limits.acceleration)) {
        both_sides(Limit{plan::LimitKind::kAcceleration, v % n, v / n, knots_[index(v)] / limits.acceleration, -1, 1},
                   [&] { row_[index(v)] = 1 / limits.acceleration; });
      }
      if (!std::isfinite(limits.jerk) || v + n >= rollout_.variables()) continue;
      const double most = limits.jerk * rollout_.grid().piece_s();
      both_sides(Limit{plan::LimitKind::kJerk, v % n, v / n, (knots_[index(v + n)] - knots_[index(v)]) / most, -1, 1},
                 [&] {
                   row_[index(v + n)] = 1 / most;
                   row_[index(v)] = -1 / most;
                 });
    }
  }

  int count_rows() {
    int rows = rollout_.grid().nodes();
    const auto count = [&rows](const Limit& limit, const auto&) {
      rows += (std::isfinite(limit.upper) ? 1 : 0) + (std::isfinite(limit.lower) ? 1 : 0);
    };
    transcription_.limits(false, count);
    knot_limits(count);
    return rows;
  }

  // A row by the knots; end_row() puts it into the program's variables.
  void begin_row() { row_.assign(knots_.size(), 0); }
  void end_row(double* to, double sign) const {
    for (std::size_t k = 0; k < free_.size(); ++k) to[k] = sign * row_[index(free_[k])] * unit_[index(free_[k])];
    to[free_.size()] = 0;
  }

  const plan::Problem& problem_;
  plan::Rollout rollout_;
  plan::Transcription transcription_;
  std::vector<double> knots_, unit_, x_, row_;
  std::vector<bool> fixed_;
  std::vector<int> free_;
  bool good_ = false;
  int equalities_ = 0, rows_ = 0, evaluations_ = 0;
};

// Ipopt's view of a Program, with a dense Jacobian.
class IpoptProgram : public Ipopt::TNLP {
 public:
  using Index = Ipopt::Index;
  using Number = Ipopt::Number;

  explicit IpoptProgram(Program& program) : result(program.start()), program_(program) {}

  std::vector<double> result;

  bool get_nlp_info(Index& n, Index& m, Index& nonzero_jacobian, Index& nonzero_hessian,
                    IndexStyleEnum& style) override {
    n = program_.size();
    m = program_.equalities() + program_.inequalities();
    nonzero_jacobian = n * m;
    nonzero_hessian = 0;
    style = C_STYLE;
    return true;
  }
  bool get_bounds_info(Index n, Number* x_l, Number* x_u, Index m, Number* g_l, Number* g_u) override {
    std::fill_n(x_l, n, -1e19);
    std::fill_n(x_u, n, 1e19);
    x_l[n - 1] = 0;
    for (Index k = 0; k < m; ++k) {
      g_l[k] = k < program_.equalities() ? 0 : -1e19;
      g_u[k] = 0;
    }
    return true;
  }
  bool get_starting_point(Index n, bool, Number* x, bool, Number*, Number*, Index, bool, Number*) override {
    std::copy_n(result.begin(), n, x);
    return true;
  }
  bool eval_f(Index n, const Number* x, bool, Number& value) override {
    if (!at(n, x)) return false;
    value = program_.objective(nullptr);
    return true;
  }
  bool eval_grad_f(Index n, const Number* x, bool, Number* gradient) override {
    if (!at(n, x)) return false;
    program_.objective(gradient);
    return true;
  }
  bool eval_g(Index n, const Number* x, bool, Index, Number* g) override {
    if (!at(n, x)) return false;
    program_.equality(g, nullptr);
    program_.inequality(g + program_.equalities(), nullptr);
    return true;
  }
  bool eval_jac_g(Index n, const Number* x, bool, Index m, Index, Index* rows, Index* columns,
                  Number* values) override {
    if (values == nullptr) {
      for (Index k = 0; k < m * n; ++k) {
        rows[k] = k / n;
        columns[k] = k % n;
      }
      return true;
    }
    if (!at(n, x)) return false;
    scratch_.resize(static_cast<std::size_t>(m));
    program_.equality(scratch_.data(), values);
    program_.inequality(scratch_.data(), values + static_cast<std::ptrdiff_t>(program_.equalities()) * n);
    return true;
  }
  void finalize_solution(Ipopt::SolverReturn, Index n, const Number* x, const Number*, const Number*, Index,
                         const Number*, const Number*, Number, const Ipopt::IpoptData*,
                         Ipopt::IpoptCalculatedQuantities*) override {
    result.assign(x, x + n);
  }

 private:
  bool at(Index n, const Number* x) { return program_.evaluate(std::vector<double>(x, x + n)); }

  Program& program_;
  std::vector<double> scratch_;
};

plan::Merit by_ipopt(Program& program) {
  Ipopt::SmartPtr<IpoptProgram> shown = new IpoptProgram(program);
  Ipopt::SmartPtr<Ipopt::IpoptApplication> solver = IpoptApplicationFactory();
  solver->Options()->SetStringValue("hessian_approximation", "limited-memory");
  solver->Options()->SetStringValue("sb", "yes");
  solver->Options()->SetIntegerValue("print_level", 0);
  solver->Options()->SetIntegerValue("max_iter", kMostIterations);
  solver->Options()->SetNumericValue("max_cpu_time", kMostSeconds);
  solver->Options()->SetNumericValue("tol", 1e-5);
  if (solver->Initialize() != Ipopt::Solve_Succeeded) return {1e9, 0, 1e9, 1e9, {}, {}};
  static_cast<void>(solver->OptimizeTNLP(shown));
  return program.merit(shown->result);
}

plan::Merit by_slsqp(Program& program) {
  const auto n = static_cast<unsigned>(program.size());
  nlopt_opt solver = nlopt_create(NLOPT_LD_SLSQP, n);
  const auto at = [](unsigned size, const double* x, void* data) {
    auto& shown = *static_cast<Program*>(data);
    return shown.evaluate(std::vector<double>(x, x + size));
  };
  static const auto reach = at;
  nlopt_set_min_objective(
      solver,
      [](unsigned size, const double* x, double* gradient, void* data) {
        return reach(size, x, data) ? static_cast<Program*>(data)->objective(gradient) : HUGE_VAL;
      },
      &program);
  const std::vector<double> equal_tolerance(index(program.equalities()), 1e-7),
      limit_tolerance(index(program.inequalities()), 1e-7);
  nlopt_add_equality_mconstraint(
      solver, static_cast<unsigned>(program.equalities()),
      [](unsigned m, double* values, unsigned size, const double* x, double* jacobian, void* data) {
        if (reach(size, x, data)) return static_cast<Program*>(data)->equality(values, jacobian);
        std::fill_n(values, m, HUGE_VAL);
      },
      &program, equal_tolerance.data());
  nlopt_add_inequality_mconstraint(
      solver, static_cast<unsigned>(program.inequalities()),
      [](unsigned m, double* values, unsigned size, const double* x, double* jacobian, void* data) {
        if (reach(size, x, data)) return static_cast<Program*>(data)->inequality(values, jacobian);
        std::fill_n(values, m, HUGE_VAL);
      },
      &program, limit_tolerance.data());
  std::vector<double> lower(n, -HUGE_VAL);
  lower.back() = 0;
  nlopt_set_lower_bounds(solver, lower.data());
  nlopt_set_ftol_rel(solver, 1e-4);
  nlopt_set_maxeval(solver, kMostIterations);
  nlopt_set_maxtime(solver, kMostSeconds);
  std::vector<double> x = program.start();
  double value = 0;
  static_cast<void>(nlopt_optimize(solver, x.data(), &value));
  nlopt_destroy(solver);
  return program.merit(x);
}

// One solver on all tasks.
struct Row {
  std::string name;
  std::vector<double> seconds = {}, over_best = {}, violation = {};
  int met = 0, within = 0;
};

struct Result {
  double need, violation, seconds;
  [[nodiscard]] bool met() const { return violation <= kMet; }
};

double quantile(std::vector<double> values, double part) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1, static_cast<std::size_t>(part * static_cast<double>(values.size())))];
}

template <class Solve>
Result timed(Solve solve) {
  const double start_s = cpu_s();
  const plan::Merit merit = solve();
  return {merit.need, merit.error(), cpu_s() - start_s};
}

// The whole search, judged by the plant.
Result by_search(const plan::Problem& problem, const plan::TaskFile& file) {
  const double start_s = cpu_s();
  const plan::Outcome outcome = plan::search(problem, file.scenario, {});
  const bool found = outcome.plan.has_value();
  return {found ? outcome.plan->run.extrema.mu_required_max.value : 1e9, found ? 0.0 : 1e9, cpu_s() - start_s};
}

// Tasks whose goal the transcription states as it is: least friction, no path to tighten, no free time of a via place.
bool comparable(const plan::SetTask& task, const plan::TaskFile& file) {
  return task.sure && file.task.objective == plan::Objective::kFriction && !file.task.follow && file.task.via.empty();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "plan_solvers SET [COUNT]\n");
    return 1;
  }
  std::string why;
  const std::vector<plan::SetTask> set = plan::read_task_set(argv[1], why);
  if (set.empty()) {
    fmt::print(stderr, "{}\n", why);
    return 1;
  }
  const int most = argc > 2 ? static_cast<int>(std::strtol(argv[2], nullptr, 10)) : 40;
  std::vector<Row> rows{{"own SQP, one start"}, {"Ipopt, one start"}, {"NLopt SLSQP, one start"}, {"whole search"}};
  int tasks = 0;
  for (const plan::SetTask& task : set) {
    if (tasks == most) break;
    std::vector<sim::ScenarioError> errors;
    auto file = plan::parse_task(task.toml, "task", errors);
    if (!file || !comparable(task, *file)) continue;
    file->task.avoid_resonance = false;
    ++tasks;
    const plan::Problem problem = plan::make_problem(*file);
    Program program(problem, file->task.duration_s);
    const Result results[] = {timed([&] { return program.improve(); }), timed([&] { return by_ipopt(program); }),
                              timed([&] { return by_slsqp(program); }), by_search(problem, *file)};
    double best = 1e9;
    for (const Result& result : results) best = result.met() ? std::min(best, result.need) : best;
    std::string line = fmt::format("{:4d}: {} variables, {} rows", task.number, program.size(), program.inequalities());
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const Result& result = results[k];
      rows[k].seconds.push_back(result.seconds);
      rows[k].violation.push_back(result.violation);
      line += fmt::format(" | {:.4f} {:.0e} {:.2f} s", result.need, result.violation, result.seconds);
      if (!result.met()) continue;
      ++rows[k].met;
      rows[k].within += result.need < 1.05 * best ? 1 : 0;
      rows[k].over_best.push_back(result.need / best);
    }
    fmt::print(stderr, "{}\n", line);
  }
  fmt::print(
      "| solver, {} tasks | meets all limits to {:g} | median violation | within 5 % of the best f_s/N | f_s/N over "
      "the "
      "best's: median, 90 % | CPU: median, 90 % |\n|---|---|---|---|---|---|\n",
      tasks, kMet);
  for (const Row& row : rows) {
    const bool search = row.name == "whole search";
    fmt::print("| {} | {} | {} | {} | {:.2f}, {:.2f} | {:.2f}, {:.2f} s |\n", row.name, row.met,
               search ? "judged by the plant" : fmt::format("{:.0e}", quantile(row.violation, 0.5)), row.within,
               quantile(row.over_best, 0.5), quantile(row.over_best, 0.9), quantile(row.seconds, 0.5),
               quantile(row.seconds, 0.9));
  }
  return 0;
}
