// The reader of event logs, and replays of what it reads: as the log of a run without faults, given to a firmware that
// answers nothing, and as that of a run with faults of messages, peers and clock, given to the firmware itself. Input:
// a log.
#include <memory>
#include <utility>

#include "tests/fuzz/change_parts.h"
#include "tools/faults/injection.h"
#include "tools/program/memory_file.h"
#include "tools/program/params.h"
#include "tools/recording/log_reader.h"
#include "tools/recording/replay.h"

namespace ballast::fuzz {
namespace {

// Answers nothing that was recorded: every tick differs.
class Silent final : public sil::Peer {
 public:
  hal::Status send(sil::Lap&) override { return hal::Status::kOk; }
  hal::Status receive(sil::Lap& lap) override {
    lap.answer.emplace().status.tick = lap.plant.sensors.tick;
    return hal::Status::kOk;
  }
  [[nodiscard]] std::string trouble() const override { return ""; }
};

// A robot, and faults of everything that can stand between a log and the firmware.
constexpr char kRobot[] = R"(
duration = 1
gravity = 1
[ball]
radius = 1
mass = 1
inertia = [1, 1, 1]
[[mass]]
mass = 1
rail = { shape = "circle", radius = 0.9, direction = { azimuth = 0, elevation = 0 } }
motion = [{ duration = 0.5, acceleration = [1, 1] }]
[run]
actuation = "stepper"
)";
const std::vector<std::string> kFaults{
    "messages_dropped@0.001:0.3",
    "messages_doubled@0.002:0.3,peer=controller",
    "messages_delayed@0.003:2,channel=BALLAST_TRIP,duration=0.005",
    "messages_reordered@0:0.3,channel=BALLAST_CONTROLLER_STATUS",
    "messages_corrupted@0.004:3",
    "messages_truncated@0.006:1,channel=BALLAST_STEP_COMMAND,duration=0.002",
    "peer_frozen@0.008:duration=0.002",
    "peer_too_slow@0.012:2,duration=0.002",
    "clock_jump@0.014:-5",
    "peer_restarted@0.016",
};

void hold_to_its_word(const sil::ReplayResult& result) {
  using End = sil::ReplayResult::End;
  require((result.end == End::kReplayed) == result.trouble.empty(), "a failure has a reason");
  require(result.end != End::kReplayed || result.ticks > 0, "a replay has ticks");
  require(result.ticks_that_differ <= result.ticks, "no more ticks differ than there are");
  require(result.end != End::kReplayed || result.last_tick - result.first_tick + 1 == result.ticks,
          "what is replayed has no gap");
}

// `id`: the log's, or nothing would be replayed.
void replay_with_faults(const std::string& log, std::int64_t id) {
  static sim::ScenarioResult robot = sim::parse_scenario(kRobot, "robot.toml", {}, kFaults);
  static const auto params = std::make_unique<firmware::ControllerParams>();
  static const bool built = robot.ok() && !program::to_controller_params(robot.scenario, *params);
  require(built, "the robot is one");
  robot.scenario.id = id;
  const sil::ReplayedFirmware firmware = sil::firmware_for_replay(robot.scenario, *params);
  hold_to_its_word(
      sil::replay(robot.scenario, log, *firmware.peer, "/dev/null", {.before_tick = firmware.before_tick}));
}

// 28 bytes of header: sync word, number, time, length of the channel's name, length of the data; all big-endian.
std::vector<Part> events_of(std::span<const std::uint8_t> input) {
  constexpr std::size_t kHeader = 28;
  const auto length = [&](std::size_t at) {
    return std::size_t{input[at]} << 24 | std::size_t{input[at + 1]} << 16 | std::size_t{input[at + 2]} << 8 |
           std::size_t{input[at + 3]};
  };
  std::vector<Part> events;
  for (std::size_t at = 0; input.size() - at >= kHeader;) {
    const std::size_t channel = length(at + 20), data = length(at + 24), left = input.size() - at - kHeader;
    if (channel > left || data > left - channel) break;
    events.push_back({at, kHeader + channel + data, at + kHeader + channel, data});
    at += events.back().size;
  }
  return events;
}

}  // namespace

Bytes change_one_thing(Bytes input, std::mt19937_64& random) {
  const auto events = events_of(input);
  return change_one_part(std::move(input), events, random);
}

bool take(std::span<const std::uint8_t> input) {
  const program::MemoryFile file(input);
  require(file.good(), "a file in memory with the input");
  sil::LogReader reader(file.path());
  std::size_t bytes = 0;
  sil::LogEvent event;
  while (reader.next(event)) bytes += 28 + event.channel.size() + event.data.size();
  require(reader.error().empty() || bytes == 0, "nothing is read of what is no log");
  require(bytes <= input.size(), "no more is read than there is");
  require(reader.error().empty() && reader.damage().empty() ? bytes == input.size() : true,
          "all is read, or it is said why not");

  const sil::LogScenario of_log = sil::scenario_of_log(file.path());
  require(of_log.id.has_value() == of_log.trouble.empty(), "a log has a scenario, or it is said why not");
  sim::Scenario scenario;
  scenario.id = of_log.id.value_or(0);
  Silent peers;
  const sil::ReplayResult result = sil::replay(scenario, file.path(), peers, "/dev/null", {});
  hold_to_its_word(result);
  replay_with_faults(file.path(), scenario.id);
  return result.ticks > 0;
}

}  // namespace ballast::fuzz
