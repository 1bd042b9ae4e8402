#include "tools/tracking/reference.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "sim/plant/plant.h"

namespace ballast::plan {
namespace {

std::size_t index(int i) { return static_cast<std::size_t>(i); }

double time_unit(const Robot& robot) {
  const double g = robot.ball.gravity_mps2;
  return g > 0 ? std::sqrt(robot.ball.radius_m / g) : 1;
}

// Why the model cannot follow the scenario; empty if it can.
std::string beyond_model(const sim::Scenario& scenario, bool lenient) {
  bool moves = false;
  for (const sim::Mass& mass : scenario.masses) {
    if (!mass.trajectory.times_s.empty()) return "mass.trajectory: a mass without a rail cannot be corrected";
    moves = moves || !mass.motion.empty();
  }
  if (lenient) {
    return scenario.masses.empty() ? "mass: there is none, and nothing else can move the ball" : "";
  }
  if (!moves) return "mass.motion: there is none to follow; `ballast plan` finds one";
  if (!scenario.force_table.times_s.empty()) return "external_force: changes with time; allowed: a constant force";
  if (scenario.drag.coefficient_kgpm > 0) return "drag: is not in the planner's model; allowed: none";
  return "";
}

double acceleration_at(const std::vector<sim::MotionPiece>& motion, double time_s) {
  double start_s = 0;
  for (const sim::MotionPiece& piece : motion) {
    if (time_s < start_s + piece.duration_s) {
      const double part = (time_s - start_s) / piece.duration_s;
      return (1 - part) * piece.acceleration_start + part * piece.acceleration_end;
    }
    start_s += piece.duration_s;
  }
  return 0;
}

// Q and R of a step, as diagonals of one over the squares of what counts as 1.
void set_weights(const sim::Scenario& scenario, const TrackingWeights& weights, Tracking& out) {
  const int n = out.masses();
  const double r = out.robot.ball.radius_m, time = time_unit(out.robot), part = out.step_s / time;
  const Eigen::Index of_masses = 2 * static_cast<Eigen::Index>(n);
  Eigen::VectorXd state(out.errors()), input(n);
  for (int i = 0; i < n; ++i) {
    const double unit = r / scenario.masses[index(i)].metres_per_rail_unit();
    state[i] = weights.mass_position * unit;
    state[n + i] = weights.mass_rate * unit / time;
    input[i] = weights.acceleration * unit / (time * time);
  }
  state.segment(of_masses, 3).setConstant(weights.attitude_rad);
  state.segment(of_masses + 3, 3).setConstant(weights.angular_velocity / time);
  state.segment(of_masses + 6, 2).setConstant(weights.place * r);
  if (out.has_integral) state.tail(2).setConstant(weights.place_integral * r * time);
  out.state_weight = (part * state.array().square().inverse()).matrix().asDiagonal();
  out.input_weight = (part * input.array().square().inverse()).matrix().asDiagonal();
}

// One step of the recursion, backward.
void step_riccati(const Tracking& tracking, std::size_t k, Eigen::MatrixXd& cost, Eigen::MatrixXd& gain) {
  const Step& step = tracking.step[k];
  const Eigen::MatrixXd pull = step.input.transpose() * cost;
  gain = (tracking.input_weight + pull * step.input).ldlt().solve(pull * step.transition);
  const Eigen::MatrixXd before =
      tracking.state_weight_at(k) + step.transition.transpose() * cost * (step.transition - step.input * gain);
  cost = (before + before.transpose()) / 2;
}

// `hold_steps` more steps of the last kind come after the end.
void solve_riccati(double at_end, int hold_steps, Tracking& out) {
  const std::size_t steps = out.step.size();
  out.gain.resize(steps);
  out.cost.resize(steps + 1);
  Eigen::MatrixXd cost = at_end * time_unit(out.robot) / out.step_s * out.state_weight;
  for (int k = 0; k < hold_steps; ++k) step_riccati(out, steps - 1, cost, out.gain.back());
  out.cost[steps] = cost;
  for (std::size_t k = steps; k-- > 0;) {
    step_riccati(out, k, cost, out.gain[k]);
    out.cost[k] = cost;
  }
}

// Appends the integral of the place.
void append_integral(Linear& linear, int masses) {
  const Eigen::Index size = linear.a.rows(), place = 2 * static_cast<Eigen::Index>(masses) + 6;
  linear.a.conservativeResizeLike(Eigen::MatrixXd::Zero(size + 2, size + 2));
  linear.b.conservativeResizeLike(Eigen::MatrixXd::Zero(size + 2, linear.b.cols()));
  linear.a.block<2, 2>(size, place).setIdentity();
}

// Whether the motion ends at rest: the masses stand, and the ball is slower than this part of sqrt(g r). A plan that
// ends at rest meets it to rounding; a motion by hand leaves a little rocking.
bool rests(const Tracking& tracking, const std::vector<sim::Mass>& masses) {
  constexpr double kSlow = 0.05;
  const ReferencePoint& last = tracking.reference.back();
  for (std::size_t i = 0; i < masses.size(); ++i) {
    const double unit = tracking.robot.ball.radius_m / masses[i].metres_per_rail_unit();
    if (!(std::abs(last.state.velocity[i]) <= 1e-6 * unit / time_unit(tracking.robot))) return false;
  }
  const Vec& w = last.state.omega_B;
  return std::sqrt(w.x * w.x + w.y * w.y + w.z * w.z) * time_unit(tracking.robot) <= kSlow;
}

}  // namespace

std::vector<ReferencePoint> roll_motion(const sim::Scenario& scenario, int steps) {
  sim::Scenario moved = scenario;
  moved.run.actuation = sim::Actuation::kPrescribed;
  moved.faults.clear();
  moved.force_table = {};
  moved.drag = {};
  moved.surface.hold_everything();
  moved.surface.kinetic_friction = std::numeric_limits<double>::infinity();
  sim::Plant plant(moved);
  std::vector<ReferencePoint> out;
  for (int k = 0; k <= steps; ++k) {
    const double time_s = k == steps ? scenario.duration_s : scenario.duration_s * k / steps;
    plant.advance(time_s, {});
    if (plant.end() != sim::PhysicsEnd::kNone) break;
    const sim::Plant::Sample s = plant.sample();
    ReferencePoint at{};
    at.state.q = {s.orientation[0], s.orientation[1], s.orientation[2], s.orientation[3]};
    at.state.omega_B = sim::vec3(s.angular_velocity_B_radps);
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      at.state.position[i] = s.mass_position[i];
      at.state.velocity[i] = s.mass_velocity[i];
      at.state.acceleration[i] = acceleration_at(scenario.masses[i].motion, time_s);
    }
    at.place_m = {s.position_W_m[0], s.position_W_m[1]};
    out.push_back(at);
  }
  return out;
}

