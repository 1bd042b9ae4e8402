// ballast tune: what the motors add to the friction that a motion needs, and what would lower it.
#include "tools/ballast/tune_command.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "tools/ballast/commands.h"
#include "tools/ballast/plan_command.h"
#include "tools/ballast/tuning.h"
#include "tools/program/program.h"
#include "tools/program/short_number.h"

namespace ballast {
namespace {

struct TuneCommand {
  program::ScenarioOptions scenario;
  std::string out;
  bool quiet = false;
};

using program::short_number;
using program::short_time;

std::string number(double value) { return std::isfinite(value) ? short_number(value) : "no limit"; }

// A change in percent, with its sign.
std::string percent(double part) {
  const std::string text = short_number(std::round(100 * part));
  return fmt::format("{}{} %", part > 0 ? "+" : "", text);
}

// Empty, or why the motors of this scenario cannot be tuned.
std::string refusal_of(const sim::Scenario& scenario, const std::string& file) {
  if (scenario.masses.empty()) return "mass: is missing; allowed with ballast tune: a robot with motors";
  if (scenario.run.actuation != sim::Actuation::kStepper) {
    return fmt::format(
        "run.actuation: the masses are {} and have no motors; allowed with ballast tune: --actuation stepper",
        to_string(scenario.run.actuation));
  }
  if (!scenario.faults.empty()) {
    return to_string(scenario.faults.front()) +
           ": not with ballast tune, which examines a robot without faults; allowed: ballast run";
  }
  const bool moves = std::any_of(scenario.masses.begin(), scenario.masses.end(),
                                 [](const sim::Mass& mass) { return !mass.motion.empty(); });
  if (!moves) {
    return fmt::format(
        "mass.0.motion: no mass has a motion that could be rolled; allowed: a plan, for example from "
        "{} plan {}",
        program::ballast_as_typed(), program::shell_word(file));
  }
  return "";
}

// The limits of floor and envelope.
struct Allowed {
  double friction, normal_n;
};

Allowed allowed_by(const sim::Scenario& scenario) {
  return {scenario.envelope.friction_use * scenario.surface.static_friction, scenario.envelope.min_normal_force_n};
}

bool holds(const Figures& figures, const Allowed& allowed) {
  return figures.completed && figures.need <= allowed.friction && figures.least_normal_n >= allowed.normal_n;
}

std::string need_text(const Figures& figures) { return figures.completed ? number(figures.need) : figures.end; }

std::string now_text(const sim::Scenario& scenario, const Tuning& tuning) {
  const Figures& now = tuning.now;
  const Allowed allowed = allowed_by(scenario);
  std::string text = fmt::format("{}: with its motors it needs f_s/N = {} at t = {} s; the motion alone needs {}\n",
                                 scenario.name, number(now.need), short_time(now.need_time_s), number(now.commanded));
  if (!now.completed) text += fmt::format("  it does not get to the end: {}\n", now.end);
  text += holds(now, allowed) ? fmt::format("  it holds: floor and envelope allow {}\n", number(allowed.friction))
          : now.need > allowed.friction
              ? fmt::format("  it does NOT hold: floor and envelope allow {}\n", number(allowed.friction))
          : now.least_normal_n < allowed.normal_n
              ? fmt::format("  it does NOT hold: N falls to {} N, and the envelope allows {}\n",
                            number(now.least_normal_n), number(allowed.normal_n))
              : "";
  text += fmt::format(
      "  the motors' share: up to {} more or less than the motion; f_s/N is at most {} while a motor is "
      "near a resonance, and {} otherwise\n",
      number(now.share), number(now.near), number(now.away));
  return text;
}

std::string times_text(const std::vector<Interval>& intervals) {
  double total_s = 0;
  std::string times;
  for (std::size_t k = 0; k < intervals.size(); ++k) {
    total_s += intervals[k].end_s - intervals[k].start_s;
    if (k >= 3) continue;
    times +=
        fmt::format("{}{} to {}", k == 0 ? "" : ", ", short_time(intervals[k].start_s), short_time(intervals[k].end_s));
  }
  if (intervals.empty()) return "never";
  const std::string more = intervals.size() > 3 ? fmt::format(" and {} times more", intervals.size() - 3) : "";
  return fmt::format("{} s in all: t = {} s{}", short_number(total_s), times, more);
}

std::string speeds_text(const sim::Scenario& scenario, const Tuning& tuning) {
  std::string text = fmt::format(
      "\nspeeds that shake: the full steps come within {:.0f} % of the frequency at which rotor and mass swing, or of "
      "twice it\n"
      "  {:<5} {:>8} {:>8}  {:<30} {:>8}  {}\n",
      100 * kNearResonance, "mass", "swing", "damping", "speeds to keep out of", "fastest", "the motion is there");
  for (const MotorResonance& r : tuning.resonances) {
    const char* unit = scenario.masses[r.mass].rail.shape == firmware::RailShape::kCircle ? "rad/s" : "m/s";
    const auto band = [&](double order) {
      return fmt::format("{}-{}", short_number(order * (1 - kNearResonance) * r.rail_speed),
                         short_number(order * (1 + kNearResonance) * r.rail_speed));
    };
    text += fmt::format("  {:<5} {:>5} Hz {:>8}  {:<30} {:>8}  {}\n", r.mass, short_number(r.swing_hz),
                        short_number(r.damping_ratio), fmt::format("{}, {} {}", band(1), band(2), unit),
                        short_number(r.greatest_speed), times_text(r.near));
  }
  // A mass that hangs still while the ball rolls moves along its ring at the ball's rate.
  const auto ring = std::find_if(tuning.resonances.begin(), tuning.resonances.end(), [&](const MotorResonance& r) {
    return scenario.masses[r.mass].rail.shape == firmware::RailShape::kCircle;
  });
  if (ring != tuning.resonances.end()) {
    text += fmt::format(
        "  a mass that hangs at the bottom of its ring while the ball rolls is at these speeds when the "
        "ball does {} and {} m/s (mass {})\n",
        short_number(scenario.ball.radius_m * ring->rail_speed),
        short_number(2 * scenario.ball.radius_m * ring->rail_speed), ring->mass);
  }
  return text;
}

std::string change_text(const Change& change, const Figures& now) {
  if (!change.figures) return fmt::format("  {:<28} {:>8}  {}\n", change.what, "-", change.refusal);
  const Figures& figures = *change.figures;
  const double part = figures.need / now.need - 1;
  const std::string by = !figures.completed || !std::isfinite(part) || std::abs(part) < 0.005 ? "" : percent(part);
  return fmt::format("  {:<28} {:>8} {:>8}{}\n", change.what, need_text(figures), number(figures.share),
                     by.empty() ? "" : fmt::format(" {:>8}", by));
}

// "microsteps = 64 for mass 0, 1, 2", a line for each value of a key.
std::string sets_text(const std::vector<std::string>& sets) {
  std::map<std::string, std::string> masses_of;
  std::vector<std::string> order;
  for (const std::string& set : sets) {
    const std::size_t first = set.find('.'), second = set.find('.', first + 1), key = set.find('.', second + 1);
    std::string what = set.substr(key + 1);
    what.replace(what.find('='), 1, " = ");
    std::string& masses = masses_of[what];
    if (masses.empty()) order.push_back(what);
    masses += (masses.empty() ? "" : ", ") + set.substr(first + 1, second - first - 1);
  }
  std::string text;
  for (const std::string& what : order)
    text += fmt::format("    {:<32} # [mass.motor] of mass {}\n", what, masses_of[what]);
  return text;
}

std::string tuning_text(const sim::Scenario& scenario, const Tuning& tuning) {
  std::string text = now_text(scenario, tuning) + speeds_text(scenario, tuning);
  const auto table = [&](const std::string& title, const std::vector<Change>& changes) {
    text += fmt::format("\n  {:<28} {:>8} {:>8}\n", title, "f_s/N", "share");
    for (const Change& change : changes) text += change_text(change, tuning.now);
  };
  table("microsteps", tuning.microsteps);
  table("one change, all else as it is", tuning.others);
  if (tuning.together) {
    table("together", {*tuning.together});
    if (tuning.together->figures) text += sets_text(tuning.together->sets);
  }
  if (!tuning.complete) text += "\ninterrupted: what follows is missing\n";
  return text;
}

using Json = nlohmann::ordered_json;

Json finite(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json figures_json(const Figures& f) {
  return {{"mu_required", {{"max", finite(f.need)}, {"time", f.need_time_s}}},
          {"commanded_mu_required", finite(f.commanded)},
          {"motor_share", finite(f.share)},
          {"near_resonance", finite(f.near)},
          {"away_from_resonance", finite(f.away)},
          {"normal_force_min", finite(f.least_normal_n)},
          {"end", f.end}};
}

Json change_json(const Change& change) {
  return {{"change", change.what},
          {"set", change.sets},
          {"figures", change.figures ? figures_json(*change.figures) : Json(nullptr)},
          {"refusal", change.refusal.empty() ? Json(nullptr) : Json(change.refusal)}};
}

std::string tuning_json(const sim::Scenario& scenario, const Tuning& tuning) {
  Json out;
  out["scenario"] = scenario.name;
  out["holds"] = holds(tuning.now, allowed_by(scenario));
  out["complete"] = tuning.complete;
  out["now"] = figures_json(tuning.now);
  out["resonances"] = Json::array();
  for (const MotorResonance& r : tuning.resonances) {
    Json near = Json::array();
    for (const Interval& interval : r.near) near.push_back({interval.start_s, interval.end_s});
    out["resonances"].push_back({{"mass", r.mass},
                                 {"swing", r.swing_hz},
                                 {"damping_ratio", r.damping_ratio},
                                 {"speed", r.rail_speed},
                                 {"step_rate", r.microsteps_hz},
                                 {"near", near}});
  }
  for (const auto& [key, changes] :
       {std::pair("microsteps", &tuning.microsteps), std::pair("changes", &tuning.others)}) {
    out[key] = Json::array();
    for (const Change& change : *changes) out[key].push_back(change_json(change));
  }
  out["together"] = tuning.together ? change_json(*tuning.together) : Json(nullptr);
  return out.dump(2) + "\n";
}

int tune_motors(const TuneCommand& command) {
  const auto scenario = program::load_scenario(command.scenario);
  if (!scenario) return program::kExitUsage;
  if (const std::string why = refusal_of(*scenario, command.scenario.scenario); !why.empty()) return refuse(why);
  if (!command.out.empty()) {
    if (const std::string why = in_the_way(command.out); !why.empty()) return refuse(why);
  }
  const volatile std::sig_atomic_t* signalled = program::catch_signals();
  ProgressLine line(command.quiet);
  std::string refusal;
  const auto tuning = tune(
      *scenario, signalled,
      [&](const std::string& what) {
        if (line.due()) line.show("rolling: " + what);
      },
      refusal);
  line.end();
  if (!tuning) return refuse(refusal);
  if (!command.out.empty() && !write_file(command.out, tuning_json(*scenario, *tuning)))
    return could_not(fmt::format("{}: cannot be written", command.out));
  if (!command.quiet) std::cout << tuning_text(*scenario, *tuning) << std::flush;
  if (!tuning->complete) return program::kExitCouldNotRun;
  return holds(tuning->now, allowed_by(*scenario)) ? program::kExitCompleted : program::kExitEnvelope;
}

}  // namespace

std::function<int()> add_tune_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("tune", "Says what the motors add to the friction of a motion, and what would lower it");
  auto options = std::make_shared<TuneCommand>();
  program::add_scenario_options(*command, options->scenario);
  command->get_option("--fault")->group("");  // hidden in the help; refused with a reason
  command->add_option("--out", options->out, "file for the figures, as JSON; default: none")
      ->check(program::not_empty());
  command->add_flag("--quiet", options->quiet, "no progress and no text");
  return [options] { return tune_motors(*options); };
}

}  // namespace ballast
