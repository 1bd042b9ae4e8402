#include "tools/sil/run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <limits>
#include <thread>

#include "tools/summary/controller_words.h"
#include "tools/sil/least_margin.h"
#include "tools/faults/sensor_faults.h"
#include "tools/sil/step_ledger.h"

namespace ballast::sil {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::int64_t kCountdown = 2;

// After a move's last step, where the run would end before: what is left of a swing at the default damping ratio of 0.2
// is exp(-0.2 * 2 pi * 10), 3e-6 of it.
constexpr double kSwingsToRest = 10;

void record(Recorder& recorder, const Lap& lap) {
  recorder.begin_lap();
  if (lap.command) recorder.record(hal::kChannelOperator, *lap.command);
  for (const operator_t& heard : lap.heard)
    recorder.record_heard(hal::kChannelOperator, heard, lap.plant.contact.utime);
  recorder.record(hal::kChannelContact, lap.plant.contact);
  recorder.record(hal::kChannelPlantState, lap.plant.state);
  recorder.record(hal::kChannelSensors, lap.plant.sensors);
  if (!lap.monitor_silent) recorder.record(hal::kChannelTrip, lap.trip);
  if (!lap.has_controller || lap.controller_silent) return;
  recorder.record(hal::kChannelControllerStatus, lap.status);
  recorder.record(hal::kChannelStepCommand, lap.steps);
}

// Step counts and rates of what the motors have executed.
class PulseRecord {
 public:
  void add(double start_s, double until_s, std::span<const sim::StepPulse> pulses) {
    for (const auto& pulse : pulses) {
      const double time_s = start_s + pulse.offset_s;
      if (time_s > until_s) break;
      const auto i = static_cast<std::size_t>(pulse.motor);
      if (motors[i].steps++ > 0) {
        motors[i].max_step_rate_hz = std::max(motors[i].max_step_rate_hz, 1 / (time_s - last_s_[i]));
      }
      last_s_[i] = time_s;
    }
  }
  std::array<MotorRecord, sim::kMaxMasses> motors{};

 private:
  std::array<double, sim::kMaxMasses> last_s_{};
};

// Whether the masses rest: for one swing of the slowest motor none has moved faster than a twentieth of the fastest
// mass's top speed in this run (in m/s: a load that still shifts as the ball rolls on keeps a held mass moving a
// little).
class RestWatch {
 public:
  explicit RestWatch(const sim::Scenario& scenario) : scenario_(scenario) {
    for (const auto& mass : scenario.masses) {
      const double lever = mass.rail.shape == firmware::RailShape::kCircle ? mass.rail.radius_m : 1;
      const double shaft = mass.motor.shaft_ratio;
      const double inertia = mass.mass_kg * lever * lever + mass.motor.rotor_inertia_kgm2 * shaft * shaft;
      const double stiffness = mass.motor.steps_per_revolution / 4.0 * mass.motor.holding_torque_nm * shaft * shaft;
      swing_s_ = std::max(swing_s_, 2 * M_PI * std::sqrt(inertia / stiffness));
    }
  }
  bool see(const sim::Plant::Sample& sample) {
    double fastest = 0;
    for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
      const auto& rail = scenario_.masses[i].rail;
      const double lever = rail.shape == firmware::RailShape::kCircle ? rail.radius_m : 1;
      fastest = std::max(fastest, lever * std::abs(sample.mass_velocity[i]));
    }
    top_mps_ = std::max(top_mps_, fastest);
    if (fastest > top_mps_ / 20) moved_s_ = sample.time_s;
    at_rest_ = top_mps_ == 0 || sample.time_s - moved_s_ >= swing_s_;
    return at_rest_;
  }
  [[nodiscard]] bool at_rest() const { return at_rest_; }
  [[nodiscard]] double swing_s() const { return swing_s_; }

 private:
  const sim::Scenario& scenario_;
  double swing_s_ = 0;
  double top_mps_ = 0;
  double moved_s_ = 0;
  bool at_rest_ = false;
};

