// The accuracy that run.tolerance gives: whole runs of six shipped robots against steps at 1e-13. Left out are `hop`
// and `paper_detach_flight`, which leave the floor (a tick that holds an impact has no accuracy of this kind), and
// `tumbleweed`, whose mass has no motor. Where a tick is one step at both tolerances, the two runs are the same.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tools/program/params.h"
#include "tools/sil/local_peers.h"
#include "tools/sil/run.h"

namespace ballast::sil {
namespace {

struct Forces {
  double normal_n, static_friction_n;
};

class KeepForces final : public LapSink {
 public:
  void take(const Lap& lap) override {
    forces.push_back({lap.plant.contact.normal_force_n, lap.plant.contact.static_friction_n});
  }
  [[nodiscard]] bool good() const override { return true; }
  [[nodiscard]] const std::string& error() const override { return error_; }
  [[nodiscard]] std::int64_t bytes() const override { return 0; }

  std::vector<Forces> forces;

 private:
  std::string error_;
};

struct Outcome {
  RunResult result;
  std::vector<Forces> forces;
  double weight_n;
};

Outcome roll(const std::string& name, std::vector<std::string> overrides) {
  overrides.emplace_back("run.actuation=stepper");
  const auto read = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + name + ".toml", overrides);
  EXPECT_TRUE(read.ok());
  const sim::Scenario& scenario = read.scenario;
  auto params = std::make_unique<firmware::ControllerParams>();
  EXPECT_FALSE(program::to_controller_params(scenario, *params));
  InProcessPeers peers(params.get(), program::to_monitor_limits(scenario), scenario.run.control_period_s);
  KeepForces sink;
  Outcome out{run(scenario, peers, sink, {}), {}, scenario.ball.mass_kg * scenario.gravity_mps2};
  EXPECT_EQ(out.result.status, hal::Status::kOk) << out.result.trouble;
  out.forces = std::move(sink.forces);
  for (const sim::Mass& mass : scenario.masses) out.weight_n += mass.mass_kg * scenario.gravity_mps2;
  return out;
}

TEST(Tolerance, ForcesAreGoodToAHundredMillionthOfTheWeight) {
  for (const char* name : {"desk_ball", "paper_ball", "seam_ball", "paper_disk", "paper_detach", "slide_to_roll"}) {
    SCOPED_TRACE(name);
    const Outcome found = roll(name, {}), exact = roll(name, {"run.tolerance=1e-13"});
    ASSERT_EQ(found.forces.size(), exact.forces.size());
    EXPECT_EQ(found.result.end_reason, exact.result.end_reason);
    EXPECT_EQ(found.result.final_sample.lost_steps, exact.result.final_sample.lost_steps);
    double worst = 0;
    for (std::size_t k = 0; k < found.forces.size(); ++k) {
      worst =
          std::max({worst, std::abs(found.forces[k].normal_n - exact.forces[k].normal_n) / found.weight_n,
                    std::abs(found.forces[k].static_friction_n - exact.forces[k].static_friction_n) / found.weight_n});
    }
    RecordProperty(std::string(name) + "_part_of_weight", std::to_string(1e12 * worst) + "e-12");
    EXPECT_LT(worst, 1e-8);
    const double mu = exact.result.extrema.mu_required_max.value;
    if (std::isfinite(mu)) {
      EXPECT_NEAR(found.result.extrema.mu_required_max.value, mu, 1e-8);
    } else {
      EXPECT_EQ(found.result.extrema.mu_required_max.value, mu);
    }
  }
}

}  // namespace
}  // namespace ballast::sil
