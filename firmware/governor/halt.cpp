#include "firmware/governor/halt.h"

#include <cmath>

#include "firmware/model/ball_sums.h"

namespace ballast::firmware {

using detail::Attitude;
using detail::cross;
using detail::from;
using detail::Vec;

namespace {

// Part of the radius to which the wish carries the centre of mass off the contact point at most. More would ask for
// more friction than floors have; the masses' reach usually ends before that.
constexpr Real kMostOffset = Real(0.2);
// Part of the acceleration at which a mass that hangs would fall back under the centre, without the ball.
constexpr Real kHanging = Real(0.3);
// Beside (d offset / d u)^2 of a mass of the ball at its surface. It keeps directions in which the masses have no
// authority from asking for large accelerations.
constexpr Real kDamped = Real(1e-4);
// Part of max_velocity that the wish goes up to, within this many steps of a rollout. A wish that runs into the limit
// is bent in every step, with alternating signs, and soon has no points of a plan's bends left.
constexpr Real kFastest = Real(0.95);
constexpr Real kSlowsDown = 4;
// Masses yield to a ball that would have them go faster than this multiple of their max_velocity to keep the centre of
// mass in its place, and altogether from the other one on. Somewhat behind they still brake, and the slope between
// keeps a mass from changing its law at every step. Drawn balls chose the numbers
// (Halt.BallsFasterThanTheirMassesComeToRest).
constexpr Real kYieldsFrom = Real(1.5), kYieldsAt = Real(2.5);

struct Plane {
  Real x = 0, y = 0;
};

Real dot(const Plane& a, const Plane& b) { return a.x * b.x + a.y * b.y; }

Plane floor_part(const Attitude& lambda, const Vec& v_B) { return {dot(lambda.row1, v_B), dot(lambda.row2, v_B)}; }

// Horizontal offset of the centre of mass from the contact point, its rate, and its acceleration level + sum per_unit
// u.
struct Offset {
  Plane value, rate, level;
  Real height = 0;  // over the geometric centre
  PerMass<Plane> per_unit{};
  PerMass<Real> hanging{};  // Gamma . zeta_i' / |zeta_i'|^2
  PerMass<Real> pull{};     // acceleration along the rail of a mass that is free there, at u = 0
  Real brake = 0;           // offset for each m/s of speed taken away in a second
};

Offset offset_of(const BallParams& ball, const RobotState& state) {
  const Attitude lambda(state.orientation);
  const Vec omega = from(state.angular_velocity_B_radps);
  AffineForces forces;
  affine_forces(ball, state.orientation, state.angular_velocity_B_radps, motion_of(state), forces);
  const auto n = static_cast<std::size_t>(ball.mass_count);

  Offset out;
  Real mass = ball.shell_mass_kg;
  Vec moment = ball.shell_mass_kg * from(ball.center_of_mass_B_m), moved{0, 0, 0}, turned{0, 0, 0};
  // The acceleration of a free mass at the centre, seen from there.
  const Vec turning = from(forces.omega_dot_B_radps2);
  const Vec falling = ball.gravity_mps2 * lambda.to_B(from(ball.down_W)) - ball.radius_m * cross(turning, lambda.gamma);
  PerMass<Vec> along;
  for (std::size_t i = 0; i < n; ++i) {
    const RailPoint<Real> rail = evaluate<Real>(ball.rail[i], state.mass_position[i]);
    const Real v = state.mass_velocity[i];
    const Vec p = from(rail.position), d1 = from(rail.d1);
    along[i] = ball.mass_kg[i] * d1;
    mass += ball.mass_kg[i];
    moment = moment + ball.mass_kg[i] * p;
    moved = moved + v * along[i];
    turned = turned + (ball.mass_kg[i] * v * v) * from(rail.d2);
    out.hanging[i] = dot(lambda.gamma, d1) / dot(d1, d1);
    out.pull[i] = dot(falling - cross(turning, p) - cross(omega, cross(omega, p)), d1) / dot(d1, d1);
  }
  const auto accelerated = [&](const Vector3& omega_dot, const Vec& more) {
    return floor_part(lambda, (1 / mass) * (cross(from(omega_dot), moment) + more));
  };
  out.value = floor_part(lambda, (1 / mass) * moment);
  out.height = dot(lambda.gamma, moment) / mass;
  out.rate = floor_part(lambda, (1 / mass) * (cross(omega, moment) + moved));
  out.level = accelerated(forces.omega_dot_B_radps2, cross(omega, cross(omega, moment) + Real(2) * moved) + turned);
  for (std::size_t i = 0; i < n; ++i) out.per_unit[i] = accelerated(forces.omega_dot_per_unit[i], along[i]);
  // M g c = J vdot / r, with J of a ball with all its mass at its surface: the middle between what balls have.
  const Real inertia =
      (ball.inertia_kgm2[0] + ball.inertia_kgm2[1] + ball.inertia_kgm2[2]) / 3 + mass * ball.radius_m * ball.radius_m;
  const Real weight = mass * ball.gravity_mps2;
  out.brake = weight > 0 ? inertia / (weight * ball.radius_m) : 0;
  return out;
}

// The least u with P u = b, damped: u = P^T solve(b), solve(b) = (P P^T + damped)^-1 b.
class LeastChange {
 public:
  LeastChange(const PerMass<Plane>& per_unit, std::size_t n) {
    for (std::size_t i = 0; i < n; ++i) {
      const Plane& p = per_unit[i];
      xx_ += p.x * p.x;
      xy_ += p.x * p.y;
      yy_ += p.y * p.y;
    }
    const Real damped = kDamped * (xx_ + yy_);
    xx_ += damped;
    yy_ += damped;
    det_ = xx_ * yy_ - xy_ * xy_;
  }
  [[nodiscard]] Plane solve(const Plane& b) const {
    if (!(det_ > 0)) return {};
    return {(yy_ * b.x - xy_ * b.y) / det_, (xx_ * b.y - xy_ * b.x) / det_};
  }

