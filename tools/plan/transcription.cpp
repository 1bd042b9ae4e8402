#include "tools/plan/transcription.h"

#include <algorithm>
#include <cmath>

namespace ballast::plan {

using sim::cross;
using sim::dot;

namespace {

std::size_t index(int i) { return static_cast<std::size_t>(i); }

constexpr double kLeastNormal = 0.02;  // of the weight: the ratio f_s / N means nothing at a vanishing N
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Where a place lies beside a polyline: at `distance` from its nearest point, in the direction `away`. Beside a leg the
// distance has a sign, positive to the left, so that a step across the leg does not count as a step towards it.
struct Beside {
  double distance = std::numeric_limits<double>::infinity();
  Eigen::Vector2d away{0, 0};
  bool of_leg = false;  // else of a corner or an end, and positive
};

Beside beside(const std::vector<Eigen::Vector2d>& points, const Eigen::Vector2d& place) {
  Beside best;
  for (std::size_t k = 0; k + 1 < points.size(); ++k) {
    const Eigen::Vector2d along = points[k + 1] - points[k], from_start = place - points[k];
    const double length = along.squaredNorm();
    const double part = length > 0 ? from_start.dot(along) / length : 0;
    Beside candidate;
    if (part > 0 && part < 1) {
      candidate.of_leg = true;
      candidate.away = Eigen::Vector2d(-along[1], along[0]) / std::sqrt(length);
      candidate.distance = from_start.dot(candidate.away);
    } else {
      const Eigen::Vector2d from_end = part > 0 ? Eigen::Vector2d(place - points[k + 1]) : from_start;
      candidate.distance = from_end.norm();
      if (candidate.distance > 0) candidate.away = from_end / candidate.distance;
    }
    if (std::abs(candidate.distance) < std::abs(best.distance)) best = candidate;
  }
  return best;
}

Vec vec(const firmware::Vector3& v) { return {v[0], v[1], v[2]}; }

// Against the weight, space frame: e3 on a level floor.
Vec up_W(const firmware::BallParams& ball) {
  return slopes(ball) ? Vec{-ball.down_W[0], -ball.down_W[1], -ball.down_W[2]} : Vec{0, 0, 1};
}

}  // namespace

Transcription::Transcription(const Problem& problem, const Rollout& rollout)
    : problem_(problem), rollout_(rollout), length_(problem.robot.ball.radius_m), time_(time_unit_s(problem)) {
  const firmware::BallParams& ball = problem.robot.ball;
  double mass = ball.shell_mass_kg;
  Vec moment = ball.shell_mass_kg * vec(ball.center_of_mass_B_m);
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = index(i);
    mass += ball.mass_kg[k];
    moment =
        moment + ball.mass_kg[k] * vec(firmware::evaluate<double>(ball.rail[k], problem.start.position[k]).position);
  }
  weight_ = mass * std::max(ball.gravity_mps2, 1e-9);
  depth_ = std::clamp(std::sqrt(dot(moment, moment)) / mass, 0.02 * length_, length_);
  for (std::size_t v = 0; v < problem.task.via.size(); ++v) {
    const auto& time = problem.task.via[v].time_s;
    via_time_s.push_back(time ? *time
                              : rollout.grid().duration_s * static_cast<double>(v + 1) /
                                    static_cast<double>(problem.task.via.size() + 1));
  }
}

// Holds for the half step on both sides of the node too.
PatchedFloor::Weight Transcription::weight(const Node& node) const {
  constexpr double kLeastMargin = 0.01;  // of r: more than model and plant differ by
  constexpr double kHalfStep = 0.6;      // of a step, with room for a speed that changes
  const double margin_m =
      kLeastMargin * length_ +
      kHalfStep * rollout_.grid().step_s() * std::hypot(node.value.velocity_mps[0], node.value.velocity_mps[1]);
  return problem_.floor.weight({node.place_m[0], node.place_m[1]}, margin_m);
}

