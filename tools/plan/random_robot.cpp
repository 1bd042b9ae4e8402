#include "tools/plan/random_robot.h"

#include <fmt/core.h>

#include <cmath>
#include <numbers>

namespace ballast::plan {
namespace {

std::string vector_text(double x, double y, double z) { return fmt::format("[{:.6g}, {:.6g}, {:.6g}]", x, y, z); }

// A common motor behind a gear that a mass of this size and lever needs.
std::string motor_text(Random& random, double mass_kg, double lever_m, bool circle) {
  const double load_nm = 9.81 * mass_kg * lever_m;
  const double gear = std::max(4.0, std::ceil(load_nm / 0.06));
  std::string text = fmt::format("[mass.motor]\npreset = \"nema17\"\nviscous_damping = 0.02\nmicrosteps = {}\n",
                                 random.coin() ? 16 : 64);
  if (circle) return text + fmt::format("gear_ratio = {:.4g}\n", gear);
  return text + fmt::format("travel_per_revolution = {:.4g}\n", 2 * std::numbers::pi * lever_m / gear);
}

// A ball of radius 1 in units with g = 1, as the paper's: one to four masses on great circles of any direction.
std::string paper_like(Random& random) {
  std::string text = fmt::format(
      "gravity = 1.0\n[ball]\nradius = 1.0\nmass = {:.4g}\ninertia = [{:.4g}, {:.4g}, {:.4g}]\n"
      "center_of_mass = [0, 0, {:.4g}]\n",
      random.between(0.8, 2), random.between(0.8, 1), random.between(0.9, 1.1), random.between(1, 1.2),
      random.between(-0.2, -0.03));
  const int masses = 1 + random.pick(4);
  for (int i = 0; i < masses; ++i) {
    text += fmt::format(
        "[[mass]]\nmass = {:.4g}\nrail = {{ shape = \"circle\", radius = {:.4g}, direction = {{ azimuth = {:.4g}, "
        "elevation = {:.4g} }} }}\ninitial_position = {:.4g}\n",
        random.between(0.3, 1.2), random.between(0.6, 0.95), random.between(-3, 3), random.between(-1.2, 1.2),
        random.between(-3, 3));
  }
  return text;
}

std::string ball_text(double radius_m, double mass_kg, double inertia_factor, double depth_m) {
  const double inertia = inertia_factor * mass_kg * radius_m * radius_m;
  return fmt::format(
      "gravity = 9.81\n[ball]\nradius = {:.4g}\nmass = {:.4g}\ninertia = {}\ncenter_of_mass = [0, 0, {:.4g}]\n",
      radius_m, mass_kg, vector_text(inertia, inertia, inertia), -depth_m);
}

// A radius from that of a toy to that of a ball one can sit in, and the mass of its shell.
double radius_of(Random& random) { return 0.08 * std::pow(10.0, random.between(0, 0.8)); }
double shell_of(Random& random, double radius_m) { return random.between(0.5, 1.5) * std::pow(radius_m / 0.15, 2); }

// Two driving rings and a steering ring, masses hanging at the bottom.
std::string desk_like(Random& random, bool motors) {
  const double r = radius_of(random), shell = shell_of(random, r);
  const double ring = random.between(0.5, 0.65) * r, apart = random.between(0.3, 0.45) * r;
  const double mass = random.between(0.2, 0.4) * shell;
  std::string text = ball_text(r, shell, 0.6, 0);
  for (const int side : {-1, 1}) {
    text += fmt::format(
        "[[mass]]\nmass = {:.4g}\nrail = {{ shape = \"circle\", radius = {:.4g}, center = [0, {:.4g}, 0], axes = [[0, "
        "0, -1], [1, 0, 0]] }}\n",
        mass, ring, side * apart);
    if (motors) text += motor_text(random, mass, ring, true);
  }
  const double steering = random.between(0.35, 0.5) * r, weight = random.between(0.7, 1.2) * mass;
  text += fmt::format(
      "[[mass]]\nmass = {:.4g}\nrail = {{ shape = \"circle\", radius = {:.4g}, center = [0, 0, {:.4g}], axes = [[0, 0, "
      "-1], [0, 1, 0]] }}\n",
      weight, steering, random.between(0, 0.2) * r);
  if (motors) text += motor_text(random, weight, steering, true);
  return text;
}

// Two or three weights on straight rails through the ball, low enough to be stable.
std::string line_like(Random& random, bool motors) {
  const double r = radius_of(random), shell = shell_of(random, r);
  const double low = -random.between(0.1, 0.3) * r;
  std::string text = ball_text(r, shell, 0.5, 0.15 * r);
  const char* directions[3] = {"[1, 0, 0]", "[0, 1, 0]", "[1, 1, 0]"};
  const int masses = 2 + random.pick(2);
  for (int i = 0; i < masses; ++i) {
    const double mass = random.between(0.2, 0.4) * shell;
    text +=
        fmt::format("[[mass]]\nmass = {:.4g}\nrail = {{ shape = \"line\", origin = [0, 0, {:.4g}], direction = {} }}\n",
                    mass, low * (1 + 0.3 * i), directions[i]);
    if (motors) text += motor_text(random, mass, 0.3 * r, false);
  }
  return text;
}

// One weight on a closed spline around the ball, one on an open one across it, and at times one on a ring.
std::string spline_like(Random& random, bool motors) {
  const double r = radius_of(random), shell = shell_of(random, r);
  std::string text = ball_text(r, shell, 0.5, 0.1 * r);
  const auto point = [&](double x, double y, double z) { return vector_text(x * r, y * r, z * r); };
  const double a = random.between(0.45, 0.65), b = random.between(0.45, 0.65), bend = random.between(-0.15, 0.15);
  const double first = random.between(0.2, 0.4) * shell, second = random.between(0.2, 0.4) * shell;
  text += fmt::format(
      "[[mass]]\nmass = {:.4g}\nrail = {{ shape = \"spline\", closed = true, points = [{}, {}, {}, {}] }}\n", first,
      point(0, bend, -b), point(a, 0, 0), point(0, -bend, b), point(-a, 0, 0));
  if (motors) text += motor_text(random, first, a * r, false);
  const double low = random.between(0.3, 0.5);
  text += fmt::format("[[mass]]\nmass = {:.4g}\nrail = {{ shape = \"spline\", points = [{}, {}, {}, {}] }}\n", second,
                      point(0, -0.7, -0.2), point(0.05, -0.3, -low), point(0.05, 0.3, -low), point(0, 0.7, -0.2));
  text += fmt::format("initial_position = {:.4g}\n", 0.75 * r);
  if (motors) text += motor_text(random, second, 0.4 * r, false);
  if (!random.coin()) return text;
  const double third = random.between(0.1, 0.3) * shell, ring = random.between(0.4, 0.6) * r;
  text += fmt::format(
      "[[mass]]\nmass = {:.4g}\nrail = {{ shape = \"circle\", radius = {:.4g}, axes = [[0, 0, -1], [0, 1, 0]] }}\n",
      third, ring);
  if (motors) text += motor_text(random, third, ring, true);
  return text;
}

}  // namespace

bool has_motors(int robot) { return robot % 4 != 0 && robot / 4 % 2 == 1; }

std::string random_robot(std::uint64_t seed, int robot) {
  Random random(seed * 7919 + static_cast<std::uint64_t>(robot));
  const bool motors = has_motors(robot);
  const std::string text = robot % 4 == 0   ? paper_like(random)
                           : robot % 4 == 1 ? desk_like(random, motors)
                           : robot % 4 == 2 ? line_like(random, motors)
                                            : spline_like(random, motors);
  return text + fmt::format("[surface]\nstatic_friction = {:.3g}\n", random.between(0.15, 0.6));
}

}  // namespace ballast::plan
