#include "tools/soak/operator_script.h"

#include <fmt/core.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "firmware/motion/jerk_limited.h"
#include "hal/lcm/messages.h"
#include "tools/go/course_parts.h"

namespace ballast::soak {

namespace {

using firmware::OperatorCommand;
using firmware::OperatorInput;

const char* name_of(OperatorCommand command) {
  switch (command) {
    case OperatorCommand::kArm:
      return "arm";
    case OperatorCommand::kStart:
      return "start";
    case OperatorCommand::kStop:
      return "stop";
    case OperatorCommand::kReset:
      return "reset";
    case OperatorCommand::kMove:
      return "move";
    case OperatorCommand::kHalt:
      return "halt";
    case OperatorCommand::kGo:
      return "go";
    case OperatorCommand::kNone:
      break;
  }
  return "nothing";
}

// A move of masses near their initial places; some targets lie beyond an end of the rail and are refused.
OperatorInput random_move(const sim::Scenario& scenario, Random& random) {
  firmware::MoveRequest move;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    if (random.chance(0.3)) continue;
    const sim::Mass& mass = scenario.masses[i];
    const double reach = 0.2 * scenario.ball.radius_m / mass.metres_per_rail_unit();
    move.masses |= 1u << i;
    move.target_position[i] = mass.initial_position + random.uniform(-reach, reach);
  }
  move.speed_fraction = random.uniform(0.3, 1);
  return move;
}

// A course that begins on the scenario's motion at `from_tick` and stops the masses there, without feedback. Empty: a
// mass cannot stop so.
std::vector<firmware::CoursePart> braking_course(const sim::Scenario& scenario, std::int64_t from_tick) {
  const double time_s = static_cast<double>(from_tick) * scenario.run.control_period_s;
  go::HostCourse course;
  course.number = 1;
  course.from_tick = from_tick;
  for (const sim::Mass& mass : scenario.masses) {
    std::vector<firmware::ProfilePiece> motion;
    for (const sim::MotionPiece& piece : mass.motion) {
      motion.push_back({piece.duration_s, piece.acceleration_start, piece.acceleration_end});
    }
    firmware::Profile profile;
    if (!profile.set(mass.initial_position, mass.initial_velocity, motion.data(), static_cast<int>(motion.size()))) {
      return {};
    }
    const firmware::ProfilePoint at = profile.at(time_s);
    const sim::Motor& motor = mass.motor;
    const firmware::MotionLimits limits{motor.max_step_rate_hz / motor.microsteps_per_rail_unit(),
                                        motor.max_acceleration, motor.max_jerk};
    firmware::PlannedPieces stop;
    if (!firmware::plan_stop(at.velocity, at.acceleration, limits, 0, stop)) return {};
    go::HostCourse::Mass& out = course.mass.emplace_back();
    out.position = at.position;
    out.velocity = at.velocity;
    for (int k = 0; k < stop.count; ++k) {
      const firmware::ProfilePiece& piece = stop.piece[static_cast<std::size_t>(k)];
      out.motion.push_back({piece.duration_s, piece.acceleration_start, piece.acceleration_end});
    }
  }
  course.reference.samples = 2;
  course.reference.period_s = 1;
  const auto row = static_cast<std::size_t>(firmware::reference_row(static_cast<int>(course.mass.size())));
  course.reference.values[0] = course.reference.values[row] = 1;  // no rotation, and no gains
  return go::parts_of(course);
}

class OperatedPeers final : public sil::Peer {
 public:
  OperatedPeers(std::unique_ptr<sil::Peer> peers, const OperatorScript& script, double control_period_s)
      : peers_(std::move(peers)), script_(script), period_s_(control_period_s) {}

  hal::Status connect() override { return peers_->connect(); }
  hal::Status send(sil::Lap& lap) override {
    if (const auto input = command(lap.tick())) {
      operator_t message = hal::to_message(*input, lap.tick(), ++sequence_, period_s_);
      message.sender = kSender;
      lap.heard.push_back(message);
    }
    return peers_->send(lap);
  }
  hal::Status receive(sil::Lap& lap) override {
    const hal::Status status = peers_->receive(lap);
    if (lap.answer) observe(lap.tick(), lap.answer->status);
    return status;
  }
  [[nodiscard]] bool computes_in_parallel() const override { return peers_->computes_in_parallel(); }
  [[nodiscard]] std::string trouble() const override { return peers_->trouble(); }
  [[nodiscard]] sil::PeerFailure failure() const override { return peers_->failure(); }
  [[nodiscard]] sil::RefusedMessages refused() const override { return peers_->refused(); }

 private:
  static constexpr std::int64_t kSender = 1;

