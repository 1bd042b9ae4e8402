#include "tests/identify/study.h"

#include <stdexcept>
#include <utility>

#include "sim/scenario/fingerprint.h"
#include "tools/ballast/stepper_run.h"

namespace ballast::identify_test {

sim::Scenario built(const sim::Scenario& nominal, const Errors& errors, std::mt19937_64& random) {
  std::uniform_real_distribution<double> within(-1, 1);
  sim::Scenario out = nominal;
  if (!out.believed) out.believed = static_cast<const sim::World&>(nominal);
  out.belief_is_written = true;
  out.ball.mass_kg *= 1 + errors.mass * within(random);
  for (sim::Mass& mass : out.masses) mass.mass_kg *= 1 + errors.mass * within(random);
  for (int j = 0; j < 3; ++j) {
    out.ball.inertia_kgm2[j] *= 1 + errors.inertia * within(random);
    out.ball.center_of_mass_B_m[j] += errors.center_of_mass * out.ball.radius_m * within(random);
  }
  out.surface.rolling_resistance += errors.rolling_resistance * (1 + within(random)) / 2;
  out.seed = static_cast<decltype(out.seed)>(random() >> 32);
  out.id = sim::fingerprint(out);
  return out;
}

sim::Scenario believing(sim::Scenario scenario, const identify::Parameters& parameters, const Eigen::VectorXd& values) {
  sim::World& belief = *scenario.believed;
  belief.ball.mass_kg = parameters.shell_mass_kg(values);
  belief.ball.center_of_mass_B_m = values.segment<3>(parameters.center_of_mass());
  belief.ball.inertia_kgm2 = values.segment<3>(parameters.inertia());
  belief.surface.rolling_resistance = values[parameters.rolling_resistance()];
  for (int i = 0; i < parameters.masses(); ++i) belief.masses[static_cast<std::size_t>(i)].mass_kg = values[i];
  scenario.id = sim::fingerprint(scenario);
  return scenario;
}

Recorded record(const sim::Scenario& scenario) {
  identify::Known known;
  if (const std::string why = identify::know(scenario, known); !why.empty()) throw std::runtime_error(why);
  identify::Collector collector(known);
  SteppedRun run = run_with_steppers(
      scenario, [] { return false; },
      [&](const sil::Lap& lap, const sim::Plant::Sample&) {
        collector.take(lap.plant.sensors);
        if (lap.answer) collector.take(lap.answer->status);
      });
  if (!run.result) throw std::runtime_error(run.refusal);
  identify::Recording recording = std::move(collector).finish();
  recording.name = scenario.name;
  return {std::move(recording), std::move(*run.result)};
}

Eigen::VectorXd truth(const identify::Parameters& parameters, const sim::Scenario& scenario) {
  Eigen::VectorXd out(parameters.count());
  for (int i = 0; i < parameters.masses(); ++i) out[i] = scenario.masses[static_cast<std::size_t>(i)].mass_kg;
  out.segment<3>(parameters.center_of_mass()) = scenario.ball.center_of_mass_B_m;
  out.segment<3>(parameters.inertia()) = scenario.ball.inertia_kgm2;
  out[parameters.rolling_resistance()] = scenario.surface.rolling_resistance;
  return out;
}

}  // namespace ballast::identify_test
