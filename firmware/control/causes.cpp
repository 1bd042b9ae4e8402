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

// Greatest number of a sensor: 1e15, that of a scenario, as a power of 2 that is exact in single precision too. Forces
// from greater rates may overflow, and could then neither be judged nor compared.
constexpr Real kGreatest = 0x1p50;

bool possible(const Vector3& v) {
  return std::fabs(v[0]) <= kGreatest && std::fabs(v[1]) <= kGreatest && std::fabs(v[2]) <= kGreatest;
}

Real length(const Quaternion& q) { return std::sqrt(q.w() * q.w() + q.x() * q.x() + q.y() * q.y() + q.z() * q.z()); }

// Tolerance of the attitude's length. A valid attitude is normalised before use, so this only tells it from garbage:
// rounding, in single precision too, stays a thousand times below it, and a lost or broken component is far above. NaN
// and infinity fail the comparison.
constexpr auto kLengthTolerance = static_cast<Real>(1e-3);

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

bool valid(const Sensors& s) {
  for (const Wide encoder : s.encoder) {
    if (!std::isfinite(encoder)) return false;
  }
  if (!std::isfinite(s.fix_W_m[0]) || !std::isfinite(s.fix_W_m[1])) return false;
  return std::fabs(length(s.orientation) - 1) <= kLengthTolerance && possible(s.gyro_B_radps) &&
         possible(s.accelerometer_B_mps2);
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
  if (!valid(inputs.sensors)) causes |= bit(Fault::kSensorNotFinite);
  if (stale(inputs.sensors.tick, inputs.tick, params.sensor_stale_ticks)) causes |= bit(Fault::kSensorStale);
  if (stale(inputs.monitor.tick, inputs.tick, params.monitor_stale_ticks)) causes |= bit(Fault::kMonitorStale);
  if (inputs.monitor.tripped) causes |= bit(Fault::kMonitorTrip);
  if (driven_over_an_end(inputs.sensors, state.now, params.ball.mass_count)) causes |= bit(Fault::kEndSwitch);
  return causes;
}

}  // namespace ballast::firmware
