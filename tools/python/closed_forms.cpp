// The closed forms over arrays, for Python. Each function returns a tuple of arrays, which the package names; with
// `jac` two tuples, values and derivatives. Derivatives have one axis more, with a column per variable: the state's
// own, then the positions of all masses, their velocities and their accelerations.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "firmware/model/rolling.h"
#include "sim/closed_forms/detached.h"
#include "sim/closed_forms/rolling_disk.h"
#include "tools/program/params.h"
#include "tools/python/arguments.h"
#include "tools/tracking/rolling_model.h"

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

  // The variables that the forms are differentiated by.
  [[nodiscard]] int columns() const { return 6 + 3 * masses_.count; }

  // visit(row, params, q, Omega, motion of the masses) for each row.
  template <class Visit>
  void for_each(const Visit& visit) {
    MassMotion motion;
    rows.for_each([&](py::ssize_t row) -> const char* {
      const firmware::Quaternion q(q_[0], q_[1], q_[2], q_[3]);
      if (!(std::fabs(q.squaredNorm() - 1) <= kUnitTolerance))
        return "q is no unit quaternion; allowed: length 1 within 1e-6";
      masses_.read(motion);
      visit(row, *params_, q, firmware::Vector3(omega_[0], omega_[1], omega_[2]), motion);
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

  [[nodiscard]] int columns() const { return 2 + 3 * masses_.count; }

  // visit(row, params, state of the disk, motion of the masses) for each row.
  template <class Visit>
  void for_each(const Visit& visit) {
    MassMotion motion;
    rows.for_each([&](py::ssize_t row) -> const char* {
      masses_.read(motion);
      visit(row, *params_, closed_forms::DiskState{phi_[0], phidot_[0]}, motion);
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

// The arrays that a closed form gives, one for each of its vectors or numbers, with so many components, or kScalar.
template <int... kSizes>
class Outputs {
 public:
  // `columns`: of derivatives; 0 for values.
  Outputs(const Rows& rows, int columns) : columns_(std::max(columns, 1)) {
    for (std::size_t i = 0; i < kCount; ++i) {
      Shape per_row;
      if (kSize[i] != kScalar) per_row.push_back(kSize[i]);
      if (columns > 0) per_row.push_back(columns);
      arrays_[i] = rows.output(per_row);
      data_[i] = arrays_[i].mutable_data();
    }
  }

  // Sets a column of a row, or with kOnlyColumn the values. `numbers` has the components of all arrays in turn.
  template <bool kOnlyColumn = false, std::size_t size>
  void put(py::ssize_t row, int column, const std::array<double, size>& numbers) {
    const py::ssize_t columns = kOnlyColumn ? 1 : columns_;
    std::size_t next = 0;
    for (std::size_t i = 0; i < kCount; ++i) {
      const int components = kSize[i] == kScalar ? 1 : kSize[i];
      double* at = data_[i] + row * components * columns + column;
      for (int k = 0; k < components; ++k, at += columns) *at = numbers[next++];
    }
  }

  [[nodiscard]] py::tuple arrays() const {
    py::tuple out(kCount);
    for (std::size_t i = 0; i < kCount; ++i) out[i] = arrays_[i];
    return out;
  }

 private:
  static constexpr std::size_t kCount = sizeof...(kSizes);
  static constexpr std::array<int, kCount> kSize{kSizes...};
  std::array<Array, kCount> arrays_;
  std::array<double*, kCount> data_{};
  int columns_;
};

// Evaluates form(...) and, with `jac`, derive(...) at each row; numbers(...) has the components for Outputs<kSizes...>.
template <int... kSizes, class States, class Form, class Derive, class Numbers>
py::tuple evaluated(States& states, bool jac, const Form& form, const Derive& derive, const Numbers& numbers) {
  Outputs<kSizes...> values(states.rows, 0);
  std::optional<Outputs<kSizes...>> derivatives;
  if (jac) derivatives.emplace(states.rows, states.columns());
  states.for_each([&](py::ssize_t row, const auto&... state) {
    values.template put<true>(row, 0, numbers(form(state...)));
    if (!derivatives) return;
    const auto derivative = derive(state...);
    for (int k = 0; k < derivative.columns; ++k)
      derivatives->put(row, k, numbers(derivative.by[static_cast<std::size_t>(k)]));
  });
  if (!derivatives) return values.arrays();
  return py::make_tuple(values.arrays(), derivatives->arrays());
}

// The planner's derivatives, in the columns of this file. That of f_s is NaN where f_s = 0.
closed_forms::Derivative<firmware::RollingForces> rolling_forces_derivative(const plan::Robot& robot,
                                                                            const firmware::Quaternion& q,
                                                                            const firmware::Vector3& omega,
                                                                            const MassMotion& masses) {
  const plan::RollingState state{.q = {q.w(), q.x(), q.y(), q.z()},
                                 .omega_B = {omega[0], omega[1], omega[2]},
                                 .position = masses.position,
                                 .velocity = masses.velocity,
                                 .acceleration = masses.acceleration};
  plan::RollingValue value{};
  plan::RollingDerivative by{};
  plan::differentiate_rolling(robot, state, false, value, by);
  const double size = std::hypot(value.force_n[0], value.force_n[1]);
  closed_forms::Derivative<firmware::RollingForces> out;
  const auto put = [&](int column) {
    const auto k = static_cast<std::size_t>(column);
    const plan::Vec& turning = by.omega_dot_B[k];
    const double force1 = by.force_n[0][k], force2 = by.force_n[1][k];
    out.by[static_cast<std::size_t>(out.columns++)] = {firmware::Vector3(turning.x, turning.y, turning.z),
                                                       by.normal_n[k], firmware::Vector2(force1, force2),
                                                       (value.force_n[0] * force1 + value.force_n[1] * force2) / size};
  };
  for (int k = 0; k < plan::kStateColumns; ++k) put(k);
  for (int coordinate = 0; coordinate < 3; ++coordinate) {
    for (int i = 0; i < robot.ball.mass_count; ++i) put(plan::kStateColumns + 3 * i + coordinate);
  }
  return out;
}

py::tuple rolling_forces(const Ball& ball, const py::object& q, const py::object& omega, const py::object& theta,
                         const py::object& thetadot, const py::object& thetaddot, bool jac) {
  BallStates states(ball, q, omega, theta, thetadot, thetaddot);
  const plan::Robot robot{*ball.params, {}};
  const auto derive = [&](const BallParams&, const auto&... state) {
    return rolling_forces_derivative(robot, state...);
  };
  return evaluated<3, kScalar, 2, kScalar>(states, jac, firmware::rolling_forces, derive,
                                           [](const firmware::RollingForces& f) {
                                             const auto& turning = f.angular_acceleration_B_radps2;
                                             return std::array{turning[0],
                                                               turning[1],
                                                               turning[2],
                                                               f.normal_force_n,
                                                               f.friction_force_W_n[0],
                                                               f.friction_force_W_n[1],
                                                               f.static_friction_n};
                                           });
}

py::tuple detached_motion(const Ball& ball, const py::object& q, const py::object& omega, const py::object& theta,
                          const py::object& thetadot, const py::object& thetaddot, bool jac) {
  BallStates states(ball, q, omega, theta, thetadot, thetaddot);
  return evaluated<3, 3>(states, jac, closed_forms::detached_motion, closed_forms::detached_motion_derivative,
                         [](const closed_forms::DetachedMotion& m) {
                           const auto &turning = m.angular_acceleration_B_radps2, &moving = m.acceleration_W_mps2;
                           return std::array{turning[0], turning[1], turning[2], moving[0], moving[1], moving[2]};
                         });
}

py::tuple rolling_disk_forces(const Ball& ball, const py::object& phi, const py::object& phidot,
                              const py::object& theta, const py::object& thetadot, const py::object& thetaddot,
                              bool jac) {
  DiskStates states(ball, phi, phidot, theta, thetadot, thetaddot);
  return evaluated<kScalar, kScalar, kScalar, kScalar>(
      states, jac, closed_forms::rolling_disk_forces, closed_forms::rolling_disk_forces_derivative,
      [](const closed_forms::RollingDiskForces& f) {
        return std::array{f.angular_acceleration_radps2, f.normal_force_n, f.friction_force_W1_n, f.static_friction_n};
      });
}

py::tuple detached_disk_motion(const Ball& ball, const py::object& phi, const py::object& phidot,
                               const py::object& theta, const py::object& thetadot, const py::object& thetaddot,
                               bool jac) {
  DiskStates states(ball, phi, phidot, theta, thetadot, thetaddot);
  return evaluated<kScalar, 3>(states, jac, closed_forms::detached_disk_motion,
                               closed_forms::detached_disk_motion_derivative,
                               [](const closed_forms::DetachedDiskMotion& m) {
                                 const auto& moving = m.acceleration_W_mps2;
                                 return std::array{m.angular_acceleration_radps2, moving[0], moving[1], moving[2]};
                               });
}

py::tuple rail(const Ball& ball, int mass, const py::object& theta) {
  const SharedBall params = ball.params;
  if (mass < 0 || mass >= params->mass_count)
    throw py::index_error("mass " + std::to_string(mass) + ": there are " + std::to_string(params->mass_count));
  Argument position("theta", theta, kScalar);
  Rows rows({&position});
  Outputs<3, 3, 3> out(rows, 0);
  rows.for_each([&](py::ssize_t row) -> const char* {
    const auto point = firmware::evaluate<firmware::Real>(params->rail[static_cast<std::size_t>(mass)], position[0]);
    std::array<double, 9> numbers{};
    for (int i = 0; i < 3; ++i) {
      const auto k = static_cast<std::size_t>(i);
      numbers[k] = point.position[i];
      numbers[k + 3] = point.d1[i];
      numbers[k + 6] = point.d2[i];
    }
    out.put<true>(row, 0, numbers);
    return nullptr;
  });
  return out.arrays();
}

py::tuple tuple3(const firmware::Vector3& v) { return py::make_tuple(v[0], v[1], v[2]); }

}  // namespace

void add_closed_forms(py::module_& module) {
  py::class_<Ball> ball(module, "Ball");
  share_copies(ball);
  ball.def(py::init(&ball_of), py::arg("scenario"), py::arg("believed"))
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
               py::arg("thetaddot"), py::arg("jac"));
  }
  for (const auto& [name, function] :
       {std::pair{"rolling_disk_forces", &rolling_disk_forces}, {"detached_disk_motion", &detached_disk_motion}}) {
    module.def(name, function, py::arg("ball"), py::arg("phi"), py::arg("phidot"), py::arg("theta"),
               py::arg("thetadot"), py::arg("thetaddot"), py::arg("jac"));
  }
}

}  // namespace ballast::python