std::vector<double> Transcription::ratios() const {
  std::vector<double> out;
  out.reserve(rollout_.nodes().size());
  for (const Node& node : rollout_.nodes()) {
    const double n = std::max(node.value.normal_n, kLeastNormal * weight_);
    out.push_back(corrections.friction * std::hypot(node.value.force_n[0], node.value.force_n[1]) / n / friction_unit);
    if (problem_.floor.has_patches()) out.back() *= weight(node).value;
  }
  return out;
}

void Transcription::ratio_forms(int node, std::array<double, 2>& value, std::array<NodeForm, 2>& form) const {
  const Node& at = rollout_.nodes()[index(node)];
  const RollingDerivative& d = rollout_.derivative(node);
  const bool held = at.value.normal_n < kLeastNormal * weight_;
  const double n = held ? kLeastNormal * weight_ : at.value.normal_n;
  for (std::size_t c = 0; c < 2; ++c) {
    const double q = at.value.force_n[c] / n, unit = friction_unit / corrections.friction;
    value[c] = q / unit;
    NodeForm& out = form[c];
    out.node = node;
    const auto by = [&](std::size_t k) { return (d.force_n[c][k] - (held ? 0 : q * d.normal_n[k])) / n / unit; };
    for (std::size_t k = 0; k < 6; ++k) out.tangent[k] = by(k);
    for (int i = 0; i < problem_.masses(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) out.mass[index(i)][k] = by(6 + 3 * index(i) + k);
    }
  }
  if (!problem_.floor.has_patches()) return;
  const PatchedFloor::Weight at_place = weight(at);
  for (std::size_t c = 0; c < 2; ++c) {
    NodeForm& out = form[c];
    for (double& by : out.tangent) by *= at_place.value;
    for (auto& mass : out.mass) {
      for (double& by : mass) by *= at_place.value;
    }
    for (std::size_t k = 0; k < 2; ++k) out.tangent[6 + k] += value[c] * at_place.gradient[static_cast<int>(k)];
    value[c] *= at_place.value;
  }
}

void Transcription::limits(bool with_forms, const Sink& sink) const {
  const Grid& grid = rollout_.grid();
  for (int node = 1; node < grid.nodes(); ++node) {
    const Node& at = rollout_.nodes()[index(node)];
    NodeForm form;
    form.node = node;
    if (with_forms) {
      const RollingDerivative& d = rollout_.derivative(node);
      for (std::size_t k = 0; k < 6; ++k) form.tangent[k] = d.normal_n[k] / weight_;
      for (int i = 0; i < problem_.masses(); ++i) {
        for (std::size_t k = 0; k < 3; ++k) form.mass[index(i)][k] = d.normal_n[6 + 3 * index(i) + k] / weight_;
      }
    }
    sink({LimitKind::kNormalForce, 0, node, at.value.normal_n / weight_,
          problem_.least_normal_n / weight_ + kLeastNormal, kInfinity},
         form);
    motor_limits(node, with_forms, sink);
    place_limits(node, {at.place_m[0], at.place_m[1]}, with_forms, sink);
  }
  if (!problem_.task.at_rest) return;
  // Stable: the centre of mass below the geometric centre, along the weight (physics.md, "Rest").
  const int last = grid.nodes() - 1;
  Vec center;
  std::array<Vec, kMaxMasses> by_position;
  center_of_mass(center, by_position);
  const Vec up = to_body(rollout_.nodes()[index(last)].state.q, up_W(problem_.robot.ball));
  NodeForm form;
  form.node = last;
  const Vec turn = cross(center, up);  // d(center . up) by phi: center . (up x phi)
  form.tangent[0] = turn.x / depth_;
  form.tangent[1] = turn.y / depth_;
  form.tangent[2] = turn.z / depth_;
  for (int i = 0; i < problem_.masses(); ++i) form.mass[index(i)][0] = dot(by_position[index(i)], up) / depth_;
  constexpr double kLeastDepth = 0.1;
  sink({LimitKind::kStability, 0, last, dot(center, up) / depth_, -kInfinity, -kLeastDepth}, form);
  if (!may_spin()) return;
  const Turning spin = turning(rollout_.nodes()[index(last)].state, {0, 0, 1});
  form.mass = {};
  form.tangent = spin.tangent;
  constexpr double kRoom = 3e-4;  // by which model and plant differ
  const double most = problem_.task.rest_spin_radps * time_ - std::min(corrections.room, kRoom);
  sink({LimitKind::kRestSpin, 0, last, spin.value, -most, most}, form);
}

