// `ballast replay` and the black box, as people use them.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <lcm/lcm-cpp.hpp>
#include <limits>
#include <set>

#include "hal/lcm/channels.h"
#include "hal/lcm/messages.h"
#include "tests/sil/shell.h"
#include "tools/recording/black_box.h"
#include "tools/recording/log_reader.h"
#include "tools/recording/recorder.h"

namespace ballast {
namespace {

using test::bus_url;
using test::Folder;
using test::Outcome;
using test::read_file;

// Copies a run's log and scenario to another folder, with `change` applied to the messages of one channel.
template <class M>
void copy_run(const Folder& folder, const std::string& from, const std::string& to, const char* channel,
              const std::function<void(M&)>& change) {
  std::filesystem::create_directory(folder / to);
  std::filesystem::copy_file(folder / from / "scenario.toml", folder / to / "scenario.toml");
  sil::LogReader reader((folder / from / "run.lcmlog").string());
  sil::Recorder recorder((folder / to / "run.lcmlog").string());
  const auto copy = [&]<class A>(const sil::LogEvent& event, const char* name, A*) {
    if (event.channel != name) return;
    A message{};
    ASSERT_TRUE(hal::decode(event.data.data(), event.data.size(), message));
    if constexpr (std::is_same_v<A, M>) {
      if (std::string(name) == channel) change(message);
    }
    recorder.record(name, message);
  };
  for (sil::LogEvent event; reader.next(event);) {
    copy(event, hal::kChannelOperator, static_cast<operator_t*>(nullptr));
    copy(event, hal::kChannelContact, static_cast<contact_t*>(nullptr));
    copy(event, hal::kChannelPlantState, static_cast<plant_state_t*>(nullptr));
    copy(event, hal::kChannelSensors, static_cast<sensors_t*>(nullptr));
    copy(event, hal::kChannelTrip, static_cast<trip_t*>(nullptr));
    copy(event, hal::kChannelControllerStatus, static_cast<controller_status_t*>(nullptr));
    copy(event, hal::kChannelStepCommand, static_cast<step_command_t*>(nullptr));
  }
  ASSERT_TRUE(recorder.close());
}

// The same firmware repeats the run's outputs, and the replayed log is the recorded one, byte for byte.
TEST(Replay, TheSameFirmwareSaysTheSame) {
  const Folder folder;
  for (const std::string scenario :
       {"paper_ball --set duration=1", "paper_ball --set envelope.friction_use=0.3", "seam_ball --set duration=0.5",
        "desk_ball --set duration=0.3 --set run.hold=0.3 --set sensors.preset=bmi088 --set sensors.latency=0.003 "
        "--set sensors.position_fix.rate=10",
        "desk_ball --set duration=0.3 --set sensors.attitude=sensed --set sensors.preset=bmi088 --set "
        "sensors.latency=0.003 "
        "--set sensors.position_fix.rate=10"}) {
    SCOPED_TRACE(scenario);
    folder.run("ballast run " + scenario + " --quiet --out r");
    const Outcome replay = folder.run("ballast replay r --verify --out again.lcmlog");
    EXPECT_EQ(replay.exit_status, 0) << replay.err;
    EXPECT_SAYS(replay.out, "equal");
    EXPECT_SAYS(replay.out, "the sources of the recorded run");
    EXPECT_TRUE(read_file(folder / "r/run.lcmlog") == read_file(folder / "again.lcmlog"));
  }
  const Outcome trip = folder.run(
      "ballast run paper_ball --set envelope.friction_use=0.3 --quiet --out r; "
      "ballast replay r");
  EXPECT_SAYS(trip.out, "trip        in tick " + folder.summary("r")["trip"]["tick"].dump() + ", faults 0x8");
}

// A log in which one number of one message is another: --verify names the tick, and says what is wrong.
TEST(Replay, EveryFieldThatFollowsFromOthersIsJudgedAgain) {
  const Folder folder;
  folder.run("ballast run paper_ball --set duration=0.1 --quiet --out r");
  const auto in_tick_50 = [&]<class M>(const char* channel, const char* words, auto change, M*) {
    SCOPED_TRACE(std::string(channel) + ": " + words);
    std::filesystem::remove_all(folder / "c");
    copy_run<M>(folder, "r", "c", channel, [&](M& message) {
      if (message.tick == 50) change(message);
    });
    const Outcome replay = folder.run("ballast replay c --verify");
    EXPECT_EQ(replay.exit_status, 3);
    EXPECT_SAYS(replay.out, "WRONG       in ");
    EXPECT_SAYS(replay.out, "first in tick 50: ");
    EXPECT_SAYS(replay.out, words);
  };
  const auto contact = [&](const char* words, auto change) {
    in_tick_50(hal::kChannelContact, words, change, static_cast<contact_t*>(nullptr));
  };
  const auto state = [&](const char* words, auto change) {
    in_tick_50(hal::kChannelPlantState, words, change, static_cast<plant_state_t*>(nullptr));
  };
  const auto sensors = [&](const char* words, auto change) {
    in_tick_50(hal::kChannelSensors, words, change, static_cast<sensors_t*>(nullptr));
  };
  const auto trip = [&](auto change) {
    in_tick_50(hal::kChannelTrip, "the monitor says", change, static_cast<trip_t*>(nullptr));
  };
  contact("time_s", [](contact_t& m) { m.time_s += 1e-6; });
  contact("utime", [](contact_t& m) { m.utime += 1; });
  contact("mu_required", [](contact_t& m) { m.normal_force_n *= 1 + 1e-6; });
  contact("static_friction_n", [](contact_t& m) { m.static_friction_n += 1e-6; });
  contact("|friction_force_W_n|", [](contact_t& m) { m.friction_force_W_n[0] += 1e-6; });
  contact("|friction_force_W_n|", [](contact_t& m) { m.friction_force_W_n[1] += 1e-6; });
  contact("mu_required", [](contact_t& m) { m.mu_required *= 1 + 1e-6; });
  contact("commanded_mu_required", [](contact_t& m) { m.commanded_mu_required *= 1 + 1e-6; });
  contact("commanded_mu_required", [](contact_t& m) { m.commanded_normal_force_n *= 1 + 1e-6; });
  contact("commanded_mu_required", [](contact_t& m) { m.commanded_static_friction_n *= 1 + 1e-6; });
  contact("commanded_tick", [](contact_t& m) { m.commanded_tick -= 1; });
  contact("margin", [](contact_t& m) { m.margin -= 1e-6; });
  contact("normal_force_min_n", [](contact_t& m) { m.normal_force_min_n *= 2; });
  contact("mu_required_max", [](contact_t& m) { m.mu_required_max /= 2; });
  contact("flight", [](contact_t& m) { m.regime = contact_t::REGIME_FLIGHT; });
  state("time_s", [](plant_state_t& m) { m.time_s += 1e-6; });
  state("utime", [](plant_state_t& m) { m.utime += 1; });
  state("the orientation's length", [](plant_state_t& m) { m.orientation[2] += 1e-4; });
  state("velocity_W_mps", [](plant_state_t& m) { m.angular_velocity_B_radps[1] += 1e-6; });
  state("velocity_W_mps", [](plant_state_t& m) { m.velocity_W_mps[0] += 1e-6; });
  state("height", [](plant_state_t& m) { m.position_W_m[2] += 1e-6; });
  state("mass 1", [](plant_state_t& m) { m.mass_position[1] += 1e-6; });
  state("mass 2", [](plant_state_t& m) { m.mass_position_B_m[2][1] += 1e-6; });
  state("center_of_mass_B_m", [](plant_state_t& m) { m.center_of_mass_B_m[0] += 1e-6; });
  state("mass_count", [](plant_state_t& m) { m.mass_count = 2; });
  sensors("utime", [](sensors_t& m) { m.utime += 1; });
  sensors("attitude_valid", [](sensors_t& m) { m.attitude_valid = 0; });
  sensors("orientation", [](sensors_t& m) { m.orientation[0] += 1e-6; });
  sensors("gyro_B_radps", [](sensors_t& m) { m.gyro_B_radps[2] += 1e-6; });
  trip([](trip_t& m) { m.cause = trip_t::CAUSE_FRICTION; });
  trip([](trip_t& m) { m.value = 1; });
  trip([](trip_t& m) { m.limit = 1; });
  trip([](trip_t& m) { m.trip_tick = 3; });
  trip([](trip_t& m) { m.trip_time_s = 3; });
  // A contact that trips the monitor of today, and did not.
  contact("the monitor says", [](contact_t& m) { m.normal_force_min_n = -1; });
}

// Logs with sliding, faults and ends between two ticks are as they should be.
TEST(Replay, SoundLogsAreJudgedSound) {
  const Folder folder;
  for (const std::string run :
       {"paper_ball --set surface.static_friction=0.17", "paper_ball --fault friction_falls@2:0.001 --set duration=3",
        "desk_ball --set duration=1 --fault push@0.5:0.5", "paper_ball --set duration=0.5 --fault sensor_nan@0.2",
        "paper_ball --set duration=0.5 --fault messages_dropped@0.2:channel=BALLAST_CONTACT",
        "desk_ball --set duration=1 --set run.on_violation=continue --set surface.static_friction=0.02"}) {
    SCOPED_TRACE(run);
    folder.run("ballast run " + run + " --quiet --out r");
    const Outcome replay = folder.run("ballast replay r --verify");
    EXPECT_EQ(replay.out.find("WRONG"), std::string::npos) << replay.out;
    EXPECT_SAYS(replay.out, "judged");
    std::filesystem::remove_all(folder / "r");
  }
}

// Commands of people, which reach the controller in a tick of its own.
TEST(Replay, OperatorsAreObeyedInTheTickInWhichTheyWere) {
  const Folder folder;
  for (const std::string how : {"", "--processes"}) {
    SCOPED_TRACE(how);
    const std::string bus = " --lcm '" + bus_url(how.empty() ? 0 : 1) + "'";
    const Outcome said = folder.run(
        "ballast run paper_ball --by-hand --speed 8 --set duration=600 --set run.control_period=0.004"
        " --set surface.static_friction=inf --quiet --out r " +
        how + bus +
        " & run=$!; i=0;"
        " while [ $i -lt 100 ] && ! ballast operate status" +
        bus +
        " --peer-timeout 0.3 >/dev/null 2>&1;"
        " do i=$((i + 1)); done; ballast move --mass 1 --to 2.1" +
        bus + "; ballast operate start" + bus + "; ballast operate stop" + bus +
        "; kill -INT $run; wait $run; ballast replay r --verify; echo status $?");
    EXPECT_SAYS(said.out, "status 0\n") << said.err;
    EXPECT_SAYS(said.out, "equal");
    EXPECT_SAYS(said.out, "did not come to its end");
  }
}

// One bit of one number, in one message.
TEST(Replay, NamesTheFirstTickAndField) {
  const Folder folder;
  folder.run("ballast run paper_ball --set duration=0.3 --quiet --out r");
  copy_run<controller_status_t>(folder, "r", "bit", hal::kChannelControllerStatus, [](controller_status_t& m) {
    if (m.tick == 100) m.normal_force_n = std::nextafter(m.normal_force_n, 0.0);
    if (m.tick == 101) m.margin += 0.5;
  });
  const Outcome bit = folder.run("ballast replay bit --verify");
  EXPECT_EQ(bit.exit_status, 3);
  EXPECT_SAYS(bit.out, "DIFFERS     in 2 of 303 ticks, first in tick 100");
  EXPECT_SAYS(bit.out, "BALLAST_CONTROLLER_STATUS, tick 100, normal_force_n: ");
  EXPECT_SAYS(bit.out, " (1 ULP); 2 messages differ");
  EXPECT_SAYS(bit.out, "why         not the firmware's sources, which are the same: the log is damaged, ");
  // Outputs of a firmware with other sources are unknown.
  std::string scenario = read_file(folder / "bit/scenario.toml");
  const std::string sources = "# Firmware sources: ";
  scenario[scenario.find(sources) + sources.size()] ^= 1;
  folder.write("other.toml", scenario);
  EXPECT_SAYS(folder.run("ballast replay bit --scenario other.toml").out, "the firmware's sources, or a damaged log");
  EXPECT_EQ(folder.run("ballast replay bit").exit_status, 0) << "only --verify judges";
  const Outcome before = folder.run("ballast replay bit/run.lcmlog --verify --until 99");
  EXPECT_EQ(before.exit_status, 0) << before.out << before.err;
  EXPECT_SAYS(before.out, "ticks -2 to 99 ");

  copy_run<step_command_t>(folder, "r", "step", hal::kChannelStepCommand, [](step_command_t& m) {
    if (m.tick == 51) m.steps[2] -= 3;
  });
  const Outcome step = folder.run("ballast replay step --verify");
  EXPECT_EQ(step.exit_status, 3);
  EXPECT_SAYS(step.out, "BALLAST_STEP_COMMAND, tick 51 (commanded in tick 50), steps[2]: ");
  EXPECT_SAYS(step.out, "(+3 microsteps)");
}

// Replay feeds the inputs: with other sensors the firmware's outputs differ from that tick on.
TEST(Replay, OtherInputsGiveOtherOutputs) {
  const Folder folder;
  folder.run("ballast run paper_ball --set duration=0.3 --quiet --out r");
  copy_run<sensors_t>(folder, "r", "nan", hal::kChannelSensors, [](sensors_t& m) {
    if (m.tick == 200) m.gyro_B_radps[1] = std::numeric_limits<double>::quiet_NaN();
  });
  const Outcome nan = folder.run("ballast replay nan --verify");
  EXPECT_EQ(nan.exit_status, 3);
  EXPECT_SAYS(nan.out, "first in tick 200");
  EXPECT_SAYS(nan.out, "trip        in tick 200, faults 0x1");
  copy_run<trip_t>(folder, "r", "trip", hal::kChannelTrip, [](trip_t& m) { m.tripped = m.tick >= 150 ? 1 : 0; });
  EXPECT_SAYS(folder.run("ballast replay trip").out, "trip        in tick 150, faults 0x8");
}

// A log of lcm-logger's that lacks a message, or a tick: what is behind it cannot be verified, and that is no success.
TEST(Replay, ALogWithAGapIsNotEqual) {
  const Folder folder;
  for (const std::string fault : {"", " --fault messages_delayed@0.05:1,peer=controller"}) {
    SCOPED_TRACE(fault);
    folder.run("ballast run paper_ball --set duration=0.3 --quiet --out r" + fault);
    const auto without = [&](const std::string& to, const std::set<std::int64_t>& ticks, const char* only) {
      std::filesystem::create_directory(folder / to);
      std::filesystem::copy_file(folder / "r/scenario.toml", folder / to / "scenario.toml",
                                 std::filesystem::copy_options::overwrite_existing);
      sil::LogReader reader((folder / "r/run.lcmlog").string());
      std::int64_t tick = hal::kWaitingTick;
      lcm::LogFile log((folder / to / "run.lcmlog").string(), "w");
      for (sil::LogEvent event; reader.next(event);) {
        contact_t contact{};
        if (event.channel == hal::kChannelContact) {
          ASSERT_TRUE(hal::decode(event.data.data(), event.data.size(), contact));
          tick = contact.tick;
        }
        if (ticks.contains(tick) && (*only == 0 || event.channel == only)) continue;
        lcm::LogEvent out{0, event.timestamp, event.channel, static_cast<std::int32_t>(event.data.size()),
                          event.data.data()};
        ASSERT_EQ(log.writeEvent(&out), 0);
      }
    };
    const auto expect_gap = [&](const std::string& what) {
      const Outcome replay = folder.run("ballast replay gap --verify");
      EXPECT_EQ(replay.exit_status, 8) << replay.out << replay.err;
      EXPECT_SAYS(replay.out, "GAP         " + what);
      EXPECT_SAYS(replay.out, "; the log goes on to tick 300, and nothing after tick 99 was replayed");
      EXPECT_SAYS(replay.out, "equal       up to the gap: every step command and every status of ticks -2 to 99, bit");
      EXPECT_EQ(folder.run("ballast replay gap").exit_status, 0) << "only --verify judges";
      EXPECT_EQ(folder.run("ballast replay gap --verify --until 99").exit_status, 0);
    };
    without("gap", {100}, "");
    expect_gap("tick 100 is not in it");
    without("gap", {100, 101, 102}, "");
    expect_gap("ticks 100 to 102 are not in it");
    without("gap", {100}, hal::kChannelControllerStatus);
    expect_gap("tick 100 is not whole");
    without("gap", {100}, hal::kChannelSensors);
    expect_gap("tick 100 is not whole");
    // At its end there is no gap.
    without("gap", {300}, hal::kChannelStepCommand);
    EXPECT_EQ(folder.run("ballast replay gap --verify").exit_status, 0);
  }
}

TEST(Replay, LogsThatDoNotFitAreRefusedOrNoted) {
  const Folder folder;
  folder.run("ballast run paper_ball --set duration=0.3 --quiet --out r");
  const std::string log = read_file(folder / "r/run.lcmlog");
  const auto beside = [&](const std::string& name, const std::string& text) {
    std::ofstream(folder / ("r/" + name), std::ios::binary) << text;
    return folder.run("ballast replay --verify r/" + name);
  };
  const Outcome cut = beside("cut.lcmlog", log.substr(0, log.size() / 2));
  EXPECT_EQ(cut.exit_status, 0) << cut.err;
  EXPECT_SAYS(cut.out, "the log ends early: cut off inside an event at byte ");
  std::string bad = log;
  bad[log.find("BALLAST_SENSORS", log.size() / 2) - 28] ^= 1;
  const Outcome damaged = beside("damaged.lcmlog", bad);
  EXPECT_EQ(damaged.exit_status, 8) << damaged.err;
  EXPECT_SAYS(damaged.out, "GAP         damaged at byte ");
  EXPECT_SAYS(damaged.out, "the log goes on to tick 300");
  bad[log.find("BALLAST_SENSORS", log.size() / 2) - 28] ^= 1;
  bad[log.find("BALLAST_SENSORS", log.size() / 2) - 4] ^= 0x10;  // the message's length
  const Outcome longer = beside("longer.lcmlog", bad);
  EXPECT_EQ(longer.exit_status, 8) << longer.err;
  EXPECT_SAYS(longer.out, "GAP         cut off inside an event at byte ");
  const auto hole = static_cast<std::ptrdiff_t>(log.size() / 2);
  const Outcome holed = beside("holed.lcmlog", std::string(log).erase(hole, 10000));
  EXPECT_TRUE(holed.exit_status == 8 || holed.exit_status == 2) << "a message may be half of one: " << holed.err;
  const Outcome twice = beside("twice.lcmlog", log + log);
  EXPECT_EQ(twice.exit_status, 0) << twice.err;

  // The summary knows the length of its own log: whole events too many or too few at its end are found as well.
  const auto as_run_log = [&](const std::string& text) {
    const Outcome replay = beside("run.lcmlog", text);
    beside("run.lcmlog", log);
    EXPECT_EQ(replay.exit_status, 8) << replay.out << replay.err;
    EXPECT_SAYS(replay.out, "DAMAGED     the log has " + std::to_string(text.size()) + " bytes; the run left " +
                                std::to_string(log.size()));
  };
  as_run_log(log + "x");
  as_run_log(log + log);
  as_run_log(log.substr(0, log.rfind("BALLAST_STEP_COMMAND") - 28));
  EXPECT_EQ(folder.run("ballast replay r --verify").out.find("DAMAGED"), std::string::npos);

  const auto ended = [](int status, const Outcome& outcome, const std::string& words) {
    EXPECT_EQ(outcome.exit_status, status) << outcome.out;
    EXPECT_SAYS(outcome.err, words);
  };
  const auto no_log = [&ended](const Outcome& outcome, const std::string& words) { ended(2, outcome, words); };
  const auto refused = [&ended](const Outcome& outcome, const std::string& words) { ended(1, outcome, words); };
  no_log(beside("empty.lcmlog", ""), "is empty");
  no_log(beside("noise.lcmlog", std::string(1000, 'x')), "is no LCM event log");
  no_log(beside("short.lcmlog", log.substr(0, 20)), "is no LCM event log");
  std::string type = log;
  type[log.find("BALLAST_SENSORS") + 15] ^= 1;
  no_log(beside("type.lcmlog", type), "not a sensors_t of this build");
  type = log;
  type[log.find("BALLAST_TRIP", log.size() / 2) + 12] ^= 1;
  no_log(beside("trip.lcmlog", type), "BALLAST_TRIP: not a trip_t of this build");
  no_log(folder.run("ballast replay nowhere"), "cannot be read");
  refused(folder.run("ballast replay r --scenario paper_disk"), "of another scenario: fingerprint ");
  refused(folder.run("ballast replay r --scenario paper_ball"), "of another scenario");
  refused(folder.run("ballast replay r --out r/run.lcmlog"), "is the log that is replayed");
  refused(folder.run("ballast run paper_ball --actuation prescribed --set duration=0.1 --quiet --out p; "
                     "ballast replay p"),
          "prescribed");
  refused(folder.run("ballast replay r --until -50"),
          "--until: r/run.lcmlog: nothing to replay: it begins after tick -50");
  refused(folder.run("mkdir bare; cp r/run.lcmlog bare; ballast replay bare"), "--scenario");
  EXPECT_TRUE(log == read_file(folder / "r/run.lcmlog"));
}

TEST(BlackBox, ItsCommandGivesTheSameTripAtTheSameTick) {
  const Folder folder;
  // In a folder with a quote and a space.
  const std::string run = "ballast run paper_ball --set envelope.friction_use=0.55 --seed 5 --out \"it's r\"";
  const Outcome tripped = folder.run(run);
  ASSERT_EQ(tripped.exit_status, 3) << tripped.out << tripped.err;
  const auto at = tripped.out.find("  black box   ");
  ASSERT_NE(at, std::string::npos) << tripped.out;
  const auto command = tripped.out.find("again: ", at) + 7;
  const Outcome again = folder.run(tripped.out.substr(command, tripped.out.find('\n', command) - command));
  EXPECT_EQ(again.exit_status, 3) << again.err;

  const auto was = folder.summary("it's r"), is = folder.summary("it's r/blackbox/again");
  ASSERT_FALSE(was["trip"].is_null());
  EXPECT_EQ(is["trip"], was["trip"]);
  EXPECT_EQ(is["seed"], 5);
  EXPECT_TRUE(read_file(folder / "it's r/run.lcmlog") == read_file(folder / "it's r/blackbox/again/run.lcmlog"));

  const auto box = nlohmann::json::parse(read_file(folder / "it's r/blackbox/blackbox.json"));
  EXPECT_EQ(box["trip"], was["trip"]);
  EXPECT_EQ(box["end"], was["end"]);
  EXPECT_EQ(box["summary"], was);
  EXPECT_EQ(box["seed"], 5);
  // The end of the log, beginning with a whole lap.
  const std::string log = read_file(folder / "it's r/run.lcmlog"),
                    tail = read_file(folder / "it's r/blackbox/run.lcmlog");
  ASSERT_LE(tail.size(), log.size());
  EXPECT_TRUE(log.substr(log.size() - tail.size()) == tail);
  sil::LogReader reader((folder / "it's r/blackbox/run.lcmlog").string());
  sil::LogEvent event;
  ASSERT_TRUE(reader.next(event));
  EXPECT_TRUE(event.channel == hal::kChannelContact || event.channel == hal::kChannelOperator) << event.channel;
}

TEST(BlackBox, HoldsTheEndOfALongRunAndIsRefusedAsAWholeOne) {
  const Folder folder;
  // It trips after seven seconds or so.
  const Outcome run = folder.run("ballast run paper_ball --set envelope.friction_use=0.55 --quiet --out r");
  ASSERT_EQ(run.exit_status, 3) << run.err;
  sil::LogReader reader((folder / "r/blackbox/run.lcmlog").string());
  std::int64_t laps = 0, first = 0, last = 0;
  for (sil::LogEvent event; reader.next(event);) {
    sensors_t sensors{};
    if (event.channel != hal::kChannelSensors || !hal::decode(event.data.data(), event.data.size(), sensors)) continue;
    if (laps++ == 0) first = sensors.tick;
    last = sensors.tick;
  }
  EXPECT_EQ(reader.damage(), "");
  EXPECT_EQ(laps, last - first + 1);
  EXPECT_EQ(last, nlohmann::json::parse(read_file(folder / "r/blackbox/blackbox.json"))["last_tick"]);
  ASSERT_GT(last, sil::Recorder::kTailTicks + sil::Recorder::kTailStride) << "too short a run to show it";
  EXPECT_GE(laps, sil::Recorder::kTailTicks);
  EXPECT_LE(laps, sil::Recorder::kTailTicks + sil::Recorder::kTailStride);
  const Outcome replay = folder.run("ballast replay r/blackbox");
  EXPECT_EQ(replay.exit_status, 2);
  EXPECT_SAYS(replay.err, "begins in the middle of a run");
  EXPECT_SAYS(replay.err, "; the whole run is in r/run.lcmlog\n");
  EXPECT_SAYS(folder.run("cd r/blackbox && ballast replay run.lcmlog").err, "; the whole run is in ../run.lcmlog\n");
  EXPECT_EQ(folder.run("ballast replay r/run.lcmlog --verify").exit_status, 0);
}

TEST(BlackBox, ARunThatEndsWellLeavesNoneNotEvenAnothers) {
  const Folder folder;
  EXPECT_EQ(folder.run("ballast run paper_ball --set envelope.friction_use=0.3 --quiet --out r").exit_status, 3);
  EXPECT_TRUE(std::filesystem::exists(folder / "r/blackbox/blackbox.json"));
  const Outcome well = folder.run("ballast run paper_ball --set duration=0.1 --out r");
  EXPECT_EQ(well.exit_status, 0);
  EXPECT_FALSE(std::filesystem::exists(folder / "r/blackbox"));
  EXPECT_EQ(well.out.find("black box"), std::string::npos);
}

// Its targets are not in the scenario. The program was not on the PATH, and the command works from everywhere.
TEST(BlackBox, OfAMoveItsCommandMovesAgain) {
  const Folder folder;
  const Outcome move = folder.run(
      "r=$PWD/r; cd \"$(dirname \"$(command -v ballast)\")\" && PATH=/usr/bin:/bin && "
      "./ballast move desk_ball --all 0.5 --mass 2 --to -0.25 --speed-fraction 0.95 --seed 3 "
      "--out \"$r\"");
  ASSERT_EQ(move.exit_status, 3) << move.out << move.err;
  const auto command =
      nlohmann::json::parse(read_file(folder / "r/blackbox/blackbox.json"))["command"].get<std::string>();
  EXPECT_SAYS(move.out, "; again: " + command + "\n");
  const Outcome again = folder.run("PATH=/usr/bin:/bin; " + command);
  EXPECT_EQ(again.exit_status, 3) << again.err;
  EXPECT_TRUE(read_file(folder / "r/run.lcmlog") == read_file(folder / "r/blackbox/again/run.lcmlog"));
}

TEST(BlackBox, WhatPeopleSaidIsOnlyInTheLog) {
  const Folder folder;
  const sim::Scenario scenario = sim::read_scenario(BALLAST_SCENARIO_DIR "/paper_ball.toml").scenario;
  const sil::OutputDir output(folder / "r");
  sil::RunResult result;
  result.operators_heard = true;
  const sil::Again heard = sil::again_of(scenario, result, {}, " --firmware qemu", " --processes", output);
  EXPECT_EQ(heard.run, "");
  EXPECT_SAYS(heard.replay, "ballast replay " + (folder / "r/run.lcmlog").string() + " --firmware qemu");
  result.operators_heard = false;
  const sil::Again alone = sil::again_of(scenario, result, {}, " --firmware qemu", "", output);
  EXPECT_EQ(alone.replay, "");
  EXPECT_SAYS(alone.run, "scenario.toml --firmware qemu --out ");
  sil::RunOptions by_hand;
  by_hand.by_hand = true;
  EXPECT_EQ(sil::again_of(scenario, result, by_hand, "", "", output).run, "");
}

// One that dies by itself may not die again; what the controller was told can be repeated at any rate.
TEST(BlackBox, ALostPeersRunIsRepeatedFromItsLog) {
  const Folder folder;
  const Outcome run = folder.run("ballast run paper_ball --processes --speed 0.33 --out r --lcm '" + bus_url(2) +
                                 "' & run=$!; i=0; while [ $i -lt 300 ] &&"
                                 " [ \"$(stat -c %s r/run.lcmlog 2>/dev/null || echo 0)\" -le 100000 ];"
                                 " do sleep 0.1; i=$((i + 1)); done; pkill -9 -P $run ballast-monitor;"
                                 " wait $run; echo $?");
  EXPECT_SAYS(run.out, "2\n");
  const auto box = nlohmann::json::parse(read_file(folder / "r/blackbox/blackbox.json"));
  EXPECT_EQ(box["end"]["reason"], "could_not_go_on");
  EXPECT_SAYS(box["end"]["text"].get<std::string>(), "ballast-monitor ended");
  EXPECT_SAYS(box["command"].get<std::string>(), "blackbox/scenario.toml --processes --lcm 'udpm://");
  EXPECT_SAYS(run.err, "; again: " + box["command"].get<std::string>() + "\n");
  const auto command = box["replay"].get<std::string>();
  EXPECT_SAYS(run.err, command);
  const Outcome again = folder.run(command + " --verify");
  EXPECT_EQ(again.exit_status, 0) << again.out << again.err;
  EXPECT_SAYS(again.out, "to " + box["last_tick"].dump() + " of ");
}

}  // namespace
}  // namespace ballast
