#include "tools/identify/recording.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <utility>

#include "hal/lcm/channels.h"
#include "sim/sensors/sensors.h"
#include "tools/program/params.h"
#include "tools/recording/log_reader.h"
#include "tools/recording/replay.h"

namespace ballast::identify {

namespace fs = std::filesystem;

namespace {

// Full steps by which an encoder may differ from the commanded position: half a tooth pitch is two, and a rotor further
// off slips into another tooth.
constexpr double kStepsOff = 2;

// sqrt(r / g) within which slip, a light ball or a lost step is found: windows of up to 0.6 s on desk_ball
// (measured_contact.md).
constexpr double kFoundAfter = 5;

Eigen::Vector3d three(const double* v) { return {v[0], v[1], v[2]}; }

}  // namespace

std::string know(const sim::Scenario& scenario, Known& known) {
  const sim::World& belief = scenario.belief();
  if (!sim::has_controller(scenario.run.actuation))
    return "run.actuation: a prescribed run has no controller that commands masses; allowed: stepper, ideal";
  if (!scenario.sensors.present)
    return "sensors: there is no IMU whose noise is known; give the scenario a table [sensors], e.g. "
           "sensors.preset=bmi088_calibrated";
  if (scenario.masses.empty()) return "mass: there is none, and nothing else excites the ball";
  if (!(scenario.gravity_mps2 > 0)) return "gravity: is 0; what masses and their centre weigh cannot be told";
  if (!belief.force_table.times_s.empty()) return "external_force: changes with time; allowed: a constant force";
  if (belief.drag.coefficient_kgpm > 0) return "drag: is not in the model; allowed: none";
  Known out;
  out.belief = belief;
  if (const auto why = program::to_ball_params(belief, out.robot.ball)) return *why;
  out.robot.ball.creep_radps = belief.creep_radps();  // where no resistance is believed there may be some
  out.scale_mass_kg = scenario.ball.mass_kg;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    out.robot.reflected_inertia[i] = belief.masses[i].motor.rail_inertia();
    out.scale_mass_kg += scenario.masses[i].mass_kg;
  }
  out.sensors = scenario.sensors;
  out.control_period_s = scenario.run.control_period_s;
  out.steppers = scenario.run.actuation == sim::Actuation::kStepper;
  out.hold_ticks = scenario.run.hold_ticks();
  const sim::InitialState& start = scenario.plan.start ? *scenario.plan.start : scenario.initial;
  out.start = start.orientation;
  out.start_W_m = start.position_W_m;
  known = std::move(out);
  return "";
}

Collector::Collector(const Known& known) { out_.known = known; }

void Collector::cut(const std::string& why) {
  if (out_.cut.empty()) out_.cut = why;
}

void Collector::take_sample(const sensors_t& sensors) {
  if (sensors.imu_count == samples_) return;
  samples_ = sensors.imu_count;
  const ImuSample sample{sensors.imu_tick, three(sensors.gyro_B_radps), three(sensors.accelerometer_B_mps2)};
  if (!sample.gyro_B_radps.allFinite() || !sample.accelerometer_B_mps2.allFinite()) return;
  if (sample.tick >= 0) {
    out_.imu.push_back(sample);
    return;
  }
  if (sample.tick < -out_.known.hold_ticks) return;
  Held& held = out_.held;
  ++held.samples;
  held.gyro_B_radps += (sample.gyro_B_radps - held.gyro_B_radps) / held.samples;
  held.accelerometer_B_mps2 += (sample.accelerometer_B_mps2 - held.accelerometer_B_mps2) / held.samples;
}

void Collector::take(const sensors_t& sensors) {
  if (is_cut()) return;
  if (sensors_ && sensors.tick != sensors_->tick + 1) {
    cut(fmt::format("sensors of tick {} follow those of tick {}", sensors.tick, sensors_->tick));
    return;
  }
  take_sample(sensors);
  if (sensors.fix_count != fixes_) {
    fixes_ = sensors.fix_count;
    const Eigen::Vector2d place_W_m(sensors.fix_W_m[0], sensors.fix_W_m[1]);
    if (sensors.fix_tick >= 0 && place_W_m.allFinite()) out_.fixes.push_back({sensors.fix_tick, place_W_m});
  }
  sensors_ = sensors;
}

void Collector::check_encoders(const controller_status_t& status) {
  if (!sensors_ || sensors_->has_encoders == 0 || sensors_->tick != status.tick) return;
  const auto& resolution = out_.known.sensors.encoder_resolution;
  for (std::size_t i = 0; i < resolution.size(); ++i) {
    const sim::Motor& motor = out_.known.belief.masses[i].motor;
    const double step = motor.microsteps / motor.microsteps_per_rail_unit();
    const double off = std::abs(sensors_->encoder[i] - status.commanded_position[i]);
    if (out_.known.steppers && resolution[i] > 0 && off > resolution[i] + kStepsOff * step)
      cut(fmt::format("mass {} is {:.3g} full steps off its command by its encoder", i, off / step));
  }
}

