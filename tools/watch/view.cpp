#include "tools/watch/view.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <vector>

namespace ballast::watch {

namespace {

constexpr double kRateWindow_s = 1;
constexpr double kSilence_s = 2;  // longer than any paced tick worth watching
constexpr std::int64_t kWaitingTick = -3;

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
  char text[256];
  va_list values;
  va_start(values, pattern);
  std::vsnprintf(text, sizeof text, pattern, values);
  va_end(values);
  return text;
}

const char* regime(std::int8_t code) {
  constexpr const char* kNames[] = {"rolling", "sliding", "flight"};
  return kNames[code];  // in_range() has seen to it
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

// `part` of 1 as a bar; where it is not a number or outside, what is left of it.
std::string bar(double part, int width) {
  const double shown = part > 0 ? std::min(part, 1.0) : 0;  // NaN: none
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

void TickCounter::see(std::int64_t tick, double now_s) {
  if (!newest_ || tick < *newest_ - kLate) {
    *this = TickCounter();
    window_start_s_ = now_s;
  } else if (tick > *newest_) {
    missed_ += tick - *newest_ - 1;
  } else {
    missed_ = std::max<std::int64_t>(missed_ - 1, 0);  // it was only late
  }
  newest_ = std::max(tick, newest_.value_or(tick));
  ++count_;
  ++window_count_;
  seen_s_ = now_s;
  if (now_s - window_start_s_ >= kRateWindow_s) {
    rate_hz_ = static_cast<double>(window_count_) / (now_s - window_start_s_);
    window_start_s_ = now_s;
    window_count_ = 0;
  }
}

double TickCounter::rate_hz(double now_s) const {
  if (now_s - seen_s_ > kSilence_s) return 0;
  if (rate_hz_ > 0) return rate_hz_;
  return now_s > window_start_s_ ? static_cast<double>(window_count_) / (now_s - window_start_s_) : 0;
}

// What was the least and the most belongs to the run before.
void View::start_again(std::int64_t tick) {
  if (!contact_ || (tick >= contact_->tick - TickCounter::kLate && !ended_)) return;
  const auto run_id = run_id_;
  *this = View();
  run_id_ = run_id;
}

// Whether the message is of the run that is shown; another one's turn comes when that is over.
bool View::is_shown(std::int64_t run_id, double now_s) {
  if (run_id_ && run_id != *run_id_) {
    if (!is_over(now_s)) {
      heard_another_s_ = now_s;
      return false;
    }
    *this = View();
  }
  run_id_ = run_id;
  heard_s_ = now_s;
  return true;
}

bool View::is_over(double now_s) const { return !run_id_ || ended_ || now_s - heard_s_ > kSilence_s; }

bool View::hears_another_run(double now_s) const { return heard_another_s_ && now_s - *heard_another_s_ <= kSilence_s; }

std::optional<double> View::silent_s(double now_s) const {
  if (!run_id_ || ended_ || now_s - heard_s_ <= kSilence_s) return std::nullopt;
  return now_s - heard_s_;
}

void View::see(const contact_t& m, double now_s) {
  if (!is_shown(m.run_id, now_s)) return;
  start_again(m.tick);
  heard_s_ = now_s;
  if (!contact_) normal_force_min_n_ = m.normal_force_n;
  contact_ = m;
  counters_[kContact].see(m.tick, now_s);
  if (m.regime != contact_t::REGIME_FLIGHT) margin_min_ = std::fmin(margin_min_, m.margin);
  mu_required_max_ = std::fmax(mu_required_max_, m.mu_required_max);
  normal_force_min_n_ = std::fmin(normal_force_min_n_, std::fmin(m.normal_force_n, m.normal_force_min_n));
  normal_force_max_n_ = std::fmax(normal_force_max_n_, m.normal_force_n);
  ended_ = m.last == 1;
}

void View::see(const plant_state_t& m, double now_s) {
  if (!is_shown(m.run_id, now_s)) return;
  state_ = m;
  counters_[kState].see(m.tick, now_s);
}

void View::see(const sensors_t& m, double now_s) {
  if (is_shown(m.run_id, now_s)) counters_[kSensors].see(m.tick, now_s);
}

// Peers that wait for their first tick say so again and again; that is no tick, and of no run.
void View::see(const controller_status_t& m, double now_s) {
  const bool waits = m.tick == kWaitingTick;
  if (waits ? !is_over(now_s) : !is_shown(m.run_id, now_s)) return;
  status_ = m;
  if (!waits) counters_[kStatus].see(m.tick, now_s);
}

void View::see(const step_command_t& m, double now_s) {
  if (is_shown(m.run_id, now_s)) counters_[kSteps].see(m.tick, now_s);
}

void View::see(const trip_t& m, double now_s) {
  const bool waits = m.tick == kWaitingTick;
  if (waits ? !is_over(now_s) : !is_shown(m.run_id, now_s)) return;
  trip_ = m;
  if (!waits) counters_[kTrip].see(m.tick, now_s);
}

std::string View::page(double now_s, int width, std::int64_t undecodable) const {
  const int bar_width = std::clamp(width - 46, 10, 50);
  std::string text;
  if (hears_another_run(now_s))
    text += cut("ANOTHER RUN talks on this bus, and is not shown: each needs its own", width);
  if (const auto silence_s = silent_s(now_s))
    text += cut(format("SILENT for %.0f s: the run is stopped, or has ended without a last word", *silence_s), width);
  if (contact_) {
    const contact_t& c = *contact_;
    text += cut(format("t = %.3f s  tick %lld  %s%s", c.time_s, static_cast<long long>(c.tick), regime(c.regime),
                       ended_ ? "  the run has ended" : ""),
                width);
    text += cut(format("margin %s %7.3f  least %.3f", bar(c.margin, bar_width).c_str(), c.margin, margin_min_), width);
    text += cut(
        format("f_s/N  %s %7.4f  most  %.4f", bar(1 - c.margin, bar_width).c_str(), c.mu_required, mu_required_max_),
        width);
    text += cut(format("N      %s %7.4g  least %.4g N", bar(c.normal_force_n / normal_force_max_n_, bar_width).c_str(),
                       c.normal_force_n, normal_force_min_n_),
                width);
  } else {
    text += cut("no plant yet", width);
  }
  if (trip_ && trip_->tripped == 1) {
    text += cut(format("TRIP   %s at t = %.6f s: %.6g, limit %.6g", cause(trip_->cause), trip_->trip_time_s,
                       trip_->value, trip_->limit),
                width);
  } else {
    text += cut(trip_ ? "trip   none" : "trip   no monitor heard", width);
  }
  if (status_) {
    text += cut(format("mode   %s  faults 0x%x  overruns %lld  messages refused %lld%s", mode(status_->mode),
                       static_cast<unsigned>(status_->faults), static_cast<long long>(status_->overruns),
                       static_cast<long long>(status_->refused_messages),
                       status_->refusal != controller_status_t::REFUSAL_NONE ? "  a command was refused" : ""),
                width);
  } else {
    text += cut("mode   no controller heard", width);
  }
  if (state_) {
    for (int i = 0; i < state_->mass_count; ++i) {
      text += cut(
          format("mass %d at %.4f, %.4f /s, torque %.3g N m, %lld steps lost", i, state_->mass_position[i],
                 state_->mass_velocity[i], state_->motor_torque_nm[i], static_cast<long long>(state_->lost_steps[i])),
          width);
    }
  }
  constexpr const char* kNames[] = {"contact", "state", "sensors", "status", "steps", "trip"};
  std::string rates = "per s ", missed = "missed";
  for (int i = 0; i < kChannels; ++i) {
    const TickCounter& counter = counters_[static_cast<std::size_t>(i)];
    if (counter.count() == 0) continue;
    rates += format(" %s %.0f", kNames[i], counter.rate_hz(now_s));
    missed += format(" %s %lld", kNames[i], static_cast<long long>(counter.missed()));
  }
  return text + cut(rates, width) +
         cut(missed + format("  undecodable %lld", static_cast<long long>(undecodable)), width);
}

std::string View::line(double now_s, std::int64_t undecodable) const {
  std::string text;
  if (contact_) {
    text = format("t=%.3f %s N=%.5g f_s/N=%.5g margin=%.4f least=%.4f", contact_->time_s, regime(contact_->regime),
                  contact_->normal_force_n, contact_->mu_required, contact_->margin, margin_min_);
  } else {
    text = "no plant yet";
  }
  text += std::string(" mode=") + (status_ ? mode(status_->mode) : "none") + " trip=" +
          (!trip_                ? "unheard"
           : trip_->tripped == 1 ? cause(trip_->cause)
                                 : "none");
  std::int64_t missed = 0;
  for (const TickCounter& counter : counters_) missed += counter.missed();
  text += format(" rate=%.0f missed=%lld refused=%lld undecodable=%lld", counters_[kContact].rate_hz(now_s),
                 static_cast<long long>(missed), static_cast<long long>(status_ ? status_->refused_messages : 0),
                 static_cast<long long>(undecodable));
  if (hears_another_run(now_s)) text += " another_run_on_this_bus";
  if (ended_) text += " ended";
  if (const auto silence_s = silent_s(now_s)) text += format(" silent=%.0fs", *silence_s);
  return text;
}

}  // namespace ballast::watch