Eigen::MatrixXd Tracking::state_weight_at(std::size_t k) const {
  Eigen::MatrixXd weight = state_weight;
  if (less_about_vertical == 0) return weight;
  const Vec up = to_body(reference[k].state.q, {0, 0, 1});
  const Eigen::Vector3d vertical(up.x, up.y, up.z);
  for (const int first : {2 * masses(), 2 * masses() + 3}) {
    weight.block<3, 3>(first, first) -= less_about_vertical * weight(first, first) * vertical * vertical.transpose();
  }
  return weight;
}

Linear linearise(const Robot& robot, const RollingState& state) {
  const int n = robot.ball.mass_count, phi = 2 * n, omega = 2 * n + 3, place = 2 * n + 6;
  RollingValue value;
  RollingDerivative d;
  differentiate_rolling(robot, state, false, value, d);
  Linear out{Eigen::MatrixXd::Zero(2 * n + 8, 2 * n + 8), Eigen::MatrixXd::Zero(2 * n + 8, n)};
  const auto column = [](const Vec& v) { return Eigen::Vector3d(v.x, v.y, v.z); };
  for (int i = 0; i < n; ++i) {
    const std::size_t by = kStateColumns + 3 * index(i);
    out.a(i, n + i) = 1;
    out.b(n + i, i) = 1;
    out.a.block<3, 1>(omega, i) = column(d.omega_dot_B[by]);
    out.a.block<3, 1>(omega, n + i) = column(d.omega_dot_B[by + 1]);
    out.b.block<3, 1>(omega, i) = column(d.omega_dot_B[by + 2]);
  }
  const Vec& w = state.omega_B;
  out.a.block<3, 3>(phi, phi) << 0, w.z, -w.y, -w.z, 0, w.x, w.y, -w.x, 0;  // phi x Omega
  out.a.block<3, 3>(phi, omega).setIdentity();
  for (int c = 0; c < 6; ++c) {
    out.a.block<3, 1>(omega, phi + c) = column(d.omega_dot_B[index(c)]);
    for (int axis = 0; axis < 2; ++axis) out.a(place + axis, phi + c) = d.velocity_mps[index(axis)][index(c)];
  }
  return out;
}

