#include "tools/sil/run.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "tools/sil/belief_watch.h"
#include "tools/sil/countdown.h"
#include "tools/sil/estimate_watch.h"
#include "tools/sil/pace.h"
#include "tools/sil/plan_watch.h"
#include "tools/sil/rest_watch.h"
#include "tools/sil/trip_watch.h"

namespace ballast::sil {

namespace {

using hal::Status;

// After a move's last step. At the default damping ratio of 0.2, exp(-0.2 * 2 pi * 10) = 3e-6 of a swing is left.
constexpr double kSwingsToRest = 10;

// Step counts and rates of the pulses that the motors have executed.
class PulseRecord {
 public:
  // `pulses` are those of an interval that starts at start_s. Pulses after until_s, where the physics ended, are left
  // out.
  void add(double start_s, double until_s, std::span<const sim::StepPulse> pulses) {
    for (const auto& pulse : pulses) {
      const double time_s = start_s + pulse.offset_s;
      if (time_s > until_s) break;
      const auto i = static_cast<std::size_t>(pulse.motor);
      if (motors[i].steps > 0)
        motors[i].max_step_rate_hz = std::max(motors[i].max_step_rate_hz, 1 / (time_s - last_s_[i]));
      ++motors[i].steps;
      last_s_[i] = time_s;
    }
  }

  std::array<MotorRecord, sim::kMaxMasses> motors{};

 private:
  std::array<double, sim::kMaxMasses> last_s_{};
};

class Run {
 public:
  Run(const sim::Scenario& scenario, Peer& peers, LapSink& sink, const RunOptions& options);

  // False: this was the last lap.
  bool lap();
  RunResult finish();

 private:
  void begin();
  [[nodiscard]] std::optional<sim::Plant::ContactForces> commanded_forces(const sim::SensorReadings* readings) const;
  bool exchange();
  void record();
  bool judge();
  bool judge_verdict();
  bool judge_answer();
  void observe_motor_share();
  bool judge_countdown();
  bool follow_move();
  bool is_undisturbed();
  bool feed_motors();
  [[nodiscard]] bool commands_ideal_masses() const;
  bool check_steps();
  bool reach_end();
  bool step();

  bool lost(const std::string& why) { return fail(Status::kPeerLost, why); }
  bool fail(Status status, const std::string& why);
  void record_previous();
  void copy_motors();

  const sim::Scenario& scenario_;
  Peer& peers_;
  LapSink& sink_;
  const RunOptions& options_;
  Wires no_faults_;
  Wires& wires_;
  const bool has_controller_;
  const bool ideal_masses_;
  const double period_s_;
  // Peers that compute in parallel leave time to record a lap while they work on the next. A paced run records before
  // it sleeps instead, so that watchers are not one tick late.
  const bool records_late_;

  sim::Plant plant_;
  sim::Plant::Sample sample_;  // at the start of this tick
  std::int64_t tick_ = 0;
  bool last_ = false;
  bool stop_done_ = false;  // after a trip, when this tick began
  double end_s_;
  Lap lap_{};
  std::optional<Lap> unrecorded_;
  // N and f_s of the commanded masses of the true robot at this tick under all external forces, where the message has
  // those of a believed one or under the told ones.
  std::optional<sim::Plant::ContactForces> commanded_under_all_;

