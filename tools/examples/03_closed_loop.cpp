// 03: the closed loop. The controller, the plant and the monitor in one process, tick by tick, as in `ballast run`.
//   03_closed_loop [FILE.toml]
// Prints the numbers of that run's summary, to the last digit. Without FILE it takes the paper's ball.
#include <algorithm>
#include <cstdio>
#include <memory>

#include "firmware/control/controller.h"
#include "sim/scenario/scenario.h"
#include "tools/program/params.h"
#include "tools/sil/local_peers.h"
#include "tools/sil/run.h"

using namespace ballast;

int main(int argc, char** argv) {
  const sim::ScenarioResult read = sim::read_scenario(argc > 1 ? argv[1] : BALLAST_SCENARIO);
  for (const sim::ScenarioError& error : read.errors) std::printf("%s\n", to_string(error).c_str());
  if (!read.ok()) return 1;
  const sim::Scenario& scenario = read.scenario;

  // The firmware's parameters. It checks them again, because on a robot they come over a link.
  const auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto refusal = program::to_controller_params(scenario, *params)) {
    std::printf("%s\n", refusal->c_str());
    return 1;
  }

  // The two that answer the plant in each tick. Those in tools/sil/lcm_peers.h are other processes.
  sil::InProcessPeers peers(params.get(), program::to_monitor_limits(scenario), scenario.run.control_period_s);

  // Called once per tick with every message of it and the plant's true state.
  double farthest_m = 0;
  sil::RunOptions options;
  options.observe = [&farthest_m](const sil::Lap&, const sim::Plant::Sample& truth) {
    farthest_m = std::max(farthest_m, truth.position_W_m.head<2>().norm());
  };
  sil::NoRecord nowhere;  // takes the place of a recorder
  const sil::RunResult result = sil::run(scenario, peers, nowhere, options);
  if (result.status != hal::Status::kOk) {
    std::printf("%s\n", result.trouble.c_str());
    return 2;
  }
  std::printf("%s at %.17g s, rolled %.17g m, least N %.17g N, most f_s/N %.17g, at most %.3g m away\n",
              sil::to_string(result.end_reason), result.final_sample.time_s, result.distance_m,
              result.extrema.normal_force_min.value, result.extrema.mu_required_max.value, farthest_m);
  return 0;
}
