// The motion of the believed robot: the believed world is rolled beside the true one, under the masses' commanded
// motion.
#pragma once

#include <cstdint>
#include <vector>

#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"
#include "tools/sil/run_result.h"

namespace ballast::sil {

class BeliefWatch {
 public:
  // The scenario has a belief.
  explicit BeliefWatch(const sim::Scenario& scenario);

  // Before the true plant's tick: the status that asked for the motion of the masses at the tick's start, and the one
  // that asks for it at its end. Without both the prediction ends here. Prescribed masses need neither.
  void begin_tick(const controller_status_t* at_start, const controller_status_t* at_end, double end_s);
  // The true plant has come to time_s.
  void follow(double time_s);

  [[nodiscard]] BeliefPrediction result() const;

 private:
  // The rows that are kept are this many ticks apart; the distance doubles when there are kMostRows of them.
  static constexpr std::size_t kMostRows = 2000;

  void keep_row();

  bool has_controller_;
  bool lost_ = false;
  sim::Plant plant_;
  std::vector<BeliefRow> rows_;
  std::int64_t ticks_ = 0, every_ = 1;
};

}  // namespace ballast::sil
