#include "tests/estimation/contact_run.h"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <memory>
#include <numbers>
#include <random>

#include "firmware/estimation/attitude_filter.h"
#include "sim/scenario/fingerprint.h"
#include "tests/estimation/recorded_run.h"
#include "tools/faults/injection.h"
#include "tools/identify/excite.h"
#include "tools/program/params.h"
#include "tools/sil/host_firmware.h"
#include "tools/sil/local_peers.h"

namespace ballast::test {

namespace {

firmware::Sensors sensors_of(const sensors_t& m) {
  using firmware::Vector3;
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
  Recorder(const sim::Scenario& scenario, ContactRun& run) : radius_m_(scenario.ball.radius_m), run_(run) {
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      commanded_.position[i] = scenario.masses[i].initial_position;
    }
  }

  void take(const sil::Lap& lap) override {
    const plant_state_t& state = lap.plant.state;
    const contact_t& contact = lap.plant.contact;
    ContactTick tick;
    tick.sensors = sensors_of(lap.plant.sensors);
    tick.commanded = commanded_;
    tick.orientation = {state.orientation[0], state.orientation[1], state.orientation[2], state.orientation[3]};
    tick.normal_force_n = contact.normal_force_n;
    tick.static_friction_n = contact.static_friction_n;
    for (std::size_t i = 0; i < tick.mass_position.size(); ++i) tick.mass_position[i] = state.mass_position[i];
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
  ContactRun& run_;
  firmware::MassMotion commanded_;
  std::string none_;
};

}  // namespace

namespace {

sim::Scenario read_contact(const std::string& name, const std::vector<std::string>& overrides,
                           const std::vector<std::string>& faults) {
  const auto read = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + name + ".toml", overrides, faults);
  for (const auto& error : read.errors) ADD_FAILURE() << to_string(error);
  return read.scenario;
}

}  // namespace

ContactRun record_contact(const std::string& name, const std::vector<std::string>& overrides,
                          const std::vector<std::string>& faults) {
  return record_contact(read_contact(name, overrides, faults));
}

ContactRun record_contact(const sim::Scenario& scenario) {
  ContactRun run;
  const auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto refused = program::to_controller_params(scenario, *params)) ADD_FAILURE() << *refused;
  // A flag would end the run. The filter needs the measurement, so that a run with an estimated attitude ends by it.
  if (!params->estimation.estimated) params->estimation.measures_contact = false;
  run.ball = params->ball;
  run.params = estimation_params(scenario, scenario.sensors);
  const std::vector<double>& resolution = scenario.sensors.encoder_resolution;
  run.params.has_encoders = !resolution.empty();
  for (std::size_t i = 0; i < resolution.size(); ++i) run.params.encoder_resolution[i] = resolution[i];
  run.control_period_s = scenario.run.control_period_s;
  sil::LocalPeers peers(std::make_unique<Blind>(program::to_monitor_limits(scenario)),
                        std::make_unique<sil::HostFirmware>(*params, run.control_period_s), nullptr);
  Recorder recorder(scenario, run);
  const sil::RunResult result = sil::run_with_faults(scenario, peers, recorder, {});
  EXPECT_EQ(result.status, hal::Status::kOk) << result.trouble;
  return run;
}

void measure(const ContactRun& run, const std::function<void(const MeasuredTick&)>& look,
             const std::function<void(std::int64_t tick, firmware::Sensors&)>& disturb) {
  const auto filter = std::make_unique<firmware::FilterState>();
  const auto masses = std::make_unique<firmware::MassMeter>();
  const auto contact = std::make_unique<firmware::ContactMeter>();
  reset(run.ball, run.params, *filter);
  reset(run.ball, run.params, *masses);
  reset(run.ball, run.params, *contact);
  firmware::Estimate estimate;
  firmware::MassMotion motion;
  firmware::MeasuredContact measured;
  for (const ContactTick& tick : run.ticks) {
    firmware::Sensors heard = tick.sensors;
    if (disturb) disturb(heard.tick, heard);
    update(run.ball, run.params, run.control_period_s, heard, tick.commanded, heard.tick, *filter, estimate);
    measure_masses(run.ball, run.params, run.control_period_s, heard, tick.commanded, *masses, motion);
    measure_contact(run.ball, run.params, run.control_period_s, heard, tick.commanded, motion, estimate, heard.tick,
                    *contact, measured);
    look({tick, estimate, motion, *contact, measured});
  }
}

