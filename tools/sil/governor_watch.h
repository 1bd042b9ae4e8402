// Measures what the governor did to the commands of a run.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "ballast/controller_status_t.hpp"
#include "firmware/motion/profile.h"
#include "sim/scenario/scenario.h"

namespace ballast::sil {

// Over the governed ticks of the running motion; a halt follows no motion.
struct GovernorRecord {
  std::int64_t ticks = 0, bent_ticks = 0, backup_ticks = 0;
  // Per mass, greatest distance of the commanded from the scenario's motion at the same time, rail units. Feedback along
  // the motion is part of it; operators' courses are not.
  std::vector<double> largest_bend;
  double motor_allowance = 0;  // greatest part of N kept free
  double least_margin = 1;     // of the certified backups

  [[nodiscard]] double share(std::int64_t part) const {
    return static_cast<double>(part) / static_cast<double>(std::max<std::int64_t>(ticks, 1));
  }
};

class GovernorWatch {
 public:
  explicit GovernorWatch(const sim::Scenario& scenario)
      : period_s_(scenario.run.control_period_s),
        motion_(scenario.masses.size()),
        offset_(scenario.masses.size()),
        drift_(scenario.masses.size()) {
    record_.largest_bend.assign(scenario.masses.size(), 0);
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      const sim::Mass& mass = scenario.masses[i];
      std::vector<firmware::ProfilePiece> pieces;
      for (const sim::MotionPiece& piece : mass.motion) {
        pieces.push_back({piece.duration_s, piece.acceleration_start, piece.acceleration_end});
      }
      // A motion that is none is refused before the run.
      static_cast<void>(
          motion_[i].set(mass.initial_position, mass.initial_velocity, pieces.data(), static_cast<int>(pieces.size())));
    }
  }

  void observe(const controller_status_t& status) {
    if (status.governed == 0 || status.mode != controller_status_t::MODE_RUNNING) {
      first_tick_.reset();
      return;
    }
    if (!first_tick_) begin(status);
    ++record_.ticks;
    record_.bent_ticks += status.command_bent != 0 ? 1 : 0;
    record_.backup_ticks += status.backup_active != 0 ? 1 : 0;
    record_.motor_allowance = std::max(record_.motor_allowance, status.governor_allowance);
    record_.least_margin = std::min(record_.least_margin, status.backup_margin);
    if (status.course != 0) return;  // its motion is not the scenario's
    const double time_s = static_cast<double>(status.tick - *first_tick_) * period_s_;
    for (std::size_t i = 0; i < motion_.size(); ++i) {
      const double planned = motion_[i].at(time_s).position + offset_[i] - drift_[i] * time_s;
      const double off = std::abs(status.next_position[i] - planned);
      record_.largest_bend[i] = std::max(record_.largest_bend[i], off);
    }
  }
  [[nodiscard]] const GovernorRecord& record() const { return record_; }

 private:
  // The first governed status has the masses where the motion begins. One that begins later starts from where the
  // masses stand, and has lost its initial velocity.
  void begin(const controller_status_t& status) {
    first_tick_ = status.tick;
    for (std::size_t i = 0; i < motion_.size(); ++i) {
      const firmware::ProfilePoint first = motion_[i].at(0);
      offset_[i] = status.next_position[i] - first.position;
      drift_[i] = first.velocity - status.next_velocity[i];
    }
  }

  double period_s_;
  std::vector<firmware::Profile> motion_;
  std::optional<std::int64_t> first_tick_;  // of the motion that runs
  std::vector<double> offset_, drift_;      // rail units, and per second
  GovernorRecord record_;
};

}  // namespace ballast::sil