bool Transcription::may_spin() const { return problem_.task.rest_spin_radps > 0 && !slopes(problem_.robot.ball); }

Transcription::Turning Transcription::turning(const RollingState& state, const Vec& axis_W) const {
  const Vec axis = to_body(state.q, axis_W), turn = cross(state.omega_B, axis);
  const Vec rate = time_ * axis, attitude = time_ * turn;
  return {dot(state.omega_B, rate), {attitude.x, attitude.y, attitude.z, rate.x, rate.y, rate.z}};
}

void Transcription::motor_limits(int node, bool with_forms, const Sink& sink) const {
  const Node& at = rollout_.nodes()[index(node)];
  for (int i = 0; i < problem_.masses(); ++i) {
    const auto k = index(i);
    const MassLimits& limits = problem_.limits[k];
    NodeForm form;
    form.node = node;
    const double unit = length_ / problem_.metres_per_unit[k];
    if (std::isfinite(limits.lower) || std::isfinite(limits.upper)) {
      const double room = (1e-3 + corrections.rail_room) * (limits.upper - limits.lower) / unit;  // between nodes
      form.mass[k] = {1 / unit, 0, 0};
      sink({LimitKind::kRailEnd, i, node, at.state.position[k] / unit, limits.lower / unit + room,
            limits.upper / unit - room},
           form);
    }
    if (std::isfinite(limits.speed)) {
      const double room = 0.004 + corrections.speed_room;  // between nodes
      form.mass[k] = {0, 1 / limits.speed, 0};
      sink({LimitKind::kSpeed, i, node, at.state.velocity[k] / limits.speed, -1 + room, 1 - room}, form);
    }
    if (!limits.motor) continue;
    const sim::Motor& motor = limits.motor->motor();
    const double ratio = motor.shaft_ratio, speed = ratio * at.state.velocity[k];
    const double available = limits.motor->available_torque_nm(speed);
    const double used = (at.value.torque[k] / ratio + motor.viscous_damping_nms * speed) / available;
    if (with_forms) {
      const RollingDerivative& d = rollout_.derivative(node);
      for (std::size_t c = 0; c < 6; ++c) form.tangent[c] = d.torque[k][c] / ratio / available;
      for (int j = 0; j < problem_.masses(); ++j) {
        for (std::size_t c = 0; c < 3; ++c)
          form.mass[index(j)][c] = d.torque[k][6 + 3 * index(j) + c] / ratio / available;
      }
      const double step = 1e-4 * std::max(1.0, std::abs(speed));
      const double slope =
          (limits.motor->available_torque_nm(speed + step) - limits.motor->available_torque_nm(speed - step)) /
          (2 * step);
      form.mass[k][1] += (motor.viscous_damping_nms - used * slope) * ratio / available;
    }
    const double most = 1 - problem_.task.torque_margin - 1e-3;
    sink({LimitKind::kTorque, i, node, used, -most, most}, form);
  }
}

void Transcription::soft_terms(const SoftSink& sink) const {
  if (resonance_weight == 0) return;
  const int nodes = rollout_.grid().nodes();
  for (int node = 0; node < nodes; ++node) {
    const Node& at = rollout_.nodes()[index(node)];
    for (int i = 0; i < problem_.masses(); ++i) {
      const auto k = index(i);
      const double speed = std::abs(at.state.velocity[k]);
      for (const double resonant : problem_.limits[k].resonant_speeds) {
        // A tent, whose sides point away from the resonance even at its top.
        const double off = (speed - resonant) / (2 * kNearResonance * resonant);
        if (std::abs(off) >= 1) continue;
        const double unit = std::sqrt(2 * resonance_weight / nodes), residual = unit * (1 - std::abs(off));
        NodeForm form;
        form.node = node;
        const double slope = (off < 0 ? unit : -unit) / (2 * kNearResonance * resonant);
        form.mass[k][1] = at.state.velocity[k] < 0 ? -slope : slope;
        sink(residual, form);
      }
    }
  }
}

