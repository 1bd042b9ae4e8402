// The governor: bends commands so that the ball neither slips nor lifts off, and keeps a certified backup at hand.
//
// Every tick the wished accelerations are projected into the cone of the state (cone.h). That alone can lead into
// states from which no acceleration keeps the cone, so a gatekeeper decides whose wish it is: the nominal's, as long as
// a certificate holds that says "nominal up to its switch tick, then the backup"; else the backup's. A rollout in
// slices over `search_ticks` makes the next certificate while the last one holds.
//
// Source: the gatekeeper of arXiv 2508.09963; the rest is our derivation, tools/docs/governor.md.
//
// Invariants: fixed size, no heap. govern() is called once per control tick, in order, by one thread.
#pragma once

#include <limits>

#include "firmware/governor/rollout.h"

namespace ballast::firmware {

inline constexpr std::int64_t kForEverTick = -1;
inline constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();
inline constexpr int kStretches = 6;
// A start tries the stretches between as well.
inline constexpr int kStartStretches = 2 * kStretches - 1;

// "Nominal up to switch_tick, then the backup" keeps the cone.
struct Certificate {
  bool valid = false;
  std::int64_t switch_tick = 0;
  std::int64_t until_tick = 0;  // kForEverTick: for ever
  Real margin = 0;              // least 1 - f_s / (friction N) along the backup
};

enum class GovernorMode : std::uint8_t { kNominal, kBackup };

struct GovernorState {
  GovernorMode mode = GovernorMode::kBackup;
  Certificate certificate;
  Bends bends;  // of the certificate's plan
  Rollout candidate;
  bool searching = false;             // candidate is under way, or complete and waits for its adoption tick
  bool changing = false;              // the nominal becomes another one at the tick `from` of the candidate's schedule
  std::int64_t change_tick = 0;       // which is this one; 0: as soon as a candidate is certified
  std::int64_t nominal_end_tick = 0;  // the nominal rests from here on; 0: unknown
  std::int64_t extend_from_tick = kNever;  // from here on candidates may go beyond the shortest stretch at once
  std::int64_t certified_tick = 0;         // of the last search that was not broken
  bool extends = false;                    // the candidate does
  bool off_path = false;                   // distrust()
  bool trusted = true;                     // the certificate; false: any other takes its place
  int attempts = 0;                        // since the last certificate: selects the stretch of the nominal
  std::int64_t late_ticks = 0;             // more than usual for the next search, because others were late
  Real pace = 0;                           // ticks of a search per tick of its plan, of late; 0: none is complete yet
};

struct GovernorReport {
  bool bent = false;       // the command is not the nominal's
  bool empty = false;      // no acceleration kept the cone: least violation
  bool backup = false;     // the backup's wish was followed
  Real backup_margin = 0;  // of the certificate
  std::int64_t backup_until_tick = 0;
  Real use = 0;        // f_s / (friction N) of the command by the closed form
  Real allowance = 0;  // part of N that the cone kept free for motors and errors, along the friction
};

struct GovernorOutput {
  PerMass<Real> acceleration{};  // at the tick's end
  RobotState end;                // predicted there
  GovernorReport report;
  int cost = 1;  // of the projection, in steps of a rollout that is not bent
};

// The nominal's accelerations at a tick's end.
struct NominalEnd {
  PerMass<Real> wish{};     // which may be more than the masses can
  PerMass<Real> reached{};  // what they do without a governor
};

// Nothing certified: the backup holds until a candidate is adopted.
void reset(GovernorState& state);

// Begins a candidate for a start or a move: held masses up to `from_tick`, the nominal from there. It is advanced by
// govern() or on its own, and adopted at from_tick. `attempt` selects the stretch of the nominal, 0 to
// kStartStretches: the last one goes to nominal_end_tick, which is 0 where the nominal does not come to rest. A start
// whose candidates are all broken has no certified stop and is refused.
void begin_start(const GovernorParams& params, const RobotState& now, std::int64_t tick, std::int64_t from_tick,
                 std::int64_t nominal_end_tick, int attempt, GovernorState& state);

// Adopts the candidate of begin_start(), which is complete and not broken, for a start at `tick`: its own times are
// moved there.
void adopt_start(const GovernorParams& params, std::int64_t tick, GovernorState& state);

// The ball is not where the certificate in force predicts it: the next certificate replaces it although that one may
// have a longer stretch of the nominal, and if none is found the backup begins.
void distrust(GovernorState& state);

// The nominal is to become another one, such as a halt. Until a candidate is certified that changes over, at the tick
// `from` of its schedule, the certificate in force holds and the caller goes on with the old nominal. `law` of govern()
// is then the old one before that tick and the new one from it on; state.changing falls when it is adopted.
void change_nominal(GovernorState& state);
// The same at a given tick, up to which the certificate in force holds the old nominal.
void change_nominal_at(std::int64_t tick, GovernorState& state);
// The old nominal goes on.
void keep_nominal(GovernorState& state);

// Ticks in which a search that follows the nominal for so long is likely complete, by those before it.
[[nodiscard]] std::int64_t likely_search_ticks(const GovernorParams& params, const GovernorState& state,
                                               std::int64_t nominal_ticks);

// Work that a projection of this cost leaves of a tick's: the two never cost their most in the same tick.
inline int left_work(const GovernorParams& params, int cost) {
  return params.work_per_tick - kMovingStepWork * (cost - 1);
}

// The parts of govern() that do not depend on the nominal.
namespace detail {
// Adopts a finished candidate, switches to the backup where the certificate says so, and begins the next candidate.
void decide(const GovernorParams& params, const RobotState& now, std::int64_t tick, GovernorState& state);
void command(const BallParams& ball, const GovernorParams& params, const GovernorState& state, const RobotState& now,
             const Ramp& ramp, const NominalEnd& nominal, std::int64_t tick, GovernorOutput& out);
// Keeps the pace of a search that may have ended in this tick.
void time_search(const GovernorParams& params, std::int64_t tick, GovernorState& state);
}  // namespace detail

// Returns the accelerations of the masses at the end of `tick`, in which they go linearly from ramp.start to the
// command, inside of ramp.end. `now`: the believed state at its start, masses as commanded. `calm`: the same without
// the swing of the masses, where candidates begin. `law(time_s, state)` predicts the Wish of a time after the start of
// the tick at which the candidate began (state.candidate.start_tick()) and a state. `spent`: work of the search that
// gives way to other work of this tick.
template <class Law>
void govern(const BallParams& ball, const GovernorParams& params, const RobotState& now, const RobotState& calm,
            const Ramp& ramp, const NominalEnd& nominal, const Law& law, std::int64_t tick, int spent,
            GovernorState& state, GovernorOutput& out) {
  detail::decide(params, calm, tick, state);
  detail::command(ball, params, state, now, ramp, nominal, tick, out);
  // The search waits for a costly projection. A little is done in some ticks whatever that costs, so that it ends.
  const int least = tick % 4 == 0 ? 1 : 0;
  const int left = left_work(params, out.cost) - spent;
  const int work = left > least ? left : least;
  if (state.candidate.end() != RolloutEnd::kUnderWay) return;
  state.candidate.advance(ball, params, law, state.bends, work);
  detail::time_search(params, tick, state);
}

}  // namespace ballast::firmware
