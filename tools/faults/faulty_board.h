// The LCM board of a controller's own process, with the scenario's faults on the links to it.
#pragma once

#include "hal/lcm/lcm_board.h"
#include "tools/faults/faulty_links.h"

namespace ballast::sil {

class FaultyBoard : public hal::LcmBoard {
 public:
  // `options` must say that verdicts may name any tick. Bus and scenario must outlive the board.
  FaultyBoard(hal::Bus& bus, const hal::LcmBoardOptions& options, const sim::Scenario& scenario)
      : LcmBoard(bus, options), links_(scenario) {}

  hal::Status wait_tick(std::int64_t& tick) {
    const hal::Status status = LcmBoard::wait_tick(tick);
    // kOk: sensors and verdict of this tick have come (LcmBoard::wait_tick()), so both are there.
    if (status == hal::Status::kOk) mail() = links_.deliver(*mail().sensors, &*mail().trip);
    return status;
  }

 private:
  ControllerLinks links_;
};

static_assert(hal::Board<FaultyBoard>);

}  // namespace ballast::sil
