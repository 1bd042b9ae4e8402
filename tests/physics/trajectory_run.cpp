#include "tests/physics/trajectory_run.h"

#include "sim/closed_forms/trajectories.h"

namespace ballast::test {

using Eigen::Vector3d;

namespace {

std::vector<double> start(const sim::InitialState& initial) {
  const auto& q = initial.orientation;
  const auto& w = initial.angular_velocity_B_radps;
  return {q.w(), q.x(), q.y(), q.z(), w[0], w[1], w[2], initial.position_W_m[0], initial.position_W_m[1]};
}

std::vector<sim::CubicSpline> curves(const sim::Scenario& scenario) {
  std::vector<sim::CubicSpline> out;
  for (const auto& mass : scenario.masses) {
    const auto& table = mass.trajectory;
    out.push_back(table.times_s.empty() ? sim::CubicSpline()
                  : table.periodic      ? sim::CubicSpline::closed(table.times_s, table.points_B_m)
                                        : sim::CubicSpline::open(table.times_s, table.points_B_m));
  }
  return out;
}

// The rows of the force's table, and those of the trajectories' in every period of the run.
std::vector<double> rows_s(const sim::Scenario& scenario) {
  std::vector<double> out = scenario.force_table.times_s;
  for (const auto& mass : scenario.masses) {
    const auto& table = mass.trajectory;
    if (table.times_s.empty()) continue;
    const double period_s = table.times_s.back() - table.times_s.front();
    const int repeats = table.periodic ? static_cast<int>(scenario.duration_s / period_s) + 2 : 0;
    for (int k = -repeats; k <= repeats; ++k) {
      for (const double time_s : table.times_s) out.push_back(time_s + k * period_s);
    }
  }
  return out;
}

}  // namespace

firmware::BallParams ball_on_rails(const sim::Scenario& scenario) {
  // The controller refuses trajectories; the model's closed forms do not.
  sim::Scenario on_rails = scenario;
  for (auto& mass : on_rails.masses) mass.trajectory = {};
  return ball_params(on_rails);
}

TrajectoryRun::TrajectoryRun(const sim::Scenario& scenario)
    : ball_(ball_on_rails(scenario)),
      trajectories_(curves(scenario)),
      table_(scenario.force_table),
      drag_(scenario.drag),
      run_(
          scenario, start(scenario.initial),
          [this](double time_s, const firmware::MassMotion& masses, const double* y, double* d) {
            const Vector3d w(y[4], y[5], y[6]);
            attitude_rate(y, w, d);
            const Vector3d acceleration = forces_at(time_s, masses, y).angular_acceleration_B_radps2;
            for (int j = 0; j < 3; ++j) d[4 + j] = acceleration[j];
            const Vector3d velocity = (attitude(y) * w).cross(Vector3d(0, 0, ball_.radius_m));
            d[7] = velocity[0], d[8] = velocity[1];
          },
          rows_s(scenario)) {}

// The quantities that the closed forms take as constant, at this instant.
Vector3d TrajectoryRun::force_W(double time_s, const Vector3d& velocity_W) const {
  Vector3d force = ball_.external_force_W_n;
  const auto& times = table_.times_s;
  if (!times.empty()) {
    force = time_s <= times.front() ? table_.forces_W_n.front() : table_.forces_W_n.back();
    for (std::size_t i = 1; i < times.size(); ++i) {
      if (time_s < times[i - 1] || time_s > times[i]) continue;
      const double part = (time_s - times[i - 1]) / (times[i] - times[i - 1]);
      force = (1 - part) * table_.forces_W_n[i - 1] + part * table_.forces_W_n[i];
    }
  }
  const Vector3d relative = velocity_W - drag_.wind_W_mps;
  return force - drag_.coefficient_kgpm * relative.norm() * relative;
}

firmware::RollingForces TrajectoryRun::forces_at(double time_s, const firmware::MassMotion& masses,
                                                 const double* y) const {
  const Eigen::Quaterniond q = attitude(y);
  const Vector3d w(y[4], y[5], y[6]);
  firmware::BallParams now = ball_;
  now.external_force_W_n = force_W(time_s, (q * w).cross(Vector3d(0, 0, ball_.radius_m)));
  closed_forms::MassTrajectories all = closed_forms::along_rails(now, masses);
  for (std::size_t i = 0; i < trajectories_.size(); ++i) {
    if (trajectories_[i].empty()) continue;
    const auto chi = trajectories_[i].at(time_s);
    all.position_B_m[i] = chi.position, all.velocity_B_mps[i] = chi.d1, all.acceleration_B_mps2[i] = chi.d2;
  }
  return closed_forms::rolling_forces_3d(now, q, w, all);
}

Eigen::Vector4d TrajectoryRun::orientation() const {
  const Eigen::Quaterniond q = attitude(run_.y());
  return {q.w(), q.x(), q.y(), q.z()};
}
Vector3d TrajectoryRun::angular_velocity_B() const { return {run_.y()[4], run_.y()[5], run_.y()[6]}; }
Eigen::Vector2d TrajectoryRun::position_W() const { return {run_.y()[7], run_.y()[8]}; }
firmware::RollingForces TrajectoryRun::forces() const { return forces_at(run_.time_s(), run_.masses(), run_.y()); }

}  // namespace ballast::test
