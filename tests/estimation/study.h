// The filter over many seeds of one recorded run, against the truth.
#pragma once

#include <functional>

#include "tests/estimation/recorded_run.h"

namespace ballast::test {

// Normalised estimation error squared of some states: e^T P^-1 e, the mean over seeds at each sampled time.
struct Consistency {
  int states = 0;
  int seeds = 0;
  std::vector<double> mean;  // per time
  // Share of the times whose mean lies in the two-sided 95 % band of chi-square with states * seeds degrees of freedom,
  // by Wilson and Hilferty's approximation; and the band.
  [[nodiscard]] double inside() const;
  [[nodiscard]] double average() const;
  [[nodiscard]] std::pair<double, double> band() const;
};

struct Study {
  double tilt_rms_rad = 0;  // angle between the true and the estimated vertical, from the first tick of the motion
  double tilt_most_rad = 0;
  double gyro_bias_rms_radps = 0;        // of an axis, at tick 0
  double gyro_bias_most_radps = 0;       // greatest axis of any seed, at tick 0
  double yaw_rms_rad = 0;                // at the end
  double place_rms = 0, place_most = 0;  // at the end, in the length of the path
  double place_rms_m = 0;                // from the first tick of the motion
  Consistency all, tilt, yaw, bias, place;
};

// The filter's estimate of a tick.
struct FilteredTick {
  const TrueTick& truth;
  const Imu& imu;
  const firmware::FilterState& state;
  const firmware::Estimate& estimate;
};

// Runs the filter over a recorded run once. `disturb` may change what the sensors say in a tick; null: nothing does.
void filter(const RecordedRun& run, const sim::SensorModel& model, std::uint64_t seed,
            const std::function<void(const FilteredTick&)>& look,
            const std::function<void(std::int64_t tick, firmware::Sensors&)>& disturb = {});

// Angle between the true and the estimated vertical.
double tilt_error_rad(const FilteredTick& tick);
// Distance of the true place from the estimated one.
double place_error_m(const FilteredTick& tick);

Study study(const RecordedRun& run, const sim::SensorModel& model, int seeds, std::uint64_t first_seed);

}  // namespace ballast::test
