#include "tools/plan/rollout.h"

#include <algorithm>
#include <cmath>

namespace ballast::plan {

using sim::cross;

namespace {

std::size_t index(int i) { return static_cast<std::size_t>(i); }

// How a mass moves within one step: its state at the step's start and its acceleration at both ends.
struct Stretch {
  double position, velocity, start, end;
};

// The masses at the part `c` of a step of h seconds.
void place_at(const Stretch& s, double c, double h, double& position, double& velocity, double& acceleration) {
  acceleration = s.start * (1 - c) + s.end * c;
  velocity = s.velocity + h * (s.start * (c - c * c / 2) + s.end * c * c / 2);
  position = s.position + h * c * s.velocity + h * h * (s.start * (c * c / 2 - c * c * c / 6) + s.end * c * c * c / 6);
}

// The ball: q, Omega, place.
struct Ball {
  std::array<double, 4> q;
  Vec omega;
  std::array<double, 2> place;
};

std::array<double, 4> quaternion_rate(const std::array<double, 4>& q, const Vec& w) {
  return {0.5 * (-q[1] * w.x - q[2] * w.y - q[3] * w.z), 0.5 * (q[0] * w.x + q[2] * w.z - q[3] * w.y),
          0.5 * (q[0] * w.y - q[1] * w.z + q[3] * w.x), 0.5 * (q[0] * w.z + q[1] * w.y - q[2] * w.x)};
}

std::array<double, 4> unit(const std::array<double, 4>& q) {
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return {q[0] / length, q[1] / length, q[2] / length, q[3] / length};
}

// base + dt * rate
Ball moved(const Ball& base, const Ball& rate, double dt) {
  Ball out;
  for (std::size_t j = 0; j < 4; ++j) out.q[j] = base.q[j] + dt * rate.q[j];
  out.q = unit(out.q);
  out.omega = base.omega + dt * rate.omega;
  for (std::size_t j = 0; j < 2; ++j) out.place[j] = base.place[j] + dt * rate.place[j];
  return out;
}

constexpr double kStages[4] = {0, 0.5, 0.5, 1};
constexpr double kWeights[4] = {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6};

// Columns of the derivative of one step: phi, Omega, then position, velocity and both accelerations of each mass.
constexpr int kMaxLocal = 6 + 4 * kMaxMasses;
using Local = std::array<std::array<double, kMaxLocal>, kTangent>;

// The rate of the tangent's columns at one stage.
void tangent_rate(const RollingDerivative& d, const Vec& omega, const Local& x, int masses, double c, double h,
                  Local& rate) {
  const int columns = 6 + 4 * masses;
  for (int k = 0; k < columns; ++k) {
    const auto col = index(k);
    const Vec phi{x[0][col], x[1][col], x[2][col]};
    const Vec phi_rate = cross(phi, omega);
    rate[0][col] = phi_rate.x + x[3][col];
    rate[1][col] = phi_rate.y + x[4][col];
    rate[2][col] = phi_rate.z + x[5][col];
    Vec omega_rate{0, 0, 0};
    double place[2] = {0, 0};
    for (std::size_t j = 0; j < 6; ++j) {
      omega_rate = omega_rate + x[j][col] * d.omega_dot_B[j];
      place[0] += x[j][col] * d.velocity_mps[0][j];
      place[1] += x[j][col] * d.velocity_mps[1][j];
    }
    rate[3][col] = omega_rate.x;
    rate[4][col] = omega_rate.y;
    rate[5][col] = omega_rate.z;
    rate[6][col] = place[0];
    rate[7][col] = place[1];
  }
  for (int i = 0; i < masses; ++i) {
    const std::size_t of = 6 + 3 * index(i);
    const Vec &by_position = d.omega_dot_B[of], &by_velocity = d.omega_dot_B[of + 1],
              &by_acceleration = d.omega_dot_B[of + 2];
    // Derivatives of position, velocity and acceleration at the stage by the four columns of the mass.
    const double coefficient[4][3] = {{1, 0, 0},
                                      {h * c, 1, 0},
                                      {h * h * (c * c / 2 - c * c * c / 6), h * (c - c * c / 2), 1 - c},
                                      {h * h * c * c * c / 6, h * c * c / 2, c}};
    for (std::size_t k = 0; k < 4; ++k) {
      const Vec w =
          coefficient[k][0] * by_position + coefficient[k][1] * by_velocity + coefficient[k][2] * by_acceleration;
      const std::size_t col = 6 + 4 * index(i) + k;
      rate[3][col] += w.x;
      rate[4][col] += w.y;
      rate[5][col] += w.z;
    }
  }
}

// The state at a part of a step of length h, where the ball is `at` and the masses' accelerations change linearly.
void set_stage(double part, double h, const Ball& at, const RollingState& from, const RollingState& to, int masses,
               RollingState& state) {
  state.q = at.q;
  state.omega_B = at.omega;
  for (int i = 0; i < masses; ++i) {
    const auto k = index(i);
    place_at({from.position[k], from.velocity[k], from.acceleration[k], to.acceleration[k]}, part, h, state.position[k],
             state.velocity[k], state.acceleration[k]);
  }
}

// Parts of a step of h seconds that are short beside the time in which the floor's moment brakes a slow ball: below the
// creep rate omega_c it is c_rr r N / (I omega_c) of the ball's rate, far more than all else. Counts with the lowest
// rate on the way, as the start foretells it.
int parts_of_step(const firmware::BallParams& ball, const Node& at, double h) {
  constexpr int kMostParts = 60;  // resolves the least creep rate that make_problem() lets through
  if (!resists(ball) || !(at.value.normal_n > 0)) return 1;
  const Vec omega = to_space(at.state.q, at.state.omega_B), change = h * to_space(at.state.q, at.value.omega_dot_B);
  const auto least = [](double start, double dot, double square) {
    const double part = square > 0 ? std::clamp(-dot / square, 0.0, 1.0) : 0;
    return std::max(0.0, start + part * (2 * dot + part * square));
  };
  const double horizontal2 = least(omega.x * omega.x + omega.y * omega.y, omega.x * change.x + omega.y * change.y,
                                   change.x * change.x + change.y * change.y);
  const double spin2 = least(omega.z * omega.z, omega.z * change.z, change.z * change.z);
  const double creep2 = ball.creep_radps * ball.creep_radps;
  // The shell's part of the inertia: the masses add to it. About the contact point where the ball rolls.
  const double arm_m = ball.radius_m - ball.center_of_mass_B_m.norm();
  const double spun = ball.inertia_kgm2.minCoeff(), rolled = spun + ball.shell_mass_kg * arm_m * arm_m;
  const double braking = at.value.normal_n * h *
                         std::max(ball.rolling_resistance * ball.radius_m / (rolled * std::sqrt(horizontal2 + creep2)),
                                  ball.spin_friction_m / (spun * std::sqrt(spin2 + creep2)));
  return static_cast<int>(std::clamp(std::ceil(braking), 1.0, double{kMostParts}));
}

}  // namespace

double time_unit_s(const Problem& problem) {
  const double g = problem.robot.ball.gravity_mps2;
  return g > 0 ? std::sqrt(problem.robot.ball.radius_m / g) : 1;
}

Grid make_grid(const Problem& problem, double duration_s, int pieces) {
  constexpr double kLongestStep = 0.35;  // of sqrt(r / g): RK4 then errs by some 1e-5 r over a plan
  constexpr int kLeastSteps = 3, kMostSteps = 40;
  const double steps = std::ceil(duration_s / pieces / (kLongestStep * time_unit_s(problem)));
  return {duration_s, pieces, static_cast<int>(std::clamp(steps, double{kLeastSteps}, double{kMostSteps}))};
}

Basis::Basis(const Grid& grid) : knots(grid.knots()) {
  const std::size_t size = index(grid.nodes()) * index(knots);
  position.assign(size, 0);
  velocity.assign(size, 0);
  acceleration.assign(size, 0);
  const double h = grid.step_s();
  const int m = grid.steps_per_piece;
  for (int knot = 0; knot < knots; ++knot) {
    for (int node = 0; node < grid.nodes(); ++node) {
      const double away = std::abs(static_cast<double>(node) / m - knot);
      acceleration[at(node, knot)] = std::max(0.0, 1 - away);
    }
    for (int node = 0; node + 1 < grid.nodes(); ++node) {
      const Stretch s{position[at(node, knot)], velocity[at(node, knot)], acceleration[at(node, knot)],
                      acceleration[at(node + 1, knot)]};
      double unused = 0;
      place_at(s, 1, h, position[at(node + 1, knot)], velocity[at(node + 1, knot)], unused);
    }
  }
}

Rollout::Rollout(const Problem& problem, const Grid& grid)
    : problem_(problem),
      local_robot_(problem.robot),
      grid_(grid),
      basis_(grid),
      variables_(grid.knots() * problem.masses()) {
  nodes_.resize(index(grid.nodes()));
  parts_.assign(index(grid.nodes()), 1);
  derivatives_.resize(index(grid.nodes()));
  sensitivity_.assign(index(grid.nodes()) * kTangent * index(variables_), 0);
}

void Rollout::place_masses(const std::vector<double>& knots) {
  const int n = problem_.masses();
  for (int node = 0; node < grid_.nodes(); ++node) {
    RollingState& state = nodes_[index(node)].state;
    const double t = node * grid_.step_s();
    for (int i = 0; i < n; ++i) {
      const auto k = index(i);
      double position = problem_.start.position[k] + t * problem_.start.velocity[k];
      double velocity = problem_.start.velocity[k], acceleration = 0;
      for (int j = 0; j < grid_.knots_before(node); ++j) {
        const double knot = knots[index(j * n + i)];
        position += basis_.position[basis_.at(node, j)] * knot;
        velocity += basis_.velocity[basis_.at(node, j)] * knot;
        acceleration += basis_.acceleration[basis_.at(node, j)] * knot;
      }
      state.position[k] = position;
      state.velocity[k] = velocity;
      state.acceleration[k] = acceleration;
    }
  }
}

const Robot& Rollout::robot_at(const std::array<double, 2>& place_m) {
  if (!problem_.floor.has_patches()) return problem_.robot;
  local_robot_.ball.rolling_resistance = problem_.floor.rolling_resistance({place_m[0], place_m[1]});
  return local_robot_;
}

firmware::BallParams Rollout::ball_ahead(const Node& from, double h) {
  firmware::BallParams ball = robot_at(from.place_m).ball;
  if (!problem_.floor.has_patches()) return ball;
  const auto& velocity = from.value.velocity_mps;
  const Robot& ahead = robot_at({from.place_m[0] + h * velocity[0], from.place_m[1] + h * velocity[1]});
  ball.rolling_resistance = std::max(ball.rolling_resistance, ahead.ball.rolling_resistance);
  return ball;
}

bool Rollout::roll(const std::vector<double>& knots) {
  place_masses(knots);
  nodes_[0].state.q = problem_.start.q;
  nodes_[0].state.omega_B = problem_.start.omega_B;
  nodes_[0].place_m = {problem_.start_m[0], problem_.start_m[1]};
  for (int node = 0; node < grid_.nodes(); ++node) {
    Node& at = nodes_[index(node)];
    evaluate_rolling(robot_at(at.place_m), at.state, at.value);
    const double sum = at.value.normal_n + at.value.force_n[0] + at.value.force_n[1] + at.state.omega_B.x;
    if (!std::isfinite(sum)) return false;
    if (node + 1 < grid_.nodes()) step(node);
  }
  return true;
}

void Rollout::step(int node) {
  const int n = problem_.masses();
  const double h = grid_.step_s();
  const Node& from = nodes_[index(node)];
  Node& to = nodes_[index(node + 1)];
  const int parts = parts_[index(node)] = parts_of_step(ball_ahead(from, h), from, h);
  const double dt = h / parts;
  Ball base{from.state.q, from.state.omega_B, from.place_m};
  RollingState state = from.state;
  RollingValue value;
  for (int part = 0; part < parts; ++part) {
    Ball sum{{0, 0, 0, 0}, {0, 0, 0}, {0, 0}}, rate = sum;
    for (int s = 0; s < 4; ++s) {
      if (part > 0 || s > 0) {
        const Ball at = s == 0 ? base : moved(base, rate, kStages[s] * dt);
        set_stage((part + kStages[s]) / parts, h, at, from.state, to.state, n, state);
        evaluate_rolling(robot_at(at.place), state, value);
      } else {
        value = from.value;
      }
      rate = {quaternion_rate(state.q, state.omega_B), value.omega_dot_B, value.velocity_mps};
      for (std::size_t j = 0; j < 4; ++j) sum.q[j] += kWeights[s] * rate.q[j];
      sum.omega = sum.omega + kWeights[s] * rate.omega;
      for (std::size_t j = 0; j < 2; ++j) sum.place[j] += kWeights[s] * rate.place[j];
    }
    base = moved(base, sum, dt);
  }
  to.state.q = base.q;
  to.state.omega_B = base.omega;
  to.place_m = base.place;
}

void Rollout::differentiate() {
  std::fill_n(sensitivity_.begin(), index(kTangent * variables_), 0.0);  // the start is given
  for (int node = 0; node + 1 < grid_.nodes(); ++node) differentiate_step(node);
  RollingValue value;
  const int last = grid_.nodes() - 1;
  differentiate_rolling(robot_at(nodes_[index(last)].place_m), nodes_[index(last)].state, true, value,
                        derivatives_[index(last)]);
}

void Rollout::differentiate_step(int node) {
  const int n = problem_.masses(), columns = 6 + 4 * n;
  const double h = grid_.step_s();
  const Node &from = nodes_[index(node)], &to = nodes_[index(node + 1)];
  const int parts = parts_[index(node)];
  const double dt = h / parts;
  Ball base{from.state.q, from.state.omega_B, from.place_m};
  RollingState state = from.state;
  RollingValue value;
  RollingDerivative at_stage;
  Local start{}, x, tangent{}, sum{};
  for (std::size_t j = 0; j < 6; ++j) start[j][j] = 1;
  for (int part = 0; part < parts; ++part) {
    Ball rate{}, rates{{0, 0, 0, 0}, {0, 0, 0}, {0, 0}};
    sum = {};
    for (int s = 0; s < 4; ++s) {
      x = start;
      const Ball at = s == 0 ? base : moved(base, rate, kStages[s] * dt);
      if (part > 0 || s > 0) set_stage((part + kStages[s]) / parts, h, at, from.state, to.state, n, state);
      if (s > 0) {
        for (std::size_t row = 0; row < kTangent; ++row) {
          for (std::size_t k = 0; k < index(columns); ++k) x[row][k] += kStages[s] * dt * tangent[row][k];
        }
      }
      const bool at_node = part == 0 && s == 0;
      RollingDerivative& d = at_node ? derivatives_[index(node)] : at_stage;
      differentiate_rolling(robot_at(at.place), state, at_node, value, d);
      rate = {quaternion_rate(state.q, state.omega_B), value.omega_dot_B, value.velocity_mps};
      tangent_rate(d, state.omega_B, x, n, (part + kStages[s]) / parts, h, tangent);
      for (std::size_t row = 0; row < kTangent; ++row) {
        for (std::size_t k = 0; k < index(columns); ++k) sum[row][k] += kWeights[s] * tangent[row][k];
      }
      if (parts == 1) continue;
      for (std::size_t j = 0; j < 4; ++j) rates.q[j] += kWeights[s] * rate.q[j];
      rates.omega = rates.omega + kWeights[s] * rate.omega;
    }
    for (std::size_t row = 0; row < kTangent; ++row) {
      for (std::size_t k = 0; k < index(columns); ++k) sum[row][k] = start[row][k] + dt * sum[row][k];
    }
    start = sum;
    if (part + 1 < parts) base = moved(base, rates, dt);
  }

  // The tangent at the next node, by all variables that have an influence there.
  const int used = grid_.knots_before(node + 1) * n;
  const auto old_row = [&](int row) {
    return &sensitivity_[(index(node) * kTangent + index(row)) * index(variables_)];
  };
  for (int row = 0; row < kTangent; ++row) {
    double* out = &sensitivity_[(index(node + 1) * kTangent + index(row)) * index(variables_)];
    std::fill_n(out, variables_, 0.0);
    if (row >= 6) std::copy_n(old_row(row), used, out);
    for (int j = 0; j < 6; ++j) {
      const double factor = sum[index(row)][index(j)];
      const double* in = old_row(j);
      for (int v = 0; v < used; ++v) out[v] += factor * in[v];
    }
    for (int j = 0; j < used / n; ++j) {
      const double position = basis_.position[basis_.at(node, j)], velocity = basis_.velocity[basis_.at(node, j)];
      const double first = basis_.acceleration[basis_.at(node, j)];
      const double second = basis_.acceleration[basis_.at(node + 1, j)];
      for (int i = 0; i < n; ++i) {
        const double* by = &sum[index(row)][index(6 + 4 * i)];
        out[j * n + i] += by[0] * position + by[1] * velocity + by[2] * first + by[3] * second;
      }
    }
  }
}

}  // namespace ballast::plan
