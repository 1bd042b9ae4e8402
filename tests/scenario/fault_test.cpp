// [[fault]] and --fault: what they may say, and that nothing of it is ever ignored.
#include "sim/scenario/fault.h"

#include <set>

#include "hal/lcm/channels.h"
#include "tests/scenario/scenario_texts.h"

namespace ballast::sim {
namespace {

ScenarioResult with_faults(const std::vector<std::string>& faults, const std::vector<std::string>& overrides = {}) {
  return parse_scenario(kFull, "test.toml", overrides, faults);
}

Fault only_fault(const std::string& text, const std::vector<std::string>& overrides = {}) {
  const ScenarioResult result = with_faults({text}, overrides);
  EXPECT_TRUE(result.ok()) << all_errors(result);
  EXPECT_EQ(result.scenario.faults.size(), 1u);
  return result.scenario.faults.empty() ? Fault{} : result.scenario.faults.front();
}

std::string refusal(const std::string& text, const std::vector<std::string>& overrides = {}) {
  const ScenarioResult result = with_faults({text}, overrides);
  EXPECT_EQ(result.errors.size(), 1u) << text << "\n" << all_errors(result);
  return result.errors.empty() ? "" : to_string(result.errors.front());
}

TEST(Fault, TheTableIsInTheOrderOfItsKinds) {
  int i = 0;
  for (const FaultKindInfo& kind : fault_kinds()) EXPECT_EQ(static_cast<int>(kind.kind), i++) << kind.name;
  EXPECT_EQ(i, static_cast<int>(FaultKind::kDiskFull) + 1);
}

// Every kind with as little as it takes, and it comes out as what it is.
TEST(Fault, EveryKindCanBeAskedFor) {
  for (const FaultKindInfo& kind : fault_kinds()) {
    SCOPED_TRACE(kind.name);
    const Fault fault = only_fault(std::string(kind.name) + "@2" + (kind.value_default ? "" : ":0.25"));
    EXPECT_EQ(fault.kind, kind.kind);
    EXPECT_EQ(fault.time_s, 2);
    if (kind.value_means[0] != '\0') {
      EXPECT_EQ(fault.value, kind.value_default.value_or(0.25));
    }
    EXPECT_TRUE(contains(to_string(fault), kind.name));
    if (kind.lasts_s == kAnInstant) {
      EXPECT_EQ(fault.end_s, 2);
    }
    if (kind.lasts_s == kOnePeriod) {
      EXPECT_DOUBLE_EQ(fault.end_s, 2.002);  // kFull's control period is 2 ms
    }
  }
}

TEST(Fault, TheCommandLineSaysWhatATableSays) {
  const std::vector<std::pair<std::string, std::string>> pairs{
      {"sensor_bias@2:0.1,sensor=gyro,axis=1", "kind = \"sensor_bias\"\ntime = 2\nvalue = 0.1\naxis = 1\n"},
      {"motor_stall@1.5:mass=2,duration=0.5", "kind = \"motor_stall\"\ntime = 1.5\nmass = 2\nduration = 0.5\n"},
      {"push@1:5,direction=[0, 2, 0]", "kind = \"push\"\ntime = 1.0\nvalue = 5\ndirection = [0, 1, 0]\n"},
      {"messages_dropped@2:0.5,channel=BALLAST_TRIP,peer=controller",
       "kind = \"messages_dropped\"\ntime = 2\nvalue = 0.5\nchannel = \"BALLAST_TRIP\"\npeer = \"controller\"\n"},
  };
  for (const auto& [option, table] : pairs) {
    const ScenarioResult by_option = with_faults({option});
    const ScenarioResult by_table = parse(kFull + "[[fault]]\n" + table);
    ASSERT_TRUE(by_option.ok()) << all_errors(by_option);
    ASSERT_TRUE(by_table.ok()) << all_errors(by_table);
    EXPECT_EQ(by_option.scenario.id, by_table.scenario.id) << option;
    // And what is written down gives the same run again.
    const ScenarioResult again = parse_scenario(by_option.scenario.toml, "again.toml");
    ASSERT_TRUE(again.ok()) << all_errors(again);
    EXPECT_EQ(again.scenario.id, by_option.scenario.id);
  }
}

TEST(Fault, EveryWordOfItIsInTheFingerprint) {
  std::set<std::int64_t> ids{accepted(kFull).id};
  const std::vector<std::string> different{"sensor_bias@2:0.1",
                                           "sensor_noise@2:0.1",
                                           "sensor_bias@2.5:0.1",
                                           "sensor_bias@2:0.2",
                                           "sensor_bias@2:0.1,axis=1",
                                           "sensor_bias@2:0.1,sensor=accelerometer",
                                           "sensor_bias@2:0.1,duration=1",
                                           "motor_stall@2",
                                           "motor_stall@2:mass=1",
                                           "push@2:1",
                                           "push@2:1,direction=[0,1,0]",
                                           "messages_dropped@2",
                                           "messages_dropped@2:peer=monitor",
                                           "messages_dropped@2:channel=BALLAST_CONTACT",
                                           "peer_killed@2",
                                           "peer_killed@2:peer=monitor"};
  for (const std::string& text : different) {
    EXPECT_TRUE(ids.insert(with_faults({text}).scenario.id).second) << text << " is told from nothing";
  }
}

TEST(Fault, WhatIsPublishedSpeaksOfAHealthyRobot) {
  EXPECT_FALSE(accepted(kFull).published.empty());
  EXPECT_TRUE(with_faults({"peer_killed@2"}).scenario.published.empty());
}

TEST(Fault, ComesInOrderOfTime) {
  const ScenarioResult result = with_faults({"peer_killed@3", "push@1:2", "motor_stall@2"});
  ASSERT_TRUE(result.ok()) << all_errors(result);
  EXPECT_EQ(result.scenario.faults[0].kind, FaultKind::kPush);
  EXPECT_EQ(result.scenario.faults[2].kind, FaultKind::kPeerKilled);
}

TEST(Fault, AnUnknownOneIsAnErrorThatSuggestsAKnownOne) {
  const std::string error = refusal("motor_stal@1");
  EXPECT_TRUE(contains(error, "--fault"));
  EXPECT_TRUE(contains(error, "did you mean motor_stall?"));
  for (const FaultKindInfo& kind : fault_kinds()) EXPECT_TRUE(contains(error, kind.name));
}

TEST(Fault, MalformedOnesAreErrors) {
  for (const char* text : {"", "motor_stall", "@1", "motor_stall@", "motor_stall@1:", "push@1:5,,axis=1",
                           "push@1:5,value=6", "push@1:=3"}) {
    const std::string error = refusal(text);
    EXPECT_TRUE(contains(error, "KIND@TIME")) << text;
  }
}

TEST(Fault, WhatMakesNoSenseIsAnErrorThatNamesIt) {
  struct Case {
    const char* text;
    const char* key;  // as the error names it
  };
  const Case cases[] = {
      {"motor_stall@-1", "fault.0.time"},
      {"motor_stall@4", "fault.0.time"},  // kFull lasts 4 s: it would never come
      {"motor_stall@nan", "fault.0.time"},
      {"motor_stall@soon", "fault.0.time"},
      {"motor_stall@1:mass=3", "fault.0.mass"},
      {"motor_stall@1:mass=-1", "fault.0.mass"},
      {"motor_stall@1:0.5", "fault.0.value"},
      {"motor_stall@1:duration=0", "fault.0.duration"},
      {"motor_stall@1:axis=1", "fault.0.axis"},
      {"motor_stall@1:colour=red", "fault.0.colour"},
      {"weak_coil@1:1.5", "fault.0.value"},
      {"lost_steps@1:2.5", "fault.0.value"},
      {"lost_steps@1:duration=1", "fault.0.duration"},
      {"friction_falls@1", "fault.0.value"},
      {"friction_falls@1:0.6", "fault.0.value"},  // kFull's is 0.5
      {"push@1:5,direction=[0,0,0]", "fault.0.direction"},
      {"sensor_bias@1", "fault.0.value"},
      {"sensor_bias@1:0.1,sensor=nose", "fault.0.sensor"},
      {"sensor_bias@1:0.1,axis=3", "fault.0.axis"},
      {"sensor_bias@1:0.1,sensor=limit_switch", "fault.0.sensor"},
      {"sensor_saturation@1:1,sensor=orientation", "fault.0.sensor"},
      {"sensor_freeze@1:sensor=orientation,axis=1", "fault.0.axis"},
      {"sensor_freeze@1:sensor=encoder", "fault.0.sensor"},       // kFull has none
      {"sensor_freeze@1:sensor=position_fix", "fault.0.sensor"},  // nor this
      {"sensor_freeze@1:sensor=gyro,mass=1", "fault.0.mass"},
      {"messages_dropped@1:2", "fault.0.value"},
      {"messages_delayed@1:1.5", "fault.0.value"},
      {"messages_dropped@1:channel=BALLAST_SENSOR", "fault.0.channel"},
      {"messages_dropped@1:channel=BALLAST_OPERATOR", "fault.0.channel"},  // the run's own words come before t = 0
      {"messages_dropped@1:channel=BALLAST_CONTACT,peer=controller", "fault.0.peer"},
      {"peer_killed@1:peer=plant", "fault.0.peer"},
      {"clock_jump@1:0", "fault.0.value"},
      {"disk_full@1:mass=0", "fault.0.mass"},
  };
  for (const Case& c : cases) EXPECT_TRUE(contains(refusal(c.text), c.key)) << c.text;
}

TEST(Fault, EncoderAndPositionFixAreSensorsToo) {
  const std::string sensors = kFull +
                              "[sensors]\nattitude = \"sensed\"\nencoder = { resolution = 0.001 }\nposition_fix = { "
                              "rate = 10, noise = 0.01 }\n";
  const auto read = [&](const std::string& text) { return parse_scenario(sensors, "test.toml", {}, {text}); };
  const auto fault = [&](const std::string& text) {
    const ScenarioResult result = read(text);
    EXPECT_TRUE(result.ok()) << all_errors(result);
    return result.ok() ? result.scenario.faults.at(0) : Fault{};
  };
  EXPECT_EQ(fault("sensor_bias@1:0.1,sensor=encoder").mass, -1);  // all of them
  EXPECT_EQ(fault("sensor_bias@1:0.1,sensor=encoder,mass=2").mass, 2);
  EXPECT_EQ(fault("sensor_nan@1:sensor=position_fix,axis=1").axis, 1);
  EXPECT_EQ(to_string(fault("sensor_bias@1:0.1,sensor=encoder,mass=2")),
            "sensor_bias at 1 s: 0.1 rail units, encoder of mass 2");
  EXPECT_EQ(to_string(fault("sensor_spike@1:2,sensor=position_fix,axis=0,duration=0.5")),
            "sensor_spike at 1 s: 2 m, position_fix axis 0, for 0.5 s");
  for (const char* kind : {"sensor_noise@1:1", "sensor_freeze@1:", "sensor_saturation@1:1"}) {
    fault(std::string(kind) + (std::string_view(kind).ends_with(':') ? "" : ",") + "sensor=encoder");
    fault(std::string(kind) + (std::string_view(kind).ends_with(':') ? "" : ",") + "sensor=position_fix");
  }
  const std::pair<const char*, const char*> refused[] = {
      {"sensor_nan@1:sensor=encoder,mass=3", "fault.0.mass"},
      {"sensor_nan@1:sensor=encoder,axis=0", "fault.0.axis"},
      {"sensor_nan@1:sensor=position_fix,axis=2", "fault.0.axis"},
      {"sensor_nan@1:sensor=position_fix,mass=0", "fault.0.mass"},
  };
  for (const auto& [text, key] : refused) {
    const ScenarioResult result = read(text);
    ASSERT_EQ(result.errors.size(), 1u) << text;
    EXPECT_EQ(result.errors[0].key, key) << text;
  }
}

TEST(Fault, WhatAPrescribedRunHasNotCannotSuffer) {
  const std::vector<std::string> prescribed{"run.actuation=prescribed"};
  for (const char* text :
       {"motor_stall@1", "weak_coil@1", "lost_steps@1", "reversed_wiring@1", "blocked_rail@1", "peer_killed@1",
        "peer_frozen@1:peer=monitor", "controller_overrun@1", "messages_dropped@1:channel=BALLAST_TRIP",
        "messages_dropped@1:channel=BALLAST_STEP_COMMAND", "messages_dropped@1:peer=controller"}) {
    EXPECT_TRUE(contains(refusal(text, prescribed), "prescribed") || contains(refusal(text, prescribed), "this run"))
        << text;
  }
  for (const char* text : {"friction_falls@1:0.1", "push@1:1", "sensor_nan@1", "messages_dropped@1", "disk_full@1",
                           "peer_restarted@1:peer=monitor"}) {
    only_fault(text, prescribed);
  }
}

// sim/ knows no bus; the channels' names are those of the bus all the same.
TEST(Fault, ChannelsAreCalledAsOnTheBus) {
  const std::set<std::string> bus{hal::kChannelSensors, hal::kChannelContact,          hal::kChannelPlantState,
                                  hal::kChannelTrip,    hal::kChannelControllerStatus, hal::kChannelStepCommand};
  std::set<std::string> here;
  for (const FaultChannel& channel : fault_channels()) here.insert(channel.name);
  EXPECT_EQ(here, bus);
}

}  // namespace
}  // namespace ballast::sim
