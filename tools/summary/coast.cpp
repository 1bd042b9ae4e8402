#include "tools/summary/coast.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "sim/plant/local_floor.h"
#include "tools/program/short_number.h"

namespace ballast::sil {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

double Coast::distance_m(double rolling_resistance) const {
  if (!(energy_j > 0)) return 0;
  return rolling_resistance > 0 ? energy_j / (rolling_resistance * weight_n) : std::numeric_limits<double>::infinity();
}

namespace {

double resistance_under(const sim::Scenario& scenario, const sim::Plant::Sample& end) {
  sim::LocalFloor floor(scenario.surface);
  floor.stand_at(end.position_W_m.head<2>());
  return floor.rolling_resistance();
}

}  // namespace

std::optional<Coast> coast(const sim::Scenario& scenario, const sim::Plant::Sample& end) {
  const double gravity_mps2 = scenario.gravity_mps2;
  if (end.regime != sim::Regime::kRolling || scenario.surface.slope_rad != 0 || !(gravity_mps2 > 0)) return {};
  const Vector3d up_B = end.up_B.normalized();
  const Vector3d turning_B = end.angular_velocity_B_radps - end.angular_velocity_B_radps.dot(up_B) * up_B;
  const auto kinetic_j = [&](double mass_kg, const Vector3d& place_B_m) {
    return mass_kg * turning_B.cross(scenario.ball.radius_m * up_B + place_B_m).squaredNorm() / 2;
  };
  const sim::Ball& ball = scenario.ball;
  double mass_kg = ball.mass_kg;
  double energy_j =
      turning_B.dot(ball.inertia_kgm2.cwiseProduct(turning_B)) / 2 + kinetic_j(ball.mass_kg, ball.center_of_mass_B_m);
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    mass_kg += scenario.masses[i].mass_kg;
    energy_j += kinetic_j(scenario.masses[i].mass_kg, end.mass_position_B_m[i]);
  }
  // The centre of mass goes round the axis on a circle. A ball that stands still falls about the level axis across it.
  const Vector3d& center_B_m = end.center_of_mass_B_m;
  const double height_m = center_B_m.dot(up_B);
  const double speed_radps = turning_B.norm();
  const double along_m = speed_radps > 0 ? center_B_m.dot(turning_B) / speed_radps : 0;
  const double circle_m = std::sqrt(std::max(0.0, center_B_m.squaredNorm() - along_m * along_m));
  const double weight_n = mass_kg * gravity_mps2;
  const bool turns_over = energy_j > weight_n * (circle_m - height_m);
  Coast found{energy_j + weight_n * (height_m + circle_m), weight_n, turns_over, 0};
  found.own_distance_m = found.distance_m(resistance_under(scenario, end));
  return found;
}

Json coast_json(const sim::Scenario& scenario, const RunResult& result) {
  const auto found = coast(scenario, result.final_sample);
  if (!found) return nullptr;
  Json floors = Json::array();
  for (const ResistingFloor& floor : kResistingFloors) {
    floors.push_back(
        {{"name", floor.name},
         {"rolling_resistance", {floor.least_resistance, floor.most_resistance}},
         {"distance", {found->distance_m(floor.most_resistance), found->distance_m(floor.least_resistance)}}});
  }
  const bool stops = std::isfinite(found->own_distance_m);
  return {{"energy", found->energy_j},
          {"turns_over", found->turns_over},
          {"distance", stops ? Json(found->own_distance_m) : Json(nullptr)},
          {"floors", floors}};
}

std::string coast_line(const sim::Scenario& scenario, const RunResult& result) {
  using program::short_number;
  const auto found = coast(scenario, result.final_sample);
  // As in the line above it, less than a ten-thousandth of the ball per second is standing still.
  if (!found || result.final_sample.velocity_W_mps.norm() < 1e-4 * scenario.ball.radius_m) return "";
  if (!found->turns_over) {
    return "  coasts      not over the top: with its masses held, the ball would rock to rest about where it is\n";
  }
  std::string text;
  if (std::isfinite(found->own_distance_m)) {
    text = short_number(found->own_distance_m) +
           (scenario.surface.patches.empty() ? " m on this floor" : " m if the floor stayed as it is there");
  }
  for (const ResistingFloor& floor : kResistingFloors) {
    text += fmt::format("{}{} to {} m on {}", text.empty() ? "" : ", ",
                        short_number(found->distance_m(floor.most_resistance)),
                        short_number(found->distance_m(floor.least_resistance)), floor.name);
  }
  return "  coasts      " + text + "\n";
}

}  // namespace ballast::sil