 private:
  Real xx_ = 0, xy_ = 0, yy_ = 0, det_ = 0;
};

// From 0, up to kYieldsFrom times the speeds that the masses have, to 1 from kYieldsAt times on: the speeds that would
// keep the offset as it is.
Real part_that_yields(const GovernorParams& params, const RobotState& state, const Offset& c, const Plane& to_keep,
                      std::size_t n) {
  Real fast = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Real keeps = state.mass_velocity[i] + dot(c.per_unit[i], to_keep);
    fast = std::fmax(fast, std::fabs(keeps) / params.mass[i].max_velocity);
  }
  return std::fmin(std::fmax((fast - kYieldsFrom) / (kYieldsAt - kYieldsFrom), Real(0)), Real(1));
}

}  // namespace

HaltGains halt_gains(const BallParams& ball) {
  const Real unit_s = firmware::unit_s(ball);
  return {3 * unit_s, Real(1.5) / unit_s, 2 * unit_s, Real(0.35) * unit_s, Real(0.05) * unit_s};
}

PerMass<Real> halt_wish(const BallParams& ball, const GovernorParams& params, const HaltGains& gains,
                        const RobotState& state) {
  const Offset c = offset_of(ball, state);
  const Vector2 v =
      turning_rate(state.orientation, state.angular_velocity_B_radps, Vector3::Zero(), ball.radius_m).position;
  const auto n = static_cast<std::size_t>(ball.mass_count);

  // Where the centre of mass should be: behind the ball, in proportion to its speed.
  Plane target = {-c.brake / gains.braking_s * v[0], -c.brake / gains.braking_s * v[1]};
  const Real far = std::sqrt(target.x * target.x + target.y * target.y), farthest = kMostOffset * ball.radius_m;
  if (far > farthest) target = {target.x * farthest / far, target.y * farthest / far};
  // At rest it lies on the vertical through the contact point, at its height over that.
  const Real over = (ball.radius_m + c.height) / ball.down_W[2];
  target = {target.x + over * ball.down_W[0], target.y + over * ball.down_W[1]};

  // Otherwise each mass would brake and hang.
  PerMass<Real> u{};
  const Real w = gains.offset_radps;
  Plane missing = {-2 * w * c.rate.x - w * w * (c.value.x - target.x) - c.level.x,
                   -2 * w * c.rate.y - w * w * (c.value.y - target.y) - c.level.y};
  for (std::size_t i = 0; i < n; ++i) {
    const Plane& p = c.per_unit[i];
    u[i] = -state.mass_velocity[i] / gains.damping_s - kHanging * ball.gravity_mps2 * c.hanging[i];
    missing.x -= p.x * u[i];
    missing.y -= p.y * u[i];
  }
  const LeastChange least(c.per_unit, n);
  const Plane to_place = least.solve(missing), to_keep = least.solve({-c.rate.x, -c.rate.y});
  const Real yields = part_that_yields(params, state, c, to_keep, n);
  const Vector3& omega = state.angular_velocity_B_radps;
  const Real following_s = std::fmax(gains.following_s, params.step_s);  // faster, it would swing in steps so long
  const Real rate_radps = std::sqrt(omega[0] * omega[0] + omega[1] * omega[1] + omega[2] * omega[2]);
  for (std::size_t i = 0; i < n; ++i) {
    const Real strongest = params.mass[i].max_acceleration, velocity = state.mass_velocity[i];
    const Real fastest = kFastest * params.mass[i].max_velocity, time_s = kSlowsDown * params.step_s;
    const Real placed = u[i] + dot(c.per_unit[i], to_place);
    // A mass that gives way to what pulls at it takes energy out of the ball, if it can turn about as often as that
    // does.
    const Real most = std::fmin(fastest, strongest / rate_radps);
    const Real falls = std::fmin(std::fmax(gains.yielding_s * c.pull[i], -most), most);
    const Real yielded = (falls - velocity) / following_s;
    const Real wish = placed + yields * (yielded - placed);
    const Real slowed = std::fmin(std::fmax(wish, (-fastest - velocity) / time_s), (fastest - velocity) / time_s);
    u[i] = std::fmin(std::fmax(slowed, -strongest), strongest);
  }
  return u;
}

