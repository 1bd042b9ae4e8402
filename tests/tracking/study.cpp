#include "tests/tracking/study.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>

#include "sim/scenario/fingerprint.h"
#include "tools/faults/injection.h"
#include "tools/program/params.h"
#include "tools/sil/lap_sink.h"
#include "tools/sil/local_peers.h"

namespace ballast::tracking_test {

sim::Scenario planned(sim::ScenarioResult read) {
  if (!read.ok()) throw std::runtime_error(sim::to_string(read.errors.front()));
  sim::Scenario scenario = std::move(read.scenario);
  scenario.plan.present = true;
  if (!scenario.plan.start) scenario.plan.start = scenario.initial;
  return scenario;
}

sim::Scenario planned(const std::string& file, const std::vector<std::string>& overrides) {
  return planned(sim::read_scenario(file, overrides));
}

sim::Scenario built(const sim::Scenario& planned, const Disturbance& disturbance, std::mt19937_64& random) {
  std::uniform_real_distribution<double> within(-1, 1);
  sim::Scenario out = planned;
  if (!out.believed) out.believed = static_cast<const sim::World&>(planned);
  double weight_n = 0;
  out.ball.mass_kg *= 1 + disturbance.mass * within(random);
  weight_n += out.ball.mass_kg * out.gravity_mps2;
  for (sim::Mass& mass : out.masses) {
    mass.mass_kg *= 1 + disturbance.mass * within(random);
    weight_n += mass.mass_kg * out.gravity_mps2;
  }
  for (int j = 0; j < 3; ++j) {
    out.ball.center_of_mass_B_m[j] += disturbance.center_of_mass * out.ball.radius_m * within(random);
  }
  const auto direction = [&] { return std::numbers::pi * within(random); };
  const double about = direction();
  const Eigen::Vector3d axis(std::cos(about), std::sin(about), 0);
  out.initial.orientation = Eigen::AngleAxisd(disturbance.tilt_rad, axis) * out.initial.orientation;
  out.surface.slope_rad = disturbance.slope_rad;
  out.surface.downhill_rad = direction();
  out.surface.rolling_resistance = disturbance.rolling_resistance;
  if (disturbance.push > 0) {
    sim::Fault push;
    push.kind = sim::FaultKind::kPush;
    push.time_s = disturbance.push_time_s;
    push.end_s = push.time_s + 0.1;
    push.value = disturbance.push * weight_n;
    const double to = direction();
    push.direction_W = {std::cos(to), std::sin(to), 0};
    out.faults.push_back(push);
  }
  out.seed = static_cast<decltype(out.seed)>(random() >> 32);  // of the sensors' errors
  return out;
}

sil::RunResult run(sim::Scenario scenario, bool tracking) {
  scenario.control.tracking = tracking;
  scenario.id = sim::fingerprint(scenario);
  const auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto why = program::to_controller_params(scenario, *params)) throw std::runtime_error(*why);
  const auto peers = sil::peers_in_process(scenario, params.get(), program::to_monitor_limits(scenario));
  sil::NoRecord nothing;
  sil::RunResult result = sil::run_with_faults(scenario, *peers, nothing, {});
  if (result.status != hal::Status::kOk) throw std::runtime_error(result.trouble);
  return result;
}

double quantile(std::vector<double> values, double part) {
  const auto at = static_cast<std::size_t>(std::ceil(part * static_cast<double>(values.size()))) - 1;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(at), values.end());
  return values[at];
}

}  // namespace ballast::tracking_test