// Keeps the controller's plans with what the contact then shows.
class PlanWatch {
 public:
  explicit PlanWatch(double period_s) : period_s_(period_s) {}
  void see(const Lap& lap, RunResult& result) {
    see_contact(lap.plant.contact);  // of the plan in force: one that this tick has brought about begins with the next
    const controller_status_t& status = lap.status;
    // A move that was cancelled before it began leaves no record.
    if (current_ && status.plan_tick != plan_tick_ && status.tick < plan_tick_) {
      current_->reset();
      current_ = nullptr;
    }
    // One over in its own tick, as a move to where the masses are, is none.
    if (status.plan_duration_s > 0 && (!current_ || status.plan_tick != plan_tick_)) {
      plan_tick_ = status.plan_tick;
      const bool moves =
          status.mode == controller_status_t::MODE_PENDING || status.mode == controller_status_t::MODE_MOVING;
      current_ = moves ? &result.move : &result.stop;
      *current_ = PlanRecord{static_cast<double>(plan_tick_) * period_s_, kNotPredicted, std::nullopt};
      (*current_)->predicted.duration_s = status.plan_duration_s;
    }
    if (current_ && status.planned != 0 && status.plan_tick == plan_tick_) {
      (*current_)->predicted = {status.plan_duration_s, status.plan_horizon_s, status.plan_normal_force_min_n,
                                status.plan_mu_required_max, status.plan_margin_min};
    }
  }

 private:
  void see_contact(const contact_t& contact) {
    if (!current_ || contact.tick < plan_tick_) return;
    PlanRecord& plan = **current_;
    // A plan may end between two ticks.
    if (static_cast<double>(contact.tick - plan_tick_) > std::ceil(plan.predicted.duration_s / period_s_)) return;
    see_margin(contact, plan.seen_margin_min);
  }

  // A plan's, until the controller has said more of it than how long it takes.
  static constexpr firmware::Prediction kNotPredicted{0, 0, std::numeric_limits<double>::quiet_NaN(),
                                                      std::numeric_limits<double>::infinity(), -1};

  double period_s_;
  std::optional<PlanRecord>* current_ = nullptr;
  std::int64_t plan_tick_ = 0;
};

}  // namespace

const char* to_string(EndReason reason) {
  switch (reason) {
    case EndReason::kCompleted:
      return "completed";
    case EndReason::kSlipped:
      return "slipped";
    case EndReason::kDetached:
      return "detached";
    case EndReason::kTripped:
      return "tripped";
    case EndReason::kInconsistent:
      return "inconsistent";
    case EndReason::kStepTiming:
      return "step_timing";
  }
  return "";
}

