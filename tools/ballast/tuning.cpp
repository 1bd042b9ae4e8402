#include "tools/ballast/tuning.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "sim/masses/motion.h"
#include "tools/ballast/motor_check.h"
#include "tools/ballast/stepper_run.h"

namespace ballast {
namespace {

constexpr double kLeastHelp = 0.02;  // of the need: a change that lowers it by less does not help
constexpr double kUndamped = 0.1;    // damping ratio that is tried where a motor has none

using Motor = sim::Motor;

// Speeds of the commanded motion, asked for in order of time.
class Speed {
 public:
  explicit Speed(const sim::Mass& mass) : motion_(mass) {}
  double at(double time_s) {
    while (motion_.end_s(piece_) <= time_s) ++piece_;
    return std::abs(motion_.at(piece_, time_s).velocity);
  }

 private:
  sim::PrescribedMotion motion_;
  std::size_t piece_ = 0;
};

bool is_near(double speed, double resonant) {
  const auto near = [&](double order) { return std::abs(speed / (order * resonant) - 1) <= kNearResonance; };
  return near(1) || near(2);
}

double resonant_speed(const sim::Mass& mass) {
  return 2 * std::numbers::pi * swing_hz(mass) / (mass.motor.steps_per_revolution * mass.motor.shaft_ratio);
}

Figures roll(const sim::Scenario& scenario, const volatile std::sig_atomic_t* signalled, std::string& refusal) {
  Figures figures;
  std::vector<Speed> speeds;
  for (const sim::Mass& mass : scenario.masses) speeds.emplace_back(mass);
  const auto observe = [&](const sil::Lap& lap, const sim::Plant::Sample&) {
    const contact_t& contact = lap.plant.contact;
    if (contact.tick < 0) return;
    bool near = false;
    for (std::size_t i = 0; i < speeds.size(); ++i) {
      const sim::Mass& mass = scenario.masses[i];
      near = is_near(speeds[i].at(contact.time_s), resonant_speed(mass)) || near;
    }
    double& most = near ? figures.near : figures.away;
    most = std::max(most, static_cast<double>(contact.mu_required_max));
  };
  const SteppedRun run = run_with_steppers(
      on_perfect_floor(scenario), [signalled] { return *signalled != 0; }, observe);
  refusal = run.refusal;
  if (!run.result) return figures;
  const sil::RunResult& result = *run.result;
  figures.need = result.extrema.mu_required_max.value;
  figures.need_time_s = result.extrema.mu_required_max.time_s;
  figures.commanded = result.motor_share.commanded_mu_required_max.value;
  figures.share = std::abs(result.motor_share.mu_required.difference());
  figures.least_normal_n = result.extrema.normal_force_min.value;
  figures.completed = result.end_reason == sil::EndReason::kCompleted;
  figures.end = to_string(result.end_reason);
  return figures;
}

class Tuner {
 public:
  Tuner(const sim::Scenario& scenario, const volatile std::sig_atomic_t* signalled,
        const std::function<void(const std::string&)>& progress)
      : scenario_(scenario), signalled_(signalled), progress_(progress) {}

  std::optional<Tuning> run(std::string& refusal) {
    progress_("as it is");
    out_.resonances = resonances(scenario_);
    out_.now = roll(scenario_, signalled_, refusal);
    if (!refusal.empty()) return std::nullopt;
    for (const int count : ladder()) add_microsteps(count);
    for (const double part : {0.5, 0.0}) {
      add("detent_torque", part == 0 ? "no detent torque" : "half the detent torque", part > 0,
          [&](const sim::Mass& mass) { return part * mass.motor.detent_torque_nm; });
      add("step_error", part == 0 ? "no step error" : "half the step error", part > 0,
          [&](const sim::Mass& mass) { return part * mass.motor.step_error; });
    }
    add("viscous_damping", "twice the viscous damping", true, [](const sim::Mass& mass) {
      const double damping = mass.motor.viscous_damping_nms;
      return damping > 0 ? 2 * damping
                         : kUndamped / 0.5 * std::sqrt(mass.motor.rail_stiffness() * mass.moving_inertia()) /
                               (mass.motor.shaft_ratio * mass.motor.shaft_ratio);
    });
    for (const double factor : {2.0, 0.5}) {
      add("gear_ratio", factor > 1 ? "twice the gear ratio" : "half the gear ratio", true, [&](const sim::Mass& mass) {
        return mass.motor.travel_per_revolution > 0 ? std::numeric_limits<double>::quiet_NaN()
                                                    : factor * mass.motor.gear_ratio;
      });
    }
    combine();
    std::stable_sort(out_.others.begin(), out_.others.end(),
                     [](const Change& a, const Change& b) { return need(a) < need(b); });
    out_.complete = *signalled_ == 0;
    return std::move(out_);
  }

 private:
  static double need(const Change& change) {
    return change.figures && change.figures->completed ? change.figures->need : std::numeric_limits<double>::infinity();
  }

