#include "sim/scenario/fault.h"

#include <fmt/core.h>

#include <array>

namespace ballast::sim {
namespace {

using enum FaultKind;
using enum FaultLayer;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::nullopt_t kGiven = std::nullopt;  // the value is required
constexpr std::optional<double> kNone = 0;       // the kind has no value

constexpr std::array kKinds{
    FaultKindInfo{kMessagesDropped, "messages_dropped", kMessage, kToTheEnd, "probability per message", "", 1.0, 0, 1,
                  true, false, "messages of a channel are lost",
                  "monitor: missing or stale; controller: sensor_stale, monitor_stale; plant: pulses not delivered"},
    FaultKindInfo{kMessagesDelayed, "messages_delayed", kMessage, kToTheEnd, "delay", "ticks", 2.0, 1, 1000, false,
                  true, "messages of a channel arrive late",
                  "as messages_dropped; the controller accepts sensors and verdicts that are one tick late"},
    FaultKindInfo{kMessagesDoubled, "messages_doubled", kMessage, kToTheEnd, "probability per message", "", 1.0, 0, 1,
                  true, false, "messages of a channel arrive twice",
                  "monitor: repeated; controller and plant use the first and count the second"},
    FaultKindInfo{kMessagesReordered, "messages_reordered", kMessage, kToTheEnd, "probability per message", "", 1.0, 0,
                  1, true, false, "messages of a channel arrive after the following one",
                  "monitor: missing or stale; plant: pulses not delivered; the controller uses the newer"},
    FaultKindInfo{kMessagesCorrupted, "messages_corrupted", kMessage, kToTheEnd, "bits flipped per message", "", 8.0, 1,
                  64, false, true, "bits of a channel's messages are flipped",
                  "as messages_dropped if the message can no longer be decoded; a value in range is accepted"},
    FaultKindInfo{kMessagesTruncated, "messages_truncated", kMessage, kToTheEnd, "bytes cut off the end", "", 1.0, 1,
                  65536, false, true, "messages of a channel lose their end", "as messages_dropped"},
    FaultKindInfo{kPeerKilled, "peer_killed", kPeer, kAnInstant, "", "", kNone, 0, 0, false, false,
                  "a peer ends for good",
                  "controller: monitor (stale) one tick later, then the run ends; monitor: controller (monitor_stale)"},
    FaultKindInfo{kPeerFrozen, "peer_frozen", kPeer, kToTheEnd, "", "", kNone, 0, 0, false, false,
                  "a peer is silent and later continues with what it missed", "as peer_killed, while it lasts"},
    FaultKindInfo{kPeerRestarted, "peer_restarted", kPeer, kAnInstant, "", "", kNone, 0, 0, false, false,
                  "a peer starts again without its state, between two ticks",
                  "controller: the run, because the count of its commands goes back; monitor: the run, but only if it "
                  "takes a trip back"},
    FaultKindInfo{kPeerTooSlow, "peer_too_slow", kPeer, kToTheEnd, "delay of its answers", "ticks", 2.0, 1, 1000, false,
                  true, "a peer answers late",
                  "controller: monitor (stale); monitor: controller (monitor_stale), from 2 ticks on"},
    FaultKindInfo{
        kSensorBias, "sensor_bias", kSensor, kToTheEnd, "offset; orientation: an angle",
        "rad/s, m/s^2, rad, m or rail units", kGiven, -kInfinity, kInfinity, false, false, "a sensor has an offset",
        "attitude sensed: monitor (disagreement) in the next tick, if it moves the controller's N or f_s by "
        "more than 5 % of the weight; with [sensors] controller (slip_measured, light_measured, no_estimate), if "
        "it looks like one; position_fix, and otherwise: nobody"},
    FaultKindInfo{kSensorNoise, "sensor_noise", kSensor, kToTheEnd, "standard deviation",
                  "rad/s, m/s^2, rad, m or rail units", kGiven, 0, kInfinity, true, false,
                  "a sensor has Gaussian noise, independent per tick", "as sensor_bias"},
    FaultKindInfo{kSensorFreeze, "sensor_freeze", kSensor, kToTheEnd, "", "", kNone, 0, 0, false, false,
                  "a sensor repeats its last value in fresh messages", "as sensor_bias"},
    FaultKindInfo{kSensorNan, "sensor_nan", kSensor, kToTheEnd, "", "", kNone, 0, 0, false, false,
                  "a sensor reports NaN", "monitor (nonfinite) and controller (sensor_not_finite), in the same tick"},
    FaultKindInfo{kSensorSpike, "sensor_spike", kSensor, kOnePeriod, "offset; orientation: an angle",
                  "rad/s, m/s^2, rad, m or rail units", kGiven, -kInfinity, kInfinity, false, false,
                  "a sensor jumps for a moment", "as sensor_bias"},
    FaultKindInfo{kSensorSaturation, "sensor_saturation", kSensor, kToTheEnd, "greatest magnitude",
                  "rad/s, m/s^2, m or rail units", kGiven, 0, kInfinity, true, false, "a sensor saturates early",
                  "as sensor_bias"},
    FaultKindInfo{kMotorStall, "motor_stall", kMotor, kToTheEnd, "", "", kNone, 0, 0, false, false,
                  "a motor's windings have no current, so that pulses turn nothing",
                  "nobody during the run; the summary counts lost steps"},
    FaultKindInfo{kWeakCoil, "weak_coil", kMotor, kToTheEnd, "part of the rated current", "", 0.5, 0, 1, false, false,
                  "one of a motor's two coils has less current",
                  "nobody during the run; the summary has torque margin and lost steps"},
    FaultKindInfo{kLostSteps, "lost_steps", kMotor, kAnInstant, "pulses ignored, from then on", "microsteps", 16.0, 1,
                  1e9, false, true, "a motor's driver ignores pulses",
                  "nobody during the run; the summary counts lost steps"},
    FaultKindInfo{kReversedWiring, "reversed_wiring", kMotor, kToTheEnd, "", "", kNone, 0, 0, false, false,
                  "a motor turns in the opposite direction",
                  "controller (end_switch), if the mass reaches one; the summary counts lost steps"},
    FaultKindInfo{kBlockedRail, "blocked_rail", kMotor, kToTheEnd, "", "", kNone, 0, 0, false, false,
                  "a mass is held where it is on its rail",
                  "monitor (normal_force, friction), if stopping the mass lifts the ball or makes it slip; the summary "
                  "counts lost steps"},
    FaultKindInfo{kFrictionFalls, "friction_falls", kWorld, kToTheEnd,
                  "the floor's static friction; the kinetic friction falls in proportion", "", kGiven, 0, kInfinity,
                  true, false, "the floor becomes slippery",
                  "monitor (friction), in the first tick in which the ball slides; with on_violation = stop the run "
                  "ends there"},
    FaultKindInfo{kPush, "push", kWorld, 0.1, "force at the geometric centre", "N", kGiven, 0, kInfinity, true, false,
                  "an external force pushes the ball",
                  "monitor (disagreement) in the next tick, if N or f_s change by more than 5 % of the weight; "
                  "(friction, normal_force), if the ball leaves the envelope"},
    FaultKindInfo{kClockJump, "clock_jump", kProgram, kAnInstant, "jump, forward or back", "ticks", 100.0, -1e9, 1e9,
                  false, true, "the clock that stamps the sensors' messages jumps",
                  "monitor (missing) and controller (sensor_stale), in the same tick"},
    FaultKindInfo{kControllerOverrun, "controller_overrun", kProgram, kAnInstant, "late ticks", "ticks", 1.0, 1, 1e6,
                  false, true, "the controller's board counts overruns", "the run, in the same tick: exit status 6"},
    FaultKindInfo{kDiskFull, "disk_full", kProgram, kAnInstant, "", "", kNone, 0, 0, false, false,
                  "the log can no longer be written",
                  "the run, in the same tick: exit status 2; the log is complete up to there"},
};

constexpr std::array kChannels{
    FaultChannel{"BALLAST_SENSORS", true, true, false, false},
    FaultChannel{"BALLAST_CONTACT", false, true, false, false},
    FaultChannel{"BALLAST_PLANT_STATE", false, true, false, false},
    FaultChannel{"BALLAST_TRIP", true, false, false, true},
    FaultChannel{"BALLAST_CONTROLLER_STATUS", false, true, false, true},
    FaultChannel{"BALLAST_STEP_COMMAND", false, false, true, true},
};

// The unit of one fault. FaultKindInfo::unit lists those of all sensors.
const char* unit_of(const Fault& fault) {
  constexpr std::array kOfSensor{"rad", "rad/s", "m/s^2", "", "rail units", "m"};  // in the order of FaultSensor
  return fault.of(kSensor) ? kOfSensor[static_cast<std::size_t>(fault.sensor)] : info(fault.kind).unit;
}

}  // namespace

const char* to_string(FaultLayer layer) {
  constexpr std::array kNames{"message", "peer", "sensor", "motor", "world", "program"};
  return kNames[static_cast<std::size_t>(layer)];
}

const char* to_string(FaultPeer peer) { return peer == FaultPeer::kController ? "controller" : "monitor"; }

const char* to_string(FaultSensor sensor) {
  constexpr std::array kNames{"orientation", "gyro", "accelerometer", "limit_switch", "encoder", "position_fix"};
  return kNames[static_cast<std::size_t>(sensor)];
}

std::span<const FaultKindInfo> fault_kinds() { return kKinds; }

const FaultKindInfo& info(FaultKind kind) { return kKinds[static_cast<std::size_t>(kind)]; }

std::optional<PlantFaultKind> plant_fault_kind(FaultKind kind) {
  if (kind < kMotorStall || kind > kPush) return std::nullopt;
  return static_cast<PlantFaultKind>(static_cast<int>(kind) - static_cast<int>(kMotorStall));
}

std::span<const FaultChannel> fault_channels() { return kChannels; }

std::string to_string(const Fault& fault) {
  const FaultKindInfo& kind = info(fault.kind);
  const std::string unit = unit_of(fault);
  std::string text = fmt::format("{} at {:.6g} s", kind.name, fault.time_s);
  const char* separator = ": ";
  const auto add = [&](const std::string& word) {
    text += separator + word;
    separator = ", ";
  };
  if (kind.value_means[0] != '\0') add(fmt::format("{:.6g}{}{}", fault.value, unit.empty() ? "" : " ", unit));
  if (kind.layer == kMessage)
    add(fault.channel + (fault.peer ? fmt::format(" to the {}", to_string(*fault.peer)) : ""));
  if (kind.layer == kPeer) add(fmt::format("the {}", to_string(*fault.peer)));
  if (kind.layer == kSensor) {
    const bool one_encoder = fault.sensor == FaultSensor::kEncoder && fault.mass >= 0;
    add(to_string(fault.sensor) + (fault.axis < 0 ? "" : fmt::format(" axis {}", fault.axis)) +
        (one_encoder ? fmt::format(" of mass {}", fault.mass) : ""));
  }
  if (kind.layer == kMotor) add(fmt::format("mass {}", fault.mass));
  if (fault.kind == kPush) {
    const Eigen::Vector3d& along = fault.direction_W;
    add(fmt::format("along ({:.6g}, {:.6g}, {:.6g})", along[0], along[1], along[2]));
  }
  if (fault.end_s > fault.time_s && fault.end_s < kInfinity) {
    add(fmt::format("for {:.6g} s", fault.end_s - fault.time_s));
  }
  return text;
}

}  // namespace ballast::sim
