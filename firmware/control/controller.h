// The controller: a step function from (inputs, state, parameters) to (outputs, state), called once per control tick.
// Time is the tick number. No heap, exceptions, RTTI, recursion, unbounded loops or virtual calls.
#pragma once

#include <limits>

#include "firmware/model/rolling.h"
#include "firmware/motion/profile.h"
#include "firmware/motion/step_generator.h"
#include "firmware/safety/fault.h"
#include "firmware/safety/modes.h"

namespace ballast::firmware {

struct MotorParams {
  Real steps_per_unit = 0;     // microsteps per rail unit (rad or m), != 0; sign = wiring
  Real max_step_rate_hz = 0;   // microsteps per second, > 0
  Real max_acceleration = 0;   // rail unit / s^2, > 0: the deceleration of a stop
  Real direction_setup_s = 0;  // 0..1e-3: least time between two opposite pulses, which the driver needs to turn
};

// Inert until validate() accepts it.
struct ControllerParams {
  std::int64_t scenario_id = 0;  // fingerprint, echoed in the status
  Real control_period_s = 0;
  Real timer_frequency_hz = 0;  // step timer, 1e6..1e8
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
  Real value = 0;
  const char* allowed = "";
  [[nodiscard]] bool ok() const { return field == nullptr; }
};

[[nodiscard]] ParamError validate(const ControllerParams& params);

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

enum class OperatorCommand : std::uint8_t { kNone = 0, kArm = 1, kStart = 2, kStop = 3, kReset = 4 };

// Everything the controller hears in one tick. What did not arrive keeps its last value, and its old tick.
struct Inputs {
  std::int64_t tick = 0;
  Sensors sensors;
  MonitorVerdict monitor;
  OperatorCommand operator_command = OperatorCommand::kNone;
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
  RollingForces predicted;               // closed forms, commanded masses, sensed attitude and rate; NaN if those are
                                         // not finite: then mu_required is +infinity and margin -1
  Real mu_required = 0;                  // f_s / N; +infinity where N <= 0
  Real margin = 0;                       // 1 - f_s / (mu_s N); 1 with perfect friction; -1 where N <= 0
  std::int64_t overruns = 0;             // kept by the HAL's clock
  PerMass<std::int64_t> steps_issued{};  // pulses, both directions counted up
  StepOverload overload;                 // kNone: there was none
};

struct Outputs {
  StepCommand steps;  // of tick + 1
  ControllerStatus status;
};

struct ControllerState {
  Mode mode = Mode::kDisarmed;
  std::uint32_t faults = 0;
  bool ticked = false;  // a tick has been seen
  std::int64_t last_tick = 0;
  std::int64_t start_tick = 0;  // tick at whose start the active profiles are at time 0
  bool started = false;         // a motion has begun since reset(): later ones start from where the masses stand
  bool moving = false;          // active profiles are in force; otherwise the masses hold at hold_position
  bool braking = false;         // the active profiles are stops
  PerMass<Profile> active{};    // the scenario's motion, or a stop from its current point
  PerMass<Real> hold_position{};
  PerMass<std::int64_t> position_steps{};
  PerMass<LastPulse> last_pulse{};
  PerMass<std::int64_t> steps_issued{};
  StepOverload overload;
};

// State before the first tick: disarmed, masses holding at their initial positions.
void reset(const ControllerParams& params, ControllerState& state);

// One tick. `params` must have been accepted by validate(). Steps written are those of inputs.tick + 1.
// - START in tick k: profile time 0 is the start of tick k + 1. The first motion starts with the parameters' initial
// position
//   and velocity. A later one (after a stop, or a trip and reset) runs the same pieces from where the masses stand, at
//   rest.
// - A stop or a trip in tick k: from the start of tick k + 1 each mass decelerates from its profile's point there at
//   max_acceleration, then holds. A motion that ends by itself leaves the mode running.
// - Step overload: the tick's steps are made again with all masses braking from the commanded state; a motor that
// cannot
//   follow even that brakes from the speed it can follow, or, if that fails too, holds at once.
// - A tick repeated issues nothing: its steps are on their way already. A tick skipped, or one from the past, left the
// motors
//   without pulses; they stand, and hold there.
// All of `outputs` is written, except overruns.
void tick(const ControllerParams& params, ControllerState& state, const Inputs& inputs, Outputs& outputs);

}  // namespace ballast::firmware
