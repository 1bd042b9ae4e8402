// ballast friction: how much friction a scenario needs, when, and which mass causes it.
#include <fmt/core.h>

#include <iostream>
#include <memory>
#include <optional>

#include "sim/plant/local_floor.h"
#include "tools/ballast/commands.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/program/short_number.h"
#include "tools/sil/local_peers.h"
#include "tools/sil/run.h"
#include "tools/summary/required_friction.h"

namespace ballast {

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

int print_required_friction(const program::ScenarioOptions& options) {
  auto scenario = program::load_scenario(options);
  if (!scenario) return program::kExitUsage;
  if (!scenario->faults.empty()) {
    return refuse(to_string(scenario->faults.front()) +
                  ": not with ballast friction, which examines a robot without faults; allowed: ballast run");
  }
  const bool has_controller = sim::has_controller(scenario->run.actuation);
  PatchWatch patches(scenario->surface);
  // Perfect friction keeps the ball rolling to the end; on the scenario's own floor the run might end earlier.
  scenario->surface.hold_everything();
  if (scenario->believed) scenario->believed->surface.hold_everything();
  scenario->envelope.min_normal_force_n = 0;
  std::unique_ptr<firmware::ControllerParams> params;  // null: there is no controller
  if (has_controller) {
    params = program::make_controller_params("ballast", *scenario);
    if (!params) return program::kExitUsage;
  }
  sil::InProcessPeers peers(params.get(), program::to_monitor_limits(*scenario), scenario->run.control_period_s);
  sil::NoRecord nowhere;
  const auto observe = [&patches](const sil::Lap&, const sim::Plant::Sample& truth) { patches.observe(truth); };
  const sil::RunResult result =
      sil::run(*scenario, peers, nowhere,
               {.interrupted = program::catch_signals(), .progress = {}, .observe = observe, .move = {}});
  if (result.status != hal::Status::kOk) return could_not(result.trouble);
  std::cout << fmt::format("{}, {} masses: {}\n{}", scenario->name, masses_word(scenario->run.actuation),
                           sil::required_friction_text(result, sil::floor_verdicts(*scenario, result)),
                           sil::friction_parts_text(result))
            << patches.text();
  if (result.end_reason == sil::EndReason::kInconsistent) std::cout << "  up to its end: " << result.end_text << '\n';
  if (const std::string lost = sil::lost_steps_text(*scenario, result); !lost.empty()) {
    std::cout << "  WARNING: " << lost << '\n';
  }
  return sil::exit_status(result);
}

}  // namespace

std::function<int()> add_friction_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("friction", "Prints how much friction a scenario needs, when, and which mass causes it");
  auto options = std::make_shared<program::ScenarioOptions>();
  program::add_scenario_options(*command, *options);
  command->get_option("--fault")->group("");  // hidden in the help; refused with a reason
  return [options] { return print_required_friction(*options); };
}

}  // namespace ballast
