// Methods side by side on one scenario: what each costs, and how far each ends from the tightest solution.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tools/integrators/rolling_run.h"

namespace ballast::integrators {

inline constexpr double kLeastTolerance = 1e-13;  // that of the tightest solution; SUNDIALS goes no further
inline constexpr double kMostTolerance = 1e-2;

struct Row {
  const MethodInfo* method = nullptr;
  Settings settings;
  RollingRun run;
  Counters counters;       // of the integration alone, as the wall time
  double wall_time_s = 0;  // median of `repetitions`
  int repetitions = 0;
  double distance = 0;  // of the end state (q, Omega, z) from the tightest solution's
};

class Comparison {
 public:
  std::string scenario;
  double tolerance = 0;
  std::vector<Row> rows;
  // The best method that reached the end of the run; nullptr: none did.
  [[nodiscard]] const Row* fastest() const;
  [[nodiscard]] const Row* fewest_evaluations() const;  // of the right-hand side, in Jacobians too

 private:
  const Row* least(double (*cost)(const Row&)) const;
};

// A fixed step applies to a single method, or among several to those that have fixed steps only. Without one these use
// fixed_step_for(). The tightest solution is dop853's at 1e-13. Each method is repeated for some tenths of a second, at
// least three times.
// Calls `begins` before each method.
Comparison compare(const sim::Scenario& scenario, const std::vector<const MethodInfo*>& methods,
                   const Settings& settings, const std::function<void(const MethodInfo&)>& begins = {});

// Why the digits of this row are not to be trusted. Empty: they are.
std::string coarse_text(const Row& row);
std::string comparison_text(const Comparison& comparison);  // a table, ending in a newline
std::string comparison_json(const Comparison& comparison);  // integrators.json: tools/docs/integrate.md

}  // namespace ballast::integrators