double Transcription::time_near_resonance() const {
  int near = 0;
  for (const Node& node : rollout_.nodes()) {
    bool any = false;
    for (int i = 0; i < problem_.masses(); ++i) {
      const double speed = std::abs(node.state.velocity[index(i)]);
      for (const double resonant : problem_.limits[index(i)].resonant_speeds) {
        any = any || std::abs(speed - resonant) < kNearResonance * resonant;
      }
    }
    near += any ? 1 : 0;
  }
  return static_cast<double>(near) / static_cast<double>(rollout_.nodes().size());
}

double Transcription::beyond_between_nodes(Limit& worst) const {
  if (problem_.task.keep_out.empty() && !problem_.task.follow) return 0;
  const double h = rollout_.grid().step_s();
  double most = 0;
  for (int node = 0; node + 1 < rollout_.grid().nodes(); ++node) {
    const Node &from = rollout_.nodes()[index(node)], &to = rollout_.nodes()[index(node + 1)];
    for (const double c : {0.25, 0.5, 0.75}) {
      Eigen::Vector2d place;
      for (int axis = 0; axis < 2; ++axis) {
        const auto k = index(axis);
        const double by_start = (1 + 2 * c) * (1 - c) * (1 - c), by_end = c * c * (3 - 2 * c);
        place[axis] = by_start * from.place_m[k] + by_end * to.place_m[k] +
                      h * c * (1 - c) * ((1 - c) * from.value.velocity_mps[k] - c * to.value.velocity_mps[k]);
      }
      place_limits(node, place, false, [&](const Limit& limit, const NodeForm&) {
        const double beyond = std::max(limit.value - limit.upper, limit.lower - limit.value);
        if (beyond <= most) return;
        most = beyond;
        worst = limit;
      });
    }
  }
  return most;
}

void Transcription::place_limits(int node, const Eigen::Vector2d& place, bool with_forms, const Sink& sink) const {
  const auto judge = [&](LimitKind kind, int i, double distance, const Eigen::Vector2d& away, double lower,
                         double upper) {
    NodeForm form;
    form.node = node;
    if (with_forms) {
      form.tangent[6] = away[0] / length_;
      form.tangent[7] = away[1] / length_;
    }
    sink({kind, i, node, distance / length_, lower / length_, upper / length_}, form);
  };
  const auto& circles = problem_.task.keep_out;
  for (std::size_t c = 0; c < circles.size(); ++c) {
    const double clear = circles[c].radius_m + length_;
    const Eigen::Vector2d from_center = place - circles[c].center_m;
    const double distance = from_center.norm();
    const Eigen::Vector2d away = distance > 0 ? Eigen::Vector2d(from_center / distance) : Eigen::Vector2d(0, 0);
    judge(LimitKind::kKeepOut, static_cast<int>(c), distance, away, clear + corrections.room * length_, kInfinity);
  }
  if (const auto& follow = problem_.task.follow) {
    const double most = follow->tolerance_m - std::min(corrections.room * length_, 0.2 * follow->tolerance_m);
    const Beside at_path = beside(follow->points_m, place);
    judge(LimitKind::kFollow, 0, at_path.distance, at_path.away, at_path.of_leg ? -most : -kInfinity, most);
  }
}

void Transcription::center_of_mass(Vec& center_B, std::array<Vec, kMaxMasses>& by_position) const {
  const firmware::BallParams& ball = problem_.robot.ball;
  const RollingState& state = rollout_.nodes().back().state;
  double mass = ball.shell_mass_kg;
  center_B = ball.shell_mass_kg * vec(ball.center_of_mass_B_m);
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = index(i);
    const auto point = firmware::evaluate<double>(ball.rail[k], state.position[k]);
    mass += ball.mass_kg[k];
    center_B = center_B + ball.mass_kg[k] * vec(point.position);
    by_position[k] = ball.mass_kg[k] * vec(point.d1);
  }
  center_B = (1 / mass) * center_B;
  for (Vec& v : by_position) v = (1 / mass) * v;
}

