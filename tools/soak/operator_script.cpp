#include "tools/soak/operator_script.h"

#include <fmt/core.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "hal/lcm/messages.h"

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

OperatorScript random_script(const sim::Scenario& scenario, Random& random) {
  OperatorScript script;
  const int ticks = std::max(2, static_cast<int>(scenario.duration_s / scenario.run.control_period_s));
  const auto give = [&](int tick, const OperatorInput& input) { script.commands.push_back({tick, input}); };
  // Ideal masses are governed, and a halt is the only command that the governor goes on through.
  if (scenario.run.actuation == sim::Actuation::kIdeal && random.chance(0.5)) {
    give(random.integer(0, ticks - 1), OperatorCommand::kHalt);
  }
  if (scenario.run.actuation != sim::Actuation::kStepper) return script;
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
  const auto earlier = [](const auto& a, const auto& b) { return a.tick < b.tick; };
  const auto same = [](const auto& a, const auto& b) { return a.tick == b.tick; };
  std::stable_sort(script.commands.begin(), script.commands.end(), earlier);
  script.commands.erase(std::unique(script.commands.begin(), script.commands.end(), same), script.commands.end());
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
