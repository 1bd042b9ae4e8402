#include "hal/lcm/messages.h"

#include <cmath>

namespace ballast::hal {
namespace {

constexpr int kMaxMasses = firmware::kMaxMasses;
constexpr int kMaxBursts = firmware::kMaxBursts;
constexpr std::int64_t kFarthestTick = (std::int64_t{1} << 62) - 1;  // differences of two fit, with 1 added too

bool is_flag(std::int8_t value) { return value == 0 || value == 1; }
bool is_count(int value, int max) { return value >= 0 && value <= max; }
bool is_tick(std::int64_t value) { return value >= -kFarthestTick && value <= kFarthestTick; }

}  // namespace

std::int64_t tick_utime(std::int64_t tick, double control_period_s) {
  return std::llround(static_cast<double>(tick) * control_period_s * 1e6);
}

sensors_t to_message(const firmware::Sensors& sensors, int mass_count, bool last, std::int64_t scenario_id,
                     double control_period_s) {
  sensors_t message{};
  message.tick = sensors.tick;
  message.utime = tick_utime(sensors.tick, control_period_s);
  message.scenario_id = scenario_id;
  message.orientation[0] = sensors.orientation.w();
  message.orientation[1] = sensors.orientation.x();
  message.orientation[2] = sensors.orientation.y();
  message.orientation[3] = sensors.orientation.z();
  for (int j = 0; j < 3; ++j) {
    message.gyro_B_radps[j] = sensors.gyro_B_radps[j];
    message.accelerometer_B_mps2[j] = sensors.accelerometer_B_mps2[j];
  }
  message.mass_count = static_cast<std::int8_t>(mass_count);
  for (std::size_t i = 0; i < kMaxMasses; ++i) {
    message.limit_switch[i] = static_cast<std::int8_t>(sensors.limit_switch[i]);
  }
  message.last = last ? 1 : 0;
  return message;
}

firmware::Sensors from_message(const sensors_t& message) {
  firmware::Sensors sensors;
  sensors.tick = message.tick;
  const double* q = message.orientation;
  sensors.orientation = firmware::Quaternion(q[0], q[1], q[2], q[3]);
  for (int j = 0; j < 3; ++j) {
    sensors.gyro_B_radps[j] = message.gyro_B_radps[j];
    sensors.accelerometer_B_mps2[j] = message.accelerometer_B_mps2[j];
  }
  for (std::size_t i = 0; i < kMaxMasses; ++i) {
    sensors.limit_switch[i] = static_cast<std::uint8_t>(message.limit_switch[i]);
  }
  return sensors;
}

step_command_t to_message(const firmware::StepCommand& steps, double control_period_s) {
  step_command_t message{};
  message.tick = steps.tick;
  message.utime = tick_utime(steps.tick, control_period_s);
  message.motor_count = static_cast<std::int8_t>(steps.motor_count);
  for (std::size_t i = 0; i < static_cast<std::size_t>(steps.motor_count); ++i) {
    message.steps[i] = steps.steps[i];
    message.position_steps[i] = steps.position_steps[i];
  }
  message.burst_count = static_cast<std::int16_t>(steps.burst_count);
  for (std::size_t i = 0; i < static_cast<std::size_t>(steps.burst_count); ++i) {
    const firmware::StepBurst& burst = steps.bursts[i];
    message.motor[i] = static_cast<std::int8_t>(burst.motor);
    message.direction[i] = burst.direction;
    message.count[i] = burst.count;
    message.first[i] = burst.first_ticks;
    message.interval[i] = burst.interval_ticks;
    message.add[i] = burst.add_ticks;
  }
  return message;
}

firmware::StepCommand from_message(const step_command_t& message) {
  firmware::StepCommand steps;
  steps.tick = message.tick;
  steps.motor_count = message.motor_count;
  for (std::size_t i = 0; i < static_cast<std::size_t>(message.motor_count); ++i) {
    steps.steps[i] = message.steps[i];
    steps.position_steps[i] = message.position_steps[i];
  }
  steps.burst_count = message.burst_count;
  for (std::size_t i = 0; i < static_cast<std::size_t>(message.burst_count); ++i) {
    firmware::StepBurst& burst = steps.bursts[i];
    burst.motor = static_cast<std::uint8_t>(message.motor[i]);
    burst.direction = message.direction[i];
    burst.count = message.count[i];
    burst.first_ticks = message.first[i];
    burst.interval_ticks = message.interval[i];
    burst.add_ticks = message.add[i];
  }
  return steps;
}

controller_status_t to_message(const firmware::ControllerStatus& status, double control_period_s) {
  controller_status_t message{};
  message.tick = status.tick;
  message.utime = tick_utime(status.tick, control_period_s);
  message.scenario_id = status.scenario_id;
  message.mode = static_cast<std::int8_t>(status.mode);
  message.at_rest = status.at_rest ? 1 : 0;
  message.faults = static_cast<std::int32_t>(status.faults);
  message.motor_count = static_cast<std::int8_t>(status.motor_count);
  for (std::size_t i = 0; i < static_cast<std::size_t>(status.motor_count); ++i) {
    message.commanded_position[i] = status.commanded_position[i];
    message.commanded_velocity[i] = status.commanded_velocity[i];
    message.next_position[i] = status.next[i].position;
    message.next_velocity[i] = status.next[i].velocity;
    message.next_acceleration[i] = status.next[i].acceleration;
    message.steps_issued[i] = status.steps_issued[i];
  }
  message.normal_force_n = status.predicted.normal_force_n;
  message.static_friction_n = status.predicted.static_friction_n;
  message.mu_required = status.mu_required;
  message.margin = status.margin;
  message.overruns = status.overruns;
  message.overload_error = static_cast<std::int8_t>(status.overload.trouble.error);
  message.overload_motor = static_cast<std::int8_t>(status.overload.motor);
  message.overload_tick = status.overload.tick;
  message.overload_value = status.overload.trouble.value;
  message.overload_limit = status.overload.trouble.limit;
  message.operator_commands = status.operator_commands;
  message.refusal = static_cast<std::int8_t>(status.refusal.reason);
  message.refusal_motor = static_cast<std::int8_t>(status.refusal.motor);
  message.refusal_piece = static_cast<std::int16_t>(status.refusal.piece);
  message.refusal_value = status.refusal.value;
  message.planned = status.planned ? 1 : 0;
  message.plan_tick = status.plan_tick;
  message.plan_duration_s = status.plan.duration_s;
  message.plan_horizon_s = status.plan.horizon_s;
  message.plan_normal_force_min_n = status.plan.normal_force_min_n;
  message.plan_mu_required_max = status.plan.mu_required_max;
  message.plan_margin_min = status.plan.margin_min;
  return message;
}

firmware::ControllerStatus from_message(const controller_status_t& message) {
  firmware::ControllerStatus status;
  status.tick = message.tick;
  status.scenario_id = message.scenario_id;
  status.mode = static_cast<firmware::Mode>(message.mode);
  status.at_rest = message.at_rest == 1;
  status.faults = static_cast<std::uint32_t>(message.faults);
  status.motor_count = message.motor_count;
  for (std::size_t i = 0; i < static_cast<std::size_t>(message.motor_count); ++i) {
    status.commanded_position[i] = message.commanded_position[i];
    status.commanded_velocity[i] = message.commanded_velocity[i];
    status.next[i] = {message.next_position[i], message.next_velocity[i], message.next_acceleration[i]};
    status.steps_issued[i] = message.steps_issued[i];
  }
  status.predicted.normal_force_n = message.normal_force_n;
  status.predicted.static_friction_n = message.static_friction_n;
  status.mu_required = message.mu_required;
  status.margin = message.margin;
  status.overruns = message.overruns;
  status.overload.trouble.error = static_cast<firmware::StepError>(message.overload_error);
  status.overload.motor = message.overload_motor;
  status.overload.tick = message.overload_tick;
  status.overload.trouble.value = message.overload_value;
  status.overload.trouble.limit = message.overload_limit;
  status.operator_commands = message.operator_commands;
  status.refusal = {static_cast<firmware::Refusal>(message.refusal), message.refusal_motor, message.refusal_piece,
                    message.refusal_value};
  status.planned = message.planned == 1;
  status.plan_tick = message.plan_tick;
  status.plan = {message.plan_duration_s, message.plan_horizon_s, message.plan_normal_force_min_n,
                 message.plan_mu_required_max, message.plan_margin_min};
  return status;
}

firmware::MonitorVerdict from_message(const trip_t& message) {
  firmware::MonitorVerdict verdict;
  verdict.tick = message.tick;
  verdict.tripped = message.tripped == 1;
  return verdict;
}

operator_t to_message(const firmware::OperatorInput& input, std::int64_t tick, std::int64_t sequence,
                      double control_period_s) {
  operator_t message{};
  message.tick = tick;
  message.utime = tick_utime(tick, control_period_s);
  message.sequence = sequence;
  message.command = static_cast<std::int8_t>(input.command);
  if (input.command != firmware::OperatorCommand::kMove) return message;
  message.move_masses = static_cast<std::int32_t>(input.move.masses);
  for (std::size_t i = 0; i < kMaxMasses; ++i) message.target_position[i] = input.move.target_position[i];
  message.speed_fraction = input.move.speed_fraction;
  return message;
}

firmware::OperatorInput from_message(const operator_t& message) {
  firmware::OperatorInput input = static_cast<firmware::OperatorCommand>(message.command);
  if (input.command != firmware::OperatorCommand::kMove) return input;
  input.move.masses = static_cast<std::uint32_t>(message.move_masses);
  for (std::size_t i = 0; i < kMaxMasses; ++i) input.move.target_position[i] = message.target_position[i];
  input.move.speed_fraction = message.speed_fraction;
  return input;
}

bool in_range(const contact_t& message) {
  return is_tick(message.tick) && message.regime >= contact_t::REGIME_ROLLING &&
         message.regime <= contact_t::REGIME_FLIGHT && is_flag(message.last);
}

bool in_range(const plant_state_t& message) {
  return is_tick(message.tick) && is_count(message.mass_count, kMaxMasses) && is_flag(message.last);
}

bool in_range(const sensors_t& message) {
  for (const std::int8_t limit_switch : message.limit_switch) {
    if (limit_switch < 0 || limit_switch > 3) return false;
  }
  return is_tick(message.tick) && is_count(message.mass_count, kMaxMasses) && is_flag(message.last);
}

bool in_range(const step_command_t& message) {
  if (!is_tick(message.tick)) return false;
  if (!is_count(message.motor_count, kMaxMasses) || !is_count(message.burst_count, kMaxBursts)) return false;
  for (int i = 0; i < message.burst_count; ++i) {
    if (message.motor[i] < 0 || message.motor[i] >= message.motor_count) return false;
    if (message.direction[i] != 1 && message.direction[i] != -1) return false;
    if (message.count[i] < 1 || message.first[i] < 0 || message.interval[i] < 0) return false;
  }
  return true;
}

bool in_range(const controller_status_t& message) {
  return is_tick(message.tick) && message.mode >= controller_status_t::MODE_DISARMED &&
         message.mode <= controller_status_t::MODE_MOVING && is_flag(message.at_rest) &&
         is_count(message.motor_count, kMaxMasses) && is_count(message.overload_error, 3) &&
         message.overload_motor >= -1 && message.overload_motor < kMaxMasses &&
         message.refusal >= controller_status_t::REFUSAL_NONE &&
         message.refusal <= controller_status_t::REFUSAL_UPPER_END && message.refusal_motor >= -1 &&
         message.refusal_motor < 32 && message.refusal_piece >= -1 && message.refusal_piece <= firmware::kMaxPieces &&
         is_flag(message.planned) && is_tick(message.plan_tick);
}

bool in_range(const trip_t& message) {
  return is_tick(message.tick) && is_tick(message.trip_tick) && is_flag(message.tripped) &&
         message.cause >= trip_t::CAUSE_NONE && message.cause <= trip_t::CAUSE_DISAGREEMENT;
}

bool in_range(const operator_t& message) {
  return is_tick(message.tick) && message.command >= operator_t::COMMAND_ARM &&
         message.command <= operator_t::COMMAND_MOVE;
}

bool has_hash(const void* data, std::size_t size, std::int64_t hash) {
  if (size < 8) return false;
  const auto* bytes = static_cast<const unsigned char*>(data);
  std::uint64_t value = 0;
  for (int i = 0; i < 8; ++i) value = value << 8 | bytes[i];
  return value == static_cast<std::uint64_t>(hash);
}

}  // namespace ballast::hal