void Collector::take(const controller_status_t& status) {
  if (is_cut() || status.tick < -1) return;
  const auto n = static_cast<std::size_t>(out_.known.robot.ball.mass_count);
  if (status_ && status.tick != status_->tick + 1) {
    cut(fmt::format("the controller's status of tick {} follows that of tick {}", status.tick, status_->tick));
    return;
  }
  if (!status_ && status.tick > 0) {
    cut(fmt::format("the controller's first status is that of tick {}", status.tick));
    return;
  }
  check_encoders(status);
  if (status.slip_detected != 0) cut("the controller has measured slip");
  if (status.light_detected != 0) cut("the controller has measured that the floor hardly carries the ball");
  if (status.mode == controller_status_t::MODE_TRIPPED || status.faults != 0) cut("the controller has tripped");
  if (is_cut()) {
    // A fault begins before it is found.
    const firmware::BallParams& ball = out_.known.robot.ball;
    const double before_s = kFoundAfter * std::sqrt(ball.radius_m / ball.gravity_mps2);
    const auto ticks = static_cast<std::size_t>(std::ceil(before_s / out_.known.control_period_s));
    out_.commanded.resize(out_.commanded.size() - std::min(ticks, out_.commanded.size()));
    return;
  }
  firmware::MassMotion motion;
  for (std::size_t i = 0; i < n; ++i) {
    motion.position[i] = status.commanded_position[i];
    motion.velocity[i] = status.commanded_velocity[i];
    motion.acceleration[i] = status_ ? status_->next_acceleration[i] : 0;
    if (!std::isfinite(motion.position[i]) || !std::isfinite(motion.velocity[i]) ||
        !std::isfinite(motion.acceleration[i])) {
      cut("a commanded position is no number");
    }
  }
  if (is_cut()) return;
  if (status.tick >= 0) out_.commanded.push_back(motion);
  status_ = status;
}

Recording Collector::finish() && {
  const auto last = static_cast<std::int64_t>(out_.commanded.size()) - 1;
  std::erase_if(out_.imu, [last](const ImuSample& sample) { return sample.tick > last; });
  std::erase_if(out_.fixes, [last](const FixSample& fix) { return fix.tick > last; });
  return std::move(out_);
}

namespace {

ReadRun trouble(const std::string& why, bool usage = false) { return {std::nullopt, why, usage}; }

// The scenario that a run has left beside its log, of that log.
std::string read_known(const fs::path& folder, const fs::path& log, Known& known, bool& usage) {
  const fs::path file = folder / "scenario.toml";
  std::error_code code;
  usage = true;
  if (!fs::exists(file, code)) return file.string() + ": no such file; a run leaves it beside its log";
  const sim::ScenarioResult read = sim::read_scenario(file);
  if (!read.ok()) return sim::to_string(read.errors.front());
  usage = false;
  const sil::LogScenario of_log = sil::scenario_of_log(log.string());
  if (!of_log.id) return of_log.trouble;
  usage = true;
  if (*of_log.id != read.scenario.id)
    return fmt::format("{} is of another scenario than {}", log.string(), file.string());
  if (const std::string why = know(read.scenario, known); !why.empty()) return file.string() + ": " + why;
  return "";
}

}  // namespace

ReadRun read_run(const std::string& folder) {
  std::error_code code;
  if (!fs::is_directory(folder, code)) return trouble(folder + ": no folder of a run", true);
  const fs::path log = fs::path(folder) / "run.lcmlog";
  Known known;
  bool usage = false;
  if (const std::string why = read_known(folder, log, known, usage); !why.empty()) return trouble(why, usage);
  sil::LogReader reader(log.string());
  if (!reader.error().empty()) return trouble(reader.error());
  Collector collector(known);
  for (sil::LogEvent event; !collector.is_cut() && reader.next(event);) {
    const auto undecoded = [&] { collector.cut(event.channel + ": a message is damaged"); };
    if (event.channel == hal::kChannelSensors) {
      sensors_t message{};
      hal::decode(event.data.data(), event.data.size(), message) ? collector.take(message) : undecoded();
    } else if (event.channel == hal::kChannelControllerStatus) {
      controller_status_t message{};
      hal::decode(event.data.data(), event.data.size(), message) ? collector.take(message) : undecoded();
    }
  }
  if (!reader.damage().empty()) collector.cut("the log is " + reader.damage());
  Recording recording = std::move(collector).finish();
  recording.name = folder;
  return {std::move(recording), "", false};
}

std::string other_geometry(const firmware::BallParams& a, const firmware::BallParams& b) {
  if (a.mass_count != b.mass_count) return fmt::format("{} masses and {}", a.mass_count, b.mass_count);
  if (a.radius_m != b.radius_m) return fmt::format("radius {} and {} m", a.radius_m, b.radius_m);
  for (std::size_t i = 0; i < static_cast<std::size_t>(a.mass_count); ++i) {
    const firmware::Rail &p = a.rail[i], &q = b.rail[i];
    const auto point = [](const firmware::Rail& rail, double theta) {
      return firmware::evaluate<double>(rail, theta).position;
    };
    if (p.shape != q.shape || point(p, 0) != point(q, 0) || point(p, 0.1) != point(q, 0.1))
      return fmt::format("another rail of mass {}", i);
  }
  return "";
}

std::string other_robot(const Known& a, const Known& b) {
  const firmware::BallParams &x = a.robot.ball, &y = b.robot.ball;
  if (const std::string why = other_geometry(x, y); !why.empty()) return why;
  if (x.gravity_mps2 != y.gravity_mps2) return fmt::format("gravity {} and {}", x.gravity_mps2, y.gravity_mps2);
  if (a.scale_mass_kg != b.scale_mass_kg)
    return fmt::format("total mass {:.9g} and {:.9g} kg", a.scale_mass_kg, b.scale_mass_kg);
  if (x.shell_mass_kg != y.shell_mass_kg || x.inertia_kgm2 != y.inertia_kgm2 ||
      x.center_of_mass_B_m != y.center_of_mass_B_m || x.rolling_resistance != y.rolling_resistance) {
    return "another ball or floor is believed";
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(x.mass_count); ++i) {
    if (x.mass_kg[i] != y.mass_kg[i]) return fmt::format("another mass {} is believed", i);
  }
  return "";
}

}  // namespace ballast::identify
