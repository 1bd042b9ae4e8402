#include "tests/physics/trajectory_run.h"

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <vector>

#include "firmware/motion/profile.h"
#include "sim/cubic_spline.h"
#include "tools/program/params.h"

namespace ballast::test {

using Eigen::Vector3d;

firmware::BallParams ball_on_rails(const sim::Scenario& scenario) {
  const auto params = std::make_unique<firmware::ControllerParams>();
  // The controller refuses trajectories; the model's closed forms do not.
  sim::Scenario on_rails = scenario;
  for (auto& mass : on_rails.masses) mass.trajectory = {};
  if (const auto refusal = program::to_controller_params(on_rails, *params)) throw std::runtime_error(*refusal);
  return params->ball;
}

struct TrajectoryRun::Impl {
  firmware::BallParams ball;
  std::vector<firmware::Profile> profiles;
  std::vector<sim::CubicSpline> trajectories;  // per mass; empty where it is on its rail
  bool on_trajectories = false;
  sim::Scenario::ForceTable table;
  sim::Scenario::Drag drag;
  std::vector<double> knots;
  double time_s = 0;
  double side_s = 0;  // a time inside the smooth stretch being integrated, to choose the side of a jump
  SUNContext context = nullptr;
  N_Vector y = nullptr;
  void* cvode = nullptr;
  SUNNonlinearSolver solver = nullptr;

  firmware::MassMotion masses(double t, double side) const {
    firmware::MassMotion m;
    for (std::size_t i = 0; i < profiles.size(); ++i) {
      const auto& cubic = profiles[i].cubic(profiles[i].locate(side).index);
      const double s = t - profiles[i].cubic_start_s(profiles[i].locate(side).index);
      m.position[i] = cubic.position + s * (cubic.velocity + s * (cubic.acceleration / 2 + s * cubic.jerk / 6));
      m.velocity[i] = cubic.velocity + s * (cubic.acceleration + s * cubic.jerk / 2);
      m.acceleration[i] = cubic.acceleration + s * cubic.jerk;
    }
    return m;
  }

  // What the closed forms take as constant, at this instant.
  Vector3d force_W(double t, const Vector3d& velocity) const {
    Vector3d force = ball.external_force_W_n;
    const auto& times = table.times_s;
    if (!times.empty()) {
      force = t <= times.front() ? table.forces_W_n.front() : table.forces_W_n.back();
      for (std::size_t i = 1; i < times.size(); ++i) {
        if (t < times[i - 1] || t > times[i]) continue;
        const double part = (t - times[i - 1]) / (times[i] - times[i - 1]);
        force = (1 - part) * table.forces_W_n[i - 1] + part * table.forces_W_n[i];
      }
    }
    const Vector3d relative = velocity - drag.wind_W_mps;
    return force - drag.coefficient_kgpm * relative.norm() * relative;
  }

  firmware::RollingForces forces(double t, const double* v, double side) const {
    firmware::Quaternion q(v[0], v[1], v[2], v[3]);
    q.normalize();
    const Vector3d w(v[4], v[5], v[6]);
    firmware::BallParams now = ball;
    now.external_force_W_n = force_W(t, (q * w).cross(Vector3d(0, 0, ball.radius_m)));
    if (!on_trajectories) return firmware::rolling_forces(now, q, w, masses(t, side));
    firmware::MassTrajectories all = firmware::along_rails(now, masses(t, side));
    for (std::size_t i = 0; i < trajectories.size(); ++i) {
      if (trajectories[i].empty()) continue;
      const auto chi = trajectories[i].at(t);
      all.position_B_m[i] = chi.position, all.velocity_B_mps[i] = chi.d1, all.acceleration_B_mps2[i] = chi.d2;
    }
    return firmware::rolling_forces_3d(now, q, w, all);
  }