namespace {

// Radix 2, in place; the size is a power of two.
void transform(std::vector<std::complex<double>>& a) {
  const std::size_t n = a.size();
  for (std::size_t i = 1, j = 0; i < n; ++i) {
    std::size_t bit = n >> 1;
    for (; (j & bit) != 0; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) std::swap(a[i], a[j]);
  }
  for (std::size_t length = 2; length <= n; length <<= 1) {
    for (std::size_t k = 0; k < length / 2; ++k) {
      const auto turn = std::polar(1.0, -2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(length));
      for (std::size_t i = k; i < n; i += length) {
        const std::complex<double> even = a[i], odd = a[i + length / 2] * turn;
        a[i] = even + odd;
        a[i + length / 2] = even - odd;
      }
    }
  }
}

}  // namespace

FrictionErrors friction_errors(const ContactRun& run) {
  FrictionErrors found;
  std::vector<std::complex<double>> errors;
  double inside = 0, inside_now = 0, squares = 0;
  measure(run, [&](const MeasuredTick& tick) {
    if (tick.truth.sensors.tick < 0 || !(tick.truth.normal_force_n > 0)) return;
    // The force is that of the sample.
    const std::int64_t age = tick.truth.sensors.tick - tick.truth.sensors.imu_tick;
    const ContactTick& then = *(&tick.truth - age);
    const double truth = then.static_friction_n / then.normal_force_n;
    const double error = tick.measured.mu_required - truth, band = 1.959964 * tick.measured.mu_sigma;
    const double now = tick.truth.static_friction_n / tick.truth.normal_force_n;
    errors.emplace_back(error);
    squares += error * error;
    inside += std::fabs(error) <= band ? 1 : 0;
    inside_now += std::fabs(tick.measured.mu_required - now) <= band ? 1 : 0;
    found.most = std::max(found.most, std::fabs(error));
    found.true_most = std::max(found.true_most, truth);
  });
  const auto count = static_cast<double>(errors.size());
  found.rms = std::sqrt(squares / count);
  found.inside = inside / count;
  found.inside_now = inside_now / count;
  std::size_t size = 1;
  while (size < errors.size()) size *= 2;
  errors.resize(size);
  transform(errors);
  for (std::size_t i = 0; i < size; ++i) {
    const double frequency_hz =
        static_cast<double>(std::min(i, size - i)) / (static_cast<double>(size) * run.control_period_s);
    std::size_t band = 0;
    while (band + 1 < found.band_rms.size() && frequency_hz >= FrictionErrors::kEdges_hz[band + 1]) ++band;
    found.band_rms[band] += std::norm(errors[i]) / (static_cast<double>(size) * count);
  }
  for (double& band : found.band_rms) band = std::sqrt(band);
  return found;
}

SlideCount count_slides(const ContactRun& run) {
  constexpr double kFast_mps = 0.05, kLong_s = 0.1, kLate_s = 0.1;
  SlideCount count;
  bool slides = false, slid = false;
  double begun_s = 0, fast_s = -1, flagged_s = -1, now_s = 0;
  const auto end = [&] {
    if (now_s - begun_s < kLong_s || fast_s < 0) return;
    ++count.slides;
    if (flagged_s >= 0 && flagged_s <= fast_s + kLate_s) {
      ++count.in_time;
    } else {
      count.slowest_missed_s = std::max(count.slowest_missed_s, fast_s - begun_s);
      count.quickest_missed_s = std::min(count.quickest_missed_s, fast_s - begun_s);
    }
  };
  measure(run, [&](const MeasuredTick& tick) {
    now_s = static_cast<double>(tick.truth.sensors.tick) * run.control_period_s;
    const bool slides_now = tick.truth.regime == contact_t::REGIME_SLIDING;
    if (slides_now && !slides) {
      slid = true;
      begun_s = now_s;
      fast_s = flagged_s = -1;
    }
    if (slides_now && fast_s < 0 && tick.truth.slip_mps > kFast_mps) fast_s = now_s;
    if (slides_now && flagged_s < 0 && tick.measured.slip_detected) flagged_s = now_s;
    if (!slides_now && slides) end();
    slides = slides_now;
    if (slid) return;
    count.false_flag = count.false_flag || tick.measured.slip_detected || tick.measured.light_detected;
    if (tick.meter.moved) count.score = std::max(count.score, tick.meter.slip_score);
  });
  if (slides) end();
  return count;
}

