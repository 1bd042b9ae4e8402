#include "tools/identify/rollout.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "sim/sensors/sensors.h"

namespace ballast::identify {

using Eigen::Vector3d;
using firmware::MassMotion;
using plan::RollingState;
using plan::RollingValue;

namespace {

// Windows last a sixth of sqrt(r / g), so that a step is a twenty-fourth: the step's error is then below 1e-7 of the
// motion, and a window still follows a swing of the ball.
constexpr double kWindow = 1.0 / 6;

int ticks_per_step(const Known& known) {
  const firmware::BallParams& ball = known.robot.ball;
  const double window_s = kWindow * std::sqrt(ball.radius_m / ball.gravity_mps2);
  const auto sample = std::max<std::int64_t>(1, sim::ticks_per_sample(known.sensors.rate_hz, known.control_period_s));
  auto ticks = std::max<std::int64_t>(1, std::llround(window_s / known.control_period_s / kStepsPerWindow));
  while (ticks * kStepsPerWindow % sample != 0) ++ticks;
  return static_cast<int>(ticks);
}

// Between ticks: the cubic through positions and velocities, and a straight line of accelerations.
MassMotion halfway(const MassMotion& a, const MassMotion& b, double period_s, std::size_t masses) {
  MassMotion out;
  for (std::size_t i = 0; i < masses; ++i) {
    out.position[i] = (a.position[i] + b.position[i]) / 2 + (a.velocity[i] - b.velocity[i]) * period_s / 8;
    out.velocity[i] = 1.5 * (b.position[i] - a.position[i]) / period_s - (a.velocity[i] + b.velocity[i]) / 4;
    out.acceleration[i] = (a.acceleration[i] + b.acceleration[i]) / 2;
  }
  return out;
}

struct Rate {
  std::array<double, 4> q;
  Vector3d omega;
  std::array<double, 2> place;
};

RollingState rolling_state(const BallState& state, const MassMotion& masses) {
  RollingState out;
  out.q = state.q;
  out.omega_B = sim::vec3(state.omega_B_radps);
  out.position = masses.position;
  out.velocity = masses.velocity;
  out.acceleration = masses.acceleration;
  return out;
}

Rate rate_of(const BallState& state, const RollingValue& value) {
  const auto& [w, x, y, z] = state.q;
  const Vector3d& o = state.omega_B_radps;
  return {{-(x * o[0] + y * o[1] + z * o[2]) / 2, (w * o[0] + y * o[2] - z * o[1]) / 2,
           (w * o[1] + z * o[0] - x * o[2]) / 2, (w * o[2] + x * o[1] - y * o[0]) / 2},
          sim::eigen(value.omega_dot_B),
          value.velocity_mps};
}

BallState moved(const BallState& state, const Rate& rate, double time_s) {
  BallState out = state;
  for (std::size_t j = 0; j < 4; ++j) out.q[j] += time_s * rate.q[j];
  out.omega_B_radps += time_s * rate.omega;
  for (int j = 0; j < 2; ++j) out.place_W_m[j] += time_s * rate.place[static_cast<std::size_t>(j)];
  return out;
}

void normalise(std::array<double, 4>& q) {
  const double per_norm = 1 / std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& component : q) component *= per_norm;
}

Node node_of(const plan::Robot& robot, const Vector3d& accelerometer_B_m, const BallState& state,
             const RollingValue& value) {
  Node node;
  node.state = state;
  const Vector3d omega_dot = sim::eigen(value.omega_dot_B), &omega = state.omega_B_radps;
  const Vector3d up_B = sim::eigen(plan::to_body(state.q, {0, 0, 1}));
  // a_GC - g + Omegadot x d + Omega x (Omega x d); rolling gives a_GC = Omegadot x r Gamma.
  node.specific_force_B_mps2 = omega_dot.cross(robot.ball.radius_m * up_B + accelerometer_B_m) +
                               omega.cross(omega.cross(accelerometer_B_m)) + held_force_B(robot.ball, state);
  node.normal_n = value.normal_n;
  node.friction_n = std::hypot(value.force_n[0], value.force_n[1]);
  return node;
}

}  // namespace

BallState turned(const BallState& state, const Vector3d& phi_B) {
  const double angle = phi_B.norm();
  const Eigen::Quaterniond q(state.q[0], state.q[1], state.q[2], state.q[3]);
  const Eigen::Quaterniond turn = angle > 0 ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, Vector3d(phi_B / angle)))
                                            : Eigen::Quaterniond(1, 0, 0, 0);
  const Eigen::Quaterniond result = (q * turn).normalized();
  BallState out = state;
  out.q = {result.w(), result.x(), result.y(), result.z()};
  return out;
}

Vector3d held_force_B(const firmware::BallParams& ball, const BallState& state) {
  return -ball.gravity_mps2 * sim::eigen(plan::to_body(state.q, sim::vec3(ball.down_W)));
}

