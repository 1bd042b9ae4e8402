// A run: lap after lap until the scenario's end, a trip's end, or the end of the physics.
#pragma once

#include <array>
#include <csignal>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"
#include "tools/sil/lap.h"
#include "tools/sil/motor_share.h"
#include "tools/recording/recorder.h"
#include "tools/sil/step_timing.h"

namespace ballast::sil {

// A controller that says nothing for so many ticks is given up. Long before that the monitor has tripped.
inline constexpr std::int64_t kGivenUpTicks = 100;

// Of step commands on end; the steps of one are missed by the next one's count.
inline constexpr std::int64_t kAllowedMissedCommands = 1;

enum class EndReason { kCompleted, kSlipped, kDetached, kTripped, kInconsistent, kStepTiming };
const char* to_string(EndReason reason);

struct MotorRecord {
  std::int64_t steps = 0;       // pulses executed, both directions counted up
  double max_step_rate_hz = 0;  // from the closest two pulses
  double steps_behind = 0;      // at the end: microsteps commanded less those the rotor has made, in the positive sense
  std::int64_t undelivered_steps = 0;  // microsteps the controller counts, and this motor has not been given
  std::int64_t slips = 0;              // of the rotor from tooth to tooth, forth and back
};

// When the controller went to kTripped, or while still disarmed saw a trip or was kept by a fault from arming, and the
// faults it had then (bits of firmware::Fault).
struct ControllerTrip {
  std::int32_t faults;
  std::int64_t tick;
  double time_s;
  controller_status_t status{};         // of that tick
  sensors_t sensors{};                  // likewise
  std::vector<step_command_t> history;  // the last commands up to then, oldest first; at most kHistoryTicks
};
inline constexpr std::size_t kHistoryTicks = 8;

// A stop or a move: what the controller predicts of it (firmware/control/prediction.h; N is NaN if the run ended before
// the prediction was complete), and the least
// margin of the plant's contact messages from its start to the first one at or after its end (samples, from the first
// in contact; -1 if the ball then left the ground; none: there was no such sample).
struct PlanRecord {
  double start_s = 0;
  firmware::Prediction predicted;
  std::optional<double> seen_margin_min;
};

// How a move that the run was asked for ended; where its masses are is in the final sample.
struct MoveEnd {
  firmware::MoveRequest asked;
  bool steps_made = false;  // all of them: the controller has the masses where they were to be
};

struct RunResult {
  EndReason end_reason = EndReason::kCompleted;
  std::string end_text;  // inconsistent: why
  sim::Plant::Sample final_sample;
  std::vector<sim::RegimeStart> regimes;
  std::vector<sim::ImpactRecord> impacts;
  bool rolling_lost = false;  // rolling ended by slip or detachment at least once
  sim::ContactExtrema extrema;
  std::optional<sim::ContactShares> friction_shares;  // whose doing extrema.mu_required_max is; rolling only
  std::array<sim::MotorExtrema, sim::kMaxMasses> motor_extrema;
  std::array<sim::MotorEnergy, sim::kMaxMasses> motor_energy{};
  std::array<MotorRecord, sim::kMaxMasses> motors;
  MotorShare motor_share;
  std::array<sim::EndStopRecord, sim::kMaxMasses> end_stops;
  trip_t trip{};  // the last verdict
  std::optional<ControllerTrip> controller_trip;
  std::optional<std::int64_t>
      latency_ticks;  // from the violating contact to the first tick whose steps belong to the stop
  std::optional<StepTimingRecord> step_timing;  // if it was asked for
  bool masses_rested = false;                   // at the end; see run()
  std::optional<PlanRecord> move, stop;         // the last of each
  std::optional<MoveEnd> move_end;              // of the move that was asked for, if one was
  bool operators_heard = false;                 // somebody beside the run itself
  std::int64_t last_tick = 0;                   // in the log
  std::int64_t log_bytes = 0;                   // its length
  std::int64_t missing_commands = 0;            // ticks for which no step command reached the motors
  RefusedMessages refused;                      // what came over the bus and was not used
  std::string refusal;                          // the controller refused the move: which, and why; nothing ran
  std::int64_t ticks = 0;                       // control periods simulated
  double wall_time_s = 0;
  double asked_speed = 0;  // RunOptions::speed

  // Why it could not run to its end; kOk: it did. Otherwise the rest is as far as it came.
  hal::Status status = hal::Status::kOk;
  std::string trouble;
};

struct RunOptions {
  double speed = 0;                                           // simulated over wall time; 0: as fast as it goes
  const volatile std::sig_atomic_t* interrupted = nullptr;    // nonzero ends the run
  bool check_steps = false;                                   // hold every pulse against the motion
  std::function<void(double time_s, double end_s)> progress;  // called now and then
  std::function<void(const Lap&, const sim::Plant::Sample& truth)> observe{};  // called in every tick, once it is said
  std::optional<firmware::MoveRequest> move;  // asked for instead of the scenario's motion
  bool plan_only = false;                     // ends where the move is refused, or predicted: `move` has it
  bool by_hand = false;                       // the controller is armed; the rest is said by operators
  std::function<std::string()> disturbed{};   // asked in every tick: why the run must end, or empty
};

// With check_steps a pulse in the wrong place ends the run at once with kStepTiming.
//
// Two countdown ticks, -2 and -1, come before t = 0 in runs with a controller: the ball is held at its initial state,
// the operator says arm, then start (by_hand: only arm), and the controller computes the steps of tick 0. In tick k the
// plant executes what the controller computed in tick k - 1. A trip ends the run once the stop's last step is executed,
// and at once if it comes, or any fault of the controller's, before that is armed: kTripped. So does a move that
// was asked for instead of the start, once its last step is executed and the masses rest: completed. It is run to its
// end whatever the scenario's duration, and the masses then have ten swings of the slowest motor to come to rest.
//
// It ends as kPeerLost where what it hears cannot be of one controller and one monitor that hear it: the controller has
// been started again (it counts fewer commands than before), the monitor takes a trip back, the controller counts steps
// that the motors have not been given or more than kAllowedMissedCommands have not come (neither counts during the stop
// after a trip: then the record keeps how many), or it has been silent for kGivenUpTicks. So it does where the motors
// would be given other pulses than the command speaks of, which would be a fault of the plant's.
RunResult run(const sim::Scenario& scenario, Peers& peers, Recorder& recorder, const RunOptions& options);

}  // namespace ballast::sil
