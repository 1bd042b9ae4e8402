// Controller and monitor in the plant's own process: the firmware on the lockstep board, no wall clock, and no
// network but for operators, if somebody wants to be heard.
#pragma once

#include "hal/control_loop.h"
#include "hal/lcm/bus.h"
#include "hal/lcm/operator_inbox.h"
#include "hal/lockstep/lockstep_board.h"
#include "tools/monitor/monitor.h"
#include "tools/sil/lap.h"

namespace ballast::sil {

class InProcessPeers : public Peers {
 public:
  // `params` (accepted by firmware::validate()) is null in prescribed runs, which have no controller. `operator_bus`: a
  // bus on which to listen to operators; may be null.
  InProcessPeers(const firmware::ControllerParams* params, const monitor::MonitorLimits& limits,
                 double control_period_s, hal::Bus* operator_bus = nullptr);

  hal::Status connect() override { return hal::Status::kOk; }
  hal::Status exchange(Lap& lap) override;
  [[nodiscard]] RefusedMessages refused() const override { return refused_operators(operator_bus_, operator_); }
  [[nodiscard]] std::string trouble() const override { return "the controller did not answer"; }

 private:
  double control_period_s_;
  monitor::Monitor monitor_;
  std::optional<std::int64_t> controller_tick_;  // of the newest status
  std::optional<monitor::Estimate> estimate_;    // in it
  hal::LockstepBoard board_;
  std::optional<hal::ControlLoop<hal::LockstepBoard>> controller_;
  hal::Bus* operator_bus_;
  hal::OperatorInbox operator_;
};

}  // namespace ballast::sil
