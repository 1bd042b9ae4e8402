#include "tests/simbody/simbody_ball.h"

#include <Simbody.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace ballast::peer {
namespace {

SimTK::Vec3 vec3(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

// The stretch of time, free of motion borders, that is being integrated. A motion takes its piece from a time inside it
// and so is smooth up to both ends of the stretch.
struct Stretch {
  double inside_s = 0;
};

// theta'' goes linearly along each piece; behind the last one it is 0.
class RailMotion : public SimTK::Motion::Custom::Implementation {
 public:
  RailMotion(const Robot::Mass& mass, const Stretch& stretch) : stretch_(stretch) {
    Cubic c{0, mass.initial_position, mass.initial_velocity, 0, 0};
    for (const Robot::Piece& piece : mass.motion) {
      const double h = piece.duration_s;
      c.acceleration = piece.acceleration_start;
      c.jerk = (piece.acceleration_end - piece.acceleration_start) / h;
      cubics_.push_back(c);
      c = {c.start_s + h, c.at(c.start_s + h), c.rate_at(c.start_s + h), 0, 0};
    }
    cubics_.push_back(c);
  }

  [[nodiscard]] std::vector<double> borders_s() const {
    std::vector<double> borders;
    for (std::size_t i = 1; i < cubics_.size(); ++i) borders.push_back(cubics_[i].start_s);
    return borders;
  }

  RailMotion* clone() const override { return new RailMotion(*this); }
  SimTK::Motion::Level getLevel(const SimTK::State&) const override { return SimTK::Motion::Position; }
  void calcPrescribedPosition(const SimTK::State& state, int, double* q) const override {
    *q = cubic().at(state.getTime());
  }
  void calcPrescribedPositionDot(const SimTK::State& state, int, double* qdot) const override {
    *qdot = cubic().rate_at(state.getTime());
  }
  void calcPrescribedPositionDotDot(const SimTK::State& state, int, double* qdotdot) const override {
    *qdotdot = cubic().acceleration + (state.getTime() - cubic().start_s) * cubic().jerk;
  }

 private:
  struct Cubic {
    double start_s, position, velocity, acceleration, jerk;
    [[nodiscard]] double at(double time_s) const {
      const double s = time_s - start_s;
      return position + s * (velocity + s * (acceleration / 2 + s * jerk / 6));
    }
    [[nodiscard]] double rate_at(double time_s) const {
      const double s = time_s - start_s;
      return velocity + s * (acceleration + s * jerk / 2);
    }
  };

  [[nodiscard]] const Cubic& cubic() const {
    std::size_t i = cubics_.size() - 1;
    while (i > 0 && cubics_[i].start_s > stretch_.inside_s) --i;
    return cubics_[i];
  }

  const Stretch& stretch_;
  std::vector<Cubic> cubics_;
};

// The external force on the geometric centre: constant or a table, and drag.
class CenterForce : public SimTK::Force::Custom::Implementation {
 public:
  CenterForce(const Robot& s, const SimTK::MobilizedBody& ball)
      : ball_(ball),
        constant_(vec3(s.force_W_n)),
        times_s_(s.force_times_s),
        drag_kgpm_(s.drag_kgpm),
        wind_(vec3(s.wind_W_mps)) {
    for (const Eigen::Vector3d& force : s.forces_W_n) forces_.push_back(vec3(force));
  }

  void calcForce(const SimTK::State& state, SimTK::Vector_<SimTK::SpatialVec>& body_forces,
                 SimTK::Vector_<SimTK::Vec3>&, SimTK::Vector&) const override {
    const SimTK::Vec3 relative = ball_.getBodyOriginVelocity(state) - wind_;
    const SimTK::Vec3 force = of_time(state.getTime()) - drag_kgpm_ * relative.norm() * relative;
    ball_.applyForceToBodyPoint(state, SimTK::Vec3(0), force, body_forces);
  }
  double calcPotentialEnergy(const SimTK::State&) const override { return 0; }  // only reports would use it

 private:
  [[nodiscard]] SimTK::Vec3 of_time(double time_s) const {
    if (times_s_.empty()) return constant_;
    if (time_s <= times_s_.front()) return forces_.front();
    for (std::size_t i = 1; i < times_s_.size(); ++i) {
      const double part = (time_s - times_s_[i - 1]) / (times_s_[i] - times_s_[i - 1]);
      if (part <= 1) return (1 - part) * forces_[i - 1] + part * forces_[i];
    }
    return forces_.back();
  }

  const SimTK::MobilizedBody& ball_;
  SimTK::Vec3 constant_;
  std::vector<double> times_s_;
  std::vector<SimTK::Vec3> forces_;
  double drag_kgpm_;
  SimTK::Vec3 wind_;
};

// The joint's frame in the shell: x and y span the circle, or x points along the line.
SimTK::Transform joint_frame(const Robot::Mass& mass) {
  const SimTK::UnitVec3 x(vec3(mass.axis_cos_B));
  if (!mass.on_circle) return {SimTK::Rotation(x, SimTK::XAxis), vec3(mass.origin_B_m)};
  return {SimTK::Rotation(x, SimTK::XAxis, vec3(mass.axis_sin_B), SimTK::YAxis), vec3(mass.origin_B_m)};
}

SimTK::MassProperties point_mass(double mass_kg, const SimTK::Vec3& where) {
  return {mass_kg, where, SimTK::Inertia::pointMassAt(where, mass_kg)};
}

SimTK::MassProperties shell(const Robot& robot) {
  const SimTK::Inertia about_own_center(vec3(robot.inertia_kgm2));
  const SimTK::Vec3 com = vec3(robot.center_of_mass_B_m);
  return {robot.shell_mass_kg, com, about_own_center.shiftFromMassCenter(-com, robot.shell_mass_kg)};
}

}  // namespace

class SimbodyBall::Snapshot {
 public:
  SimTK::State state;
};

struct SimbodyBall::Model {
  SimTK::MultibodySystem system;
  SimTK::SimbodyMatterSubsystem matter{system};
  SimTK::GeneralForceSubsystem forces{system};
  SimTK::MobilizedBody::Free ball;
  SimTK::Constraint::SphereOnPlaneContact contact;
  std::vector<SimTK::MobilizedBody> masses;
  Stretch stretch;
  std::vector<double> borders_s;  // of motion pieces and the force's table; increasing, the last one infinite
  std::unique_ptr<SimTK::RungeKuttaMersonIntegrator> integrator;

