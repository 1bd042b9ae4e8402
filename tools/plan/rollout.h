// A motion of the masses, and the ball's under it.
//
// A motion is the rail acceleration of every mass at knots a constant time apart, linear between them: the decision
// variables of the planner. Variable j n + i is knot j of mass i. Positions and rates of the masses are then linear in
// the variables; only attitude, angular velocity and place of the ball are integrated, by RK4 with a fixed number of
// steps per piece, together with their derivatives by the variables. Where a floor resists and the ball is slow, a step
// is made in parts.
#pragma once

#include <array>
#include <vector>

#include "tools/plan/problem.h"

namespace ballast::plan {

// Times of knots and nodes. Node k is the end of step k.
struct Grid {
  double duration_s = 0;
  int pieces = 0;
  int steps_per_piece = 0;

  [[nodiscard]] int knots() const { return pieces + 1; }
  [[nodiscard]] int nodes() const { return pieces * steps_per_piece + 1; }
  [[nodiscard]] double step_s() const { return duration_s / (pieces * steps_per_piece); }
  [[nodiscard]] double piece_s() const { return duration_s / pieces; }
  // Knots that have an influence on node k: 0 to knots_before(k) - 1.
  [[nodiscard]] int knots_before(int node) const {
    return std::min(knots(), (node + steps_per_piece - 1) / steps_per_piece + 1);
  }
};

// Steps short enough for the ball: their error in the place is corrected in the end against the plant, and must be
// small beside what separates two motions.
[[nodiscard]] Grid make_grid(const Problem& problem, double duration_s, int pieces);

// Change of a mass's position, velocity and acceleration at a node by an acceleration of 1 at a knot.
struct Basis {
  explicit Basis(const Grid& grid);
  // [node][knot]
  std::vector<double> position, velocity, acceleration;
  int knots;
  [[nodiscard]] std::size_t at(int node, int knot) const {
    return static_cast<std::size_t>(node) * static_cast<std::size_t>(knots) + static_cast<std::size_t>(knot);
  }
};

struct Node {
  RollingState state;
  std::array<double, 2> place_m;
  RollingValue value;
};

// Rows of the tangent: phi (3), Omega (3), place (2).
inline constexpr int kTangent = 8;

class Rollout {
 public:
  Rollout(const Problem& problem, const Grid& grid);

  [[nodiscard]] const Grid& grid() const { return grid_; }
  [[nodiscard]] const Basis& basis() const { return basis_; }
  [[nodiscard]] int variables() const { return variables_; }

  // Rolls the ball. False if it stops being finite; nodes from there on are then meaningless.
  bool roll(const std::vector<double>& knots);
  [[nodiscard]] const std::vector<Node>& nodes() const { return nodes_; }
  // Replaces the nodes by those of another program, whose states are better.
  void adopt(const std::vector<Node>& nodes) { nodes_ = nodes; }

  // Derivatives of the nodes that roll() has set, by the knots.
  void differentiate();
  // Derivatives of a node's value. Set for every node.
  [[nodiscard]] const RollingDerivative& derivative(int node) const {
    return derivatives_[static_cast<std::size_t>(node)];
  }
  // Row `row` of the tangent at `node` by the variables; only the first knots_before(node) n of them are not 0.
  [[nodiscard]] const double* sensitivity(int node, int row) const {
    return &sensitivity_[(static_cast<std::size_t>(node) * kTangent + static_cast<std::size_t>(row)) *
                         static_cast<std::size_t>(variables_)];
  }

 private:
  void place_masses(const std::vector<double>& knots);
  void step(int node);
  void differentiate_step(int node);

  // The robot on the floor of a place.
  const Robot& robot_at(const std::array<double, 2>& place_m);
  // The ball with the greater rolling resistance of both ends of the step of h seconds from a node.
  firmware::BallParams ball_ahead(const Node& from, double h);

  const Problem& problem_;
  Robot local_robot_;  // used on floors with patches
  Grid grid_;
  Basis basis_;
  int variables_;
  std::vector<Node> nodes_;
  std::vector<int> parts_;  // of the step that starts at each node
  std::vector<RollingDerivative> derivatives_;
  std::vector<double> sensitivity_;
};

}  // namespace ballast::plan
