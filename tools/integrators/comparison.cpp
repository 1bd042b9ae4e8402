#include "tools/integrators/comparison.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "tools/program/short_number.h"

namespace ballast::integrators {

namespace {

constexpr double kMeasured_s = 0.3;
constexpr int kFewest = 3, kMost = 201;

// Right-hand sides, complex ones, in a Jacobian by complex step: one per component of q and Omega.
constexpr int kJacobian = static_cast<int>(sim::RollingOde::kZ);

// q and -q are the same attitude.
double distance(const State& a, const State& b) {
  double same = 0, opposite = 0, rest = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    same = std::max(same, std::abs(a[i] - b[i]));
    opposite = std::max(opposite, std::abs(a[i] + b[i]));
  }
  for (std::size_t i = 4; i < sim::RollingOde::kSize; ++i) rest = std::max(rest, std::abs(a[i] - b[i]));
  return std::max(std::min(same, opposite), rest);
}

State with_unit_q(State y) {
  const double length = std::sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2] + y[3] * y[3]);
  for (std::size_t i = 0; i < 4; ++i) y[i] /= length;
  return y;
}

// A sum of errors above this shows in the three digits that are printed.
constexpr double kCoarse = 1e-3;

void measure(const sim::Scenario& scenario, Row& row) {
  const double end_s = row.run.result.final_sample.time_s;
  std::vector<double> times;
  double total = 0;
  while (static_cast<int>(times.size()) < kFewest || (total < kMeasured_s && static_cast<int>(times.size()) < kMost)) {
    const BareRun bare = integrate_only(scenario, *row.method, row.settings, end_s);
    times.push_back(bare.wall_time_s);
    total += bare.wall_time_s;
    row.counters = bare.counters;
  }
  std::nth_element(times.begin(), times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2), times.end());
  row.wall_time_s = times[times.size() / 2];
  row.repetitions = static_cast<int>(times.size());
}

}  // namespace

const Row* Comparison::least(double (*cost)(const Row&)) const {
  const Row* best = nullptr;
  for (const Row& row : rows) {
    if (row.run.failure.empty() && (best == nullptr || cost(row) < cost(*best))) best = &row;
  }
  return best;
}

const Row* Comparison::fastest() const {
  return least([](const Row& row) { return row.wall_time_s; });
}

const Row* Comparison::fewest_evaluations() const {
  return least([](const Row& row) {
    return static_cast<double>(row.counters.right_hand_sides + kJacobian * row.counters.jacobians);
  });
}

Comparison compare(const sim::Scenario& scenario, const std::vector<const MethodInfo*>& methods,
                   const Settings& settings, const std::function<void(const MethodInfo&)>& begins) {
  const Settings tightest{.tolerance = kLeastTolerance, .interrupted = settings.interrupted};
  const State reference = with_unit_q(run_rolling(scenario, *find_method(kDefaultMethod), tightest).end_state);
  Comparison out;
  out.scenario = scenario.name;
  out.tolerance = settings.tolerance;
  for (const MethodInfo* method : methods) {
    if (begins) begins(*method);
    Row row;
    row.method = method;
    row.settings = settings;
    if (method->fixed_steps == FixedSteps::kAlways && settings.fixed_step_s == 0) {
      row.settings.fixed_step_s = fixed_step_for(scenario, settings.tolerance);
    } else if (method->fixed_steps != FixedSteps::kAlways && methods.size() > 1) {
      row.settings.fixed_step_s = 0;
    }
    row.run = run_rolling(scenario, *method, row.settings);
    row.distance = distance(with_unit_q(row.run.end_state), reference);
    if (row.run.failure.empty()) measure(scenario, row);
    out.rows.push_back(std::move(row));
  }
  return out;
}

std::string coarse_text(const Row& row) {
  if (!row.run.failure.empty() || !(row.distance > kCoarse)) return "";
  const double step_s = row.settings.fixed_step_s;
  std::string text = fmt::format(
      "{} is too coarse here: its end state is {} away from that of {} at tolerance {:g}, so its digits are not to be "
      "trusted",
      row.method->name, program::short_number(row.distance), kDefaultMethod, kLeastTolerance);
  if (!(step_s > 0)) return text + "; a smaller --tolerance helps";
  // The error of order p falls as step^p. Half of what that gives is on the safe side where the step was far too long.
  const double order = std::strtod(row.method->order, nullptr);
  return text + fmt::format("; --step {:.1g} or less helps", step_s * std::pow(kCoarse / row.distance, 1 / order) / 2);
}