  std::optional<sim::Body> believed_;  // of the controller, where it is not the truth
  std::optional<BeliefWatch> belief_watch_;
  std::optional<TrackingWatch> tracking_watch_;
  std::int64_t course_ = 0;  // that the controller follows
  std::optional<GovernorWatch> governor_watch_;
  std::optional<EstimateWatch> estimate_watch_;
  std::optional<sim::Sensors> sensors_;  // none: ideal ones
  Pace pace_;
  Countdown countdown_;
  StepFeed feed_;
  PulseRecord pulses_;
  RestWatch rest_;
  PlanWatch plans_;
  TripWatch trips_;
  std::optional<StepTimingCheck> step_check_;
  std::optional<controller_status_t> asks_;     // of the tick before: it asks for the steps of this one
  std::optional<controller_status_t> asked_;    // of the tick before that one
  std::optional<std::int64_t> move_done_tick_;  // at whose start the move's last step has been executed
  bool was_pending_ = false;                    // the move, when the controller last answered
  bool already_there_ = false;                  // a move to where the masses are
  std::int64_t silent_ticks_ = 0;               // of the controller, consecutive
  std::int64_t operator_commands_ = 0;          // as the controller counted them last
  RunResult result_;
};

Run::Run(const sim::Scenario& scenario, Peer& peers, LapSink& sink, const RunOptions& options)
    : scenario_(scenario),
      peers_(peers),
      sink_(sink),
      options_(options),
      wires_(options.wires == nullptr ? no_faults_ : *options.wires),
      has_controller_(sim::has_controller(scenario.run.actuation)),
      ideal_masses_(scenario.run.actuation == sim::Actuation::kIdeal),
      period_s_(scenario.run.control_period_s),
      records_late_(peers.computes_in_parallel() && options.speed <= 0),
      plant_(scenario),
      end_s_(scenario.duration_s),
      pace_(options, scenario.run.hold_s),
      countdown_(options, period_s_),
      feed_(scenario),
      rest_(scenario),
      plans_(period_s_),
      trips_(has_controller_) {
  result_.asked_speed = options.speed;
  if (scenario.sensors.present) sensors_.emplace(scenario.sensors, period_s_, scenario.seed);
  if (scenario.believed) believed_.emplace(*scenario.believed);
  if (scenario.believed && options.predict_belief) belief_watch_.emplace(scenario);
  if (scenario.plan.present) {
    if (auto path = plan::planned_path(scenario)) tracking_watch_.emplace(std::move(*path));
  }
  if (scenario.control.governor && has_controller_) governor_watch_.emplace(scenario);
  if (scenario.sensors.attitude_estimated && has_controller_) estimate_watch_.emplace(scenario);
  if (options.move) result_.move_end = MoveEnd{*options.move};
  if (options.check_steps && has_controller_) step_check_.emplace(scenario);
  // A ball that breaks the envelope as it is set down is not held, and needs no countdown.
  if (plant_.end() == sim::PhysicsEnd::kNone) tick_ = scenario.run.first_tick();
}

bool Run::lap() {
  begin();
  if (!exchange()) return false;
  record();
  if (!judge() || !feed_motors() || !check_steps()) return false;
  if (reach_end() || !step()) return false;
  // In the countdown and the hold the plant stands at t = 0.
  pace_.keep(tick_, tick_ < 0 ? static_cast<double>(tick_ + 1) * period_s_ : plant_.time_s(), end_s_);
  ++tick_;
  return true;
}

// The plant's messages, and the countdown's command.
void Run::begin() {
  const Eigen::Vector3d before_W_m = sample_.position_W_m;
  if (ideal_masses_ && asks_ && tick_ >= 0) {
    plant_.place_masses(asks_->next_position, asks_->next_velocity, asks_->next_acceleration);
  }
  sample_ = plant_.sample();
  if (tick_ < 0 && scenario_.run.hold_s > 0) hold_still(sample_);
  if (result_.ticks > 0) result_.distance_m += (sample_.position_W_m - before_W_m).norm();
  // The plan's path ends where an operator's course begins.
  if (tracking_watch_ && tick_ >= 0 && result_.courses == 0)
    tracking_watch_->observe(sample_.time_s, sample_.position_W_m.head<2>());
  rest_.observe(sample_);
  const bool move_done = move_done_tick_ && tick_ >= *move_done_tick_;
  if (move_done) result_.move_end->steps_made = true;
  stop_done_ = trips_.stop_done(tick_);
  last_ = plant_.end() != sim::PhysicsEnd::kNone || plant_.time_s() >= end_s_ || (stop_done_ && rest_.at_rest()) ||
          (move_done && (rest_.at_rest() || already_there_));

  const bool commands = asks_ && tick_ >= 0 && sample_.time_s == static_cast<double>(tick_) * period_s_;
  commanded_under_all_.reset();
  if (commands && (believed_ || sensors_ || plant_.has_untold_forces())) {
    commanded_under_all_ = plant_.contact_forces(asks_->next_position, asks_->next_velocity, asks_->next_acceleration);
  }
  const sim::SensorReadings* readings = sensors_ ? &sensors_->read(tick_, true_motion(scenario_, sample_)) : nullptr;
  const auto commanded = commands ? commanded_forces(readings) : std::nullopt;
  // Part by part: a whole new lap would be filled with zeros first.
  lap_.plant = plant_messages(scenario_, sample_, tick_, last_, commanded);
  lap_.command = countdown_.command(tick_);
  lap_.heard.clear();
  lap_.verdict.reset();
  lap_.answer.reset();
  if (scenario_.sensors.attitude_estimated) lap_.plant.contact.commanded_tick = tick_ - 1;
  if (readings != nullptr) set_sensors(*readings, scenario_.sensors, lap_.plant.sensors);
  wires_.carry_sensors(sample_.time_s, lap_.plant.sensors);
}

// N and f_s of the commanded masses, by the plant's equations, for the monitor to hold against the controller's own. A
// sensed attitude is known now, as the sensors give it before any fault; the controller's forces of this tick come with
// its next status. An estimated attitude
// is known from the status of the tick before, so those are its forces of that tick, with the masses as commanded then.
std::optional<sim::Plant::ContactForces> Run::commanded_forces(const sim::SensorReadings* readings) const {
  const controller_status_t& asks = *asks_;
  if (!scenario_.sensors.attitude_estimated) {
    if (readings != nullptr && sample_.regime == sim::Regime::kRolling) {
      return plant_.rolling_forces(believed_ ? &*believed_ : nullptr, sample_.orientation.data(),
                                   readings->imu.gyro_B_radps.data(), asks.next_position, asks.next_velocity,
                                   asks.next_acceleration);
    }
    if (believed_) {
      return plant_.contact_forces(*believed_, asks.next_position, asks.next_velocity, asks.next_acceleration);
    }
    return plant_.contact_forces(asks.next_position, asks.next_velocity, asks.next_acceleration,
                                 sim::Plant::Forces::kTold);
  }
  if (!asked_ || asks.estimate_valid == 0 || sample_.regime != sim::Regime::kRolling) return std::nullopt;
  return plant_.rolling_forces(believed_ ? &*believed_ : nullptr, asks.estimated_orientation,
                               asks.estimated_angular_velocity_B_radps, asked_->next_position, asked_->next_velocity,
                               asked_->next_acceleration);
}

bool Run::exchange() {
  Status status = peers_.send(lap_);
  record_previous();
  if (status == Status::kOk) status = peers_.receive(lap_);
  if (status == Status::kOk) return true;
  result_.failure = peers_.failure();
  return fail(status, peers_.trouble());
}

void Run::record() {
  if (records_late_) {
    unrecorded_ = lap_;
  } else {
    sink_.take(lap_);
  }
  if (options_.observe) options_.observe(lap_, sample_);
  result_.last_tick = tick_;
  result_.operators_heard = result_.operators_heard || !lap_.heard.empty();
}

void Run::record_previous() {
  if (unrecorded_) sink_.take(*unrecorded_);
  unrecorded_.reset();
}

bool Run::judge() {
  if (!judge_verdict() || (has_controller_ && !judge_answer()) || !judge_countdown() || !follow_move()) return false;
  if (!is_undisturbed()) return false;
  trips_.observe(lap_, result_.trip);
  return true;
}

bool Run::judge_verdict() {
  if (!lap_.verdict) return true;
  if (result_.trip.tripped != 0 && lap_.verdict->tripped == 0) {
    return lost("the monitor takes back its trip (tick " + std::to_string(tick_) + "): it was started again");
  }
  if (result_.trip.tripped == 0 && lap_.verdict->cause == trip_t::CAUSE_FRICTION) {
    result_.trip_static_friction = sample_.floor_static_friction;
  }
  result_.trip = *lap_.verdict;
  return true;
}

bool Run::judge_answer() {
  asked_ = asks_;
  asks_.reset();
  if (!lap_.answer) {
    ++silent_ticks_;
    if (silent_ticks_ < kGivenUpTicks) return true;
    return lost("controller lost: silent for " + std::to_string(kGivenUpTicks) + " ticks at tick " +
                std::to_string(tick_));
  }
  const controller_status_t& status = lap_.answer->status;
  silent_ticks_ = 0;
  if (status.tick == tick_) asks_ = status;
  if (estimate_watch_ && tick_ >= 0 && status.tick == tick_) {
    estimate_watch_->observe(lap_.plant.contact, lap_.plant.state, status, sensors_->gyro_bias_B_radps());
  }
  if (tracking_watch_ && status.motion_delay_s > 0) tracking_watch_->wait(status.motion_delay_s);
  if (governor_watch_ && status.tick == tick_) governor_watch_->observe(status);
  if (status.course != 0 && status.course != course_) ++result_.courses;
  course_ = status.course;
  plans_.observe(lap_.plant.contact, status);
  if (!ideal_masses_) observe_motor_share();
  if (status.operator_commands < operator_commands_) {
    return lost("the controller was started again: in tick " + std::to_string(status.tick) + " it counts " +
                std::to_string(status.operator_commands) + " commands, and " + std::to_string(operator_commands_) +
                " before");
  }
  operator_commands_ = status.operator_commands;
  return true;
}

// Force tables, drag and errors of the belief are no part of the motors' share, so real and commanded masses are
// compared with them.
void Run::observe_motor_share() {
  contact_t contact = lap_.plant.contact;
  if (commanded_under_all_) set_commanded(commanded_under_all_, contact);
  result_.motor_share.observe(contact);
}

bool Run::judge_countdown() {
  if (tick_ >= 0 || !has_controller_) return true;
  if (countdown_.refuses(lap_)) {
    result_.refusal = lap_.answer->status;
    return false;
  }
  if (!trips_.controller_trip() && countdown_.ignores_command(lap_)) {
    return lost(countdown_.ignored_text(lap_));
  }
  return true;
}

// A move that was asked for is pending until it is predicted. Then it begins, or is over at once if the masses are
// there.
bool Run::follow_move() {
  if (!options_.move || tick_ < -1 || !lap_.answer) return true;
  const controller_status_t& status = lap_.answer->status;
  const bool pending = status.mode == controller_status_t::MODE_PENDING;
  const bool armed = status.mode == controller_status_t::MODE_ARMED;
  if (was_pending_ && armed && status.planned == 0) {
    return fail(Status::kInterrupted, "the pending move was cancelled by an operator's stop");
  }
  already_there_ = already_there_ || (was_pending_ && armed);
  was_pending_ = pending;
  if (options_.plan_only && (!pending || status.planned != 0)) return false;
  if (tick_ == -1 && pending) {
    const double begins_s = static_cast<double>(status.plan_tick) * period_s_;
    end_s_ = std::max(
        end_s_, begins_s + status.plan_duration_s + Countdown::kTicks * period_s_ + kSwingsToRest * rest_.swing_s());
  }
  if (armed && !move_done_tick_) move_done_tick_ = tick_ + 2;
  return true;
}

bool Run::is_undisturbed() {
  if (const std::string why = options_.disturbed ? options_.disturbed() : ""; !why.empty()) {
    return fail(Status::kForeignPeer, why);
  }
  if (!sink_.good()) {
    result_.sink_failed = true;
    return fail(Status::kIo, sink_.error());
  }
  const bool interrupted = options_.interrupted != nullptr && *options_.interrupted != 0;
  return !interrupted || fail(Status::kInterrupted, "interrupted");
}

// The steps of the next tick, as they reach the motors.
bool Run::feed_motors() {
  if (!has_controller_) return true;
  const std::int64_t missing = feed_.missing_commands();
  const std::string wrong = feed_.take(tick_, wires_.carry_steps(tick_, lap_.answer ? &lap_.answer->steps : nullptr));
  if (ideal_masses_ && !last_ && tick_ >= -1 && (feed_.missing_commands() > missing || !commands_ideal_masses())) {
    return lost("ideal masses are where the controller commands, and no good command for tick " +
                std::to_string(tick_ + 1) + " has come");
  }
  // After a trip the stop goes on as well as it can, and the result counts what it lacked.
  return wrong.empty() || trips_.stopping() || result_.trip.tripped != 0 || lost(wrong);
}

// Whether the controller's status of this tick says where the masses are to be in the next. Without it they have no
// place: to hold them would be a jump that no command asks for.
bool Run::commands_ideal_masses() const {
  if (!asks_) return false;
  const auto finite = [](double value) { return std::isfinite(value); };
  const std::size_t n = scenario_.masses.size();
  return std::all_of(asks_->next_position, asks_->next_position + n, finite) &&
         std::all_of(asks_->next_velocity, asks_->next_velocity + n, finite) &&
         std::all_of(asks_->next_acceleration, asks_->next_acceleration + n, finite);
}

bool Run::check_steps() {
  if (!step_check_ || !lap_.answer) return true;
  const bool good = step_check_->observe(lap_.answer->status, lap_.answer->steps) && (!last_ || step_check_->finish());
  if (!good) result_.end_reason = EndReason::kStepTiming;
  return good;
}

bool Run::reach_end() {
  if (!last_) return false;
  switch (plant_.end()) {
    case sim::PhysicsEnd::kSlipped:
      result_.end_reason = EndReason::kSlipped;
      break;
    case sim::PhysicsEnd::kDetached:
      result_.end_reason = EndReason::kDetached;
      break;
    case sim::PhysicsEnd::kInconsistent:
      result_.end_reason = EndReason::kInconsistent;
      break;
    case sim::PhysicsEnd::kNone:
      if (stop_done_) result_.end_reason = EndReason::kTripped;
      break;
  }
  return true;
}

bool Run::step() {
  if (tick_ < 0) return true;
  const double start_s = plant_.time_s();
  if (!feed_.expand()) {
    return lost("the motors would be given other pulses in tick " + std::to_string(tick_) +
                " than the step command has: a fault of this program");
  }
  const double next_s = static_cast<double>(tick_ + 1) * period_s_;
  if (ideal_masses_) plant_.lead_masses(next_s, asks_->next_position, asks_->next_velocity);
  if (belief_watch_) belief_watch_->begin_tick(asked_ ? &*asked_ : nullptr, asks_ ? &*asks_ : nullptr, next_s);
  plant_.advance(std::min(next_s, end_s_), feed_.pulses());
  if (belief_watch_) belief_watch_->follow(plant_.time_s());
  pulses_.add(start_s, plant_.time_s(), feed_.pulses());
  ++result_.ticks;
  return true;
}

bool Run::fail(Status status, const std::string& why) {
  result_.status = status;
  result_.trouble = why;
  return false;
}

RunResult Run::finish() {
  record_previous();
  result_.wall_time_s = pace_.wall_time_s();
  result_.end_text = plant_.end_text();
  result_.masses_rested = rest_.at_rest();
  result_.log_bytes = sink_.bytes();
  result_.refused = peers_.refused();
  result_.refused.here += wires_.refused();
  result_.final_sample = plant_.sample();
  result_.regimes = plant_.regimes();
  result_.impacts = plant_.impacts();
  result_.rolling_lost = plant_.rolling_lost();
  result_.extrema = plant_.extrema();
  result_.friction_shares = plant_.shares_at_mu_required_max();
  result_.move = plans_.move();
  result_.stop = plans_.stop();
  result_.controller_trip = trips_.controller_trip();
  result_.latency_ticks = trips_.latency_ticks();
  result_.missing_commands = feed_.missing_commands();
  if (belief_watch_) result_.belief = belief_watch_->result();
  if (tracking_watch_) result_.tracking = tracking_watch_->record();
  if (governor_watch_ && governor_watch_->record().ticks > 0) result_.governor = governor_watch_->record();
  if (estimate_watch_) result_.estimate = estimate_watch_->result();
  if (step_check_) result_.step_timing = step_check_->record();
  copy_motors();
  return std::move(result_);
}

void Run::copy_motors() {
  result_.motors = pulses_.motors;
  for (std::size_t i = 0; i < sim::kMaxMasses; ++i) {
    const int motor = static_cast<int>(i);
    result_.motor_extrema[i] = plant_.motor_extrema(motor);
    result_.end_stops[i] = plant_.end_stop(motor);
    if (i >= scenario_.masses.size()) continue;
    result_.motor_energy[i] = plant_.motor_energy(motor);
    result_.motors[i].steps_behind = plant_.motor_steps_behind(motor);
    result_.motors[i].slips = plant_.motor_slips(motor);
    result_.motors[i].undelivered_steps = feed_.undelivered_steps(i);
  }
}

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

RunResult run(const sim::Scenario& scenario, Peer& peers, LapSink& sink, const RunOptions& options) {
  Run run(scenario, peers, sink, options);
  while (run.lap()) {
  }
  return run.finish();
}

}  // namespace ballast::sil
