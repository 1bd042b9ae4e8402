#include "tools/watch/view.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "hal/lcm/channels.h"
#include "tools/program/short_number.h"

namespace ballast::watch {

namespace {

using program::fixed_number;
using program::short_number;

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kRateWindow_s = 1;
constexpr double kSilence_s = 2;  // longer than a tick of any useful pace

const char* regime(std::int8_t code) {
  constexpr const char* kNames[] = {"rolling", "sliding", "flight"};
  return kNames[code];  // in_range() has checked it
}

const char* mode(std::int8_t code) {
  constexpr const char* kNames[] = {"disarmed", "armed", "running", "stopping", "tripped", "moving", "pending"};
  return kNames[code];
}

const char* cause(std::int8_t code) {
  constexpr const char* kNames[] = {"none",  "normal_force", "friction", "nonfinite",
                                    "stale", "missing",      "repeated", "disagreement"};
  return kNames[code];
}

// A bar that is filled to `fraction`, limited to 0 to 1. NaN is 0.
std::string bar(double fraction, int width) {
  const double shown = fraction > 0 ? std::min(fraction, 1.0) : 0;
  std::string text = "[]";
  text.insert(1, static_cast<std::size_t>(width), '.');
  std::fill_n(text.begin() + 1, std::lround(shown * width), '#');
  return text;
}

std::string cut(std::string line, int width) {
  if (static_cast<int>(line.size()) > width) line.resize(static_cast<std::size_t>(std::max(width, 0)));
  return line + "\n";
}

}  // namespace

void TickCounter::add(std::int64_t tick, double now_s) {
  if (!newest_ || tick < *newest_ - kLate) {
    *this = TickCounter();
    window_start_s_ = now_s;
  } else if (tick > *newest_) {
    missed_ += tick - *newest_ - 1;
  } else {
    missed_ = std::max<std::int64_t>(missed_ - 1, 0);  // a late message was counted as missing
  }
  newest_ = std::max(tick, newest_.value_or(tick));
  ++count_;
  ++window_count_;
  latest_s_ = now_s;
  if (now_s - window_start_s_ >= kRateWindow_s) {
    rate_hz_ = static_cast<double>(window_count_) / (now_s - window_start_s_);
    window_start_s_ = now_s;
    window_count_ = 0;
  }
}

double TickCounter::rate_hz(double now_s) const {
  if (now_s - latest_s_ > kSilence_s) return 0;
  if (rate_hz_ > 0) return rate_hz_;
  return now_s > window_start_s_ ? static_cast<double>(window_count_) / (now_s - window_start_s_) : 0;
}

// Forgets the extremes of the run before.
void View::restart_if_new_run(std::int64_t tick) {
  if (!contact_ || (tick >= contact_->tick - TickCounter::kLate && !ended_)) return;
  const auto run_id = run_id_;
  *this = View();
  run_id_ = run_id;
}

// Whether a message belongs to the shown run. Another run is shown once that one is over.
bool View::is_shown(std::int64_t run_id, double now_s) {
  if (run_id_ && run_id != *run_id_) {
    if (!is_over(now_s)) {
      another_run_s_ = now_s;
      return false;
    }
    *this = View();
  }
  run_id_ = run_id;
  latest_s_ = now_s;
  return true;
}

bool View::is_over(double now_s) const { return !run_id_ || ended_ || now_s - latest_s_ > kSilence_s; }

bool View::has_another_run(double now_s) const { return another_run_s_ && now_s - *another_run_s_ <= kSilence_s; }

std::optional<double> View::silent_s(double now_s) const {
  if (!run_id_ || ended_ || now_s - latest_s_ <= kSilence_s) return std::nullopt;
  return now_s - latest_s_;
}

void View::observe(const contact_t& m, double now_s) {
  if (!is_shown(m.run_id, now_s)) return;
  restart_if_new_run(m.tick);
  latest_s_ = now_s;
  if (!contact_) normal_force_min_n_ = m.normal_force_n;
  contact_ = m;
  counters_[kContact].add(m.tick, now_s);
  if (m.regime != contact_t::REGIME_FLIGHT) margin_min_ = std::fmin(margin_min_, m.margin);
  mu_required_max_ = std::fmax(mu_required_max_, m.mu_required_max);
  normal_force_min_n_ = std::fmin(normal_force_min_n_, std::fmin(m.normal_force_n, m.normal_force_min_n));
  normal_force_max_n_ = std::fmax(normal_force_max_n_, m.normal_force_n);
  ended_ = m.last == 1;
}

void View::observe(const plant_state_t& m, double now_s) {
  if (!is_shown(m.run_id, now_s)) return;
  state_ = m;
  counters_[kState].add(m.tick, now_s);
}

void View::observe(const sensors_t& m, double now_s) {
  if (is_shown(m.run_id, now_s)) counters_[kSensors].add(m.tick, now_s);
}

// Peers that wait for their first tick repeat a message with kWaitingTick, which belongs to no run.
void View::observe(const controller_status_t& m, double now_s) {
  const bool waits = m.tick == hal::kWaitingTick;
  if (waits ? !is_over(now_s) : !is_shown(m.run_id, now_s)) return;
  status_ = m;
  if (!waits) counters_[kStatus].add(m.tick, now_s);
}

void View::observe(const step_command_t& m, double now_s) {
  if (is_shown(m.run_id, now_s)) counters_[kSteps].add(m.tick, now_s);
}

void View::observe(const trip_t& m, double now_s) {
  const bool waits = m.tick == hal::kWaitingTick;
  if (waits ? !is_over(now_s) : !is_shown(m.run_id, now_s)) return;
  trip_ = m;
  if (!waits) counters_[kTrip].add(m.tick, now_s);
}

std::string View::page(double now_s, int width, std::int64_t undecodable) const {
  std::string text;
  if (has_another_run(now_s))
    text += cut("ANOTHER RUN on this bus is not shown: each run needs a bus of its own", width);
  if (const auto silence_s = silent_s(now_s)) {
    text += cut(fmt::format("SILENT for {:.0f} s: the run is stopped, or has ended without a last message", *silence_s),
                width);
  }
  return text + contact_lines(width) + known_lines(width) + controller_lines(width) +
         rate_lines(now_s, width, undecodable);
}

std::string View::contact_lines(int width) const {
  if (!contact_) return cut("no plant yet", width);
  const int bar_width = std::clamp(width - 46, 10, 50);
  const contact_t& c = *contact_;
  return cut(fmt::format("t = {} s  tick {}  {}{}", fixed_number(c.time_s, 3), c.tick, regime(c.regime),
                         ended_ ? "  the run has ended" : ""),
             width) +
         cut(fmt::format("margin {} {:>6}  least {}", bar(c.margin, bar_width), fixed_number(c.margin, 3),
                         fixed_number(margin_min_, 3)),
             width) +
         cut(fmt::format("f_s/N  {} {:>6}  most  {}", bar(1 - c.margin, bar_width), fixed_number(c.mu_required, 3),
                         fixed_number(mu_required_max_, 3)),
             width) +
         cut(fmt::format("N      {} {:>6}  least {} N", bar(c.normal_force_n / normal_force_max_n_, bar_width),
                         short_number(c.normal_force_n), short_number(normal_force_min_n_)),
             width);
}

std::string View::known_lines(int width) const {
  if (!status_) return "";
  const controller_status_t& s = *status_;
  std::string text;
  if (s.measured_valid != 0) {
    text += cut(fmt::format("known  f_s/N {} +-{}, N {} +-{} N measured{}{}", fixed_number(s.measured_mu_required, 3),
                            fixed_number(2 * s.measured_mu_sigma, 3), short_number(s.measured_normal_force_n),
                            short_number(2 * s.measured_normal_sigma_n), s.slip_detected != 0 ? "  SLIP" : "",
                            s.light_detected != 0 ? "  LIGHT CONTACT" : ""),
                width);
  }
  if (s.estimate_valid != 0) {
    std::string off;
    if (state_ && state_->tick == s.tick) {
      off =
          fmt::format(", off by {} m", short_number(std::hypot(s.estimated_position_W_m[0] - state_->position_W_m[0],
                                                               s.estimated_position_W_m[1] - state_->position_W_m[1])));
    }
    text += cut(fmt::format("known  place ({}, {}) +-{} m{}, tilt +-{} deg, yaw +-{} deg",
                            fixed_number(s.estimated_position_W_m[0], 3), fixed_number(s.estimated_position_W_m[1], 3),
                            fixed_number(2 * s.position_sigma_m, 3), off, short_number(2 * kDegrees * s.tilt_sigma_rad),
                            short_number(2 * kDegrees * s.yaw_sigma_rad)),
                width);
  }
  return text;
}

std::string View::controller_lines(int width) const {
  std::string text;
  if (trip_ && trip_->tripped == 1) {
    const auto [value, limit] = program::apart(trip_->value, trip_->limit);
    text += cut(fmt::format("TRIP   {} at t = {} s: {}, limit {}", cause(trip_->cause),
                            program::short_time(trip_->trip_time_s), value, limit),
                width);
  } else {
    text += cut(trip_ ? "trip   none" : "trip   no monitor yet", width);
  }
  if (status_) {
    text += cut(fmt::format("mode   {}  faults {:#x}  overruns {}  messages refused {}{}", mode(status_->mode),
                            static_cast<std::uint32_t>(status_->faults), status_->overruns, status_->refused_messages,
                            status_->refusal != controller_status_t::REFUSAL_NONE ? "  a command was refused" : ""),
                width);
  } else {
    text += cut("mode   no controller yet", width);
  }
  if (!state_) return text;
  for (int i = 0; i < state_->mass_count; ++i) {
    text += cut(fmt::format("mass {} at {}, {} /s, torque {} N m, {} steps lost", i,
                            fixed_number(state_->mass_position[i], 3), fixed_number(state_->mass_velocity[i], 3),
                            short_number(state_->motor_torque_nm[i]), state_->lost_steps[i]),
                width);
  }
  return text;
}

std::string View::rate_lines(double now_s, int width, std::int64_t undecodable) const {
  constexpr const char* kNames[] = {"contact", "state", "sensors", "status", "steps", "trip"};
  std::string rates = "per s ", missed = "missed";
  for (int i = 0; i < kChannels; ++i) {
    const TickCounter& counter = counters_[static_cast<std::size_t>(i)];
    if (counter.count() == 0) continue;
    rates += fmt::format(" {} {:.0f}", kNames[i], counter.rate_hz(now_s));
    missed += fmt::format(" {} {}", kNames[i], counter.missed());
  }
  return cut(rates, width) + cut(fmt::format("{}  undecodable {}", missed, undecodable), width);
}

std::string View::line(double now_s, std::int64_t undecodable) const {
  std::string text;
  if (contact_) {
    text = fmt::format("t={} {} N={} f_s/N={} margin={} least={}", fixed_number(contact_->time_s, 3),
                       regime(contact_->regime), short_number(contact_->normal_force_n),
                       fixed_number(contact_->mu_required, 3), fixed_number(contact_->margin, 3),
                       fixed_number(margin_min_, 3));
  } else {
    text = "no plant yet";
  }
  const char* trip = !trip_ ? "no_monitor" : trip_->tripped == 1 ? cause(trip_->cause) : "none";
  if (status_ && status_->measured_valid != 0) {
    text += fmt::format(" measured={}{}{}", fixed_number(status_->measured_mu_required, 3),
                        status_->slip_detected != 0 ? " slip" : "", status_->light_detected != 0 ? " light" : "");
  }
  text += fmt::format(" mode={} trip={}", status_ ? mode(status_->mode) : "none", trip);
  std::int64_t missed = 0;
  for (const TickCounter& counter : counters_) missed += counter.missed();
  text += fmt::format(" rate={:.0f} missed={} refused={} undecodable={}", counters_[kContact].rate_hz(now_s), missed,
                      status_ ? status_->refused_messages : 0, undecodable);
  if (has_another_run(now_s)) text += " another_run_on_this_bus";
  if (ended_) text += " ended";
  if (const auto silence_s = silent_s(now_s)) text += fmt::format(" silent={:.0f}s", *silence_s);
  return text;
}

}  // namespace ballast::watch
