// The bytes of an LCM message. They are those of the encoders that lcm-gen writes, which take a few dozen instructions
// for a number where these take three. Tests compare the two.
//
// The members of a message are encoded in the order in which lcm-gen declares them. A message whose .lcm file has
// another number of fields than are listed here does not compile.
#pragma once

#include <ballast/contact_t.hpp>
#include <ballast/controller_status_t.hpp>
#include <ballast/operator_t.hpp>
#include <ballast/plant_state_t.hpp>
#include <ballast/sensors_t.hpp>
#include <ballast/step_command_t.hpp>
#include <ballast/trip_t.hpp>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

namespace ballast::hal {

// Writes numbers and arrays of them one after the other, big-endian.
class BigEndian {
 public:
  explicit BigEndian(char* to) : at_(to) {}

  template <class T>
  BigEndian& operator<<(const T& value) {
    if constexpr (std::is_same_v<std::remove_extent_t<T>, std::int8_t> && std::is_array_v<T>) {
      std::memcpy(at_, value, sizeof value);
      at_ += sizeof value;
    } else if constexpr (std::is_array_v<T>) {
      for (const auto& element : value) *this << element;
    } else {
      put(value);
    }
    return *this;
  }
  // Writes bytes as they are.
  BigEndian& write(const char* bytes, std::size_t size) {
    std::memcpy(at_, bytes, size);
    at_ += size;
    return *this;
  }

 private:
  template <class T>
  void put(T value) {
    static_assert(std::is_arithmetic_v<T>);
    if constexpr (sizeof value == 8) {
      put_word<std::uint64_t>(value, [](std::uint64_t word) { return __builtin_bswap64(word); });
    } else if constexpr (sizeof value == 4) {
      put_word<std::uint32_t>(value, [](std::uint32_t word) { return __builtin_bswap32(word); });
    } else if constexpr (sizeof value == 2) {
      put_word<std::uint16_t>(value, [](std::uint16_t word) { return __builtin_bswap16(word); });
    } else {
      static_assert(sizeof value == 1);
      put_word<std::uint8_t>(value, [](std::uint8_t word) { return word; });
    }
  }
  template <class Word, class T, class Swap>
  void put_word(T value, Swap swap) {
    Word word;
    std::memcpy(&word, &value, sizeof word);
    if constexpr (__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__) word = swap(word);
    std::memcpy(at_, &word, sizeof word);
    at_ += sizeof word;
  }

