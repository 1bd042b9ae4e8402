// The controller: a step function from (inputs, state, parameters) to (outputs, state), called once per control tick.
// Time is the tick number. No heap, exceptions, RTTI, recursion, unbounded loops or virtual calls.
#pragma once

#include <limits>

#include "firmware/control/prediction.h"
#include "firmware/model/rolling.h"
#include "firmware/motion/limits.h"
#include "firmware/motion/profile.h"
#include "firmware/motion/step_command.h"
#include "firmware/safety/fault.h"
#include "firmware/safety/modes.h"

namespace ballast::firmware {

struct MotorParams {
  Wide steps_per_unit = 0;     // microsteps per rail unit (rad or m), != 0; sign = wiring
  Wide max_step_rate_hz = 0;   // microsteps per second, > 0, at most (sure_steps_per_tick() - 1) / control_period_s
  Wide max_acceleration = 0;   // rail unit / s^2, > 0: of motion, moves and stops
  Wide max_jerk = 0;           // rail unit / s^3, > 0: likewise, inside the motion's pieces
  Wide direction_setup_s = 0;  // 0..1e-3: least time between two opposite pulses, which the driver needs to turn
  Wide swing = 0;              // rail unit, >= 0: how far the rotor may be off and lose no step (two full steps)
};

// Inert until validate() accepts it.
struct ControllerParams {
  std::int64_t scenario_id = 0;  // fingerprint, echoed in the status
  Wide control_period_s = 0;
  Wide timer_frequency_hz = 0;  // step timer, 1e6..1e8
  Real static_friction = 0;     // mu_s > 0; infinity: perfect friction
  int sensor_stale_ticks = 0;   // sensors may be this many ticks old
  int monitor_stale_ticks = 0;  // heartbeat may be this many ticks old
  BallParams ball;
  PerMass<MotorParams> motor{};
  PerMass<Profile> motion{};  // what `start` runs; its initial position is where the masses stand
};

// Why parameters were refused.
struct ParamError {
  const char* field = nullptr;  // nullptr: accepted
  int index = -1;               // mass, where the field has one
  int piece = -1;               // of the motion, where the field is one
  Wide value = 0;
  const char* allowed = "";
  Wide limit = 0;  // what was allowed, in the unit of `value`; 0 where `allowed` says it all
  [[nodiscard]] bool ok() const { return field == nullptr; }
};

[[nodiscard]] ParamError validate(const ControllerParams& params);

// A motor's limits as its profiles have to keep them. The speed is that of its step rate.
[[nodiscard]] MotionLimits motion_limits(const ControllerParams& params, int mass);

// The tick of what never arrived: older than any limit.
inline constexpr std::int64_t kNeverTick = std::numeric_limits<std::int64_t>::min();

// Body frame; as the robot measures it. A sample from the future counts as stale.
struct Sensors {
  std::int64_t tick = kNeverTick;      // of the sample
  Quaternion orientation{1, 0, 0, 0};  // body -> space
  Vector3 gyro_B_radps = Vector3::Zero();
  Vector3 accelerometer_B_mps2 = Vector3::Zero();  // specific force at the geometric centre
  PerMass<std::uint8_t> limit_switch{};            // bit 0 lower end, bit 1 upper end
};

// The monitor's heartbeat.
struct MonitorVerdict {
  std::int64_t tick = kNeverTick;  // the tick it is about
  bool tripped = false;
};

enum class OperatorCommand : std::uint8_t { kNone = 0, kArm = 1, kStart = 2, kStop = 3, kReset = 4, kMove = 5 };

// Moves masses from rest to rest, all in the time that the slowest needs. It is judged before anything moves.
struct MoveRequest {
  std::uint32_t masses = 0;         // bit i: mass i moves; the others stay
  PerMass<Wide> target_position{};  // rail coordinate, rad or m; read where the bit is set
  Wide speed_fraction = 1;          // 0 < .. <= 1: the shortest time is divided by it
};

// What the operator says; a plain command converts.
struct OperatorInput {
  OperatorCommand command = OperatorCommand::kNone;
  MoveRequest move;  // read with kMove only
  OperatorInput() = default;
  OperatorInput(OperatorCommand c) : command(c) {}  // NOLINT(google-explicit-constructor): that is what it is for
  OperatorInput(const MoveRequest& request) : command(OperatorCommand::kMove), move(request) {}  // NOLINT
};

// Why the operator's last command was not obeyed. The numbers are those of controller_status_t.
enum class Refusal : std::uint8_t {
  kNone = 0,           // it was, or there was none
  kMode = 1,           // not in this mode, or not healthy
  kNoMass = 2,         // the move names no mass
  kUnknownMass = 3,    // one there is not; value: its number
  kTarget = 4,         // not finite, or too many steps away; value: the target
  kSpeedFraction = 5,  // outside 0 < .. <= 1; value: it
  kVelocity = 6,       // the motion, begun from where the masses stand, breaks a limit; value: its extreme
  kAcceleration = 7,
  kJerk = 8,
  kNotPlanned = 9,  // no profile came of these numbers; value: the distance
  kRailEnd = 10,    // the motion, begun from where the masses stand, leaves its rail; value: how far it goes
  kLowerEnd = 11,   // the move's target is beyond the lower end of its rail, or nearer to it than MotorParams::swing;
                    // value: the least target allowed there
  kUpperEnd = 12,   // the same at the upper end; value: the greatest
  kCancelled = 13,  // a fault came while the move was pending
};

struct RefusalReport {
  Refusal reason = Refusal::kNone;
  int motor = -1;
  int piece = -1;  // of the motion
  Wide value = 0;
};

// Everything the controller hears in one tick. What did not arrive keeps its last value, and its old tick.
struct Inputs {
  std::int64_t tick = 0;
  Sensors sensors;
  MonitorVerdict monitor;
  OperatorInput operator_command;
};

// The first step overload since the faults were last cleared: what could not be stepped.
struct StepOverload {
  StepTrouble trouble;
  int motor = -1;
  std::int64_t tick = 0;  // in which the steps would have been executed
};

struct ControllerStatus {
  std::int64_t tick = 0;
  std::int64_t scenario_id = 0;
  Mode mode = Mode::kDisarmed;
  bool at_rest = true;
  std::uint32_t faults = 0;  // bits of Fault, latched; while disarmed, those present in this tick
  int motor_count = 0;
  PerMass<Real> commanded_position{};  // at the start of this tick
  PerMass<Real> commanded_velocity{};
  PerMass<ProfilePoint> next{};          // commanded at the start of the next tick, whose steps go with this
  RollingForces predicted;               // closed forms, commanded masses, sensed attitude and rate; NaN if those are
                                         // not finite: then mu_required is +infinity and margin -1
  Real mu_required = 0;                  // f_s / N; +infinity where N <= 0
  Real margin = 0;                       // 1 - f_s / (mu_s N); 1 with perfect friction; -1 where N <= 0
  std::int64_t overruns = 0;             // kept by the HAL's clock
  PerMass<std::int64_t> steps_issued{};  // pulses, both directions counted up
  StepOverload overload;                 // kNone: there was none
  std::int64_t operator_commands = 0;    // given since reset(), obeyed or not
  RefusalReport refusal;                 // of the operator's last command; stays until the next
  std::int64_t plan_tick = 0;            // at whose start the last stop or move since reset() begins; 0: there was none
  bool planned = false;                  // its prediction is complete
  Prediction plan;                       // until then zeros, but for the duration
};

struct ControllerState {
  Mode mode = Mode::kDisarmed;
  std::uint32_t faults = 0;
  bool ticked = false;  // a tick has been seen
  std::int64_t last_tick = 0;
  std::int64_t start_tick = 0;  // tick at whose start the active profiles are at time 0
  bool started = false;         // a motion or a move has begun since reset(): motions start from where the masses stand
  bool moving = false;          // active profiles are in force; otherwise the masses hold at hold_position
  bool braking = false;         // the active profiles are stops
  PerMass<Profile> active{};    // the scenario's motion, a move, or a stop from where one of them is
  PerMass<Wide> hold_position{};
  PerMass<std::int64_t> position_steps{};
  PerMass<LastPulse> last_pulse{};
  PerMass<std::int64_t> steps_issued{};
  StepOverload overload;
  std::int64_t operator_commands = 0;
  RefusalReport refusal;
  std::int64_t plan_tick = 0;  // of the last stop or move; `active` holds its profiles until its prediction is complete
  bool planned = false;        // that prediction is complete
  Prediction plan;             // as published in the status
  Predictor predictor;
  bool planned_motion_now = false;  // a stop or move was planned in this tick, which leaves no time to predict
  MassMotion now;                   // commanded at the start of the last tick
  bool at_rest = true;              // from the start of the next tick on
};

// State before the first tick: disarmed, masses holding at their initial positions.
void reset(const ControllerParams& params, ControllerState& state);

// Ticks from the request of a move to the tick that begins it: B, for profiles with so many pieces. The request's tick
// plans and predicts nothing; B - 1 ticks with kPredictionStepsHolding steps each follow, and the lead is B + 1 ticks:
// most_prediction_steps(B + 1, borders) <= kPredictionStepsHolding (B - 1).
constexpr int pending_ticks(int borders) {
  constexpr int kPerTick = kPredictionStepsHolding - 1;  // the lead grows by a step with each tick
  return (most_prediction_steps(1, borders) + kPredictionStepsHolding + kPerTick - 1) / kPerTick;
}
inline constexpr int kMostPendingTicks = pending_ticks(kMaxMasses * kMaxPlannedPieces);  // 16

// A control tick consists of three calls, in this order. `params` must have been accepted by validate().
//
// tick() decides what the masses do and makes the steps of inputs.tick + 1. Nothing in it waits for a prediction.
// - START in tick k: profile time 0 is the start of tick k + 1. The first motion starts with the parameters' initial
//   position and velocity. A later one (after a stop, a move, or a trip and reset) runs the same pieces from where the
//   masses stand, at rest; it is refused if that breaks a limit or leaves a rail. The motion after its last piece is
//   not checked, because its length is not known here.
// - MOVE in tick k, armed: plan_move() plans it for each mass asked, all in the same time. The move is then pending
//   while it is predicted, and the masses hold. It begins with the start of tick k + 1 + pending_ticks(). A stop
//   cancels a pending move, and so does a fault (kCancelled). When the masses have arrived they hold, and the mode is
//   armed again. A target at an end of its rail is refused: the rotor swings about the commanded position, would close
//   the end switch on the way there, and be tripped for it. From MotorParams::swing before the end on it does not, as
//   long as it loses no step.
// - A stop or a trip in tick k: from the start of tick k + 1 each mass stops by plan_stop() from its profile's
//   position, velocity and acceleration there, all in the time that the slowest needs at least (a mass that would be
//   stretched beyond an end of its rail takes its own shortest: lines end where the ball does, open splines at their
//   ends, both at their stops); then it holds. The acceleration has no jump, except where the motion itself has one
//   there, and near the step rate: an acceleration that would carry the speed past it begins lower. A motion that ends
//   by itself leaves the mode running.
// - Step overload: the tick's steps are made again with all masses stopping from the commanded state. A motor whose
//   stop cannot be stepped either holds. validate() refuses every motion that could lead there.
// - A tick repeated issues nothing: its steps are on their way already. A tick skipped, or one from the past, left the
//   motors without pulses; they stand, and hold there.
void tick(const ControllerParams& params, ControllerState& state, const Inputs& inputs, StepCommand& steps);

// Predicts N and f_s along the last stop or move, a few steps per tick. The prediction starts from the attitude sensed
// in the tick that planned it and advances from the next tick on: while the masses stop, while they hold after a short
// stop, or while a move is pending. A new stop or move replaces it. A start drops it, because the motion takes its
// profiles' place; so does a start or a move that is refused for other reasons than the mode.
void predict(const ControllerParams& params, ControllerState& state);

// Writes the status, except overruns.
void report(const ControllerParams& params, const ControllerState& state, const Inputs& inputs,
            ControllerStatus& status);

}  // namespace ballast::firmware
