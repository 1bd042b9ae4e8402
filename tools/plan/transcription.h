// The planning problem in the planner's variables: what has to be small, to vanish or to stay within limits, as
// functions of a rollout, each with its derivatives on request. All are dimensionless: lengths by r, times by sqrt(r /
// g), forces by weight, limits by themselves.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tools/plan/rollout.h"

namespace ballast::plan {

enum class LimitKind {
  kNormalForce,
  kRailEnd,
  kSpeed,
  kAcceleration,
  kJerk,
  kTorque,
  kResonance,
  kKeepOut,
  kFollow,
  kStability,
  kRestSpin,
};

// Linear form in the tangent and the masses' motion at one node, or in the knots themselves.
struct NodeForm {
  int node = 0;
  std::array<double, kTangent> tangent{};
  PerMass<std::array<double, 3>> mass{};  // by position, velocity, acceleration
};

struct Limit {
  LimitKind kind;
  int index;  // of the mass or the circle
  int node;   // or knot
  double value, lower, upper;
};

// Corrections that make the planner's model agree with the plant, and room kept from limits.
struct Corrections {
  std::vector<double> equality;  // added to the equalities; empty: none
  double room = 0;               // of limits that hold between nodes too
  double speed_room = 0;         // beyond the room that speeds have anyway, in parts of the limit
  double rail_room = 0;          // beyond the room that rail ends have anyway, in parts of the rail
  double friction = 1;           // the plant's located maximum of f_s / N over that at the nodes
};

// The condition that an equality stands for.
struct EqualityKind {
  enum { kGoal, kVia, kSpin, kMassRate, kBalance, kMassPosition } kind;
  int index;
};

inline constexpr double kNearResonance = 0.15;  // of the speed

class Transcription {
 public:
  Transcription(const Problem& problem, const Rollout& rollout);

  // Reference of f_s / N, by which it is made dimensionless.
  double friction_unit = 1;
  Corrections corrections;
  double resonance_weight = 0;     // of the whole time spent at a motor's resonance, beside the friction's 1
  std::vector<double> via_time_s;  // of each via place

  // f_s / N at the nodes, weighted by place (patched_floor.h), over friction_unit. A node whose N is not well above 0
  // has a large one.
  [[nodiscard]] std::vector<double> ratios() const;
  // f / N of a node (two components), weighted like them, over friction_unit, and its derivatives.
  void ratio_forms(int node, std::array<double, 2>& value, std::array<NodeForm, 2>& form) const;

  // Calls `sink` for each limit; `form` is filled only `with_forms`. Limits of knots come from knot_limits().
  using Sink = std::function<void(const Limit& limit, const NodeForm& form)>;
  void limits(bool with_forms, const Sink& sink) const;

  // By how much the ball passes a circle or leaves the path between two nodes, in radii, along cubics through the
  // nodes; 0: nowhere. `worst` is set if it does.
  [[nodiscard]] double beyond_between_nodes(Limit& worst) const;

  // Soft terms, small but without a limit, as residuals of a sum of squares: the time that motors spend near their
  // resonances, times resonance_weight.
  using SoftSink = std::function<void(double residual, const NodeForm& form)>;
  void soft_terms(const SoftSink& sink) const;
  // Part of the duration in which some motor is within kNearResonance of one.
  [[nodiscard]] double time_near_resonance() const;

  // Each equality has up to two forms (a via place lies between two nodes).
  struct Equality {
    EqualityKind kind;
    double value;
    int forms;
    std::array<NodeForm, 2> form;
  };
  [[nodiscard]] std::vector<Equality> equalities(bool with_forms) const;

  // Moves the times of via places that have none given towards the nearest pass.
  void move_via_times();

  // Row of `form` over the variables, added to `out` times `factor`. Returns the end of its columns.
  int expand(const NodeForm& form, double factor, double* out) const;

  [[nodiscard]] const Problem& problem() const { return problem_; }
  [[nodiscard]] const Rollout& rollout() const { return rollout_; }

 private:
  [[nodiscard]] PatchedFloor::Weight weight(const Node& node) const;
  void motor_limits(int node, bool with_forms, const Sink& sink) const;
  void place_limits(int node, const Eigen::Vector2d& place, bool with_forms, const Sink& sink) const;
  // The rate of turning about an axis of the space frame, dimensionless, and its derivative.
  struct Turning {
    double value;
    std::array<double, kTangent> tangent;
  };
  [[nodiscard]] Turning turning(const RollingState& state, const Vec& axis_W) const;
  [[nodiscard]] bool may_spin() const;
  void rest_equalities(bool with_forms, std::vector<Equality>& out) const;
  void center_of_mass(Vec& center_B, std::array<Vec, kMaxMasses>& by_position) const;

  const Problem& problem_;
  const Rollout& rollout_;
  double length_, time_, weight_, depth_;
};

}  // namespace ballast::plan
