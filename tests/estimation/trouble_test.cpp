// The filter with sensors that are broken, missing or moved.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/estimation/study.h"
#include "tests/random_seed.h"

namespace ballast::test {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t kFrom = 2000, kTo = 2500;  // ticks of trouble; the run has 10,000

const RecordedRun& desk_ball() {
  static const RecordedRun run = record("desk_ball", {});
  return run;
}

using Disturb = std::function<void(std::int64_t tick, firmware::Sensors&)>;

struct Seen {
  double tilt_before = 0, tilt_after = 0;              // greatest errors, rad
  double tilt_sigma_before = 0, tilt_sigma_after = 0;  // just before the trouble, and greatest from then on
  double place_at_end_m = 0, place_sigma_at_end_m = 0;
  bool within_band = true;  // of four sigma, tilt and place, always
};

void expect_bounded(const FilteredTick& tick) {
  const firmware::Estimate& e = tick.estimate;
  ASSERT_NEAR(e.orientation.norm(), 1, 1e-12) << tick.truth.tick;
  ASSERT_LE(e.angular_velocity_B_radps.norm(), 200) << tick.truth.tick;
  ASSERT_LE(e.gyro_bias_B_radps.norm(), 1) << tick.truth.tick;
  ASSERT_LE(e.position_W_m.norm(), 1e3) << tick.truth.tick;
  for (const double sigma : {e.tilt_sigma_rad, e.yaw_sigma_rad, e.gyro_bias_sigma_radps, e.position_sigma_m}) {
    ASSERT_GE(sigma, 0) << tick.truth.tick;
    ASSERT_LE(sigma, 1e6) << tick.truth.tick;
  }
  for (std::size_t i = 0; i < firmware::estimation::kErrors; ++i) {
    ASSERT_GE(tick.state.covariance.xx[i][i], 0) << tick.truth.tick;
  }
}

Seen run_with(const Disturb& disturb, const sim::SensorModel& model = desk_ball().scenario.sensors) {
  static const std::uint64_t seed = random_seed(11);
  Seen seen;
  filter(
      desk_ball(), model, seed,
      [&](const FilteredTick& tick) {
        ASSERT_NO_FATAL_FAILURE(expect_bounded(tick));
        if (tick.truth.tick < 0) return;
        const double tilt = tilt_error_rad(tick), place = place_error_m(tick);
        const firmware::Estimate& e = tick.estimate;
        double& most = tick.truth.tick < kFrom ? seen.tilt_before : seen.tilt_after;
        most = std::max(most, tilt);
        if (tick.truth.tick < kFrom) seen.tilt_sigma_before = e.tilt_sigma_rad;
        if (tick.truth.tick >= kFrom) seen.tilt_sigma_after = std::max(seen.tilt_sigma_after, e.tilt_sigma_rad);
        // A floor for the first ticks, in which the place is known exactly.
        if (tilt > 4 * e.tilt_sigma_rad || place > 4 * e.position_sigma_m + 1e-4) seen.within_band = false;
        seen.place_at_end_m = place;
        seen.place_sigma_at_end_m = e.position_sigma_m;
      },
      disturb);
  return seen;
}

Disturb between(const std::function<void(firmware::Sensors&)>& change) {
  return [change](std::int64_t tick, firmware::Sensors& sensors) {
    if (tick >= kFrom && tick < kTo) change(sensors);
  };
}

TEST(AttitudeFilterTrouble, NoneIsTheReference) {
  const Seen seen = run_with({});
  EXPECT_LE(seen.tilt_after, 1 * kDegree);
  EXPECT_TRUE(seen.within_band);
}

// Half a second without a gyro: the model rolls on, and half of 2 % of g / r in half a second squared is 0.16 rad.
TEST(AttitudeFilterTrouble, NanOfTheGyro) {
  const Seen seen = run_with(between([](firmware::Sensors& s) { s.gyro_B_radps[1] = kNan; }));
  EXPECT_TRUE(seen.within_band);
  EXPECT_GE(seen.tilt_sigma_after, 0.1);
  EXPECT_LE(seen.tilt_after, 0.3);
}

// The gyro alone holds the tilt: half a second adds next to nothing.
TEST(AttitudeFilterTrouble, NanOfTheAccelerometer) {
  const Seen seen = run_with(between([](firmware::Sensors& s) { s.accelerometer_B_mps2.setConstant(kNan); }));
  EXPECT_TRUE(seen.within_band);
  EXPECT_LE(seen.tilt_after, 1 * kDegree);
}

TEST(AttitudeFilterTrouble, SamplesStayAway) {
  firmware::Sensors last;
  const Seen seen = run_with([&](std::int64_t tick, firmware::Sensors& sensors) {
    if (tick < kFrom) last = sensors;
    if (tick >= kFrom && tick < kTo) sensors = last;
  });
  EXPECT_TRUE(seen.within_band);
  EXPECT_GE(seen.tilt_sigma_after, 0.1);
  EXPECT_LE(seen.tilt_after, 0.3);
}

// For good: the tilt is lost, and the band says so.
TEST(AttitudeFilterTrouble, SamplesStayAwayForGood) {
  firmware::Sensors last;
  const Seen seen = run_with([&](std::int64_t tick, firmware::Sensors& sensors) {
    (tick < kFrom ? last : sensors) = tick < kFrom ? sensors : last;
  });
  EXPECT_TRUE(seen.within_band);
  EXPECT_GE(seen.tilt_sigma_after, 1);
  EXPECT_GE(seen.place_sigma_at_end_m, 0.15);
}

// The count grows and the values of one triad do not change.
Disturb frozen(firmware::Vector3 firmware::Sensors::*triad, std::int64_t to = kTo) {
  return [triad, to, last = firmware::Vector3(firmware::Vector3::Zero())](std::int64_t tick,
                                                                          firmware::Sensors& sensors) mutable {
    if (tick < kFrom) last = sensors.*triad;
    if (tick >= kFrom && tick < to) sensors.*triad = last;
  };
}

// Stuck after ten repetitions.
TEST(AttitudeFilterTrouble, FrozenValues) {
  for (const bool gyro : {true, false}) {
    SCOPED_TRACE(gyro ? "gyro" : "accelerometer");
    const Seen seen =
        run_with(frozen(gyro ? &firmware::Sensors::gyro_B_radps : &firmware::Sensors::accelerometer_B_mps2));
    EXPECT_TRUE(seen.within_band);
    EXPECT_LE(seen.tilt_after, gyro ? 0.3 : 1 * kDegree);
    if (gyro) {
      EXPECT_GE(seen.tilt_sigma_after, 0.1);
    }
  }
}

// Fixes while the gyro is frozen, for half a second and for good. The travel since a late fix is then the model's:
// taken for the gyro's, its error is found as a tilt, of 3 rad in some runs. When the gyro is back, a fix corrects the
// tilt by a large angle in the middle of a window, whose sums have to turn with it.
TEST(AttitudeFilterTrouble, FrozenGyroWithFixes) {
  // `most_rad`: without the gyro the tilt is the model's and what the fixes tell of it. The greatest of 40 seeds is
  // 0.12 with fixes 0.1 s old, whose travel counts for little, and 0.58 with those 0.02 s old.
  for (const auto& [delay_s, most_rad] : {std::pair(0.1, 0.3), std::pair(0.02, 1.0)}) {
    SCOPED_TRACE(delay_s);
    sim::SensorModel model = desk_ball().scenario.sensors;
    model.fix = {.rate_hz = 10, .noise_m = 0.005, .delay_s = delay_s};
    const Seen for_a_time = run_with(frozen(&firmware::Sensors::gyro_B_radps), model);
    EXPECT_TRUE(for_a_time.within_band);
    EXPECT_LE(for_a_time.tilt_after, 0.3);
    EXPECT_LE(for_a_time.place_at_end_m, 0.01);
    constexpr std::int64_t kForGood = std::numeric_limits<std::int64_t>::max();
    const Seen for_good = run_with(frozen(&firmware::Sensors::gyro_B_radps, kForGood), model);
    EXPECT_TRUE(for_good.within_band);
    EXPECT_LE(for_good.tilt_after, most_rad);
  }
}

// One sample in 50, of 10 rad/s and of 3 g.
TEST(AttitudeFilterTrouble, Spikes) {
  const Seen seen = run_with([](std::int64_t tick, firmware::Sensors& sensors) {
    if (tick >= kFrom && tick < kTo && tick % 50 == 0) {
      sensors.gyro_B_radps[0] += 10;
      sensors.accelerometer_B_mps2[1] -= 30;
    }
  });
  EXPECT_TRUE(seen.within_band);
  EXPECT_LE(seen.tilt_after, 1 * kDegree);
}

// A gyro that sees 0.3 rad/s at most, of 1.3 the ball has, and an accelerometer that sees 0.8 g.
TEST(AttitudeFilterTrouble, Saturation) {
  const auto clip = [](Eigen::Vector3d& v, double most) { v = v.cwiseMax(-most).cwiseMin(most); };
  sim::SensorModel model = desk_ball().scenario.sensors;
  model.gyro.range = 0.3;
  const Seen gyro = run_with(
      [&](std::int64_t, firmware::Sensors& s) {
        Eigen::Vector3d clipped = s.gyro_B_radps;
        clip(clipped, 0.3);
        s.gyro_B_radps = clipped;
      },
      model);
  EXPECT_TRUE(gyro.within_band);
  EXPECT_GE(gyro.tilt_sigma_after, 0.1);
  // The same from outside, of which the filter's parameters know nothing.
  const Seen both = run_with(between([&](firmware::Sensors& s) {
    Eigen::Vector3d clipped = s.accelerometer_B_mps2;
    clip(clipped, 8);
    s.accelerometer_B_mps2 = clipped;
  }));
  EXPECT_TRUE(both.within_band);
  EXPECT_LE(both.tilt_after, 2 * kDegree);
}

// A metre off, no number, and beyond all places: the last would otherwise replace the place after three refusals.
TEST(AttitudeFilterTrouble, FixesFarOff) {
  sim::SensorModel model = desk_ball().scenario.sensors;
  model.fix = {.rate_hz = 10, .noise_m = 0.005, .delay_s = 0.1};
  const Seen seen = run_with(
      [](std::int64_t tick, firmware::Sensors& sensors) {
        if (tick >= kFrom && tick < kFrom + 250) sensors.fix_W_m[0] += 1;
        if (tick >= kFrom + 1000 && tick < kFrom + 1250) sensors.fix_W_m[1] = kNan;
        if (tick >= kFrom + 2000 && tick < kFrom + 3000) sensors.fix_W_m[0] = 1e300;
      },
      model);
  EXPECT_TRUE(seen.within_band);
  EXPECT_LE(seen.place_at_end_m, 0.005);
}

// Messages have no checksum: a wrong count or tick is one bad sample, and not the end of all.
TEST(AttitudeFilterTrouble, CorruptedCountsAndTicks) {
  constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();
  constexpr std::int64_t kGreatest = std::numeric_limits<std::int64_t>::max();
  std::int64_t first = 0;
  const Seen seen = run_with([&](std::int64_t tick, firmware::Sensors& sensors) {
    first = std::min(first, tick);
    if (tick < first + 3) sensors.imu_tick = kLeast;
    if (tick == kFrom) sensors.imu_count = kGreatest;
    if (tick == kFrom + 1) sensors.imu_count = kLeast;
    if (tick == kFrom + 100) sensors.imu_tick = kGreatest;
    if (tick == kFrom + 101) sensors.imu_tick = kLeast;
  });
  EXPECT_TRUE(seen.within_band);
  EXPECT_LE(seen.tilt_after, 1 * kDegree);
}

// Without a single sample nothing is valid, and nothing breaks.
TEST(AttitudeFilterTrouble, NoSampleAtAll) {
  filter(
      desk_ball(), desk_ball().scenario.sensors, 1,
      [](const FilteredTick& tick) {
        ASSERT_FALSE(tick.estimate.valid);
        ASSERT_NO_FATAL_FAILURE(expect_bounded(tick));
      },
      [](std::int64_t, firmware::Sensors& sensors) { sensors.imu_count = 0; });
}

// A state that a fault of the memory has made no number of: the filter begins anew and says that it knows nothing.
TEST(AttitudeFilterTrouble, StateThatIsNoNumber) {
  const RecordedRun& run = desk_ball();
  const auto params = estimation_params(run.scenario, run.scenario.sensors);
  const auto state = std::make_unique<firmware::FilterState>();
  for (const int what : {0, 1, 2, 3}) {
    Imu imu(run.scenario.sensors, run.scenario.run.control_period_s, 1);
    firmware::Sensors sensors;
    firmware::Estimate out;
    reset(run.params->ball, params, *state);
    for (std::size_t k = 0; k < 8000; ++k) {
      if (k == 6000) {
        if (what == 0) state->orientation.x() = kNan;
        if (what == 1) state->covariance.xx[2][4] = kNan;
        if (what == 2) state->position_W_m[0] = kNan;
        if (what == 3) state->rate_B_radps[2] = std::numeric_limits<double>::infinity();
      }
      const TrueTick& truth = run.ticks[k];
      imu.read(truth, sensors);
      update(run.params->ball, params, run.scenario.run.control_period_s, sensors, truth.commanded, truth.tick, *state,
             out);
      // Within two windows.
      if (k < 6300 && k >= 6000) continue;
      ASSERT_TRUE(std::isfinite(out.orientation.norm() + out.angular_velocity_B_radps.norm() + out.position_W_m.norm() +
                                out.tilt_sigma_rad + out.position_sigma_m))
          << what << " " << k;
    }
    EXPECT_GE(out.position_sigma_m, 1) << what;
  }
}

// Taken up and turned by 20 degrees in the hold: no rest, and no bias.
TEST(Hold, MovedBallIsNoRest) {
  RecordedRun run = record("desk_ball", {"duration=1"});
  for (TrueTick& tick : run.ticks) {
    if (tick.tick < -2500 || tick.tick >= -2000) continue;
    tick.motion.angular_velocity_B_radps = {0, 0, 40 * kDegree};
  }
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(20 * kDegree, Eigen::Vector3d::UnitZ()));
  filter(run, run.scenario.sensors, 3, [&](const FilteredTick& tick) {
    if (tick.truth.tick != -1) return;
    const Eigen::Vector3d off = tick.imu.gyro_bias() - tick.estimate.gyro_bias_B_radps;
    EXPECT_LE(off.norm(), 0.05 * kDegree);
    const Eigen::AngleAxisd missing(tick.truth.orientation * turn * tick.estimate.orientation.conjugate());
    EXPECT_LE(missing.angle(), 2 * kDegree);
    EXPECT_GE(tick.estimate.yaw_sigma_rad, 0.5 * kDegree);
  });
}

