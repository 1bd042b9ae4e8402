// Rows of a prescribed sweep, rolled several at once (rolling_batch.h) where that gives what the plant gives: rails and
// motions are those of all rows, the floor is level, and the ball rolls to the end. Rows that leave rolling, or come so
// near to it that rounding could decide, are run by the plant.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tools/sweep/rolling_batch.h"
#include "tools/sweep/run_row.h"

namespace ballast::sweep {

class BatchRows {
 public:
  // Chooses the length of the steps, so that the extrema of some rows, spread over the sweep, agree with the plant's.
  // The choice depends on the sweep alone. A row that the steps integrate worse than those is run by the plant. Both
  // must outlive the object.
  BatchRows(const Spec& spec, const RowScenarios& scenarios, Lanes lanes = best_lanes());

  // False: the sweep is of another kind, and every row is run by itself.
  [[nodiscard]] bool usable() const { return batch_.has_value(); }
  [[nodiscard]] double step_s() const { return step_s_; }

  // One result per row, in order. Only if usable().
  [[nodiscard]] std::vector<RowResult> run(const std::vector<Row>& rows);

 private:
  // The part of a ball that a varied key sets.
  enum class Field { kShellMass, kInertia, kCenterOfMass, kMass, kForce, kOrientation, kRate, kPosition, kFriction };
  struct Target {
    Field field;
    std::size_t index;
  };
  // A row in a lane.
  struct Lane {
    Row row;
    BatchBall ball;
    double static_friction = 0;
    bool fits = false;
  };

  [[nodiscard]] static std::optional<Target> target_of(const std::string& key, const sim::Scenario& base);
  static void set(const Target& target, const sim::Node& value, Lane& lane);
  [[nodiscard]] bool fits(const Lane& lane) const;
  [[nodiscard]] Lane lane_of(Row row) const;
  [[nodiscard]] bool agree(const BatchBall& ball, const BatchResult& rolled, const sim::ContactExtrema& truth) const;
  [[nodiscard]] bool agrees(double step_s, const std::vector<Lane>& rows, const std::vector<sil::RunResult>& truth);
  void choose_step();
  // nullopt: the plant must decide.
  [[nodiscard]] std::optional<RowResult> result_of(const Lane& lane, const BatchResult& rolled);

  const Spec& spec_;
  const RowScenarios& scenarios_;
  Lanes lanes_;
  sim::Scenario base_;
  Lane nominal_;
  std::optional<double> believed_friction_;  // where the scenario says so; else a row's own floor is believed
  std::vector<Target> targets_;              // one per Spec::vary
  double step_s_ = 0;
  double most_drift_ = 0;  // of the attitude's length, in the rows that were compared
  std::optional<MotionTable> table_;
  std::optional<RollingBatch> batch_;
  sil::RunResult result_;  // reused: of the row at hand
};

}  // namespace ballast::sweep