Timeline::Timeline(const std::vector<MassMotion>& at_ticks, const Known& known) : step_ticks_(ticks_per_step(known)) {
  const auto masses = static_cast<std::size_t>(known.robot.ball.mass_count);
  step_s_ = step_ticks_ * known.control_period_s;
  const int ticks = static_cast<int>(at_ticks.size()) - 1;
  windows_ = std::max(0, ticks / window_ticks());
  const int halves = 2 * kStepsPerWindow * windows_;
  halves_.reserve(static_cast<std::size_t>(halves) + 1);
  for (int h = 0; h <= halves && ticks > 0; ++h) {
    const auto tick = static_cast<std::size_t>(h * step_ticks_ / 2);
    const bool between = h * step_ticks_ % 2 != 0;
    halves_.push_back(between ? halfway(at_ticks[tick], at_ticks[tick + 1], known.control_period_s, masses)
                              : at_ticks[tick]);
  }
  commanded_ = halves_;
}

void Timeline::place(const plan::PerMass<double>& offset, const plan::PerMass<double>& factor) {
  for (std::size_t h = 0; h < halves_.size(); ++h) {
    for (std::size_t i = 0; i < offset.size(); ++i) {
      const MassMotion& commanded = commanded_[h];
      MassMotion& moved = halves_[h];
      moved.position[i] = commanded.position[i] + offset[i];
      if (lag_.empty()) continue;
      moved.position[i] -= factor[i] * lag_[h].position[i];
      moved.velocity[i] = commanded.velocity[i] - factor[i] * lag_[h].velocity[i];
      moved.acceleration[i] = commanded.acceleration[i] - factor[i] * lag_[h].acceleration[i];
    }
  }
}

void Timeline::set_lag(const std::vector<plan::PerMass<double>>& at_nodes) {
  // Differences over a window: the lag has bends where accelerations have.
  constexpr int kApart = kStepsPerWindow;  // halves of steps, on either side
  const double apart_s = kApart * step_s_ / 2;
  const int last = static_cast<int>(halves_.size()) - 1;
  lag_.assign(halves_.size(), {});
  for (int h = 0; h <= last; ++h) {
    MassMotion& out = lag_[static_cast<std::size_t>(h)];
    for (std::size_t i = 0; i < out.position.size(); ++i) {
      const auto at = [&](int half) {
        return (at_nodes[static_cast<std::size_t>(half / 2)][i] +
                at_nodes[static_cast<std::size_t>((half + 1) / 2)][i]) /
               2;
      };
      out.position[i] = at(h);
      const int middle = std::clamp(h, kApart, last - kApart);
      const double before = at(middle - kApart), after = at(middle + kApart);
      out.acceleration[i] = (after - 2 * at(middle) + before) / (apart_s * apart_s);
      out.velocity[i] = (after - before) / (2 * apart_s) + out.acceleration[i] * (h - middle) * step_s_ / 2;
    }
  }
}

void roll(const plan::Robot& robot, const Vector3d& accelerometer_B_m, const Timeline& timeline, int first_window,
          int windows, const BallState& start, std::vector<Node>& nodes) {
  const double h = timeline.step_s();
  nodes.clear();
  BallState state = start;
  RollingValue value;
  int half = 2 * kStepsPerWindow * first_window;
  plan::evaluate_rolling(robot, rolling_state(state, timeline.at_half(half)), value);
  nodes.push_back(node_of(robot, accelerometer_B_m, state, value));
  const auto rate_at = [&](const BallState& at, int half_steps) {
    plan::evaluate_rolling(robot, rolling_state(at, timeline.at_half(half_steps)), value);
    return rate_of(at, value);
  };
  for (int step = 0; step < kStepsPerWindow * windows; ++step, half += 2) {
    const Rate k1 = rate_of(state, value);
    const Rate k2 = rate_at(moved(state, k1, h / 2), half + 1);
    const Rate k3 = rate_at(moved(state, k2, h / 2), half + 1);
    const Rate k4 = rate_at(moved(state, k3, h), half + 2);
    state = moved(moved(moved(moved(state, k1, h / 6), k2, h / 3), k3, h / 3), k4, h / 6);
    normalise(state.q);
    plan::evaluate_rolling(robot, rolling_state(state, timeline.at_half(half + 2)), value);
    nodes.push_back(node_of(robot, accelerometer_B_m, state, value));
  }
}

void lag_along(const plan::Robot& robot, const Known& known, const Timeline& timeline, int first_window,
               const std::vector<Node>& nodes, bool lagging, std::vector<plan::PerMass<double>>& lag) {
  RollingValue value;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const int half = 2 * (kStepsPerWindow * first_window + static_cast<int>(k));
    const MassMotion& masses = lagging ? timeline.at_half(half) : timeline.commanded_at_half(half);
    plan::evaluate_rolling(robot, rolling_state(nodes[k].state, masses), value);
    auto& at = lag[static_cast<std::size_t>(half / 2)];
    for (std::size_t i = 0; i < static_cast<std::size_t>(robot.ball.mass_count); ++i) {
      const sim::Motor& motor = known.belief.masses[i].motor;
      const double damping = motor.viscous_damping_nms * motor.shaft_ratio * motor.shaft_ratio;
      at[i] = (value.torque[i] + damping * masses.velocity[i]) / motor.rail_stiffness();
    }
  }
}

}  // namespace ballast::identify
