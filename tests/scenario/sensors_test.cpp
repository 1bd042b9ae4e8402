// The table [sensors]: what is read, and one clear error for each wrong key.
#include <gtest/gtest.h>

#include <algorithm>

#include "sim/scenario/scenario.h"
#include "sim/sensors/imu_presets.h"

namespace ballast::sim {
namespace {

const std::string kRobot =
    "duration = 1\ngravity = 9.81\nball = { radius = 0.1, mass = 0.5, inertia = [0.002, 0.002, 0.002] }\n"
    "[[mass]]\nmass = 0.1\nrail = { shape = \"line\", origin = [0, 0, 0], direction = [1, 0, 0] }\n"
    "[[mass]]\nmass = 0.1\nrail = { shape = \"circle\", radius = 0.05, direction = { azimuth = 0, elevation = 0 } }\n"
    "[sensors]\nattitude = \"sensed\"\n";

TEST(SensorScenario, IsAsWritten) {
  const auto result = parse_scenario(kRobot +
                                         "rate = 500\nlatency = 0.002\n"
                                         "gyro = { noise_density = 1e-4, bias = 0.01, range = 30 }\n"
                                         "accelerometer = { scale_error = 0.01, position = [0.01, 0, 0] }\n"
                                         "position_fix = { rate = 10, noise = 0.005, delay = 0.1 }\n"
                                         "encoder = { resolution = [0.001, 0.002] }\n",
                                     "test.toml");
  ASSERT_TRUE(result.ok()) << to_string(result.errors[0]);
  const SensorModel& sensors = result.scenario.sensors;
  EXPECT_TRUE(sensors.present);
  EXPECT_EQ(sensors.rate_hz, 500);
  EXPECT_EQ(sensors.latency_s, 0.002);
  EXPECT_EQ(sensors.gyro.noise_density, 1e-4);
  EXPECT_EQ(sensors.gyro.bias, 0.01);
  EXPECT_EQ(sensors.gyro.range, 30);
  EXPECT_EQ(sensors.gyro.resolution, 0);
  EXPECT_EQ(sensors.accelerometer.scale_error, 0.01);
  EXPECT_EQ(sensors.accelerometer_position_B_m, Eigen::Vector3d(0.01, 0, 0));
  EXPECT_EQ(sensors.fix.rate_hz, 10);
  EXPECT_EQ(sensors.encoder_resolution, (std::vector<double>{0.001, 0.002}));
}

TEST(SensorScenario, APresetGivesWhatIsNotWritten) {
  const auto result = parse_scenario(
      kRobot + "preset = \"bmi088\"\ngyro = { bias = 0 }\nencoder = { resolution = 0.001 }", "test.toml");
  ASSERT_TRUE(result.ok()) << to_string(result.errors[0]);
  const SensorModel& sensors = result.scenario.sensors;
  EXPECT_EQ(sensors.gyro.bias, 0);
  EXPECT_EQ(sensors.gyro.noise_density, imu_presets()[0].gyro.noise_density);
  EXPECT_EQ(sensors.rate_hz, 1000) << "every tick";
  EXPECT_EQ(sensors.encoder_resolution, (std::vector<double>{0.001, 0.001}));
}

// Runs of other sensors are other runs; no table is no line of the fingerprint.
TEST(SensorScenario, EveryKeyCountsInTheFingerprint) {
  const std::int64_t plain = parse_scenario(kRobot, "test.toml").scenario.id;
  std::vector<std::int64_t> known{plain};
  for (const char* key : {"rate=500.0",
                          "latency=0.001",
                          "preset=lsm6dso",
                          "gyro.noise_density=1e-4",
                          "gyro.bias=1e-4",
                          "gyro.bias_walk=1e-4",
                          "gyro.scale_error=1e-4",
                          "gyro.misalignment=1e-4",
                          "gyro.range=10.0",
                          "gyro.resolution=1e-4",
                          "accelerometer.noise_density=1e-4",
                          "accelerometer.bias=1e-4",
                          "accelerometer.bias_walk=1e-4",
                          "accelerometer.scale_error=1e-4",
                          "accelerometer.misalignment=1e-4",
                          "accelerometer.range=10.0",
                          "accelerometer.resolution=1e-4",
                          "accelerometer.position=[0.01, 0, 0]",
                          "position_fix={rate=10}",
                          "position_fix={rate=10,noise=0.01}",
                          "position_fix={rate=10,delay=0.1}",
                          "encoder.resolution=0.001"}) {
    const auto result = parse_scenario(kRobot, "test.toml", {"sensors." + std::string(key)});
    ASSERT_TRUE(result.ok()) << key << ": " << to_string(result.errors[0]);
    EXPECT_EQ(std::count(known.begin(), known.end(), result.scenario.id), 0) << key;
    known.push_back(result.scenario.id);
  }
}

TEST(SensorScenario, EachWrongKeyIsOneError) {
  const struct {
    const char *lines, *key, *words;
  } cases[] = {
      {"preset = \"bmi099\"", "sensors.preset", "bmi088"},
      {"rate = 300", "sensors.rate", "does not divide the tick rate of 1000 Hz"},
      {"rate = 2000", "sensors.rate", "as 1000 Hz"},
      {"rate = 0", "sensors.rate", "> 0"},
      {"rate = nan", "sensors.rate", "> 0"},
      {"rate = \"fast\"", "sensors.rate", "Hz"},
      {"latency = -0.1", "sensors.latency", "[0, 10]"},
      {"gyro = { noise_density = -1 }", "sensors.gyro.noise_density", ">= 0"},
      {"gyro = { bias = nan }", "sensors.gyro.bias", ">= 0"},
      {"gyro = { range = 1, resolution = 2 }", "sensors.gyro.resolution", "coarser than the range"},
      {"accelerometer = { position = [0, 0] }", "sensors.accelerometer.position", "3"},
      {"accelerometer = { position = [0, 0.08, 0.06] }", "sensors.accelerometer.position", "< ball.radius = 0.1"},
      // The first sample is taken at 0, two ticks of countdown before it give none at these rates; the run lasts 1 s.
      {"rate = 100\nlatency = 1.005", "sensors.latency", "at most 1 s at this rate"},
      {"position_fix = { rate = 10, delay = 1.1 }", "sensors.position_fix.delay", "at most 1 s at this rate"},
      {"position_fix = { rate = 10, delay = 11 }", "sensors.position_fix.delay", "[0, 10]"},
      {"position_fix = { rate = 10, delay = nan }", "sensors.position_fix.delay", "[0, 10]"},
      {"position_fix = { rate = 10, noise = -1 }", "sensors.position_fix.noise", ">= 0"},
      {"gyro = { drift = 1 }", "sensors.gyro.drift", "allowed in [sensors.gyro]: "},
      {"position_fix = { noise = 0.1 }", "sensors.position_fix.rate", "missing"},
      {"position_fix = { rate = 7 }", "sensors.position_fix.rate", "does not divide"},
      {"encoder = { resolution = [0.1] }", "sensors.encoder.resolution", "2"},
      {"encoder = { }", "sensors.encoder.resolution", "missing"},
      {"encoder = { resolution = -1 }", "sensors.encoder.resolution", ">= 0"},
      {"compass = 1", "sensors.compass", ""},
  };
  for (const auto& wrong : cases) {
    SCOPED_TRACE(wrong.lines);
    const auto result = parse_scenario(kRobot + wrong.lines + "\n", "test.toml");
    ASSERT_EQ(result.errors.size(), 1u);
    EXPECT_EQ(result.errors[0].key, wrong.key);
    EXPECT_NE(to_string(result.errors[0]).find(wrong.words), std::string::npos) << to_string(result.errors[0]);
    EXPECT_GT(result.errors[0].line, 0);
  }
}

// The limits of a delay: the run's end, or more with a hold; and the slowest rates that can be written.
TEST(SensorScenario, DelaysUpToTheRunAreGood) {
  for (const std::vector<std::string>& overrides : {std::vector<std::string>{"sensors.rate=100", "sensors.latency=1"},
                                                    {"sensors.position_fix={rate=10,delay=1}"},
                                                    {"sensors.position_fix={rate=10,delay=1.1}", "run.hold=0.1"},
                                                    {"sensors.rate=1e-15", "run.control_period=1e-6"}}) {
    const auto result = parse_scenario(kRobot, "test.toml", overrides);
    EXPECT_TRUE(result.ok()) << overrides[0] << ": " << to_string(result.errors[0]);
  }
}

TEST(SensorScenario, TheAccelerometerFitsTheBelievedBall) {
  const auto result = parse_scenario(
      kRobot + "accelerometer = { position = [0, 0.06, 0] }\n[believed.ball]\nradius = 0.055\n", "test.toml");
  ASSERT_EQ(result.errors.size(), 1u);
  EXPECT_EQ(result.errors[0].key, "believed.ball.radius");
  EXPECT_NE(result.errors[0].message.find("above 0.06 m"), std::string::npos) << result.errors[0].message;
}

// A table without `attitude` asks for an estimate, and a filter needs a hold.
TEST(SensorScenario, TheAttitudeIsEstimatedUnlessItIsSensed) {
  const auto read = [](const std::vector<std::string>& overrides) {
    const auto result = parse_scenario(kRobot, "test.toml", overrides);
    for (const auto& error : result.errors) ADD_FAILURE() << to_string(error);
    return result.scenario;
  };
  const Scenario sensed = read({}), estimated = read({"sensors.attitude=estimated"});
  EXPECT_FALSE(sensed.sensors.attitude_estimated);
  EXPECT_EQ(sensed.run.hold_s, 0);
  EXPECT_TRUE(estimated.sensors.attitude_estimated);
  EXPECT_EQ(estimated.run.hold_s, 5);
  EXPECT_EQ(read({"sensors.attitude=estimated", "run.hold=0.1"}).run.hold_s, 0.1);
  // A default that is no whole number of control periods is the next one.
  EXPECT_NEAR(read({"sensors.attitude=estimated", "run.control_period=0.003"}).run.hold_s, 5.001, 1e-12);
  EXPECT_NE(estimated.id, read({"run.hold=5"}).id) << "the attitude counts in the fingerprint";
  const std::string without = kRobot.substr(0, kRobot.find("attitude"));
  const auto by_default = parse_scenario(without, "test.toml");
  ASSERT_TRUE(by_default.ok()) << to_string(by_default.errors[0]);
  EXPECT_EQ(by_default.scenario.id, estimated.id);
  EXPECT_FALSE(
      parse_scenario(without.substr(0, without.find("[sensors]")), "test.toml").scenario.sensors.attitude_estimated)
      << "ideal sensors sense it";
}

TEST(SensorScenario, EachWrongKeyOfAnEstimateIsOneError) {
  const struct {
    std::vector<std::string> overrides;
    const char *key, *words;
  } cases[] = {
      {{"sensors.attitude=guessed"}, "sensors.attitude", "\"sensed\" or \"estimated\""},
      {{"sensors.attitude=1"}, "sensors.attitude", "\"sensed\" or \"estimated\""},
      // The controller is armed two ticks before 0; a sample of 100 Hz that is 50 ms old needs 61 ticks to be sure.
      {{"sensors.attitude=estimated", "sensors.rate=100", "sensors.latency=0.05", "run.hold=0.06"},
       "run.hold",
       "at least 0.061 s"},
      {{"sensors.attitude=estimated", "sensors.rate=1e-4"}, "sensors.rate", "the longest hold of 1000 s"},
      {{"sensors.attitude=estimated", "fault=[{kind=\"sensor_bias\",time=0.1,sensor=\"orientation\",value=0.1}]"},
       "fault.0.sensor",
       "nothing senses"},
  };
  for (const auto& wrong : cases) {
    SCOPED_TRACE(wrong.overrides.back());
    const auto result = parse_scenario(kRobot, "test.toml", wrong.overrides);
    ASSERT_EQ(result.errors.size(), 1u);
    EXPECT_EQ(result.errors[0].key, wrong.key);
    EXPECT_NE(to_string(result.errors[0]).find(wrong.words), std::string::npos) << to_string(result.errors[0]);
  }
  EXPECT_TRUE(
      parse_scenario(kRobot, "test.toml",
                     {"sensors.attitude=estimated", "sensors.rate=100", "sensors.latency=0.05", "run.hold=0.061"})
          .ok());
}

}  // namespace
}  // namespace ballast::sim