std::vector<Transcription::Equality> Transcription::equalities(bool with_forms) const {
  std::vector<Equality> out;
  const Grid& grid = rollout_.grid();
  const int last = grid.nodes() - 1;
  const Node& end = rollout_.nodes().back();
  for (int c = 0; c < 2; ++c) {
    Equality e{{EqualityKind::kGoal, c}, (end.place_m[index(c)] - problem_.task.goal_m[c]) / length_, 1, {}};
    e.form[0].node = last;
    e.form[0].tangent[index(6 + c)] = 1 / length_;
    out.push_back(e);
  }
  for (std::size_t v = 0; v < problem_.task.via.size(); ++v) {
    const double h = grid.step_s();
    const int node = std::clamp(static_cast<int>(via_time_s[v] / h), 0, grid.nodes() - 2);
    const double x = via_time_s[v] / h - node;
    // Cubic Hermite weights of place and velocity at both nodes.
    const double place[2] = {(1 + 2 * x) * (1 - x) * (1 - x), x * x * (3 - 2 * x)};
    const double rate[2] = {h * x * (1 - x) * (1 - x), h * x * x * (x - 1)};
    for (int c = 0; c < 2; ++c) {
      Equality e{{EqualityKind::kVia, static_cast<int>(v)}, -problem_.task.via[v].position_m[c] / length_, 2, {}};
      for (int k = 0; k < 2; ++k) {
        const Node& at = rollout_.nodes()[index(node + k)];
        e.value += (place[k] * at.place_m[index(c)] + rate[k] * at.value.velocity_mps[index(c)]) / length_;
        NodeForm& form = e.form[index(k)];
        form.node = node + k;
        form.tangent[index(6 + c)] = place[k] / length_;
        if (!with_forms) continue;
        const RollingDerivative& d = rollout_.derivative(node + k);
        for (std::size_t j = 0; j < 6; ++j) form.tangent[j] = rate[k] * d.velocity_mps[index(c)][j] / length_;
      }
      out.push_back(e);
    }
  }
  for (std::size_t i = 0; i < problem_.task.mass_position.size(); ++i) {
    const double unit = length_ / problem_.metres_per_unit[i];
    Equality e{{EqualityKind::kMassPosition, static_cast<int>(i)},
               (end.state.position[i] - problem_.task.mass_position[i]) / unit,
               1,
               {}};
    e.form[0].node = last;
    e.form[0].mass[i] = {1 / unit, 0, 0};
    out.push_back(e);
  }
  if (problem_.task.at_rest) rest_equalities(with_forms, out);
  for (std::size_t k = 0; k < std::min(out.size(), corrections.equality.size()); ++k) {
    out[k].value += corrections.equality[k];
  }
  return out;
}

