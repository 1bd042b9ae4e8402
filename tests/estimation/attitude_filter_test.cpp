#include <gtest/gtest.h>

#include <cstdlib>
#include <numbers>

#include "tests/estimation/study.h"
#include "tests/random_seed.h"

namespace ballast::test {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

int seeds(int usual) {
  const char* given = std::getenv("BALLAST_SEEDS");
  return given != nullptr ? std::atoi(given) : usual;
}

void print(const char* name, const Study& s) {
  std::printf(
      "%s: tilt rms %.3f most %.3f deg; bias rms %.4f most %.4f deg/s; yaw %.3f deg; place rms %.3f most %.3f %%\n",
      name, s.tilt_rms_rad / kDegree, s.tilt_most_rad / kDegree, s.gyro_bias_rms_radps / kDegree,
      s.gyro_bias_most_radps / kDegree, s.yaw_rms_rad / kDegree, 100 * s.place_rms, 100 * s.place_most);
  for (const auto& [what, c] :
       {std::pair{"all", &s.all}, {"tilt", &s.tilt}, {"yaw", &s.yaw}, {"bias", &s.bias}, {"place", &s.place}}) {
    const auto [low, high] = c->band();
    std::printf("  NEES %-5s average %.3f band %.3f..%.3f inside %.2f:", what, c->average(), low, high, c->inside());
    for (const double value : c->mean) std::printf(" %.2f", value);
    std::printf("\n");
  }
}

sim::SensorModel with_fix(sim::SensorModel model) {
  model.fix = {.rate_hz = 10, .noise_m = 0.005, .delay_s = 0.1};
  return model;
}
sim::SensorModel changed(sim::SensorModel model, double rate, double latency) {
  model.rate_hz = rate;
  model.latency_s = latency;
  model.accelerometer_position_B_m = {0.03, -0.02, 0.05};
  return model;
}
TEST(AttitudeFilter, Explore) {
  for (const char* name : {"desk_ball", "paper_ball"}) {
    for (const auto& more : std::vector<std::vector<std::string>>{{}, {"mass.1.motion=[{duration=1.6,acceleration=[0.0,0.8]},{duration=1.6,acceleration=[0.8,0.0]},{duration=1.6,acceleration=[0.0,-0.8]},{duration=3.2,acceleration=[-0.8,0.0]}]","mass.2.motion=[{duration=1.0,acceleration=[0.0,-0.4]},{duration=2.0,acceleration=[-0.4,0.4]},{duration=1.0,acceleration=[0.4,0.0]}]"}, {"surface.slope={angle=0.03,downhill=0.5}"}}) {
    if (name[0] == 'p' && !more.empty()) continue;
    const RecordedRun run = record(name, more);
    const auto& m = run.scenario.sensors;
    std::printf("path %.3f m\n", run.path_m);
    print((std::string(name)+(more.empty()?"":more[0])).c_str(), study(run, m, seeds(20), random_seed(1)));
    if (!more.empty()) continue;
    print("fix", study(run, with_fix(m), seeds(20), random_seed(1)));
    print("off centre", study(run, changed(m, 1000, 0), seeds(20), random_seed(1)));
    print("200 Hz", study(run, changed(m, 200, 0), seeds(20), random_seed(1)));
    print("100 Hz", study(run, changed(m, 100, 0), seeds(20), random_seed(1)));
    print("5 ms late", study(run, changed(m, 1000, 0.005), seeds(20), random_seed(1)));
    }
  }
}

}  // namespace
}  // namespace ballast::test
