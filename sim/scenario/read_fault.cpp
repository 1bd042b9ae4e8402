#include "sim/scenario/read_fault.h"

#include <algorithm>
#include <cmath>

namespace ballast::sim {
namespace {

// The names in a table of kinds or channels.
template <class Table>
std::vector<std::string_view> names_of(const Table& table) {
  std::vector<std::string_view> names;
  for (const auto& row : table) names.emplace_back(row.name);
  return names;
}

// Splits at commas outside brackets and quotes.
std::vector<std::string> split(std::string_view text) {
  std::vector<std::string> parts(1);
  int depth = 0;
  bool quoted = false;
  for (const char c : text) {
    if (c == '"') quoted = !quoted;
    if (!quoted && (c == '[' || c == '{')) ++depth;
    if (!quoted && (c == ']' || c == '}')) --depth;
    if (c == ',' && depth == 0 && !quoted) {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

// Reads `value` within the range of the kind. False: an error was reported.
bool read_value(TableReader& table, const FaultKindInfo& kind, double& out) {
  if (kind.value_means[0] == '\0') {
    if (!table.has("value")) return true;
    table.refuse("value", "does not apply to {}, which has no value", kind.name);
    return false;
  }
  Range range = Range::between(kind.low, kind.high, kind.unit);
  range.low_excluded = kind.low_excluded;
  const auto value = table.number("value", range, kind.value_default);
  if (!value) return false;
  if (kind.integer && *value != std::floor(*value)) {
    table.refuse("value", "is not a whole number; allowed: {}, whole", range.text());
    return false;
  }
  if (kind.kind == FaultKind::kClockJump && *value == 0) {
    table.refuse("value", "is not a jump; allowed: a whole number of ticks other than 0");
    return false;
  }
  out = *value;
  return true;
}

// Refuses keys of other layers' faults, which would be ignored.
bool refuse_others(TableReader& table, const FaultKindInfo& kind, std::initializer_list<std::string_view> own) {
  bool good = true;
  for (const std::string_view key : {"channel", "peer", "sensor", "axis", "mass", "direction"}) {
    table.know({key});
    if (std::find(own.begin(), own.end(), key) != own.end() || !table.has(key)) continue;
    table.refuse(key, "does not apply to {}", kind.name);
    good = false;
  }
  return good;
}

std::optional<FaultPeer> read_peer(TableReader& table, std::optional<FaultPeer> fallback) {
  return table.choice<FaultPeer>("peer", {"controller", "monitor"}, fallback);
}

bool read_channel(TableReader& table, const Scenario& scenario, Fault& fault) {
  const bool has_controller = sim::has_controller(scenario.run.actuation);
  const auto channels = fault_channels();
  const auto place = table.choice("channel", names_of(channels), 0);
  if (!place) return false;
  const FaultChannel& channel = channels[*place];
  if (channel.of_controller && !has_controller) {
    table.refuse("channel", "does not exist in a run with prescribed masses, which has no controller");
    return false;
  }
  fault.channel = channel.name;
  if (!table.has("peer")) return true;
  fault.peer = read_peer(table, std::nullopt);
  if (!fault.peer) return false;
  if (*fault.peer == FaultPeer::kController ? channel.to_controller && has_controller : channel.to_monitor) return true;
  table.refuse("peer", "does not receive {} in this run", channel.name);
  return false;
}

// One encoder of those that the masses have.
bool read_encoder(TableReader& table, const Scenario& scenario, Fault& fault) {
  fault.mass = -1;
  if (scenario.sensors.encoder_resolution.empty()) {
    table.refuse("sensor", "has no encoders to act on; allowed with sensors.encoder");
    return false;
  }
  if (!table.has("mass")) return true;
  const auto mass = table.integer("mass", 0, static_cast<std::int64_t>(scenario.masses.size()) - 1, 0);
  if (mass) fault.mass = static_cast<int>(*mass);
  return mass.has_value();
}

bool read_sensor(TableReader& table, const Scenario& scenario, Fault& fault) {
  const auto sensor = table.choice<FaultSensor>(
      "sensor", {"orientation", "gyro", "accelerometer", "limit_switch", "encoder", "position_fix"},
      FaultSensor::kGyro);
  if (!sensor) return false;
  fault.sensor = *sensor;
  const bool of_switch = fault.sensor == FaultSensor::kLimitSwitch, of_encoder = fault.sensor == FaultSensor::kEncoder;
  const bool of_fix = fault.sensor == FaultSensor::kPositionFix;
  if (of_switch && fault.kind != FaultKind::kSensorFreeze) {
    table.refuse("sensor", "is a switch, for which there is no {}; allowed: sensor_freeze", info(fault.kind).name);
    return false;
  }
  if (fault.sensor == FaultSensor::kOrientation && scenario.sensors.attitude_estimated) {
    table.refuse("sensor",
                 "is an attitude, which nothing senses with sensors.attitude = \"estimated\"; allowed: gyro, "
                 "accelerometer, limit_switch, encoder, position_fix");
    return false;
  }
  if (fault.sensor == FaultSensor::kOrientation && fault.kind == FaultKind::kSensorSaturation) {
    table.refuse("sensor",
                 "is an attitude, which does not saturate; allowed: gyro, accelerometer, encoder, position_fix");
    return false;
  }
  if (of_fix && !(scenario.sensors.fix.rate_hz > 0)) {
    table.refuse("sensor", "has no position fix to act on; allowed with sensors.position_fix");
    return false;
  }
  if (of_encoder && !read_encoder(table, scenario, fault)) return false;
  if (!of_encoder && table.has("mass")) {
    table.refuse("mass", "does not apply to {}", to_string(fault.sensor));
    return false;
  }
  table.know({"axis"});
  if (!table.has("axis")) return true;
  if (of_switch || of_encoder) {
    table.refuse("axis", "does not apply to {}", to_string(fault.sensor));
    return false;
  }
  if (fault.sensor == FaultSensor::kOrientation &&
      (fault.kind == FaultKind::kSensorFreeze || fault.kind == FaultKind::kSensorNan)) {
    table.refuse("axis", "does not apply to orientation with sensor_freeze or sensor_nan, which act on all of it");
    return false;
  }
  const auto axis = table.integer("axis", 0, of_fix ? 1 : 2, 0);
  if (axis) fault.axis = static_cast<int>(*axis);
  return axis.has_value();
}

bool read_mass_index(TableReader& table, const Scenario& scenario, Fault& fault) {
  if (scenario.run.actuation != Actuation::kStepper) {
    table.refuse("kind", "acts on a motor, and a run with {} masses has none; allowed with run.actuation = \"stepper\"",
                 to_string(scenario.run.actuation));
    return false;
  }
  if (scenario.masses.empty()) {
    table.refuse("kind", "acts on a motor, and this ball has none");
    return false;
  }
  const auto mass = table.integer("mass", 0, static_cast<std::int64_t>(scenario.masses.size()) - 1, 0);
  if (mass) fault.mass = static_cast<int>(*mass);
  return mass.has_value();
}

bool read_direction(TableReader& table, Fault& fault) {
  if (!table.has("direction")) return true;
  const auto direction = table.vector<3>("direction", Range::any());
  if (!direction) return false;
  const double length = direction->stableNorm();
  if (!(length > 0)) {
    table.refuse("direction", "is zero; allowed: a vector of the space frame other than 0");
    return false;
  }
  fault.direction_W = *direction / length;
  return true;
}

bool read_target(TableReader& table, const Scenario& scenario, Fault& fault) {
  const FaultKindInfo& kind = info(fault.kind);
  const bool has_controller = sim::has_controller(scenario.run.actuation);
  switch (kind.layer) {
    case FaultLayer::kMessage:
      return refuse_others(table, kind, {"channel", "peer"}) && read_channel(table, scenario, fault);
    case FaultLayer::kPeer: {
      if (!refuse_others(table, kind, {"peer"})) return false;
      fault.peer = read_peer(table, FaultPeer::kController);
      if (!fault.peer) return false;
      if (has_controller) return true;
      if (*fault.peer == FaultPeer::kMonitor && fault.kind == FaultKind::kPeerRestarted) return true;
      table.refuse(
          table.has("peer") ? "peer" : "kind",
          "has no effect in a run with prescribed masses: it has no controller, and nothing reads the monitor; "
          "allowed with run.actuation = \"stepper\"");
      return false;
    }
    case FaultLayer::kSensor:
      return refuse_others(table, kind, {"sensor", "axis", "mass"}) && read_sensor(table, scenario, fault);
    case FaultLayer::kMotor:
      return refuse_others(table, kind, {"mass"}) && read_mass_index(table, scenario, fault);
    case FaultLayer::kWorld:
      if (fault.kind == FaultKind::kPush)
        return refuse_others(table, kind, {"direction"}) && read_direction(table, fault);
      if (!refuse_others(table, kind, {})) return false;
      if (fault.value <= scenario.surface.greatest_static_friction()) return true;
      table.refuse("value", "does not lower the friction; allowed: at most {} = {}",
                   scenario.surface.patches.empty() ? "surface.static_friction" : "the greatest on the floor",
                   scenario.surface.greatest_static_friction());
      return false;
    case FaultLayer::kProgram:
      if (!refuse_others(table, kind, {})) return false;
      if (fault.kind != FaultKind::kControllerOverrun || has_controller) return true;
      table.refuse("kind",
                   "acts on the controller, and a run with prescribed masses has none; allowed with "
                   "run.actuation = \"stepper\"");
      return false;
  }
  return false;
}

bool read_times(TableReader& table, const FaultKindInfo& kind, const Scenario& scenario, Fault& fault) {
  Range range = Range::non_negative("s");
  range.high = scenario.duration_s > 0 ? scenario.duration_s : range.high;
  range.high_excluded = true;
  const auto time = table.number("time", range);
  table.know({"duration"});
  if (kind.lasts_s == kAnInstant) {
    if (table.has("duration")) {
      table.refuse("duration", "does not apply to {}, which happens once", kind.name);
      return false;
    }
    if (time) fault.time_s = fault.end_s = *time;
    return time.has_value();
  }
  const double usual_s = kind.lasts_s == kOnePeriod ? scenario.run.control_period_s : kind.lasts_s;
  const auto duration = table.number("duration", Range::positive("s"), usual_s);
  if (!time || !duration) return false;
  fault.time_s = *time;
  fault.end_s = *time + *duration;
  return true;
}

}  // namespace

void add_fault(const std::string& text, Node& root, std::vector<ScenarioError>& errors) {
  const auto refuse = [&](const std::string& message) {
    errors.push_back({kFaultOption, 0, "", text,
                      message + "; allowed: KIND@TIME[:PARAM], e.g. "
                                "sensor_bias@2:0.1,sensor=gyro,axis=1; ballast faults lists the kinds"});
  };
  const std::size_t at = text.find('@');
  if (at == std::string::npos) return refuse("has no '@' before its time");
  if (at == 0) return refuse("has no kind before its '@'");
  const std::size_t colon = text.find(':', at);
  const std::string time = text.substr(at + 1, colon == std::string::npos ? colon : colon - at - 1);
  if (time.empty()) return refuse("has no time after its '@'");
  // The text tells which option it is, also among [[fault]] of the file.
  const std::string source = std::string(kFaultOption) + " " + text;
  Node fault;
  fault.source = source;
  Node kind;
  kind.kind = NodeKind::kString;
  kind.source = source;
  kind.text = text.substr(0, at);
  kind.written = kind.text;
  fault.entries.emplace_back("kind", std::move(kind));
  fault.entries.emplace_back("time", value_node(time, source.c_str()));
  if (colon != std::string::npos) {
    for (const std::string& part : split(std::string_view(text).substr(colon + 1))) {
      const std::size_t equals = part.find('=');
      const std::string key = equals == std::string::npos ? "value" : part.substr(0, equals);
      const std::string value = equals == std::string::npos ? part : part.substr(equals + 1);
      if (key.empty() || value.empty()) return refuse("has an empty parameter after its ':'");
      if (fault.find(key) != nullptr) return refuse("gives its " + key + " twice");
      fault.entries.emplace_back(key, value_node(value, source.c_str()));
    }
  }
  Node* faults = root.find("fault");
  if (faults == nullptr) {
    Node array;
    array.kind = NodeKind::kArray;
    array.source = kFaultOption;
    root.entries.emplace_back("fault", std::move(array));
    faults = root.find("fault");
  }
  // The reader refuses a `fault` that is no array.
  if (faults->kind == NodeKind::kArray) faults->items.push_back(std::move(fault));
}

std::optional<Fault> read_fault(TableReader& table, const Scenario& scenario) {
  Fault fault;
  const auto kind = table.choice("kind", names_of(fault_kinds()));
  if (!kind) return std::nullopt;  // the other keys depend on it
  const FaultKindInfo& found = fault_kinds()[*kind];
  fault.kind = found.kind;
  const bool timed = read_times(table, found, scenario, fault);
  const bool valued = read_value(table, found, fault.value);
  const bool aimed = read_target(table, scenario, fault);
  table.refuse_unknown_keys();
  return timed && valued && aimed ? std::optional(fault) : std::nullopt;
}

}  // namespace ballast::sim
