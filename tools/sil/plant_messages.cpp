#include "tools/sil/plant_messages.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/plant/floor.h"
#include "tools/sil/countdown.h"

namespace ballast::sil {

double friction_margin(double normal_force_n, double static_friction_n, double static_friction_coefficient) {
  if (!(normal_force_n > 0)) return -1;
  return std::max(-1.0, 1 - static_friction_n / (static_friction_coefficient * normal_force_n));
}

namespace {

std::int8_t regime_code(sim::Regime regime) {
  switch (regime) {
    case sim::Regime::kRolling:
      return contact_t::REGIME_ROLLING;
    case sim::Regime::kSliding:
      return contact_t::REGIME_SLIDING;
    case sim::Regime::kFlight:
      return contact_t::REGIME_FLIGHT;
  }
  return contact_t::REGIME_ROLLING;
}

// a_GC - g. On a level floor gravity is along the floor's normal.
Eigen::Vector3d specific_force_B_mps2(const sim::Scenario& scenario, const sim::Plant::Sample& sample) {
  Eigen::Vector3d against_weight_B = sample.up_B;
  if (const sim::Floor floor(scenario); floor.slopes) {
    const Eigen::Vector4d& q = sample.orientation;
    against_weight_B = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).conjugate() * sim::eigen(floor.against_weight_W);
  }
  return sample.acceleration_B_mps2 + scenario.gravity_mps2 * against_weight_B;
}

}  // namespace

void hold_still(sim::Plant::Sample& sample) {
  sample.angular_velocity_B_radps.setZero();
  sample.angular_acceleration_B_radps2.setZero();
  sample.velocity_W_mps.setZero();
  sample.acceleration_B_mps2.setZero();
}

sim::TrueMotion true_motion(const sim::Scenario& scenario, const sim::Plant::Sample& sample) {
  return {sample.angular_velocity_B_radps, sample.angular_acceleration_B_radps2,
          specific_force_B_mps2(scenario, sample), sample.position_W_m.head<2>(), sample.mass_position};
}

void set_sensors(const sim::SensorReadings& readings, const sim::SensorModel& model, sensors_t& sensors) {
  if (model.attitude_estimated) {
    sensors.attitude_valid = 0;
    std::copy_n(kNoAttitude, 4, sensors.orientation);
  }
  for (int j = 0; j < 3; ++j) {
    sensors.gyro_B_radps[j] = readings.imu.gyro_B_radps[j];
    sensors.accelerometer_B_mps2[j] = readings.imu.accelerometer_B_mps2[j];
  }
  sensors.imu_count = readings.imu.count;
  sensors.imu_tick = readings.imu.tick;
  sensors.has_encoders = model.encoder_resolution.empty() ? 0 : 1;
  for (std::size_t i = 0; i < readings.encoder.size(); ++i) sensors.encoder[i] = readings.encoder[i];
  sensors.fix_count = readings.fix.count;
  sensors.fix_tick = readings.fix.tick;
  for (int j = 0; j < 2; ++j) sensors.fix_W_m[j] = readings.fix.position_W_m[j];
}

void set_commanded(const std::optional<sim::Plant::ContactForces>& commanded, contact_t& contact) {
  constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
  const bool flies = contact.regime == contact_t::REGIME_FLIGHT;
  const bool known = commanded && std::isfinite(commanded->normal_force_n);
  contact.commanded_normal_force_n = known ? commanded->normal_force_n : kNothing;
  contact.commanded_static_friction_n = known ? commanded->static_friction_n : kNothing;
  contact.commanded_mu_required = !known  ? kNothing
                                  : flies ? 0
                                          : sim::mu_required(commanded->normal_force_n, commanded->static_friction_n);
}

