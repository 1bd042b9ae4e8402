#include "sim/plant/equations.h"

#include <algorithm>
#include <limits>

#include "sim/plant/contact.h"

namespace ballast::sim {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

bool all_on_circles(const std::vector<Mass>& masses) {
  return std::all_of(masses.begin(), masses.end(),
                     [](const Mass& mass) { return mass.rail.shape == firmware::RailShape::kCircle; });
}

void set_lane(LaneVectors& to, std::size_t i, const Vector3d& v) {
  to.x[i] = v[0];
  to.y[i] = v[1];
  to.z[i] = v[2];
}

LaneBody to_lanes(const Body& body) {
  LaneBody out;
  out.mass_count = static_cast<std::size_t>(body.mass_count);
  out.radius_m = body.radius_m;
  out.gravity_mps2 = body.gravity_mps2;
  out.total_mass_kg = body.total_mass_kg;
  const Vec3<double>& moment = body.shell_first_moment;
  out.inertia_kgm2 = {body.inertia_kgm2[0], body.inertia_kgm2[1], body.inertia_kgm2[2]};
  out.shell_first_moment = {moment.x, moment.y, moment.z};
  out.shell_second_moment = body.shell_second_moment;
  out.mass_kg = body.mass_kg;
  out.reflected_inertia.fill(1);
  for (std::size_t i = 0; i < out.mass_count; ++i) {
    const firmware::Rail& rail = body.rail[i];
    out.reflected_inertia[i] = body.reflected_inertia[i];
    set_lane(out.center_B_m, i, rail.origin_B_m);
    set_lane(out.axis_cos_B_m, i, rail.radius_m * rail.axis_cos_B);
    set_lane(out.axis_sin_B_m, i, rail.radius_m * rail.axis_sin_B);
  }
  return out;
}

}  // namespace

Equations::Equations(const PlantModel& model)
    : body(model),
      prescribed(model.masses),
      motors(model),
      contact(model, body.total_mass_kg),
      floor(model.surface),
      driven_(model.actuation == Actuation::kStepper),
      known_ahead_(model.actuation == Actuation::kPrescribed),
      contact_start_(kTheta + (driven_ ? 2 * model.masses.size() : 0)) {
  if (model.begins_held) {
    MassPoint held = prescribed.at(0);
    held.acceleration = {};
    prescribed.place(0, held);
  }
  const auto pushes = [](const PlantFault& fault) { return fault.kind == PlantFaultKind::kPush; };
  if (std::any_of(model.faults.begin(), model.faults.end(), pushes)) body.external_force.expect_pushes();
  lanes_suit_ = driven_ && !body.external_force.present() && all_on_circles(model.masses);
  lane_body_ = to_lanes(body);
  lay_floor();
}

void Equations::lay_floor() {
  contact.static_friction = floor.static_friction();
  contact.kinetic_friction = floor.kinetic_friction();
  body.floor.resist(floor.rolling_resistance() * body.radius_m);
  driven_lanes_ = lanes_suit_ && body.floor.ideal() ? &driven_lanes() : nullptr;
}

MassPoint Equations::mass_point(double time_s, const double* y) const {
  if (!driven_) return prescribed.at(time_s);
  MassPoint p{};
  for (std::size_t i = 0; i < mass_count(); ++i) {
    p.position[i] = y[kTheta + i];
    p.velocity[i] = y[kTheta + mass_count() + i];
  }
  return p;
}

CarriedMasses Equations::carried(const MassPoint& masses) const {
  CarriedMasses out;
  carry_along(body, masses.position.data(), masses.velocity.data(), masses.acceleration.data(), out);
  return out;
}

void Equations::evaluate(double time_s, const double* y, Instant& motion) const {
  if (!driven_) return evaluate_prescribed(time_s, y, carried(prescribed.at(time_s)), motion);
  if (contact.regime == Regime::kRolling && driven_lanes_ != nullptr && evaluate_lanes(y, motion)) return;
  const double *position = y + kTheta, *velocity = position + mass_count();
  const PerMass force = motors.forces(position, velocity);
  if (contact.regime == Regime::kRolling) {
    rolling_driven(body, time_s, y + kQ, y + kOmega, position, velocity, force.data(), motion);
  } else {
    evaluate_open(body, y, open_contact_driven_at(time_s, y, force), motion);
    motion.generalised_force = force;
  }
}

