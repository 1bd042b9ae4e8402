#include "tests/physics/closed_form_run.h"

#include "sim/closed_forms/detached.h"

namespace ballast::test {

using Eigen::Vector3d;

namespace {

Vector3d vector3(const double* v) { return {v[0], v[1], v[2]}; }
Eigen::Vector4d components(const Eigen::Quaterniond& q) { return {q.w(), q.x(), q.y(), q.z()}; }

void put(const Vector3d& v, double* to) { to[0] = v[0], to[1] = v[1], to[2] = v[2]; }

// q, Omega and the position's first two components of the start.
std::vector<double> start(const sim::InitialState& initial) {
  const auto& q = initial.orientation;
  const auto& w = initial.angular_velocity_B_radps;
  return {q.w(), q.x(), q.y(), q.z(), w[0], w[1], w[2], initial.position_W_m[0], initial.position_W_m[1]};
}

std::vector<double> flying_start(const sim::InitialState& initial) {
  std::vector<double> y = start(initial);
  y.push_back(initial.height_m);
  for (int j = 0; j < 3; ++j) y.push_back(initial.velocity_W_mps[j]);
  return y;
}

}  // namespace

ClosedFormRun::ClosedFormRun(const sim::Scenario& scenario)
    : ball_(ball_params(scenario)),
      run_(scenario, start(scenario.initial),
           [this](double, const firmware::MassMotion& masses, const double* y, double* d) {
             const Eigen::Quaterniond q = attitude(y);
             const Vector3d w = vector3(y + 4);
             attitude_rate(y, w, d);
             put(firmware::rolling_forces(ball_, q, w, masses).angular_acceleration_B_radps2, d + 4);
             const Vector3d velocity = (q * w).cross(Vector3d(0, 0, ball_.radius_m));
             d[7] = velocity[0], d[8] = velocity[1];
           }) {}

Eigen::Vector4d ClosedFormRun::orientation() const { return components(attitude(run_.y())); }
Vector3d ClosedFormRun::angular_velocity_B() const { return vector3(run_.y() + 4); }
Eigen::Vector2d ClosedFormRun::position_W() const { return {run_.y()[7], run_.y()[8]}; }
firmware::RollingForces ClosedFormRun::forces() const {
  return firmware::rolling_forces(ball_, attitude(run_.y()), angular_velocity_B(), run_.masses());
}

ClosedFormFlight::ClosedFormFlight(const sim::Scenario& scenario)
    : ball_(ball_params(scenario)),
      run_(scenario, flying_start(scenario.initial),
           [this](double, const firmware::MassMotion& masses, const double* y, double* d) {
             const Vector3d w = vector3(y + 4);
             const auto motion = closed_forms::detached_motion(ball_, attitude(y), w, masses);
             attitude_rate(y, w, d);
             put(motion.angular_acceleration_B_radps2, d + 4);
             put(vector3(y + 10), d + 7);
             put(motion.acceleration_W_mps2, d + 10);
           }) {}

Eigen::Vector4d ClosedFormFlight::orientation() const { return components(attitude(run_.y())); }
Vector3d ClosedFormFlight::angular_velocity_B() const { return vector3(run_.y() + 4); }
Vector3d ClosedFormFlight::position_W() const { return vector3(run_.y() + 7); }
Vector3d ClosedFormFlight::velocity_W() const { return vector3(run_.y() + 10); }

}  // namespace ballast::test