  [[nodiscard]] std::set<int> ladder() const {
    std::set<int> counts{1, 4, 16, 32, 64, 128, 256};
    for (const sim::Mass& mass : scenario_.masses) counts.insert(mass.motor.microsteps);
    return counts;
  }

  [[nodiscard]] std::string key(std::size_t mass, const char* name, double value) const {
    return fmt::format("mass.{}.motor.{}={:.4g}", mass, name, value);
  }

  void add_microsteps(int count) {
    Change change{fmt::format("{}", count)};
    bool same = true;
    for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
      same = same && scenario_.masses[i].motor.microsteps == count;
      change.sets.push_back(key(i, "microsteps", count));
    }
    if (same) {
      change.what += " (now)";
      change.sets.clear();
      change.figures = out_.now;
    } else {
      try_out(change);
      if (!change.figures) allow_rates(change, count);
    }
    out_.microsteps.push_back(change);
  }

  // A driver's step rate is given for the present microsteps; the same speed takes more of them.
  void allow_rates(Change& change, int count) {
    for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
      const Motor& motor = scenario_.masses[i].motor;
      change.sets.push_back(key(i, "max_step_rate", motor.max_step_rate_hz * count / motor.microsteps));
    }
    try_out(change);
  }

  template <typename ValueOf>
  void add(const char* name, const std::string& what, bool buyable, const ValueOf& value_of) {
    Change change{what};
    change.key = name;
    change.buyable = buyable;
    for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
      const double value = value_of(scenario_.masses[i]);
      if (std::isfinite(value)) change.sets.push_back(key(i, name, value));
    }
    if (change.sets.empty()) return;
    try_out(change);
    out_.others.push_back(change);
  }

  void try_out(Change& change) {
    if (*signalled_ != 0) {
      change.refusal = "interrupted";
      return;
    }
    progress_(change.what);
    const auto read = sim::parse_scenario(scenario_.toml, scenario_.name, change.sets);
    if (!read.ok()) {
      change.refusal = fmt::format("{} {}", read.errors.front().key, read.errors.front().message);
      return;
    }
    const Figures figures = roll(read.scenario, signalled_, change.refusal);
    if (change.refusal.empty() && *signalled_ == 0) change.figures = figures;
  }

  // All that help: the best microsteps and, of the changes of the gear, the better.
  void combine() {
    const double enough = (1 - kLeastHelp) * out_.now.need;
    Change all{"all that help"};
    const auto finest = std::min_element(out_.microsteps.begin(), out_.microsteps.end(),
                                         [](const Change& a, const Change& b) { return need(a) < need(b); });
    int helpful = 0;
    const auto take = [&](const Change& change) {
      all.sets.insert(all.sets.end(), change.sets.begin(), change.sets.end());
      ++helpful;
    };
    if (need(*finest) < enough && !finest->sets.empty()) take(*finest);
    const Change* gear = nullptr;
    for (const Change& change : out_.others) {
      if (need(change) >= enough || !change.buyable) continue;
      const bool is_gear = change.key == "gear_ratio";
      if (!is_gear) take(change);
      if (is_gear && (gear == nullptr || need(change) < need(*gear))) gear = &change;
    }
    if (gear != nullptr) take(*gear);
    if (helpful < 2) return;
    try_out(all);
    out_.together = all;
  }

  const sim::Scenario& scenario_;
  const volatile std::sig_atomic_t* signalled_;
  const std::function<void(const std::string&)>& progress_;
  Tuning out_;
};

}  // namespace

std::vector<MotorResonance> resonances(const sim::Scenario& scenario) {
  std::vector<MotorResonance> out;
  const double tick_s = scenario.run.control_period_s;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::Mass& mass = scenario.masses[i];
    MotorResonance found;
    found.mass = i;
    found.swing_hz = swing_hz(mass);
    found.damping_ratio = mass.damping_ratio();
    found.rail_speed = resonant_speed(mass);
    found.microsteps_hz = found.rail_speed * mass.motor.microsteps_per_rail_unit();
    Speed speed(mass);
    bool near_before = false;
    for (int k = 0; k * tick_s <= scenario.duration_s; ++k) {
      const double at = speed.at(k * tick_s);
      found.greatest_speed = std::max(found.greatest_speed, at);
      const bool near = is_near(at, found.rail_speed);
      if (near && !near_before) found.near.push_back({k * tick_s, k * tick_s});
      if (near) found.near.back().end_s = k * tick_s;
      near_before = near;
    }
    out.push_back(found);
  }
  return out;
}

std::optional<Tuning> tune(const sim::Scenario& scenario, const volatile std::sig_atomic_t* signalled,
                           const std::function<void(const std::string& what)>& progress, std::string& refusal) {
  return Tuner(scenario, signalled, progress).run(refusal);
}

}  // namespace ballast
