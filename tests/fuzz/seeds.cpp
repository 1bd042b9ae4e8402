// fuzz_seeds SCENARIO_FOLDER CORPUS_FOLDER: writes what the corpora of the link, the controller and the LCM types begin
// with: whole sessions and whole messages, as the types are today. README.md says when.
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "hal/lcm/messages.h"
#include "sim/scenario/scenario.h"
#include "tests/fuzz/byte_link.h"
#include "tools/program/params.h"

namespace ballast::fuzz {
namespace {

namespace target = hal::target;
using enum firmware::OperatorCommand;

template <class M>
void add(const M& message, std::int64_t tick, Bytes& bytes) {
  Bytes frame(target::kMaxFrame);
  frame.resize(target::encode(message, tick, frame));
  bytes.insert(bytes.end(), frame.begin(), frame.end());
}

void write(const std::filesystem::path& path, const Bytes& bytes) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::ssize(bytes));
}

Bytes params_of(const sim::Scenario& scenario) {
  Bytes bytes{0};
  const auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto refusal = program::to_controller_params(scenario, *params)) {
    std::fprintf(stderr, "%s\n", refusal->c_str());
    std::exit(1);
  }
  add(*params, 0, bytes);
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::Mass& from = scenario.masses[i];
    const auto mass = std::make_unique<target::MassParams>();
    mass->mass_kg = params->ball.mass_kg[i];
    mass->rail = params->ball.rail[i];
    mass->motor = params->motor[i];
    mass->initial_position = from.initial_position;
    mass->initial_velocity = from.initial_velocity;
    mass->piece_count = static_cast<std::int32_t>(from.motion.size());
    for (std::size_t k = 0; k < from.motion.size(); ++k) {
      mass->pieces[k] = {from.motion[k].duration_s, from.motion[k].acceleration_start, from.motion[k].acceleration_end};
    }
    add(*mass, 0, bytes);
  }
  add(target::Commit(), 0, bytes);
  return bytes;
}

struct Said {
  std::int64_t tick;
  firmware::OperatorInput command;
};

// Parameters, and ticks at rest on a level floor in which an operator says this and that; `trip_tick`: of the monitor.
Bytes session(const sim::Scenario& scenario, const std::vector<Said>& said, std::int64_t ticks,
              std::int64_t trip_tick = -1) {
  Bytes bytes = params_of(scenario);
  target::World world;
  for (std::int64_t tick = -2; tick < ticks; ++tick) {
    world.last = tick + 1 == ticks;
    world.sensors.tick = world.verdict.tick = tick;
    world.verdict.tripped = trip_tick >= 0 && tick >= trip_tick && tick < trip_tick + 3;
    world.command_count = 0;
    for (const Said& what : said) {
      if (what.tick == tick) world.commands[static_cast<std::size_t>(world.command_count++)] = what.command;
    }
    add(world, tick, bytes);
  }
  return bytes;
}

firmware::MoveRequest move_of(double position) {
  firmware::MoveRequest move;
  move.masses = 1;
  move.target_position[0] = position;
  move.speed_fraction = 0.5;
  return move;
}

void write_link(const std::filesystem::path& folder) {
  const auto reply = std::make_unique<target::Reply>();
  reply->status.motor_count = reply->steps.motor_count = 2;
  reply->steps.burst_count = 1;
  reply->steps.bursts[0] = {.motor = 1, .direction = -1, .count = 3, .first_ticks = 5, .interval_ticks = 9};
  reply->played.count = 1;
  const auto end_report = std::make_unique<target::EndReport>();
  Bytes target_says{0};
  add(target::Hello(), 0, target_says);
  add(target::Verdict(), 0, target_says);
  add(*reply, 0, target_says);
  add(target::FaultReport(), 1, target_says);
  add(*end_report, 2, target_says);
  write(folder / "target_says", target_says);
  target::World world;
  world.command_count = 2;
  world.commands = {kArm, move_of(0.25)};
  Bytes host_says{2 * 7};  // seven bytes at a time
  add(target::Commit(), 0, host_says);
  add(world, -2, host_says);
  write(folder / "host_says", host_says);
}

template <class M>
void add_message(std::uint8_t type, const M& message, Bytes& bytes) {
  bytes.push_back(type);
  const std::size_t at = bytes.size(), size = static_cast<std::size_t>(message.getEncodedSize());
  bytes.resize(at + size);
  message.encode(bytes.data(), static_cast<int>(at), static_cast<int>(size));
}

void write_lcm(const std::filesystem::path& folder) {
  step_command_t steps{};
  steps.motor_count = 2;
  steps.burst_count = 1;
  steps.motor[0] = 1;
  steps.direction[0] = 1;
  steps.count[0] = 1;
  controller_status_t status{};
  status.motor_count = 8;
  Bytes one_of_each;
  add_message(0, contact_t{}, one_of_each);
  add_message(1, plant_state_t{}, one_of_each);
  add_message(2, sensors_t{}, one_of_each);
  add_message(3, steps, one_of_each);
  add_message(4, status, one_of_each);
  add_message(5, trip_t{}, one_of_each);
  write(folder / "one_of_each", one_of_each);
  Bytes commands;
  for (const std::int64_t sequence : {1, 2, 2, 1, 3}) {
    for (const int command : {1, 2, 3, 4, 5}) {
      operator_t message{};
      message.tick = sequence;
      message.sender = command % 2;
      message.sequence = sequence;
      message.command = static_cast<std::int8_t>(command);
      add_message(6, message, commands);
    }
  }
  write(folder / "commands", commands);
}

int write_all(const std::filesystem::path& scenarios, const std::filesystem::path& corpus) {
  const auto scenario = [&](const char* name) {
    const sim::ScenarioResult result = sim::read_scenario(scenarios / (std::string(name) + ".toml"));
    for (const sim::ScenarioError& error : result.errors) std::fprintf(stderr, "%s\n", to_string(error).c_str());
    if (!result.ok()) std::exit(1);
    return result.scenario;
  };
  write(corpus / "controller/motion", session(scenario("paper_ball"), {{0, kArm}, {1, kStart}}, 20));
  write(corpus / "controller/stop", session(scenario("paper_ball"), {{0, kArm}, {1, kStart}, {6, kStop}}, 16));
  write(corpus / "controller/trip_and_reset",
        session(scenario("desk_ball"), {{0, kArm}, {1, kStart}, {8, kReset}, {9, kArm}, {10, kStart}}, 16, 4));
  write(corpus / "controller/move", session(scenario("desk_ball"), {{0, kArm}, {1, move_of(0.25)}}, 16));
  write(corpus / "controller/spline", session(scenario("seam_ball"), {{0, kArm}, {1, kStart}, {5, kStop}}, 12));
  write(corpus / "controller/disk", session(scenario("paper_disk"), {{0, kArm}, {1, kStart}}, 12));
  write_link(corpus / "link");
  write_lcm(corpus / "lcm_messages");
  return 0;
}

}  // namespace
}  // namespace ballast::fuzz

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: fuzz_seeds SCENARIO_FOLDER CORPUS_FOLDER\n");
    return 1;
  }
  return ballast::fuzz::write_all(argv[1], argv[2]);
}
