#include "hal/lcm/messages.h"

#include <cmath>
#include <type_traits>

#include "hal/messages.h"

namespace ballast::hal {
namespace {

constexpr int kMaxMasses = firmware::kMaxMasses;

bool is_flag(std::int8_t value) { return value == 0 || value == 1; }
bool is_count(int value, int max) { return value >= 0 && value <= max; }
bool is_tick(std::int64_t value) { return value >= -kFarthestTick && value <= kFarthestTick; }

// Finds the member of an LCM message that belongs to a field. LCM has a struct of arrays where the firmware has an
// array of structs, so a member that is an array is taken at the index of the visit.
template <class Self>
class LcmVisitor : public Visitor<Self> {
 public:
  void at(int index) { index_ = index; }

 protected:
  template <class Name, class M>
  [[nodiscard]] auto& member(const Name& name, M& message) const {
    static_assert(!std::is_same_v<Name, NotOnLcm>, "a message on LCM names every field");
    auto& found = name.in(message);
    if constexpr (std::is_array_v<std::remove_reference_t<decltype(found)>>) {
      return found[index_];
    } else {
      return found;
    }
  }

 private:
  int index_ = 0;
};

template <class M>
class ToLcm : public LcmVisitor<ToLcm<M>> {
 public:
  explicit ToLcm(M& message) : message_(message) {}
  template <class Name, class T, class Rule>
  void leaf(const Name& name, const T& value, const Rule&) {
    auto& to = this->member(name, message_);
    to = static_cast<std::remove_reference_t<decltype(to)>>(value);
  }

 private:
  M& message_;
};

// Leaves a value that is out of range alone, and says so in ok().
template <class M>
class FromLcm : public LcmVisitor<FromLcm<M>> {
 public:
  explicit FromLcm(const M& message) : message_(message) {}
  template <class Name, class T, class Rule>
  void leaf(const Name& name, T& value, const Rule& rule) {
    const auto from = this->member(name, message_);
    bool good = true;
    if constexpr (std::is_same_v<Rule, Within>) {
      good = from >= rule.low && from <= rule.high;
    } else if constexpr (std::is_same_v<Rule, Sign>) {
      good = from == 1 || from == -1;
    } else if constexpr (std::is_same_v<Rule, Tick>) {
      good = is_tick(from);
    } else if constexpr (std::is_same_v<T, bool>) {
      good = is_flag(from);
    }
    if (good) value = static_cast<T>(from);
    ok_ = ok_ && good;
  }
  [[nodiscard]] bool ok() const { return ok_; }

 private:
  const M& message_;
  bool ok_ = true;
};

template <class M, class T>
M to_lcm(const T& fields) {
  M message{};
  ToLcm<M> to(message);
  visit(to, fields);
  return message;
}
template <class M, class T>
M to_lcm(const T& fields, double control_period_s) {
  M message = to_lcm<M>(fields);
  message.utime = tick_utime(message.tick, control_period_s);
  return message;
}

// False: a field is out of range.
template <class M, class T>
bool read(const M& message, T& fields) {
  FromLcm<M> from(message);
  visit(from, fields);
  return from.ok();
}
template <class T, class M>
T from_lcm(const M& message) {
  T fields;
  static_cast<void>(read(message, fields));  // it is in range
  return fields;
}
template <class T, class M>
bool fields_in_range(const M& message) {
  T fields;
  return read(message, fields);
}

}  // namespace

std::int64_t tick_utime(std::int64_t tick, double control_period_s) {
  return std::llround(static_cast<double>(tick) * control_period_s * 1e6);
}

sensors_t to_message(const firmware::Sensors& sensors, int mass_count, bool last, std::int64_t scenario_id,
                     double control_period_s) {
  sensors_t message = to_lcm<sensors_t>(sensors, control_period_s);
  message.scenario_id = scenario_id;
  message.mass_count = static_cast<std::int8_t>(mass_count);
  message.last = last ? 1 : 0;
  return message;
}

step_command_t to_message(const firmware::StepCommand& steps, double control_period_s) {
  return to_lcm<step_command_t>(steps, control_period_s);
}

controller_status_t to_message(const firmware::ControllerStatus& status, double control_period_s) {
  return to_lcm<controller_status_t>(status, control_period_s);
}

operator_t to_message(const firmware::OperatorInput& input, std::int64_t tick, std::int64_t sequence,
                      double control_period_s) {
  operator_t message = to_lcm<operator_t>(input);
  message.tick = tick;
  message.utime = tick_utime(tick, control_period_s);
  message.sequence = sequence;
  return message;
}

firmware::Sensors from_message(const sensors_t& message) { return from_lcm<firmware::Sensors>(message); }
firmware::StepCommand from_message(const step_command_t& message) { return from_lcm<firmware::StepCommand>(message); }
firmware::ControllerStatus from_message(const controller_status_t& message) {
  return from_lcm<firmware::ControllerStatus>(message);
}
firmware::MonitorVerdict from_message(const trip_t& message) { return from_lcm<firmware::MonitorVerdict>(message); }
firmware::OperatorInput from_message(const operator_t& message) { return from_lcm<firmware::OperatorInput>(message); }

bool in_range(const contact_t& message) {
  return is_tick(message.tick) && message.regime >= contact_t::REGIME_ROLLING &&
         message.regime <= contact_t::REGIME_FLIGHT && is_flag(message.last);
}

bool in_range(const plant_state_t& message) {
  return is_tick(message.tick) && is_count(message.mass_count, kMaxMasses) && is_flag(message.last);
}

bool in_range(const sensors_t& message) {
  return is_count(message.mass_count, kMaxMasses) && is_flag(message.last) &&
         fields_in_range<firmware::Sensors>(message);
}

bool in_range(const step_command_t& message) { return fields_in_range<firmware::StepCommand>(message); }

bool in_range(const controller_status_t& message) { return fields_in_range<firmware::ControllerStatus>(message); }

bool in_range(const trip_t& message) {
  return is_tick(message.trip_tick) && message.cause >= trip_t::CAUSE_NONE &&
         message.cause <= trip_t::CAUSE_DISAGREEMENT && fields_in_range<firmware::MonitorVerdict>(message);
}

bool in_range(const operator_t& message) {
  return is_tick(message.tick) && fields_in_range<firmware::OperatorInput>(message);
}

bool has_hash(const void* data, std::size_t size, std::int64_t hash) {
  if (size < 8) return false;
  const auto* bytes = static_cast<const unsigned char*>(data);
  std::uint64_t value = 0;
  for (int i = 0; i < 8; ++i) value = value << 8 | bytes[i];
  return value == static_cast<std::uint64_t>(hash);
}

}  // namespace ballast::hal
