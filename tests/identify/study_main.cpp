// The study of tools/docs/identify.md:
//   identify_study [--first SEED] RUNS EXCITED PLANNED [KEY=VALUE]...
// Robot k is built with the errors of seed SEED + k from the scenario EXCITED, run once and identified. Then it follows
// the motion of PLANNED three times: believed as it is, as it was identified and as EXCITED says. KEY=VALUE overrides
// keys of both.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "tests/identify/study.h"
#include "tests/tracking/study.h"

namespace ballast::identify_test {
namespace {

struct Request {
  std::uint64_t first = 1;
  int runs = 0;
  std::string excited, planned;
  std::vector<std::string> overrides;
};

// One parameter over all robots.
struct Column {
  std::string name;
  std::vector<double> believed_off, off, half_width;  // parts of what counts as 1
  int near = 0, inside = 0, inside_half = 0;          // within 1 %, inside the interval, inside half of it
};

struct Results {
  std::vector<Column> columns;
  std::vector<double> identified, nominal;  // rms distance from the plan over that with the truth believed
  std::vector<double> with_truth;           // rms distance over the path
  int all_near = 0, early = 0;

  void add(std::size_t k, const std::string& name, double believed, double value, double half_width, double true_value,
           double one) {
    if (columns.size() <= k) columns.resize(k + 1);
    Column& column = columns[k];
    column.name = name;
    const double off = std::abs(value - true_value);
    column.believed_off.push_back(std::abs(believed - true_value) / one);
    column.off.push_back(off / one);
    column.half_width.push_back(half_width / one);
    column.near += off <= 0.01 * one ? 1 : 0;
    column.inside += off <= half_width ? 1 : 0;
    column.inside_half += off <= half_width / 2 ? 1 : 0;
  }

