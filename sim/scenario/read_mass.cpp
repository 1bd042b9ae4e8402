#include "sim/scenario/read_mass.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "sim/masses/cubic_spline.h"
#include "sim/masses/motion_extent.h"
#include "sim/masses/spline_rail.h"
#include "sim/motors/motor_presets.h"
#include "sim/motors/phase_current.h"

namespace ballast::sim {
namespace {

constexpr double kRoundOff = 1e-12;      // relative rounding error of the distance of a rail's point
constexpr double kUnitTolerance = 1e-6;  // for unit lengths and right angles written with few digits
// Largest deviation of a spline rail: of |zeta'| from 1, and of the curve from the given points as a part of its
// length.
constexpr double kMostSpeedError = 0.01;
constexpr double kMostPointDistance = 1e-3;

// The speed of a governed ideal mass over the greatest of its motion, by default.
constexpr double kCatchUp = 2;
// The same of others.
constexpr double kSpeedReserve = 1.1;

// Microsteps per second that a motor's share of a command's bursts surely carries. At constant speed a control period
// may have one step more than the mean.
double sure_rate_hz(double control_period_s, int mass_count) {
  return (sure_steps_per_control_period(mass_count) - 1) / control_period_s;
}

bool outside(double distance_m, double radius_m) { return !(distance_m <= radius_m * (1 + kRoundOff)); }

// Reports a distance from the geometric centre that lies outside the ball. `place` begins the message, `where` follows
// the distance.
void refuse_outside(TableReader& table, std::string_view key, const std::string& place, double distance_m,
                    const std::string& where, double ball_radius_m) {
  table.refuse(key, "{} {} m from the geometric centre{}; allowed: <= ball.radius = {}", place, distance_m, where,
               ball_radius_m);
}

// Distance of the circle's farthest point from the geometric centre.
double farthest_m(const firmware::Rail& circle) {
  const Eigen::Vector3d normal = circle.axis_cos_B.cross(circle.axis_sin_B);
  const double above_plane = circle.origin_B_m.dot(normal);
  const double in_plane = (circle.origin_B_m - above_plane * normal).norm();
  return std::hypot(in_plane + circle.radius_m, above_plane);
}

std::optional<firmware::Rail> read_circle(TableReader& rail) {
  const auto radius = rail.number("radius", Range::positive("m"));
  rail.know({"direction", "center", "axes"});
  const bool by_direction = rail.has("direction"), by_axes = rail.has("center") || rail.has("axes");
  if (by_direction == by_axes) {
    const std::string allowed = "; allowed: direction = { azimuth, elevation }, or axes (and center)";
    if (by_axes) {
      rail.refuse(rail.has("center") ? "center" : "axes", "is given together with direction" + allowed);
    } else {
      rail.refuse("direction", "is missing" + allowed);
    }
    return std::nullopt;
  }
  if (by_direction) {
    TableReader direction = rail.table("direction");
    const auto azimuth = direction.number("azimuth", Range::any("rad"));
    const auto elevation = direction.number("elevation", Range::any("rad"));
    direction.refuse_unknown_keys();
    if (!radius || !azimuth || !elevation) return std::nullopt;
    return firmware::circle_about(*radius, *azimuth, *elevation);
  }
  const auto center = rail.vector_or_zero<3>("center", Range::any("m"));
  const auto axes = rail.vectors("axes", 2, 2, Range::any());
  if (!axes) return std::nullopt;
  Eigen::Vector3d cos_axis = (*axes)[0], sin_axis = (*axes)[1];
  // stableNorm does not overflow.
  const bool unit =
      std::abs(cos_axis.stableNorm() - 1) <= kUnitTolerance && std::abs(sin_axis.stableNorm() - 1) <= kUnitTolerance;
  if (!unit || std::abs(cos_axis.dot(sin_axis)) > kUnitTolerance) {
    rail.refuse("axes",
                "are not two perpendicular unit vectors; allowed: lengths within 1e-6 of 1, dot product within "
                "1e-6 of 0");
    return std::nullopt;
  }
  if (!radius || !center) return std::nullopt;
  cos_axis.normalize();
  sin_axis = (sin_axis - sin_axis.dot(cos_axis) * cos_axis).normalized();
  return firmware::circle(*center, *radius, cos_axis, sin_axis);
}

std::optional<firmware::Rail> read_line(TableReader& rail) {
  const auto origin = rail.vector<3>("origin", Range::any("m"));
  auto direction = rail.vector<3>("direction", Range::any());
  if (!direction) return std::nullopt;
  const double length = direction->stableNorm();
  if (!(length > 0) || !std::isfinite(length)) {
    rail.refuse("direction", "is zero; allowed: a vector that is not zero");
    return std::nullopt;
  }
  if (!origin) return std::nullopt;
  return firmware::line(*origin, *direction / length);
}

// Checks that the points of a curve are inside the ball and neighbours differ. `closed`: last and first are neighbours.
bool check_points(TableReader& table, const std::vector<Eigen::Vector3d>& points, bool closed,
                  std::optional<double> ball_radius_m) {
  bool good = true;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::string key = message("points.{}", i);
    const double distance = points[i].stableNorm();
    if (ball_radius_m && outside(distance, *ball_radius_m)) {
      refuse_outside(table, key, "is", distance, "", *ball_radius_m);
      good = false;
    }
    if (i > 0 && points[i] == points[i - 1]) {
      table.refuse(key, "equals the point before it; allowed: neighbours that differ");
      good = false;
    }
  }
  if (closed && points.front() == points.back()) {
    table.refuse(message("points.{}", points.size() - 1),
                 "repeats the first point; allowed: a last point from which the closed rail continues to the first");
    good = false;
  }
  return good;
}

std::optional<firmware::Rail> read_spline(TableReader& rail, std::optional<double> ball_radius_m) {
  const auto closed = rail.boolean("closed", false);
  const auto points = rail.vectors("points", closed.value_or(false) ? 3 : 2, kMaxTableEntries, Range::any("m"));
  if (!points || !closed) return std::nullopt;
  if (!check_points(rail, *points, *closed, ball_radius_m)) return std::nullopt;
  const SplineRail spline = spline_rail(*points, *closed);
  const double length = spline.length_m;
  if (!std::isfinite(length) || !(length > 0) || !std::isfinite(spline.speed_error) ||
      !std::isfinite(spline.point_distance_m)) {
    rail.refuse("points", "make a curve that overflows; allowed: points at distances less extreme");
    return std::nullopt;
  }
  const std::string too_sharp = message(
      "; allowed: bends that {} pieces of {} m can follow (gentler ones, points more evenly spread, or a shorter rail)",
      firmware::kMaxRailPieces, spline.rail.piece_length_m);
  if (spline.speed_error > kMostSpeedError) {
    rail.refuse("points", "make too sharp a curve: along it |zeta'| would be off 1 by {}, more than {}{}",
                spline.speed_error, kMostSpeedError, too_sharp);
    return std::nullopt;
  }
  if (spline.point_distance_m > kMostPointDistance * length) {
    rail.refuse(message("points.{}", spline.worst_point),
                "makes too sharp a curve: the rail would pass it at {} m, more than {} of its length{}",
                spline.point_distance_m, kMostPointDistance, too_sharp);
    return std::nullopt;
  }
  if (ball_radius_m && outside(spline.farthest_m, *ball_radius_m)) {
    refuse_outside(rail, "points", "make a curve that is", spline.farthest_m,
                   message(" at theta = {} m", spline.farthest_theta_m), *ball_radius_m);
    return std::nullopt;
  }
  return spline.rail;
}

// Sets the ends where a line leaves the ball. A line that does not meet the ball keeps infinite ends.
void end_in_ball(firmware::Rail& line, double ball_radius_m) {
  const double along = line.origin_B_m.dot(line.axis_cos_B);
  const double beside = (line.origin_B_m - along * line.axis_cos_B).stableNorm();
  if (!(beside < ball_radius_m)) return;
  const double half = std::sqrt((ball_radius_m - beside) * (ball_radius_m + beside));
  line.lower_end = -along - half;
  line.upper_end = -along + half;
}

// Reads the ends of a line or an open spline. Given ends must be on the rail and in the ball.
void read_ends(TableReader& table, std::optional<double> ball_radius_m, firmware::Rail& rail) {
  const bool on_line = rail.shape == firmware::RailShape::kLine;
  if (!on_line) {
    rail.lower_end = 0;
    rail.upper_end = firmware::length_m(rail);
  } else if (ball_radius_m) {
    end_in_ball(rail, *ball_radius_m);
  }
  table.know({"end_stops"});
  if (!table.has("end_stops")) return;
  const auto ends = table.vector<2>("end_stops", Range::any("m"));
  if (!ends) return;
  bool good = true;
  for (int i = 0; i < 2; ++i) {
    const double end = (*ends)[i];
    const std::string key = message("end_stops.{}", i);
    if (!on_line && !Range::between(0, firmware::length_m(rail)).contains(end)) {
      table.refuse(key, "is off the rail; allowed: 0 to its length {} m", firmware::length_m(rail));
      good = false;
    }
    const double distance = firmware::evaluate(rail, end).position.stableNorm();
    if (on_line && ball_radius_m && outside(distance, *ball_radius_m)) {
      refuse_outside(table, key, "is", distance, "", *ball_radius_m);
      good = false;
    }
  }
  if (good && !((*ends)[0] < (*ends)[1])) {
    table.refuse("end_stops.1", "is not above the lower stop; allowed: > {}", (*ends)[0]);
    good = false;
  }
  if (!good) return;
  rail.lower_end = (*ends)[0];
  rail.upper_end = (*ends)[1];
}

// Reads stiffness and restitution of the stops. default_stiffness() sets a missing stiffness once the motor is known.
void read_end_stop_material(TableReader& table, bool has_ends, EndStopMaterial& out) {
  for (const char* key : {"end_stops", "end_stop_stiffness", "end_stop_restitution"}) {
    table.know({key});
    if (!has_ends && table.has(key)) {
      table.refuse(key, "belongs to a rail that has ends; allowed: on a line or an open spline");
    }
  }
  if (!has_ends) return;
  if (table.has("end_stop_stiffness")) {
    out.stiffness_npm = table.number("end_stop_stiffness", Range::positive("N/m")).value_or(0);
  }
  out.restitution = table.number("end_stop_restitution", Range::between(0.01, 1), out.restitution).value_or(0.5);
}

std::optional<firmware::Rail> read_rail(TableReader rail, std::optional<double> ball_radius_m,
                                        EndStopMaterial& end_stops) {
  using enum firmware::RailShape;
  const auto shape = rail.choice<firmware::RailShape>("shape", {"circle", "line", "spline"});
  if (!shape) return std::nullopt;  // the other keys depend on it
  std::optional<firmware::Rail> result;
  if (*shape == kCircle) {
    result = read_circle(rail);
    if (result && ball_radius_m) {
      const double distance = farthest_m(*result);
      if (outside(distance, *ball_radius_m)) {
        refuse_outside(rail, "radius", "takes the mass", distance, "", *ball_radius_m);
        result.reset();
      }
    }
  } else if (*shape == kLine) {
    result = read_line(rail);
  } else {
    result = read_spline(rail, ball_radius_m);
  }
  if (result) {
    const bool has_ends = *shape == kLine || (*shape == kSpline && !result->closed);
    if (has_ends) read_ends(rail, ball_radius_m, *result);
    read_end_stop_material(rail, has_ends, end_stops);
  } else {
    rail.know({"end_stops", "end_stop_stiffness", "end_stop_restitution"});
  }
  rail.refuse_unknown_keys();
  return result;
}

std::optional<std::vector<MotionPiece>> read_motion(TableReader& mass) {
  const std::string allowed =
      message("an array of at most {} tables {{ duration, acceleration = [start, end] }}", kMaxMotionPieces);
  std::vector<TableReader> pieces = mass.tables("motion", allowed);
  const Node* node = mass.node("motion");
  if (node != nullptr && node->kind != NodeKind::kArray) return std::nullopt;
  if (pieces.size() > static_cast<std::size_t>(kMaxMotionPieces)) {
    mass.refuse("motion", "has {} pieces; allowed: {}", pieces.size(), allowed);
    return std::nullopt;
  }
  std::vector<MotionPiece> motion;
  for (TableReader& piece : pieces) {
    const auto duration = piece.number("duration", Range::positive("s"));
    const auto acceleration = piece.vector<2>("acceleration", Range::any("rail unit / s^2"));
    piece.refuse_unknown_keys();
    if (!duration || !acceleration) continue;
    const double start = (*acceleration)[0], end = (*acceleration)[1];
    if (!Range::any().contains((end - start) / *duration)) {
      piece.refuse("acceleration", "changes too fast; allowed: (end - start) / duration of at most {} in size",
                   kMostSize);
      continue;
    }
    motion.push_back({*duration, start, end});
  }
  return motion.size() == pieces.size() ? std::optional(motion) : std::nullopt;
}

// The key that an error in a piece of the motion is reported under.
std::string piece_key(const Mass& mass, std::size_t piece) {
  if (mass.motion.empty()) return "initial_velocity";
  return piece < mass.motion.size() ? message("motion.{}", piece) : "motion";
}

// First part of the message about an extreme beyond `end`, if it lies after the last piece. The velocity with which the
// mass continues has no key of its own, so the message names the piece it comes from and the time at which the mass
// passes the end.
std::string after_the_motion(const Mass& mass, const Extreme& worst, double end) {
  if (mass.motion.empty() || worst.piece < mass.motion.size() || !std::isfinite(end)) return "";
  double over_s = 0, velocity = mass.initial_velocity;
  for (const MotionPiece& piece : mass.motion) {
    over_s += piece.duration_s;
    velocity += piece.duration_s * (piece.acceleration_start + piece.acceleration_end) / 2;
  }
  const double passes_s = worst.time_s - (worst.position - end) / velocity;
  return message("continues with {} m/s after its last piece, motion.{}, which ends at t = {} s{}, and ", velocity,
                 mass.motion.size() - 1, over_s,
                 passes_s > over_s ? message(", passes the end of its rail at t = {} s", passes_s)
                                   : " with the mass already beyond the end of its rail");
}

// Checks that a mass on a line stays in the ball for the whole run. The distance is convex in theta, so the extremes
// suffice.
void check_line_in_ball(TableReader& table, const Mass& mass, const MassSurroundings& around) {
  if (!around.ball_radius_m || !around.duration_s) return;
  const PositionExtent extent = position_extent(mass, *around.duration_s);
  Extreme worst = extent.least;
  double worst_distance = 0;
  for (const Extreme& extreme : {extent.least, extent.greatest}) {
    const double distance = firmware::evaluate(mass.rail, extreme.position).position.stableNorm();
    if (distance > worst_distance) {
      worst = extreme;
      worst_distance = distance;
    }
  }
  if (!outside(worst_distance, *around.ball_radius_m)) return;
  const double end = worst.position < mass.rail.lower_end ? mass.rail.lower_end : mass.rail.upper_end;
  const std::string at_start = table.has("initial_position") ? "initial_position" : "rail";
  refuse_outside(table, worst.time_s > 0 ? piece_key(mass, worst.piece) : at_start,
                 after_the_motion(mass, worst, end) + "takes the mass", worst_distance,
                 message(" at t = {} s", worst.time_s), *around.ball_radius_m);
}

// Checks that the motion stays between the ends of the rail.
void check_between_ends(TableReader& table, const Mass& mass, const MassSurroundings& around) {
  if (!around.duration_s) return;
  const double lower = mass.rail.lower_end, upper = mass.rail.upper_end;
  const double rounding = kRoundOff * (upper - lower);
  const PositionExtent extent = position_extent(mass, *around.duration_s);
  const bool below = extent.least.position < lower - rounding;
  if (!below && extent.greatest.position <= upper + rounding) return;
  const Extreme& worst = below ? extent.least : extent.greatest;
  const bool whole =
      mass.rail.shape == firmware::RailShape::kSpline && lower == 0 && upper == firmware::length_m(mass.rail);
  const std::string allowed = whole ? message("on the rail, 0 to its length {} m", upper)
                                    : message("between the rail's end_stops, {} to {} m", lower, upper);
  table.refuse(worst.time_s > 0 ? piece_key(mass, worst.piece) : "initial_position",
               "{}takes the mass to theta = {} m at t = {} s; allowed: {}",
               after_the_motion(mass, worst, below ? lower : upper), worst.position, worst.time_s, allowed);
}

// Reports a computed default that is out of range, as extreme numbers in the scenario make it.
void refuse_default(TableReader& table, std::string_view key, const Range& range, double value) {
  if (range.contains(value)) return;
  table.refuse(key, "is not given, and its default {} is out of range; allowed: a {}", value, range.text_for(value));
}

// Default: the motor's holding torque presses the mass in by a thousandth of the distance between the stops.
void default_stiffness(TableReader& table, Mass& mass) {
  double& stiffness = mass.end_stops.stiffness_npm;
  if (stiffness > 0 || !std::isfinite(mass.rail.lower_end)) return;
  stiffness =
      mass.motor.holding_torque_nm * mass.motor.shaft_ratio / (1e-3 * (mass.rail.upper_end - mass.rail.lower_end));
  refuse_default(table, "rail.end_stop_stiffness", Range::positive("N/m"), stiffness);
}

// The motor alone must not press the mass out through the shell. The tolerance of a hundredth of the radius is within
// the idealisation of a point mass, and more than the default stiffness yields at an end on the shell (a thousandth of
// at most two radii).
constexpr double kMostOutside = 0.01;

void check_stops_hold_in_ball(TableReader& table, const Mass& mass, double ball_radius_m) {
  const firmware::Rail& rail = mass.rail;
  if (!std::isfinite(rail.lower_end) || !(mass.end_stops.stiffness_npm > 0)) return;
  const double give_m = mass.motor.holding_torque_nm * mass.motor.shaft_ratio / mass.end_stops.stiffness_npm;
  for (const double pressed : {rail.lower_end - give_m, rail.upper_end + give_m}) {
    const double distance = firmware::evaluate(rail, pressed).position.stableNorm();
    if (distance <= ball_radius_m * (1 + kMostOutside)) continue;
    table.refuse("rail.end_stop_stiffness",
                 "lets the motor's holding torque press the mass to theta = {} m, {} m from the geometric centre; "
                 "allowed: a stop that holds it within {} ball.radius = {} (stiffer, or further in)",
                 pressed, distance, 1 + kMostOutside, (1 + kMostOutside) * ball_radius_m);
    return;
  }
}

// Reads a trajectory, which replaces rail, initial position and velocity, motion and motor.
void read_trajectory(TableReader& mass, const MassSurroundings& around, Trajectory& trajectory) {
  for (const char* key : {"rail", "initial_position", "initial_velocity", "motion", "motor"}) {
    mass.know({key});
    if (!mass.has(key)) continue;
    mass.refuse(key, std::string(key) == "rail"
                         ? "is given together with trajectory; allowed: one of the two"
                         : "belongs to a mass on a rail; allowed: no such key beside a trajectory");
  }
  if (around.actuation && has_controller(*around.actuation)) {
    mass.refuse("trajectory",
                "cannot be commanded by the controller; allowed: run.actuation = \"prescribed\", or a rail");
  }
  TableReader table = mass.table("trajectory");
  const auto times = read_times(table);
  const auto periodic = table.boolean("periodic", false);
  const auto points = table.vectors("points", periodic.value_or(false) ? 3 : 2, kMaxTableEntries, Range::any("m"));
  table.refuse_unknown_keys();
  if (!times || !periodic || !points) return;
  if (points->size() != times->size()) {
    table.refuse("points", "has {} elements; allowed: one for each of the {} times", points->size(), times->size());
    return;
  }
  if (*periodic && points->front() != points->back()) {
    table.refuse(message("points.{}", points->size() - 1),
                 "is not the first point; allowed: with periodic = true the table ends where it starts");
    return;
  }
  if (!*periodic && times->front() > 0) {
    table.refuse("times.0", "is after the start; allowed: <= 0, or periodic = true");
  }
  if (!*periodic && around.duration_s && times->back() < *around.duration_s) {
    table.refuse(message("times.{}", times->size() - 1),
                 "is before the end of the run; allowed: >= duration = {}, or periodic = true", *around.duration_s);
  }
  const CubicSpline curve = *periodic ? CubicSpline::closed(*times, *points) : CubicSpline::open(*times, *points);
  double farthest_m = 0, when_s = 0;
  bool good = curve.finite();
  for (std::size_t i = 0; good && i < curve.pieces(); ++i) {
    constexpr int kPlaces = 32;
    for (int k = 0; k <= kPlaces; ++k) {
      const double time = (*times)[i] + k * ((*times)[i + 1] - (*times)[i]) / kPlaces;
      const CubicSpline::Point p = curve.at(i, time);
      for (const Eigen::Vector3d& v : {p.position, p.d1, p.d2}) good = good && Range::any().contains(v.stableNorm());
      if (const double distance = p.position.stableNorm(); distance > farthest_m) {
        farthest_m = distance;
        when_s = time;
      }
    }
  }
  if (!good) {
    table.refuse("times",
                 "make a curve with speeds or accelerations above {}; allowed: times at distances less extreme",
                 kMostSize);
  } else if (around.ball_radius_m && outside(farthest_m, *around.ball_radius_m)) {
    refuse_outside(table, "points", "take the mass", farthest_m, message(" at t = {} s", when_s),
                   *around.ball_radius_m);
  }
  trajectory = {*times, *points, *periodic};
}

// nullptr: none given, or an unknown one, which is reported.
const MotorPreset* read_preset(TableReader& table) {
  table.know({"preset"});
  if (!table.has("preset")) return nullptr;
  std::vector<std::string_view> names;
  for (const MotorPreset& known : motor_presets()) names.push_back(known.name);
  const auto place = table.choice("preset", names);
  return place ? &motor_presets()[*place] : nullptr;
}

// Reads winding and supply. The four keys are given together or not at all, because no default of one suits another. A
// corner_speed overrides the winding of a preset and contradicts one that is written out.
void read_winding(TableReader& table, const MotorPreset* preset, Motor& motor) {
  constexpr const char* kKeys[] = {"rated_current", "resistance", "inductance", "supply_voltage"};
  bool written = false;
  for (const char* key : kKeys) {
    table.know({key});
    written = written || table.has(key);
  }
  if (table.has("corner_speed") && written) {
    table.refuse("corner_speed",
                 "follows from the winding, which is given too; allowed: corner_speed, or rated_current, resistance, "
                 "inductance and supply_voltage");
    return;
  }
  if (table.has("corner_speed") || (!written && preset == nullptr)) return;
  const auto number = [&](const char* key, const char* unit, double MotorPreset::*figure) {
    return table.number(key, Range::positive(unit), preset ? std::optional(preset->*figure) : std::nullopt);
  };
  const auto current = number(kKeys[0], "A", &MotorPreset::rated_current_a);
  const auto resistance = number(kKeys[1], "ohm", &MotorPreset::resistance_ohm);
  const auto inductance = number(kKeys[2], "H", &MotorPreset::inductance_h);
  const auto supply = number(kKeys[3], "V", &MotorPreset::supply_voltage_v);
  if (!current || !resistance || !inductance || !supply) return;
  const double peak_v = std::numbers::sqrt2 * *current * *resistance;
  if (!(*supply > peak_v)) {
    table.refuse("supply_voltage",
                 "is too low for the rated current; allowed: > sqrt(2) * rated_current * resistance = {}", peak_v);
    return;
  }
  motor.rated_current_a = *current;
  motor.resistance_ohm = *resistance;
  motor.inductance_h = *inductance;
  motor.supply_voltage_v = *supply;
  motor.corner_speed_radps = PhaseCurrent(motor).corner_speed_radps();
  if (const Range range = Range::positive("rad/s"); !range.contains(motor.corner_speed_radps)) {
    table.refuse("rated_current",
                 "and the rest of the winding make a corner speed of {}; allowed: figures that make it a {}",
                 motor.corner_speed_radps, range.text_for(motor.corner_speed_radps));
    motor.corner_speed_radps = std::numeric_limits<double>::infinity();  // avoids further errors that follow from it
  }
}

// Reads the motor. The defaults can drive any scenario: three times the torque it needs and a well damped resonance.
// `complete`: the mass and its surroundings have no errors. Otherwise defaults mean nothing and are not checked.
void read_motor(TableReader table, const MassSurroundings& around, const std::optional<firmware::Rail>& rail,
                bool complete, const SpeedExtent& extent, Mass& mass) {
  Motor& motor = mass.motor;

  const MotorPreset* preset = read_preset(table);
  if (preset != nullptr) motor.steps_per_revolution = preset->steps_per_revolution;
  if (const auto steps = table.integer("steps_per_revolution", 4, 2000, motor.steps_per_revolution)) {
    motor.steps_per_revolution = static_cast<int>(*steps);
    if (*steps % 4 != 0) table.refuse("steps_per_revolution", "is no multiple of 4; allowed: 4, 8, .. 2000");
  }
  if (const auto microsteps = table.integer("microsteps", 1, 256, motor.microsteps)) {
    motor.microsteps = static_cast<int>(*microsteps);
  }

  const bool on_circle = !rail || rail->shape == firmware::RailShape::kCircle;
  const bool on_line = !rail || rail->shape != firmware::RailShape::kCircle;  // theta in m: a line or a spline
  table.know({"gear_ratio", "travel_per_revolution"});
  if (on_circle) {
    motor.gear_ratio = table.number("gear_ratio", Range::positive(), 1.0).value_or(1.0);
    motor.shaft_ratio = motor.gear_ratio;
  } else if (table.has("gear_ratio")) {
    table.refuse("gear_ratio", "belongs to a circle rail; allowed on a line or a spline: travel_per_revolution, in m");
  }
  if (on_line) {
    const double fallback = around.ball_radius_m.value_or(1.0) / 2;
    motor.travel_per_revolution =
        table.number("travel_per_revolution", Range::positive("m"), fallback).value_or(fallback);
    if (!on_circle) motor.shaft_ratio = 2 * std::numbers::pi / motor.travel_per_revolution;
  } else if (table.has("travel_per_revolution")) {
    table.refuse("travel_per_revolution", "belongs to a line or spline rail; allowed on a circle: gear_ratio");
  }

  // The load at the shaft.
  const double mass_kg = complete ? mass.mass_kg : 1;
  const double lever = complete && on_circle ? mass.rail.radius_m : 1;  // |zeta'|
  const double ratio = motor.shaft_ratio;
  const double rail_inertia = mass_kg * lever * lever;
  const double load_inertia = rail_inertia / (ratio * ratio);  // J_L
  const auto read = [&](const char* key, const Range& range, double fallback, double& out) {
    out = table.number(key, range, fallback).value_or(fallback);
    if (complete && !table.has(key)) refuse_default(table, key, range, fallback);
  };
  // A rotor inertia of three times the load's: a microstep moves the load a quarter as much at the same margin.
  read("rotor_inertia", Range::positive("kg m^2"), preset ? preset->rotor_inertia_kgm2 : 3 * load_inertia,
       motor.rotor_inertia_kgm2);
  // Three times the torque for gravity and the greatest acceleration of mass and rotor.
  const double moved_inertia = rail_inertia + motor.rail_inertia();
  double rail_torque = mass_kg * around.gravity_mps2.value_or(1) * lever + moved_inertia * extent.greatest_acceleration;
  if (rail_torque == 0) rail_torque = moved_inertia;  // for 1 rail unit / s^2
  read("holding_torque", Range::positive("N m"), preset ? preset->holding_torque_nm : 3 * rail_torque / ratio,
       motor.holding_torque_nm);
  Range below_half = Range::between(0, motor.holding_torque_nm / 2, "N m (the upper end is half the holding torque)");
  below_half.high_excluded = true;
  if (!complete && !table.has("holding_torque")) below_half = Range::non_negative("N m");
  const bool printed = preset != nullptr && preset->detent_torque_nm > 0;
  read("detent_torque", below_half, printed ? preset->detent_torque_nm : 0.04 * motor.holding_torque_nm,
       motor.detent_torque_nm);
  // Damping ratio 0.2 for rotor and load on the field's stiffness N_r tau_hold, but at most a tenth of the holding
  // torque at the motion's greatest speed.
  const double damped = 2 * 0.2 * std::sqrt(motor.stiffness_nmprad() * (motor.rotor_inertia_kgm2 + load_inertia));
  const double most_drag = 0.1 * motor.holding_torque_nm / std::max(ratio * extent.greatest_speed, 1e-300);
  read("viscous_damping", Range::non_negative("N m s"), std::min(damped, most_drag), motor.viscous_damping_nms);
  read_winding(table, preset, motor);
  if (!motor.has_winding()) {
    read("corner_speed", Range::positive("rad/s of the motor shaft"), std::max(30.0, 2 * ratio * extent.greatest_speed),
         motor.corner_speed_radps);
  }
  read("step_error", Range::between(0, 0.1), motor.step_error, motor.step_error);
  read("direction_setup", Range::between(0, 1e-3, "s"), motor.direction_setup_s, motor.direction_setup_s);
  // Default: what half the holding torque gives, at least the motion's own. Only an explicit limit refuses a motion.
  const double half_torque = 0.5 * ratio * motor.holding_torque_nm / moved_inertia;
  read("max_acceleration", Range::positive("rail unit / s^2"), std::max(half_torque, extent.greatest_acceleration),
       motor.max_acceleration);
  // Default: the speed at which gravity, that acceleration and the drag use nine tenths of the holding torque, so that
  // moves at full speed lose no steps. It is at most the corner speed, at least a tenth above the motion's speed, and
  // at most what the bursts of a control tick surely carry.
  const double period = around.control_period_s.value_or(1e-3), timer = around.timer_frequency_hz.value_or(1e7);
  const double gravity_torque = mass_kg * around.gravity_mps2.value_or(1) * lever / ratio;
  const double acceleration_torque = moved_inertia * motor.max_acceleration / ratio;
  const double left_torque =
      std::max(0.9 * motor.holding_torque_nm - gravity_torque - acceleration_torque, 0.01 * motor.holding_torque_nm);
  const double carried_radps = std::min(left_torque / motor.viscous_damping_nms, motor.corner_speed_radps);
  // No torque limits an ideal mass, and one whose motion the governor bends has to catch up with it.
  const bool catches_up = around.governor && around.actuation == Actuation::kIdeal;
  const double speed_factor = catches_up ? kCatchUp : kSpeedReserve;
  const double carried_hz =
      std::max(carried_radps / ratio, speed_factor * extent.greatest_speed) * motor.microsteps_per_rail_unit();
  read("max_step_rate", Range::positive("1/s"),
       std::min({timer / 10, 60 / period, sure_rate_hz(period, around.mass_count), carried_hz}),
       motor.max_step_rate_hz);
  // Default: max_acceleration is reached within one oscillation of load and rotor on the field's stiffness, which
  // excites that oscillation least.
  const double swing_s = 2 * std::numbers::pi * std::sqrt(moved_inertia / motor.rail_stiffness());
  read("max_jerk", Range::positive("rail unit / s^3"), std::max(motor.max_acceleration / swing_s, extent.greatest_jerk),
       motor.max_jerk);
  table.refuse_unknown_keys();
}

// Checks what the controller would refuse, and reports it under the key that causes it.
void check_steps(TableReader& table, const Mass& mass, const MassSurroundings& around) {
  const double per_unit = mass.motor.microsteps_per_rail_unit();
  if (const Range range = Range::positive(); !range.contains(per_unit)) {
    const bool on_line = mass.rail.shape != firmware::RailShape::kCircle;
    table.refuse(on_line ? "motor.travel_per_revolution" : "motor.gear_ratio",
                 "makes {} microsteps per rail unit; allowed: a {}", per_unit, range.text_for(per_unit));
    return;
  }
  if (!(std::abs(mass.initial_position * per_unit) <= kMaxInitialMicrosteps)) {
    table.refuse("initial_position",
                 "is more microsteps from 0 than can be counted; allowed: within {} microsteps, here {}",
                 kMaxInitialMicrosteps, kMaxInitialMicrosteps / per_unit);
  }
  if (around.timer_frequency_hz && mass.motor.max_step_rate_hz > *around.timer_frequency_hz) {
    table.refuse("motor.max_step_rate", "is out of range; allowed: <= run.timer_frequency = {}",
                 *around.timer_frequency_hz);
    return;
  }
  const double sure_hz = sure_rate_hz(*around.control_period_s, around.mass_count);
  if (mass.motor.max_step_rate_hz > sure_hz) {
    table.refuse("motor.max_step_rate",
                 "is out of range; allowed: <= {}, {} steps in a run.control_period, what the 32 bursts of {} motor{} "
                 "surely carry",
                 sure_hz, sure_steps_per_control_period(around.mass_count) - 1, around.mass_count,
                 around.mass_count == 1 ? "" : "s");
  }
}

// Checks the motion against the motor's limits. Jumps of acceleration where pieces meet are allowed.
void check_acceleration(TableReader& table, const Mass& mass, const SpeedExtent& extent) {
  const Motor& motor = mass.motor;
  if (extent.greatest_acceleration > motor.max_acceleration) {
    table.refuse(piece_key(mass, extent.hardest_piece), "has acceleration {}; allowed: <= {} (motor.max_acceleration)",
                 extent.greatest_acceleration, motor.max_acceleration);
  }
  if (extent.greatest_jerk > motor.max_jerk) {
    table.refuse(piece_key(mass, extent.jerkiest_piece), "has jerk {}; allowed: <= {} (motor.max_jerk)",
                 extent.greatest_jerk, motor.max_jerk);
  }
}

// Checks that the controller can issue the steps of the fastest part of the motion.
void check_step_rate(TableReader& table, const Mass& mass, const SpeedExtent& extent) {
  const double needed_hz = extent.greatest_speed * mass.motor.microsteps_per_rail_unit();
  const double possible_hz = mass.motor.max_step_rate_hz;
  if (needed_hz <= possible_hz) return;
  table.refuse(piece_key(mass, extent.fastest_piece),
               "needs {} microsteps/s at its greatest speed {}; allowed: <= {} (motor.max_step_rate)", needed_hz,
               extent.greatest_speed, possible_hz);
}

}  // namespace