RunResult run(const sim::Scenario& scenario, Peers& peers, Recorder& recorder, const RunOptions& options) {
  RunResult result;
  result.asked_speed = options.speed;
  const bool has_controller = scenario.run.actuation == sim::Actuation::kStepper;
  const double period_s = scenario.run.control_period_s;
  const auto wall_start = Clock::now();
  sim::Plant plant(scenario);
  PulseRecord pulse_record;
  std::vector<sim::StepPulse> pulses;
  step_command_t due{};                        // the steps of the tick about to be executed
  std::optional<controller_status_t> heard;    // the controller's, of the tick before: it asks for those steps
  std::optional<std::int64_t> stop_done_tick;  // at whose start the stop's last step has been executed
  std::optional<std::int64_t> move_done_tick;  // likewise the move's
  bool was_pending = false;                    // the move that was asked for, when the controller was last heard
  bool already_there = false;                  // a move to where the masses are is over as it begins
  RestWatch rest(scenario);
  PlanWatch plans(period_s);
  auto next_progress = wall_start;
  std::optional<StepTimingCheck> step_check;
  if (options.check_steps && has_controller) step_check.emplace(scenario);
  std::deque<step_command_t> history;
  double end_s = scenario.duration_s;
  if (options.move) result.move_end = MoveEnd{*options.move};
  SensorFaults sensor_faults(scenario);
  StepLedger ledger;
  std::int64_t commands_missed = 0;    // on end
  std::int64_t silent_ticks = 0;       // of the controller, on end
  std::int64_t operator_commands = 0;  // as it counted them last
  bool armed = false;                  // at least once
  // Where the run sleeps between two ticks, who watches it would learn of the one only after that sleep.
  const bool records_meanwhile = peers.are_waited_for() && options.speed <= 0;
  std::optional<Lap> unrecorded;
  const auto record_it = [&] {
    if (unrecorded) record(recorder, *unrecorded);
    unrecorded.reset();
  };

  // What is known at the end, good or bad.
  const auto finished = [&] {
    record_it();
    result.wall_time_s = std::chrono::duration<double>(Clock::now() - wall_start).count();
    result.end_text = plant.end_text();
    result.masses_rested = rest.at_rest();
    result.log_bytes = recorder.bytes();
    result.final_sample = plant.sample();
    result.regimes = plant.regimes();
    result.impacts = plant.impacts();
    result.rolling_lost = plant.rolling_lost();
    result.extrema = plant.extrema();
    result.friction_shares = plant.shares_at_mu_required_max();
    for (int i = 0; i < sim::kMaxMasses; ++i) {
      result.motor_extrema[static_cast<std::size_t>(i)] = plant.motor_extrema(i);
      result.end_stops[static_cast<std::size_t>(i)] = plant.end_stop(i);
    }
    result.motors = pulse_record.motors;
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      result.motor_energy[i] = plant.motor_energy(static_cast<int>(i));
      result.motors[i].steps_behind = plant.motor_steps_behind(static_cast<int>(i));
      result.motors[i].slips = plant.motor_slips(static_cast<int>(i));
      result.motors[i].undelivered_steps = ledger.missing(i);
    }
    if (step_check) result.step_timing = step_check->record();
    return result;
  };

  // A ball that breaks the envelope as it is set down needs no countdown.
  std::int64_t tick = has_controller && plant.end() == sim::PhysicsEnd::kNone ? -kCountdown : 0;
  for (;; ++tick) {
    const sim::Plant::Sample sample = plant.sample();
    const bool at_rest = rest.see(sample);
    const bool stopped = stop_done_tick && tick >= *stop_done_tick && at_rest;
    if (move_done_tick && tick >= *move_done_tick) result.move_end->steps_made = true;
    const bool moved = move_done_tick && tick >= *move_done_tick && (at_rest || already_there);
    const bool last = plant.end() != sim::PhysicsEnd::kNone || plant.time_s() >= end_s || stopped || moved;

    std::optional<sim::Plant::ContactForces> commanded;
    if (heard && tick >= 0 && sample.time_s == static_cast<double>(tick) * period_s) {
      commanded = plant.contact_forces(heard->next_position, heard->next_velocity, heard->next_acceleration);
    }

    Lap lap;
    lap.meanwhile = record_it;
    lap.has_controller = has_controller;
    lap.plant = plant_messages(scenario, sample, tick, last, commanded);
    sensor_faults.suffer(sample.time_s, lap.plant.sensors);
    if (tick < 0 && !(options.by_hand && tick > -kCountdown)) {
      firmware::OperatorInput input = firmware::OperatorCommand::kArm;
      if (tick > -kCountdown) input = firmware::OperatorCommand::kStart;
      if (tick > -kCountdown && options.move) input = *options.move;
      lap.command = hal::to_message(input, tick, tick + kCountdown + 1, period_s);
    }
    result.status = peers.exchange(lap);
    result.refused = peers.refused();
    if (result.status != hal::Status::kOk) {
      result.trouble = peers.trouble();
      return finished();
    }
    if (records_meanwhile) {
      record_it();  // of peers that did not take their time
      unrecorded = lap;
    } else {
      record(recorder, lap);
    }
    if (options.observe) options.observe(lap, sample);
    result.last_tick = tick;
    result.operators_heard = result.operators_heard || !lap.heard.empty();
    const auto lost = [&](const std::string& why) {
      result.status = hal::Status::kPeerLost;
      result.trouble = why;
      return finished();
    };
    if (!lap.monitor_silent) {
      if (result.trip.tripped != 0 && lap.trip.tripped == 0) {
        return lost("the monitor takes back its trip (tick " + std::to_string(tick) + "): it was started again");
      }
      result.trip = lap.trip;
    }
    const bool answered = has_controller && !lap.controller_silent;
    heard.reset();
    if (answered) {
      silent_ticks = 0;
      if (lap.status.tick == tick) heard = lap.status;
      plans.see(lap, result);
      result.motor_share.see(lap.plant.contact);
      if (lap.status.operator_commands < operator_commands) {
        return lost("the controller was started again: in tick " + std::to_string(lap.status.tick) + " it counts " +
                    std::to_string(lap.status.operator_commands) + " commands, and " +
                    std::to_string(operator_commands) + " before");
      }
      operator_commands = lap.status.operator_commands;
    } else if (has_controller && ++silent_ticks == kGivenUpTicks) {
      return lost("controller lost: silent for " + std::to_string(kGivenUpTicks) + " ticks at tick " +
                  std::to_string(tick));
    }
    if (tick == -1 && options.move && lap.status.refusal != controller_status_t::REFUSAL_NONE &&
        lap.trip.tripped == 0 && lap.status.faults == 0) {
      result.refusal = refusal_text(lap.status, &*options.move);
      return finished();
    }
    // Every command of the countdown must have been obeyed, unless something tripped or kept the controller from it.
    const bool armed_due = tick == -kCountdown || options.by_hand;
    const std::int8_t mode_due = armed_due      ? controller_status_t::MODE_ARMED
                                 : options.move ? controller_status_t::MODE_PENDING
                                                : controller_status_t::MODE_RUNNING;
    const bool pending = answered && lap.status.mode == controller_status_t::MODE_PENDING;
    already_there = already_there || (was_pending && answered && lap.status.mode == controller_status_t::MODE_ARMED);
    was_pending = pending || (was_pending && !answered);
    if (tick < 0 && lap.trip.tripped == 0 && lap.status.faults == 0 && !result.controller_trip &&
        lap.status.mode != mode_due) {
      result.status = hal::Status::kPeerLost;
      result.trouble = "the controller did not obey the operator's " + std::string(armed_due ? "arm" : "start");
      return finished();
    }
    if (tick >= -1 && options.plan_only && (!pending || lap.status.planned != 0)) return finished();
    if (tick == -1 && pending) {
      const double begins_s = static_cast<double>(lap.status.plan_tick) * period_s;
      end_s = std::max(end_s, begins_s + lap.status.plan_duration_s + kCountdown * period_s +
                                  kSwingsToRest * rest.swing_s());
    }
    if (std::string why = options.disturbed ? options.disturbed() : ""; !why.empty()) {
      result.status = hal::Status::kForeignPeer;
      result.trouble = std::move(why);
      return finished();
    }
    if (!recorder.good() || (options.interrupted != nullptr && *options.interrupted != 0)) {
      result.status = recorder.good() ? hal::Status::kInterrupted : hal::Status::kIo;
      result.trouble = recorder.good() ? "interrupted" : recorder.error();
      return finished();
    }

    if (answered) {
      if (history.size() == kHistoryTicks) history.pop_front();
      history.push_back(lap.steps);
    }
    if (options.move && tick >= -1 && !move_done_tick && lap.status.mode == controller_status_t::MODE_ARMED) {
      move_done_tick = tick + 2;
    }
    // A controller that is still disarmed has nothing to stop, and will not start: after a trip, or if a fault keeps it
    // from arming, which is no trip of its own, for nothing moves.
    armed = armed || (answered && lap.status.mode != controller_status_t::MODE_DISARMED);
    const bool not_to_start = lap.status.mode == controller_status_t::MODE_DISARMED &&
                              (result.trip.tripped != 0 || (!armed && lap.status.faults != 0));
    const bool stopping = answered && (lap.status.mode == controller_status_t::MODE_TRIPPED || not_to_start);
    if (stopping) {
      if (result.trip.tripped != 0 && !result.latency_ticks) result.latency_ticks = tick + 1 - result.trip.trip_tick;
      if (!result.controller_trip) {
        result.controller_trip = {
            lap.status.faults, tick, plant.time_s(), lap.status, lap.plant.sensors, {history.begin(), history.end()}};
      }
      // At rest from the next tick on, whose steps are still to be executed.
      if (lap.status.at_rest != 0 && !stop_done_tick) stop_done_tick = tick + 2;
    } else if (!has_controller && result.trip.tripped != 0 && !result.latency_ticks) {
      result.latency_ticks = tick - result.trip.trip_tick;
    }

    // The steps of the next tick, as they reach the motors.
    step_command_t next_due{};
    if (has_controller) {
      if (lap.steps_injured) {
        next_due = lap.delivered.value_or(step_command_t{});
      } else if (answered) {
        next_due = lap.steps;
      }
      std::string wrong = StepLedger::fault_of(next_due, period_s * scenario.run.timer_frequency_hz);
      if (next_due.tick != tick + 1 || !wrong.empty()) {
        ++result.missing_commands;
        next_due = step_command_t{};
        if (wrong.empty() && ++commands_missed > kAllowedMissedCommands) {
          wrong = "no step command has reached the motors for " + std::to_string(commands_missed) + " ticks at tick " +
                  std::to_string(tick);
        }
      } else {
        commands_missed = 0;
        if (!ledger.enter(next_due)) wrong = ledger.text();
      }
      // Somebody has noticed already: how the stop goes on is worth seeing.
      const bool tripped = stopping || result.trip.tripped != 0;
      if (!wrong.empty() && !tripped) return lost(wrong);
    }

    if (step_check && answered && (!step_check->see(lap.status, lap.steps) || (last && !step_check->finish()))) {
      result.end_reason = EndReason::kStepTiming;
      break;
    }
    if (last) {
      if (plant.end() == sim::PhysicsEnd::kSlipped)
        result.end_reason = EndReason::kSlipped;
      else if (plant.end() == sim::PhysicsEnd::kDetached)
        result.end_reason = EndReason::kDetached;
      else if (plant.end() == sim::PhysicsEnd::kInconsistent)
        result.end_reason = EndReason::kInconsistent;
      else if (stop_done_tick && tick >= *stop_done_tick)
        result.end_reason = EndReason::kTripped;
      break;
    }

    if (tick >= 0) {
      const double start_s = plant.time_s();
      expand(due, scenario.run.timer_frequency_hz, pulses);
      if (!StepLedger::gives(due, scenario.run.timer_frequency_hz, pulses)) {
        return lost("the motors would be given other pulses in tick " + std::to_string(tick) +
                    " than the step command speaks of: a fault of this program");
      }
      plant.advance(std::min(static_cast<double>(tick + 1) * period_s, end_s), pulses);
      pulse_record.add(start_s, plant.time_s(), pulses);
      ++result.ticks;
    }
    due = next_due;
    if (options.speed > 0 && tick >= 0) {
      // A signal that came just before a sleep would not end it: no sleep is long.
      const hal::Seconds until(plant.time_s() / options.speed);
      for (hal::Seconds gone(0); (gone = Clock::now() - wall_start) < until;) {
        if (options.interrupted != nullptr && *options.interrupted != 0) break;
        std::this_thread::sleep_for(std::min(until - gone, hal::Seconds(0.1)));
      }
    }
    // Looking at the clock in every tick would cost more than the tick's messages.
    if (options.progress && (tick & 63) == 0 && Clock::now() >= next_progress) {
      options.progress(plant.time_s(), end_s);
      next_progress = Clock::now() + std::chrono::milliseconds(100);
    }
  }

  return finished();
}

}  // namespace ballast::sil
