// The table of tools/docs/tracking.md: tracking_study RUNS PLAN...
#include <fmt/core.h>

#include <exception>
#include <numbers>
#include <string>

#include "tests/tracking/study.h"

namespace ballast::tracking_test {
namespace {

struct Row {
  const char* what;
  Disturbance disturbance;
};

void study(const sim::Scenario& plan, const Row& row, int runs) {
  std::vector<double> tracked, open, final_place, speed, friction;
  int broken = 0;
  std::mt19937_64 random(1);
  const double unit_mps = std::sqrt(plan.gravity_mps2 * plan.ball.radius_m);
  for (int k = 0; k < runs; ++k) {
    const sim::Scenario robot = built(plan, row.disturbance, random);
    const sil::RunResult with = run(robot, true), without = run(robot, false);
    const double path_m = with.tracking->path_length_m;
    tracked.push_back(with.tracking->rms_m / path_m);
    final_place.push_back(with.tracking->final_m / path_m);
    speed.push_back(with.final_sample.velocity_W_mps.norm() / unit_mps);
    friction.push_back(with.extrema.mu_required_max.value);
    open.push_back(without.tracking->rms_m / path_m);
    if (with.end_reason != sil::EndReason::kCompleted) ++broken;
  }
  const auto percent = [](const std::vector<double>& values, double part) { return 100 * quantile(values, part); };
  fmt::print("| {} | {} | {:.2f}, {:.2f}, {:.2f} | {:.2f}, {:.2f}, {:.2f} | {:.2f} | {:.4f} | {:.3f} | {} |\n",
             plan.name, row.what, percent(open, 0.5), percent(open, 0.95), percent(open, 1), percent(tracked, 0.5),
             percent(tracked, 0.95), percent(tracked, 1), percent(final_place, 0.95), quantile(speed, 0.95),
             quantile(friction, 0.95), broken);
  std::fflush(stdout);
}

}  // namespace
}  // namespace ballast::tracking_test

int main(int count, char** arguments) {
  using namespace ballast::tracking_test;
  if (count < 3) {
    fmt::print(stderr, "usage: tracking_study RUNS PLAN [KEY=VALUE]...\n");
    return 1;
  }
  const std::vector<std::string> overrides(arguments + 3, arguments + count);
  constexpr double kDegree = std::numbers::pi / 180;
  const Row rows[] = {
      {"errors", {.mass = 0.05, .center_of_mass = 0.005, .tilt_rad = 3 * kDegree}},
      {"slope of 2 degrees", {.slope_rad = 2 * kDegree}},
      {"rolling resistance 0.002", {.rolling_resistance = 0.002}},
      {"push", {.push = 0.2, .push_time_s = 3}},
  };
  try {
    const ballast::sim::Scenario plan = planned(arguments[2], overrides);
    const int runs = std::stoi(arguments[1]);
    for (const Row& row : rows) study(plan, row, runs);
  } catch (const std::exception& error) {
    fmt::print(stderr, "tracking_study: {}\n", error.what());
    return 1;
  }
  return 0;
}