Real rest_speed_mps(const BallParams& ball) { return kRestSpeed * std::sqrt(ball.gravity_mps2 * ball.radius_m); }

Real speed_mps(const BallParams& ball, const RobotState& state) {
  const Vector2 v =
      turning_rate(state.orientation, state.angular_velocity_B_radps, Vector3::Zero(), ball.radius_m).position;
  return std::sqrt(v[0] * v[0] + v[1] * v[1]);
}

void HaltRollout::begin(const GovernorParams& params, const RobotState& state, std::int64_t tick,
                        const Schedule& change, Wide longest_s) {
  Schedule schedule = change;
  schedule.to = schedule.from + static_cast<std::int64_t>(longest_s / params.control_period_s) + 1;
  rollout_.begin(params, state, tick, schedule);
  rollout_.tell_way();
  result_ = {};
  result_.place_W_m = state.position_W_m;
  from_s_ = static_cast<Wide>(change.from - tick) * params.control_period_s;
  longest_s_ = from_s_ + longest_s;
  path_m_ = 0;
}

void HaltRollout::take(const BallParams& ball, const Vector2& before_W_m) {
  const RobotState& now = rollout_.state();
  const Real x = now.position_W_m[0] - before_W_m[0], y = now.position_W_m[1] - before_W_m[1];
  const bool halts = rollout_.time_s() > from_s_ * (1 + Wide(1e-9));
  const Real speed = speed_mps(ball, now);
  result_.speed_after_mps = speed;
  if (!halts) result_.speed_before_mps = speed;
  if (halts) path_m_ += std::sqrt(x * x + y * y);
  if (!halts || !(speed < rest_speed_mps(ball))) {
    result_.distance_m = path_m_;
    result_.place_W_m = now.position_W_m;
    result_.time_s = halts ? rollout_.time_s() - from_s_ : 0;
  }
  result_.rests = rollout_.time_s() - from_s_ - result_.time_s >= kRestTime_s;
  result_.complete = result_.rests || rollout_.time_s() >= longest_s_ || rollout_.end() != RolloutEnd::kUnderWay;
}

}  // namespace ballast::firmware
