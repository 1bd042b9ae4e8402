#include "sim/scenario/check.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "sim/scenario/read_fault.h"
#include "sim/scenario/read_mass.h"

namespace ballast::sim {
namespace {

constexpr double kRoundOff = 1e-9;       // relative, for numbers written by hand that should be equal
constexpr double kUnitTolerance = 1e-6;  // for an orientation written with few digits
constexpr std::size_t kMaxNameLength = 64;

bool good_in_a_name(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_' || c == '.';
}

bool usable_as_folder(const std::string& name) {
  return !name.empty() && name.size() <= kMaxNameLength && name[0] != '.' &&
         std::all_of(name.begin(), name.end(), good_in_a_name);
}

// The file's name with `_` for every character that a folder's name may not have.
std::string default_name(const std::string& source_name) {
  std::string name = std::filesystem::path(source_name).stem().string().substr(0, kMaxNameLength);
  for (char& c : name) {
    if (!good_in_a_name(c)) c = '_';
  }
  for (std::size_t i = 0; i < name.size() && name[i] == '.'; ++i) name[i] = '_';
  return name.empty() ? "scenario" : name;
}

void read_name(TableReader& root, const std::string& source_name, std::string& out) {
  const std::string allowed = "allowed: 1 to 64 of letters, digits, - _ . and no . at the start (it names a folder)";
  const Node* node = root.node("name");
  if (node == nullptr) {
    out = default_name(source_name);
  } else if (node->kind != NodeKind::kString) {
    root.refuse("name", "is not a string; " + allowed);
  } else if (!usable_as_folder(node->text)) {
    root.refuse("name", "cannot name a folder; " + allowed);
  } else {
    out = node->text;
  }
}

void read_ball(TableReader table, std::optional<double>& radius, Ball& ball) {
  radius = table.number("radius", Range::positive("m"));
  const auto mass = table.number("mass", Range::positive("kg"));
  const auto inertia = table.vector<3>("inertia", Range::positive("kg m^2"));
  const auto center = table.vector_or_zero<3>("center_of_mass", Range::any("m"));
  table.refuse_unknown_keys();
  if (radius) ball.radius_m = *radius;
  if (mass) ball.mass_kg = *mass;
  if (inertia) {
    ball.inertia_kgm2 = *inertia;
    for (int j = 0; j < 3; ++j) {
      const double others = (*inertia)[(j + 1) % 3] + (*inertia)[(j + 2) % 3];
      if ((*inertia)[j] > others * (1 + kRoundOff)) {
        table.refuse("inertia." + std::to_string(j),
                     "is impossible for a body; allowed: at most the sum of the other two, " + number_text(others));
      }
    }
  }
  if (center) {
    ball.center_of_mass_B_m = *center;
    const double distance = center->stableNorm();
    if (radius && !(distance < *radius)) {
      table.refuse("center_of_mass", "is " + number_text(distance) +
                                         " m from the geometric centre; allowed: inside the ball, < ball.radius = " +
                                         number_text(*radius));
    }
  }
}

void read_surface(TableReader table, Surface& surface) {
  Range friction = Range::positive();
  friction.infinity_allowed = true;
  const auto static_friction = table.number("static_friction", friction, surface.static_friction);
  const auto kinetic_friction =
      table.number("kinetic_friction", friction, static_friction.value_or(surface.kinetic_friction));
  const auto restitution = table.number("restitution", Range::between(0, 1), surface.restitution);
  table.refuse_unknown_keys();
  if (restitution) surface.restitution = *restitution;
  if (!static_friction || !kinetic_friction) return;
  surface.static_friction = *static_friction;
  surface.kinetic_friction = *kinetic_friction;
  if (*kinetic_friction <= *static_friction) return;
  const Node* written_static = table.node("static_friction");
  const Node* written_kinetic = table.node("kinetic_friction");
  if (written_static != nullptr && written_static->source == kOverrideSource && written_kinetic != nullptr &&
      written_kinetic->source != kOverrideSource) {
    // --set surface.static_friction=0.17 lowers both: the file's kinetic friction is that of the rougher floor.
    surface.kinetic_friction = *static_friction;
  } else {
    table.refuse("kinetic_friction",
                 "is out of range; allowed: > 0 and <= surface.static_friction = " + number_text(*static_friction));
  }
}

void read_initial(TableReader table, std::optional<double> ball_radius_m, InitialState& initial) {
  const std::string orientation_allowed = "allowed: w, x, y, z of a unit quaternion, its length within 1e-6 of 1";
  table.know({"orientation"});
  if (table.has("orientation")) {
    if (const auto q = table.vector<4>("orientation", Range::any())) {
      const double length = q->stableNorm();
      if (std::abs(length - 1) <= kUnitTolerance) {
        const Eigen::Vector4d unit = *q / length;
        initial.orientation = Eigen::Quaterniond(unit[0], unit[1], unit[2], unit[3]);
      } else {
        table.refuse("orientation", "has length " + number_text(length) + "; " + orientation_allowed);
      }
    }
  }
  const auto angular_velocity = table.vector_or_zero<3>("angular_velocity", Range::any("rad/s"));
  const auto position = table.vector_or_zero<2>("position", Range::any("m"));
  const auto velocity = table.vector_or_zero<3>("velocity", Range::any("m/s"));
  const auto height = table.number("height", Range::non_negative("m"), 0.0);
  table.refuse_unknown_keys();
  if (angular_velocity) initial.angular_velocity_B_radps = *angular_velocity;
  if (position) initial.position_W_m = *position;
  if (height) initial.height_m = *height;
  if (!table.has("velocity") || !velocity || !angular_velocity || !ball_radius_m) return;
  // A velocity equal to the rolling one, zdot = omega x r e3, starts rolling.
  const Eigen::Vector3d omega_W = initial.orientation * *angular_velocity;
  const Eigen::Vector3d rolling = omega_W.cross(Eigen::Vector3d(0, 0, *ball_radius_m));
  if ((*velocity - rolling).norm() <= kRoundOff * rolling.norm()) return;
  initial.has_velocity = true;
  initial.velocity_W_mps = *velocity;
}

void read_run(TableReader& root, MassSurroundings& known, Scenario::Run& run) {
  TableReader table = root.table("run");
  const auto actuation = table.word("actuation", {"prescribed", "stepper"}, "stepper");
  const auto period = table.number("control_period", Range::between(1e-6, 10, "s"), run.control_period_s);
  const auto timer = table.number("timer_frequency", Range::between(1e6, 1e8, "Hz"), run.timer_frequency_hz);
  const auto on_violation = table.word("on_violation", {"stop", "continue"}, "stop");
  table.refuse_unknown_keys();
  if (on_violation) run.on_violation = *on_violation == "stop" ? OnViolation::kStop : OnViolation::kContinue;
  if (actuation) {
    run.actuation = *actuation == "stepper" ? Actuation::kStepper : Actuation::kPrescribed;
    known.actuation = run.actuation;
  }
  if (period) {
    run.control_period_s = *period;
    known.control_period_s = period;
  }
  if (timer) {
    run.timer_frequency_hz = *timer;
    known.timer_frequency_hz = timer;
  }
  // Clocks that do not go together are no ground to judge step rates on.
  const auto refuse_clock = [&](std::string_view key, const std::string& message) {
    table.refuse(key, message);
    known.control_period_s.reset();
    known.timer_frequency_hz.reset();
  };
  if (period && timer) {
    const double ticks = *period * *timer;
    if (!(ticks >= 10 && ticks <= 1e9)) {
      refuse_clock(table.has("timer_frequency") ? "timer_frequency" : "control_period",
                   "makes " + number_text(ticks) + " timer ticks per control period; allowed: 10 to 1e9");
    }
  }
  if (period && known.duration_s) {
    const double duration = *known.duration_s;
    if (*period > duration && !table.has("control_period")) {
      root.refuse("duration", "is less than one control period; allowed: >= run.control_period = " +
                                  number_text(*period) + " s, its default");
    } else if (*period > duration) {
      refuse_clock("control_period", "is longer than the run; allowed: <= duration = " + number_text(duration) + " s");
    } else if (duration / *period > 1e9) {
      refuse_clock("control_period", "makes " + number_text(duration / *period) +
                                         " control periods of the duration; allowed: at most 1e9");
    }
  }
}

void read_envelope(TableReader table, Scenario::Envelope& envelope) {
  const auto force = table.number("min_normal_force", Range::non_negative("N"), envelope.min_normal_force_n);
  Range use = Range::between(0, 1);
  use.low_excluded = true;
  const auto friction = table.number("friction_use", use, envelope.friction_use);
  table.refuse_unknown_keys();
  if (force) envelope.min_normal_force_n = *force;
  if (friction) envelope.friction_use = *friction;
}

void read_external_force(TableReader& root, Scenario& scenario) {
  if (!root.is_table("external_force")) {
    if (const auto force = root.vector_or_zero<3>("external_force", Range::any("N"))) {
      scenario.external_force_W_n = *force;
    }
    return;
  }
  TableReader table = root.table("external_force");
  const auto times = read_times(table);
  const auto forces = table.vectors("forces", 2, kMaxTableEntries, Range::any("N"));
  table.refuse_unknown_keys();
  if (!times || !forces) return;
  if (forces->size() != times->size()) {
    table.refuse("forces", "has " + std::to_string(forces->size()) + " elements; allowed: one for each of the " +
                               std::to_string(times->size()) + " times");
    return;
  }
  for (std::size_t i = 1; i < times->size(); ++i) {
    const Eigen::Vector3d rate = ((*forces)[i] - (*forces)[i - 1]) / ((*times)[i] - (*times)[i - 1]);
    if (Range::any().contains(rate.stableNorm())) continue;
    table.refuse("forces." + std::to_string(i), "changes too fast; allowed: a rate of at most " +
                                                    number_text(kMostSize) + " N/s from each force to the next");
    return;
  }
  scenario.force_table = {*times, *forces};
}

void read_drag(TableReader table, Drag& drag) {
  const bool present = table.present();
  const auto coefficient = table.number("coefficient", Range::non_negative("kg/m"),
                                        present ? std::nullopt : std::optional(drag.coefficient_kgpm));
  const auto wind = table.vector_or_zero<3>("wind", Range::any("m/s"));
  table.refuse_unknown_keys();
  if (coefficient) drag.coefficient_kgpm = *coefficient;
  if (wind) drag.wind_W_mps = *wind;
}

void read_published(TableReader table, std::vector<Scenario::Published>& published) {
  const auto quantity = table.word("quantity", {"mu_required.max", "normal_force.min", "end.time"});
  const auto value = table.number("value", Range::any());
  const auto source = table.text("source");
  table.refuse_unknown_keys();
  if (quantity && value && source) published.push_back({*quantity, *value, *source});
}

// Refuses a start in sliding on a floor of infinite friction.
void check_start(TableReader& root, const Scenario& scenario) {
  const auto& initial = scenario.initial;
  if (!initial.has_velocity || initial.height_m > 0 || initial.velocity_W_mps[2] != 0) return;
  if (std::isfinite(scenario.surface.kinetic_friction)) return;
  root.refuse("initial.velocity",
              "starts sliding on a floor of infinite friction; allowed: the rolling velocity, or a finite "
              "surface.kinetic_friction");
}

}  // namespace

Scenario check_scenario(const Node& root_node, ReadContext& context) {
  Scenario scenario;
  MassSurroundings known;
  TableReader root(&root_node, "", context);
  read_name(root, context.source_name, scenario.name);
  known.duration_s = root.number("duration", Range::positive("s"));
  known.gravity_mps2 = root.number("gravity", Range::non_negative("m/s^2"));
  read_external_force(root, scenario);
  if (known.duration_s) scenario.duration_s = *known.duration_s;
  if (known.gravity_mps2) scenario.gravity_mps2 = *known.gravity_mps2;
  read_ball(root.table("ball"), known.ball_radius_m, scenario.ball);
  read_surface(root.table("surface"), scenario.surface);
  read_drag(root.table("drag"), scenario.drag);
  read_initial(root.table("initial"), known.ball_radius_m, scenario.initial);
  read_run(root, known, scenario.run);
  read_envelope(root.table("envelope"), scenario.envelope);
  if (const auto seed = root.integer("seed", 0, std::numeric_limits<std::int64_t>::max(), 0)) {
    scenario.seed = static_cast<std::uint64_t>(*seed);
  }

  const std::string masses_allowed =
      "an array of at most " + std::to_string(firmware::kMaxMasses) + " tables, each headed [[mass]]";
  std::vector<TableReader> masses = root.tables("mass", masses_allowed);
  if (masses.size() > static_cast<std::size_t>(firmware::kMaxMasses)) {
    root.refuse("mass", "has " + std::to_string(masses.size()) + " entries; allowed: " + masses_allowed);
  }
  known.mass_count = std::max(1, static_cast<int>(masses.size()));
  for (TableReader& mass : masses) scenario.masses.push_back(read_mass(mass, known));

  for (TableReader& table : root.tables("fault", "an array of tables, each headed [[fault]]")) {
    if (const auto fault = read_fault(table, scenario)) scenario.faults.push_back(*fault);
  }
  std::stable_sort(scenario.faults.begin(), scenario.faults.end(),
                   [](const Fault& a, const Fault& b) { return a.time_s < b.time_s; });

  for (TableReader& table : root.tables("published", "an array of tables, each headed [[published]]")) {
    read_published(table, scenario.published);
  }

  root.refuse_unknown_keys();
  check_start(root, scenario);
  return scenario;
}

}  // namespace ballast::sim