// A slow turn by 0.04 rad in the hold, of which the gyro hears every tenth tick. Those samples alone deny the rest: a
// mean over all ticks would be a tenth of the rate, and look like noise.
TEST(Hold, SlowTurnIsNoRestWhereSamplesAreMissing) {
  RecordedRun run = record("desk_ball", {"duration=1"});
  for (TrueTick& tick : run.ticks) {
    if (tick.tick >= -2500 && tick.tick < -500) tick.motion.angular_velocity_B_radps = {0, 0, 0.02};
  }
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.04, Eigen::Vector3d::UnitZ()));
  filter(
      run, run.scenario.sensors, 3,
      [&](const FilteredTick& tick) {
        if (tick.truth.tick != -1) return;
        // Twelve samples a window of noise 0.0055 rad/s over 2 s leave 0.0008 rad; the window at each end counts half.
        const Eigen::AngleAxisd missing(tick.truth.orientation * turn * tick.estimate.orientation.conjugate());
        EXPECT_LE(missing.angle(), 0.01);
      },
      [](std::int64_t tick, firmware::Sensors& sensors) {
        if (tick >= -2600 && tick < -400 && tick % 10 != 0) sensors.gyro_B_radps.setConstant(kNan);
      });
}

// Without a hold the first samples come with the ball held for two ticks: the tilt is what one sample says, by its
// noise, the accelerometer's bias and its axes. The second sample takes about a hundredth off the band.
TEST(Hold, NoneLeavesABandOfOneSample) {
  const RecordedRun run = record("desk_ball", {"run.hold=0", "duration=4"});
  const sim::SensorModel& sensors = run.scenario.sensors;
  const sim::ImuTriad& part = sensors.accelerometer;
  const double noise = part.noise_density * std::sqrt(sensors.rate_hz / 2);
  const double sigma_rad = std::hypot(noise / 9.81, part.bias / 9.81, part.misalignment_rad);
  double worst = 0;
  filter(run, sensors, 5, [&](const FilteredTick& tick) {
    if (tick.truth.tick < 0) return;
    worst = std::max(worst, tilt_error_rad(tick) / tick.estimate.tilt_sigma_rad);
    if (tick.truth.tick == 0) {
      EXPECT_NEAR(tick.estimate.tilt_sigma_rad, sigma_rad, 0.03 * sigma_rad);
    }
  });
  EXPECT_LE(worst, 5);
}

}  // namespace
}  // namespace ballast::test
