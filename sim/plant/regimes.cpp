#include "sim/plant/regimes.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sim/plant/contact.h"

namespace ballast::sim {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

// Changes of regime at one instant, each that close to the one before, after which there is no hope of an end.
constexpr int kMostChanges = 16;
constexpr double kOneInstant = 1e-14;

Vector3d angular_velocity_W(const State& y) {
  return rotation_B_to_W(&y[kQ]) * Vector3d(y[kOmega], y[kOmega + 1], y[kOmega + 2]);
}

// Balances each motor under the load of the masses held as they are (thetaddot = 0), in flight or in contact. A slip
// does not last long enough to be balanced for.
void balance_motors(bool flies, const Vector3d& velocity_W, Progress& run) {
  Equations& equations = run.dynamics.equations;
  const State& y = run.dynamics.now.y;
  const MassPoint masses = run.dynamics.masses();
  const CarriedMasses held = equations.carried(masses);
  Motion at_rest;
  if (flies) {
    OpenContact open;
    open_contact_prescribed(equations.body, 0, &y[kQ], &y[kOmega], velocity_W, held, open);
    close_contact(equations.body, open, Vector3d::Zero(), at_rest);
  } else {
    rolling_prescribed(equations.body, 0, &y[kQ], &y[kOmega], held, at_rest);
  }
  const PerMass torque = equations.needed_torques(y.data(), at_rest, masses);
  for (std::size_t i = 0; i < equations.mass_count(); ++i) {
    Stepper& stepper = equations.motors.stepper(i);
    stepper.balance(torque[i], stepper.motor().shaft_ratio * masses.velocity[i]);
  }
  run.motors.start(equations, masses);
}

}  // namespace

void Regimes::start(const InitialState& initial, Progress& run) {
  Dynamics& dynamics = run.dynamics;
  const Vector3d omega_W = angular_velocity_W(dynamics.now.y);
  Vector3d velocity_W = omega_W.cross(Vector3d(0, 0, dynamics.equations.body.radius_m));
  if (initial.has_velocity) velocity_W = initial.velocity_W_mps;
  double* center = dynamics.center();
  center[0] = initial.height_m;
  for (int j = 0; j < 3; ++j) center[1 + j] = velocity_W[j];
  const bool flies = initial.height_m > 0 || velocity_W[2] > 0;
  const bool lands = !flies && velocity_W[2] < 0;
  const bool slides = !flies && !lands && initial.has_velocity;

  if (dynamics.equations.driven()) balance_motors(flies, velocity_W, run);
  if (flies) {
    enter(Regime::kFlight, run);
  } else if (lands) {
    dynamics.equations.contact.regime = Regime::kFlight;  // up to the impact
    starts_.push_back({Regime::kFlight, 0});
    dynamics.evaluate();
    land(run);
  } else if (slides) {
    touch(dynamics.slip_W_mps().head<2>(), run);
  } else {
    starts_.push_back({Regime::kRolling, 0});
    continue_after_jump(run);
  }
}

void Regimes::continue_after_jump(Progress& run) {
  run.dynamics.evaluate();
  const bool over = run.regime_over();
  const bool rolling = run.dynamics.equations.contact.regime == Regime::kRolling;
  if (over && (!rolling || on_violation_ == OnViolation::kContinue)) {
    // The forces do not come about. The friction that rolling on would have needed is worth recording.
    if (rolling) run.record_mu();
  } else {
    run.record();
  }
  if (over) leave(run);
}

void Regimes::end_inconsistent(std::string text, Progress& run) {
  if (run.contact.empty()) {  // the run ends as it starts
    Dynamics& dynamics = run.dynamics;
    run.contact.record(dynamics.equations, dynamics.time_s, dynamics.now.y, dynamics.now.motion);
  }
  end_ = PhysicsEnd::kInconsistent;
  end_text_ = std::move(text);
}

