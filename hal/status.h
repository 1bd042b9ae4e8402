// Results of calls into the hardware abstraction.
#pragma once

#include <cstdint>

namespace ballast::hal {

enum class [[nodiscard]] Status : std::uint8_t{
    kOk,
    kEmpty,            // nothing has come; the output is untouched
    kEnded,            // the tick announced as the last one has been served
    kPeerLost,         // a peer has been silent for longer than its timeout
    kForeignScenario,  // a peer runs another scenario
    kForeignPeer,      // a process takes part that does not belong to this run
    kInterrupted,      // a signal or the user ended this process
    kIo,               // the transport failed
};

}  // namespace ballast::hal
