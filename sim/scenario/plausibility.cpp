#include "sim/scenario/plausibility.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace ballast::sim {
namespace {

constexpr double kGreatestGravity_mps2 = 30;   // Jupiter: 24.8
constexpr double kGreatestRadius_m = 20;       // the largest rolling robots are a few metres across
constexpr double kGreatestDensity = 12'000;    // kg/m^3 of the whole ball: more than lead throughout
constexpr double kGreatestFriction = 2;        // rubber on dry asphalt: about 1
constexpr double kGreatestResistance = 0.3;    // loose sand
constexpr double kGreatestSpinFriction = 0.1;  // of ball.radius
constexpr double kSteepest_rad = 0.6;          // steeper than any street
constexpr double kLeastCreep = 1e-2;           // of the default: the integrator follows stops that take as long as this
constexpr double kFarFromTruth = 2;            // factor of a belief
constexpr double kSureSigmas = 3;              // of what is drawn for a sensor
constexpr double kTouching = 2e-3;             // of ball.radius: rails nearer than this cannot be built
constexpr double kRounding = 1 + 1e-9;         // inertias written with ten digits

// The rail coordinates at which a mass may stand.
std::array<double, 2> reach(const firmware::Rail& rail) {
  if (rail.shape == firmware::RailShape::kCircle) return {0, 2 * std::numbers::pi};
  if (std::isfinite(rail.lower_end) && std::isfinite(rail.upper_end)) return {rail.lower_end, rail.upper_end};
  return {0, firmware::length_m(rail)};
}

Eigen::Vector3d point(const firmware::Rail& rail, double theta) { return firmware::evaluate(rail, theta).position; }

bool same_curve(const firmware::Rail& a, const firmware::Rail& b, double touching_m) {
  constexpr int kProbes = 8, kSamples = 256;
  const auto [low, high] = reach(a);
  const auto [b_low, b_high] = reach(b);
  const double unit_m = b.shape == firmware::RailShape::kCircle ? b.radius_m : 1;
  const double allowed_m = touching_m + unit_m * (b_high - b_low) / (2 * kSamples);
  for (int i = 0; i < kProbes; ++i) {
    const Eigen::Vector3d here = point(a, low + (high - low) * i / (kProbes - 1));
    double nearest_m = std::numeric_limits<double>::infinity();
    for (int k = 0; k <= kSamples; ++k) {
      nearest_m = std::min(nearest_m, (point(b, b_low + (b_high - b_low) * k / kSamples) - here).norm());
    }
    if (nearest_m > allowed_m) return false;
  }
  return true;
}

void warn_of_ball(TableReader ball, const Scenario& scenario) {
  const double radius_m = scenario.ball.radius_m, mass_kg = scenario.ball.mass_kg;
  if (radius_m > kGreatestRadius_m) {
    ball.warn("radius", "is {} m; a radius in mm would be {} m", radius_m, radius_m / 1000);
  }
  const double most = mass_kg * radius_m * radius_m;
  for (int j = 0; j < 3; ++j) {
    if (scenario.ball.inertia_kgm2[j] <= most * kRounding) continue;
    ball.warn(message("inertia.{}", j),
              "is more than {} kg m^2 = ball.mass * ball.radius^2, which no body inside the ball exceeds; a hollow "
              "sphere has two thirds of that",
              most);
    break;
  }
  double total_kg = mass_kg;
  for (const Mass& mass : scenario.masses) total_kg += mass.mass_kg;
  const double density = total_kg / (4.0 / 3.0 * std::numbers::pi * radius_m * radius_m * radius_m);
  if (density > kGreatestDensity) {
    ball.warn("mass", "makes the whole robot {} kg/m^3, denser than lead; masses in g would be kg / 1000",
              std::round(density));
  }
}

void warn_of_idle_patches(TableReader& surface) {
  std::vector<TableReader> patches = surface.tables("patch", "");
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const TableReader& patch = patches[i];
    if (patch.has("static_friction") || patch.has("kinetic_friction") || patch.has("rolling_resistance")) continue;
    surface.warn(message("patch.{}", i),
                 "gives no static_friction, kinetic_friction or rolling_resistance, so that it is like the floor");
  }
}

