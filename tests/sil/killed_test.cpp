// Plant, controller and monitor as three processes, one of them killed with SIGKILL at a random tick and in a random
// part of it. BALLAST_KILLS says how often (default 12), BALLAST_SEED which ones (default: drawn).
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <random>
#include <set>
#include <thread>

#include "hal/lcm/bus.h"
#include "tests/random_seed.h"
#include "tests/sil/shell.h"
#include "tools/recording/log_reader.h"

extern char** environ;

namespace ballast {
namespace {

using test::Folder;
using test::Outcome;
using test::read_file;

constexpr const char* kPrograms[] = {"plant", "controller", "monitor"};

// One of the three, with what it says in a file. Ends with the object, however that ends.
class Process {
 public:
  Process(const Folder& folder, const std::string& program, const std::string& url) : said_(folder / program) {
    // On a machine so busy that a process does not run for the 2 s of the default, peers are lost that nobody killed.
    std::vector<std::string> words{BALLAST_BIN_DIR "/ballast-" + program,
                                   "paper_ball",
                                   "--set",
                                   "duration=600",
                                   "--lcm",
                                   url,
                                   "--peer-timeout",
                                   "4"};
    if (program == "plant") words.insert(words.end(), {"--out", (folder / "r").string()});
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, said_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_adddup2(&files, STDERR_FILENO, STDOUT_FILENO);
    EXPECT_EQ(posix_spawn(&pid_, argv[0], &files, nullptr, argv.data(), environ), 0) << argv[0];
    posix_spawn_file_actions_destroy(&files);
  }
  ~Process() {
    if (ended()) return;
    kill();
    waitpid(pid_, &status_, 0);
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void kill() const { ::kill(pid_, SIGKILL); }
  bool ended() {
    ended_ = ended_ || waitpid(pid_, &status_, WNOHANG) != 0;
    return ended_;
  }
  // Once it has ended; -1: by a signal.
  [[nodiscard]] int exit_status() const { return WIFEXITED(status_) ? WEXITSTATUS(status_) : -1; }
  [[nodiscard]] std::string said() const { return read_file(said_); }

 private:
  std::filesystem::path said_;
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false;
};

// The newest tick of either on the bus; who listens on a busy machine misses messages, so there may have been newer.
struct Heard {
  std::int64_t sensors = hal::kWaitingTick, steps = hal::kWaitingTick;
};

// The readable part of a log: how many messages of each tick, in the order of the ticks, and why it ends.
struct Laps {
  std::map<std::int64_t, int> messages;
  std::string damage;

  explicit Laps(const std::string& path) {
    sil::LogReader reader(path);
    if (!reader.error().empty()) return;  // nothing is in it yet
    const auto count = [this]<class M>(const sil::LogEvent& event, M message) {
      EXPECT_TRUE(hal::decode(event.data.data(), event.data.size(), message)) << event.channel;
      ++messages[message.tick];
    };
    for (sil::LogEvent event; reader.next(event);) {
      if (event.channel == hal::kChannelContact) count(event, contact_t{});
      if (event.channel == hal::kChannelPlantState) count(event, plant_state_t{});
      if (event.channel == hal::kChannelSensors) count(event, sensors_t{});
      if (event.channel == hal::kChannelTrip) count(event, trip_t{});
      if (event.channel == hal::kChannelControllerStatus) count(event, controller_status_t{});
      if (event.channel == hal::kChannelStepCommand) {
        step_command_t steps{};
        EXPECT_TRUE(hal::decode(event.data.data(), event.data.size(), steps));
        ++messages[steps.tick - 1];  // said in the tick before
      }
    }
    damage = reader.damage();
  }
  static constexpr int kPerTick = 6;

