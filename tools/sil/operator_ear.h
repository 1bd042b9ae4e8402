// Hears operators on a bus, for the peers of a run.
#pragma once

#include <cstddef>
#include <limits>

#include "hal/lcm/bus.h"
#include "hal/lcm/operator_inbox.h"
#include "tools/sil/peer.h"

namespace ballast::sil {

class OperatorEar {
 public:
  // Subscribes on `bus`, which must outlive the ear. Null: nobody is heard.
  explicit OperatorEar(hal::Bus* bus);
  OperatorEar(const OperatorEar&) = delete;
  OperatorEar& operator=(const OperatorEar&) = delete;

  // Before the bus is read in a tick. The bus gives back the run's own command, which is then not handed out.
  void begin(const Lap& lap);
  // Appends to lap.heard what has been heard, oldest first, a stop before all.
  void hand_out(Lap& lap, std::size_t at_most = std::numeric_limits<std::size_t>::max());

  // For peers that read the bus only for operators. Hands out one message per tick, as the controller obeys one per
  // tick, and none in the countdown, whose commands are the run's own. kIo: the bus failed.
  hal::Status listen(Lap& lap);

  [[nodiscard]] RefusedMessages refused() const;

 private:
  hal::Bus* bus_;
  hal::OperatorInbox inbox_;
};

}  // namespace ballast::sil
