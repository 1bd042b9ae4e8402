// go_study FIRST LAST [LATENCY [ACTUATION]]: random clicks on desk_ball. Each seed is a run with ten clicks, one in two
// while the ball rolls; LATENCY: ticks that a planner takes, 500 if it is not given. A plan is given up after 10 s.
// Prints a line per seed and the counts.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>

#include "tests/go/clicked_run.h"

namespace {

using ballast::go_test::Click;

// Uniform in [0, 1), the same on every platform.
double uniform(std::mt19937_64& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }

double part_of(std::vector<double> values, double part) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print("usage: go_study FIRST LAST [LATENCY [ACTUATION]]\n");
    return 1;
  }
  const int latency = argc > 3 ? static_cast<int>(std::strtol(argv[3], nullptr, 10)) : 500;
  const std::string actuation = argc > 4 ? argv[4] : "stepper";
  constexpr double kTimeLimit_s = 10;
  int clicks = 0, planned = 0, gone = 0, halts = 0, rolling = 0, broken = 0, over = 0, there = 0;
  std::vector<double> plan_s, handover_s;
  for (std::uint64_t seed = std::strtoull(argv[1], nullptr, 10); seed <= std::strtoull(argv[2], nullptr, 10); ++seed) {
    std::mt19937_64 random(seed);
    std::vector<Click> places;
    std::int64_t tick = 100;
    for (int k = 0; k < 10; ++k) {
      const double angle = 6.283185307179586 * uniform(random), far_m = 0.2 + 1.3 * uniform(random);
      places.push_back({tick, {far_m * std::cos(angle), far_m * std::sin(angle)}});
      tick += k % 2 == 0 ? 6000 : 40000;
    }
    const auto scenario = ballast::go_test::clickable(static_cast<double>(tick) * 1e-3,
                                                      {"seed=" + std::to_string(seed), "run.actuation=" + actuation});
    const auto run = ballast::go_test::run_clicked(scenario, places, latency, kTimeLimit_s);
    const bool bad = run.result.end_reason != ballast::sil::EndReason::kCompleted || run.result.rolling_lost;
    broken += bad ? 1 : 0;
    halts += run.halts;
    fmt::print("{}: {}, most f_s/N {:.3f}, jerk {:.3f} of its limit;", seed, to_string(run.result.end_reason),
               run.result.extrema.mu_required_max.value, run.greatest_jerk_use);
    for (const auto& c : run.clicked) {
      ++clicks;
      planned += c.planned ? 1 : 0;
      gone += c.in_force ? 1 : 0;
      rolling += c.in_force && c.rolling ? 1 : 0;
      if (c.planned) plan_s.push_back(c.plan_s);
      if (c.in_force) handover_s.push_back(1e-3 * static_cast<double>(c.decided_tick - c.sent_tick));
      if (!c.planned) fmt::print(" [{:.2f} s: {}]", c.plan_s, c.why);
      if (c.planned && !c.in_force) fmt::print(" [refused {}]", c.refusal);
      if (!c.in_force) continue;
      fmt::print(" {:.2f}m/{:.1f}s{}:{},{:.2f}s", c.way_m, c.duration_s, c.rolling ? "r" : "",
                 c.over ? fmt::format("{:.1f}mm", 1e3 * c.off_m) : "replaced", c.plan_s);
      over += c.over ? 1 : 0;
      there += c.over && c.off_m <= 0.01 * c.way_m ? 1 : 0;
    }
    fmt::print("\n");
    std::fflush(stdout);
  }
  fmt::print("{} clicks, {} planned, {} gone, {} of them while the ball rolled; {} after a halt; runs broken: {}\n",
             clicks, planned, gone, rolling, halts, broken);
  fmt::print("{} courses were not replaced; {} of them ended within 1 % of their way\n", over, there);
  fmt::print("planned in {:.2f} s (median), {:.2f} s (95 %); handed over in {:.2f} s, {:.2f} s of the run's time\n",
             part_of(plan_s, 0.5), part_of(plan_s, 0.95), part_of(handover_s, 0.5), part_of(handover_s, 0.95));
  return broken == 0 ? 0 : 1;
}
