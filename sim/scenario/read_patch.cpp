#include "sim/scenario/read_patch.h"

#include <algorithm>
#include <cmath>

namespace ballast::sim {

namespace {

using Eigen::Vector2d;

// Twice the area of the triangle, positive if it turns left.
double turn(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

// Whether p, on the line through a and b, lies between them.
bool between(const Vector2d& a, const Vector2d& b, const Vector2d& p) { return (a - p).dot(b - p) <= 0; }

// Whether the closed segments a-b and c-d have a point in common.
bool meet(const Vector2d& a, const Vector2d& b, const Vector2d& c, const Vector2d& d) {
  const double c_side = turn(a, b, c), d_side = turn(a, b, d), a_side = turn(c, d, a), b_side = turn(c, d, b);
  if ((c_side > 0 && d_side < 0) || (c_side < 0 && d_side > 0)) {
    if ((a_side > 0 && b_side < 0) || (a_side < 0 && b_side > 0)) return true;
  }
  return (c_side == 0 && between(a, b, c)) || (d_side == 0 && between(a, b, d)) || (a_side == 0 && between(c, d, a)) ||
         (b_side == 0 && between(c, d, b));
}

// The reason why the corners are no polygon; empty: nothing.
std::string polygon_error(const std::vector<Vector2d>& corners) {
  const std::size_t n = corners.size();
  const auto corner = [&](std::size_t i) { return corners[i % n]; };
  double doubled_area = 0, size = 0, greatest_turn = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (corner(i) == corner(i + 1)) {
      return message("has corner {} twice; allowed: corners that differ, the last one from the first too", i);
    }
    const double part = turn(corner(0), corner(i), corner(i + 1));
    doubled_area += part;
    greatest_turn = std::max(greatest_turn, std::abs(part));
    size = std::max(size, (corner(i) - corner(0)).norm());
  }
  // Numbers written by hand are no better than that.
  const double least = 1e-12 * size * size;
  const char* no_area = "has no area; allowed: corners around an area";
  if (!(greatest_turn > least)) return no_area;  // all on a line; the two halves of a bow tie cancel later
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) {
      // Neighbours share a corner, and may not fold back over each other.
      const bool next = j == i + 1, around = i == 0 && j == n - 1;
      const Vector2d &a = corner(i), &b = corner(i + 1), &c = corner(j), &d = corner(j + 1);
      const bool folds_next = next && turn(a, b, d) == 0 && (a - b).dot(d - b) > 0;
      const bool folds_around = around && turn(a, b, c) == 0 && (b - a).dot(c - a) > 0;
      if (folds_next || folds_around || (!next && !around && meet(a, b, c, d))) {
        return message(
            "crosses or touches itself: the edges from corner {} and corner {} meet; allowed: a border that "
            "does not",
            i, j);
      }
    }
  }
  return std::abs(doubled_area) > least ? "" : no_area;
}

bool read_shape(TableReader& table, SurfacePatch& patch) {
  const bool has_polygon = table.has("polygon"), has_circle = table.has("circle");
  table.know({"polygon", "circle"});
  if (has_polygon == has_circle) {
    table.refuse(has_polygon ? "circle" : "polygon",
                 has_polygon ? "stands beside a polygon; allowed: one of both"
                             : "is missing; allowed: polygon = [[x, y], ...], or circle = { center, radius }");
    return false;
  }
  if (has_polygon) {
    const auto corners = table.vectors<2>("polygon", 3, kMaxCorners, Range::any("m"));
    if (!corners) return false;
    if (const std::string why = polygon_error(*corners); !why.empty()) {
      table.refuse("polygon", why);
      return false;
    }
    patch.polygon_W_m = *corners;
    return true;
  }
  TableReader circle = table.table("circle");
  const auto center = circle.vector<2>("center", Range::any("m"));
  const auto radius = circle.number("radius", Range::positive("m"));
  circle.refuse_unknown_keys();
  if (!center || !radius) return false;
  patch.center_W_m = *center;
  patch.radius_m = *radius;
  return true;
}

void read_patch(TableReader table, Surface& floor) {
  SurfacePatch patch;
  const bool has_shape = read_shape(table, patch);
  Range friction = Range::positive();
  friction.infinity_allowed = true;
  const auto static_friction = table.number("static_friction", friction, floor.static_friction);
  // A patch smoother than the floor's kinetic friction has no more than its static one.
  const double most = static_friction.value_or(floor.static_friction);
  const auto kinetic = table.number("kinetic_friction", friction, std::min(floor.kinetic_friction, most));
  const auto resistance = table.number("rolling_resistance", Range::non_negative(), floor.rolling_resistance);
  table.refuse_unknown_keys();
  if (!has_shape || !static_friction || !kinetic || !resistance) return;
  if (*kinetic > *static_friction) {
    table.refuse("kinetic_friction", "is out of range; allowed: > 0 and <= the patch's static_friction = {}",
                 *static_friction);
    return;
  }
  patch.static_friction = *static_friction;
  patch.kinetic_friction = *kinetic;
  patch.rolling_resistance = *resistance;
  floor.patches.push_back(std::move(patch));
}

}  // namespace

void read_patches(TableReader& surface, Surface& floor) {
  const std::string allowed = message("an array of at most {} tables, each headed [[surface.patch]]", kMaxPatches);
  std::vector<TableReader> tables = surface.tables("patch", allowed);
  if (tables.size() > kMaxPatches) {
    surface.refuse("patch", "has {} entries; allowed: {}", tables.size(), allowed);
    return;
  }
  for (TableReader& table : tables) read_patch(table, floor);
}

}  // namespace ballast::sim
