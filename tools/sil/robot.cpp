#include "tools/sil/robot.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <tuple>
#include <utility>

namespace ballast::sil {

namespace {

using Json = nlohmann::ordered_json;
using firmware::RailShape;

// With so many chords a circle is off by 3e-4 of its radius, less than a pixel.
constexpr int kCirclePoints = 128;
constexpr int kPointsPerSplinePiece = 4;

Json vector_json(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

// The ends of a line rail inside the shell: |origin + theta axis| = radius. Equal if it passes outside.
std::pair<double, double> chord(const firmware::Rail& rail, double radius_m) {
  const double along = rail.origin_B_m.dot(rail.axis_cos_B);
  const double square = along * along - rail.origin_B_m.squaredNorm() + radius_m * radius_m;
  const double half = std::sqrt(std::max(square, 0.0));
  return {-along - half, -along + half};
}

Json rail_json(const firmware::Rail& rail, double radius_m) {
  double first = 0, last = 0;
  int count = 1;  // of intervals
  bool closed = false;
  const char* shape = "";
  switch (rail.shape) {
    case RailShape::kCircle:
      shape = "circle";
      closed = true;
      count = kCirclePoints;
      last = 2 * std::numbers::pi;
      break;
    case RailShape::kLine:
      shape = "line";
      std::tie(first, last) = chord(rail, radius_m);
      break;
    case RailShape::kSpline:
      shape = "spline";
      closed = rail.closed;
      count = kPointsPerSplinePiece * rail.piece_count;
      last = length_m(rail);
      break;
  }
  if (!closed && std::isfinite(rail.lower_end)) first = rail.lower_end;
  if (!closed && std::isfinite(rail.upper_end)) last = rail.upper_end;
  Json points = Json::array();
  for (int k = 0; k < (closed ? count : count + 1); ++k)  // the first point of a closed rail is not repeated
    points.push_back(vector_json(firmware::evaluate(rail, first + (last - first) * k / count).position));
  return {{"shape", shape}, {"closed", closed}, {"points", points}};
}

}  // namespace

std::string robot_json(const sim::Scenario& scenario) {
  Json masses = Json::array();
  for (const sim::Mass& mass : scenario.masses) {
    const bool on_rail = mass.trajectory.times_s.empty();
    masses.push_back(
        {{"mass", mass.mass_kg}, {"rail", on_rail ? rail_json(mass.rail, scenario.ball.radius_m) : Json(nullptr)}});
  }
  const Json robot = {{"gravity", scenario.gravity_mps2},
                      {"ball",
                       {{"radius", scenario.ball.radius_m},
                        {"mass", scenario.ball.mass_kg},
                        {"center_of_mass", vector_json(scenario.ball.center_of_mass_B_m)}}},
                      {"masses", masses}};
  return robot.dump() + "\n";
}

}  // namespace ballast::sil