  void print() const {
    using tracking_test::quantile;
    fmt::print(
        "| parameter | robots | believed off, median | identified off: median, 95 %, worst | half-width, median | "
        "within 1 % | inside | inside half |\n|---|---|---|---|---|---|---|---|\n");
    for (const Column& c : columns) {
      fmt::print("| `{}` | {} | {:.2f} % | {:.3f}, {:.3f}, {:.3f} % | {:.3f} % | {} | {} | {} |\n", c.name,
                 c.off.size(), 100 * quantile(c.believed_off, 0.5), 100 * quantile(c.off, 0.5),
                 100 * quantile(c.off, 0.95), 100 * quantile(c.off, 1), 100 * quantile(c.half_width, 0.5), c.near,
                 c.inside, c.inside_half);
    }
    fmt::print("\nall within 1 %: {}; ended early: {}\n", all_near, early);
    if (with_truth.empty()) return;
    const auto three = [](const std::vector<double>& v) {
      return fmt::format("{:.3f}, {:.3f}, {:.3f}", quantile(v, 0.5), quantile(v, 0.95), quantile(v, 1));
    };
    fmt::print("tracking, rms over the path in per cent with the truth believed: median, 95 %, worst {}\n",
               three([this] {
                 std::vector<double> percent;
                 for (const double part : with_truth) percent.push_back(100 * part);
                 return percent;
               }()));
    fmt::print("over that with the truth: identified {}; nominal {}\n", three(identified), three(nominal));
  }
};

// The size that counts as 1 of a parameter: its true value; of the centre of mass the radius, of the resistance 0.01.
double one_of(const identify::Parameters& parameters, const sim::Scenario& robot, int k, double true_value) {
  if (k >= parameters.center_of_mass() && k < parameters.inertia()) return robot.ball.radius_m;
  return k == parameters.rolling_resistance() ? 0.01 : true_value;
}

sim::Scenario read(const std::string& file, const std::vector<std::string>& overrides) {
  sim::ScenarioResult result = sim::read_scenario(file, overrides);
  if (!result.ok()) throw std::runtime_error(sim::to_string(result.errors.front()));
  return std::move(result.scenario);
}

double followed(const sim::Scenario& robot, Results& results, bool truth_believed = false) {
  const sil::RunResult run = tracking_test::run(robot, true);
  if (!run.tracking) throw std::runtime_error("PLANNED has no motion that rolls");
  if (truth_believed) results.with_truth.push_back(run.tracking->rms_m / run.tracking->path_length_m);
  return run.tracking->rms_m;
}

void study(const Request& request, std::uint64_t seed, Results& results) {
  std::mt19937_64 random(seed);
  const sim::Scenario robot = built(read(request.excited, request.overrides), {}, random);
  const Recorded run = record(robot);
  const identify::Parameters parameters(run.recording.known, run.recording.known.scale_mass_kg);
  const identify::FitOutcome outcome = identify::fit(parameters, {run.recording});
  if (!outcome.fit || !run.recording.cut.empty()) {
    fmt::print(stderr, "seed {}: {}{}\n", seed, run.recording.cut, outcome.trouble);
    ++results.early;
    if (!outcome.fit) return;
  }
  const identify::Identified& fit = *outcome.fit;
  const Eigen::VectorXd true_values = truth(parameters, robot);
  bool near = true;
  const auto add = [&](std::size_t k, const std::string& name, double believed, double value, double half_width,
                       double true_value, double one) {
    results.add(k, name, believed, value, half_width, true_value, one);
    near = near && std::abs(value - true_value) <= 0.01 * one;
  };
  add(0, "ball.mass", robot.believed->ball.mass_kg, fit.shell_mass_kg, fit.shell_half_width_kg, robot.ball.mass_kg,
      robot.ball.mass_kg);
  const Eigen::VectorXd believed = truth(parameters, sim::as_believed(robot));
  for (int k = 0; k < parameters.count(); ++k) {
    add(static_cast<std::size_t>(k) + 1, parameters.name(k), believed[k], fit.value[k], fit.half_width[k],
        true_values[k], one_of(parameters, robot, k, true_values[k]));
  }
  results.all_near += near ? 1 : 0;
  std::string line = fmt::format("seed {}: segment {:.1f} s, {} iterations, f_s/N {:.3f}", seed, fit.segment_s,
                                 fit.iterations, run.result.extrema.mu_required_max.value);
  if (request.planned != "none") {
    sim::Scenario plan = tracking_test::planned(request.planned, request.overrides);
    std::mt19937_64 again(seed);
    plan = built(plan, {}, again);
    const double nominal = followed(plan, results);
    const double identified = followed(believing(plan, parameters, fit.value), results);
    const double with_truth = followed(believing(plan, parameters, true_values), results, true);
    results.identified.push_back(identified / with_truth);
    results.nominal.push_back(nominal / with_truth);
    line += fmt::format(", tracking {:.3g} mm, identified {:.3f} times, nominal {:.3f} times", 1e3 * with_truth,
                        identified / with_truth, nominal / with_truth);
  }
  fmt::print(stderr, "{}\n", line);
}

// Throws std::invalid_argument where the words make no sense.
Request requested(int count, char** words) {
  Request out;
  int next = 1;
  if (next + 1 < count && std::string_view(words[next]) == "--first") {
    out.first = std::stoull(words[next + 1]);
    next += 2;
  }
  if (next + 3 > count) throw std::invalid_argument("RUNS, EXCITED and PLANNED");
  out.runs = std::stoi(words[next]);
  out.excited = words[next + 1];
  out.planned = words[next + 2];
  out.overrides.assign(words + next + 3, words + count);
  if (out.runs < 1) throw std::invalid_argument("RUNS");
  return out;
}

}  // namespace
}  // namespace ballast::identify_test

int main(int count, char** words) {
  using namespace ballast::identify_test;
  Request request;
  try {
    request = requested(count, words);
  } catch (const std::exception& error) {
    fmt::print(stderr,
               "identify_study: {}\nusage: identify_study [--first SEED] RUNS EXCITED PLANNED|none "
               "[KEY=VALUE]...\n",
               error.what());
    return 1;
  }
  try {
    Results results;
    for (int k = 0; k < request.runs; ++k) study(request, request.first + static_cast<std::uint64_t>(k), results);
    results.print();
  } catch (const std::exception& error) {
    fmt::print(stderr, "identify_study: {}\n", error.what());
    return 2;
  }
  return 0;
}
