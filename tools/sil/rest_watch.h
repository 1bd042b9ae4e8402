// Tells whether the masses rest: for one swing of the slowest motor no mass has moved faster than a twentieth of the
// fastest mass's top speed in this run. (A load that still shifts as the ball rolls on keeps a held mass moving a
// little.)
#pragma once

#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"

namespace ballast::sil {

class RestWatch {
 public:
  // The scenario must outlive the watch.
  explicit RestWatch(const sim::Scenario& scenario);
  void observe(const sim::Plant::Sample& sample);
  [[nodiscard]] bool at_rest() const { return at_rest_; }
  [[nodiscard]] double swing_s() const { return swing_s_; }  // period of the slowest motor's swing

 private:
  const sim::Scenario& scenario_;
  double swing_s_ = 0;
  double top_mps_ = 0;
  double moved_s_ = 0;
  bool at_rest_ = false;
};

}  // namespace ballast::sil
