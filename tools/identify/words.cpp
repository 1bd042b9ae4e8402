#include "tools/identify/words.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "sim/scenario/tree_nodes.h"
#include "tools/program/short_number.h"

namespace ballast::identify {

namespace {

using program::short_number;

struct Line {
  std::string name, unit;
  double believed, value, half_width;
};

// The believed value of a parameter, before it is scaled to the total mass.
double as_believed(const Parameters& parameters, const Known& known, int k) {
  const firmware::BallParams& ball = known.robot.ball;
  if (k < parameters.center_of_mass()) return ball.mass_kg[static_cast<std::size_t>(k)];
  if (k < parameters.inertia()) return ball.center_of_mass_B_m[k - parameters.center_of_mass()];
  if (k < parameters.rolling_resistance()) return ball.inertia_kgm2[k - parameters.inertia()];
  return ball.rolling_resistance;
}

// The belief after the fit: unknown parameters stay as they were.
double value_of(const Parameters& parameters, const Known& known, const Identified& fit, int k) {
  return std::isfinite(fit.half_width[k]) ? fit.value[k] : as_believed(parameters, known, k);
}

std::vector<Line> lines(const Parameters& parameters, const Known& known, const Identified& fit) {
  std::vector<Line> out{
      {"ball.mass", "kg", known.robot.ball.shell_mass_kg, fit.shell_mass_kg, fit.shell_half_width_kg}};
  for (int k = 0; k < parameters.count(); ++k) {
    out.push_back(
        {parameters.name(k), parameters.unit(k), as_believed(parameters, known, k), fit.value[k], fit.half_width[k]});
  }
  return out;
}

// The value with the digits that its interval leaves.
std::string digits(double value, double half_width) {
  const int decimals = std::max(0, 2 - static_cast<int>(std::ceil(std::log10(half_width))));
  return fmt::format("{:.{}f}", value, std::min(decimals, 12));
}

std::string direction_text(const Parameters& parameters, const UnknownDirection& unknown) {
  constexpr double kCounts = 0.1;  // of a direction of length 1
  std::string text;
  for (int k = 0; k < parameters.count(); ++k) {
    const double part = unknown.direction[k];
    if (std::abs(part) < kCounts) continue;
    text += fmt::format("{}{:.2f} {}", text.empty() ? (part < 0 ? "-" : "") : (part < 0 ? " - " : " + "),
                        std::abs(part), parameters.name(k));
  }
  return text;
}

}  // namespace

std::string identified_text(const Parameters& parameters, const Known& known, const Identified& fit) {
  std::string text = fmt::format("  {:<28} {:>12} {:>14}   {}\n", "", "believed", "identified", "95 % interval");
  for (const Line& line : lines(parameters, known, fit)) {
    text += fmt::format("  {:<28} {:>12}", line.name, short_number(line.believed));
    if (!std::isfinite(line.half_width)) {
      text += fmt::format(" {:>14}   the motion does not show it; it stays as believed\n", "unknown");
      continue;
    }
    text += fmt::format(" {:>14}   +- {} {}\n", digits(line.value, line.half_width), short_number(line.half_width),
                        line.unit);
  }
  for (const UnknownDirection& unknown : fit.unknown)
    text += fmt::format("  not excited: {} (in parts of their sizes)\n", direction_text(parameters, unknown));
  return text;
}

std::string excess_text(double excess) {
  std::string text = fmt::format("; the residuals have {} times the sensors' variance", short_number(excess));
  constexpr double kNoticeable = 1.1;
  if (excess < kNoticeable) return text;
  return text + fmt::format(", which makes the intervals up to {} times as wide", short_number(std::sqrt(excess)));
}

std::string intervals_text(const Parameters& parameters, const Identified& fit) {
  std::string text;
  const auto add = [&](const std::string& name, const std::string& unit, double half_width, double size) {
    if (!std::isfinite(half_width)) {
      text += fmt::format("  {:<28} unknown\n", name);
      return;
    }
    const std::string part = size > 0 ? fmt::format(", {} %", short_number(100 * half_width / size)) : "";
    text += fmt::format("  {:<28} +- {} {}{}\n", name, short_number(half_width), unit, part);
  };
  add("ball.mass", "kg", fit.shell_half_width_kg, fit.shell_mass_kg);
  for (int k = 0; k < parameters.count(); ++k) {
    const bool has_size =
        k < parameters.center_of_mass() || (k >= parameters.inertia() && k < parameters.rolling_resistance());
    add(parameters.name(k), parameters.unit(k), fit.half_width[k], has_size ? fit.value[k] : 0);
  }
  return text;
}

BeliefError belief_error(const Parameters& parameters, const Identified& fit) {
  BeliefError out;
  out.mass = {fit.shell_half_width_kg / fit.shell_mass_kg, "ball.mass",
              sim::Scenario::Control::BeliefError::kMostMassShare};
  out.center_of_mass_m.most = std::numeric_limits<double>::max();
  const auto take = [&](Widest& widest, double half_width, int k) {
    if (half_width > widest.half_width || widest.name.empty()) {
      widest.half_width = half_width;
      widest.name = parameters.name(k);
    }
  };
  for (int k = 0; k < parameters.rolling_resistance(); ++k) {
    const bool center = k >= parameters.center_of_mass() && k < parameters.inertia();
    if (center) {
      take(out.center_of_mass_m, fit.half_width[k], k);
    } else {
      take(out.mass, fit.half_width[k] / fit.value[k], k);
    }
  }
  return out;
}

std::string declared_text(const BeliefError& error) {
  const auto line = [](const char* key, const Widest& widest, const char* unit) {
    const std::string name = fmt::format("control.belief_error.{}", key);
    if (widest.can_be_declared())
      return fmt::format("  declared    {} = {}{}, by {}\n", name, short_number(widest.half_width), unit, widest.name);
    const std::string why = std::isfinite(widest.half_width)
                                ? fmt::format("{} may be off by {} %, and at most {} % can be declared", widest.name,
                                              short_number(100 * widest.half_width), short_number(100 * widest.most))
                                : widest.name + " is unknown";
    return fmt::format("  declared    {} stays as it was: {}\n", name, why);
  };
  return line("mass", error.mass, "") + line("center_of_mass", error.center_of_mass_m, " m");
}

std::string believed_toml(const std::string& toml, const Parameters& parameters, const Known& known,
                          const Identified& fit, const std::string& name) {
  sim::Node root;
  std::vector<sim::ScenarioError> errors;
  static_cast<void>(sim::read_tree(toml, "scenario", root, errors));  // it has been read before
  if (!name.empty()) sim::set_entry(root, "name", sim::text_node(name));
  const auto table = [](sim::Node& in, const char* key) -> sim::Node& {
    if (in.find(key) == nullptr) sim::set_entry(in, key, sim::Node());
    return *in.find(key);
  };
  const auto value = [&](int k) { return value_of(parameters, known, fit, k); };
  sim::Node& believed = table(root, "believed");
  sim::Node& ball = table(believed, "ball");
  const bool shell = std::isfinite(fit.shell_half_width_kg);
  sim::set_entry(ball, "mass", sim::number_node(shell ? fit.shell_mass_kg : known.robot.ball.shell_mass_kg));
  const int center = parameters.center_of_mass(), inertia = parameters.inertia();
  sim::set_entry(ball, "center_of_mass", sim::numbers_node({value(center), value(center + 1), value(center + 2)}));
  sim::set_entry(ball, "inertia", sim::numbers_node({value(inertia), value(inertia + 1), value(inertia + 2)}));
  sim::set_entry(table(believed, "surface"), "rolling_resistance",
                 sim::number_node(value(parameters.rolling_resistance())));
  sim::Node masses = sim::array_node();
  for (int i = 0; i < parameters.masses(); ++i) {
    sim::Node mass;
    sim::set_entry(mass, "mass", sim::number_node(value(i)));
    masses.items.push_back(std::move(mass));
  }
  sim::set_entry(believed, "mass", std::move(masses));

  // Nobody knows how far an unknown parameter is off: a bound that was declared stays.
  const BeliefError off = belief_error(parameters, fit);
  sim::Node& error = table(table(root, "control"), "belief_error");
  const auto declare = [&](const char* key, const Widest& widest) {
    if (widest.can_be_declared()) sim::set_entry(error, key, sim::number_node(widest.half_width));
  };
  declare("mass", off.mass);
  declare("center_of_mass", off.center_of_mass_m);
  return sim::to_toml(root) + "\n";
}

}  // namespace ballast::identify
