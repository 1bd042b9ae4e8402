#include "tools/recording/recorder.h"

#include <gtest/gtest.h>
#include <sched.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <lcm/lcm-cpp.hpp>

#include "tools/faults/full_disk.h"
#include "tools/recording/output_dir.h"
#include "tools/sil/plant_messages.h"
#include "tools/sil/step_ledger.h"

namespace ballast::sil {
namespace {

// Read back by liblcm's own reader.
TEST(Recorder, WritesALogThatLcmReads) {
  const std::string path = testing::TempDir() + "recorder_test.lcmlog";
  {
    Recorder recorder(path);
    for (std::int64_t k = -2; k < 100; ++k) {
      trip_t trip{};
      trip.tick = k;
      trip.utime = 1000 * k;
      recorder.record(hal::kChannelTrip, trip);
    }
    EXPECT_TRUE(recorder.close());
  }
  lcm::LogFile log(path, "r");
  ASSERT_TRUE(log.good());
  for (std::int64_t k = -2; k < 100; ++k) {
    const auto* event = log.readNextEvent();
    ASSERT_NE(event, nullptr);
    EXPECT_EQ(event->channel, hal::kChannelTrip);
    EXPECT_EQ(event->timestamp, 1000 * k);
    EXPECT_EQ(event->eventnum, k + 2);
    trip_t trip;
    ASSERT_TRUE(hal::decode(event->data, static_cast<std::size_t>(event->datalen), trip));
    EXPECT_EQ(trip.tick, k);
  }
  EXPECT_EQ(log.readNextEvent(), nullptr);
  std::filesystem::remove(path);
}

// Seconds, however short the control period; and whole laps.
TEST(Recorder, KnowsWhereTheLastSecondsOfItsLogBegin) {
  EXPECT_EQ(Recorder::tail_ticks(0.01), 4096);
  EXPECT_EQ(Recorder::tail_ticks(0.001), 4096);
  EXPECT_EQ(Recorder::tail_ticks(0.0005), 8000);
  const std::string path = testing::TempDir() + "recorder_tail_test.lcmlog";
  constexpr std::int64_t kTail = 5000, kLaps = 12345;
  Recorder recorder(path, nullptr, false, 0, kTail);
  for (std::int64_t k = 0; k < kLaps; ++k) recorder.take(Lap{});
  ASSERT_TRUE(recorder.close());
  const auto bytes = static_cast<std::int64_t>(std::filesystem::file_size(path));
  const std::int64_t lap = bytes / kLaps;
  EXPECT_EQ(recorder.tail_offset() % lap, 0);
  EXPECT_GE((bytes - recorder.tail_offset()) / lap, kTail);
  EXPECT_LE((bytes - recorder.tail_offset()) / lap, kTail + 2 * Recorder::kTailStride);
  std::filesystem::remove(path);
}

TEST(Recorder, SaysWhenTheDiskIsFull) {
  Recorder recorder("/dev/full");
  for (int k = 0; k < 100; ++k) recorder.record(hal::kChannelTrip, trip_t{});
  EXPECT_FALSE(recorder.close());
  EXPECT_NE(recorder.error().find("/dev/full"), std::string::npos);
}

// The processors of each thread of this process.
std::vector<cpu_set_t> processors_of_threads() {
  std::vector<cpu_set_t> all;
  for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task")) {
    cpu_set_t& its = all.emplace_back();
    EXPECT_EQ(sched_getaffinity(std::stoi(thread.path().filename()), sizeof its, &its), 0);
  }
  return all;
}

// A lap beside QEMU keeps to one processor.
TEST(Recorder, WritesOnAllProcessorsWhereTheLapKeepsToOne) {
  cpu_set_t before, one;
  ASSERT_EQ(sched_getaffinity(0, sizeof before, &before), 0);
  CPU_ZERO(&one);
  CPU_SET(static_cast<std::size_t>(sched_getcpu()), &one);
  const std::string path = testing::TempDir() + "recorder_processors_test.lcmlog";
  ASSERT_EQ(sched_setaffinity(0, sizeof one, &one), 0);
  {
    Recorder recorder(path);
    recorder.record(hal::kChannelTrip, trip_t{});
    EXPECT_TRUE(recorder.close());  // its thread has begun
    const auto processors = processors_of_threads();
    const auto on = [&](const cpu_set_t& set) {
      return std::ranges::count_if(processors, [&](const cpu_set_t& its) { return CPU_EQUAL(&its, &set) != 0; });
    };
    EXPECT_GE(on(before), 1);
    EXPECT_GE(on(one), 1);
  }
  EXPECT_EQ(sched_setaffinity(0, sizeof before, &before), 0);
  std::filesystem::remove(path);
}

TEST(FullDisk, TheFirstOfTwoCounts) {
  sim::Scenario scenario;
  for (const double time_s : {2, 1}) {
    sim::Fault& fault = scenario.faults.emplace_back();
    fault.kind = sim::FaultKind::kDiskFull;
    fault.time_s = time_s;
  }
  const std::string path = testing::TempDir() + "full_disk_test.lcmlog";
  Recorder recorder(path);
  FullDisk disk(scenario, recorder);
  Lap lap;
  lap.plant.contact.utime = 999'999;
  disk.take(lap);
  EXPECT_TRUE(disk.good());
  const std::int64_t bytes = disk.bytes();
  EXPECT_GT(bytes, 0);
  lap.plant.contact.utime = 1'000'000;
  disk.take(lap);
  EXPECT_FALSE(disk.good());
  EXPECT_NE(disk.error().find("No space left on device (as asked: disk_full at 1 s)"), std::string::npos)
      << disk.error();
  EXPECT_EQ(disk.bytes(), bytes);
  EXPECT_TRUE(recorder.close());
  std::filesystem::remove(path);
}

TEST(Recorder, SaysWhenTheFolderIsNotThere) {
  const Recorder recorder("/nonexistent/run.lcmlog");
  EXPECT_FALSE(recorder.good());
  EXPECT_NE(recorder.error().find("/nonexistent/run.lcmlog"), std::string::npos);
}

TEST(FrictionMargin, IsOneUnusedZeroAtTheLimitAndNeverNan) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(friction_margin(10, 0, 0.5), 1);
  EXPECT_EQ(friction_margin(10, 5, 0.5), 0);
  EXPECT_EQ(friction_margin(10, 100, 0.5), -1);
  EXPECT_EQ(friction_margin(10, 5, kInfinity), 1);
  EXPECT_EQ(friction_margin(0, 5, kInfinity), -1);
  EXPECT_EQ(friction_margin(-1, 0, 0.5), -1);
}