void Regimes::end_painleve(Progress& run) {
  end_inconsistent(
      "sliding cannot go on: friction turns pressing the ball into the floor from pushing it out to pulling it in (the "
      "normal force's coefficient is no longer positive: Painleve's paradox)",
      run);
}

bool Regimes::changes_without_end(double time_s) {
  if (time_s - last_change_s_ > kOneInstant * std::max(1.0, time_s)) changes_here_ = 0;
  last_change_s_ = time_s;
  ++changes_here_;
  return changes_here_ > kMostChanges;
}

void Regimes::leave(Progress& run) {
  Dynamics& dynamics = run.dynamics;
  const Regime regime = dynamics.equations.contact.regime;
  const Instant& motion = dynamics.now.motion;
  if (!std::isfinite(motion.normal_force_n) || !std::isfinite(motion.static_friction_n)) {
    if (regime == Regime::kSliding) return end_painleve(run);
    return end_inconsistent(
        dynamics.equations.body.floor.resists
            ? "rolling cannot go on: the moment of the floor's resistance presses the ball down by more "
              "than the normal force that causes it, so that no normal force balances it"
            : "the contact force stopped being finite",
        run);
  }
  if (changes_without_end(dynamics.time_s)) {
    return end_inconsistent("the contact changes between its regimes without end at one instant", run);
  }
  const bool pulls = !(motion.normal_force_n > 0);
  if (regime == Regime::kFlight) return land(run);
  if (regime == Regime::kSliding) return pulls ? enter(Regime::kFlight, run) : touch(Vector2d::Zero(), run);
  rolling_lost_ = true;
  if (on_violation_ == OnViolation::kStop) {
    end_ = pulls ? PhysicsEnd::kDetached : PhysicsEnd::kSlipped;
    return;
  }
  double* center = dynamics.center();
  center[0] = center[3] = 0;
  center[1] = dynamics.now.dydt[kZ];
  center[2] = dynamics.now.dydt[kZ + 1];
  touch(Vector2d::Zero(), run);
}

// The state at dynamics.time_s has to be complete.
void Regimes::enter(Regime regime, Progress& run) {
  Dynamics& dynamics = run.dynamics;
  dynamics.equations.contact.regime = regime;
  if (!starts_.empty() && starts_.back().time_s == dynamics.time_s) starts_.pop_back();
  if (starts_.empty() || starts_.back().regime != regime) starts_.push_back({regime, dynamics.time_s});
  dynamics.evaluate();
  if (regime == Regime::kSliding && !std::isfinite(dynamics.now.motion.normal_force_n)) return end_painleve(run);
  if (run.regime_over()) return leave(run);  // the forces do not come about
  run.record();
}

// The height is 0 and falling: one impulse, physics.md section 4.
void Regimes::land(Progress& run) {
  Dynamics& dynamics = run.dynamics;
  const ContactRegime& contact = dynamics.equations.contact;
  double* center = dynamics.center();
  center[0] = 0;
  if (dynamics.equations.floor.has_borders()) dynamics.stand_at(dynamics.now.y);
  const Vector3d before = dynamics.slip_W_mps();
  const double arriving = -before[2];
  const double leaving = arriving > kRestSpeed * contact.speed_scale_mps ? restitution_ * arriving : 0.0;
  const OpenContact open = dynamics.open_contact();
  std::string why;
  const auto impact = impact_impulse(before, open.impulse_compliance_W, contact.static_friction,
                                     contact.kinetic_friction, leaving, why);
  if (!impact) return end_inconsistent(why, run);
  const Vector3d& impulse = impact->impulse_W_ns;
  const Vector3d after(impact->slip_W_mps[0], impact->slip_W_mps[1], leaving);
  // The work of an impulse is its product with the mean velocity of the point it acts on.
  if (impulse.dot(before + after) > 1e-9 * impulse.norm() * (before.norm() + after.norm())) {
    return end_inconsistent(
        "Newton's restitution would make energy out of nothing in this impact: it reverses the slip", run);
  }
  const VelocityJump jump = apply_impulse(dynamics.equations.body, open, impulse);
  State& y = dynamics.now.y;
  for (int j = 0; j < 3; ++j) {
    center[1 + j] += jump.velocity_W_mps[j];
    y[kOmega + static_cast<std::size_t>(j)] += jump.angular_velocity_B_radps[j];
  }
  const std::size_t n = dynamics.equations.mass_count();
  for (std::size_t i = 0; dynamics.equations.driven() && i < n; ++i) y[kTheta + n + i] += jump.mass_velocity[i];
  run.update_stops();
  center[3] = leaving;
  impacts_.push_back({dynamics.time_s, impulse[2], impulse.head<2>().norm(), impact->sticking});
  if (leaving > 0) {
    enter(Regime::kFlight, run);
  } else {
    touch(impact->slip_W_mps, run);
  }
}

