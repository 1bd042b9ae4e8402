#include "sim/masses/spline_rail.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "sim/masses/cubic_spline.h"

namespace ballast::sim {

using Eigen::Vector3d;

namespace {

constexpr int kPlaces = 32;  // samples in each piece of a rail

// The arc length along a curve, in parts short enough for Gauss's rule with five nodes.
class ArcLength {
 public:
  explicit ArcLength(const CubicSpline& curve) : curve_(curve) {
    const auto& knots = curve.knots();
    for (std::size_t piece = 0; piece < curve.pieces(); ++piece) {
      for (int part = 0; part < kParts; ++part) {
        ends_.push_back({piece, knots[piece] + part * (knots[piece + 1] - knots[piece]) / kParts, total_});
        total_ +=
            between(piece, ends_.back().u, knots[piece] + (part + 1) * (knots[piece + 1] - knots[piece]) / kParts);
      }
    }
  }

  [[nodiscard]] double total_m() const { return total_; }
  [[nodiscard]] double to_knot_m(std::size_t knot) const {
    return knot == curve_.pieces() ? total_ : ends_[knot * kParts].way;
  }

  // The point at this arc length.
  [[nodiscard]] Vector3d point_at(double way_m) const {
    const auto after = std::upper_bound(ends_.begin() + 1, ends_.end(), way_m,
                                        [](double way, const End& end) { return way < end.way; });
    const End& start = *(after - 1);
    double low = start.u, high = after == ends_.end() ? curve_.knots().back() : after->u;
    // Newton's method, with bisection to stay between the ends.
    double u = (low + high) / 2;
    for (int i = 0; i < 100 && high - low > 1e-15 * (1 + std::abs(u)); ++i) {
      const double excess = start.way + between(start.piece, start.u, u) - way_m;
      (excess > 0 ? high : low) = u;
      const double next = u - excess / curve_.at(start.piece, u).d1.norm();
      if (next == u) break;
      u = next > low && next < high ? next : (low + high) / 2;
    }
    return curve_.at(start.piece, u).position;
  }

 private:
  static constexpr int kParts = 16;
  struct End {
    std::size_t piece;
    double u;
    double way;
  };

  [[nodiscard]] double between(std::size_t piece, double from, double to) const {
    constexpr std::array<double, 3> kNode = {0, 0.5384693101056831, 0.9061798459386640};
    constexpr std::array<double, 3> kWeight = {128. / 225, 0.4786286704993665, 0.2369268850561891};
    const double middle = (from + to) / 2, half = (to - from) / 2;
    double sum = kWeight[0] * curve_.at(piece, middle).d1.norm();
    for (std::size_t j = 1; j < kNode.size(); ++j) {
      sum += kWeight[j] * (curve_.at(piece, middle - half * kNode[j]).d1.norm() +
                           curve_.at(piece, middle + half * kNode[j]).d1.norm());
    }
    return half * sum;
  }

  const CubicSpline& curve_;
  std::vector<End> ends_;  // starts of the parts
  double total_ = 0;
};

// The greatest |zeta| near theta, between its neighbours `step` away, by golden section.
double farthest_near(const firmware::Rail& rail, double theta, double step) {
  constexpr double kGolden = 0.6180339887498949;
  double low = theta - step, high = theta + step;
  const auto distance = [&](double at) { return firmware::evaluate(rail, at).position.squaredNorm(); };
  for (int i = 0; i < 40; ++i) {
    const double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
    (distance(left) < distance(right) ? low : high) = distance(left) < distance(right) ? left : right;
  }
  return (low + high) / 2;
}

}  // namespace

SplineRail spline_rail(const std::vector<Vector3d>& points, bool closed, int pieces) {
  SplineRail out{};
  firmware::Rail& rail = out.rail;
  rail.shape = firmware::RailShape::kSpline;
  out.length_m = std::numeric_limits<double>::quiet_NaN();

  std::vector<Vector3d> through = points;
  if (closed) through.push_back(points.front());
  std::vector<double> chord = {0};
  for (std::size_t i = 1; i < through.size(); ++i) chord.push_back(chord.back() + (through[i] - through[i - 1]).norm());
  const CubicSpline first = closed ? CubicSpline::closed(chord, through) : CubicSpline::open(chord, through);
  if (!first.finite()) return out;
  const ArcLength way(first);
  if (!std::isfinite(way.total_m())) return out;

  std::vector<double> knots;
  std::vector<Vector3d> equidistant;
  for (int k = 0; k <= pieces; ++k) {
    knots.push_back(way.total_m() * k / pieces);
    equidistant.push_back(k == 0 ? through.front() : k == pieces ? through.back() : way.point_at(knots.back()));
  }
  const CubicSpline even = closed ? CubicSpline::closed(knots, equidistant)
                                  : CubicSpline::clamped(knots, equidistant, first.at(chord.front()).d1.normalized(),
                                                         first.at(chord.back()).d1.normalized());
  if (!even.finite()) return out;
  rail.closed = closed;
  rail.piece_count = pieces;
  rail.piece_length_m = way.total_m() / pieces;
  for (std::size_t k = 0; k < equidistant.size(); ++k) {
    rail.knots[k] = {even.points()[k], even.second_derivatives()[k]};
  }
  out.length_m = firmware::length_m(rail);

  const double step = rail.piece_length_m / kPlaces;
  for (int k = 0; k <= pieces * kPlaces; ++k) {
    const double theta = std::min(k * step, out.length_m);
    const auto p = firmware::evaluate(rail, theta);
    const double error = std::abs(p.d1.norm() - 1);
    if (error > out.speed_error || std::isnan(error)) out.speed_error = error;  // NaN is taken over, and stays
    if (p.position.norm() > out.farthest_m) {
      out.farthest_m = p.position.norm();
      out.farthest_theta_m = theta;
    }
  }
  double refined = farthest_near(rail, out.farthest_theta_m, step);
  if (!closed) refined = std::clamp(refined, 0.0, out.length_m);
  if (const double distance = firmware::evaluate(rail, refined).position.norm(); distance > out.farthest_m) {
    out.farthest_m = distance;
    out.farthest_theta_m = refined;
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double distance = (firmware::evaluate(rail, way.to_knot_m(i)).position - points[i]).norm();
    if (distance > out.point_distance_m || std::isnan(distance)) {
      out.point_distance_m = distance;
      out.worst_point = i;
    }
  }
  return out;
}

}  // namespace ballast::sim