std::string comparison_text(const Comparison& comparison) {
  const Row* fastest = comparison.fastest();
  std::string text = fmt::format("{}, prescribed masses, tolerance {:g}\n", comparison.scenario, comparison.tolerance);
  text += fmt::format("  {:<11} {:<8} {:>5} {:>8} {:>8} {:>10} {:>9} {:>12}  {:<10} {:>9}\n", "method", "(paper)",
                      "order", "steps", "rejected", "rhs", "Jacobians", "wall time", "most f_s/N", "distance");
  for (const Row& row : comparison.rows) {
    if (!row.run.failure.empty()) {
      text += fmt::format("  {:<11} failed at t = {} s: {}\n", row.method->name,
                          program::short_time(row.run.result.final_sample.time_s), row.run.failure);
      continue;
    }
    const Counters& c = row.counters;
    text += fmt::format("  {:<11} {:<8} {:>5} {:8} {:8} {:10} {:9} {:>9} us{} {:<10} {:9.1e}", row.method->name,
                        row.method->counterpart, row.method->order, c.steps, c.rejected, c.right_hand_sides,
                        c.jacobians, program::short_number(1e6 * row.wall_time_s), &row == fastest ? "*" : " ",
                        program::short_number(row.run.result.extrema.mu_required_max.value), row.distance);
    if (row.settings.fixed_step_s > 0) text += fmt::format("  fixed step {:g}", row.settings.fixed_step_s);
    text += "\n";
  }
  text += fmt::format(
      "  wall time: of the integration alone, median; distance: of the end state from dop853 at tolerance {:g}\n",
      kLeastTolerance);
  if (fastest != nullptr && comparison.rows.size() > 1) {
    text += fmt::format(
        "  * fastest: {}; fewest evaluations, a Jacobian counted as {}: {}.\n"
        "    The paper found ode113, here adams, the fastest in MATLAB, where evaluations are what costs\n",
        fastest->method->name, kJacobian, comparison.fewest_evaluations()->method->name);
  }
  return text;
}

std::string comparison_json(const Comparison& comparison) {
  using Json = nlohmann::ordered_json;
  const auto finite_or_null = [](double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); };
  const Row* fastest = comparison.fastest();
  Json j;
  j["scenario"] = comparison.scenario;
  j["tolerance"] = comparison.tolerance;
  j["reference"] = {{"method", kDefaultMethod}, {"tolerance", kLeastTolerance}};
  j["fastest"] = fastest != nullptr ? Json(fastest->method->name) : Json(nullptr);
  j["fewest_evaluations"] = fastest != nullptr ? Json(comparison.fewest_evaluations()->method->name) : Json(nullptr);
  j["methods"] = Json::array();
  for (const Row& row : comparison.rows) {
    const sil::RunResult& result = row.run.result;
    const bool failed = !row.run.failure.empty();
    j["methods"].push_back(
        {{"method", row.method->name},
         {"counterpart", row.method->counterpart},
         {"order", row.method->order},
         {"form", row.method->form == Form::kOde ? "rolling_ball_ode_f" : "rolling_ball_dae_g"},
         {"fixed_step", row.settings.fixed_step_s > 0 ? Json(row.settings.fixed_step_s) : Json(nullptr)},
         {"failure", failed ? Json(row.run.failure) : Json(nullptr)},
         {"end",
          {{"reason", failed ? Json(nullptr) : Json(sil::to_string(result.end_reason))},
           {"time", result.final_sample.time_s}}},
         {"steps", row.counters.steps},
         {"rejected", row.counters.rejected},
         {"right_hand_sides", row.counters.right_hand_sides},
         {"jacobians", row.counters.jacobians},
         {"mu_required_max", finite_or_null(result.extrema.mu_required_max.value)},
         {"distance", row.distance},
         {"constraint_error", row.run.constraint_error},
         {"wall_time", row.wall_time_s},
         {"repetitions", row.repetitions}});
  }
  return j.dump(2) + "\n";
}

}  // namespace ballast::integrators