// The forces that end stops and blocks add to the motors'.
PerMass Equations::holding_forces(const double* y) const {
  PerMass force{};
  motors.add_holding_forces(y + kTheta, y + kTheta + mass_count(), force.data());
  return force;
}

// False: the motors or the state are not for driven_lanes().
bool Equations::evaluate_lanes(const double* y, Instant& motion) const {
  const LaneMotors* lanes = motors.lanes();
  if (lanes == nullptr) return false;
  const double *position = y + kTheta, *velocity = position + mass_count();
  LaneMotion found;
  if (!driven_lanes_->evaluate(lane_body_, *lanes, y + kQ, y + kOmega, position, velocity, holding_forces(y), found)) {
    return false;
  }
  motion.rotation_B_to_W = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(found.rotation_B_to_W.data());
  motion.up_B = motion.rotation_B_to_W.row(2);
  motion.angular_acceleration_B_radps2 = Vector3d::Map(found.angular_acceleration_B_radps2.data());
  motion.acceleration_B_mps2 = Vector3d::Map(found.acceleration_B_mps2.data());
  motion.contact_force_B_n = Vector3d::Map(found.contact_force_B_n.data());
  motion.normal_force_n = found.normal_force_n;
  motion.static_friction_n = found.static_friction_n;
  motion.rolling_velocity_W_mps = Vector2d::Map(found.rolling_velocity_W_mps.data());
  motion.mass_acceleration = found.mass_acceleration;
  motion.generalised_force = found.generalised_force;
  return true;
}

void Equations::evaluate_prescribed(const Body& other, double time_s, const double* y, const CarriedMasses& masses,
                                    Instant& motion) const {
  if (contact.regime == Regime::kRolling) {
    return rolling_prescribed(other, time_s, y + kQ, y + kOmega, masses, motion);
  }
  OpenContact open;
  open_contact_prescribed(other, time_s, y + kQ, y + kOmega, velocity_W_mps(y), masses, open);
  evaluate_open(other, y, open, motion);
}

// Sliding and flight.
void Equations::evaluate_open(const Body& of, const double* y, const OpenContact& open, Instant& motion) const {
  if (contact.regime == Regime::kFlight) {
    close_contact(of, open, Vector3d::Zero(), motion);
    motion.remaining = y[contact_start_];
    motion.height_rate_mps = y[contact_start_ + 3];
    return;
  }
  const double mu = contact.kinetic_friction;
  const ContactRelation relation{open.free_slip_rate_W_mps2, open.compliance_W};
  const Vector2d slip = slip_W_mps(y).head<2>();
  motion.remaining = slip.dot(contact.slip_direction_W);
  Vector2d e = contact.slip_direction_W;
  if (contact.slip_begins) {
    e = follow_slip_direction(relation, mu, contact.slip_direction_W);
  } else if (motion.remaining > contact.slip_kept_mps) {
    e = slip.normalized();
  }
  if (normal_coefficient(relation, mu, e) > 0) {
    close_contact(of, open, sliding_force(relation, mu, e), motion);
    motion.static_friction_n = mu * motion.normal_force_n;  // exactly, without the rounding of a norm
  } else {
    close_contact(of, open, Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()), motion);
  }
}