  // The last tick of which everything is there, when all before it are whole too; kWaitingTick: none.
  [[nodiscard]] std::int64_t last_whole() const {
    std::int64_t tick = -2;
    for (auto lap = messages.begin(); lap != messages.end() && lap->first == tick && lap->second == kPerTick; ++lap)
      ++tick;
    return tick - 1;
  }
};

void kill_one(const std::string& victim, const std::string& url, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto tick = static_cast<std::int64_t>(random() % 1000) - 2;
  const std::chrono::microseconds part(random() % 1000);  // laps at full speed take some hundred us
  SCOPED_TRACE("BALLAST_KILLS=1 BALLAST_SEED=" + std::to_string(seed) + ": " + victim + " in tick " +
               std::to_string(tick));
  const Folder folder;
  hal::Bus bus(url);
  Heard heard;
  bus.subscribe<sensors_t>(hal::kChannelSensors,
                           [&](const sensors_t& m) { heard.sensors = std::max(heard.sensors, m.tick); });
  bus.subscribe<step_command_t>(hal::kChannelStepCommand,
                                [&](const step_command_t& m) { heard.steps = std::max(heard.steps, m.tick); });

  std::map<std::string, std::unique_ptr<Process>> processes;
  std::vector<std::string> order(std::begin(kPrograms), std::end(kPrograms));
  std::shuffle(order.begin(), order.end(), random);
  for (const std::string& program : order) processes[program] = std::make_unique<Process>(folder, program, url);
  const auto all_said = [&] {
    std::string text;
    for (const auto& [program, process] : processes) text += process->said();
    return text;
  };

  const auto wait = [&](const auto& done) {
    return bus.receive_until(hal::after(hal::WallClock::now(), hal::Seconds(60)), done);
  };
  ASSERT_EQ(wait([&] { return heard.sensors >= tick; }), hal::Status::kOk) << all_said();
  std::this_thread::sleep_for(part);
  ASSERT_FALSE(processes[victim]->ended()) << all_said();
  processes[victim]->kill();

  // The others end by themselves: a peer is given up after 4 s, a minute is any machine's.
  const auto everybody_ended = [&] {
    return std::all_of(processes.begin(), processes.end(), [](auto& process) { return process.second->ended(); });
  };
  const auto deadline = hal::after(hal::WallClock::now(), hal::Seconds(60));
  while (!everybody_ended() && hal::WallClock::now() < deadline) {
    static_cast<void>(bus.receive_until(hal::after(hal::WallClock::now(), hal::Seconds(0.02)), [] { return false; }));
  }
  for (const auto& [program, process] : processes) {
    ASSERT_TRUE(process->ended()) << program << " goes on\n" << all_said();
    if (program == victim) continue;
    EXPECT_EQ(process->exit_status(), 2) << program << "\n" << all_said();
    EXPECT_NE(process->said().find(victim), std::string::npos) << program << " does not name it\n" << all_said();
  }

  // The log is whole up to the last tick that everybody had answered: a plant that sends tick k has kept k - 1.
  const Laps laps((folder / "r/run.lcmlog").string());
  const std::int64_t last = laps.last_whole();
  EXPECT_GE(last, heard.sensors - 1);
  // The masses stop: no pulses were sent beyond those that answer the tick under way, last + 1.
  EXPECT_LE(heard.steps, last + 2);
  EXPECT_LE(laps.messages.size(), static_cast<std::size_t>(last + 2 + (victim == "plant" ? 2 : 1)));
  if (victim != "plant") {
    EXPECT_EQ(laps.damage, "");
    EXPECT_EQ(laps.messages.size(), static_cast<std::size_t>(last + 3)) << "part of a tick";
    EXPECT_EQ(nlohmann::json::parse(read_file(folder / "r/blackbox/blackbox.json"))["last_tick"], last);
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "r/summary.json"));
  if (last < -2) return;
  const Outcome replay = folder.run("ballast replay r --verify");
  EXPECT_EQ(replay.exit_status, 0) << replay.out << replay.err;
  EXPECT_NE(replay.out.find("ticks -2 to " + std::to_string(last) + " "), std::string::npos) << replay.out;
}

std::uint64_t number(const char* variable, std::uint64_t otherwise) {
  const char* text = std::getenv(variable);
  return text != nullptr ? std::stoull(text) : otherwise;
}

// Four at a time, each on a bus of its own: they mostly wait for each other to be given up.
TEST(Killed, OneOfThreeTheOthersEndAndTheLogIsKept) {
  const std::uint64_t kills = number("BALLAST_KILLS", 12);
  const std::uint64_t seed = ballast::test::random_seed();
  std::atomic<std::uint64_t> next{0};
  std::vector<std::thread> worlds;
  for (int world = 0; world < 4; ++world) {
    worlds.emplace_back([&, world] {
      for (std::uint64_t i = next++; i < kills; i = next++)
        kill_one(kPrograms[(seed + i) % std::size(kPrograms)], test::bus_url(world), seed + i);
    });
  }
  for (std::thread& world : worlds) world.join();
  // None of ours is left over.
  EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);
  std::printf("%llu kills, seed %llu\n", static_cast<unsigned long long>(kills), static_cast<unsigned long long>(seed));
}

}  // namespace
}  // namespace ballast