namespace {

// The robot as it was built: masses and inertias, the place of the shell's centre of mass, the floor's resistance.
sim::Scenario built(sim::Scenario scenario, const BeliefErrors& errors, std::mt19937_64& random) {
  std::uniform_real_distribution<double> within(-1, 1), part;
  if (!scenario.believed) scenario.believed = static_cast<const sim::World&>(scenario);
  scenario.belief_is_written = true;
  scenario.ball.mass_kg *= 1 + errors.mass * within(random);
  for (sim::Mass& mass : scenario.masses) mass.mass_kg *= 1 + errors.mass * within(random);
  for (int j = 0; j < 3; ++j) {
    scenario.ball.inertia_kgm2[j] *= 1 + errors.mass * within(random);
    scenario.ball.center_of_mass_B_m[j] += errors.center_of_mass * scenario.ball.radius_m * within(random);
  }
  scenario.surface.rolling_resistance += errors.rolling_resistance * part(random);
  scenario.id = sim::fingerprint(scenario);
  return scenario;
}

// A motion as `ballast identify --excite` proposes it.
void excite(std::uint64_t seed, double most_s, sim::Scenario& scenario) {
  identify::Known known;
  if (const std::string why = identify::know(scenario, known); !why.empty()) ADD_FAILURE() << why;
  const identify::Parameters parameters(known, known.scale_mass_kg);
  identify::ExciteOptions options;
  options.candidates = 1;
  options.seed = seed;
  const auto found = identify::excitations(scenario, known, parameters, options);
  ASSERT_FALSE(found.empty()) << "seed " << seed;
  scenario.duration_s = std::min(found[0].duration_s, most_s);
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) scenario.masses[i].motion = found[0].motion[i];
}

}  // namespace

ContactRun random_desk_ball(std::uint64_t seed, const DeskBall& kind) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> part;
  std::vector<std::string> set{"sensors.preset=bmi088_calibrated", "run.hold=5", "run.on_violation=continue"}, faults;
  set.push_back("seed=" + std::to_string(seed));
  const double friction = 0.001 * std::pow(12, part(random)), at_s = 0.3 + 8 * part(random);
  const double peak = 0.8 * (0.6 + 0.6 * part(random));
  const std::array<std::array<double, 2>, 5> motion{{{0, peak}, {peak, 0}, {0, 0}, {0, -peak}, {-peak, 0}}};
  for (std::size_t mass = 0; mass < 2; ++mass) {
    for (std::size_t k = 0; k < motion.size(); ++k) {
      set.push_back(fmt::format("mass.{}.motion.{}.acceleration=[{:.6f},{:.6f}]", mass, k, motion[k][0], motion[k][1]));
    }
  }
  // A flag ends a run whose attitude is estimated, and a slide must go on.
  if (!kind.tracked || kind.falls) set.emplace_back("sensors.attitude=sensed");
  const double most_s = kind.falls ? at_s + 4 : std::numeric_limits<double>::infinity();
  if (kind.falls) {
    faults.push_back(fmt::format("friction_falls@{:.6f}:value={:.6f}", at_s, friction));
    set.push_back(fmt::format("duration={:.3f}", std::min(10.0, most_s)));
  }
  sim::Scenario scenario = read_contact("desk_ball", set, faults);
  if (kind.excited) excite(seed, most_s, scenario);
  if (kind.tracked) {
    scenario.plan.present = scenario.control.tracking = scenario.control.governor = true;
    scenario.plan.start = scenario.initial;
  }
  return record_contact(kind.errors.none() ? scenario : built(scenario, kind.errors, random));
}

}  // namespace ballast::test
