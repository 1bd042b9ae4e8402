// go_study FIRST LAST [LATENCY [ACTUATION]]: random clicks on desk_ball. Each seed is a run with ten clicks, one in two
// while the ball rolls; LATENCY: ticks that a planner takes, 500 if it is not given. A plan is given up after 10 s.
// Prints a line per seed and the counts.
//
// go_study --halts FIRST LAST: halts of courses at random times. Each seed is a run with six.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

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

// The bar of issue 22, or so little that it does not matter.
bool as_said(const ballast::go_test::Halted& halted) {
  return std::fabs(halted.rolled_m - halted.said_m) <= std::max(0.05 * halted.rolled_m, 5e-4);
}

int study_halts(std::uint64_t first, std::uint64_t last) {
  constexpr int kHalts = 6;
  int halts = 0, rest = 0, said = 0, true_said = 0, broken = 0;
  std::vector<double> said_s, rest_s, off;
  for (std::uint64_t seed = first; seed <= last; ++seed) {
    std::mt19937_64 random(seed);
    std::vector<Click> clicks;
    std::int64_t tick = 100;
    for (int k = 0; k < kHalts; ++k) {
      const double angle = 6.283185307179586 * uniform(random), far_m = 0.2 + 1.3 * uniform(random);
      clicks.push_back({.tick = tick, .to_m = {far_m * std::cos(angle), far_m * std::sin(angle)}});
      clicks.push_back({.tick = tick + 1500 + static_cast<std::int64_t>(6000 * uniform(random)), .halt = true});
      tick += 25000;
    }
    const auto scenario =
        ballast::go_test::clickable(static_cast<double>(tick) * 1e-3, {"seed=" + std::to_string(seed)});
    const auto run = ballast::go_test::run_clicked(scenario, clicks, 500, 10);
    const bool bad = run.result.end_reason != ballast::sil::EndReason::kCompleted || run.result.rolling_lost;
    broken += bad ? 1 : 0;
    fmt::print("{}: {}, most f_s/N {:.3f};", seed, to_string(run.result.end_reason),
               run.result.extrema.mu_required_max.value);
    for (const auto& halted : run.halted) {
      ++halts;
      rest += halted.rests ? 1 : 0;
      rest_s.push_back(halted.rest_s);
      if (halted.said) {
        ++said;
        true_said += as_said(halted) ? 1 : 0;
        said_s.push_back(1e-3 * static_cast<double>(halted.said_tick - halted.tick));
        if (halted.rolled_m > 0) off.push_back(std::fabs(halted.said_m / halted.rolled_m - 1));
      }
      fmt::print(" {:.2f}s", halted.rest_s);
      if (halted.said) fmt::print("/{:.0f}mm said {:.0f}", 1e3 * halted.rolled_m, 1e3 * halted.said_m);
      if (!halted.rests) fmt::print(" DOES NOT REST");
    }
    for (const auto& c : run.clicked) {
      if (!c.planned && !c.why.empty()) fmt::print(" [{:.2f} s: {}]", c.plan_s, c.why);
      if (c.planned && !c.in_force) fmt::print(" [refused {}]", c.refusal);
    }
    fmt::print("\n");
    std::fflush(stdout);
  }
  fmt::print("{} halts, {} came to rest, after {:.1f} s (median), {:.1f} s at most; runs broken: {}\n", halts, rest,
             part_of(rest_s, 0.5), part_of(rest_s, 1), broken);
  fmt::print("{} said how far, after {:.2f} s (median); {} rolled so far to 5 % or 0.5 mm, {:.1f} % off (median)\n",
             said, part_of(said_s, 0.5), true_said, 100 * part_of(off, 0.5));
  return broken == 0 && rest == halts ? 0 : 1;
}

int study_clicks(std::uint64_t first, std::uint64_t last, int latency, const std::string& actuation) {
  constexpr double kTimeLimit_s = 10;
  int clicks = 0, planned = 0, gone = 0, halts = 0, rolling = 0, broken = 0, over = 0, there = 0;
  std::vector<double> plan_s, handover_s;
  for (std::uint64_t seed = first; seed <= last; ++seed) {
    std::mt19937_64 random(seed);
    std::vector<Click> places;
    std::int64_t tick = 100;
    for (int k = 0; k < 10; ++k) {
      const double angle = 6.283185307179586 * uniform(random), far_m = 0.2 + 1.3 * uniform(random);
      places.push_back({.tick = tick, .to_m = {far_m * std::cos(angle), far_m * std::sin(angle)}, .sets_out = true});
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

}  // namespace

int main(int argc, char** argv) {
  const bool halts = argc > 1 && std::string(argv[1]) == "--halts";
  const int at = halts ? 2 : 1;
  if (argc < at + 2) {
    fmt::print("usage: go_study FIRST LAST [LATENCY [ACTUATION]]\n       go_study --halts FIRST LAST\n");
    return 1;
  }
  const std::uint64_t first = std::strtoull(argv[at], nullptr, 10), last = std::strtoull(argv[at + 1], nullptr, 10);
  if (halts) return study_halts(first, last);
  const int latency = argc > 3 ? static_cast<int>(std::strtol(argv[3], nullptr, 10)) : 500;
  return study_clicks(first, last, latency, argc > 4 ? argv[4] : "stepper");
}
