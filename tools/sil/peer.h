// The other end of a lap: the monitor, the controller, or both, in this process or elsewhere.
#pragma once

#include <cstdint>
#include <string>

#include "hal/host_link.h"
#include "hal/status.h"
#include "tools/sil/lap.h"

namespace ballast::sil {

// Messages that came over a bus and were not used.
struct RefusedMessages {
  hal::LinkCounters here;          // by this process
  std::int64_t by_controller = 0;  // by the controller, if it has a bus of its own

  RefusedMessages& operator+=(const RefusedMessages& more) {
    here += more.here;
    by_controller += more.by_controller;
    return *this;
  }
};

// Why a peer could not go on.
enum class PeerFailure {
  kLost,             // it is silent, has ended, or its transport failed
  kFirmwareFault,    // the firmware took a processor fault
  kFirmwareHung,     // its watchdog ended it
  kLate,             // a control tick or a step pulse came late
  kForeignFirmware,  // the firmware's types, build or parameters are not this program's
};

// A lap is sent, then received. Each call fills in its part of the lap and leaves the rest as it is. After a call that
// fails, trouble() and failure() say why, and no other call follows.
class Peer {
 public:
  virtual ~Peer() = default;
  // Waits until the peer is there and runs the same scenario.
  virtual hal::Status connect() { return hal::Status::kOk; }
  // Hands out the plant's messages and the commands of a tick.
  virtual hal::Status send(Lap& lap) = 0;
  // Fills in the answers. Peers with a bus also fill in the operators' messages heard up to then.
  virtual hal::Status receive(Lap& lap) = 0;
  hal::Status exchange(Lap& lap) {
    const hal::Status sent = send(lap);
    return sent == hal::Status::kOk ? receive(lap) : sent;
  }
  // True: the peer computes between send() and receive(), so this process has time for other work there.
  [[nodiscard]] virtual bool computes_in_parallel() const { return false; }
  // One line.
  [[nodiscard]] virtual std::string trouble() const = 0;
  [[nodiscard]] virtual PeerFailure failure() const { return PeerFailure::kLost; }
  [[nodiscard]] virtual RefusedMessages refused() const { return {}; }
};

}  // namespace ballast::sil
