// The parts of a control tick, in the order in which tick() uses them.
#pragma once

#include "firmware/control/inputs.h"
#include "firmware/control/params.h"
#include "firmware/control/state.h"
#include "firmware/safety/modes.h"

namespace ballast::firmware {

// --- causes.cpp: judges the inputs of a control tick ---

// The order of a tick after the one before.
enum class Order : std::uint8_t { kInOrder, kRepeated, kBroken };

[[nodiscard]] Order order_of(const ControllerState& state, std::int64_t tick);

// Greatest number of a sensor or an estimate: 1e15, that of a scenario, as a power of 2 that is exact in single
// precision too. Forces from greater rates may overflow, and could then neither be judged nor compared.
[[nodiscard]] bool possible(Real value);
[[nodiscard]] bool possible(const Vector3& v);

// Tells a rotation from garbage: rounding, in single precision too, stays a thousand times below the tolerance, and a
// lost or broken component is far above. NaN and infinity are none.
[[nodiscard]] bool is_rotation(const Quaternion& q);

// True if the rates and accelerations are finite, and so is the attitude where it is sensed; it then has about unit
// length.
[[nodiscard]] bool valid(const ControllerParams& params, const Sensors& sensors);

// Returns the sensed attitude with unit length. `sensors` are valid.
[[nodiscard]] Quaternion attitude(const Sensors& sensors);

// Returns the bits of the world's faults that are present in this tick. state.now is the commanded motion,
// state.estimate that of this tick, state.measured that of the tick before.
[[nodiscard]] std::uint32_t causes_of(const ControllerParams& params, const ControllerState& state,
                                      const Inputs& inputs, Order order);

// --- sensing.cpp: what the controller knows of the ball ---

// The attitude and the rate that the controller computes with.
struct BallMotion {
  bool known = false;                  // false: the rest is no motion
  Quaternion orientation{1, 0, 0, 0};  // body -> space, unit
  Vector3 angular_velocity_B_radps = Vector3::Zero();
};

// Returns the estimated motion, or the sensed one, as the parameters have it.
[[nodiscard]] BallMotion ball_motion(const ControllerParams& params, const ControllerState& state,
                                     const Sensors& sensors);

// Forgets every sample.
void reset_sensing(const ControllerParams& params, ControllerState& state);

// Sets state.measured_masses and state.estimate, at the start of this tick. state.now is the commanded motion.
void sense(const ControllerParams& params, const Inputs& inputs, ControllerState& state);

// --- commanded.cpp: the motion that the masses are commanded to follow ---

// Profile time at the start of a tick.
[[nodiscard]] Wide profile_time(const ControllerParams& params, const ControllerState& state, std::int64_t tick);

// Commanded point of mass i at the start of a tick.
[[nodiscard]] ProfilePoint commanded(const ControllerParams& params, const ControllerState& state, std::int64_t tick,
                                     int i);

// True if all masses are commanded to rest from the start of a tick on.
[[nodiscard]] bool at_rest_from(const ControllerParams& params, const ControllerState& state, std::int64_t tick);

// Puts the profiles in `active` into force from the start of `next` on.
void begin(ControllerState& state, std::int64_t next);

// Makes the masses hold where their profiles are at the start of `tick`.
void hold(const ControllerParams& params, ControllerState& state, std::int64_t tick);

// --- tracking.cpp: the motion along the reference (firmware/tracking) ---

// The motion that the masses follow, or will follow.
struct Followed {
  const PerMass<Profile>& motion;
  const ReferenceTable& reference;
  MotionClock clock;
  bool rebased;  // it begins at rest in `origin`
  const PerMass<Wide>& origin;
  const PerMass<Real>* rest_offset = nullptr;  // the masses rest, so far from the motion's end; null: they do not
};
[[nodiscard]] Followed followed(const ControllerParams& params, const ControllerState& state);
[[nodiscard]] Followed coming_course(const ControllerState& state);

// Begins to command each tick anew from the start of `next` on: by the feedback along the reference, or without it.
void begin_tracking(ControllerState& state, std::int64_t next, bool feeds);

// The motion of a start from here on: the parameters' at first, later one from where the masses stand.
void set_origin(ControllerState& state);

// The acceleration that a motion asks of the masses of this robot, at a time after its start: by the feedback, where
// `feeds`, and otherwise back to the motion's positions.
[[nodiscard]] Wish wish_at(const ControllerParams& params, const Followed& motion, const Vector2& integral_W_ms,
                           Wide time_s, bool feeds, const RobotState& robot);
// The same for the profiles in `active`, at a profile time.
[[nodiscard]] Wish wish_of_active(const ControllerParams& params, const ControllerState& state, Wide time_s,
                                  const RobotState& robot);

// Where mass i will be commanded when the course that comes begins.
[[nodiscard]] ProfilePoint motion_at_course(const ControllerParams& params, const ControllerState& state, int i);

// Puts the motion of the tick `next` into `active`.
void track(const ControllerParams& params, const Inputs& inputs, ControllerState& state, std::int64_t next);

// --- governing.cpp: the governor (firmware/governor) ---

// Forgets every certificate, and certifies the first start.
void reset_governing(const ControllerParams& params, ControllerState& state);

// Begins to search a certificate for a later start, where it is armed and the ball is another than before.
void watch_start(const ControllerParams& params, const Inputs& inputs, ControllerState& state);
// Continues the search, while the masses hold.
void search_start(const ControllerParams& params, ControllerState& state);

// Begins to search a certificate for the move in `active`, which is pending up to state.plan_tick.
void begin_move_search(const ControllerParams& params, const Inputs& inputs, ControllerState& state);
// Longer moves cannot be certified.
[[nodiscard]] Wide longest_governed_move_s(const ControllerParams& params, const ControllerState& state);
// Ticks that such a search likely takes, unless the move nearly slips.
[[nodiscard]] int ticks_of_move_search(const ControllerParams& params, const ControllerState& state);

// The reason why the motion or the move cannot be started under the governor; none: it can, or nothing is governed.
[[nodiscard]] RefusalReport judge_start(const ControllerParams& params, const ControllerState& state);
void begin_governing(const ControllerParams& params, const Inputs& inputs, ControllerState& state, std::int64_t next);

struct TickToGovern {
  std::int64_t tick = 0;  // the tick that is commanded
  BallMotion motion;      // at the start of the tick before, known
  Vector2 place_W_m = Vector2::Zero();
  bool held = false;  // the ball is set down in the tick before
  PerMass<ProfilePoint> from{};
  PerMass<Wide> wanted{};             // accelerations at the tick's end, before the motors' limits
  PerMass<Wide> lowest{}, highest{};  // accelerations that the motors reach at the tick's end
};
// The greatest jerk of mass i where its motion's acceleration changes by `jump` in the tick: the nominal follows that,
// and the backup does not.
[[nodiscard]] Wide governed_jerk(const GoverningState& governing, int i, Wide jump, Wide period_s);
// The motion under the governor is to become a halt of the ball.
void begin_halt(ControllerState& state);
// The masses hold, and the ball that rolls with them is to be halted: begins to search a certificate.
void ask_for_halt(const ControllerParams& params, const Inputs& inputs, ControllerState& state);
// Begins that halt with the tick `next` if it is due. Returns the reason where it cannot be.
[[nodiscard]] RefusalReport await_halt(const ControllerParams& params, const Inputs& inputs, ControllerState& state,
                                       std::int64_t next);
// The ball that is halted, or that an armed robot lets roll, has been at rest for kRestTime_s.
[[nodiscard]] bool halted(const ControllerParams& params, const ControllerState& state);
// The halt commands the tick that begins at the start of `tick`, if its stop is certified.
[[nodiscard]] bool halts(const GoverningState& governing, std::int64_t tick);
// The halt's accelerations in that tick, and how much they have changed since the tick before.
struct HaltWish {
  PerMass<Real> wish{}, change{};
};
[[nodiscard]] HaltWish wish_of_halt(const ControllerParams& params, const ControllerState& state,
                                    const TickToGovern& now);

// Bends the accelerations with which the first tick of a motion begins, in `now`.
void bend_beginning(const ControllerParams& params, const ControllerState& state, TickToGovern& now);
// Bends the accelerations wished for the tick's end, which lie inside of those limits.
void govern_tick(const ControllerParams& params, const TickToGovern& now, ControllerState& state,
                 PerMass<Wide>& accelerations);

// Begins to search a certificate for the course that comes, while the masses hold. False: the ball is not known.
[[nodiscard]] bool search_course(const ControllerParams& params, const Inputs& inputs, ControllerState& state);
// The search's verdict for a course that could begin with the next tick.
struct CourseVerdict {
  bool decided = false;
  RefusalReport refusal;  // none: the course begins
};
[[nodiscard]] CourseVerdict judge_course(const ControllerParams& params, const Inputs& inputs,
                                         const ControllerState& state);
// Begins the course with the tick `next`, from masses that hold.
void set_out(const ControllerParams& params, ControllerState& state, std::int64_t next);
// The motion under the governor is to become the course that comes, at its tick.
void await_course(const ControllerParams& params, ControllerState& state);
// Ticks that its certificate likely takes, if it begins `left` ticks from now. A search that is cut off would cost the
// old motion its next certificate.
[[nodiscard]] std::int64_t ticks_of_course_search(const GoverningState& governing, std::int64_t left);
// The reason why it cannot; none: it still can, or it begins with the tick `next`.
[[nodiscard]] RefusalReport watch_course(const ControllerState& state, std::int64_t next);
// It does not become it any more.
void forget_course(GoverningState& governing);

// --- course.cpp ---

// Takes a part of a course, or returns the reason why not.
[[nodiscard]] RefusalReport take_part(const ControllerParams& params, const CoursePart& part, ControllerState& state);
// Checks the course that has arrived, and begins it from masses that hold once it is certified. A course that cannot
// begin is dropped, with the reason in state.refusal.
void advance_course(const ControllerParams& params, const Inputs& inputs, const GuardState& guards,
                    ControllerState& state);
// Forgets the course that comes.
void drop_course(ControllerState& state);
// Lets the masses follow the course that comes, which begins at the start of `tick`.
void put_in_force(ControllerState& state, std::int64_t tick);

// --- operator.cpp ---

// The microsteps from the start to this position can be counted.
[[nodiscard]] bool countable_steps(const ControllerParams& params, int i, Wide position);

// Counts the ticks in which an armed robot's ball has been slower than rest, on from those of a halt (halted()).
void watch_rest(const ControllerParams& params, const Inputs& inputs, ControllerState& state);

// Obeys the operator's command, if there is one, or keeps the reason why not.
void obey(const ControllerParams& params, const Inputs& inputs, const GuardState& guards, ControllerState& state);

// --- stopping.cpp ---

// Plans a stop of all masses from the start of `next` on, in the time that the slowest of them needs, and puts it into
// force. A mass that would leave its rail by being stretched takes its own shortest time.
void begin_stop(const ControllerParams& params, ControllerState& state, std::int64_t next);

// --- steps.cpp: step pulses of all motors for one control tick ---

// Empties `out`: a command for `tick` without pulses.
void clear(const ControllerParams& params, const ControllerState& state, std::int64_t tick, StepCommand& out);

// Makes the steps of all motors, into a cleared command. False: some motor's profile cannot be stepped. The first such
// overload since the faults were cleared is kept.
[[nodiscard]] bool generate_all(const ControllerParams& params, ControllerState& state, StepCommand& out);

// Makes the steps of a stop after an overload: all masses stop, and a motor whose stop cannot be stepped either holds.
// validate() admits no motion that comes here; this is the second line of defence.
void stop_overloaded(const ControllerParams& params, ControllerState& state, StepCommand& out);

// Takes over the counts of a command that is on its way.
void count(const StepCommand& steps, ControllerState& state);

}  // namespace ballast::firmware
