// What a run can be made to suffer: the kinds of faults, and one of them as a scenario asks for it ([[fault]], or
// --fault KIND@TIME[:PARAM]). Who injects which: plant.h (plant), tools/faults/sensor_faults.h (sensors),
// tools/sil/hearing.h (messages and the sensors' clock), tools/faults/faulty_peers.h (peers, and the program's own),
// tools/ballast/peer_faults.h (peers that are processes).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace ballast::sim {

enum class FaultKind {
  kMessagesDropped,
  kMessagesDelayed,
  kMessagesDoubled,
  kMessagesReordered,
  kMessagesCorrupted,
  kMessagesTruncated,
  kPeerKilled,
  kPeerFrozen,
  kPeerRestarted,
  kPeerTooSlow,
  kSensorBias,
  kSensorNoise,
  kSensorFreeze,
  kSensorNan,
  kSensorSpike,
  kSensorSaturation,
  kMotorStall,
  kWeakCoil,
  kLostSteps,
  kReversedWiring,
  kBlockedRail,
  kFrictionFalls,
  kPush,
  kClockJump,
  kControllerOverrun,
  kDiskFull,
};

// Where a fault bites, and with that what else has to be said of it.
enum class FaultLayer {
  kMessage,  // `channel`, and `peer`: the receiver it happens to; without: all that hear the channel
  kPeer,     // `peer`
  kSensor,   // `sensor`, and `axis`: 0, 1, 2; without: all three
  kMotor,    // `mass`
  kWorld,    // the floor, or a hand: `direction` of a push
  kProgram,  // controller's clock and time, the log
};
const char* to_string(FaultLayer layer);

enum class FaultPeer { kController, kMonitor };
const char* to_string(FaultPeer peer);

enum class FaultSensor { kOrientation, kGyro, kAccelerometer, kLimitSwitch };
const char* to_string(FaultSensor sensor);

// How long a fault lasts, in s, if its `duration` is not given; beside a number of seconds:
inline constexpr double kToTheEnd = std::numeric_limits<double>::infinity();
inline constexpr double kOnePeriod = -1;  // one control period
inline constexpr double kAnInstant = 0;   // it has no duration, and takes none

struct FaultKindInfo {
  FaultKind kind;
  const char* name;
  FaultLayer layer;
  double lasts_s;
  // `value`. An empty meaning: there is none, and none is taken. No default: it has to be given.
  const char* value_means;
  const char* unit;
  std::optional<double> value_default;
  double low, high;
  bool low_excluded;
  bool integer;
  const char* what;  // what happens
  const char* seen;  // who notices, when, and how the run ends
};

// All of them, in the order of FaultKind.
std::span<const FaultKindInfo> fault_kinds();
const FaultKindInfo& info(FaultKind kind);

// The channels whose messages can be made to suffer (names of hal/lcm/channels.h, which says the same in a test) and
// who hears each of them.
struct FaultChannel {
  const char* name;
  bool to_controller, to_monitor, to_plant;
  bool of_controller;  // there only in runs with a controller
};
std::span<const FaultChannel> fault_channels();

struct Fault {
  FaultKind kind{};
  double time_s = 0;
  double end_s = std::numeric_limits<double>::infinity();  // not before time_s; an instant's is time_s
  double value = 0;
  std::string channel;            // messages
  std::optional<FaultPeer> peer;  // messages: the one receiver; peers: which
  FaultSensor sensor = FaultSensor::kGyro;
  int axis = -1;  // sensors; -1: all
  int mass = 0;   // motors
  Eigen::Vector3d direction_W = Eigen::Vector3d::UnitX();

  // Times of ticks and of faults are both rounded.
  [[nodiscard]] bool active(double at_s) const { return begun(at_s) && at_s < end_s - kRounding; }
  [[nodiscard]] bool begun(double at_s) const { return at_s >= time_s - kRounding; }
  static constexpr double kRounding = 1e-9;  // s; a thousandth of the shortest control period

  [[nodiscard]] bool of(FaultLayer layer) const { return info(kind).layer == layer; }
};

// "sensor_bias at 2 s: 0.1 rad/s, gyro axis 1"
std::string to_string(const Fault& fault);

}  // namespace ballast::sim