void warn_of_creep(TableReader& surface, const Scenario& scenario) {
  const Surface& floor = scenario.surface;
  const auto resists = [](const SurfacePatch& patch) { return patch.rolling_resistance > 0; };
  if (!(floor.rolling_resistance > 0 || floor.spin_friction_m > 0) &&
      std::none_of(floor.patches.begin(), floor.patches.end(), resists)) {
    return;
  }
  World usual = scenario;
  usual.surface.creep_radps = 0;
  const double least = kLeastCreep * usual.creep_radps();
  if (!(floor.creep_radps > 0 && floor.creep_radps < least)) return;
  surface.warn("creep",
               "is less than a hundredth of the default, {} rad/s: a ball at rest on this floor takes very small steps "
               "of time, and the run may last long",
               usual.creep_radps());
}

void warn_of_surface(TableReader& root, const Scenario& scenario) {
  TableReader surface = root.table("surface");
  const double friction = scenario.surface.static_friction;
  if (!surface.has("static_friction")) {
    root.warn("surface.static_friction",
              "is not given: friction is infinite, and the monitor never trips on it; rubber on a floor has about 0.5, "
              "steel on steel 0.35");
  } else if (std::isfinite(friction) && friction > kGreatestFriction) {
    surface.warn("static_friction", "is more than any floor has; rubber on dry asphalt has about 1");
  }
  if (scenario.surface.rolling_resistance > kGreatestResistance) {
    surface.warn("rolling_resistance", "is more than that of loose sand, about 0.3; a ball on carpet has 0.03 to 0.1");
  }
  for (std::size_t i = 0; i < scenario.surface.patches.size(); ++i) {
    const SurfacePatch& patch = scenario.surface.patches[i];
    if (std::isfinite(patch.static_friction) && patch.static_friction > kGreatestFriction) {
      surface.warn(message("patch.{}.static_friction", i),
                   "is more than any floor has; rubber on dry asphalt has about 1");
    }
    if (patch.rolling_resistance > kGreatestResistance) {
      surface.warn(message("patch.{}.rolling_resistance", i), "is more than that of loose sand, about 0.3");
    }
  }
  warn_of_idle_patches(surface);
  warn_of_creep(surface, scenario);
  if (scenario.surface.spin_friction_m > kGreatestSpinFriction * scenario.ball.radius_m) {
    surface.warn("spin_friction", "is more than {} m = ball.radius / 10, so that contact would be as wide as the ball",
                 kGreatestSpinFriction * scenario.ball.radius_m);
  }
  if (scenario.surface.slope_rad > kSteepest_rad) {
    surface.table("slope").warn("angle", "is in radians; if {} degrees are meant, write {}", scenario.surface.slope_rad,
                                scenario.surface.slope_rad * std::numbers::pi / 180);
  }
}

void warn_of_direction(TableReader direction) {
  const auto degrees = [&](std::string_view key, double most) {
    const Node* node = direction.node(key);
    if (node == nullptr || !(std::abs(node->number) > most * kRounding)) return;
    direction.warn(key, "is in radians; if {} degrees are meant, write {}", node->number,
                   node->number * std::numbers::pi / 180);
  };
  degrees("azimuth", 2 * std::numbers::pi);
  degrees("elevation", std::numbers::pi / 2);
}

void warn_of_rails(std::vector<TableReader>& tables, const Scenario& scenario) {
  const double touching_m = kTouching * scenario.ball.radius_m;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    TableReader rail = tables[i].table("rail");
    if (scenario.masses[i].rail.shape == firmware::RailShape::kCircle && rail.has("direction"))
      warn_of_direction(rail.table("direction"));
    for (std::size_t k = 0; k < i; ++k) {
      const Mass &a = scenario.masses[k], &b = scenario.masses[i];
      if (!a.trajectory.times_s.empty() || !b.trajectory.times_s.empty()) continue;
      const double distance_m = rail_distance_m(a.rail, b.rail);
      if (distance_m > touching_m) continue;
      if (same_curve(a.rail, b.rail, touching_m)) {
        tables[i].warn("rail", "is the rail of mass.{}: the two masses can run into each other", k);
      } else {
        tables[i].warn(
            "rail",
            "comes within {} m of the rail of mass.{}: rails that cross cannot both be built, and the masses "
            "can meet there",
            distance_m, k);
      }
    }
  }
}

}  // namespace