  explicit Model(const Robot& s)
      : ball(matter.Ground(), SimTK::Transform(), SimTK::Body::Rigid(shell(s)), SimTK::Transform()),
        contact(matter.updGround(), SimTK::Transform(SimTK::Vec3(0, 0, -s.radius_m)), ball, SimTK::Vec3(0), s.radius_m,
                true) {
    // The system owns what the handles of forces and motions stand for.
    const SimTK::Force::UniformGravity gravity(forces, matter, SimTK::Vec3(0, 0, -s.gravity_mps2));
    const SimTK::Force::Custom center_force(forces, new CenterForce(s, ball));
    borders_s = s.force_times_s;
    for (const Robot::Mass& mass : s.masses) {
      if (mass.on_circle) {
        const SimTK::Body::Rigid body(point_mass(mass.mass_kg, SimTK::Vec3(mass.circle_radius_m, 0, 0)));
        masses.push_back(SimTK::MobilizedBody::Pin(ball, joint_frame(mass), body, SimTK::Transform()));
      } else {
        const SimTK::Body::Rigid body(point_mass(mass.mass_kg, SimTK::Vec3(0)));
        masses.push_back(SimTK::MobilizedBody::Slider(ball, joint_frame(mass), body, SimTK::Transform()));
      }
      auto motion = std::make_unique<RailMotion>(mass, stretch);
      for (const double border : motion->borders_s()) borders_s.push_back(border);
      const SimTK::Motion::Custom prescribed(masses.back(), motion.release());
    }
    borders_s.push_back(std::numeric_limits<double>::infinity());
    std::sort(borders_s.begin(), borders_s.end());
  }

