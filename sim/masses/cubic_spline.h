// A cubic curve through points in space with continuous second derivatives: for rails (spline_rail.h) and trajectories.
//
// Between the knots u_i and u_i+1, h apart, with b = (u - u_i) / h, a = 1 - b and the second derivatives M_i at the
// knots,
//   c(u) = a c_i + b c_i+1 + ((a^3 - a) M_i + (b^3 - b) M_i+1) h^2 / 6,
// and continuous first derivatives make the M_i the solution of a sparse linear system (de Boor, "A Practical Guide to
// Splines", ch. IV). Eigen's own (unsupported) splines do not fit: they have no closed curves, they put the knots at
// averages of the parameters instead of the instants of a table, and they do not give second derivatives at the knots.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace ballast::sim {

class CubicSpline {
 public:
  // The following need as many points as knots, at least 2, and increasing knots. Where the equations have no finite
  // solution, as with numbers near the ends of the range, finite() is false.

  // Not-a-knot: the third derivative is continuous at the second and the last but one knot too, so the spline
  // reproduces any cubic. Three points make a parabola, two a line.
  static CubicSpline open(std::vector<double> knots, std::vector<Eigen::Vector3d> points);
  // Periodic with the length of the knots; first and last point equal, at least 3.
  static CubicSpline closed(std::vector<double> knots, std::vector<Eigen::Vector3d> points);

  // With given first derivatives at the ends.
  static CubicSpline clamped(std::vector<double> knots, std::vector<Eigen::Vector3d> points,
                             const Eigen::Vector3d& first_d1, const Eigen::Vector3d& last_d1);

  CubicSpline() = default;
  [[nodiscard]] bool empty() const { return knots_.empty(); }

  struct Point {
    Eigen::Vector3d position, d1, d2;
  };
  // A closed curve repeats for ever; an open one continues beyond its ends with the cubics there.
  [[nodiscard]] Point at(double u) const;
  // The cubic of one piece, at any u.
  [[nodiscard]] Point at(std::size_t piece, double u) const;

  [[nodiscard]] std::size_t pieces() const { return knots_.size() - 1; }
  [[nodiscard]] const std::vector<double>& knots() const { return knots_; }
  [[nodiscard]] const std::vector<Eigen::Vector3d>& points() const { return points_; }
  [[nodiscard]] const std::vector<Eigen::Vector3d>& second_derivatives() const { return second_; }
  [[nodiscard]] bool finite() const;

 private:
  enum class Ends { kNotAKnot, kClosed, kClamped };
  CubicSpline(std::vector<double> knots, std::vector<Eigen::Vector3d> points, Ends ends,
              const Eigen::Vector3d& first_d1 = Eigen::Vector3d::Zero(),
              const Eigen::Vector3d& last_d1 = Eigen::Vector3d::Zero());

  bool closed_ = false;
  std::vector<double> knots_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<Eigen::Vector3d> second_;  // M_i
};

}  // namespace ballast::sim