double rail_distance_m(const firmware::Rail& a, const firmware::Rail& b) {
  constexpr int kSamples = 97;
  const auto [a_low, a_high] = reach(a);
  const auto [b_low, b_high] = reach(b);
  double step_a = (a_high - a_low) / (kSamples - 1), step_b = (b_high - b_low) / (kSamples - 1);
  std::array<Eigen::Vector3d, kSamples> points_b;
  for (int k = 0; k < kSamples; ++k) points_b[static_cast<std::size_t>(k)] = point(b, b_low + step_b * k);
  double best_m = std::numeric_limits<double>::infinity(), at_a = a_low, at_b = b_low;
  for (int i = 0; i < kSamples; ++i) {
    const Eigen::Vector3d here = point(a, a_low + step_a * i);
    for (int k = 0; k < kSamples; ++k) {
      const double distance_m = (here - points_b[static_cast<std::size_t>(k)]).norm();
      if (!(distance_m < best_m)) continue;
      best_m = distance_m;
      at_a = a_low + step_a * i;
      at_b = b_low + step_b * k;
    }
  }
  // A pattern search about the nearest samples: a few moves for each of some 14 halvings.
  for (int move = 0; move < 1000 && step_a > 1e-6 * (a_high - a_low); ++move) {
    bool better = false;
    for (const auto& [da, db] : {std::array{1.0, 0.0},
                                 {-1.0, 0.0},
                                 {0.0, 1.0},
                                 {0.0, -1.0},
                                 {1.0, 1.0},
                                 {-1.0, -1.0},
                                 {1.0, -1.0},
                                 {-1.0, 1.0}}) {
      const double to_a = std::clamp(at_a + da * step_a, a_low, a_high);
      const double to_b = std::clamp(at_b + db * step_b, b_low, b_high);
      const double distance_m = (point(a, to_a) - point(b, to_b)).norm();
      if (!(distance_m < best_m)) continue;
      best_m = distance_m;
      at_a = to_a;
      at_b = to_b;
      better = true;
    }
    if (better) continue;
    step_a /= 2;
    step_b /= 2;
  }
  return best_m;
}