Step discretise(const Linear& linear, double step_s) {
  constexpr int kTerms = 10;  // steps are short beside the ball's own times: the tenth is below rounding
  const Eigen::MatrixXd ah = linear.a * step_s;
  Eigen::MatrixXd power = Eigen::MatrixXd::Identity(ah.rows(), ah.cols()), integral = power * step_s;
  Step out{power, {}};
  for (int k = 1; k <= kTerms; ++k) {
    power = ah * power / k;
    out.transition += power;
    integral += power * step_s / (k + 1);
  }
  out.input = integral * linear.b;
  return out;
}

Eigen::VectorXd tracking_error(const ReferencePoint& reference, const ReferencePoint& truth, int masses) {
  const Eigen::Index of_masses = 2 * static_cast<Eigen::Index>(masses);
  Eigen::VectorXd e(of_masses + 8);
  for (int i = 0; i < masses; ++i) {
    e[i] = truth.state.position[index(i)] - reference.state.position[index(i)];
    e[masses + i] = truth.state.velocity[index(i)] - reference.state.velocity[index(i)];
  }
  const auto quaternion = [](const std::array<double, 4>& q) { return Eigen::Quaterniond(q[0], q[1], q[2], q[3]); };
  const Eigen::AngleAxisd turn(quaternion(reference.state.q).conjugate() * quaternion(truth.state.q));
  e.segment<3>(of_masses) = turn.angle() * turn.axis();
  const Vec omega = truth.state.omega_B - reference.state.omega_B;
  e.segment<3>(of_masses + 3) << omega.x, omega.y, omega.z;
  for (int axis = 0; axis < 2; ++axis) {
    e[of_masses + 6 + axis] = truth.place_m[index(axis)] - reference.place_m[index(axis)];
  }
  return e;
}

std::optional<Tracking> track(const sim::Scenario& scenario, const firmware::BallParams& ball, std::string& why,
                              const TrackingOptions& options) {
  constexpr double kMostSteps = TrackingOptions::kMostSteps;
  constexpr int kHoldSteps = 600;  // of a tenth of sqrt(r / g): a hold of several swings of a ball that rocks slowly
  why = beyond_model(scenario, options.lenient);
  if (!why.empty()) return std::nullopt;
  Tracking out;
  out.robot.ball = ball;
  out.has_integral = options.weights.place_integral > 0;
  const double wanted = std::ceil(scenario.duration_s / (options.step * time_unit(out.robot)));
  if (!(wanted <= kMostSteps)) {
    why = fmt::format("duration: is {:.0f} steps of {} sqrt(r / g); allowed: at most {:.0f}", wanted, options.step,
                      kMostSteps);
    return std::nullopt;
  }
  int steps = std::max(2, static_cast<int>(wanted));
  out.step_s = scenario.duration_s / steps;
  out.reference = roll_motion(scenario, steps);
  const auto rolled = static_cast<int>(out.reference.size()) - 1;
  if (rolled != steps && (!options.lenient || rolled < 2)) {
    why = fmt::format("the ball leaves the floor at t = {:.4g} s or before",
                      static_cast<double>(out.reference.size()) * out.step_s);
    return std::nullopt;
  }
  out.ends_at_rest = rolled == steps && rests(out, scenario.masses);
  steps = rolled;
  set_weights(scenario, options.weights, out);
  out.less_about_vertical = 1 - options.weights.about_vertical;
  // The moment of a floor that resists turns round within the creep rate, which is far below an error that matters. So
  // its slope is taken over errors of the size that counts as 1.
  Robot smooth = out.robot;
  if (resists(smooth.ball)) {
    smooth.ball.creep_radps = std::max(smooth.ball.creep_radps, options.weights.angular_velocity / time_unit(smooth));
  }
  const auto linear_at = [&](int k) {
    Linear linear = linearise(smooth, out.reference[index(k)].state);
    if (out.has_integral) append_integral(linear, out.masses());
    return linear;
  };
  Linear before = linear_at(0);
  for (int k = 0; k < steps; ++k) {
    Linear after = linear_at(k + 1);
    out.step.push_back(discretise({(before.a + after.a) / 2, (before.b + after.b) / 2}, out.step_s));
    before = std::move(after);
  }
  solve_riccati(options.weights.at_end, options.holds && out.ends_at_rest ? kHoldSteps : 0, out);
  return out;
}