void Equations::derivative(double time_s, const double* y, double* dydt, Instant& motion) const {
  evaluate(time_s, y, motion);
  quaternion_rate(y + kQ, y + kOmega, dydt + kQ);
  for (int j = 0; j < 3; ++j) dydt[kOmega + j] = motion.angular_acceleration_B_radps2[j];
  if (contact.regime == Regime::kRolling) {
    dydt[kZ] = motion.rolling_velocity_W_mps[0];
    dydt[kZ + 1] = motion.rolling_velocity_W_mps[1];
  } else {
    const Vector3d acceleration_W = motion.rotation_B_to_W * motion.acceleration_B_mps2;
    const bool flies = contact.regime == Regime::kFlight;
    const std::size_t c = contact_start_;
    dydt[kZ] = y[c + 1];
    dydt[kZ + 1] = y[c + 2];
    dydt[c] = flies ? y[c + 3] : 0;
    dydt[c + 1] = acceleration_W[0];
    dydt[c + 2] = acceleration_W[1];
    dydt[c + 3] = flies ? acceleration_W[2] : 0;
  }
  for (std::size_t i = 0; driven_ && i < mass_count(); ++i) {
    dydt[kTheta + i] = y[kTheta + mass_count() + i];
    dydt[kTheta + mass_count() + i] = motion.mass_acceleration[i];
  }
}

void Equations::derivative_alone(double time_s, const double* y, double* dydt, Instant& motion) const {
  static_assert(kLaneOmega == kOmega && kLaneZ == kZ && kLaneTheta == kTheta && kLaneStateCapacity == kStateCapacity);
  const bool by_lanes = contact.regime == Regime::kRolling && driven_lanes_ != nullptr;
  const LaneMotors* lanes = by_lanes ? motors.lanes() : nullptr;
  if (lanes != nullptr && driven_lanes_->derivative(lane_body_, *lanes, y, holding_forces(y), dydt)) return;
  derivative(time_s, y, dydt, motion);
}

OpenContact Equations::open_contact(double time_s, const double* y) const {
  if (driven_) return open_contact_driven_at(time_s, y, motors.forces(y + kTheta, y + kTheta + mass_count()));
  OpenContact open;
  open_contact_prescribed(body, time_s, y + kQ, y + kOmega, velocity_W_mps(y), carried(prescribed.at(time_s)), open);
  return open;
}

OpenContact Equations::open_contact_driven_at(double time_s, const double* y, const PerMass& force) const {
  OpenContact open;
  open_contact_driven(body, time_s, y + kQ, y + kOmega, velocity_W_mps(y), y + kTheta, y + kTheta + mass_count(),
                      force.data(), open);
  return open;
}

Vector3d Equations::velocity_W_mps(const double* y) const {
  return {y[contact_start_ + 1], y[contact_start_ + 2], y[contact_start_ + 3]};
}

Vector3d Equations::slip_W_mps(const double* y) const {
  const Vector3d omega_W = rotation_B_to_W(y + kQ) * Vector3d(y[kOmega], y[kOmega + 1], y[kOmega + 2]);
  return velocity_W_mps(y) - omega_W.cross(Vector3d(0, 0, body.radius_m));
}

PerMass Equations::needed_torques(const double* y, const MotionOf<double>& motion, const MassPoint& masses) const {
  PerMass torque{};
  generalised_forces(body, y + kOmega, masses.position.data(), masses.velocity.data(), masses.acceleration.data(),
                     motion, torque.data());
  for (std::size_t i = 0; i < mass_count(); ++i) {
    torque[i] = body.trajectory[i].empty() ? torque[i] / motors.stepper(i).motor().shaft_ratio : 0;
  }
  return torque;
}

Dynamics::Dynamics(const PlantModel& model) : equations(model) {
  const InitialState& initial = model.initial;
  State& y = now.y;
  y[kQ] = initial.orientation.w();
  for (int j = 0; j < 3; ++j) {
    y[kQ + 1 + j] = initial.orientation.vec()[j];
    y[kOmega + j] = initial.angular_velocity_B_radps[j];
  }
  y[kZ] = initial.position_W_m[0];
  y[kZ + 1] = initial.position_W_m[1];
  stand_at(y);
  const std::size_t n = model.masses.size();
  for (std::size_t i = 0; i < n && equations.driven(); ++i) {
    y[kTheta + i] = model.masses[i].initial_position;
    y[kTheta + n + i] = model.masses[i].initial_velocity;
  }
}

void Dynamics::stand_at(const State& y) {
  equations.floor.stand_at(place_W_m(y));
  equations.lay_floor();
}

}  // namespace ballast::sim
