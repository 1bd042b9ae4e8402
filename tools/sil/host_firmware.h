// The controller in the plant's own process: the firmware on the lockstep board, no wall clock, no network.
#pragma once

#include <optional>

#include "hal/control_loop.h"
#include "hal/lockstep/lockstep_board.h"
#include "tools/sil/peer.h"

namespace ballast::sil {

class HostFirmware final : public Peer {
 public:
  // `params` must have been accepted by firmware::validate() and must outlive the firmware.
  HostFirmware(const firmware::ControllerParams& params, double control_period_s)
      : control_period_s_(control_period_s), loop_(params, board_) {}

  hal::Status send(Lap& lap) override;
  hal::Status receive(Lap& lap) override;
  [[nodiscard]] std::string trouble() const override { return "the controller did not answer"; }

 private:
  double control_period_s_;
  hal::LockstepBoard board_;
  hal::ControlLoop<hal::LockstepBoard> loop_;
};

// Serves the tick that `board` has released, and takes the answer from it.
hal::Status serve(hal::ControlLoop<hal::LockstepBoard>& loop, hal::LockstepBoard& board, double control_period_s,
                  std::optional<Answer>& answer);

}  // namespace ballast::sil
