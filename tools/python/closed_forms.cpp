// The closed forms over arrays, for Python. Each function returns a tuple of arrays, which the package names.
#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "firmware/model/rolling.h"
#include "sim/closed_forms/detached.h"
#include "sim/closed_forms/rolling_disk.h"
#include "tools/program/params.h"
#include "tools/python/arguments.h"

namespace ballast::python {
namespace {

using firmware::BallParams;
using firmware::MassMotion;

// The parameters never change, so threads may share a ball.
using SharedBall = std::shared_ptr<const BallParams>;
struct Ball {
  SharedBall params;
};

Ball ball_of(const CheckedScenario& checked, bool believed) {
  auto params = std::make_shared<BallParams>();
  const sim::World& world = believed ? checked.scenario.belief() : checked.scenario;
  if (const auto refusal = program::to_ball_params(world, *params))
    raise({{checked.scenario.name, 0, "", "", *refusal}});
  return {std::move(params)};
}

// Tolerance on the squared length of a unit quaternion: a scenario allows 1e-6 for the length.
constexpr double kUnitTolerance = 2e-6;
// Axes of rails are normalised, so that a component 0 may be rounding.
constexpr double kInPlane = 1e-12;

constexpr int kScalar = Argument::kScalar;

struct Masses {
  Masses(const BallParams& ball, const py::object& theta, const py::object& rate, const py::object& change)
      : count(ball.mass_count),
        position("theta", theta, count),
        velocity("thetadot", rate, count),
        acceleration("thetaddot", change, count) {}

  void read(MassMotion& out) const {
    for (int i = 0; i < count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      out.position[k] = position[i];
      out.velocity[k] = velocity[i];
      out.acceleration[k] = acceleration[i];
    }
  }

  int count;
  Argument position, velocity, acceleration;
};

// The arguments of the ball's closed forms, and the state in their present row.
class BallStates {
 public:
  BallStates(const Ball& ball, const py::object& q, const py::object& omega, const py::object& theta,
             const py::object& thetadot, const py::object& thetaddot)
      : params_(ball.params),
        q_("q", q, 4),
        omega_("Omega", omega, 3),
        masses_(*params_, theta, thetadot, thetaddot),
        rows({&q_, &omega_, &masses_.position, &masses_.velocity, &masses_.acceleration}) {}

  // form(params, q, Omega, motion of the masses) for each row; put(row, result).
  template <class Form, class Put>
  void evaluate(const Form& form, const Put& put) {
    MassMotion motion;
    rows.for_each([&](py::ssize_t row) -> const char* {
      const firmware::Quaternion q(q_[0], q_[1], q_[2], q_[3]);
      if (!(std::fabs(q.squaredNorm() - 1) <= kUnitTolerance))
        return "q is no unit quaternion; allowed: length 1 within 1e-6";
      masses_.read(motion);
      put(row, form(*params_, q, firmware::Vector3(omega_[0], omega_[1], omega_[2]), motion));
      return nullptr;
    });
  }

 private:
  SharedBall params_;
  Argument q_, omega_;
  Masses masses_;

