#include "sim/scenario/check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "sim/plant/local_floor.h"
#include "sim/scenario/read_believed.h"
#include "sim/scenario/read_fault.h"
#include "sim/scenario/read_mass.h"
#include "sim/scenario/read_sensors.h"
#include "sim/scenario/read_world.h"
#include "sim/sensors/sensors.h"

namespace ballast::sim {
namespace {

constexpr double kMaxHold_s = 1000;
constexpr double kRoundOff = 1e-9;       // relative, for numbers written by hand that should be equal
constexpr double kUnitTolerance = 1e-6;  // for an orientation written with few digits
constexpr std::size_t kMaxNameLength = 64;

bool good_in_a_name(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_' || c == '.';
}

}  // namespace

bool usable_as_folder(const std::string& name) {
  return !name.empty() && name.size() <= kMaxNameLength && name[0] != '.' &&
         std::all_of(name.begin(), name.end(), good_in_a_name);
}

std::string default_name(const std::string& source_name) {
  std::string name = std::filesystem::path(source_name).stem().string().substr(0, kMaxNameLength);
  for (char& c : name) {
    if (!good_in_a_name(c)) c = '_';
  }
  for (std::size_t i = 0; i < name.size() && name[i] == '.'; ++i) name[i] = '_';
  return name.empty() ? "scenario" : name;
}

namespace {

void read_name(TableReader& root, const std::string& source_name, std::string& out) {
  const std::string allowed = std::string("allowed: ") + kFolderNames;
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

void read_initial(TableReader table, std::optional<double> ball_radius_m, InitialState& initial) {
  table.know({"orientation"});
  if (table.has("orientation")) {
    if (const auto q = table.vector<4>("orientation", Range::any())) {
      const double length = q->stableNorm();
      if (std::abs(length - 1) <= kUnitTolerance) {
        const Eigen::Vector4d unit = *q / length;
        initial.orientation = Eigen::Quaterniond(unit[0], unit[1], unit[2], unit[3]);
      } else {
        table.refuse("orientation",
                     "has length {}; allowed: w, x, y, z of a unit quaternion, its length within 1e-6 of 1", length);
      }
    }
  }
  const auto angular_velocity = table.vector_or_zero<3>("angular_velocity", Range::any("rad/s"));
  initial.position_W_m = table.vector_or_zero<2>("position", Range::any("m")).value_or(initial.position_W_m);
  const auto velocity = table.vector_or_zero<3>("velocity", Range::any("m/s"));
  initial.height_m = table.number("height", Range::non_negative("m"), 0.0).value_or(0);
  table.refuse_unknown_keys();
  if (angular_velocity) initial.angular_velocity_B_radps = *angular_velocity;
  if (!table.has("velocity") || !velocity || !angular_velocity || !ball_radius_m) return;
  // A velocity equal to the rolling one, zdot = omega x r e3, starts rolling.
  const Eigen::Vector3d omega_W = initial.orientation * *angular_velocity;
  const Eigen::Vector3d rolling = omega_W.cross(Eigen::Vector3d(0, 0, *ball_radius_m));
  if ((*velocity - rolling).norm() <= kRoundOff * rolling.norm()) return;
  initial.has_velocity = true;
  initial.velocity_W_mps = *velocity;
}

// A filter finds the gyro's bias in the hold.
constexpr double kHoldToEstimate_s = 5;

// Whether [sensors] asks for an estimated attitude, its default. That table is read, and checked, after [run].
bool estimates_attitude(const Node& root) {
  const Node* sensors = root.find("sensors");
  if (sensors == nullptr) return false;
  const Node* attitude = sensors->find("attitude");
  return attitude == nullptr || attitude->text == "estimated";
}

void read_hold(TableReader& table, std::optional<double> period_s, bool estimates, Scenario::Run& run) {
  // A default that is no whole number of periods is the next one.
  const double to_estimate_s =
      period_s ? std::ceil(kHoldToEstimate_s / *period_s - 1e-9) * *period_s : kHoldToEstimate_s;
  const auto hold = table.number("hold", Range::between(0, kMaxHold_s, "s"), estimates ? to_estimate_s : run.hold_s);
  if (!hold || !period_s) return;
  const double ticks = *hold / *period_s, whole = std::round(ticks);
  if (std::abs(ticks - whole) > 1e-9 * std::max(1.0, whole)) {
    table.refuse("hold", "is no whole number of control periods; allowed: {} s and others that are", whole * *period_s);
    return;
  }
  run.hold_s = *hold;
}

void read_run(TableReader& root, bool estimates, MassSurroundings& known, Scenario::Run& run) {
  TableReader table = root.table("run");
  known.actuation = table.choice<Actuation>("actuation", {"prescribed", "stepper", "ideal"}, run.actuation);
  const auto period = table.number("control_period", Range::between(1e-6, 10, "s"), run.control_period_s);
  const auto timer = table.number("timer_frequency", Range::between(1e6, 1e8, "Hz"), run.timer_frequency_hz);
  run.on_violation =
      table.choice<OnViolation>("on_violation", {"stop", "continue"}, run.on_violation).value_or(run.on_violation);
  const auto tolerance = table.number("tolerance", Range::between(1e-14, 1e-8), run.tolerance);
  read_hold(table, period, estimates, run);
  table.refuse_unknown_keys();
  run.actuation = known.actuation.value_or(run.actuation);
  run.control_period_s = period.value_or(run.control_period_s);
  run.timer_frequency_hz = timer.value_or(run.timer_frequency_hz);
  run.tolerance = tolerance.value_or(run.tolerance);
  known.control_period_s = period;
  known.timer_frequency_hz = timer;
  // Clocks that do not go together are no ground to judge step rates on.
  const auto refuse_clock = [&](std::string_view key, const std::string& why) {
    table.refuse(key, why);
    known.control_period_s.reset();
    known.timer_frequency_hz.reset();
  };
  if (period && timer) {
    const double ticks = *period * *timer;
    if (!(ticks >= 10 && ticks <= 1e9)) {
      refuse_clock(table.has("timer_frequency") ? "timer_frequency" : "control_period",
                   message("makes {} timer ticks per control period; allowed: 10 to 1e9", ticks));
    }
  }
  if (period && known.duration_s) {
    const double duration = *known.duration_s;
    if (*period > duration && !table.has("control_period")) {
      root.refuse("duration", "is less than one control period; allowed: >= run.control_period = {} s, its default",
                  *period);
    } else if (*period > duration) {
      refuse_clock("control_period", message("is longer than the run; allowed: <= duration = {} s", duration));
    } else if (duration / *period > 1e9) {
      refuse_clock("control_period",
                   message("makes {} control periods of the duration; allowed: at most 1e9", duration / *period));
    }
  }
}

void read_envelope(TableReader table, Scenario::Envelope& envelope) {
  envelope.min_normal_force_n =
      table.number("min_normal_force", Range::non_negative("N"), envelope.min_normal_force_n).value_or(0);
  Range use = Range::between(0, 1);
  use.low_excluded = true;
  envelope.friction_use = table.number("friction_use", use, envelope.friction_use).value_or(1);
  table.refuse_unknown_keys();
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
    table.refuse("forces", "has {} elements; allowed: one for each of the {} times", forces->size(), times->size());
    return;
  }
  for (std::size_t i = 1; i < times->size(); ++i) {
    const Eigen::Vector3d rate = ((*forces)[i] - (*forces)[i - 1]) / ((*times)[i] - (*times)[i - 1]);
    if (Range::any().contains(rate.stableNorm())) continue;
    table.refuse(message("forces.{}", i),
                 "changes too fast; allowed: a rate of at most {} N/s from each force to the next", kMostSize);
    return;
  }
  scenario.force_table = {*times, *forces};
}

void read_drag(TableReader table, Drag& drag) {
  const bool present = table.present();
  const auto coefficient = table.number("coefficient", Range::non_negative("kg/m"),
                                        present ? std::nullopt : std::optional(drag.coefficient_kgpm));
  drag.wind_W_mps = table.vector_or_zero<3>("wind", Range::any("m/s")).value_or(drag.wind_W_mps);
  table.refuse_unknown_keys();
  drag.coefficient_kgpm = coefficient.value_or(0);
}

void read_published(TableReader table, std::vector<Scenario::Published>& published) {
  constexpr std::array<std::string_view, 3> kQuantities{"mu_required.max", "normal_force.min", "end.time"};
  const auto quantity = table.choice("quantity", kQuantities);
  const auto value = table.number("value", Range::any());
  const auto source = table.text("source");
  table.refuse_unknown_keys();
  if (quantity && value && source) published.push_back({std::string(kQuantities[*quantity]), *value, *source});
}

// An array of so many numbers, each finite; anything else is none.
template <int kSize>
std::optional<Eigen::Matrix<double, kSize, 1>> finite_numbers(const Node* node) {
  if (node == nullptr || node->kind != NodeKind::kArray || node->items.size() != kSize) return std::nullopt;
  Eigen::Matrix<double, kSize, 1> out;
  for (std::size_t j = 0; j < kSize; ++j) {
    const Node& item = node->items[j];
    const bool number = item.kind == NodeKind::kFloat || item.kind == NodeKind::kInteger;
    if (!number || !std::isfinite(item.number)) return std::nullopt;
    out[static_cast<Eigen::Index>(j)] = item.number;
  }
  return out;
}

// [plan] as `ballast plan` writes it. Anything else is ignored.
Scenario::Plan read_plan(const Node& root) {
  Scenario::Plan out;
  const Node* plan = root.find("plan");
  out.present = plan != nullptr && plan->kind == NodeKind::kTable;
  if (!out.present) return out;
  out.goal_W_m = finite_numbers<2>(plan->find("goal"));
  const Node* start = plan->find("start");
  if (start == nullptr || start->kind != NodeKind::kTable) return out;
  const auto q = finite_numbers<4>(start->find("orientation"));
  const auto omega = finite_numbers<3>(start->find("angular_velocity"));
  const auto place = finite_numbers<2>(start->find("position"));
  if (!q || !omega || !place || !(std::abs(q->norm() - 1) <= kUnitTolerance)) return out;
  const Eigen::Vector4d unit = q->normalized();
  out.start.emplace();
  out.start->orientation = Eigen::Quaterniond(unit[0], unit[1], unit[2], unit[3]);
  out.start->angular_velocity_B_radps = *omega;
  out.start->position_W_m = *place;
  return out;
}

void read_control(TableReader table, bool planned, Scenario::Control& control) {
  control.tracking = table.boolean("tracking", planned).value_or(planned);
  control.governor = table.boolean("governor", control.tracking).value_or(control.tracking);
  Range use = Range::between(0, 1);
  use.low_excluded = true;
  control.friction_use = table.number("friction_use", use, control.friction_use).value_or(control.friction_use);
  TableReader error = table.table("belief_error");
  Scenario::Control::BeliefError& off = control.belief_error;
  off.mass_share = error.number("mass", Range::between(0, off.kMostMassShare), 0).value_or(0);
  off.center_of_mass_m = error.number("center_of_mass", Range::non_negative("m"), 0).value_or(0);
  error.refuse_unknown_keys();
  table.refuse_unknown_keys();
}

// The accelerometer is in the ball, and a delayed sample comes before the run ends.
void check_sensors(TableReader& root, const Scenario& scenario) {
  const SensorModel& sensors = scenario.sensors;
  if (!sensors.present) return;
  if (const double distance = sensors.accelerometer_position_B_m.stableNorm(); distance >= scenario.ball.radius_m) {
    root.refuse("sensors.accelerometer.position",
                "is {} m from the geometric centre; allowed: inside the ball, < ball.radius = {}", distance,
                scenario.ball.radius_m);
  }
  const double period_s = scenario.run.control_period_s;
  const auto last = static_cast<std::int64_t>(scenario.duration_s / period_s);
  const auto check_delay = [&](std::string_view key, double rate_hz, double delay_s) {
    const std::int64_t every = ticks_per_sample(rate_hz, period_s);
    const std::int64_t first = scenario.run.first_tick() / every * every;  // <= 0: rounded towards 0
    if (first + delay_ticks(delay_s, period_s) <= last) return;
    root.refuse(key, "is longer than the run, in which no sample would arrive; allowed: at most {} s at this rate",
                static_cast<double>(last - first) * period_s);
  };
  check_delay("sensors.latency", sensors.rate_hz, sensors.latency_s);
  if (sensors.fix.rate_hz > 0) check_delay("sensors.position_fix.delay", sensors.fix.rate_hz, sensors.fix.delay_s);
}

// The controller can be armed once a sample of the IMU has arrived, and is armed at the end of the hold.
void check_first_sample(TableReader& root, const Scenario& scenario) {
  const SensorModel& sensors = scenario.sensors;
  if (!sensors.attitude_estimated || !has_controller(scenario.run.actuation)) return;
  const double period_s = scenario.run.control_period_s;
  const std::int64_t every = ticks_per_sample(sensors.rate_hz, period_s);
  const std::int64_t needed = every + delay_ticks(sensors.latency_s, period_s) + kCountdownTicks - 1;
  if (every == 0 || scenario.run.lead_ticks() >= needed) return;
  const double others_s = static_cast<double>(needed - every) * period_s;
  if (static_cast<double>(every) * period_s > kMaxHold_s - others_s) {
    root.refuse("sensors.rate",
                "gives no sample in the longest hold of {} s, and without one there is no attitude; allowed: at least "
                "{} Hz",
                kMaxHold_s, 1 / (kMaxHold_s - others_s));
    return;
  }
  root.refuse("run.hold",
              "ends before a sample of the IMU is sure to have come, and without one there is no attitude; allowed: at "
              "least {} s at this sensors.rate and latency",
              static_cast<double>(needed) * period_s);
}

// Refuses a start in sliding on a floor of infinite friction.
void check_start(TableReader& root, const Scenario& scenario) {
  const auto& initial = scenario.initial;
  if (!initial.has_velocity || initial.height_m > 0 || initial.velocity_W_mps[2] != 0) return;
  LocalFloor floor(scenario.surface);
  floor.stand_at(initial.position_W_m);
  if (std::isfinite(floor.kinetic_friction())) return;
  root.refuse("initial.velocity",
              "starts sliding on a floor of infinite friction; allowed: the rolling velocity, or a finite "
              "surface.kinetic_friction");
}

}  // namespace

Scenario check_scenario(const Node& root_node, ReadContext& context) {
  Scenario scenario;
  MassSurroundings known;
  TableReader root(&root_node, "", context);
  root.know({"task", "plan"});  // for and from ballast plan; a run ignores them
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
  read_run(root, estimates_attitude(root_node), known, scenario.run);
  read_envelope(root.table("envelope"), scenario.envelope);
  if (const auto seed = root.integer("seed", 0, std::numeric_limits<std::int64_t>::max(), 0)) {
    scenario.seed = static_cast<std::uint64_t>(*seed);
  }

  scenario.plan = read_plan(root_node);
  read_control(root.table("control"), scenario.plan.present, scenario.control);
  known.governor = scenario.control.governor;

  const std::string masses_allowed = message("an array of at most {} tables, each headed [[mass]]", kMaxMasses);
  std::vector<TableReader> masses = root.tables("mass", masses_allowed);
  if (masses.size() > static_cast<std::size_t>(kMaxMasses)) {
    root.refuse("mass", "has {} entries; allowed: {}", masses.size(), masses_allowed);
  }
  known.mass_count = std::max(1, static_cast<int>(masses.size()));
  for (TableReader& mass : masses) scenario.masses.push_back(read_mass(mass, known));

  scenario.sensors =
      read_sensors(root.table("sensors"), known.control_period_s, static_cast<int>(scenario.masses.size()));

  for (TableReader& table : root.tables("fault", "an array of tables, each headed [[fault]]")) {
    if (const auto fault = read_fault(table, scenario)) scenario.faults.push_back(*fault);
  }
  std::stable_sort(scenario.faults.begin(), scenario.faults.end(),
                   [](const Fault& a, const Fault& b) { return a.time_s < b.time_s; });

  for (TableReader& table : root.tables("published", "an array of tables, each headed [[published]]")) {
    read_published(table, scenario.published);
  }

  // A belief that is held against a robot with errors would only repeat them.
  root.know({"believed"});
  if (context.errors.empty() && root.has("believed")) read_believed(root_node, known, context, scenario);
  scenario.belief_is_written = root.has("believed");
  if (context.errors.empty() && !scenario.believed && !scenario.surface.patches.empty()) {
    World bare = scenario;
    bare.surface.patches.clear();
    scenario.believed = std::move(bare);
  }

  root.refuse_unknown_keys();
  check_start(root, scenario);
  if (context.errors.empty()) check_sensors(root, scenario);
  if (context.errors.empty()) check_first_sample(root, scenario);
  return scenario;
}

}  // namespace ballast::sim
