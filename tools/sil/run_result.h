// The result of a run.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "firmware/control/inputs.h"
#include "firmware/control/status.h"
#include "sim/plant/plant.h"
#include "tools/sil/governor_watch.h"
#include "tools/sil/motor_share.h"
#include "tools/sil/peer.h"
#include "tools/sil/step_timing.h"
#include "tools/sil/tracking_watch.h"

namespace ballast::sil {

enum class EndReason { kCompleted, kSlipped, kDetached, kTripped, kInconsistent, kStepTiming };
const char* to_string(EndReason reason);

struct MotorRecord {
  std::int64_t steps = 0;              // pulses executed, counted up in both directions
  double max_step_rate_hz = 0;         // from the closest two pulses
  double steps_behind = 0;             // at the end: microsteps commanded less those the rotor has made
  std::int64_t undelivered_steps = 0;  // microsteps that the controller counts and the motor has not been given
  std::int64_t slips = 0;              // of the rotor from tooth to tooth, either way
};

// The tick in which the controller went to kTripped, or was kept from leaving kDisarmed by a trip or a fault.
struct ControllerTrip {
  std::int32_t faults;  // bits of firmware::Fault
  std::int64_t tick;
  double time_s;
  controller_status_t status{};
  sensors_t sensors{};
  std::vector<step_command_t> history;  // the last commands up to that tick, oldest first; at most kHistoryTicks
};
inline constexpr std::size_t kHistoryTicks = 8;

// A stop or a move, as the controller predicted it (firmware/control/prediction.h) and as the plant did it. The
// predicted N is NaN, and the horizon 0, if the run ended before the prediction was complete, or the sensors gave no
// valid attitude.
struct PlanRecord {
  double start_s = 0;
  firmware::Prediction predicted;
  // The least margin of the contact messages from the plan's start to the first one at or after its end, counted from
  // the first in contact; -1 if the ball then left the ground; none if there was no such message.
  std::optional<double> seen_margin_min;
};

// The end of a move that the run was asked for. The final sample tells where its masses are.
struct MoveEnd {
  firmware::MoveRequest asked;
  bool steps_made = false;  // all of them
};

// The believed robot at one instant.
struct BeliefRow {
  double time_s = 0;
  Eigen::Vector2d position_W_m = Eigen::Vector2d::Zero();
  double normal_force_n = 0;
  double static_friction_n = 0;
};

// The believed robot's run under the same commanded motion.
struct BeliefPrediction {
  double time_s = 0;  // up to which it was rolled: the run's end, the end of its own physics, or a missing status
  sim::PhysicsEnd end{};
  sim::ContactExtrema extrema;
  Eigen::Vector3d position_W_m = Eigen::Vector3d::Zero();
  std::vector<BeliefRow> rows;  // from t = 0 to time_s, at most about 2000, for pictures
};

// The controller's estimate against the truth, over the ticks from 0 to the end.
struct EstimateErrors {
  double tilt_rms_rad = 0;           // of gravity in the body
  double gyro_bias_error_radps = 0;  // norm, at the end
  double position_rms_m = 0;
  double yaw_error_rad = 0;                                // at the end; >= 0
  std::optional<double> friction_rms;                      // of the measured f_s / N; none: nothing was measured
  std::optional<double> friction_error;                    // the largest of those
  Eigen::Vector2d position_W_m = Eigen::Vector2d::Zero();  // as estimated at the end
};

struct RunResult {
  EndReason end_reason = EndReason::kCompleted;
  std::string end_text;  // inconsistent: why
  sim::Plant::Sample final_sample;
  double distance_m = 0;  // path of the geometric centre, from tick to tick
  std::vector<sim::RegimeStart> regimes;
  std::vector<sim::ImpactRecord> impacts;
  bool rolling_lost = false;  // rolling ended by slip or detachment at least once
  sim::ContactExtrema extrema;
  std::optional<sim::ContactShares> friction_shares;  // of extrema.mu_required_max; rolling only
  std::array<sim::MotorExtrema, sim::kMaxMasses> motor_extrema;
  std::array<sim::MotorEnergy, sim::kMaxMasses> motor_energy{};
  std::array<MotorRecord, sim::kMaxMasses> motors;
  MotorShare motor_share;
  std::optional<BeliefPrediction> belief;  // where the scenario has one
  std::optional<TrackingRecord> tracking;  // where the scenario has a plan that rolls
  std::optional<GovernorRecord> governor;  // where a tick was governed
  std::optional<EstimateErrors> estimate;  // where the controller has estimated its attitude
  std::array<sim::EndStopRecord, sim::kMaxMasses> end_stops;
  trip_t trip{};                               // the last verdict
  std::optional<double> trip_static_friction;  // mu_s under the ball when friction tripped
  std::optional<ControllerTrip> controller_trip;
  std::optional<std::int64_t> latency_ticks;    // from the violating contact to the first tick with the stop's steps
  std::optional<StepTimingRecord> step_timing;  // if it was asked for
  bool masses_rested = false;                   // at the end; RestWatch
  std::optional<PlanRecord> move, stop;         // the last of each
  std::optional<MoveEnd> move_end;              // of the move that was asked for
  bool operators_heard = false;                 // somebody beside the run itself
  std::int64_t courses = 0;                     // that operators have handed over and the controller has followed
  std::int64_t last_tick = 0;                   // recorded
  std::int64_t log_bytes = 0;                   // length of the log
  std::int64_t missing_commands = 0;            // ticks for which no step command reached the motors
  RefusedMessages refused;                      // came over the bus and were not used
  std::optional<controller_status_t> refusal;   // the status that refuses the move or start; nothing ran
  std::int64_t ticks = 0;                       // control periods simulated
  double wall_time_s = 0;
  double asked_speed = 0;  // RunOptions::speed

  // kOk: the run came to its end. Otherwise `trouble` says why it did not, and the rest is as far as it came.
  hal::Status status = hal::Status::kOk;
  PeerFailure failure = PeerFailure::kLost;  // of a peer, where one has failed
  std::string trouble;
  bool sink_failed = false;  // the trouble is the sink's
};

}  // namespace ballast::sil
