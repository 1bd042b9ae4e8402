// The table of tools/docs/tracking.md:
//   tracking_study [--rows NAME,NAME...] [--first SEED] RUNS PLAN|robots [KEY=VALUE]...
// Run k of a row has seed SEED + k, whatever the row: the same errors of the robot. `robots`: random desk-like robots
// by turns. KEY=VALUE overrides keys of the scenario in every row. Columns: robot, runs, row; rms distance over the
// path without and with tracking, in per cent, median, 95 % and worst; of the tracked runs in 95 %: final distance over
// the path in per cent, final speed over sqrt(g r), greatest f_s / N; runs that did not complete, that were worse than
// without tracking, that the governor refused; ticks that it bent, in per cent, in 95 %.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <numbers>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "tests/tracking/random_plans.h"
#include "tests/tracking/study.h"

namespace ballast::tracking_test {
namespace {

struct Row {
  const char* name;
  Disturbance disturbance;
  std::vector<std::string> overrides = {};
};

constexpr double kDegree = std::numbers::pi / 180;
const Disturbance kErrors{.mass = 0.05, .center_of_mass = 0.005, .tilt_rad = 3 * kDegree};
const std::string kPart = "sensors.preset=bmi088_calibrated";
const Row kRows[] = {
    {"errors", kErrors},
    {"estimated", kErrors, {kPart}},
    {"fix", kErrors, {kPart, "sensors.position_fix.rate=10", "sensors.position_fix.noise=0.005"}},
    {"slope", {.slope_rad = 2 * kDegree}},
    {"resistance", {.rolling_resistance = 0.002}},
    {"push", {.push = 0.2, .push_time_s = 3}},
};

struct Request {
  std::vector<std::string> rows;  // empty: all
  std::uint64_t first = 1;
  int runs = 0;
  std::string plan;
  std::vector<std::string> overrides;
};

// Plans that the runs of a study take by turns.
class Plans {
 public:
  explicit Plans(const Request& request) : file_(request.plan) {
    if (file_ != "robots") return;
    constexpr int kRobots = 25;
    const auto wanted = static_cast<std::size_t>(std::min(kRobots, request.runs));
    for (int robot = 0; robot < 4 * kRobots && tomls_.size() < wanted; ++robot) {
      std::string why;
      if (auto toml = random_plan(robot, why)) tomls_.push_back(std::move(*toml));
    }
    if (tomls_.empty()) throw std::runtime_error("no random robot has a plan");
  }

  [[nodiscard]] std::vector<sim::Scenario> read(const std::vector<std::string>& overrides) const {
    if (tomls_.empty()) return {planned(file_, overrides)};
    std::vector<sim::Scenario> out;
    for (const std::string& toml : tomls_) {
      out.push_back(planned(sim::parse_scenario(toml, "random plan", overrides)));
    }
    return out;
  }

 private:
  std::string file_;
  std::vector<std::string> tomls_;
};

// Results of a row: parts of the path, but for speed (of sqrt(g r)) and friction.
struct Results {
  std::vector<double> open, tracked, final_place, speed, friction, bent;
  int broken = 0, worse = 0;  // ended early; further off than open loop
  int refused = 0;            // not started

  void add(const sim::Scenario& plan, const sil::RunResult& with, const sil::RunResult& without) {
    const double path_m = with.tracking->path_length_m;
    tracked.push_back(with.tracking->rms_m / path_m);
    open.push_back(without.tracking->rms_m / path_m);
    final_place.push_back(with.tracking->final_m / path_m);
    speed.push_back(with.final_sample.velocity_W_mps.norm() / std::sqrt(plan.gravity_mps2 * plan.ball.radius_m));
    friction.push_back(with.extrema.mu_required_max.value);
    bent.push_back(with.governor ? with.governor->share(with.governor->bent_ticks) : 0);
    broken += with.end_reason != sil::EndReason::kCompleted ? 1 : 0;
    worse += with.tracking->rms_m > without.tracking->rms_m ? 1 : 0;
  }

