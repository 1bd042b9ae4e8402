// The commands that an operator gives in a soak: stops, starts, moves and resets at random ticks, and resets after a
// trip.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "firmware/control/inputs.h"
#include "sim/scenario/scenario.h"
#include "tools/sil/peer.h"
#include "tools/soak/random.h"

namespace ballast::soak {

struct OperatorScript {
  struct Timed {
    std::int64_t tick;
    firmware::OperatorInput input;
  };
  std::vector<Timed> commands;  // in order of their ticks, one per tick
  // Resets begin this many ticks after the controller trips and follow each other as far apart, up to kMostResets; -1:
  // none. After one that is obeyed the operator arms and starts again.
  std::int64_t resets_every = -1;
  static constexpr int kMostResets = 8;
};

// None in every third script. Starts and moves mostly follow a stop, without which they are refused. Ideal masses get
// halts and courses.
OperatorScript random_script(const sim::Scenario& scenario, Random& random);

// One line for each command, as TOML comments.
std::string comments(const OperatorScript& script);

// Gives the script's commands on the way to `peers`, in addition to those of the run.
std::unique_ptr<sil::Peer> with_operator(std::unique_ptr<sil::Peer> peers, const OperatorScript& script,
                                         double control_period_s);

}  // namespace ballast::soak