PlantMessages plant_messages(const sim::Scenario& scenario, const sim::Plant::Sample& sample, std::int64_t tick,
                             bool last, const std::optional<sim::Plant::ContactForces>& commanded) {
  const std::int64_t utime = tick < 0 ? hal::tick_utime(tick, scenario.run.control_period_s)
                                      : static_cast<std::int64_t>(std::llround(sample.time_s * 1e6));
  const auto mass_count = static_cast<std::int8_t>(scenario.masses.size());
  const auto last_flag = static_cast<std::int8_t>(last);
  PlantMessages m{};

  m.contact.tick = m.state.tick = m.sensors.tick = tick;
  m.contact.utime = m.state.utime = m.sensors.utime = utime;
  m.contact.time_s = m.state.time_s = sample.time_s;
  m.contact.last = m.state.last = m.sensors.last = last_flag;

  m.contact.normal_force_n = sample.normal_force_n;
  m.contact.static_friction_n = sample.static_friction_n;
  const bool flies = sample.regime == sim::Regime::kFlight;
  m.contact.mu_required = flies ? 0 : sim::mu_required(sample.normal_force_n, sample.static_friction_n);
  m.contact.normal_force_min_n = sample.normal_force_min_n;
  m.contact.mu_required_max = sample.mu_required_max;
  m.contact.margin = friction_margin(sample.normal_force_n, sample.static_friction_n, sample.floor_static_friction);
  m.contact.regime = regime_code(sample.regime);
  set_commanded(commanded, m.contact);

  m.contact.commanded_tick = tick;

  m.sensors.scenario_id = scenario.id;
  m.sensors.attitude_valid = 1;
  m.state.mass_count = m.sensors.mass_count = mass_count;
  const Eigen::Vector3d specific_force_B = specific_force_B_mps2(scenario, sample);
  m.sensors.imu_tick = tick;
  m.sensors.imu_count = tick + scenario.run.lead_ticks() + 1;  // one per tick
  for (int j = 0; j < 4; ++j) m.state.orientation[j] = m.sensors.orientation[j] = sample.orientation[j];
  for (int j = 0; j < 2; ++j) m.contact.friction_force_W_n[j] = sample.friction_force_W_n[j];
  for (int j = 0; j < 3; ++j) {
    m.state.angular_velocity_B_radps[j] = m.sensors.gyro_B_radps[j] = sample.angular_velocity_B_radps[j];
    m.state.position_W_m[j] = sample.position_W_m[j];
    m.state.velocity_W_mps[j] = sample.velocity_W_mps[j];
    m.state.center_of_mass_B_m[j] = sample.center_of_mass_B_m[j];
    m.sensors.accelerometer_B_mps2[j] = specific_force_B[j];
  }
  for (int i = 0; i < mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    m.state.mass_position[i] = sample.mass_position[k];
    m.state.mass_velocity[i] = sample.mass_velocity[k];
    for (int j = 0; j < 3; ++j) m.state.mass_position_B_m[i][j] = sample.mass_position_B_m[k][j];
    m.state.motor_torque_nm[i] = sample.motor_torque_nm[k];
    m.state.lost_steps[i] = sample.lost_steps[k];
    m.sensors.limit_switch[i] = static_cast<std::int8_t>(sample.end_switches[k]);
  }
  return m;
}

void expand(const step_command_t& command, double timer_frequency_hz, std::vector<sim::StepPulse>& pulses) {
  pulses.clear();
  for (int b = 0; b < command.burst_count; ++b) {
    for (std::int64_t j = 0; j < command.count[b]; ++j) {
      const std::int64_t timer_tick = command.first[b] + j * command.interval[b] + command.add[b] * (j * (j - 1) / 2);
      pulses.push_back({static_cast<double>(timer_tick) / timer_frequency_hz, command.motor[b], command.direction[b]});
    }
  }
  std::stable_sort(pulses.begin(), pulses.end(), [](const auto& a, const auto& b) {
    return a.offset_s != b.offset_s ? a.offset_s < b.offset_s : a.motor < b.motor;
  });
}

}  // namespace ballast::sil
