#include "tests/estimation/recorded_run.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sim/motors/random.h"
#include "tools/program/params.h"
#include "tools/sil/local_peers.h"
#include "tools/sil/run.h"

namespace ballast::test {

RecordedRun record(const std::string& name, std::vector<std::string> overrides) {
  RecordedRun run;
  overrides.insert(overrides.begin(), {"run.hold=5", "sensors.attitude=sensed", "sensors.preset=bmi088_calibrated"});
  const auto read = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + name + ".toml", overrides);
  for (const auto& error : read.errors) ADD_FAILURE() << to_string(error);
  run.scenario = read.scenario;
  run.params = std::make_unique<firmware::ControllerParams>();
  if (const auto refused = program::to_controller_params(run.scenario, *run.params)) ADD_FAILURE() << *refused;
  run.params->estimation.measures_contact = false;  // a flag would end the run

  // A status says what is commanded at the next tick. Before the first one the masses stand where they begin.
  firmware::MassMotion next;
  for (std::size_t i = 0; i < run.scenario.masses.size(); ++i) {
    next.position[i] = run.params->motion[i].at(0).position;
  }
  sil::InProcessPeers peers(run.params.get(), program::to_monitor_limits(run.scenario),
                            run.scenario.run.control_period_s);
  sil::NoRecord sink;
  sil::RunOptions options;
  options.observe = [&](const sil::Lap& lap, const sim::Plant::Sample& sample) {
    const Eigen::Vector4d& q = sample.orientation;
    TrueTick tick{lap.tick(), sil::true_motion(run.scenario, sample), {q[0], q[1], q[2], q[3]}, next};
    if (!run.ticks.empty()) run.path_m += (tick.motion.position_W_m - run.ticks.back().motion.position_W_m).norm();
    run.ticks.push_back(tick);
    if (!lap.answer) return;
    for (std::size_t i = 0; i < run.scenario.masses.size(); ++i) {
      next.position[i] = lap.answer->status.next_position[i];
      next.velocity[i] = lap.answer->status.next_velocity[i];
      next.acceleration[i] = lap.answer->status.next_acceleration[i];
    }
  };
  const auto result = sil::run(run.scenario, peers, sink, options);
  EXPECT_EQ(result.status, hal::Status::kOk) << result.trouble;
  EXPECT_EQ(result.end_reason, sil::EndReason::kCompleted);
  return run;
}

firmware::EstimationParams estimation_params(const sim::Scenario& scenario, const sim::SensorModel& model) {
  firmware::EstimationParams p;
  const double period_s = scenario.run.control_period_s;
  const auto ticks = [period_s](double time_s) { return static_cast<int>(std::ceil(time_s / period_s - 1e-9)); };
  const auto triad = [&model](const sim::ImuTriad& t) {
    return firmware::TriadErrors{.noise = t.noise_density * std::sqrt(model.rate_hz / 2),
                                 .bias = t.bias,
                                 .bias_walk = t.bias_walk,
                                 .scale_error = t.scale_error,
                                 .misalignment_rad = t.misalignment_rad,
                                 .range = t.range,
                                 .resolution = t.resolution};
  };
  p.estimated = p.measures_contact = true;
  p.imu_period_ticks = static_cast<int>(sim::ticks_per_sample(model.rate_hz, period_s));
  p.imu_latency_ticks = ticks(model.latency_s);
  p.gyro = triad(model.gyro);
  p.accelerometer = triad(model.accelerometer);
  p.accelerometer_position_B_m = model.accelerometer_position_B_m;
  p.fix_delay_ticks = ticks(model.fix.delay_s);
  p.fix_noise_m = model.fix.noise_m;
  p.initial_orientation = scenario.initial.orientation;
  p.initial_angular_velocity_B_radps = scenario.initial.angular_velocity_B_radps;
  p.initial_position_W_m = scenario.initial.position_W_m;
  return p;
}

Imu::Imu(const sim::SensorModel& model, double control_period_s, std::uint64_t seed)
    : model_(model),
      control_period_s_(control_period_s),
      every_(sim::ticks_per_sample(model.rate_hz, control_period_s)),
      fix_every_(model.fix.rate_hz > 0 ? sim::ticks_per_sample(model.fix.rate_hz, control_period_s) : 0),
      gyro_(model.gyro, model.rate_hz, sim::random_bits(seed)),
      accelerometer_(model.accelerometer, model.rate_hz, sim::random_bits(seed)),
      fix_random_(sim::random_bits(seed)),
      gyro_bias_(gyro_.bias()) {}

void Imu::read(const TrueTick& truth, firmware::Sensors& sensors) {
  const std::int64_t tick = truth.tick;
  const auto late = [this](double time_s) {
    return static_cast<std::int64_t>(std::ceil(time_s / control_period_s_ - 1e-9));
  };
  if (tick % every_ == 0) {
    const Eigen::Vector3d &omega = truth.motion.angular_velocity_B_radps, &d = model_.accelerometer_position_B_m;
    firmware::Sensors sample;
    gyro_bias_ = gyro_.bias();
    sample.gyro_B_radps = gyro_.read(omega);
    sample.accelerometer_B_mps2 =
        accelerometer_.read(truth.motion.specific_force_B_mps2 + truth.motion.angular_acceleration_B_radps2.cross(d) +
                            omega.cross(omega.cross(d)));
    sample.imu_count = ++imu_count_;
    sample.imu_tick = tick;
    on_its_way_.push_back(sample);
  }
  if (fix_every_ > 0 && tick % fix_every_ == 0) {
    firmware::Sensors fix;
    for (int j = 0; j < 2; ++j) {
      fix.fix_W_m[static_cast<std::size_t>(j)] =
          truth.motion.position_W_m[j] + model_.fix.noise_m * sim::normal(fix_random_);
    }
    fix.fix_count = ++fix_count_;
    fix.fix_tick = tick;
    fixes_on_their_way_.push_back(fix);
  }
  sensors.tick = tick;
  while (!on_its_way_.empty() && on_its_way_.front().imu_tick + late(model_.latency_s) <= tick) {
    const firmware::Sensors& sample = on_its_way_.front();
    sensors.gyro_B_radps = sample.gyro_B_radps;
    sensors.accelerometer_B_mps2 = sample.accelerometer_B_mps2;
    sensors.imu_count = sample.imu_count;
    sensors.imu_tick = sample.imu_tick;
    on_its_way_.erase(on_its_way_.begin());
  }
  while (!fixes_on_their_way_.empty() && fixes_on_their_way_.front().fix_tick + late(model_.fix.delay_s) <= tick) {
    const firmware::Sensors& fix = fixes_on_their_way_.front();
    sensors.fix_W_m = fix.fix_W_m;
    sensors.fix_count = fix.fix_count;
    sensors.fix_tick = fix.fix_tick;
    fixes_on_their_way_.erase(fixes_on_their_way_.begin());
  }
}

}  // namespace ballast::test
