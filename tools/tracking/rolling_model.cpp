#include "tools/tracking/rolling_model.h"

#include <cmath>
#include <complex>
#include <limits>

namespace ballast::plan {

using sim::cross;
using sim::dot;

namespace {

// A 3x3 matrix by its columns.
struct Mat {
  Vec c0{0, 0, 0}, c1{0, 0, 0}, c2{0, 0, 0};
};

Vec operator*(const Mat& m, const Vec& v) { return v.x * m.c0 + v.y * m.c1 + v.z * m.c2; }

Vec vec(const firmware::Vector3& v) { return {v[0], v[1], v[2]}; }
Vec scaled(const Vec& a, const Vec& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
Vec negative(const Vec& a) { return {-a.x, -a.y, -a.z}; }
void add(Vec& sum, const Vec& v) { sum = sum + v; }

// Rows of Lambda; the third is Gamma.
struct Attitude {
  Vec row1, row2, gamma;
};

Attitude attitude_of(const std::array<double, 4>& q) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  return {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
          {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
          {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
}

Vec turned_to_body(const Attitude& lambda, const Vec& v_W) {
  return v_W.x * lambda.row1 + v_W.y * lambda.row2 + v_W.z * lambda.gamma;
}

Vec turned_to_space(const Attitude& lambda, const Vec& v_B) {
  return {dot(lambda.row1, v_B), dot(lambda.row2, v_B), dot(lambda.gamma, v_B)};
}

// One mass, the shell included.
struct Term {
  double mass;
  Vec zeta, d1, d2;  // of a rail; the shell has no d1 and d2
  double rate, acceleration;
  Vec lever;  // s = r Gamma + zeta
  Vec c;      // c_i of physics.md section 1
};

// All that values and derivatives share at one instant.
struct Instant {
  explicit Instant(const RollingState& state) : attitude(attitude_of(state.q)) {}

  Attitude attitude;
  Vec omega, u;        // u = -Lambda^T g_W, on a level floor g Gamma
  Vec inertia, force;  // F_B
  double radius = 0, mass = 0;
  std::array<Term, kMaxMasses + 1> terms;
  int count = 0;
  Vec mass_s{0, 0, 0}, mass_c{0, 0, 0};
  Mat inverse;  // A^-1
  Vec omega_dot;
  Vec h;  // R_B - M u = sum m_i (Omegadot x s_i + c_i) - F_B
  double normal = 0;
  // The floor's moment N t.
  bool moment = false;  // there is one: the floor resists and presses
  Vec arm;              // t = Lambda^T T_W / N
  Vec omega_dot_1;      // A^-1 (-t): Omegadot per N
  double share = 1;     // 1 - (Omegadot_1 x sum m_i s_i) . Gamma: the part of N that is not the moment's own
};

// 1 / sqrt(omega_h^2 + omega_c^2) and 1 / sqrt(omega_3^2 + omega_c^2).
struct Fading {
  Fading(const firmware::BallParams& ball, const Vec& omega_W) {
    const double creep2 = ball.creep_radps * ball.creep_radps;
    rolling = 1 / std::sqrt(omega_W.x * omega_W.x + omega_W.y * omega_W.y + creep2);
    spinning = 1 / std::sqrt(omega_W.z * omega_W.z + creep2);
  }
  double rolling, spinning;
};

// T_W / N (physics.md, "Real floors").
Vec arm_W(const firmware::BallParams& ball, const Vec& omega_W) {
  const Fading fading(ball, omega_W);
  const double rolling = ball.rolling_resistance * ball.radius_m * fading.rolling;
  return {-rolling * omega_W.x, -rolling * omega_W.y, -ball.spin_friction_m * fading.spinning * omega_W.z};
}

// Change of T_W / N by a change of omega.
Vec arm_change_W(const firmware::BallParams& ball, const Vec& omega_W, const Vec& change_W) {
  const Fading fading(ball, omega_W);
  const double rolling = ball.rolling_resistance * ball.radius_m * fading.rolling;
  const double along = fading.rolling * fading.rolling * (omega_W.x * change_W.x + omega_W.y * change_W.y);
  const double faded = ball.creep_radps * fading.spinning;
  return {rolling * (along * omega_W.x - change_W.x), rolling * (along * omega_W.y - change_W.y),
          -ball.spin_friction_m * fading.spinning * faded * faded * change_W.z};
}

void add_term(Instant& at, double mass, const firmware::RailPoint<double>* rail, const Vec& zeta, double rate,
              double acceleration) {
  Term& term = at.terms[static_cast<std::size_t>(at.count++)];
  term.mass = mass;
  term.zeta = zeta;
  term.rate = rate;
  term.acceleration = acceleration;
  term.lever = at.radius * at.attitude.gamma + zeta;
  term.c = cross(at.omega, cross(at.omega, zeta));
  if (rail == nullptr) return;
  term.d1 = vec(rail->d1);
  term.d2 = vec(rail->d2);
  term.c = term.c + cross(at.omega, (2 * rate) * term.d1) + (rate * rate) * term.d2 + acceleration * term.d1;
}

// Solves A Omegadot = b with A = sum m_i s_i^ s_i^ - I, which is symmetric and negative definite.
void solve(Instant& at) {
  double xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0;
  Vec b = cross(at.omega, scaled(at.inertia, at.omega)) + cross(at.radius * at.force, at.attitude.gamma);
  for (int i = 0; i < at.count; ++i) {
    const Term& term = at.terms[static_cast<std::size_t>(i)];
    const Vec ms = term.mass * term.lever;
    at.mass += term.mass;
    at.mass_s = at.mass_s + ms;
    at.mass_c = at.mass_c + term.mass * term.c;
    b = b + cross(ms, at.u + term.c);
    xx += ms.x * term.lever.x;
    yy += ms.y * term.lever.y;
    zz += ms.z * term.lever.z;
    xy += ms.x * term.lever.y;
    xz += ms.x * term.lever.z;
    yz += ms.y * term.lever.z;
  }
  const double a11 = -yy - zz - at.inertia.x, a22 = -xx - zz - at.inertia.y, a33 = -xx - yy - at.inertia.z;
  const double c11 = a22 * a33 - yz * yz, c12 = xz * yz - xy * a33, c13 = xy * yz - xz * a22;
  const double c22 = a11 * a33 - xz * xz, c23 = xy * xz - a11 * yz, c33 = a11 * a22 - xy * xy;
  const double per_det = 1 / (a11 * c11 + xy * c12 + xz * c13);
  at.inverse = {{per_det * c11, per_det * c12, per_det * c13},
                {per_det * c12, per_det * c22, per_det * c23},
                {per_det * c13, per_det * c23, per_det * c33}};
  at.omega_dot = at.inverse * b;
  at.h = cross(at.omega_dot, at.mass_s) + at.mass_c - at.force;
}

// Adds what the floor's moment does, as firmware/model/rolling.h derives it: A Omegadot = b - N t, and N = N_0 + N
// (Omegadot_1 x sum m_i s_i) . Gamma.
void resist(const firmware::BallParams& ball, double pressing_n, Instant& at) {
  const double normal_0 = pressing_n + dot(at.h, at.attitude.gamma);
  if (!(normal_0 > 0)) return;
  at.moment = true;
  at.arm = turned_to_body(at.attitude, arm_W(ball, turned_to_space(at.attitude, at.omega)));
  at.omega_dot_1 = at.inverse * negative(at.arm);
  const Vec h_1 = cross(at.omega_dot_1, at.mass_s);
  at.share = 1 - dot(h_1, at.attitude.gamma);
  const double normal = at.share > 0 ? normal_0 / at.share : std::numeric_limits<double>::quiet_NaN();
  at.omega_dot = at.omega_dot + normal * at.omega_dot_1;
  at.h = at.h + normal * h_1;
}

Instant instant_of(const Robot& robot, const RollingState& state) {
  const firmware::BallParams& ball = robot.ball;
  Instant at(state);
  at.omega = state.omega_B;
  at.radius = ball.radius_m;
  const Vec down = vec(ball.down_W);
  at.u = slopes(ball) ? negative(turned_to_body(at.attitude, ball.gravity_mps2 * down))
                      : ball.gravity_mps2 * at.attitude.gamma;
  at.inertia = vec(ball.inertia_kgm2);
  const Vec force = vec(ball.external_force_W_n);
  at.force = force.x * at.attitude.row1 + force.y * at.attitude.row2 + force.z * at.attitude.gamma;
  add_term(at, ball.shell_mass_kg, nullptr, vec(ball.center_of_mass_B_m), 0, 0);
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const auto rail = firmware::evaluate<double>(ball.rail[k], state.position[k]);
    add_term(at, ball.mass_kg[k], &rail, vec(rail.position), state.velocity[k], state.acceleration[k]);
  }
  solve(at);
  const double pressing_n = -(at.mass * ball.gravity_mps2) * down.z;
  if (resists(ball)) resist(ball, pressing_n, at);
  at.normal = pressing_n + dot(at.h, at.attitude.gamma);
  return at;
}

void value_of(const Robot& robot, const Instant& at, bool with_torque, RollingValue& value) {
  value.omega_dot_B = at.omega_dot;
  value.normal_n = at.normal;
  const double weight_n = at.mass * robot.ball.gravity_mps2;
  value.force_n = {dot(at.attitude.row1, at.h) - weight_n * robot.ball.down_W[0],
                   dot(at.attitude.row2, at.h) - weight_n * robot.ball.down_W[1]};
  // zdot = omega x r e3.
  value.velocity_mps = {at.radius * dot(at.attitude.row2, at.omega), -at.radius * dot(at.attitude.row1, at.omega)};
  if (!with_torque) return;
  for (int i = 1; i < at.count; ++i) {
    const Term& term = at.terms[static_cast<std::size_t>(i)];
    const auto k = static_cast<std::size_t>(i - 1);
    value.torque[k] = term.mass * dot(term.d1, cross(at.omega_dot, term.lever) + term.c + at.u) +
                      robot.reflected_inertia[k] * term.acceleration;
  }
}

// zeta'''. A spline's is constant on each of its pieces.
Vec third_derivative(const firmware::Rail& rail, const Term& term, double position) {
  if (rail.shape == firmware::RailShape::kLine) return {0, 0, 0};
  if (rail.shape == firmware::RailShape::kCircle) return negative(term.d1);
  constexpr double kStep = 1e-200;  // so small that the complex step is exact
  const auto point = firmware::evaluate(rail, std::complex<double>(position, kStep));
  return {point.d2[0].imag() / kStep, point.d2[1].imag() / kStep, point.d2[2].imag() / kStep};
}

// The change of the explicit parts by one variable; complete() adds what follows from Omegadot's.
struct Change {
  Vec b{0, 0, 0};      // of b - A Omegadot, Omegadot held
  Vec h{0, 0, 0};      // of h, Omegadot held
  Vec gamma{0, 0, 0};  // of Gamma
};

// Columns of one variable from the changes of its explicit parts. phi: the rotation, or nullptr.
//
// With a moment, change.b has -N dt; what is missing is -t dN, where dN = (dOmegadot x sum m_i s_i + dh) . Gamma + h .
// dGamma again has dN on its right: dN share = the same without the moment.
void complete(const Instant& at, const Change& change, const Vec* phi, std::size_t column, RollingDerivative& out) {
  Vec omega_dot = at.inverse * change.b;
  Vec h = cross(omega_dot, at.mass_s) + change.h;
  if (at.moment) {
    const double normal = (dot(h, at.attitude.gamma) + dot(at.h, change.gamma)) / at.share;
    omega_dot = omega_dot + normal * at.omega_dot_1;
    h = cross(omega_dot, at.mass_s) + change.h;
  }
  out.omega_dot_B[column] = omega_dot;
  out.normal_n[column] = dot(h, at.attitude.gamma) + dot(at.h, change.gamma);
  out.force_n[0][column] = dot(at.attitude.row1, h);
  out.force_n[1][column] = dot(at.attitude.row2, h);
  if (phi == nullptr) return;
  out.force_n[0][column] += dot(cross(at.attitude.row1, *phi), at.h);
  out.force_n[1][column] += dot(cross(at.attitude.row2, *phi), at.h);
}

constexpr std::array<Vec, 3> kUnit{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

void attitude_columns(const Robot& robot, const Instant& at, RollingDerivative& out) {
  const double r = at.radius;
  const Vec load = at.mass * at.u + at.mass_c;
  const Vec lever_turn = cross(at.mass_s, at.omega_dot);
  for (std::size_t k = 0; k < 3; ++k) {
    Change change;
    change.gamma = cross(at.attitude.gamma, kUnit[k]);
    const Vec ds = r * change.gamma, force = cross(at.force, kUnit[k]);
    // The weight's turn, m_i s_i x du. A level floor's form is kept to the bit.
    const Vec weight_turn = slopes(robot.ball) ? cross(at.mass_s, cross(at.u, kUnit[k]))
                                               : robot.ball.gravity_mps2 * cross(at.mass_s, change.gamma);
    change.b = r * (cross(force, at.attitude.gamma) + cross(at.force, change.gamma)) + cross(ds, load) + weight_turn -
               cross(ds, lever_turn) - cross(at.mass_s, cross(ds, at.omega_dot));
    if (at.moment) {
      // d(Lambda^T T) = (Lambda^T T) x phi + Lambda^T dT, and omega_W changes by Lambda (phi x Omega).
      const Vec omega_W = turned_to_space(at.attitude, at.omega);
      const Vec turn_W = turned_to_space(at.attitude, cross(kUnit[k], at.omega));
      const Vec darm = cross(at.arm, kUnit[k]) + turned_to_body(at.attitude, arm_change_W(robot.ball, omega_W, turn_W));
      add(change.b, (-at.normal) * darm);
    }
    change.h = at.mass * cross(at.omega_dot, ds) - force;
    complete(at, change, &kUnit[k], k, out);
    out.velocity_mps[0][k] = r * dot(cross(at.attitude.row2, kUnit[k]), at.omega);
    out.velocity_mps[1][k] = -r * dot(cross(at.attitude.row1, kUnit[k]), at.omega);
  }
}

// Derivative of c_i by Omega: (Omega . zeta) 1 + Omega zeta^T - 2 zeta Omega^T - 2 rate d1^, applied to e_k.
Vec turned(const Instant& at, const Term& term, const Vec& unit) {
  return dot(at.omega, term.zeta) * unit + dot(term.zeta, unit) * at.omega - (2 * dot(at.omega, unit)) * term.zeta;
}

void rate_columns(const Robot& robot, const Instant& at, RollingDerivative& out) {
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec& unit = kUnit[k];
    Change change;
    change.b = cross(unit, scaled(at.inertia, at.omega)) + cross(at.omega, scaled(at.inertia, unit));
    for (int i = 0; i < at.count; ++i) {
      const Term& term = at.terms[static_cast<std::size_t>(i)];
      Vec dc = turned(at, term, unit);
      if (i > 0) dc = dc + cross(unit, (2 * term.rate) * term.d1);
      dc = term.mass * dc;
      add(change.h, dc);
      add(change.b, cross(term.lever, dc));
    }
    if (at.moment) {
      const Vec omega_W = turned_to_space(at.attitude, at.omega), unit_W = turned_to_space(at.attitude, unit);
      add(change.b, (-at.normal) * turned_to_body(at.attitude, arm_change_W(robot.ball, omega_W, unit_W)));
    }
    complete(at, change, nullptr, 3 + k, out);
    out.velocity_mps[0][3 + k] = at.radius * dot(at.attitude.row2, unit);
    out.velocity_mps[1][3 + k] = -at.radius * dot(at.attitude.row1, unit);
  }
}

// Changes of c_i by the mass's position, velocity and acceleration.
std::array<Vec, 3> mass_changes(const Robot& robot, const Instant& at, const Term& term, std::size_t mass,
                                double position) {
  const Vec d3 = third_derivative(robot.ball.rail[mass], term, position);
  const Vec& w = at.omega;
  return {cross(w, cross(w, term.d1) + (2 * term.rate) * term.d2) + (term.rate * term.rate) * d3 +
              term.acceleration * term.d2,
          2 * cross(w, term.d1) + (2 * term.rate) * term.d2, term.d1};
}

void mass_columns(const Robot& robot, const RollingState& state, const Instant& at, RollingDerivative& out) {
  for (int i = 1; i < at.count; ++i) {
    const Term& term = at.terms[static_cast<std::size_t>(i)];
    const auto mass = static_cast<std::size_t>(i - 1);
    const auto changes = mass_changes(robot, at, term, mass, state.position[mass]);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec dc = term.mass * changes[k];
      Change change;
      change.b = cross(term.lever, dc);
      change.h = dc;
      if (k == 0) {
        const Vec ds = term.mass * term.d1;
        const Vec turn = cross(at.omega_dot, term.d1);
        add(change.b, cross(ds, at.u + term.c + cross(at.omega_dot, term.lever)));
        add(change.b, term.mass * cross(term.lever, turn));
        add(change.h, term.mass * turn);
      }
      complete(at, change, nullptr, static_cast<std::size_t>(kStateColumns) + 3 * mass + k, out);
    }
  }
}

// tau_i = m_i zeta_i' . (Omegadot x s_i + c_i + u) + J_i thetaddot_i.
void torque_columns(const Robot& robot, const RollingState& state, const Instant& at, RollingDerivative& out) {
  for (int i = 1; i < at.count; ++i) {
    const Term& term = at.terms[static_cast<std::size_t>(i)];
    const auto mass = static_cast<std::size_t>(i - 1);
    auto& row = out.torque[mass];
    const Vec arm = term.mass * cross(term.lever, term.d1);
    for (std::size_t k = 0; k < static_cast<std::size_t>(out.columns); ++k) row[k] = dot(arm, out.omega_dot_B[k]);
    const Vec along = term.mass * term.d1;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec gamma = cross(at.attitude.gamma, kUnit[k]);
      row[k] += dot(along, cross(at.omega_dot, at.radius * gamma) + cross(at.u, kUnit[k]));
      row[3 + k] += dot(along, turned(at, term, kUnit[k]));  // d1 . (e_k x d1) is 0
    }
    const auto changes = mass_changes(robot, at, term, mass, state.position[mass]);
    const std::size_t own = static_cast<std::size_t>(kStateColumns) + 3 * mass;
    for (std::size_t k = 0; k < 3; ++k) row[own + k] += dot(along, changes[k]);
    row[own] += dot(along, cross(at.omega_dot, term.d1)) +
                term.mass * dot(term.d2, cross(at.omega_dot, term.lever) + term.c + at.u);
    row[own + 2] += robot.reflected_inertia[mass];
  }
}

}  // namespace

void evaluate_rolling(const Robot& robot, const RollingState& state, RollingValue& value) {
  value_of(robot, instant_of(robot, state), true, value);
}

void differentiate_rolling(const Robot& robot, const RollingState& state, bool with_torque, RollingValue& value,
                           RollingDerivative& derivative) {
  const Instant at = instant_of(robot, state);
  value_of(robot, at, with_torque, value);
  derivative.columns = kStateColumns + 3 * robot.ball.mass_count;
  attitude_columns(robot, at, derivative);
  rate_columns(robot, at, derivative);
  mass_columns(robot, state, at, derivative);
  if (with_torque) torque_columns(robot, state, at, derivative);
}

Vec to_space(const std::array<double, 4>& q, const Vec& v_B) { return turned_to_space(attitude_of(q), v_B); }

Vec to_body(const std::array<double, 4>& q, const Vec& v_W) { return turned_to_body(attitude_of(q), v_W); }

}  // namespace ballast::plan
