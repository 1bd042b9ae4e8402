#include "tools/sil/estimate_watch.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace ballast::sil {

namespace {

using Eigen::Quaterniond;
using Eigen::Vector2d;
using Eigen::Vector3d;

// The direction of weight in the floor's frame, also where gravity is 0.
Vector3d down_W(const sim::Surface& floor) {
  const double along = std::sin(floor.slope_rad);
  return {along * std::cos(floor.downhill_rad), along * std::sin(floor.downhill_rad), -std::cos(floor.slope_rad)};
}

Quaterniond quaternion(const double (&q)[4]) { return {q[0], q[1], q[2], q[3]}; }

// acos would lose half the digits of a small angle.
double angle_between(const Vector3d& a, const Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

// The turn about e3 in a rotation of the space frame.
double yaw_rad(const Quaterniond& turn) {
  return std::abs(2 * std::atan2(turn.w() < 0 ? -turn.z() : turn.z(), std::abs(turn.w())));
}

}  // namespace

void EstimateWatch::Rms::add(double square) {
  sum += square;
  ++count;
}

double EstimateWatch::Rms::value() const { return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0; }

EstimateWatch::EstimateWatch(const sim::Scenario& scenario)
    : true_down_W_(down_W(scenario.surface)), believed_down_W_(down_W(scenario.belief().surface)) {}

void EstimateWatch::observe(const contact_t& contact, const plant_state_t& truth, const controller_status_t& status,
                            const Vector3d& gyro_bias_B_radps) {
  if (status.estimate_valid == 0) return;
  const Quaterniond estimated = quaternion(status.estimated_orientation), real = quaternion(truth.orientation);
  const double tilt_rad = angle_between(estimated.conjugate() * believed_down_W_, real.conjugate() * true_down_W_);
  tilt_.add(tilt_rad * tilt_rad);
  const Vector2d place(status.estimated_position_W_m[0], status.estimated_position_W_m[1]);
  position_.add((place - Vector2d(truth.position_W_m[0], truth.position_W_m[1])).squaredNorm());
  errors_.position_W_m = place;
  errors_.yaw_error_rad = yaw_rad(estimated * real.conjugate());
  errors_.gyro_bias_error_radps =
      (Vector3d(status.estimated_gyro_bias_B_radps[0], status.estimated_gyro_bias_B_radps[1],
                status.estimated_gyro_bias_B_radps[2]) -
       gyro_bias_B_radps)
          .norm();
  observe_friction(contact, status);
}

// The robot's newest measurement beside the truth of the same tick, so that its age counts.
void EstimateWatch::observe_friction(const contact_t& contact, const controller_status_t& status) {
  if (status.measured_valid == 0) return;
  const double error = std::abs(status.measured_mu_required - contact.mu_required);
  if (!std::isfinite(error)) return;
  friction_.add(error * error);
  errors_.friction_error = std::max(errors_.friction_error.value_or(0), error);
}

std::optional<EstimateErrors> EstimateWatch::result() const {
  if (tilt_.count == 0) return std::nullopt;
  EstimateErrors errors = errors_;
  errors.tilt_rms_rad = tilt_.value();
  errors.position_rms_m = position_.value();
  if (friction_.count > 0) errors.friction_rms = friction_.value();
  return errors;
}

}  // namespace ballast::sil