TEST(Expand, GivesPulsesInOrderOfTime) {
  step_command_t command{};
  command.burst_count = 2;
  command.motor[0] = 1, command.direction[0] = -1, command.count[0] = 4;
  command.first[0] = 100, command.interval[0] = 50, command.add[0] = 10;
  command.motor[1] = 0, command.direction[1] = 1, command.count[1] = 2;
  command.first[1] = 100, command.interval[1] = 55, command.add[1] = 0;
  std::vector<sim::StepPulse> pulses;
  expand(command, 1e3, pulses);
  ASSERT_EQ(pulses.size(), 6u);
  // Motor 1: 100, 150, 210, 280; motor 0: 100, 155.
  const double times[] = {.1, .1, .15, .155, .21, .28};
  const int motors[] = {0, 1, 1, 0, 1, 1};
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_DOUBLE_EQ(pulses[i].offset_s, times[i]);
    EXPECT_EQ(pulses[i].motor, motors[i]);
    EXPECT_EQ(pulses[i].direction, motors[i] == 1 ? -1 : 1);
  }
}

// Two motors, one of them forth and back, with intervals that grow and shrink.
TEST(StepLedger, SeesPulsesThatTheCommandDoesNotSpeakOf) {
  constexpr double kTimer_hz = 1e7;
  step_command_t command{};
  command.motor_count = 2;
  command.burst_count = 3;
  for (std::size_t b = 0; b < 3; ++b) {
    command.motor[b] = b == 2 ? 1 : 0;
    command.direction[b] = b == 0 ? -1 : 1;
    command.count[b] = static_cast<std::int16_t>(5 + 2 * b);
    command.first[b] = 1234 + 4000 * static_cast<std::int32_t>(b);
    command.interval[b] = 400;
    command.add[b] = b == 1 ? 17 : -13;
  }
  std::vector<sim::StepPulse> pulses;
  expand(command, kTimer_hz, pulses);
  ASSERT_EQ(pulses.size(), 5u + 7u + 9u);
  EXPECT_TRUE(StepLedger::gives(command, kTimer_hz, pulses));
  const auto with = [&](auto change) {
    auto changed = pulses;
    change(changed);
    return StepLedger::gives(command, kTimer_hz, changed);
  };
  EXPECT_FALSE(with([](auto& p) { p.pop_back(); }));
  EXPECT_FALSE(with([](auto& p) { p.push_back(p.back()); }));
  EXPECT_FALSE(with([](auto& p) { std::swap(p[3], p[4]); }));
  EXPECT_FALSE(with([](auto& p) { p[7].direction *= -1; }));
  EXPECT_FALSE(with([](auto& p) { p[7].offset_s += 1 / kTimer_hz; }));
  EXPECT_FALSE(with([](auto& p) { p[7].motor = 2; }));
  EXPECT_FALSE(with([](auto& p) { p[7].motor = -1; }));
  EXPECT_FALSE(with([](auto& p) {
    for (auto& pulse : p) pulse.motor = 1 - pulse.motor;
  }));
  EXPECT_TRUE(StepLedger::gives(step_command_t{}, kTimer_hz, {}));
}

// Its lock is on the folder, and files are written by name: after a move the name may be another run's.
TEST(OutputDir, WritesNothingIntoAnotherFolderOfItsName) {
  const std::filesystem::path root = testing::TempDir() + "output_dir_test";
  std::filesystem::remove_all(root);
  {
    OutputDir output(root / "r");
    ASSERT_TRUE(output.good()) << output.error();
    ASSERT_TRUE(output.write("robot.json", "{}"));
    std::filesystem::rename(root / "r", root / "moved");
    std::filesystem::create_directories(root / "r" / "blackbox" / "of another run");
    std::ofstream(root / "r" / "blackbox" / "run.lcmlog") << "its";
    output.clear_black_box();
    EXPECT_TRUE(std::filesystem::exists(root / "r" / "blackbox" / "run.lcmlog"));
    EXPECT_FALSE(output.write("summary.json", "{}"));
    EXPECT_NE(output.error().find("is no longer the folder that it was"), std::string::npos) << output.error();
    EXPECT_FALSE(std::filesystem::exists(root / "r" / "summary.json"));
  }
  {
    // A folder that was made goes if nothing was put in it, on every path to its name.
    const OutputDir output(root / "x" / "y" / ".." / "z" / "");
    EXPECT_TRUE(std::filesystem::exists(root / "x" / "z"));
  }
  EXPECT_FALSE(std::filesystem::exists(root / "x"));
  std::filesystem::remove_all(root);
}

}  // namespace
}  // namespace ballast::sil
