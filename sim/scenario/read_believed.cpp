#include "sim/scenario/read_believed.h"

#include <algorithm>

#include "sim/scenario/read_world.h"

namespace ballast::sim {

namespace {

void read_believed_ball(TableReader table, Ball& ball) {
  if (!table.present()) return;
  const auto radius = table.number("radius", Range::positive("m"), ball.radius_m);
  const auto mass = table.number("mass", Range::positive("kg"), ball.mass_kg);
  table.know({"inertia", "center_of_mass"});
  const bool has_inertia = table.has("inertia"), has_center = table.has("center_of_mass");
  std::optional<Eigen::Vector3d> inertia = ball.inertia_kgm2, center = ball.center_of_mass_B_m;
  if (has_inertia) inertia = table.vector<3>("inertia", Range::positive("kg m^2"));
  if (has_center) center = table.vector<3>("center_of_mass", Range::any("m"));
  table.refuse_unknown_keys();
  if (!radius || !mass || !inertia || !center) return;
  ball = {*radius, *mass, *inertia, *center};
  if (has_inertia) check_inertia(table, ball);
  if (has_center || table.has("radius")) check_center(table, ball);
}

void read_believed_surface(TableReader table, Surface& surface) {
  if (!table.present()) return;
  Range friction = Range::positive();
  friction.infinity_allowed = true;
  const auto static_friction = table.number("static_friction", friction, surface.static_friction);
  // A floor believed to be smoother than the truth's kinetic friction has no more than its static one.
  const double most = static_friction.value_or(surface.static_friction);
  const auto kinetic = table.number("kinetic_friction", friction, std::min(surface.kinetic_friction, most));
  surface.rolling_resistance =
      table.number("rolling_resistance", Range::non_negative(), surface.rolling_resistance).value_or(0);
  surface.spin_friction_m =
      table.number("spin_friction", Range::non_negative("m"), surface.spin_friction_m).value_or(0);
  TableReader slope = table.table("slope");
  if (slope.present()) read_slope(slope, surface);
  table.refuse_unknown_keys();
  if (!static_friction || !kinetic) return;
  if (*kinetic > *static_friction) {
    table.refuse("kinetic_friction", "is out of range; allowed: > 0 and <= believed.surface.static_friction = {}",
                 *static_friction);
    return;
  }
  surface.static_friction = *static_friction;
  surface.kinetic_friction = *kinetic;
}

void read_believed_masses(TableReader& believed, std::vector<Mass>& masses) {
  const std::string allowed =
      message("an array of at most {} tables, one for each [[mass]], each headed [[believed.mass]]", masses.size());
  std::vector<TableReader> tables = believed.tables("mass", allowed);
  if (tables.size() > masses.size()) {
    believed.refuse("mass", "has {} entries; allowed: {}", tables.size(), allowed);
    return;
  }
  for (std::size_t i = 0; i < tables.size(); ++i) {
    const auto mass_kg = tables[i].number("mass", Range::positive("kg"), masses[i].mass_kg);
    tables[i].refuse_unknown_keys();
    masses[i].mass_kg = mass_kg.value_or(masses[i].mass_kg);
  }
}

// The rails are known: a ball in which they have no place is no belief.
void check_rails(const Node& root, MassSurroundings around, const ReadContext& context, double radius_m,
                 TableReader& believed) {
  std::vector<ScenarioError> errors, warnings;
  ReadContext again{context.source_name, errors, warnings};
  around.ball_radius_m = radius_m;
  TableReader reader(&root, "", again);
  for (TableReader& mass : reader.tables("mass", "")) read_mass(mass, around);
  if (errors.empty()) return;
  believed.refuse("ball.radius", message("leaves the rails no room: {} = {} {}", errors.front().key,
                                         errors.front().value, errors.front().message));
}

}  // namespace

void read_believed(const Node& root, const MassSurroundings& around, ReadContext& context, Scenario& scenario) {
  World world = scenario;
  world.surface.patches.clear();
  TableReader believed(root.find("believed"), "believed", context);
  read_believed_ball(believed.table("ball"), world.ball);
  read_believed_surface(believed.table("surface"), world.surface);
  read_believed_masses(believed, world.masses);
  believed.refuse_unknown_keys();
  if (!context.errors.empty()) return;
  if (world.ball.radius_m != scenario.ball.radius_m) {
    check_rails(root, around, context, world.ball.radius_m, believed);
  }
  if (const double place_m = scenario.sensors.accelerometer_position_B_m.stableNorm(); place_m >= world.ball.radius_m) {
    believed.refuse("ball.radius",
                    "leaves the accelerometer no room; allowed: above {} m, its distance from the centre", place_m);
  }
  scenario.believed = std::move(world);
}

}  // namespace ballast::sim
