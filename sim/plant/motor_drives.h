// The forces along the rails of driven masses: motors, end stops and, where a fault blocks a rail, the block.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sim/masses/motion.h"
#include "sim/motors/end_stop.h"
#include "sim/motors/stepper.h"
#include "sim/plant/driven_lanes.h"
#include "sim/plant/plant_model.h"

namespace ballast::sim {

class MotorDrives {
 public:
  explicit MotorDrives(const PlantModel& model);

  [[nodiscard]] std::size_t size() const { return steppers_.size(); }
  // The caller may change the field, so driven_lanes() is told anew.
  [[nodiscard]] Stepper& stepper(std::size_t i) {
    old_lanes_ |= std::uint32_t{1} << i;
    return steppers_[i];
  }
  [[nodiscard]] const Stepper& stepper(std::size_t i) const { return steppers_[i]; }

  // The generalised force on each mass (N m on a circle, N on a line) at these rail coordinates and rates.
  [[nodiscard]] PerMass forces(const double* position, const double* velocity) const;
  // The part of it that end stop and block give.
  [[nodiscard]] double holding_force(std::size_t i, double position, double velocity) const {
    const double stop_n = stop_force_n(i, position, velocity);
    const Block& block = blocks_[i];
    return block.on ? stop_n - block.stiffness * (position - block.position) - block.damping * velocity : stop_n;
  }

  // The motors for driven_lanes(); null if one of them is not sound.
  [[nodiscard]] const LaneMotors* lanes() const;
  // The part of forces() that end stops and blocks give.
  void add_holding_forces(const double* position, const double* velocity, double* force) const;

  // Stepper::wait().
  bool wait(std::size_t i, double time_s) {
    if (!steppers_[i].wait(time_s)) return false;
    old_lanes_ |= std::uint32_t{1} << i;
    return true;
  }
  void count_slips(std::size_t i, double shaft_rad) { steppers_[i].count_slips(shaft_rad); }

  // --- end stops ---
  [[nodiscard]] const std::vector<std::size_t>& with_stops() const { return with_stops_; }
  // -1 or +1: the stop that pushes; 0: none.
  [[nodiscard]] int stop_side(std::size_t i) const { return stop_side_[i]; }
  [[nodiscard]] double stop_force_n(std::size_t i, double position, double velocity) const {
    return end_stops_[i].force_n(stop_side_[i], position, velocity);
  }
  // > 0 where the stop that pushes is another than stop_side().
  [[nodiscard]] double stop_overdue_m(std::size_t i, double position, double velocity) const {
    return end_stops_[i].overdue_m(stop_side_[i], position, velocity);
  }
  // Sets stop_side() for a mass there. True: another stop has begun to push.
  bool update_stop(std::size_t i, double position, double velocity);

  // --- injected faults ---
  // Holds a mass there from now on; a rail that is blocked stays blocked where it is.
  void block(std::size_t i, double position);
  void release(std::size_t i) { blocks_[i].on = false; }

 private:
  // A spring and its critical damper about the place where the mass was.
  struct Block {
    bool on = false;
    double position = 0;
    double stiffness = 0, damping = 0;  // N per rail unit, and per its rate
  };

  std::vector<Stepper> steppers_;
  mutable LaneMotors lanes_;
  // A bit per motor: its lanes are out of date, or it is not sound.
  mutable std::uint32_t old_lanes_ = ~std::uint32_t{0}, unsound_lanes_ = 0;
  std::array<EndStops, kMaxMasses> end_stops_{};  // of driven masses
  std::vector<std::size_t> with_stops_;           // masses that have end stops
  std::array<int, kMaxMasses> stop_side_{};
  std::array<Block, kMaxMasses> blocks_{};
  bool may_block_;
};

}  // namespace ballast::sim