  char* at_;
};

template <class F>
decltype(auto) with_fields(const contact_t& message, F&& f) {
  const auto& [tick, utime, run_id, time_s, normal_force_n, commanded_tick, commanded_normal_force_n, static_friction_n,
               commanded_static_friction_n, friction_force_W_n, mu_required, commanded_mu_required, margin,
               normal_force_min_n, mu_required_max, regime, last] = message;
  return f(tick, utime, run_id, time_s, normal_force_n, commanded_tick, commanded_normal_force_n, static_friction_n,
           commanded_static_friction_n, friction_force_W_n, mu_required, commanded_mu_required, margin,
           normal_force_min_n, mu_required_max, regime, last);
}

template <class F>
decltype(auto) with_fields(const controller_status_t& message, F&& f) {
  const auto& [tick, utime, scenario_id, run_id, mode, at_rest, faults, motor_count, commanded_position,
               commanded_velocity, next_position, next_velocity, next_acceleration, normal_force_n, static_friction_n,
               mu_required, margin, overruns, steps_issued, overload_error, overload_motor, overload_tick,
               overload_value, overload_limit, refused_messages, operator_commands, refusal, refusal_motor,
               refusal_piece, refusal_value, refusal_time_s, planned, plan_tick, plan_duration_s, plan_horizon_s,
               plan_normal_force_min_n, plan_mu_required_max, plan_margin_min, estimate_valid, estimated_orientation,
               estimated_angular_velocity_B_radps, estimated_gyro_bias_B_radps, estimated_position_W_m, tilt_sigma_rad,
               yaw_sigma_rad, gyro_bias_sigma_radps, position_sigma_m, measured_valid, measured_normal_force_n,
               measured_normal_sigma_n, measured_static_friction_n, measured_mu_required, measured_mu_sigma,
               measured_slip_mps2, measured_slip_sigma_mps2, slip_detected, light_detected, governed, command_bent,
               backup_active, backup_margin, backup_until_tick, governor_allowance, halt_said, halt_tick,
               halt_distance_m, halt_duration_s, motion_delay_s, slip_friction, course, course_tick, course_coming] =
      message;
  return f(tick, utime, scenario_id, run_id, mode, at_rest, faults, motor_count, commanded_position, commanded_velocity,
           next_position, next_velocity, next_acceleration, normal_force_n, static_friction_n, mu_required, margin,
           overruns, steps_issued, overload_error, overload_motor, overload_tick, overload_value, overload_limit,
           refused_messages, operator_commands, refusal, refusal_motor, refusal_piece, refusal_value, refusal_time_s,
           planned, plan_tick, plan_duration_s, plan_horizon_s, plan_normal_force_min_n, plan_mu_required_max,
           plan_margin_min, estimate_valid, estimated_orientation, estimated_angular_velocity_B_radps,
           estimated_gyro_bias_B_radps, estimated_position_W_m, tilt_sigma_rad, yaw_sigma_rad, gyro_bias_sigma_radps,
           position_sigma_m, measured_valid, measured_normal_force_n, measured_normal_sigma_n,
           measured_static_friction_n, measured_mu_required, measured_mu_sigma, measured_slip_mps2,
           measured_slip_sigma_mps2, slip_detected, light_detected, governed, command_bent, backup_active,
           backup_margin, backup_until_tick, governor_allowance, halt_said, halt_tick, halt_distance_m, halt_duration_s,
           motion_delay_s, slip_friction, course, course_tick, course_coming);
}

template <class F>
decltype(auto) with_fields(const operator_t& message, F&& f) {
  const auto& [tick, utime, run_id, sender, sequence, command, move_masses, target_position, speed_fraction, course,
               course_first, course_total, course_count, course_value] = message;
  return f(tick, utime, run_id, sender, sequence, command, move_masses, target_position, speed_fraction, course,
           course_first, course_total, course_count, course_value);
}

template <class F>
decltype(auto) with_fields(const plant_state_t& message, F&& f) {
  const auto& [tick, utime, run_id, time_s, orientation, angular_velocity_B_radps, position_W_m, velocity_W_mps,
               center_of_mass_B_m, mass_count, mass_position, mass_velocity, mass_position_B_m, motor_torque_nm,
               lost_steps, last] = message;
  return f(tick, utime, run_id, time_s, orientation, angular_velocity_B_radps, position_W_m, velocity_W_mps,
           center_of_mass_B_m, mass_count, mass_position, mass_velocity, mass_position_B_m, motor_torque_nm, lost_steps,
           last);
}

template <class F>
decltype(auto) with_fields(const sensors_t& message, F&& f) {
  const auto& [tick, utime, scenario_id, run_id, attitude_valid, orientation, gyro_B_radps, accelerometer_B_mps2,
               mass_count, limit_switch, imu_count, imu_tick, has_encoders, encoder, fix_count, fix_tick, fix_W_m,
               last] = message;
  return f(tick, utime, scenario_id, run_id, attitude_valid, orientation, gyro_B_radps, accelerometer_B_mps2,
           mass_count, limit_switch, imu_count, imu_tick, has_encoders, encoder, fix_count, fix_tick, fix_W_m, last);
}

template <class F>
decltype(auto) with_fields(const step_command_t& message, F&& f) {
  const auto& [tick, utime, run_id, motor_count, steps, position_steps, burst_count, motor, direction, count, first,
               interval, add] = message;
  return f(tick, utime, run_id, motor_count, steps, position_steps, burst_count, motor, direction, count, first,
           interval, add);
}

template <class F>
decltype(auto) with_fields(const trip_t& message, F&& f) {
  const auto& [tick, utime, scenario_id, run_id, tripped, cause, trip_tick, trip_time_s, value, limit] = message;
  return f(tick, utime, scenario_id, run_id, tripped, cause, trip_tick, trip_time_s, value, limit);
}

// The size of an encoded message; the same for all of its type.
template <class M>
std::size_t encoded_size(const M& message) {
  return with_fields(message, [](const auto&... field) { return (sizeof(std::int64_t) + ... + sizeof field); });
}

// Writes encoded_size() bytes: the type's hash and the fields.
template <class M>
void encode(const M& message, char* to) {
  BigEndian out(to);
  out << M::getHash();
  with_fields(message, [&out](const auto&... field) { (out << ... << field); });
}

}  // namespace ballast::hal
