// Runs in this process whose laps are kept for a test.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tools/faults/injection.h"
#include "tools/program/params.h"
#include "tools/sil/lap_sink.h"
#include "tools/sil/run.h"

namespace ballast::sil {

struct KeptLaps final : LapSink {
  void take(const Lap& lap) override { laps.push_back(lap); }
  [[nodiscard]] bool good() const override { return true; }
  [[nodiscard]] const std::string& error() const override { return none; }
  [[nodiscard]] std::int64_t bytes() const override { return 0; }
  std::vector<Lap> laps;
  std::string none;
};

struct Rolled {
  RunResult result;
  std::vector<Lap> laps;
};

inline Rolled roll(const sim::Scenario& scenario, const RunOptions& options = {}) {
  const auto params = std::make_unique<firmware::ControllerParams>();
  const bool has_controller = sim::has_controller(scenario.run.actuation);
  if (has_controller) {
    EXPECT_FALSE(program::to_controller_params(scenario, *params));
  }
  const auto peers =
      peers_in_process(scenario, has_controller ? params.get() : nullptr, program::to_monitor_limits(scenario));
  KeptLaps kept;
  RunResult result = run_with_faults(scenario, *peers, kept, options);
  return {std::move(result), std::move(kept.laps)};
}

}  // namespace ballast::sil