// Least distance of two rows of a table, in s and as a part of the time. The integrator's steps are longer.
constexpr double kLeastGap = 1e-9;

std::optional<std::vector<double>> read_times(TableReader& table) {
  const auto times = table.list("times", 2, kMaxTableEntries, Range::any("s"));
  if (!times) return std::nullopt;
  for (std::size_t i = 1; i < times->size(); ++i) {
    const double before = (*times)[i - 1], gap = (*times)[i] - before;
    if (gap >= kLeastGap * std::max(1.0, std::abs(before)) && std::isfinite(gap)) continue;
    table.refuse(
        message("times.{}", i),
        "is not after the time before it, {}; allowed: times that increase, by finite steps of at least 1e-9 and "
        "1e-9 of the time",
        before);
    return std::nullopt;
  }
  return times;
}

Mass read_mass(TableReader& table, const MassSurroundings& around) {
  Mass mass;
  const auto mass_kg = table.number("mass", Range::positive("kg"));
  mass.mass_kg = mass_kg.value_or(0);
  table.know({"trajectory"});
  if (table.has("trajectory")) {
    read_trajectory(table, around, mass.trajectory);
    table.refuse_unknown_keys();
    return mass;
  }
  const auto rail = read_rail(table.table("rail"), around.ball_radius_m, mass.end_stops);
  const auto initial_position = table.number("initial_position", Range::any("rad or m"), 0.0);
  const auto initial_velocity = table.number("initial_velocity", Range::any("rad/s or m/s"), 0.0);
  const auto motion = read_motion(table);
  if (rail) mass.rail = *rail;
  mass.initial_position = initial_position.value_or(0);
  mass.initial_velocity = initial_velocity.value_or(0);
  if (motion) mass.motion = *motion;

  bool motion_known = initial_position && initial_velocity && motion && around.duration_s;
  SpeedExtent speed;
  if (motion_known) {
    const PositionExtent extent = position_extent(mass, *around.duration_s);
    speed = speed_extent(mass);
    const Range range = Range::any();
    if (!range.contains(extent.least.position) || !range.contains(extent.greatest.position) ||
        !range.contains(speed.greatest_speed)) {
      table.refuse("motion", "overflows; allowed: positions and speeds of at most {} in size", kMostSize);
      motion_known = false;
    }
  }
  if (motion_known && rail) {
    const bool on_line = rail->shape == firmware::RailShape::kLine;
    const bool ends = std::isfinite(rail->lower_end) && std::isfinite(rail->upper_end);
    if (on_line && !table.table("rail").has("end_stops")) {
      check_line_in_ball(table, mass, around);
    } else if (ends) {
      check_between_ends(table, mass, around);
    }
  }

  const bool complete = mass_kg && rail && motion_known && around.gravity_mps2 && around.ball_radius_m &&
                        around.control_period_s && around.timer_frequency_hz;
  TableReader motor = table.table("motor");
  mass.motor_limited = motor.has("max_step_rate") || motor.has("max_acceleration") || motor.has("max_jerk");
  read_motor(std::move(motor), around, rail, complete, speed, mass);
  if (complete) default_stiffness(table, mass);
  if (complete && around.actuation && has_controller(*around.actuation)) {
    check_steps(table, mass, around);
    check_step_rate(table, mass, speed);
    check_acceleration(table, mass, speed);
    check_stops_hold_in_ball(table, mass, *around.ball_radius_m);
  }
  table.refuse_unknown_keys();
  return mass;
}

}  // namespace ballast::sim
