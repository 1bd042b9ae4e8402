#include "sim/scenario/read_world.h"

#include <numbers>

#include "sim/scenario/read_patch.h"

namespace ballast::sim {

namespace {

constexpr double kRoundOff = 1e-9;  // relative, for numbers written by hand that should be equal

}  // namespace

void check_inertia(TableReader& table, const Ball& ball) {
  const Eigen::Vector3d& inertia = ball.inertia_kgm2;
  for (int j = 0; j < 3; ++j) {
    const double others = inertia[(j + 1) % 3] + inertia[(j + 2) % 3];
    if (inertia[j] <= others * (1 + kRoundOff)) continue;
    table.refuse(message("inertia.{}", j), "is impossible for a body; allowed: at most the sum of the other two, {}",
                 others);
  }
}

void check_center(TableReader& table, const Ball& ball) {
  const double distance = ball.center_of_mass_B_m.stableNorm();
  if (distance < ball.radius_m) return;
  table.refuse("center_of_mass", "is {} m from the geometric centre; allowed: inside the ball, < ball.radius = {}",
               distance, ball.radius_m);
}

void read_ball(TableReader table, std::optional<double>& radius, Ball& ball) {
  radius = table.number("radius", Range::positive("m"));
  ball.mass_kg = table.number("mass", Range::positive("kg")).value_or(0);
  const auto inertia = table.vector<3>("inertia", Range::positive("kg m^2"));
  const auto center = table.vector_or_zero<3>("center_of_mass", Range::any("m"));
  table.refuse_unknown_keys();
  ball.radius_m = radius.value_or(0);
  if (inertia) {
    ball.inertia_kgm2 = *inertia;
    check_inertia(table, ball);
  }
  if (center) ball.center_of_mass_B_m = *center;
  if (center && radius) check_center(table, ball);
}

void read_slope(TableReader table, Surface& surface) {
  Range angle = Range::between(0, std::numbers::pi / 2, "rad");
  angle.high_excluded = true;
  surface.slope_rad = table.number("angle", angle, surface.slope_rad).value_or(0);
  surface.downhill_rad = table.number("downhill", Range::any("rad"), surface.downhill_rad).value_or(0);
  table.refuse_unknown_keys();
}

namespace {

void set_friction(TableReader& table, double static_friction, double kinetic_friction, Surface& surface) {
  surface.static_friction = static_friction;
  surface.kinetic_friction = kinetic_friction;
  if (kinetic_friction <= static_friction) return;
  const Node* written_static = table.node("static_friction");
  const Node* written_kinetic = table.node("kinetic_friction");
  if (written_static != nullptr && written_static->source == kOverrideSource && written_kinetic != nullptr &&
      written_kinetic->source != kOverrideSource) {
    // --set surface.static_friction=0.17 lowers both: the file's kinetic friction is that of the rougher floor.
    surface.kinetic_friction = static_friction;
  } else {
    table.refuse("kinetic_friction", "is out of range; allowed: > 0 and <= surface.static_friction = {}",
                 static_friction);
  }
}

}  // namespace

void read_surface(TableReader table, Surface& surface) {
  Range friction = Range::positive();
  friction.infinity_allowed = true;
  const auto static_friction = table.number("static_friction", friction, surface.static_friction);
  const auto kinetic_friction =
      table.number("kinetic_friction", friction, static_friction.value_or(surface.kinetic_friction));
  surface.restitution = table.number("restitution", Range::between(0, 1), surface.restitution).value_or(0);
  surface.rolling_resistance =
      table.number("rolling_resistance", Range::non_negative(), surface.rolling_resistance).value_or(0);
  surface.spin_friction_m =
      table.number("spin_friction", Range::non_negative("m"), surface.spin_friction_m).value_or(0);
  surface.creep_radps = table.number("creep", Range::non_negative("rad/s"), surface.creep_radps).value_or(0);
  read_slope(table.table("slope"), surface);
  if (static_friction && kinetic_friction) set_friction(table, *static_friction, *kinetic_friction, surface);
  read_patches(table, surface);
  table.refuse_unknown_keys();
}

}  // namespace ballast::sim
