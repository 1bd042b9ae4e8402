// Keeps the controller's last move and last stop: what it predicted, and the least margin that the contact then shows.
#pragma once

#include <cstdint>
#include <optional>

#include "tools/sil/run_result.h"

namespace ballast::sil {

class PlanWatch {
 public:
  explicit PlanWatch(double period_s) : period_s_(period_s) {}
  // A lap with an answer.
  void observe(const contact_t& contact, const controller_status_t& status);
  [[nodiscard]] const std::optional<PlanRecord>& move() const { return move_; }
  [[nodiscard]] const std::optional<PlanRecord>& stop() const { return stop_; }

 private:
  void observe_margin(const contact_t& contact);

  double period_s_;
  std::optional<PlanRecord> move_, stop_;
  std::optional<PlanRecord>* current_ = nullptr;  // one of these
  std::int64_t plan_tick_ = 0;
};

}  // namespace ballast::sil
