// A run: lap after lap until the scenario's end, a trip's end, or the end of the physics.
//
// A run with a controller begins with a countdown (countdown.h). In tick k the plant executes the steps that the
// controller has computed in tick k - 1. A trip ends the run once the stop's last step is executed; it ends the run at
// once if it comes before the controller is armed, as any fault of the controller does then. A move that is asked for
// replaces the start, and ends the run once its last step is executed and the masses rest, whatever the scenario's
// duration; the masses have ten swings of the slowest motor to come to rest.
//
// A run ends as kPeerLost where its messages cannot be those of one controller and one monitor that hear it:
//   - the controller has been started again: it counts fewer commands than before;
//   - the monitor takes a trip back;
//   - the controller counts steps that the motors have not been given, or more than kAllowedMissedCommands have not
//     come. During the stop after a trip neither ends the run, and the result counts them;
//   - the controller has been silent for kGivenUpTicks;
//   - the motors would be given other pulses than the command has, which would be a fault of the plant's program.
#pragma once

#include "sim/scenario/scenario.h"
#include "tools/sil/lap_sink.h"
#include "tools/sil/peer.h"
#include "tools/sil/run_options.h"
#include "tools/sil/run_result.h"
#include "tools/sil/step_feed.h"

namespace ballast::sil {

// Ticks after which a silent controller is given up. Long before that the monitor has tripped.
inline constexpr std::int64_t kGivenUpTicks = 100;

// `peers` must be connected.
RunResult run(const sim::Scenario& scenario, Peer& peers, LapSink& sink, const RunOptions& options);

}  // namespace ballast::sil