namespace {

void warn_of_unplanned_task(TableReader& root, const std::string& source_name, const Scenario& scenario) {
  root.know({"task", "plan"});
  const auto moves = [](const Mass& mass) { return !mass.motion.empty() || !mass.trajectory.times_s.empty(); };
  const bool any_moves = std::any_of(scenario.masses.begin(), scenario.masses.end(), moves);
  if (!root.has("task") || root.has("plan") || any_moves) return;
  root.warn("task", "has no motion yet, so no mass moves; `ballast plan {}` finds one", source_name);
}

// The text of a computed number, with as many digits as mean something.
std::string rounded_text(double value) { return fmt::format("{:.3g}", value); }

// A triad's error at rest, against the largest that leaves an attitude to estimate.
void warn_of_triad(TableReader triad, const ImuTriad& model, double rate_hz, double rest, double most,
                   const std::string& unit, const char* most_text) {
  const double noise = model.noise_density * std::sqrt(rate_hz / 2);
  if (model.range > 0 && model.range - model.resolution <= rest) {
    triad.warn("range", "is reached at rest, where an axis reads {} {}: no attitude can be estimated",
               rounded_text(rest), unit);
    return;
  }
  const double room = model.range > 0 ? (model.range - rest) / kSureSigmas : most;
  const auto check = [&](const char* key, const char* what, double value) {
    if (value <= std::min(room, most)) return;
    if (room < most) {
      triad.warn(
          key,
          "gives {} of {} {}, which may take readings at rest to the end of the range of {} {}: then no attitude "
          "can be estimated",
          what, rounded_text(value), unit, rounded_text(model.range), unit);
    } else {
      triad.warn(key, "gives {} of {} {}, {} {} {}: no attitude can be estimated", what, rounded_text(value), unit,
                 most_text, rounded_text(most), unit);
    }
  };
  check("bias", "an offset", model.bias);
  check("noise_density", "a noise of each sample", noise);
}

// The filter on board needs samples that say something of the attitude.
void warn_of_sensors(TableReader sensors, const Scenario& scenario) {
  const SensorModel& model = scenario.sensors;
  if (!model.attitude_estimated || !has_controller(scenario.run.actuation) || scenario.gravity_mps2 == 0) return;
  const double slope = scenario.surface.slope_rad, downhill = scenario.surface.downhill_rad;
  const Eigen::Vector3d up_W(-std::sin(slope) * std::cos(downhill), -std::sin(slope) * std::sin(downhill),
                             std::cos(slope));
  const Eigen::Vector3d up_B = scenario.initial.orientation.conjugate() * up_W;
  const double most_radps = std::sqrt(scenario.gravity_mps2 / scenario.ball.radius_m);
  warn_of_triad(sensors.table("gyro"), model.gyro, model.rate_hz, 0, most_radps, "rad/s",
                "more than the rate at which this ball rocks, about");
  warn_of_triad(sensors.table("accelerometer"), model.accelerometer, model.rate_hz,
                scenario.gravity_mps2 * up_B.cwiseAbs().maxCoeff(), scenario.gravity_mps2, "m/s^2",
                "more than gravity,");
}

// A belief is meant to differ, but rarely by that much.
void warn_of_belief(TableReader believed, const Scenario& scenario) {
  if (!believed.present() || !scenario.believed) return;
  const World& belief = *scenario.believed;
  const auto check = [](TableReader& table, const std::string& key, double value, double truth) {
    if (!(value > 0 && truth > 0 && std::isfinite(value) && std::isfinite(truth))) return;
    if (value < kFarFromTruth * truth && truth < kFarFromTruth * value) return;
    table.warn(key, "is believed where the truth is {}, a factor of {} away", truth,
               std::round(10 * std::max(value / truth, truth / value)) / 10);
  };
  TableReader ball = believed.table("ball"), surface = believed.table("surface");
  check(ball, "radius", belief.ball.radius_m, scenario.ball.radius_m);
  check(ball, "mass", belief.ball.mass_kg, scenario.ball.mass_kg);
  for (int j = 0; j < 3; ++j) {
    check(ball, message("inertia.{}", j), belief.ball.inertia_kgm2[j], scenario.ball.inertia_kgm2[j]);
  }
  check(surface, "static_friction", belief.surface.static_friction, scenario.surface.static_friction);
  check(surface, "rolling_resistance", belief.surface.rolling_resistance, scenario.surface.rolling_resistance);
  for (std::size_t i = 0; i < belief.masses.size(); ++i) {
    check(believed, message("mass.{}.mass", i), belief.masses[i].mass_kg, scenario.masses[i].mass_kg);
  }
}

}  // namespace

void warn_of_implausible_values(const Node& root_node, const std::string& source_name, const Scenario& scenario,
                                std::vector<ScenarioError>& warnings) {
  std::vector<ScenarioError> errors;  // none: the scenario has been accepted
  ReadContext context{source_name, errors, warnings};
  TableReader root(&root_node, "", context);
  if (scenario.gravity_mps2 > kGreatestGravity_mps2) {
    root.warn("gravity", "is {} m/s^2; the Earth's is 9.81 m/s^2, which is 9810 mm/s^2 and 32.2 ft/s^2",
              scenario.gravity_mps2);
  }
  if (scenario.gravity_mps2 == 0 && !(scenario.external_force_W_n[2] < 0)) {
    root.warn("gravity", "is zero: nothing presses the ball on the floor, so it detaches at once");
  }
  warn_of_unplanned_task(root, source_name, scenario);
  warn_of_ball(root.table("ball"), scenario);
  warn_of_surface(root, scenario);
  warn_of_sensors(root.table("sensors"), scenario);
  warn_of_belief(root.table("believed"), scenario);
  std::vector<TableReader> masses = root.tables("mass", "");
  if (masses.size() == scenario.masses.size()) warn_of_rails(masses, scenario);
}

}  // namespace ballast::sim
