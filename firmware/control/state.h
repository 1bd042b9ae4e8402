// State of the controller from one control tick to the next. The parts of the controller share it.
#pragma once

#include "firmware/control/course.h"
#include "firmware/control/prediction.h"
#include "firmware/control/status.h"
#include "firmware/estimation/attitude_filter.h"
#include "firmware/estimation/measured_contact.h"
#include "firmware/estimation/measured_masses.h"
#include "firmware/estimation/slip_friction.h"
#include "firmware/governor/governor.h"
#include "firmware/governor/halt.h"
#include "firmware/governor/sensitivity.h"
#include "firmware/tracking/tracker.h"

namespace ballast::firmware {

// The motion's time, which waits for a ball that is far behind.
struct MotionClock {
  Wide delay_s = 0;  // behind the time since the start
  Real rate = 1;     // of the motion's time
  Real change = 0;   // of the rate, per second
  Wide seen_s = 0;   // time since the start for which this holds
};

// A ball that has come to rest where its reference holds. Feedback that goes on would shake the masses for it: their
// steps, and limits of their motors, are not in its gains.
struct RestState {
  bool rests = false;      // the masses hold, at `offset` from the motion's end
  bool restless = false;   // something moves the ball: it has not stayed at rest, and feedback goes on
  int ticks = 0;           // calm ones before the rest, or at rest
  PerMass<Real> offset{};  // their mean error in the calm before
};

// The run along the reference, from the first start on.
struct TrackingState {
  bool follows = false;         // each tick's motion is commanded anew; `active` holds one tick of it
  bool feeds = false;           // by the feedback; otherwise the governor bends the motion
  std::int64_t start_tick = 0;  // at whose start the plan time is 0
  bool reckons = false;
  DeadReckoning reckoning;
  Vector2 integral_W_ms = Vector2::Zero();  // of the place's error
  PerMass<int> waiting_ticks{};             // in which a motor's pulses have waited for their distance
  bool rebased = false;                     // the motion begins at rest in `origin`
  PerMass<Wide> origin{};
  MotionClock clock;
  RestState rest;
};

// How far the search for a certificate of a start has come.
enum class StartStage : std::uint8_t { kNone, kSearching, kCertified, kRefused, kUsed };

// The motion that a search is made for.
enum class Begins : std::uint8_t { kMotion, kMove, kHalt, kCourse };

// The search for a start, a pending move or course, or a halt of the ball from where the masses hold.
struct StartSearch {
  StartStage stage = StartStage::kNone;
  Begins what = Begins::kMotion;
  std::int64_t tick = 0;       // at whose start the ball is that of `robot`; 0 for a start, which may come at any tick
  std::int64_t from_tick = 0;  // at whose start the motion begins
  RobotState robot;            // for which the search was made
  int attempt = 0;
  Breach breach;  // of the last attempt, the shortest stretch
  Wide breach_s = 0;
};

// A halt of the ball, from the operator's command on.
struct HaltState {
  bool asked = false;
  bool begun = false;          // the masses follow it; before, the motion goes on until a stop of the halt is certified
  std::int64_t from_tick = 0;  // at whose start it began
  std::int64_t predicted_tick = 0;  // at whose start the candidate begins it that `rollout` predicts
  bool predicts = false;
  std::int64_t rollout_tick = 0;  // at whose start `rollout` begins
  HaltRollout rollout;
  PerMass<Real> wish{};  // of the last tick, once begun
  int slow_ticks = 0;    // in which the ball has been slower than rest
  // Speed at the end of the last prediction that found no rest; 0: none was complete, or it found one.
  Real without_rest_mps = 0;
};

// The governor of the running motion.
struct GoverningState {
  GovernorParams params;  // set by reset(); `uncertain` is that of the last tick
  GovernorState governor;
  GovernorReport report;  // of the last tick that was governed
  bool governs = false;   // each tick's motion passes the governor
  StartSearch start;
  HaltState halt;
  Sensitivity sensitivity;
  PerMass<Real> swing_acceleration{}, swing_jerk{};  // of the masses at the start of the next tick
  std::int64_t certificate_tick = 0;                 // switch of the certificate whose path is watched
  bool expects = false;                              // expected_B_radps is that of the next tick
  Vector3 expected_B_radps = Vector3::Zero();
  Vector3 off_path_B_radps = Vector3::Zero();
  Vector3 sensed_B_radps = Vector3::Zero();  // Omega at the start of the last governed tick
  Vector3 calm_B_radps = Vector3::Zero();    // the same without the swing of the masses
};

struct ControllerState {
  Mode mode = Mode::kDisarmed;
  std::uint32_t faults = 0;
  bool ticked = false;  // there has been a tick since reset()
  std::int64_t last_tick = 0;
  std::int64_t start_tick = 0;  // tick at whose start the active profiles are at time 0
  bool started = false;         // a motion or a move has begun since reset(): motions start from where the masses stand
  bool moving = false;          // active profiles are in force; otherwise the masses hold at hold_position
  bool braking = false;         // the active profiles are stops
  PerMass<Profile> active{};    // the scenario's motion, a move, or a stop from where one of them is
  TrackingState tracking;
  GoverningState governing;
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
  CourseState course;
  MassMotion now;  // commanded at the start of the last tick
  MassMeter mass_meter;
  MassMotion measured_masses;  // at the start of the last tick; used where there is an IMU
  FilterState filter;
  Estimate estimate;  // at the start of the last tick; not valid where the attitude is sensed
  ContactMeter contact_meter;
  SlipFriction slip_friction;
  MeasuredContact measured;  // by the last tick
  bool at_rest = true;       // from the start of the next tick on
};

inline std::size_t at(int i) { return static_cast<std::size_t>(i); }

// Tick numbers come from outside: sums and differences wrap, they do not overflow.
inline std::int64_t plus(std::int64_t tick, int n) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(tick) + static_cast<std::uint64_t>(n));
}
inline std::int64_t minus(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b));
}

}  // namespace ballast::firmware
