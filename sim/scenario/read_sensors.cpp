#include "sim/scenario/read_sensors.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "sim/sensors/imu_presets.h"
#include "sim/sensors/sensors.h"

namespace ballast::sim {

namespace {

const ImuPreset* read_preset(TableReader& table) {
  table.know({"preset"});
  if (!table.has("preset")) return nullptr;
  std::vector<std::string_view> names;
  for (const ImuPreset& known : imu_presets()) names.push_back(known.name);
  const auto place = table.choice("preset", names);
  return place ? &imu_presets()[*place] : nullptr;
}

// `unit`: of a reading.
ImuTriad read_triad(TableReader& table, const std::string& unit, const ImuTriad& preset) {
  ImuTriad triad = preset;
  const auto read = [&table](std::string_view key, const std::string& in, double& value) {
    value = table.number(key, Range::non_negative(in), value).value_or(value);
  };
  read("noise_density", unit + "/sqrt(Hz)", triad.noise_density);
  read("bias", unit, triad.bias);
  read("bias_walk", unit + "/sqrt(s)", triad.bias_walk);
  read("scale_error", "", triad.scale_error);
  read("misalignment", "rad", triad.misalignment_rad);
  read("range", unit, triad.range);
  read("resolution", unit, triad.resolution);
  if (triad.range > 0 && triad.resolution > triad.range) {
    table.refuse("resolution", "is coarser than the range; allowed: at most range = {} {}", triad.range, unit);
  }
  return triad;
}

// A sample is taken at a control tick. A rate that gives none is reported and leaves 0.
double read_rate(TableReader& table, std::optional<double> control_period_s, std::optional<double> fallback) {
  const double rate_hz = table.number("rate", Range::positive("Hz"), fallback).value_or(0);
  if (rate_hz <= 0 || !control_period_s || ticks_per_sample(rate_hz, *control_period_s) > 0) return rate_hz;
  const double tick_rate_hz = 1 / *control_period_s, ticks = std::max(1.0, std::ceil(tick_rate_hz / rate_hz - 1e-9));
  table.refuse("rate",
               "does not divide the tick rate of {} Hz (1 / run.control_period); allowed: that rate over a "
               "whole number, as {} Hz = {} / {}",
               tick_rate_hz, tick_rate_hz / ticks, tick_rate_hz, ticks);
  return 0;
}

// check_scenario() refuses one by which no sample would arrive within the run.
double read_delay(TableReader& table, std::string_view key) {
  return table.number(key, Range::between(0, 10, "s"), 0.0).value_or(0);
}

PositionFix read_fix(TableReader table, std::optional<double> control_period_s) {
  PositionFix fix;
  if (!table.present()) return fix;
  fix.rate_hz = read_rate(table, control_period_s, std::nullopt);
  fix.noise_m = table.number("noise", Range::non_negative("m"), 0.0).value_or(0);
  fix.delay_s = read_delay(table, "delay");
  table.refuse_unknown_keys();
  return fix;
}

std::vector<double> read_encoder(TableReader table, int mass_count) {
  const auto masses = static_cast<std::size_t>(mass_count);
  if (!table.present()) return {};
  const Range range = Range::non_negative("rad or m");
  const Node* written = table.node("resolution");
  std::vector<double> resolution;
  if (written != nullptr && written->kind == NodeKind::kArray) {
    resolution = table.list("resolution", masses, masses, range).value_or(resolution);
  } else if (const auto one = table.number("resolution", range)) {
    resolution.assign(masses, *one);
  }
  table.refuse_unknown_keys();
  return resolution;
}

}  // namespace

SensorModel read_sensors(TableReader table, std::optional<double> control_period_s, int mass_count) {
  SensorModel sensors;
  sensors.present = table.present();
  if (!sensors.present) return sensors;
  const ImuPreset* preset = read_preset(table);
  if (preset != nullptr) {
    sensors.preset = preset->name;
    sensors.gyro = preset->gyro;
    sensors.accelerometer = preset->accelerometer;
  }
  sensors.attitude_estimated = table.choice<bool>("attitude", {"sensed", "estimated"}, true).value_or(false);
  sensors.rate_hz = read_rate(table, control_period_s, 1 / control_period_s.value_or(1));
  sensors.latency_s = read_delay(table, "latency");
  TableReader gyro = table.table("gyro");
  sensors.gyro = read_triad(gyro, "rad/s", sensors.gyro);
  gyro.refuse_unknown_keys();
  TableReader accelerometer = table.table("accelerometer");
  sensors.accelerometer = read_triad(accelerometer, "m/s^2", sensors.accelerometer);
  sensors.accelerometer_position_B_m =
      accelerometer.vector_or_zero<3>("position", Range::any("m")).value_or(sensors.accelerometer_position_B_m);
  accelerometer.refuse_unknown_keys();
  sensors.fix = read_fix(table.table("position_fix"), control_period_s);
  sensors.encoder_resolution = read_encoder(table.table("encoder"), mass_count);
  table.refuse_unknown_keys();
  return sensors;
}

}  // namespace ballast::sim
