// Status of the controller after a control tick. Types only.
#pragma once

#include "firmware/estimation/estimate.h"
#include "firmware/model/ball.h"
#include "firmware/motion/profile.h"
#include "firmware/motion/step_command.h"
#include "firmware/safety/fault.h"
#include "firmware/safety/mode.h"

namespace ballast::firmware {

// Least and greatest of the paper's closed forms along profiles, from profile time 0 to horizon_s.
struct Prediction {
  Wide duration_s = 0;
  Wide horizon_s = 0;  // the predicted part: duration_s, or less of a long motion
  Real normal_force_min_n = 0;
  Real mu_required_max = 0;  // f_s / N; +infinity where N <= 0
  Real margin_min = 0;       // 1 - f_s / (mu_s N); 1 with perfect friction; -1 where N <= 0
};

// Reason for which the operator's last command was not obeyed. The numbers are those of controller_status_t.
enum class Refusal : std::uint8_t {
  kNone = 0,           // it was obeyed, or there was none
  kMode = 1,           // not in this mode, or not healthy
  kNoMass = 2,         // the move names no mass
  kUnknownMass = 3,    // the move names a mass that does not exist; value: its number
  kTarget = 4,         // not finite, or too many steps away; value: the target
  kSpeedFraction = 5,  // outside 0 < .. <= 1; value: the fraction
  kVelocity = 6,       // the motion, begun from where the masses stand, breaks a limit; value: its extreme
  kAcceleration = 7,
  kJerk = 8,
  kNotPlanned = 9,   // no profile could be made; value: the distance
  kRailEnd = 10,     // the motion, begun from where the masses stand, leaves its rail; value: the position it reaches
  kLowerEnd = 11,    // the move's target is beyond the lower end of its rail, or nearer to it than MotorParams::swing;
                     // value: the least target allowed there
  kUpperEnd = 12,    // the same at the upper end; value: the greatest
  kCancelled = 13,   // a fault came while the move was pending
  kNoEstimate = 14,  // arming: the attitude is to be estimated, and there is no estimate yet
  kNoBackup = 15,    // governed: no stop could be certified; time_s: when the cone breaks, value: f_s / (kappa N) there
  kLiftsOff = 16,    // the same where N falls below its least; value: N
  kNotCertified = 17,  // governed: the ball rolls, or the search for a certificate is under way; value > 0: a move
                       // takes so many seconds, more than time_s, which is the most that can be certified
  kNoRest = 18,        // halt: no rest was found; time_s: how far it was looked for, value: the speed there
  kCourse = 19,     // a part of a course does not continue it, or is no part of one; value: place of the value refused
  kLate = 20,       // the course's first tick came before it was certified; value: that tick
  kOffCourse = 21,  // the course does not begin where mass `motor` will be; value: how far off
};

struct RefusalReport {
  Refusal reason = Refusal::kNone;
  int motor = -1;
  int piece = -1;  // of the motion
  Wide value = 0;
  Wide time_s = 0;  // after the beginning of what was refused
};

// First motion that could not be stepped since the faults were last cleared.
struct StepOverload {
  StepTrouble trouble;
  int motor = -1;
  std::int64_t tick = 0;  // in which the steps would have been executed
};

// The governor's part in this tick, and its certificate. All zero while it does not command.
struct GovernorStatus {
  bool governs = false;
  bool bent = false;                   // the command for the next tick is not the wished one
  bool backup = false;                 // the masses follow the backup
  Real backup_margin = 0;              // least 1 - (f_s + that by belief_error) / (kappa N) along the certified backup
  std::int64_t backup_until_tick = 0;  // up to which it is certified; -1: for ever
  Real allowance = 0;                  // part of N kept free for motors, estimate and belief
};

// How far the ball still rolls, said before it is halted.
struct HaltStatus {
  bool said = false;
  std::int64_t tick = 0;  // at whose start the halt begins
  Real distance_m = 0;    // along the path from there
  Wide duration_s = 0;
};

// Courses that operators have handed over.
struct CourseStatus {
  std::int64_t in_force = 0;  // number of the course that the masses follow; 0: the parameters' motion, or none
  std::int64_t tick = 0;      // at whose start it began, or the parameters' motion that runs; 0: neither
  std::int64_t coming = 0;    // number of the course that arrives, or waits for its certificate or its tick; 0: none
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
  PerMass<ProfilePoint> next{};  // commanded at the start of the next tick, whose steps go with this
  RollingForces predicted;    // closed forms, commanded masses, sensed or estimated attitude and rate; NaN if those are
                              // no possible numbers: then mu_required is +infinity and margin -1
  Real mu_required = 0;       // f_s / N; +infinity where N <= 0
  Real margin = 0;            // 1 - f_s / (mu_s N); 1 with perfect friction; -1 where N <= 0
  std::int64_t overruns = 0;  // kept by the HAL's clock
  PerMass<std::int64_t> steps_issued{};  // pulses in either direction
  StepOverload overload;                 // kNone: there was none
  std::int64_t operator_commands = 0;    // given since reset(), obeyed or not
  RefusalReport refusal;                 // of the operator's last command; stays until the next
  std::int64_t plan_tick = 0;            // at whose start the last stop or move since reset() begins; 0: there was none
  bool planned = false;                  // its prediction is complete
  Prediction plan;                       // until then zeros, but for the duration
  Estimate estimate;                     // at the start of this tick; not valid where the attitude is sensed
  MeasuredContact measured;              // of the IMU's newest sample
  GovernorStatus governor;
  HaltStatus halt;
  Wide motion_delay_s = 0;  // by which the time of a tracked motion is behind the time since its start
  Real slip_friction = 0;   // f_s / N measured while the ball slipped, the least of its slips; +infinity: it has not
  CourseStatus course;
};

}  // namespace ballast::firmware
