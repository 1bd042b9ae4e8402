#include "tools/monitor/monitor.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "hal/lcm/channels.h"

namespace ballast::monitor {
namespace {

template <std::size_t n>
bool finite(const double (&values)[n], std::size_t count = n) {
  return std::all_of(values, values + std::min(count, n), [](double value) { return std::isfinite(value); });
}

bool finite(const contact_t& contact) {
  return std::isfinite(contact.time_s) && std::isfinite(contact.normal_force_n) &&
         std::isfinite(contact.normal_force_min_n) &&
         (std::isfinite(contact.mu_required_max) || contact.mu_required_max > 0) &&
         std::isfinite(contact.static_friction_n) && finite(contact.friction_force_W_n) &&
         (std::isfinite(contact.mu_required) || contact.mu_required > 0);
}

bool finite(const plant_state_t& state) {
  const auto count = static_cast<std::size_t>(std::max<int>(state.mass_count, 0));
  for (std::size_t i = 0; i < std::min(count, std::size(state.mass_position_B_m)); ++i) {
    if (!finite(state.mass_position_B_m[i])) return false;
  }
  return std::isfinite(state.time_s) && finite(state.orientation) && finite(state.angular_velocity_B_radps) &&
         finite(state.position_W_m) && finite(state.velocity_W_mps) && finite(state.center_of_mass_B_m) &&
         finite(state.mass_position, count) && finite(state.mass_velocity, count) &&
         finite(state.motor_torque_nm, count);
}

bool finite(const sensors_t& sensors) {
  return finite(sensors.orientation) && finite(sensors.gyro_B_radps) && finite(sensors.accelerometer_B_mps2) &&
         finite(sensors.encoder) && finite(sensors.fix_W_m);
}

// Tolerance on the margin: a few roundings of O(1) values.
constexpr double kRounding = 1e-12;

// The f_s that a message's margin hides, in N: f_s itself less the f_s that the margin stands for. -infinity where the
// margin hides nothing. `cone_n`: mu_s N.
double hidden_friction_n(const contact_t& contact, double cone_n) {
  // A margin of -1 stands for anything worse too.
  if (!std::isfinite(cone_n) || cone_n <= 0 || contact.margin <= -1) return -std::numeric_limits<double>::infinity();
  if (std::isnan(contact.margin)) return contact.static_friction_n + cone_n;  // the most that a margin can hide
  return contact.static_friction_n - (1 - contact.margin) * cone_n;
}

}  // namespace

Monitor::Monitor(const MonitorLimits& limits) : limits_(limits), has_rolled_(limits.starts_rolling) {
  if (limits_.margin_friction == 0) limits_.margin_friction = limits_.static_friction;
  verdict_.tick = hal::kWaitingTick;
  verdict_.scenario_id = limits_.scenario_id;
}

std::int64_t Monitor::due_tick() const { return last_tick_ ? *last_tick_ + 1 : limits_.first_tick; }

void Monitor::trip(std::int8_t cause, double value, double limit) {
  if (verdict_.tripped == 1) return;
  verdict_.tripped = 1;
  verdict_.cause = cause;
  verdict_.trip_tick = verdict_.tick;
  verdict_.trip_time_s = time_s_;
  verdict_.value = value;
  verdict_.limit = limit;
}

trip_t Monitor::judge(const Samples& samples) {
  const contact_t* contact = samples.contact;
  const plant_state_t* state = samples.plant_state;
  const sensors_t* sensors = samples.sensors;

  // The contact names the tick; without it the plant state or the sensors do; without any it is the tick expected. A
  // time that is no number leaves the latest that was one.
  std::int64_t tick = due_tick();
  const auto take_time = [this](double time_s) { time_s_ = std::isfinite(time_s) ? time_s : time_s_; };
  if (contact != nullptr) {
    tick = contact->tick;
    take_time(contact->time_s);
    verdict_.utime = contact->utime;
  } else if (state != nullptr) {
    tick = state->tick;
    take_time(state->time_s);
    verdict_.utime = state->utime;
  } else if (sensors != nullptr) {
    tick = sensors->tick;
    verdict_.utime = sensors->utime;
  }
  const bool first = !last_tick_;
  const std::int64_t expected = first ? tick : *last_tick_ + 1;
  const auto tick_instead = [&](const auto* message) {
    return static_cast<double>(message != nullptr ? message->tick : expected - 1);
  };

  verdict_.tick = tick;
  if (tick < expected) {
    trip(trip_t::CAUSE_REPEATED, static_cast<double>(tick), static_cast<double>(expected));
  } else if (tick > expected) {
    trip(trip_t::CAUSE_MISSING, static_cast<double>(tick), static_cast<double>(expected));
  } else if (contact == nullptr) {
    trip(trip_t::CAUSE_MISSING, tick_instead(contact), static_cast<double>(expected));
  } else if (state == nullptr || state->tick != tick) {
    trip(trip_t::CAUSE_MISSING, tick_instead(state), static_cast<double>(expected));
  } else if (sensors == nullptr || sensors->tick != tick) {
    trip(trip_t::CAUSE_MISSING, tick_instead(sensors), static_cast<double>(expected));
  } else if (!finite(*contact) || !finite(*state) || !finite(*sensors)) {
    trip(trip_t::CAUSE_NONFINITE, 0, 0);
  } else {
    judge_envelope(samples);
    if (limits_.controller_expected) {
      const std::int64_t if_never = first ? tick : tick - kAllowedControllerAge - 1;
      const std::int64_t heard = samples.status != nullptr ? samples.status->tick : if_never;
      const std::int64_t age = tick - heard;
      if (age < 0 || (age > kAllowedControllerAge && !first)) {
        trip(trip_t::CAUSE_STALE, static_cast<double>(age), static_cast<double>(kAllowedControllerAge));
      }
    }
    judge_agreement(samples);
  }
  last_tick_ = first ? tick : std::max(*last_tick_, tick);
  return verdict_;
}

void Monitor::judge_envelope(const Samples& samples) {
  const contact_t& contact = *samples.contact;
  const double least_n = std::min(contact.normal_force_n, contact.normal_force_min_n);
  if (least_n <= limits_.min_normal_force_n) {
    trip(trip_t::CAUSE_NORMAL_FORCE, least_n, limits_.min_normal_force_n);
  }
  const double mu_allowed = limits_.friction_use * limits_.static_friction;
  const bool slipped = has_rolled_ && contact.regime == contact_t::REGIME_SLIDING;
  has_rolled_ = has_rolled_ || contact.regime == contact_t::REGIME_ROLLING;
  // With perfect friction no force is too much, and infinity times N = 0 would be a NaN. The ball can still slip if the
  // floor is not what it should be.
  const bool too_much =
      !std::isinf(limits_.static_friction) &&
      (contact.static_friction_n > mu_allowed * contact.normal_force_n || contact.mu_required_max > mu_allowed);
  if (slipped || too_much) {
    const double now = contact.static_friction_n / contact.normal_force_n;
    trip(trip_t::CAUSE_FRICTION, std::max(now, contact.mu_required_max), mu_allowed);
  }
}

bool Monitor::Forces::known() const { return std::isfinite(normal_n) && std::isfinite(static_friction_n); }

void Monitor::judge_forces(const controller_status_t* status) {
  const bool of_one_instant = commanded_ && status != nullptr && status->tick == commanded_->tick;
  // A plant whose floor would have to pull says 0, which is no number to compare with.
  if (!of_one_instant || !commanded_->known() || !(commanded_->normal_n > 0)) return;
  const Forces own{status->tick, status->normal_force_n, status->static_friction_n};
  const double apart_n = std::max(std::abs(commanded_->normal_n - own.normal_n),
                                  std::abs(commanded_->static_friction_n - own.static_friction_n));
  if (own.known() && apart_n > limits_.disagreement_n) {
    trip(trip_t::CAUSE_DISAGREEMENT, apart_n, limits_.disagreement_n);
  }
}

void Monitor::judge_agreement(const Samples& samples) {
  const contact_t& contact = *samples.contact;
  judge_forces(samples.status);
  commanded_.reset();
  if (contact.regime == contact_t::REGIME_ROLLING) {
    commanded_ = Forces{contact.commanded_tick, contact.commanded_normal_force_n, contact.commanded_static_friction_n};
  }
  // Forces that answer a status already heard are judged now.
  if (contact.commanded_tick != contact.tick) judge_forces(samples.status);
  const double cone_n = limits_.margin_friction * contact.normal_force_n;
  if (const double hidden_n = hidden_friction_n(contact, cone_n); hidden_n > kRounding * cone_n) {
    trip(trip_t::CAUSE_DISAGREEMENT, hidden_n, kRounding * cone_n);
  }
  if (contact.regime == contact_t::REGIME_ROLLING) {
    const double force_n = std::hypot(contact.friction_force_W_n[0], contact.friction_force_W_n[1]);
    const double apart_n = std::abs(force_n - contact.static_friction_n);
    const double rounding_n = limits_.turned_part * (force_n + std::abs(contact.normal_force_n));
    if (apart_n > rounding_n) trip(trip_t::CAUSE_DISAGREEMENT, apart_n, rounding_n);
  }
}

trip_t Monitor::silence(double silent_ticks, double allowed_ticks) {
  verdict_.tick = due_tick();
  trip(trip_t::CAUSE_STALE, silent_ticks, allowed_ticks);
  return verdict_;
}

}  // namespace ballast::monitor
