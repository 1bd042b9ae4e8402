#include "sim/masses/cubic_spline.h"

#include <Eigen/SparseLU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace ballast::sim {

using Eigen::Vector3d;

namespace {

class Equations {
 public:
  explicit Equations(std::size_t unknowns)
      : size_(static_cast<int>(unknowns)), right_(Eigen::MatrixX3d::Zero(size_, 3)) {}

  void add(std::size_t row, std::size_t column, double value) {
    entries_.emplace_back(static_cast<int>(row), static_cast<int>(column), value);
  }
  void set_right(std::size_t row, const Vector3d& value) { right_.row(static_cast<int>(row)) = value.transpose(); }

  [[nodiscard]] Eigen::MatrixX3d solve() const {
    Eigen::SparseMatrix<double> matrix(size_, size_);
    matrix.setFromTriplets(entries_.begin(), entries_.end());  // adds up entries of the same place
    Eigen::SparseLU<Eigen::SparseMatrix<double>> factors(matrix);
    if (factors.info() != Eigen::Success) {
      return Eigen::MatrixX3d::Constant(size_, 3, std::numeric_limits<double>::quiet_NaN());
    }
    return factors.solve(right_);
  }

 private:
  int size_;
  std::vector<Eigen::Triplet<double>> entries_;
  Eigen::MatrixX3d right_;
};

}  // namespace

CubicSpline CubicSpline::open(std::vector<double> knots, std::vector<Vector3d> points) {
  return {std::move(knots), std::move(points), Ends::kNotAKnot};
}

CubicSpline CubicSpline::closed(std::vector<double> knots, std::vector<Vector3d> points) {
  return {std::move(knots), std::move(points), Ends::kClosed};
}

CubicSpline CubicSpline::clamped(std::vector<double> knots, std::vector<Vector3d> points, const Vector3d& first_d1,
                                 const Vector3d& last_d1) {
  return {std::move(knots), std::move(points), Ends::kClamped, first_d1, last_d1};
}

CubicSpline::CubicSpline(std::vector<double> knots, std::vector<Vector3d> points, Ends ends, const Vector3d& first_d1,
                         const Vector3d& last_d1)
    : closed_(ends == Ends::kClosed),
      knots_(std::move(knots)),
      points_(std::move(points)),
      second_(points_.size(), Vector3d::Zero()) {
  const std::size_t last = pieces();
  const auto step = [&](std::size_t i) { return knots_[i + 1] - knots_[i]; };
  const auto slope = [&](std::size_t i) -> Vector3d { return (points_[i + 1] - points_[i]) / step(i); };
  const bool not_a_knot_ends = ends == Ends::kNotAKnot;
  if (not_a_knot_ends && last == 1) return;
  if (not_a_knot_ends && last == 2) {
    // The two end conditions are one and the same: a parabola.
    second_.assign(3, 2 * (slope(1) - slope(0)) / (step(0) + step(1)));
    return;
  }
  Equations equations(closed_ ? last : last + 1);
  // The first derivative is continuous at the knot between `left` and `right`.
  const auto smooth = [&](std::size_t row, std::size_t left, std::size_t right, std::size_t before, std::size_t after) {
    const double both = step(left) + step(right);
    equations.add(row, before, step(left) / both);
    equations.add(row, row, 2);
    equations.add(row, after, step(right) / both);
    equations.set_right(row, 6 * (slope(right) - slope(left)) / both);
  };
  // The third derivative is continuous at the knot between the pieces i and i + 1.
  const auto not_a_knot = [&](std::size_t row, std::size_t i) {
    const double both = step(i) + step(i + 1);
    equations.add(row, i, step(i + 1) / both);
    equations.add(row, i + 1, -1);
    equations.add(row, i + 2, step(i) / both);
  };
  for (std::size_t i = 1; i < last; ++i) smooth(i, i - 1, i, i - 1, closed_ ? (i + 1) % last : i + 1);
  if (closed_) {
    smooth(0, last - 1, 0, last - 1, 1);
  } else if (ends == Ends::kClamped) {
    equations.add(0, 0, 2);
    equations.add(0, 1, 1);
    equations.set_right(0, 6 * (slope(0) - first_d1) / step(0));
    equations.add(last, last - 1, 1);
    equations.add(last, last, 2);
    equations.set_right(last, 6 * (last_d1 - slope(last - 1)) / step(last - 1));
  } else {
    not_a_knot(0, 0);
    not_a_knot(last, last - 2);
  }
  const Eigen::MatrixX3d solution = equations.solve();
  for (std::size_t i = 0; i <= last; ++i) {
    second_[i] = solution.row(static_cast<int>(closed_ ? i % last : i)).transpose();
  }
}

bool CubicSpline::finite() const {
  return std::all_of(second_.begin(), second_.end(), [](const Vector3d& v) { return v.allFinite(); });
}

CubicSpline::Point CubicSpline::at(double u) const {
  if (closed_) {
    const double length = knots_.back() - knots_.front();
    u -= length * std::floor((u - knots_.front()) / length);
  }
  const auto inner = std::upper_bound(knots_.begin() + 1, knots_.end() - 1, u);
  return at(static_cast<std::size_t>(inner - knots_.begin()) - 1, u);
}

CubicSpline::Point CubicSpline::at(std::size_t piece, double u) const {
  const double h = knots_[piece + 1] - knots_[piece];
  const double b = (u - knots_[piece]) / h, a = (knots_[piece + 1] - u) / h;
  const Vector3d &y0 = points_[piece], &y1 = points_[piece + 1], &m0 = second_[piece], &m1 = second_[piece + 1];
  return {a * y0 + b * y1 + ((a * a * a - a) * m0 + (b * b * b - b) * m1) * (h * h / 6),
          (y1 - y0) / h + ((1 - 3 * a * a) * m0 + (3 * b * b - 1) * m1) * (h / 6), a * m0 + b * m1};
}

}  // namespace ballast::sim