void Transcription::rest_equalities(bool with_forms, std::vector<Equality>& out) const {
  const int last = rollout_.grid().nodes() - 1;
  const Node& end = rollout_.nodes().back();
  const double omega[3] = {end.state.omega_B.x, end.state.omega_B.y, end.state.omega_B.z};
  for (int c = 0; c < (may_spin() ? 2 : 3); ++c) {
    Equality e{{EqualityKind::kSpin, c}, omega[c] * time_, 1, {}};
    e.form[0].node = last;
    if (may_spin()) {
      const Turning rolls = turning(end.state, c == 0 ? Vec{1, 0, 0} : Vec{0, 1, 0});
      e.value = rolls.value;
      e.form[0].tangent = rolls.tangent;
    } else {
      e.form[0].tangent[index(3 + c)] = time_;
    }
    out.push_back(e);
  }
  for (int i = 0; i < problem_.masses(); ++i) {
    const auto k = index(i);
    const double unit = length_ / problem_.metres_per_unit[k] / time_;
    Equality e{{EqualityKind::kMassRate, i}, end.state.velocity[k] / unit, 1, {}};
    e.form[0].node = last;
    e.form[0].mass[k] = {0, 1 / unit, 0};
    out.push_back(e);
  }
  // No moment about the contact point but the floor's own, which fades: with c the centre of mass and P = c + r e3,
  // P_c = P_3 g_c / g_3 + r F_c / (M g_3) in both directions of the floor, for the weight g and a constant force F. On
  // a level floor c is above or below the contact point, beside it by F / (M g) r.
  Vec center;
  std::array<Vec, kMaxMasses> by_position;
  center_of_mass(center, by_position);
  const firmware::BallParams& ball = problem_.robot.ball;
  for (int c = 0; c < 2; ++c) {
    const double lean = slopes(ball) ? ball.down_W[c] / ball.down_W[2] : 0;
    const Vec axis = to_body(end.state.q, c == 0 ? Vec{1, 0, -lean} : Vec{0, 1, -lean});
    const double beside = length_ / weight_ * ball.external_force_W_n[c] / -ball.down_W[2] - lean * length_;
    Equality e{{EqualityKind::kBalance, c}, (dot(axis, center) + beside) / depth_, 1, {}};
    e.form[0].node = last;
    if (with_forms) {
      const Vec turn = cross(center, axis);
      e.form[0].tangent[0] = turn.x / depth_;
      e.form[0].tangent[1] = turn.y / depth_;
      e.form[0].tangent[2] = turn.z / depth_;
      for (int i = 0; i < problem_.masses(); ++i)
        e.form[0].mass[index(i)][0] = dot(by_position[index(i)], axis) / depth_;
    }
    out.push_back(e);
  }
}

void Transcription::move_via_times() {
  const Grid& grid = rollout_.grid();
  const double h = grid.step_s();
  for (std::size_t v = 0; v < via_time_s.size(); ++v) {
    const Via& via = problem_.task.via[v];
    if (via.time_s) continue;
    const int node = std::clamp(static_cast<int>(std::lround(via_time_s[v] / h)), 0, grid.nodes() - 1);
    const Node& at = rollout_.nodes()[index(node)];
    const Eigen::Vector2d velocity(at.value.velocity_mps[0], at.value.velocity_mps[1]);
    const Eigen::Vector2d place(at.place_m[0], at.place_m[1]);
    const double ahead = (via.position_m - place - (via_time_s[v] - node * h) * velocity).dot(velocity);
    const double most = 0.5 * grid.piece_s();
    const double change = std::clamp(ahead / std::max(velocity.squaredNorm(), 1e-12), -most, most);
    const double before = v == 0 ? 0 : via_time_s[v - 1];
    const double after = v + 1 == via_time_s.size() ? grid.duration_s : via_time_s[v + 1];
    via_time_s[v] = std::clamp(via_time_s[v] + change, before + 0.25 * grid.piece_s(), after - 0.25 * grid.piece_s());
  }
}

int Transcription::expand(const NodeForm& form, double factor, double* out) const {
  const int n = problem_.masses(), knots = rollout_.grid().knots_before(form.node), end = knots * n;
  for (int row = 0; row < kTangent; ++row) {
    const double weight = factor * form.tangent[index(row)];
    if (weight == 0) continue;
    const double* s = rollout_.sensitivity(form.node, row);
    for (int v = 0; v < end; ++v) out[v] += weight * s[v];
  }
  const Basis& basis = rollout_.basis();
  for (int i = 0; i < n; ++i) {
    const auto& by = form.mass[index(i)];
    if (by[0] == 0 && by[1] == 0 && by[2] == 0) continue;
    for (int j = 0; j < knots; ++j) {
      const std::size_t at = basis.at(form.node, j);
      out[j * n + i] +=
          factor * (by[0] * basis.position[at] + by[1] * basis.velocity[at] + by[2] * basis.acceleration[at]);
    }
  }
  return end;
}

}  // namespace ballast::plan