  [[nodiscard]] double next_border_s(double time_s) const {
    return *std::upper_bound(borders_s.begin(), borders_s.end(), time_s);
  }

  // The cache of `last` belongs to the stretch before. `last` may be the integrator's own state, which initialize()
  // overwrites, so a copy is taken.
  void start_stretch(const SimTK::State& last) {
    const SimTK::State state = last;  // NOLINT(performance-unnecessary-copy-initialization)
    const double start = state.getTime(), end = next_border_s(start);
    stretch.inside_s = std::isfinite(end) ? (start + end) / 2 : start + 1;
    state.invalidateAllCacheAtOrAbove(SimTK::Stage::Time);
    integrator->initialize(state);
  }
};

SimbodyBall::SimbodyBall(const Robot& robot, double accuracy) : model_(std::make_unique<Model>(robot)) {
  Model& m = *model_;
  SimTK::State state = m.system.realizeTopology();
  const Eigen::Quaterniond& q = robot.orientation;
  const Eigen::Vector3d omega_W = q * robot.angular_velocity_B_radps;
  const Eigen::Vector3d velocity_W = omega_W.cross(Eigen::Vector3d(0, 0, robot.radius_m));
  const Eigen::Vector2d& z = robot.position_W_m;
  m.ball.setQToFitRotation(state, SimTK::Rotation(SimTK::Quaternion(q.w(), q.x(), q.y(), q.z())));
  m.ball.setQToFitTranslation(state, SimTK::Vec3(z[0], z[1], 0));
  m.ball.setUToFitAngularVelocity(state, vec3(omega_W));
  m.ball.setUToFitLinearVelocity(state, vec3(velocity_W));

  m.integrator = std::make_unique<SimTK::RungeKuttaMersonIntegrator>(m.system);
  m.integrator->setAccuracy(accuracy);
  m.integrator->setAllowInterpolation(false);
  m.start_stretch(state);
}

SimbodyBall::~SimbodyBall() = default;

double SimbodyBall::time_s() const { return model_->integrator->getTime(); }

void SimbodyBall::advance(double end_s) {
  Model& m = *model_;
  while (time_s() < end_s) {
    const double border_s = m.next_border_s(time_s()), target_s = std::min(end_s, border_s);
    while (time_s() < target_s) m.integrator->stepTo(target_s);
    if (target_s == border_s) m.start_stretch(m.integrator->getState());
  }
}

SimbodyBall::Sample SimbodyBall::sample() const {
  const Model& m = *model_;
  const SimTK::State& state = m.integrator->getState();
  m.system.realize(state, SimTK::Stage::Acceleration);
  Sample s;
  const SimTK::Rotation& rotation = m.ball.getBodyRotation(state);
  const SimTK::Quaternion q = rotation.convertRotationToQuaternion();
  const SimTK::Vec3 omega_B = ~rotation * m.ball.getBodyAngularVelocity(state);
  const SimTK::Vec3& z = m.ball.getBodyOriginLocation(state);
  const SimTK::Vec3 force_W = m.contact.findForceOnSphereInG(state);
  s.orientation = {q[0], q[1], q[2], q[3]};
  s.angular_velocity_B_radps = {omega_B[0], omega_B[1], omega_B[2]};
  s.position_W_m = {z[0], z[1], z[2]};
  s.normal_force_n = force_W[2];
  s.friction_force_W_n = {force_W[0], force_W[1]};
  for (std::size_t i = 0; i < m.masses.size(); ++i) {
    s.mass_position[i] = m.masses[i].getOneQ(state, 0);
    s.mass_velocity[i] = m.masses[i].getOneU(state, 0);
  }
  return s;
}

std::shared_ptr<const SimbodyBall::Snapshot> SimbodyBall::snapshot() const {
  auto snapshot = std::make_shared<Snapshot>();
  snapshot->state = model_->integrator->getState();
  return snapshot;
}

void SimbodyBall::restore(const Snapshot& snapshot) { model_->start_stretch(snapshot.state); }

}  // namespace ballast::peer
