// contact_study force | holds FROM TO [KIND]... | slides FROM TO [KIND]...: the figures of
// tools/docs/measured_contact.md, from random runs of desk_ball numbered FROM to TO - 1. KIND: `excited`, `tracked`,
// and `wrong=PART`, a robot whose masses and inertias are off by up to PART, its centre of mass by 0.5 % of the radius,
// on a floor whose resistance of up to 0.002 nobody believes. Built on request only.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string_view>

#include "tests/estimation/contact_run.h"

namespace ballast::test {
namespace {

void forces(const char* name, const std::vector<std::string>& more) {
  constexpr int kSeeds = 10;
  FrictionErrors all;
  all.inside = all.inside_now = 1;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    std::vector<std::string> set{"sensors.preset=bmi088_calibrated", "sensors.attitude=sensed", "run.hold=5",
                                 "seed=" + std::to_string(seed)};
    set.insert(set.end(), more.begin(), more.end());
    const FrictionErrors errors = friction_errors(record_contact("desk_ball", set));
    all.rms += errors.rms * errors.rms / kSeeds;
    for (std::size_t k = 0; k < errors.band_rms.size(); ++k) {
      all.band_rms[k] += errors.band_rms[k] * errors.band_rms[k] / kSeeds;
    }
    all.most = std::max(all.most, errors.most);
    all.true_most = std::max(all.true_most, errors.true_most);
    all.inside = std::min(all.inside, errors.inside);
    all.inside_now = std::min(all.inside_now, errors.inside_now);
  }
  fmt::print("{:24} true to {:.3f}: rms {:.4f}, most {:.3f}; bands", name, all.true_most, std::sqrt(all.rms), all.most);
  for (const double square : all.band_rms) fmt::print(" {:.4f}", std::sqrt(square));
  fmt::print("; inside, least of the seeds {:.3f}, with its age {:.3f}\n", all.inside, all.inside_now);
}

bool set_kind(std::string_view word, DeskBall& kind) {
  constexpr std::string_view kWrong = "wrong=";
  if (word == "excited") {
    kind.excited = true;
  } else if (word == "tracked") {
    kind.tracked = true;
  } else if (word.starts_with(kWrong)) {
    kind.errors = {std::strtod(word.data() + kWrong.size(), nullptr), 0.005, 0.002};
  } else {
    return false;
  }
  return true;
}

void runs(const DeskBall& kind, std::uint64_t from, std::uint64_t to) {
  int slides = 0, in_time = 0, alarms = 0;
  double score = 0;
  for (std::uint64_t seed = from; seed < to; ++seed) {
    const SlideCount count = count_slides(random_desk_ball(seed, kind));
    slides += count.slides;
    in_time += count.in_time;
    alarms += count.false_flag ? 1 : 0;
    score = std::max(score, count.score);
    if (count.in_time < count.slides) {
      fmt::print("run {}: missed, 0.05 m/s after {:.2f} s\n", seed, count.slowest_missed_s);
    }
    if (count.false_flag) fmt::print("run {}: a false flag\n", seed);
  }
  fmt::print("{} runs: {} slides, {} flagged in time; {} runs with a false flag; greatest unconfirmed score {:.2f}\n",
             to - from, slides, in_time, alarms, score);
}

}  // namespace
}  // namespace ballast::test

int main(int argc, char** argv) {
  using namespace ballast::test;
  const std::string_view what = argc > 1 ? argv[1] : "";
  if (what == "force") {
    forces("ideal masses", {"run.actuation=ideal"});
    forces("steppers", {});
    forces("encoders 1.5 mrad", {"sensors.encoder.resolution=0.0015"});
    forces("encoders 0.1 mrad", {"sensors.encoder.resolution=0.0001"});
    forces("encoders 0.01 mrad", {"sensors.encoder.resolution=0.00001"});
    forces("4 ms late", {"sensors.latency=0.004"});
    forces("500 Hz", {"sensors.rate=500"});
    forces("500 Hz, 4 ms late", {"sensors.rate=500", "sensors.latency=0.004"});
    forces("200 Hz", {"sensors.rate=200"});
    return 0;
  }
  if ((what != "holds" && what != "slides") || argc < 4) return 2;
  DeskBall kind;
  kind.falls = what == "slides";
  for (int i = 4; i < argc; ++i) {
    if (!set_kind(argv[i], kind)) return 2;
  }
  runs(kind, std::strtoull(argv[2], nullptr, 10), std::strtoull(argv[3], nullptr, 10));
  return 0;
}
