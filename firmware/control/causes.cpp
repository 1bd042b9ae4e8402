#include <cmath>

#include "firmware/control/parts.h"

namespace ballast::firmware {

namespace {

bool stale(std::int64_t sample_tick, std::int64_t tick, int limit_ticks) {
  // Unsigned: the age of a message that never came does not fit the signed type, and that of a sample from the future
  // wraps to a huge one.
  const std::uint64_t age = static_cast<std::uint64_t>(tick) - static_cast<std::uint64_t>(sample_tick);
  return age > static_cast<std::uint64_t>(limit_ticks);
}

Real length(const Quaternion& q) { return std::sqrt(q.w() * q.w() + q.x() * q.x() + q.y() * q.y() + q.z() * q.z()); }

// True if some mass closes the switch at an end of its rail and is commanded on over that end. A mass that rests there,
// or leaves it, is no fault.
bool driven_over_an_end(const Sensors& sensors, const MassMotion& commanded, int count) {
  for (int i = 0; i < count; ++i) {
    const unsigned switches = sensors.limit_switch[at(i)];
    const Wide velocity = commanded.velocity[at(i)];
    if (((switches & 1u) != 0 && velocity < 0) || ((switches & 2u) != 0 && velocity > 0)) return true;
  }
  return false;
}

}  // namespace

Order order_of(const ControllerState& state, std::int64_t tick) {
  if (!state.ticked) return Order::kInOrder;
  if (tick == state.last_tick) return Order::kRepeated;
  return tick > state.last_tick && tick - 1 == state.last_tick ? Order::kInOrder : Order::kBroken;
}

bool possible(Real value) {
  constexpr Real kGreatest = 0x1p50;
  return std::fabs(value) <= kGreatest;
}

bool possible(const Vector3& v) { return possible(v[0]) && possible(v[1]) && possible(v[2]); }

bool is_rotation(const Quaternion& q) { return std::fabs(length(q) - 1) <= static_cast<Real>(1e-3); }

bool valid(const ControllerParams& params, const Sensors& s) {
  for (const Wide encoder : s.encoder) {
    if (!std::isfinite(encoder)) return false;
  }
  if (!std::isfinite(s.fix_W_m[0]) || !std::isfinite(s.fix_W_m[1])) return false;
  if (!possible(s.gyro_B_radps) || !possible(s.accelerometer_B_mps2)) return false;
  return params.estimation.estimated || (s.attitude_valid && is_rotation(s.orientation));
}

Quaternion attitude(const Sensors& sensors) {
  const Quaternion& q = sensors.orientation;
  const Real norm = length(q);
  return {q.w() / norm, q.x() / norm, q.y() / norm, q.z() / norm};
}

std::uint32_t causes_of(const ControllerParams& params, const ControllerState& state, const Inputs& inputs,
                        Order order) {
  std::uint32_t causes = 0;
  if (order != Order::kInOrder) causes |= bit(Fault::kTickOutOfOrder);
  if (!valid(params, inputs.sensors)) causes |= bit(Fault::kSensorNotFinite);
  if (stale(inputs.sensors.tick, inputs.tick, params.sensor_stale_ticks)) causes |= bit(Fault::kSensorStale);
  if (stale(inputs.monitor.tick, inputs.tick, params.monitor_stale_ticks)) causes |= bit(Fault::kMonitorStale);
  if (inputs.monitor.tripped) causes |= bit(Fault::kMonitorTrip);
  if (driven_over_an_end(inputs.sensors, state.now, params.ball.mass_count)) causes |= bit(Fault::kEndSwitch);
  // Slip and light contact are acted on where motion can cause them. Without an estimate the robot cannot be armed
  // (Refusal::kNoEstimate), so its absence is a fault only after that.
  const bool moves =
      state.mode == Mode::kRunning || state.mode == Mode::kMoving || (state.mode == Mode::kHalting && state.moving);
  if (moves && state.measured.slip_detected) causes |= bit(Fault::kSlipMeasured);
  if (moves && state.measured.light_detected) causes |= bit(Fault::kLightMeasured);
  const bool armed = state.mode != Mode::kDisarmed;
  if (armed && params.estimation.estimated && !ball_motion(params, state, inputs.sensors).known) {
    causes |= bit(Fault::kNoEstimate);
  }
  return causes;
}

}  // namespace ballast::firmware
