#include "tools/sweep/errors_option.h"

#include <fmt/core.h>

#include <charconv>
#include <cmath>
#include <numbers>
#include <set>

#include "sim/scenario/reader.h"
#include "tools/sweep/read_spec.h"
#include "tools/sweep/rows.h"

namespace ballast::sweep {
namespace {

constexpr const char* kSource = "--errors";
constexpr const char* kPercent = "%";

// One kind of error. `add` appends the variations of a scenario for an error of this size: a part of 1, or rad.
struct ErrorKind {
  std::string_view name;
  bool is_angle;
  void (*add)(const sim::Scenario& scenario, double size, std::vector<Variation>& out);
};

void add_normal(std::string key, double nominal, double deviation, std::vector<Variation>& out) {
  out.push_back({std::move(key), Distribution::kNormal, nominal, deviation, {}, 0});
}

void add_mass(const sim::Scenario& s, double size, std::vector<Variation>& out) {
  add_normal("ball.mass", s.ball.mass_kg, size * s.ball.mass_kg, out);
  for (std::size_t i = 0; i < s.masses.size(); ++i)
    add_normal(fmt::format("mass.{}.mass", i), s.masses[i].mass_kg, size * s.masses[i].mass_kg, out);
}

void add_inertia(const sim::Scenario& s, double size, std::vector<Variation>& out) {
  for (int j = 0; j < 3; ++j)
    add_normal(fmt::format("ball.inertia.{}", j), s.ball.inertia_kgm2[j], size * s.ball.inertia_kgm2[j], out);
}

void add_center_of_mass(const sim::Scenario& s, double size, std::vector<Variation>& out) {
  for (int j = 0; j < 3; ++j)
    add_normal(fmt::format("ball.center_of_mass.{}", j), s.ball.center_of_mass_B_m[j], size * s.ball.radius_m, out);
}

void add_tilt(const sim::Scenario&, double size, std::vector<Variation>& out) {
  out.push_back({"initial.orientation", Distribution::kTilt, size, 0, {}, 0});
}

// Perfect friction has no error.
void add_friction(const sim::Scenario& s, double size, std::vector<Variation>& out) {
  const double mu = s.surface.static_friction;
  if (std::isfinite(mu)) add_normal("surface.static_friction", mu, size * mu, out);
}

void add_torque(const sim::Scenario& s, double size, std::vector<Variation>& out) {
  for (std::size_t i = 0; i < s.masses.size(); ++i) {
    const double torque = s.masses[i].motor.holding_torque_nm;
    if (s.masses[i].trajectory.times_s.empty())
      add_normal(fmt::format("mass.{}.motor.holding_torque", i), torque, size * torque, out);
  }
}

constexpr ErrorKind kKinds[] = {{"mass", false, add_mass},         {"com", false, add_center_of_mass},
                                {"inertia", false, add_inertia},   {"tilt", true, add_tilt},
                                {"friction", false, add_friction}, {"torque", false, add_torque}};

// Reads "5%" or "3deg" or "0.05rad". nullopt: it is no such size.
std::optional<double> size_of(std::string_view text, bool is_angle) {
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || !std::isfinite(number) || number < 0) return std::nullopt;
  const std::string_view unit(end, static_cast<std::size_t>(text.data() + text.size() - end));
  if (!is_angle) return unit == kPercent ? std::optional(number / 100) : std::nullopt;
  if (unit == "deg") return number * std::numbers::pi / 180;
  return unit == "rad" ? std::optional(number) : std::nullopt;
}

// Appends the variations of one "KIND=SIZE". Empty, or why it is none.
std::string add_error(std::string_view item, const sim::Scenario& scenario, std::vector<Variation>& out) {
  const std::size_t equals = item.find('=');
  const std::string_view name = item.substr(0, equals);
  for (const ErrorKind& kind : kKinds) {
    if (kind.name != name || equals == std::string_view::npos) continue;
    const auto size = size_of(item.substr(equals + 1), kind.is_angle);
    if (!size)
      return kind.is_angle ? "is no angle; allowed: a number >= 0 with deg or rad, such as tilt=3deg"
                           : fmt::format("is no part; allowed: a number >= 0 with %, such as {}=5%", kind.name);
    kind.add(scenario, *size, out);
    return "";
  }
  return "is no error; allowed: " + errors_allowed();
}

// Adds [believed] as the nominal robot, so that the controller does not know the errors of a row. A prescribed run has
// no controller: there only the monitor's floor is believed.
void believe_nominal(const sim::Scenario& nominal, std::vector<Setting>& set) {
  const auto vector = [](const Eigen::Vector3d& v) { return list_node({v[0], v[1], v[2]}); };
  if (sim::has_controller(nominal.run.actuation)) {
    set.push_back({"believed.ball.mass", number_node(nominal.ball.mass_kg)});
    set.push_back({"believed.ball.inertia", vector(nominal.ball.inertia_kgm2)});
    set.push_back({"believed.ball.center_of_mass", vector(nominal.ball.center_of_mass_B_m)});
    std::string masses;
    for (const sim::Mass& mass : nominal.masses) {
      masses += fmt::format("{}{{ mass = {} }}", masses.empty() ? "" : ", ", sim::number_text(mass.mass_kg));
    }
    if (!masses.empty()) set.push_back({"believed.mass", sim::value_node("[" + masses + "]", sim::kOverrideSource)});
  }
  if (!std::isfinite(nominal.surface.static_friction)) return;
  set.push_back({"believed.surface.static_friction", number_node(nominal.surface.static_friction)});
  set.push_back({"believed.surface.kinetic_friction", number_node(nominal.surface.kinetic_friction)});
}

}  // namespace

std::string errors_allowed() {
  std::string text;
  for (const ErrorKind& kind : kKinds)
    text += fmt::format("{}{}={}", text.empty() ? "" : ",", kind.name, kind.is_angle ? "DEGdeg" : "PERCENT%");
  return text;
}

std::optional<Spec> errors_sweep(const std::string& scenario_file, const std::string& errors_text, std::uint64_t runs,
                                 std::uint64_t seed, std::vector<sim::ScenarioError>& errors) {
  const sim::ScenarioResult nominal = sim::read_scenario(scenario_file);
  errors = nominal.errors;
  if (!nominal.ok()) return std::nullopt;
  Spec spec;
  spec.name = nominal.scenario.name + "_errors";
  spec.source = kSource;
  spec.repeats = runs;
  spec.seed = seed;
  spec.keep = {"end.reason", "end.time", "mu_required.max", "normal_force.min", "surface.static_friction"};
  std::set<std::string> given;
  for (std::size_t begin = 0; begin <= errors_text.size();) {
    const std::size_t comma = std::min(errors_text.find(',', begin), errors_text.size());
    const std::string item = errors_text.substr(begin, comma - begin), name = item.substr(0, item.find('='));
    if (!given.insert(name).second) {
      errors.push_back({kSource, 0, "", item, name + " is given twice; allowed: once"});
    } else if (const std::string why = add_error(item, nominal.scenario, spec.vary); !why.empty())
      errors.push_back({kSource, 0, "", item, why});
    begin = comma + 1;
  }
  // A scenario that says what is believed keeps that.
  if (!nominal.scenario.belief_is_written) believe_nominal(nominal.scenario, spec.set);
  // A floor that is varied is in its column already.
  for (const Variation& v : spec.vary) std::erase(spec.keep, v.key);
  if (errors.empty()) complete_spec(scenario_file, spec, errors);
  return errors.empty() ? std::optional(std::move(spec)) : std::nullopt;
}

}  // namespace ballast::sweep
