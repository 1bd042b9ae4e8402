// Measures how far the ball is from the place that its plan says.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "tools/tracking/followed_plan.h"

namespace ballast::sil {

// Distances of the true geometric centre over the ticks from 0 to the end, in the floor.
struct TrackingRecord {
  double rms_m = 0, max_m = 0, final_m = 0;  // from the plan's place at the same time
  double cross_track_rms_m = 0;              // from the nearest point of the plan's path
  double path_length_m = 0;                  // of the plan
  double delay_s = 0;                        // the motion's time at the end is behind by this
};

class TrackingWatch {
 public:
  explicit TrackingWatch(plan::PlannedPath path) : path_(std::move(path)) {}

  void observe(double time_s, const Eigen::Vector2d& place_W_m) {
    const double off = (place_W_m - path_.place_at(time_s)).norm(), aside = path_.distance_m(place_W_m);
    sum_square_ += off * off;
    cross_square_ += aside * aside;
    ++ticks_;
    max_ = std::max(max_, off);
    final_ = off;
  }
  // `delay_s`: of the motion's time, by the controller's newest status.
  void wait(double delay_s) { delay_s_ = delay_s; }
  [[nodiscard]] TrackingRecord record() const {
    const auto ticks = static_cast<double>(std::max<std::int64_t>(ticks_, 1));
    return {std::sqrt(sum_square_ / ticks), max_, final_, std::sqrt(cross_square_ / ticks), path_.length_m(), delay_s_};
  }

 private:
  plan::PlannedPath path_;
  double sum_square_ = 0, cross_square_ = 0, max_ = 0, final_ = 0, delay_s_ = 0;
  std::int64_t ticks_ = 0;
};

}  // namespace ballast::sil
