// How a run finds the friction that it needs.
#include "tools/summary/friction_run.h"

#include <fmt/core.h>

#include <memory>
#include <optional>
#include <utility>

#include "sim/plant/local_floor.h"
#include "tools/program/params.h"
#include "tools/program/short_number.h"
#include "tools/sil/local_peers.h"
#include "tools/summary/required_friction.h"
#include "tools/summary/summary.h"

namespace ballast::sil {

namespace {

// Finds the first tick in which the ball, rolling on perfect friction, is on a patch of the real floor that holds less.
class PatchWatch {
 public:
  explicit PatchWatch(const sim::Surface& real) : floor_(real) {}

  void observe(const sim::Plant::Sample& truth) {
    if (!floor_.has_borders() || slips_ || truth.time_s < 0 || truth.regime != sim::Regime::kRolling) return;
    const Eigen::Vector2d place_W_m = truth.position_W_m.head<2>();
    floor_.stand_at(place_W_m);
    if (truth.static_friction_n <= floor_.static_friction() * truth.normal_force_n) return;
    slips_ = Slip{truth.time_s, place_W_m, floor_.static_friction(), truth.static_friction_n / truth.normal_force_n};
  }

  // Empty for a floor without patches.
  [[nodiscard]] std::string text() const {
    using program::short_number;
    if (!floor_.has_borders()) return "";
    if (!slips_) return "  on its own floor, with patches, it holds in every tick\n";
    return fmt::format(
        "  on its own floor, with patches, it slips at t = {} s at ({}, {}) m, where f_s/N = {} and mu_s = {}\n",
        program::short_time(slips_->time_s), short_number(slips_->place_W_m[0]), short_number(slips_->place_W_m[1]),
        short_number(slips_->needed), short_number(slips_->given));
  }

 private:
  struct Slip {
    double time_s;
    Eigen::Vector2d place_W_m;
    double given, needed;
  };

  sim::LocalFloor floor_;
  std::optional<Slip> slips_;
};

}  // namespace

FrictionRun run_for_friction(sim::Scenario scenario, const volatile std::sig_atomic_t* interrupted,
                             std::function<void(double time_s, double end_s)> progress) {
  FrictionRun run;
  if (!scenario.faults.empty()) {
    run.refusal = to_string(scenario.faults.front()) +
                  ": not with ballast friction, which examines a robot without faults; allowed: ballast run";
    return run;
  }
  PatchWatch patches(scenario.surface);
  // Perfect friction keeps the ball rolling to the end; on the scenario's own floor the run might end earlier.
  scenario.surface.hold_everything();
  if (scenario.believed) scenario.believed->surface.hold_everything();
  scenario.envelope.min_normal_force_n = 0;
  scenario.control.governor = false;                   // the motion's own need
  std::unique_ptr<firmware::ControllerParams> params;  // null: there is no controller
  if (sim::has_controller(scenario.run.actuation)) {
    params = std::make_unique<firmware::ControllerParams>();
    if (const auto refusal = program::to_controller_params(scenario, *params)) {
      run.refusal = *refusal;
      return run;
    }
  }
  InProcessPeers peers(params.get(), program::to_monitor_limits(scenario), scenario.run.control_period_s);
  NoRecord nowhere;
  const auto observe = [&patches](const Lap&, const sim::Plant::Sample& truth) { patches.observe(truth); };
  run.result = sil::run(scenario, peers, nowhere,
                        {.interrupted = interrupted, .progress = std::move(progress), .observe = observe, .move = {}});
  run.patches_text = patches.text();
  run.scenario = std::move(scenario);
  return run;
}

std::string friction_run_text(const FrictionRun& run) {
  std::string text = fmt::format("{}, {} masses: {}\n{}{}", run.scenario.name, masses_word(run.scenario.run.actuation),
                                 required_friction_text(run.result, floor_verdicts(run.scenario, run.result)),
                                 friction_parts_text(run.result), run.patches_text);
  if (run.result.end_reason == EndReason::kInconsistent) text += "  up to its end: " + run.result.end_text + "\n";
  if (const std::string lost = lost_steps_text(run.scenario, run.result); !lost.empty())
    text += "  WARNING: " + lost + "\n";
  return text;
}

}  // namespace ballast::sil