  static int derivative(double t, N_Vector y, N_Vector ydot, void* self) {
    const auto& run = *static_cast<const Impl*>(self);
    const double* v = NV_DATA_S(y);
    double* d = NV_DATA_S(ydot);
    const Eigen::Quaterniond q(v[0], v[1], v[2], v[3]);
    const Vector3d w(v[4], v[5], v[6]);
    const Eigen::Quaterniond dq = q * Eigen::Quaterniond(0, w[0] / 2, w[1] / 2, w[2] / 2);
    d[0] = dq.w(), d[1] = dq.x(), d[2] = dq.y(), d[3] = dq.z();
    const Vector3d acceleration = run.forces(t, v, run.side_s).angular_acceleration_B_radps2;
    for (int j = 0; j < 3; ++j) d[4 + j] = acceleration[j];
    const Vector3d velocity = (q.normalized() * w).cross(Vector3d(0, 0, run.ball.radius_m));
    d[7] = velocity[0], d[8] = velocity[1];
    return 0;
  }
};

TrajectoryRun::TrajectoryRun(const sim::Scenario& scenario) : impl_(new Impl) {
  impl_->ball = ball_on_rails(scenario);
  impl_->table = scenario.force_table;
  impl_->drag = scenario.drag;
  impl_->knots = scenario.force_table.times_s;
  for (const auto& mass : scenario.masses) {
    std::vector<firmware::ProfilePiece> pieces;
    for (const auto& piece : mass.motion) {
      pieces.push_back({piece.duration_s, piece.acceleration_start, piece.acceleration_end});
    }
    firmware::Profile profile;
    if (!profile.set(mass.initial_position, mass.initial_velocity, pieces.data(), static_cast<int>(pieces.size()))) {
      throw std::runtime_error("a profile was refused");
    }
    for (int p = 1; p <= profile.piece_count(); ++p) impl_->knots.push_back(profile.cubic_start_s(p));
    impl_->profiles.push_back(profile);
    const auto& table = mass.trajectory;
    impl_->trajectories.emplace_back();
    if (table.times_s.empty()) continue;
    impl_->on_trajectories = true;
    impl_->trajectories.back() = table.periodic ? sim::CubicSpline::closed(table.times_s, table.points_B_m)
                                                : sim::CubicSpline::open(table.times_s, table.points_B_m);
    const double period_s = table.times_s.back() - table.times_s.front();
    const int repeats = table.periodic ? static_cast<int>(scenario.duration_s / period_s) + 2 : 0;
    for (int k = -repeats; k <= repeats; ++k) {
      for (const double time : table.times_s) {
        if (time + k * period_s > 0) impl_->knots.push_back(time + k * period_s);
      }
    }
  }
  // CVODE cannot start for less than rounding: where a period ends and the next begins.
  std::sort(impl_->knots.begin(), impl_->knots.end());
  const auto same = [](double a, double b) { return b - a < 1e-12; };
  impl_->knots.erase(std::unique(impl_->knots.begin(), impl_->knots.end(), same), impl_->knots.end());

  if (SUNContext_Create(nullptr, &impl_->context) != 0) throw std::runtime_error("SUNDIALS context");
  impl_->y = N_VNew_Serial(9, impl_->context);
  double* v = NV_DATA_S(impl_->y);
  const auto& q = scenario.initial.orientation;
  v[0] = q.w(), v[1] = q.x(), v[2] = q.y(), v[3] = q.z();
  for (int j = 0; j < 3; ++j) v[4 + j] = scenario.initial.angular_velocity_B_radps[j];
  v[7] = scenario.initial.position_W_m[0], v[8] = scenario.initial.position_W_m[1];
  impl_->cvode = CVodeCreate(CV_ADAMS, impl_->context);
  CVodeInit(impl_->cvode, &Impl::derivative, 0, impl_->y);
  CVodeSStolerances(impl_->cvode, 1e-13, 1e-14);
  impl_->solver = SUNNonlinSol_FixedPoint(impl_->y, 0, impl_->context);
  CVodeSetNonlinearSolver(impl_->cvode, impl_->solver);
  CVodeSetUserData(impl_->cvode, impl_);
  CVodeSetMaxNumSteps(impl_->cvode, 10'000'000);
}

TrajectoryRun::~TrajectoryRun() {
  CVodeFree(&impl_->cvode);
  SUNNonlinSolFree(impl_->solver);
  N_VDestroy(impl_->y);
  SUNContext_Free(&impl_->context);
  delete impl_;
}

bool TrajectoryRun::advance(double time_s) {
  while (impl_->time_s < time_s) {
    const auto knot = std::upper_bound(impl_->knots.begin(), impl_->knots.end(), impl_->time_s);
    const double target = knot == impl_->knots.end() ? time_s : std::min(time_s, *knot);
    impl_->side_s = (impl_->time_s + target) / 2;
    if (CVodeReInit(impl_->cvode, impl_->time_s, impl_->y) != CV_SUCCESS) return false;
    CVodeSetStopTime(impl_->cvode, target);
    if (CVode(impl_->cvode, target, impl_->y, &impl_->time_s, CV_NORMAL) < 0) return false;
    impl_->time_s = target;
  }
  return true;
}

Eigen::Vector4d TrajectoryRun::orientation() const {
  const double* v = NV_DATA_S(impl_->y);
  return Eigen::Vector4d(v[0], v[1], v[2], v[3]).normalized();
}
Eigen::Vector3d TrajectoryRun::angular_velocity_B() const {
  const double* v = NV_DATA_S(impl_->y);
  return {v[4], v[5], v[6]};
}
Eigen::Vector2d TrajectoryRun::position_W() const {
  const double* v = NV_DATA_S(impl_->y);
  return {v[7], v[8]};
}
firmware::RollingForces TrajectoryRun::forces() const {
  return impl_->forces(impl_->time_s, NV_DATA_S(impl_->y), impl_->time_s);
}

}  // namespace ballast::test
