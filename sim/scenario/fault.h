// Faults that can be injected into a run: the table of their kinds, and one fault as a scenario describes it
// ([[fault]], or --fault KIND@TIME[:PARAM]). The plant injects those of motors and world, tools/faults/ all others.
// `ballast run --processes` injects those of peers with signals. User page: tools/docs/faults.md.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "sim/plant/plant_model.h"

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

// The part of the run on which a fault acts, and the keys that select its target.
enum class FaultLayer {
  kMessage,  // `channel`; `peer` selects one receiver, the default is all of them
  kPeer,     // `peer`
  kSensor,   // `sensor`; `axis` selects one of three, or `mass` one encoder; the default is all of them
  kMotor,    // `mass`
  kWorld,    // `direction` of a push
  kProgram,  // the sensors' clock, the controller's overruns, the log
};
const char* to_string(FaultLayer layer);

enum class FaultPeer { kController, kMonitor };
const char* to_string(FaultPeer peer);

enum class FaultSensor { kOrientation, kGyro, kAccelerometer, kLimitSwitch, kEncoder, kPositionFix };
const char* to_string(FaultSensor sensor);

// Special values of FaultKindInfo::lasts_s, beside a number of seconds.
inline constexpr double kToTheEnd = std::numeric_limits<double>::infinity();
inline constexpr double kOnePeriod = -1;  // one control period
inline constexpr double kAnInstant = 0;   // no duration; the key `duration` is refused

struct FaultKindInfo {
  FaultKind kind;
  const char* name;
  FaultLayer layer;
  double lasts_s;           // default of `duration`
  const char* value_means;  // meaning of `value`; empty: the kind has none, and the key is refused
  const char* unit;
  std::optional<double> value_default;  // none: the key is required
  double low, high;
  bool low_excluded;
  bool integer;
  const char* what;
  const char* detected_by;  // and when
};

// All kinds, in the order of FaultKind.
std::span<const FaultKindInfo> fault_kinds();
const FaultKindInfo& info(FaultKind kind);
// The plant's name for a fault of motors, rails, floor or ball; none for the others. These kinds stand in the order of
// PlantFaultKind.
std::optional<PlantFaultKind> plant_fault_kind(FaultKind kind);

// The channels that message faults act on, with their receivers. A test compares the names with hal/lcm/channels.h.
struct FaultChannel {
  const char* name;
  bool to_controller, to_monitor, to_plant;
  bool of_controller;  // exists only in runs with a controller
};
std::span<const FaultChannel> fault_channels();

struct Fault {
  FaultKind kind{};
  double time_s = 0;
  double end_s = std::numeric_limits<double>::infinity();  // at least time_s; equal to it for an instant
  double value = 0;
  std::string channel;            // messages
  std::optional<FaultPeer> peer;  // messages: the one receiver, none: all; peers: which one
  FaultSensor sensor = FaultSensor::kGyro;
  int axis = -1;                                           // sensors; -1: all of them
  int mass = 0;                                            // motors; encoders, -1: all of them
  Eigen::Vector3d direction_W = Eigen::Vector3d::UnitX();  // push

  // A tick within kRounding of the fault's time counts as at that time: both are rounded.
  [[nodiscard]] bool active(double at_s) const { return begun(at_s) && at_s < end_s - kRounding; }
  [[nodiscard]] bool begun(double at_s) const { return at_s >= time_s - kRounding; }
  static constexpr double kRounding = 1e-9;  // s; a thousandth of the shortest control period

  [[nodiscard]] bool of(FaultLayer layer) const { return info(kind).layer == layer; }
};

// "sensor_bias at 2 s: 0.1 rad/s, gyro axis 1"
std::string to_string(const Fault& fault);

}  // namespace ballast::sim