 public:
  Rows rows;
};

// Why the disk's closed forms do not hold for this ball; empty: they do.
std::string disk_refusal(const BallParams& ball) {
  const auto in_plane = [](const firmware::Vector3& v) { return std::fabs(v[1]) <= kInPlane * (1 + v.norm()); };
  if (!in_plane(ball.center_of_mass_B_m) || !in_plane(ball.external_force_W_n))
    return "center_of_mass and external_force have a part along axis 2; allowed: in the plane of axes 1 and 3";
  if (ball.down_W[2] != -1 || ball.rolling_resistance != 0 || ball.spin_friction_m != 0)
    return "the floor slopes or resists; allowed: a level floor without resistance";
  for (int i = 0; i < ball.mass_count; ++i) {
    const firmware::Rail& rail = ball.rail[static_cast<std::size_t>(i)];
    bool flat = rail.shape == firmware::RailShape::kSpline || (in_plane(rail.origin_B_m) && in_plane(rail.axis_cos_B));
    if (rail.shape == firmware::RailShape::kCircle) flat = flat && in_plane(rail.axis_sin_B);
    for (int k = 0; rail.shape == firmware::RailShape::kSpline && k <= rail.piece_count; ++k)
      flat = flat && in_plane(rail.knots[static_cast<std::size_t>(k)].position_B_m);
    if (!flat) return fmt::format("mass {} leaves the plane of axes 1 and 3; allowed: rails in that plane", i);
  }
  return "";
}

class DiskStates {
 public:
  DiskStates(const Ball& ball, const py::object& phi, const py::object& phidot, const py::object& theta,
             const py::object& thetadot, const py::object& thetaddot)
      : params_(ball.params),
        phi_("phi", phi, kScalar),
        phidot_("phidot", phidot, kScalar),
        masses_(*params_, theta, thetadot, thetaddot),
        rows({&phi_, &phidot_, &masses_.position, &masses_.velocity, &masses_.acceleration}) {
    if (const std::string why = disk_refusal(*params_); !why.empty()) throw py::value_error("ball: no disk: " + why);
  }

  template <class Form, class Put>
  void evaluate(const Form& form, const Put& put) {
    MassMotion motion;
    rows.for_each([&](py::ssize_t row) -> const char* {
      masses_.read(motion);
      put(row, form(*params_, closed_forms::DiskState{phi_[0], phidot_[0]}, motion));
      return nullptr;
    });
  }

 private:
  SharedBall params_;
  Argument phi_, phidot_;
  Masses masses_;

 public:
  Rows rows;
};

// A result of the closed forms: an array, and where its rows go.
class Output {
 public:
  Output(const Rows& rows, int width) : array_(rows.output(width)), data_(array_.mutable_data()) {}
  void put(py::ssize_t row, double value) { data_[row] = value; }
  template <class Vector>
  void put(py::ssize_t row, const Vector& value) {
    for (int i = 0; i < value.size(); ++i) data_[row * value.size() + i] = value[i];
  }
  [[nodiscard]] const Array& array() const { return array_; }