// Returns whether the ball can roll from here, and the motion that rolling would have.
bool Regimes::can_roll(Progress& run, Instant& rolling) {
  Dynamics& dynamics = run.dynamics;
  ContactRegime& contact = dynamics.equations.contact;
  const Regime before = std::exchange(contact.regime, Regime::kRolling);
  dynamics.equations.evaluate(dynamics.time_s, dynamics.now.y.data(), rolling);
  const bool possible = !contact.over(rolling);
  contact.regime = before;
  return possible;
}

void Regimes::touch(const Vector2d& slip_W_mps, Progress& run) {
  Dynamics& dynamics = run.dynamics;
  ContactRegime& contact = dynamics.equations.contact;
  const double speed = slip_W_mps.norm();
  if (speed > kSlipVanishes * contact.speed_scale_mps) {
    if (std::isinf(contact.kinetic_friction)) {
      return end_inconsistent("the ball is to slide, and friction is infinite", run);
    }
    contact.slip_begins = false;
    contact.slip_direction_W = slip_W_mps / speed;
    contact.slip_kept_mps = kSlipKept * speed;
    return enter(Regime::kSliding, run);
  }

  // The ball rolls if friction and normal force allow it.
  Instant rolling;
  if (can_roll(run, rolling)) return enter(Regime::kRolling, run);
  // Otherwise it flies if that is where it goes without the floor, and slides if not.
  const OpenContact open = dynamics.open_contact();
  const ContactRelation relation{open.free_slip_rate_W_mps2, open.compliance_W};
  // Rounding of f_s makes rolling end that much of N, over mu_s, before N is 0.
  const double negligible =
      1e-12 * (dynamics.equations.body.gravity_mps2 + relation.free.norm()) / std::min(1.0, contact.static_friction);
  if (relation.free[2] >= -negligible) return enter(Regime::kFlight, run);
  if (std::isinf(contact.kinetic_friction)) {
    return end_inconsistent(
        "with perfect friction the ball can neither roll, for the floor would have to pull it, nor leave the ground",
        run);
  }
  const Vector3d sticking_W = rolling.rotation_B_to_W * rolling.contact_force_B_n;
  const auto direction =
      slip_direction(relation, contact.kinetic_friction, -sticking_W.head<2>(), 1e-9 * relation.free.norm());
  if (!direction) {
    return end_inconsistent("rolling is over, and no direction of slip obeys the laws of friction (Painleve's paradox)",
                            run);
  }
  contact.slip_begins = true;
  contact.slip_direction_W = *direction;
  contact.slip_kept_mps = kSlipVanishes * contact.speed_scale_mps;
  // The contact point's velocity is 0 but for rounding: exactly that of rolling.
  const State& y = dynamics.now.y;
  const Vector3d omega_W = open.rotation_B_to_W * Vector3d(y[kOmega], y[kOmega + 1], y[kOmega + 2]);
  dynamics.center()[1] = dynamics.equations.body.radius_m * omega_W[1];
  dynamics.center()[2] = -dynamics.equations.body.radius_m * omega_W[0];
  enter(Regime::kSliding, run);
}

}  // namespace ballast::sim
