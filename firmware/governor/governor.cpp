#include "firmware/governor/governor.h"

#include <cmath>

namespace ballast::firmware {

namespace {

Certificate certificate_of(const Rollout& candidate, Wide control_period_s) {
  Certificate out;
  out.valid = true;
  out.switch_tick = candidate.schedule().backup_from();
  out.margin = candidate.margin();
  out.until_tick = candidate.end() == RolloutEnd::kForEver
                       ? kForEverTick
                       : candidate.start_tick() + static_cast<std::int64_t>(candidate.time_s() / control_period_s);
  return out;
}

// A search is expected to take longer than those before it, by this.
constexpr Real kToSpare = Real(1.25);

// A governor rests after a search for this part of a long one.
constexpr int kRestPart = 32;

// Until the masses of a plan rest, after its switch.
std::int64_t brake_ticks(const GovernorParams& params) {
  return static_cast<std::int64_t>(12 * Wide{params.brake_time_s} / params.control_period_s);
}

bool renews_backup(const Schedule& schedule) {
  return schedule.backup_from() == schedule.until && schedule.from >= schedule.to;
}

// Ticks for which a candidate follows the nominal beyond the tick at which it is ready. Where that leads to a stop that
// breaks the cone, a later stop may not: the attempts go through kStretches, each longer than the one before. The last
// one goes to where the nominal rests, if it does.
// `step`: 2 for each attempt, so that a start can try the stretches between.
std::int64_t stretch_of(const GovernorParams& params, int step, std::int64_t left_ticks) {
  const std::int64_t more = step + 2;
  if (step < 2 * kStretches - 1) return params.stretch_ticks * more * more / 4;
  return left_ticks > params.search_ticks ? left_ticks : params.search_ticks;
}

// Ticks that a search takes with this stretch of the nominal in it, if steps are not short. One that takes longer is
// begun anew.
std::int64_t ticks_of_search(const GovernorParams& params, std::int64_t stretch_ticks) {
  const Wide steps =
      static_cast<Wide>(stretch_ticks - params.stretch_ticks) * params.control_period_s / Wide{params.step_s};
  return params.search_ticks + static_cast<std::int64_t>(steps * kMovingStepWork / params.work_per_tick) + 1;
}

// A certificate that reaches far ahead is certified again from the state of today: a prediction of seconds drifts.
bool renews_certificate(const GovernorParams& params, const GovernorState& state, std::int64_t tick) {
  return state.mode == GovernorMode::kNominal && state.attempts == 0 && state.trusted && !state.changing &&
         state.certificate.switch_tick - tick > 3 * std::int64_t{params.search_ticks};
}

// The tick up to which a candidate can follow a nominal that comes to rest, with time for another search should this
// one be broken; 0: not beyond what is certified. A ball that is certified up to its rest needs no stop on the way.
std::int64_t extended_to(const GovernorParams& params, std::int64_t tick, const GovernorState& state) {
  const std::int64_t leaves = state.certificate.switch_tick, end = state.nominal_end_tick;
  const std::int64_t spare = leaves - tick - params.search_ticks;
  if (state.mode != GovernorMode::kNominal || state.changing || !state.trusted || state.attempts > 0 ||
      tick < state.extend_from_tick || end <= leaves || spare <= 0 || !(state.pace > 0)) {
    return 0;
  }
  const Real most = static_cast<Real>(spare) / (kToSpare * state.pace) - static_cast<Real>(brake_ticks(params));
  if (most >= static_cast<Real>(end - tick)) return end;
  const std::int64_t to = most > 0 ? tick + static_cast<std::int64_t>(most) : 0;
  return to > leaves + params.stretch_ticks ? to : 0;
}

// The next candidate, from the state of this tick.
Schedule next_schedule(const GovernorParams& params, std::int64_t tick, const GovernorState& state) {
  Schedule out;
  if (renews_certificate(params, state, tick)) {
    out.until = out.from = out.to = state.certificate.switch_tick;
    return out;
  }
  const int attempt = state.attempts % (kStretches + 1);
  std::int64_t stretch = stretch_of(params, 2 * attempt, state.nominal_end_tick - tick);
  const bool nominal = state.mode == GovernorMode::kNominal;
  const std::int64_t leaves = state.certificate.switch_tick;
  // A certificate that is shorter than a search at its longest is continued nevertheless, where the search is likely
  // over in time.
  if (nominal && !state.changing && attempt == 0 && leaves < tick + ticks_of_search(params, stretch) &&
      leaves > tick + likely_search_ticks(params, state, leaves + stretch - tick)) {
    out.until = out.from = leaves;
    out.to = leaves + stretch;
    return out;
  }
  // A candidate that waits for its tick is followed by a whole search, during which its nominal has to go on.
  const bool waits = !nominal || state.changing || leaves < tick + ticks_of_search(params, stretch);
  if (waits) stretch += params.search_ticks + 1;
  if (nominal && state.changing && state.change_tick != 0) {
    out.until = out.from = state.change_tick;
    out.to = state.change_tick + stretch;
    return out;
  }
  const std::int64_t ready = tick + ticks_of_search(params, stretch) + state.late_ticks;
  if (nominal) {
    // Up to the switch of the certificate in force the nominal runs anyway. A candidate that is ready before continues
    // it; one that is not finds the backup running.
    out.until = leaves < ready ? leaves : ready;
    out.from = ready;
    out.to = ready + stretch;
    return out;
  }
  out.until = out.from = out.to = tick;
  const bool ends = state.certificate.until_tick != kForEverTick;
  if (ends && attempt == kStretches) return out;
  out.from = ready;
  out.to = ready + stretch;
  return out;
}

}  // namespace

void reset(GovernorState& state) {
  state.mode = GovernorMode::kBackup;
  state.certificate = {};
  state.bends.clear(0, {});
  state.searching = false;
  state.changing = false;
  state.change_tick = 0;
  state.nominal_end_tick = 0;
  state.extend_from_tick = kNever;
  state.trusted = true;
  state.off_path = false;
  state.attempts = 0;
  state.late_ticks = 0;
  state.pace = 0;
  state.certified_tick = 0;
}

void change_nominal_at(std::int64_t tick, GovernorState& state) {
  state.changing = true;
  state.change_tick = tick;
  state.searching = false;
  state.attempts = 0;
}

void keep_nominal(GovernorState& state) {
  state.changing = false;
  state.change_tick = 0;
  state.searching = false;
  state.attempts = 0;
}

void change_nominal(GovernorState& state) {
  state.changing = true;
  state.change_tick = 0;
  state.nominal_end_tick = 0;
  state.searching = false;
  state.attempts = 0;
}

void begin_start(const GovernorParams& params, const RobotState& now, std::int64_t tick, std::int64_t from_tick,
                 std::int64_t nominal_end_tick, int attempt, GovernorState& state) {
  reset(state);
  state.nominal_end_tick = nominal_end_tick;
  state.attempts = attempt;
  state.candidate.begin(params, now, tick,
                        {tick, from_tick, from_tick + stretch_of(params, attempt, nominal_end_tick - from_tick)});
  state.searching = true;
}

void adopt_start(const GovernorParams& params, std::int64_t tick, GovernorState& state) {
  const std::int64_t later = tick - state.candidate.schedule().from;
  Certificate adopted = certificate_of(state.candidate, params.control_period_s);
  adopted.switch_tick += later;
  if (adopted.until_tick != kForEverTick) adopted.until_tick += later;
  reset(state);
  state.bends = state.candidate.bends();
  state.bends.shift(later);
  state.certificate = adopted;
  state.mode = GovernorMode::kNominal;
}

void distrust(GovernorState& state) {
  state.off_path = true;
  state.trusted = false;
  state.attempts = 0;
}

std::int64_t likely_search_ticks(const GovernorParams& params, const GovernorState& state, std::int64_t nominal_ticks) {
  if (!(state.pace > 0)) return params.search_ticks;
  return static_cast<std::int64_t>(kToSpare * state.pace * static_cast<Real>(nominal_ticks + brake_ticks(params))) + 1;
}

void detail::time_search(const GovernorParams& params, std::int64_t tick, GovernorState& state) {
  const Rollout& candidate = state.candidate;
  if (candidate.end() != RolloutEnd::kForEver && candidate.end() != RolloutEnd::kHorizon) return;
  const std::int64_t took = tick + 1 - candidate.start_tick();
  const std::int64_t plan = candidate.schedule().backup_from() - candidate.start_tick() + brake_ticks(params);
  const Real pace = static_cast<Real>(took) / static_cast<Real>(plan);
  constexpr Real kForgets = Real(0.75);
  state.pace = std::fmax(pace, kForgets * state.pace);
}

namespace {

// A certificate that reaches far enough needs no next one at once: ticks without a search are cheap.
bool rests(const GovernorParams& params, std::int64_t tick, const GovernorState& state) {
  return state.mode == GovernorMode::kNominal && state.trusted && !state.changing && state.attempts == 0 &&
         tick < state.certified_tick + params.search_ticks / kRestPart &&
         state.certificate.switch_tick - tick > 3 * std::int64_t{params.search_ticks} / 2;
}

void begin_search(const GovernorParams& params, const RobotState& now, std::int64_t tick, GovernorState& state) {
  const std::int64_t extended = extended_to(params, tick, state), leaves = state.certificate.switch_tick;
  state.extends = extended > 0;
  state.candidate.begin(params, now, tick,
                        state.extends ? Schedule{leaves, leaves, extended} : next_schedule(params, tick, state));
  state.searching = true;
}

}  // namespace

void detail::decide(const GovernorParams& params, const RobotState& now, std::int64_t tick, GovernorState& state) {
  if (state.searching && state.candidate.end() != RolloutEnd::kUnderWay) {
    const Schedule& schedule = state.candidate.schedule();
    const bool broken = state.candidate.end() == RolloutEnd::kBroken;
    const bool renewed = schedule.from == schedule.to && schedule.until == schedule.to &&
                         state.mode == GovernorMode::kNominal && schedule.until > state.candidate.start_tick();
    const bool renewal = renews_backup(schedule) && !renewed;
    // A candidate that follows what runs anyway is in force at once; one that goes back to the nominal waits for that.
    const bool continues =
        renewal || (state.mode == GovernorMode::kNominal && schedule.from <= schedule.until && !state.changing);
    if (broken && state.extends) {
      state.searching = false;
      state.extend_from_tick = tick + 4 * std::int64_t{params.search_ticks};
    } else if (broken || (!continues && tick > schedule.from)) {
      state.searching = false;
      ++state.attempts;
      // The certificate in force would break from here: the next one takes its place, whatever its reach.
      if (renewed) state.trusted = false;
    } else if (continues && !renewal && !renewed && state.trusted && schedule.to <= state.certificate.switch_tick) {
      state.searching = false;  // the one in force reaches further
      state.attempts = 0;
      state.certified_tick = tick;
    } else if (continues || tick == schedule.from) {
      state.certificate = certificate_of(state.candidate, params.control_period_s);
      state.bends = state.candidate.bends();
      state.certified_tick = tick;
      state.searching = false;
      state.attempts = renewal ? state.attempts + 1 : 0;
      state.late_ticks = 0;
      if (!renewal) {
        state.mode = GovernorMode::kNominal;
        state.trusted = true;
        state.changing = false;
        state.change_tick = 0;
        state.off_path = false;
      }
    }
  } else if (state.searching && (state.mode == GovernorMode::kBackup || state.changing) &&
             tick > state.candidate.schedule().from && !renews_backup(state.candidate.schedule())) {
    // Later than its adoption tick: the shortest stretch with more time, then the next.
    state.searching = false;
    if (state.late_ticks < 2 * std::int64_t{params.search_ticks}) {
      state.late_ticks += params.search_ticks / 2;
      state.attempts = 0;
    } else {
      ++state.attempts;
    }
  }
  const bool out_of_trust = state.off_path && state.attempts > kStretches;
  if (state.mode == GovernorMode::kNominal && (tick >= state.certificate.switch_tick || out_of_trust)) {
    state.mode = GovernorMode::kBackup;
    if (tick < state.certificate.switch_tick) state.bends.clear(tick, {});  // they are the nominal's
  }
  if (!state.searching && !rests(params, tick, state)) begin_search(params, now, tick, state);
}

namespace {

PerMass<Real> clipped(const Box& box, const PerMass<Real>& u) {
  PerMass<Real> out{};
  for (std::size_t i = 0; i < u.size(); ++i) out[i] = std::fmin(std::fmax(u[i], box.lower[i]), box.upper[i]);
  return out;
}

}  // namespace

void detail::command(const BallParams& ball, const GovernorParams& params, const GovernorState& state,
                     const RobotState& now, const Ramp& ramp, const NominalEnd& nominal, std::int64_t tick,
                     GovernorOutput& out) {
  const bool backup = state.mode == GovernorMode::kBackup;
  // The wish, and what the certified plan bends it by.
  const Wide end_s = static_cast<Wide>(tick + 1 - state.bends.start_tick()) * params.control_period_s;
  const PerMass<Real> bend = state.bends.at(end_s, params.control_period_s);
  PerMass<Real> wish = nominal.wish;
  if (backup) {
    // The wish of a tick's end is that of the state there, as in the rollout.
    RobotState ahead = now;
    ahead.mass_acceleration = ramp.start;
    brake_masses(params, ball.mass_count, ramp.h_s, bend, ahead);
    wish = braking(params, ahead, ball.mass_count);
  }
  for (std::size_t i = 0; i < wish.size(); ++i)
    wish[i] = bend[i] == 0 && !backup ? nominal.reached[i] : wish[i] + bend[i];
  const AffineForces forces = forces_at(ball, params, now);
  Ramp kept = ramp;
  if (params.belief_error.any()) {
    Drift drift;
    drift_at(ball, params, now, forces, ramp.swing, drift);
    kept.belief_n = drift.force_n();
  }
  GovernedRamp end;
  governed_for_ramp(ball, params, now, forces, kept, clipped(ramp.end, wish), end);
  out.acceleration = end.command.u;
  out.end = end.state;
  out.cost = cost_of(end);
  GovernorReport& report = out.report;
  report.backup = backup;
  report.empty = end.command.empty;
  report.bent = false;
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    report.bent |= std::fabs(out.acceleration[i] - nominal.reached[i]) > Real(1e-9) * params.mass[i].max_acceleration;
  }
  report.backup_margin = state.certificate.margin;
  report.backup_until_tick = state.certificate.until_tick;
  const Vector3& f = end.force_W_n;
  report.use = std::isinf(params.friction) ? 0 : use_of(params.friction, std::sqrt(f[0] * f[0] + f[1] * f[1]), f[2]);
  report.allowance = allowance_of(params, end, ball.mass_count);
}

}  // namespace ballast::firmware
