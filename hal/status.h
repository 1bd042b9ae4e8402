// How a call into the hardware abstraction ends.
#pragma once

#include <cstdint>

namespace ballast::hal {

enum class [[nodiscard]] Status : std::uint8_t{
    kOk,
    kEmpty,            // nothing there now; the output is untouched
    kEnded,            // the tick announced as the last one has been served
    kPeerLost,         // a peer has been silent for longer than its timeout
    kForeignScenario,  // a peer runs another scenario
    kForeignPeer,      // somebody takes part who does not belong to this run
    kInterrupted,      // somebody asked this process to end
    kIo,               // the transport itself failed
};

}  // namespace ballast::hal
