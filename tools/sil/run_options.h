// Options of a run.
#pragma once

#include <csignal>
#include <functional>
#include <optional>
#include <string>

#include "firmware/control/inputs.h"
#include "sim/plant/plant.h"
#include "tools/sil/lap.h"
#include "tools/sil/wires.h"

namespace ballast::sil {

struct RunOptions {
  double speed = 0;                                           // simulated over wall time; 0: as fast as it goes
  const volatile std::sig_atomic_t* interrupted = nullptr;    // nonzero ends the run
  bool check_steps = false;                                   // hold every pulse against the motion
  std::function<void(double time_s, double end_s)> progress;  // called now and then
  std::function<void(const Lap&, const sim::Plant::Sample& truth)> observe{};  // called once per tick
  std::optional<firmware::MoveRequest> move;  // asked for instead of the scenario's motion
  bool plan_only = false;                     // ends where the move is refused or predicted; `move` has the plan
  bool by_hand = false;                       // the run only arms; operators give all other commands
  std::function<std::string()> disturbed{};   // called once per tick: why the run must end, or empty
  bool predict_belief = true;                 // RunResult::belief, where the scenario has a belief
  Wires* wires = nullptr;                     // null: sensors and steps pass unchanged
};

}  // namespace ballast::sil
