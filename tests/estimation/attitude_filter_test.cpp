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

TEST(AttitudeFilter, DeskBall) {
  const RecordedRun run = record("desk_ball", {});
  std::printf("path %.3f m\n", run.path_m);
  print("desk_ball", study(run, run.scenario.sensors, seeds(20), random_seed(1)));
}

TEST(AttitudeFilter, PaperBall) {
  const RecordedRun run = record("paper_ball", {});
  std::printf("path %.3f m\n", run.path_m);
  print("paper_ball", study(run, run.scenario.sensors, seeds(20), random_seed(1)));
}

}  // namespace
}  // namespace ballast::test
