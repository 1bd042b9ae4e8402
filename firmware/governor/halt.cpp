#include "firmware/governor/halt.h"

#include <cmath>

#include "firmware/model/ball_sums.h"

namespace ballast::firmware {

using detail::Attitude;
using detail::cross;
using detail::dot;
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

struct Plane {
  Real x = 0, y = 0;
};

Plane floor_part(const Attitude& lambda, const Vec& v_B) { return {dot(lambda.row1, v_B), dot(lambda.row2, v_B)}; }

// Horizontal offset of the centre of mass from the contact point, its rate, and its acceleration level + sum per_unit
// u.
struct Offset {
  Plane value, rate, level;
  Real height = 0;  // over the geometric centre
  PerMass<Plane> per_unit{};
  PerMass<Real> hanging{};  // Gamma . zeta_i' / |zeta_i'|^2
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
  PerMass<Vec> along;
  for (std::size_t i = 0; i < n; ++i) {
    const RailPoint<Real> rail = evaluate<Real>(ball.rail[i], state.mass_position[i]);
    const Real v = state.mass_velocity[i];
    const Vec d1 = from(rail.d1);
    along[i] = ball.mass_kg[i] * d1;
    mass += ball.mass_kg[i];
    moment = moment + ball.mass_kg[i] * from(rail.position);
    moved = moved + v * along[i];
    turned = turned + (ball.mass_kg[i] * v * v) * from(rail.d2);
    out.hanging[i] = dot(lambda.gamma, d1) / dot(d1, d1);
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

}  // namespace

HaltGains halt_gains(const BallParams& ball) {
  const Real unit_s = firmware::unit_s(ball);
  return {3 * unit_s, Real(1.5) / unit_s, 2 * unit_s};
}

PerMass<Real> halt_wish(const BallParams& ball, const GovernorParams& params, const HaltGains& gains,
                        const RobotState& state) {
  const Offset c = offset_of(ball, state);
  const Vector2 v =
      turning_rate(state.orientation, state.angular_velocity_B_radps, Vector3::Zero(), ball.radius_m).position;
  const auto n = static_cast<std::size_t>(ball.mass_count);

  // Where the centre of mass should be: behind the ball, in proportion to its speed.
  Plane target = {-c.brake / gains.braking_s * v[0], -c.brake / gains.braking_s * v[1]};
  const Real far = std::sqrt(target.x * target.x + target.y * target.y), most = kMostOffset * ball.radius_m;
  if (far > most) target = {target.x * most / far, target.y * most / far};
  // At rest it lies on the vertical through the contact point, at its height over that.
  const Real over = (ball.radius_m + c.height) / ball.down_W[2];
  target = {target.x + over * ball.down_W[0], target.y + over * ball.down_W[1]};

  // Otherwise each mass would brake and hang.
  PerMass<Real> u{};
  const Real w = gains.offset_radps;
  Plane missing = {-2 * w * c.rate.x - w * w * (c.value.x - target.x) - c.level.x,
                   -2 * w * c.rate.y - w * w * (c.value.y - target.y) - c.level.y};
  Real xx = 0, xy = 0, yy = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Plane& p = c.per_unit[i];
    u[i] = -state.mass_velocity[i] / gains.damping_s - kHanging * ball.gravity_mps2 * c.hanging[i];
    missing.x -= p.x * u[i];
    missing.y -= p.y * u[i];
    xx += p.x * p.x;
    xy += p.x * p.y;
    yy += p.y * p.y;
  }
  // The least change of u that moves the offset as wished, damped: P^T (P P^T + damped)^-1 missing.
  const Real damped = kDamped * (xx + yy);
  const Real a = xx + damped, d = yy + damped, det = a * d - xy * xy;
  const Real x = det > 0 ? (d * missing.x - xy * missing.y) / det : 0;
  const Real y = det > 0 ? (a * missing.y - xy * missing.x) / det : 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Real strongest = params.mass[i].max_acceleration, velocity = state.mass_velocity[i];
    const Real fastest = kFastest * params.mass[i].max_velocity, time_s = kSlowsDown * params.step_s;
    const Real wish = u[i] + c.per_unit[i].x * x + c.per_unit[i].y * y;
    const Real slowed = std::fmin(std::fmax(wish, (-fastest - velocity) / time_s), (fastest - velocity) / time_s);
    u[i] = std::fmin(std::fmax(slowed, -strongest), strongest);
  }
  return u;
}

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
  if (!halts || !(speed < kRestSpeed * std::sqrt(ball.gravity_mps2 * ball.radius_m))) {
    result_.distance_m = path_m_;
    result_.place_W_m = now.position_W_m;
    result_.time_s = halts ? rollout_.time_s() - from_s_ : 0;
  }
  result_.rests = rollout_.time_s() - from_s_ - result_.time_s >= kRestTime_s;
  result_.complete = result_.rests || rollout_.time_s() >= longest_s_ || rollout_.end() != RolloutEnd::kUnderWay;
}

}  // namespace ballast::firmware
