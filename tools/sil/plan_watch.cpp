#include "tools/sil/plan_watch.h"

#include <cmath>
#include <limits>

#include "tools/sil/least_margin.h"

namespace ballast::sil {

// A plan of which only the duration is known.
static constexpr firmware::Prediction kNotPredicted{0, 0, std::numeric_limits<double>::quiet_NaN(),
                                                    std::numeric_limits<double>::infinity(), -1};

void PlanWatch::observe(const contact_t& contact, const controller_status_t& status) {
  observe_margin(contact);  // belongs to the plan in force: one that this tick has brought about begins with the next
  // A move that was cancelled before it began leaves no record.
  if (current_ != nullptr && status.plan_tick != plan_tick_ && status.tick < plan_tick_) {
    current_->reset();
    current_ = nullptr;
  }
  // A plan over in its own tick, as a move to where the masses are, is none.
  if (status.plan_duration_s > 0 && (current_ == nullptr || status.plan_tick != plan_tick_)) {
    plan_tick_ = status.plan_tick;
    const bool moves =
        status.mode == controller_status_t::MODE_PENDING || status.mode == controller_status_t::MODE_MOVING;
    current_ = moves ? &move_ : &stop_;
    *current_ = PlanRecord{static_cast<double>(plan_tick_) * period_s_, kNotPredicted, std::nullopt};
    (*current_)->predicted.duration_s = status.plan_duration_s;
  }
  if (current_ != nullptr && status.planned != 0 && status.plan_tick == plan_tick_) {
    (*current_)->predicted = {status.plan_duration_s, status.plan_horizon_s, status.plan_normal_force_min_n,
                              status.plan_mu_required_max, status.plan_margin_min};
  }
}

void PlanWatch::observe_margin(const contact_t& contact) {
  if (current_ == nullptr || contact.tick < plan_tick_) return;
  PlanRecord& plan = **current_;
  // A plan may end between two ticks.
  if (static_cast<double>(contact.tick - plan_tick_) > std::ceil(plan.predicted.duration_s / period_s_)) return;
  lower_margin(contact, plan.seen_margin_min);
}

}  // namespace ballast::sil