GainTable gain_table(const Tracking& tracking, std::size_t most_bytes) {
  const int n = tracking.masses();
  GainTable out;
  out.masses = n;
  out.errors = tracking.errors();
  const std::size_t steps = tracking.gain.size();
  const std::size_t fit = most_bytes / sizeof(float) / out.row();
  out.samples = static_cast<int>(std::clamp<std::size_t>(steps + 1, 2, std::max<std::size_t>(fit, 2)));
  const double duration_s = tracking.step_s * static_cast<double>(steps);
  out.period_s = duration_s / (out.samples - 1);
  for (int k = 0; k < out.samples; ++k) {
    // Between two points: linear in each number, the attitude made a unit again. K is that of a whole step, so that of
    // the last one serves to the end.
    const double at = std::min(static_cast<double>(steps), k * out.period_s / tracking.step_s);
    const std::size_t from = std::min(static_cast<std::size_t>(at), steps - 1);
    const double part = at - static_cast<double>(from);
    const ReferencePoint &a = tracking.reference[from], &b = tracking.reference[from + 1];
    const auto mix = [&](double x, double y) { return (1 - part) * x + part * y; };
    double sign = 0;
    for (std::size_t c = 0; c < 4; ++c) sign += a.state.q[c] * b.state.q[c];
    Eigen::Vector4d q;
    for (std::size_t c = 0; c < 4; ++c) {
      q[static_cast<int>(c)] = mix(a.state.q[c], sign < 0 ? -b.state.q[c] : b.state.q[c]);
    }
    q.normalize();
    for (int c = 0; c < 4; ++c) out.values.push_back(static_cast<float>(q[c]));
    const Vec &wa = a.state.omega_B, &wb = b.state.omega_B;
    for (const double w : {mix(wa.x, wb.x), mix(wa.y, wb.y), mix(wa.z, wb.z)}) {
      out.values.push_back(static_cast<float>(w));
    }
    for (std::size_t c = 0; c < 2; ++c) out.values.push_back(static_cast<float>(mix(a.place_m[c], b.place_m[c])));
    const Eigen::MatrixXd &ka = tracking.gain[from], &kb = tracking.gain[std::min(from + 1, steps - 1)];
    for (int i = 0; i < n; ++i) {
      for (int c = 0; c < out.errors; ++c) out.values.push_back(static_cast<float>(mix(ka(i, c), kb(i, c))));
    }
  }
  return out;
}

Eigen::MatrixXd GainTable::gain_at(double time_s) const {
  const double at = std::clamp(time_s / period_s, 0.0, static_cast<double>(samples - 1));
  const int from = std::min(static_cast<int>(at), samples - 2);
  const double part = at - from;
  Eigen::MatrixXd out(masses, errors);
  for (int i = 0; i < masses; ++i) {
    for (int c = 0; c < errors; ++c) {
      const std::size_t place = index(from) * row() + 9 + index(i * errors + c);
      out(i, c) = (1 - part) * static_cast<double>(values[place]) + part * static_cast<double>(values[place + row()]);
    }
  }
  return out;
}

std::string gain_csv(const GainTable& table) {
  std::string text = "time_s,q_w,q_x,q_y,q_z,omega_x_B_radps,omega_y_B_radps,omega_z_B_radps,x_W_m,y_W_m";
  const auto out = std::back_inserter(text);
  for (int i = 0; i < table.masses; ++i) {
    for (int c = 0; c < table.errors; ++c) fmt::format_to(out, ",k_{}_{}", i, c);
  }
  text += '\n';
  for (int k = 0; k < table.samples; ++k) {
    fmt::format_to(out, "{:.9g}", k * table.period_s);
    for (std::size_t c = 0; c < table.row(); ++c)
      fmt::format_to(out, ",{:.9g}", table.values[index(k) * table.row() + c]);
    text += '\n';
  }
  return text;
}

}  // namespace ballast::plan
