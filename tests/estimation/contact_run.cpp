#include "tests/estimation/contact_run.h"

#include <cmath>
#include <memory>

#include "sim/sensors/sensors.h"
#include "tools/faults/injection.h"
#include "tools/program/params.h"
#include "tools/sil/host_firmware.h"
#include "tools/sil/lap_sink.h"
#include "tools/sil/local_peers.h"
#include "tools/sil/run.h"

namespace ballast::contact_test {
namespace {

using firmware::Vector3;

firmware::TriadErrors errors_of(const sim::ImuTriad& triad, double rate_hz) {
  return {.noise = triad.noise_density * std::sqrt(rate_hz / 2),
          .bias = triad.bias,
          .bias_walk = triad.bias_walk,
          .scale_error = triad.scale_error,
          .misalignment_rad = triad.misalignment_rad,
          .range = triad.range,
          .resolution = triad.resolution};
}

firmware::Sensors sensors_of(const sensors_t& m) {
  firmware::Sensors s;
  s.tick = m.tick;
  s.orientation = {m.orientation[0], m.orientation[1], m.orientation[2], m.orientation[3]};
  s.gyro_B_radps = Vector3(m.gyro_B_radps[0], m.gyro_B_radps[1], m.gyro_B_radps[2]);
  s.accelerometer_B_mps2 = Vector3(m.accelerometer_B_mps2[0], m.accelerometer_B_mps2[1], m.accelerometer_B_mps2[2]);
  s.imu_count = m.imu_count;
  s.imu_tick = m.imu_tick;
  s.has_encoders = m.has_encoders != 0;
  for (std::size_t i = 0; i < s.encoder.size(); ++i) s.encoder[i] = m.encoder[i];
  return s;
}

// Speed of the contact point: zdot - omega x r e3, along the floor.
double slip_of(const plant_state_t& state, double radius_m) {
  const Eigen::Quaterniond q(state.orientation[0], state.orientation[1], state.orientation[2], state.orientation[3]);
  const double* rate = state.angular_velocity_B_radps;
  const Eigen::Vector3d omega_W = q * Eigen::Vector3d(rate[0], rate[1], rate[2]);
  return std::hypot(state.velocity_W_mps[0] - radius_m * omega_W[1], state.velocity_W_mps[1] + radius_m * omega_W[0]);
}

// A monitor that sees nothing wrong: the robot is on its own, and slides until it stops by itself.
class Blind final : public sil::LapMonitor {
 public:
  explicit Blind(const monitor::MonitorLimits& limits) : scenario_id_(limits.scenario_id) {}
  void judge(sil::Lap& lap) override {
    trip_t verdict{};
    verdict.tick = lap.tick();
    verdict.utime = lap.plant.contact.utime;
    verdict.scenario_id = scenario_id_;
    lap.verdict = verdict;
  }
  void hear(const sil::Lap&) override {}

 private:
  std::int64_t scenario_id_;
};

class Recorder final : public sil::LapSink {
 public:
  Recorder(const sim::Scenario& scenario, RecordedRun& run) : radius_m_(scenario.ball.radius_m), run_(run) {
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      commanded_.position[i] = scenario.masses[i].initial_position;
    }
  }

  void take(const sil::Lap& lap) override {
    const plant_state_t& state = lap.plant.state;
    const contact_t& contact = lap.plant.contact;
    RecordedTick tick;
    tick.sensors = sensors_of(lap.plant.sensors);
    tick.commanded = commanded_;
    tick.orientation = {state.orientation[0], state.orientation[1], state.orientation[2], state.orientation[3]};
    tick.normal_force_n = contact.normal_force_n;
    tick.static_friction_n = contact.static_friction_n;
    tick.friction_force_W_n = {contact.friction_force_W_n[0], contact.friction_force_W_n[1]};
    tick.regime = contact.regime;
    tick.slip_mps = contact.regime == contact_t::REGIME_ROLLING ? 0 : slip_of(state, radius_m_);
    run_.ticks.push_back(tick);
    if (!lap.answer) return;
    const controller_status_t& said = lap.answer->status;
    for (std::size_t i = 0; i < static_cast<std::size_t>(run_.ball.mass_count); ++i) {
      commanded_.position[i] = said.next_position[i];
      commanded_.velocity[i] = said.next_velocity[i];
      commanded_.acceleration[i] = said.next_acceleration[i];
    }
  }
  [[nodiscard]] bool good() const override { return true; }
  [[nodiscard]] const std::string& error() const override { return none_; }
  [[nodiscard]] std::int64_t bytes() const override { return 0; }

 private:
  double radius_m_;
  RecordedRun& run_;
  firmware::MassMotion commanded_;
  std::string none_;
};

}  // namespace

firmware::EstimationParams estimation_params(const sim::Scenario& scenario) {
  const sim::SensorModel& sensors = scenario.sensors;
  firmware::EstimationParams p;
  p.estimated = true;
  p.measures_contact = sensors.present;
  p.imu_period_ticks = static_cast<int>(sim::ticks_per_sample(sensors.rate_hz, scenario.run.control_period_s));
  p.imu_latency_ticks = static_cast<int>(std::ceil(sensors.latency_s / scenario.run.control_period_s - 1e-9));
  p.gyro = errors_of(sensors.gyro, sensors.rate_hz);
  p.accelerometer = errors_of(sensors.accelerometer, sensors.rate_hz);
  p.accelerometer_position_B_m = sensors.accelerometer_position_B_m;
  p.initial_orientation = scenario.initial.orientation;
  p.initial_angular_velocity_B_radps = scenario.initial.angular_velocity_B_radps;
  p.initial_position_W_m = scenario.initial.position_W_m;
  p.has_encoders = !sensors.encoder_resolution.empty();
  for (std::size_t i = 0; i < sensors.encoder_resolution.size(); ++i) {
    p.encoder_resolution[i] = sensors.encoder_resolution[i];
  }
  return p;
}

RecordedRun record(const std::string& name, const std::vector<std::string>& overrides,
                   const std::vector<std::string>& faults, std::string& error) {
  RecordedRun run;
  const auto read = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + name + ".toml", overrides, faults);
  for (const auto& e : read.errors) error += to_string(e) + "\n";
  if (!read.errors.empty()) return run;
  const sim::Scenario& scenario = read.scenario;
  const auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto refusal = program::to_controller_params(scenario, *params)) {
    error = *refusal;
    return run;
  }
  run.ball = params->ball;
  run.params = estimation_params(scenario);
  run.control_period_s = scenario.run.control_period_s;
  run.static_friction = params->static_friction;
  sil::LocalPeers peers(std::make_unique<Blind>(program::to_monitor_limits(scenario)),
                        std::make_unique<sil::HostFirmware>(*params, run.control_period_s), nullptr);
  Recorder recorder(scenario, run);
  const sil::RunResult result = sil::run_with_faults(scenario, peers, recorder, {});
  if (result.status != hal::Status::kOk) {
    error = result.trouble;
    run.ticks.clear();
  }
  return run;
}

}  // namespace ballast::contact_test
