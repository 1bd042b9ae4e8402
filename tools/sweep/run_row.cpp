#include "tools/sweep/run_row.h"

#include <algorithm>
#include <memory>
#include <optional>

#include "sim/plant/plant.h"
#include "tools/faults/injection.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/sil/lap_sink.h"
#include "tools/summary/summary.h"
#include "tools/sweep/kept_values.h"

namespace ballast::sweep {
namespace {

sil::EndReason reason_of(sim::PhysicsEnd end) {
  switch (end) {
    case sim::PhysicsEnd::kSlipped:
      return sil::EndReason::kSlipped;
    case sim::PhysicsEnd::kDetached:
      return sil::EndReason::kDetached;
    case sim::PhysicsEnd::kInconsistent:
      return sil::EndReason::kInconsistent;
    case sim::PhysicsEnd::kNone:
      break;
  }
  return sil::EndReason::kCompleted;
}

bool monitor_trips(const sim::Scenario& scenario, const sil::RunResult& result) {
  return result.extrema.normal_force_min.value <= scenario.envelope.min_normal_force_n ||
         result.extrema.mu_required_max.value >
             scenario.envelope.friction_use * scenario.belief().surface.static_friction;
}

// A run as `ballast run` makes it. nullopt: it could not go to its end.
std::optional<sil::RunResult> run_ticks(const Spec& spec, const sim::Scenario& scenario, int& exit_status,
                                        std::string& why) {
  const bool has_controller = sim::has_controller(scenario.run.actuation);
  auto params = std::make_unique<firmware::ControllerParams>();
  if (has_controller) {
    if (const auto refusal = program::to_controller_params(scenario, *params)) {
      exit_status = program::kExitUsage;
      why = *refusal;
      return std::nullopt;
    }
  }
  const auto peers =
      sil::peers_in_process(scenario, has_controller ? params.get() : nullptr, program::to_monitor_limits(scenario));
  sil::NoRecord nothing;
  sil::RunOptions options;
  options.predict_belief = std::any_of(spec.keep.begin(), spec.keep.end(),
                                       [](const std::string& name) { return name.starts_with("belief."); });
  sil::RunResult result = sil::run_with_faults(scenario, *peers, nothing, options);
  if (result.status != hal::Status::kOk) {
    exit_status = program::kExitCouldNotRun;
    why = result.trouble;
    return std::nullopt;
  }
  exit_status = sil::exit_status(result);
  return result;
}

}  // namespace

sil::RunResult run_plant(const sim::Scenario& scenario) {
  sim::Plant plant(scenario);
  plant.advance(scenario.duration_s, {});
  sil::RunResult result;
  result.end_reason = reason_of(plant.end());
  result.end_text = plant.end_text();
  result.final_sample = plant.sample();
  result.rolling_lost = plant.rolling_lost();
  result.regimes = plant.regimes();
  result.extrema = plant.extrema();
  return result;
}

bool plant_suffices(const Spec& spec, const RowScenarios& scenarios, const sim::Scenario& scenario) {
  return scenario.run.actuation == sim::Actuation::kPrescribed &&
         scenario.run.on_violation == sim::OnViolation::kStop && scenario.faults.empty() &&
         !scenario.initial.has_velocity && scenario.initial.height_m == 0 &&
         decided_by_plant(spec.keep, scenarios.find("plan") != nullptr);
}

RowResult run_row(const Spec& spec, const RowScenarios& scenarios, const Row& row, std::string* why) {
  RowResult out;
  out.number = row.number;
  out.seed = row.seed;
  for (const sim::Node& value : row.values) out.varied.push_back(to_cell(value));
  out.kept.resize(spec.keep.size());
  std::string reason;
  const sim::ScenarioResult read = scenarios.make(row);
  if (!read.ok()) {
    out.exit_status = program::kExitUsage;
    reason = sim::to_string(read.errors.front());
  } else if (plant_suffices(spec, scenarios, read.scenario)) {
    const sil::RunResult result = run_plant(read.scenario);
    out.kept = kept_plant_values(spec.keep, read.scenario, result);
    const bool held = sil::exit_status(result) == program::kExitCompleted && !monitor_trips(read.scenario, result);
    out.exit_status = held ? program::kExitCompleted : program::kExitEnvelope;
  } else if (const auto result = run_ticks(spec, read.scenario, out.exit_status, reason)) {
    out.kept = kept_values(spec.keep, read.scenario, *result);
  }
  if (why != nullptr) *why = reason;
  return out;
}

}  // namespace ballast::sweep