 private:
  Array array_;
  double* data_;
};

py::tuple rolling_forces(const Ball& ball, const py::object& q, const py::object& omega, const py::object& theta,
                         const py::object& thetadot, const py::object& thetaddot) {
  BallStates states(ball, q, omega, theta, thetadot, thetaddot);
  Output turning(states.rows, 3), normal(states.rows, kScalar), friction(states.rows, 2), size(states.rows, kScalar);
  states.evaluate(firmware::rolling_forces, [&](py::ssize_t row, const firmware::RollingForces& forces) {
    turning.put(row, forces.angular_acceleration_B_radps2);
    normal.put(row, forces.normal_force_n);
    friction.put(row, forces.friction_force_W_n);
    size.put(row, forces.static_friction_n);
  });
  return py::make_tuple(turning.array(), normal.array(), friction.array(), size.array());
}

py::tuple detached_motion(const Ball& ball, const py::object& q, const py::object& omega, const py::object& theta,
                          const py::object& thetadot, const py::object& thetaddot) {
  BallStates states(ball, q, omega, theta, thetadot, thetaddot);
  Output turning(states.rows, 3), moving(states.rows, 3);
  states.evaluate(closed_forms::detached_motion, [&](py::ssize_t row, const closed_forms::DetachedMotion& motion) {
    turning.put(row, motion.angular_acceleration_B_radps2);
    moving.put(row, motion.acceleration_W_mps2);
  });
  return py::make_tuple(turning.array(), moving.array());
}

py::tuple rolling_disk_forces(const Ball& ball, const py::object& phi, const py::object& phidot,
                              const py::object& theta, const py::object& thetadot, const py::object& thetaddot) {
  DiskStates states(ball, phi, phidot, theta, thetadot, thetaddot);
  Output turning(states.rows, kScalar), normal(states.rows, kScalar), friction(states.rows, kScalar),
      size(states.rows, kScalar);
  states.evaluate(closed_forms::rolling_disk_forces,
                  [&](py::ssize_t row, const closed_forms::RollingDiskForces& forces) {
                    turning.put(row, forces.angular_acceleration_radps2);
                    normal.put(row, forces.normal_force_n);
                    friction.put(row, forces.friction_force_W1_n);
                    size.put(row, forces.static_friction_n);
                  });
  return py::make_tuple(turning.array(), normal.array(), friction.array(), size.array());
}

py::tuple detached_disk_motion(const Ball& ball, const py::object& phi, const py::object& phidot,
                               const py::object& theta, const py::object& thetadot, const py::object& thetaddot) {
  DiskStates states(ball, phi, phidot, theta, thetadot, thetaddot);
  Output turning(states.rows, kScalar), moving(states.rows, 3);
  states.evaluate(closed_forms::detached_disk_motion,
                  [&](py::ssize_t row, const closed_forms::DetachedDiskMotion& motion) {
                    turning.put(row, motion.angular_acceleration_radps2);
                    moving.put(row, motion.acceleration_W_mps2);
                  });
  return py::make_tuple(turning.array(), moving.array());
}

py::tuple rail(const Ball& ball, int mass, const py::object& theta) {
  const SharedBall params = ball.params;
  if (mass < 0 || mass >= params->mass_count)
    throw py::index_error("mass " + std::to_string(mass) + ": there are " + std::to_string(params->mass_count));
  Argument position("theta", theta, kScalar);
  Rows rows({&position});
  Output zeta(rows, 3), d1(rows, 3), d2(rows, 3);
  rows.for_each([&](py::ssize_t row) -> const char* {
    const auto point = firmware::evaluate<firmware::Real>(params->rail[static_cast<std::size_t>(mass)], position[0]);
    zeta.put(row, point.position);
    d1.put(row, point.d1);
    d2.put(row, point.d2);
    return nullptr;
  });
  return py::make_tuple(zeta.array(), d1.array(), d2.array());
}

py::tuple tuple3(const firmware::Vector3& v) { return py::make_tuple(v[0], v[1], v[2]); }

}  // namespace

void add_closed_forms(py::module_& module) {
  py::class_<Ball>(module, "Ball")
      .def(py::init(&ball_of), py::arg("scenario"), py::arg("believed"))
      .def_property_readonly("radius_m", [](const Ball& b) { return b.params->radius_m; })
      .def_property_readonly("gravity_mps2", [](const Ball& b) { return b.params->gravity_mps2; })
      .def_property_readonly("shell_mass_kg", [](const Ball& b) { return b.params->shell_mass_kg; })
      .def_property_readonly("inertia_kgm2", [](const Ball& b) { return tuple3(b.params->inertia_kgm2); })
      .def_property_readonly("center_of_mass_B_m", [](const Ball& b) { return tuple3(b.params->center_of_mass_B_m); })
      .def_property_readonly("mass_count", [](const Ball& b) { return b.params->mass_count; })
      .def_property_readonly("mass_kg",
                             [](const Ball& b) {
                               py::tuple masses(b.params->mass_count);
                               for (int i = 0; i < b.params->mass_count; ++i)
                                 masses[static_cast<std::size_t>(i)] = b.params->mass_kg[static_cast<std::size_t>(i)];
                               return masses;
                             })
      .def("rail", &rail, py::arg("mass"), py::arg("theta"));
  for (const auto& [name, function] :
       {std::pair{"rolling_forces", &rolling_forces}, {"detached_motion", &detached_motion}}) {
    module.def(name, function, py::arg("ball"), py::arg("q"), py::arg("Omega"), py::arg("theta"), py::arg("thetadot"),
               py::arg("thetaddot"));
  }
  for (const auto& [name, function] :
       {std::pair{"rolling_disk_forces", &rolling_disk_forces}, {"detached_disk_motion", &detached_disk_motion}}) {
    module.def(name, function, py::arg("ball"), py::arg("phi"), py::arg("phidot"), py::arg("theta"),
               py::arg("thetadot"), py::arg("thetaddot"));
  }
}

}  // namespace ballast::python