  void print(const std::string& plan, const char* row) const {
    if (open.empty()) {
      fmt::print("| {} | 0 | {} | {} refused |\n", plan, row, refused);
      return;
    }
    const auto percent = [](const std::vector<double>& values, double part) { return 100 * quantile(values, part); };
    fmt::print(
        "| {} | {} | {} | {:.2f}, {:.2f}, {:.2f} | {:.2f}, {:.2f}, {:.2f} | {:.2f} | {:.4f} | {:.3f} | {} | {} | {} | "
        "{:.0f} |\n",
        plan, open.size(), row, percent(open, 0.5), percent(open, 0.95), percent(open, 1), percent(tracked, 0.5),
        percent(tracked, 0.95), percent(tracked, 1), percent(final_place, 0.95), quantile(speed, 0.95),
        quantile(friction, 0.95), broken, worse, refused, percent(bent, 0.95));
    std::fflush(stdout);
  }
};

void study(const Request& request, const Plans& plans, const Row& row) {
  std::vector<std::string> overrides = request.overrides;
  overrides.insert(overrides.end(), row.overrides.begin(), row.overrides.end());
  const std::vector<sim::Scenario> scenarios = plans.read(overrides);
  Results results;
  double most = 0;
  std::string worst;
  for (int k = 0; k < request.runs; ++k) {
    const std::uint64_t seed = request.first + static_cast<std::uint64_t>(k);
    const sim::Scenario& plan = scenarios[static_cast<std::size_t>(k) % scenarios.size()];
    std::mt19937_64 random(seed);
    const sim::Scenario robot = built(plan, row.disturbance, random);
    const sil::RunResult with = run(robot, true);
    if (with.refusal) {
      ++results.refused;  // by the governor
      continue;
    }
    if (with.end_reason != sil::EndReason::kCompleted) {
      fmt::print(stderr, "{}: seed {}, plan {}: {} at {:.3f} s, controller's faults {}, monitor's {}\n", row.name, seed,
                 static_cast<std::size_t>(k) % scenarios.size(), sil::to_string(with.end_reason),
                 with.final_sample.time_s, with.controller_trip ? with.controller_trip->faults : 0,
                 static_cast<int>(with.trip.cause));
    }
    const sil::RunResult without = run(robot, false);
    const double path_m = with.tracking->path_length_m;
    results.add(plan, with, without);
    if (results.tracked.back() < most) continue;
    most = results.tracked.back();
    worst = fmt::format("seed {}, plan {}: {:.2f} % tracked, {:.2f} % open of {:.2f} radii", seed,
                        static_cast<std::size_t>(k) % scenarios.size(), 100 * most, 100 * results.open.back(),
                        path_m / plan.ball.radius_m);
  }
  results.print(scenarios.size() == 1 ? scenarios[0].name : "random robots", row.name);
  fmt::print(stderr, "worst of {}: {}\n", row.name, worst);
}

// Throws std::invalid_argument where the words make no sense.
Request requested(int count, char** words) {
  Request out;
  int next = 1;
  for (; next + 1 < count && std::string_view(words[next]).starts_with("--"); next += 2) {
    const std::string option = words[next], value = words[next + 1];
    if (option == "--first") {
      out.first = std::stoull(value);
    } else if (option == "--rows") {
      for (std::size_t from = 0; from < value.size();) {
        const std::size_t comma = std::min(value.find(',', from), value.size());
        out.rows.push_back(value.substr(from, comma - from));
        from = comma + 1;
      }
    } else {
      throw std::invalid_argument(option);
    }
  }
  if (next + 2 > count) throw std::invalid_argument("RUNS and PLAN");
  out.runs = std::stoi(words[next]);
  out.plan = words[next + 1];
  out.overrides.assign(words + next + 2, words + count);
  const auto known = [](const std::string& name) {
    return std::any_of(std::begin(kRows), std::end(kRows), [&](const Row& row) { return name == row.name; });
  };
  if (out.runs < 1 || !std::all_of(out.rows.begin(), out.rows.end(), known))
    throw std::invalid_argument("RUNS or NAME");
  return out;
}

}  // namespace
}  // namespace ballast::tracking_test

int main(int count, char** words) {
  using namespace ballast::tracking_test;
  Request request;
  try {
    request = requested(count, words);
  } catch (const std::exception& error) {
    fmt::print(stderr, "tracking_study: {}\nusage: tracking_study [--rows ", error.what());
    for (const Row& row : kRows) fmt::print(stderr, "{}{}", &row == kRows ? "" : ",", row.name);
    fmt::print(stderr, "] [--first SEED] RUNS PLAN|robots [KEY=VALUE]...\n");
    return 1;
  }
  try {
    const Plans plans(request);
    for (const Row& row : kRows) {
      const auto& rows = request.rows;
      if (rows.empty() || std::find(rows.begin(), rows.end(), row.name) != rows.end()) study(request, plans, row);
    }
  } catch (const std::exception& error) {
    fmt::print(stderr, "tracking_study: {}\n", error.what());
    return 2;
  }
  return 0;
}