  std::optional<OperatorInput> command(std::int64_t tick) {
    if (again_ != OperatorCommand::kNone) return std::exchange(again_, OperatorCommand::kNone);
    if (tripped_tick_ && script_.resets_every >= 0 && resets_ < OperatorScript::kMostResets &&
        tick > *tripped_tick_ + (resets_ + 1) * script_.resets_every) {
      ++resets_;
      return OperatorCommand::kReset;
    }
    while (next_ < script_.commands.size() && script_.commands[next_].tick < tick) ++next_;
    if (next_ == script_.commands.size() || script_.commands[next_].tick != tick) return std::nullopt;
    return script_.commands[next_++].input;
  }

  void observe(std::int64_t tick, const controller_status_t& status) {
    const bool tripped = status.mode == controller_status_t::MODE_TRIPPED;
    if (tripped && !tripped_tick_) tripped_tick_ = tick;
    const bool was_reset = tripped_tick_ && status.mode == controller_status_t::MODE_DISARMED;
    if (was_reset && !armed_again_) again_ = OperatorCommand::kArm;
    if (armed_again_ && !started_again_ && status.mode == controller_status_t::MODE_ARMED) {
      again_ = OperatorCommand::kStart;
      started_again_ = true;
    }
    armed_again_ = armed_again_ || was_reset;
  }

  std::unique_ptr<sil::Peer> peers_;
  OperatorScript script_;
  double period_s_;
  std::size_t next_ = 0;
  std::int64_t sequence_ = 0;
  std::optional<std::int64_t> tripped_tick_;
  int resets_ = 0;
  bool armed_again_ = false, started_again_ = false;
  OperatorCommand again_ = OperatorCommand::kNone;  // due in the next tick
};

}  // namespace

namespace {

// The first command of a tick stays.
void put_in_order(OperatorScript& script) {
  const auto earlier = [](const auto& a, const auto& b) { return a.tick < b.tick; };
  const auto same = [](const auto& a, const auto& b) { return a.tick == b.tick; };
  std::stable_sort(script.commands.begin(), script.commands.end(), earlier);
  script.commands.erase(std::unique(script.commands.begin(), script.commands.end(), same), script.commands.end());
}

}  // namespace

OperatorScript random_script(const sim::Scenario& scenario, Random& random) {
  OperatorScript script;
  const int ticks = std::max(2, static_cast<int>(scenario.duration_s / scenario.run.control_period_s));
  const auto give = [&](int tick, const OperatorInput& input) { script.commands.push_back({tick, input}); };
  // Ideal masses are governed, and a halt is the only command that the governor goes on through.
  if (scenario.run.actuation == sim::Actuation::kIdeal && random.chance(0.5)) {
    give(random.integer(0, ticks - 1), OperatorCommand::kHalt);
  }
  // Some come too late to be certified, and some are incomplete: their last part is that of nothing.
  if (scenario.run.actuation == sim::Actuation::kIdeal && !scenario.masses.empty() && random.chance(0.5)) {
    const int first = random.integer(0, ticks - 1);
    auto parts = braking_course(scenario, first + random.integer(1, std::max(2, ticks / 2)));
    if (!parts.empty() && random.chance(0.1)) parts.pop_back();
    for (std::size_t k = 0; k < parts.size(); ++k) give(first + static_cast<int>(k), parts[k]);
  }
  if (scenario.run.actuation != sim::Actuation::kStepper) {
    put_in_order(script);
    return script;
  }
  if (random.chance(0.7)) script.resets_every = random.integer(0, 12);
  if (random.chance(1.0 / 3)) return script;
  if (random.chance(0.5)) {
    const int stop = random.integer(0, ticks - 1);
    give(stop, OperatorCommand::kStop);
    // Early ones come while the masses still stop, and are refused.
    const int after = random.integer(stop, ticks);
    if (random.chance(0.5)) {
      give(after, OperatorCommand::kStart);
    } else {
      give(after, random_move(scenario, random));
      give(random.integer(after, ticks), random.chance(0.5) ? OperatorCommand::kStop : OperatorCommand::kStart);
    }
  } else {
    const int count = random.integer(1, 4);
    for (int i = 0; i < count; ++i) {
      const auto command = random.one_of({OperatorCommand::kArm, OperatorCommand::kStart, OperatorCommand::kStop,
                                          OperatorCommand::kReset, OperatorCommand::kMove, OperatorCommand::kHalt});
      const int tick = random.integer(0, ticks - 1);
      give(tick, command == OperatorCommand::kMove ? random_move(scenario, random) : OperatorInput(command));
    }
  }
  put_in_order(script);
  return script;
}

std::string comments(const OperatorScript& script) {
  std::string out;
  for (const auto& [tick, input] : script.commands) {
    out += fmt::format("# operator, tick {}: {}\n", tick, name_of(input.command));
  }
  if (script.resets_every >= 0) {
    out +=
        fmt::format("# operator, after a trip: reset every {} ticks\n", std::max<std::int64_t>(1, script.resets_every));
  }
  return out;
}

std::unique_ptr<sil::Peer> with_operator(std::unique_ptr<sil::Peer> peers, const OperatorScript& script,
                                         double control_period_s) {
  return std::make_unique<OperatedPeers>(std::move(peers), script, control_period_s);
}

}  // namespace ballast::soak
