#include "sim/scenario/read_fault.h"

#include <algorithm>
#include <cmath>

namespace ballast::sim {
namespace {

std::vector<std::string> kind_names() {
  std::vector<std::string> names;
  for (const FaultKindInfo& kind : fault_kinds()) names.emplace_back(kind.name);
  return names;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
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

std::optional<FaultKind> read_kind(TableReader& table) {
  const Node* node = table.node("kind");
  const std::string allowed = "; allowed: " + joined(kind_names());
  if (node == nullptr) {
    table.refuse("kind", "is missing" + allowed);
  } else if (node->kind != NodeKind::kString) {
    table.refuse("kind", "is not a string" + allowed);
  } else {
    for (const FaultKindInfo& kind : fault_kinds()) {
      if (node->text == kind.name) return kind.kind;
    }
    const std::string near = nearest(node->text, kind_names());
    table.refuse("kind", "is not a kind of fault" + (near.empty() ? "" : "; did you mean " + near + "?") + allowed);
  }
  return std::nullopt;
}

// Reads `value` within the range of the kind. False: an error was reported.
bool read_value(TableReader& table, const FaultKindInfo& kind, double& out) {
  if (kind.value_means[0] == '\0') {
    if (!table.has("value")) return true;
    table.refuse("value", std::string("does not apply to ") + kind.name + ", which has no value");
    return false;
  }
  Range range = Range::between(kind.low, kind.high, kind.unit);
  range.low_excluded = kind.low_excluded;
  const auto value = table.number("value", range, kind.value_default);
  if (!value) return false;
  if (kind.integer && *value != std::floor(*value)) {
    table.refuse("value", "is not a whole number; allowed: " + range.text() + ", whole");
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
    table.refuse(key, std::string("does not apply to ") + kind.name);
    good = false;
  }
  return good;
}

bool read_channel(TableReader& table, const Scenario& scenario, Fault& fault) {
  const bool has_controller = scenario.run.actuation == Actuation::kStepper;
  std::vector<std::string> names;
  for (const FaultChannel& channel : fault_channels()) names.emplace_back(channel.name);
  const std::string allowed = "; allowed: " + joined(names);
  table.know({"channel"});
  const auto name = table.has("channel") ? table.text("channel") : std::optional(names[0]);
  if (!name) return false;
  const auto channels = fault_channels();
  const auto found = std::find_if(channels.begin(), channels.end(), [&](const auto& c) { return *name == c.name; });
  if (found == channels.end()) {
    const std::string near = nearest(*name, names);
    table.refuse("channel", "is not a channel that faults act on" +
                                (near.empty() ? "" : "; did you mean " + near + "?") + allowed);
    return false;
  }
  if (found->of_controller && !has_controller) {
    table.refuse("channel", "does not exist in a run with prescribed masses, which has no controller");
    return false;
  }
  fault.channel = *name;
  if (!table.has("peer")) return true;
  const auto peer = table.word("peer", {"controller", "monitor"});
  if (!peer) return false;
  fault.peer = *peer == "controller" ? FaultPeer::kController : FaultPeer::kMonitor;
  if (*fault.peer == FaultPeer::kController ? found->to_controller && has_controller : found->to_monitor) return true;
  table.refuse("peer", "does not receive " + *name + " in this run");
  return false;
}

bool read_sensor(TableReader& table, Fault& fault) {
  const auto sensor = table.word("sensor", {"orientation", "gyro", "accelerometer", "limit_switch"}, "gyro");
  if (!sensor) return false;
  for (const FaultSensor candidate :
       {FaultSensor::kOrientation, FaultSensor::kGyro, FaultSensor::kAccelerometer, FaultSensor::kLimitSwitch}) {
    if (*sensor == to_string(candidate)) fault.sensor = candidate;
  }
  const bool of_switch = fault.sensor == FaultSensor::kLimitSwitch;
  if (of_switch && fault.kind != FaultKind::kSensorFreeze) {
    table.refuse("sensor", std::string("is a switch, for which there is no ") + info(fault.kind).name +
                               "; allowed: sensor_freeze");
    return false;
  }
  if (fault.sensor == FaultSensor::kOrientation && fault.kind == FaultKind::kSensorSaturation) {
    table.refuse("sensor", "is an attitude, which does not saturate; allowed: gyro, accelerometer");
    return false;
  }
  table.know({"axis"});
  if (!table.has("axis")) return true;
  if (of_switch) {
    table.refuse("axis", "does not apply to limit_switch");
    return false;
  }
  if (fault.sensor == FaultSensor::kOrientation &&
      (fault.kind == FaultKind::kSensorFreeze || fault.kind == FaultKind::kSensorNan)) {
    table.refuse("axis", "does not apply to orientation with sensor_freeze or sensor_nan, which act on all of it");
    return false;
  }
  const auto axis = table.integer("axis", 0, 2, 0);
  if (axis) fault.axis = static_cast<int>(*axis);
  return axis.has_value();
}

bool read_mass_index(TableReader& table, const Scenario& scenario, Fault& fault) {
  if (scenario.run.actuation != Actuation::kStepper) {
    table.refuse("kind",
                 "acts on a motor, and a run with prescribed masses has none; allowed with "
                 "run.actuation = \"stepper\"");
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
  const bool has_controller = scenario.run.actuation == Actuation::kStepper;
  switch (kind.layer) {
    case FaultLayer::kMessage:
      return refuse_others(table, kind, {"channel", "peer"}) && read_channel(table, scenario, fault);
    case FaultLayer::kPeer: {
      if (!refuse_others(table, kind, {"peer"})) return false;
      const auto peer = table.word("peer", {"controller", "monitor"}, "controller");
      if (!peer) return false;
      fault.peer = *peer == "controller" ? FaultPeer::kController : FaultPeer::kMonitor;
      if (has_controller) return true;
      if (*fault.peer == FaultPeer::kMonitor && fault.kind == FaultKind::kPeerRestarted) return true;
      table.refuse(
          table.has("peer") ? "peer" : "kind",
          "has no effect in a run with prescribed masses: it has no controller, and nothing reads the monitor; "
          "allowed with run.actuation = \"stepper\"");
      return false;
    }
    case FaultLayer::kSensor:
      return refuse_others(table, kind, {"sensor", "axis"}) && read_sensor(table, fault);
    case FaultLayer::kMotor:
      return refuse_others(table, kind, {"mass"}) && read_mass_index(table, scenario, fault);
    case FaultLayer::kWorld:
      if (fault.kind == FaultKind::kPush)
        return refuse_others(table, kind, {"direction"}) && read_direction(table, fault);
      if (!refuse_others(table, kind, {})) return false;
      if (fault.value <= scenario.surface.static_friction) return true;
      table.refuse("value", "does not lower the friction; allowed: at most surface.static_friction = " +
                                number_text(scenario.surface.static_friction));
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
      table.refuse("duration", std::string("does not apply to ") + kind.name + ", which happens once");
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
  Node fault;
  fault.source = kFaultOption;
  Node kind;
  kind.kind = NodeKind::kString;
  kind.source = kFaultOption;
  kind.text = text.substr(0, at);
  kind.written = kind.text;
  fault.entries.emplace_back("kind", std::move(kind));
  fault.entries.emplace_back("time", value_node(time, kFaultOption));
  if (colon != std::string::npos) {
    for (const std::string& part : split(std::string_view(text).substr(colon + 1))) {
      const std::size_t equals = part.find('=');
      const std::string key = equals == std::string::npos ? "value" : part.substr(0, equals);
      const std::string value = equals == std::string::npos ? part : part.substr(equals + 1);
      if (key.empty() || value.empty()) return refuse("has an empty parameter after its ':'");
      if (fault.find(key) != nullptr) return refuse("gives its " + key + " twice");
      fault.entries.emplace_back(key, value_node(value, kFaultOption));
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
  const auto kind = read_kind(table);
  if (!kind) return std::nullopt;  // the other keys depend on it
  fault.kind = *kind;
  const bool timed = read_times(table, info(*kind), scenario, fault);
  const bool valued = read_value(table, info(*kind), fault.value);
  const bool aimed = read_target(table, scenario, fault);
  table.refuse_unknown_keys();
  return timed && valued && aimed ? std::optional(fault) : std::nullopt;
}

}  // namespace ballast::sim
