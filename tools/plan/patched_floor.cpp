#include "tools/plan/patched_floor.h"

#include <algorithm>
#include <cmath>

#include "sim/plant/local_floor.h"

namespace ballast::plan {

using Eigen::Vector2d;

namespace {

constexpr double kBand = 0.1;  // of the ball's radius

// 0 below 0, 1 above 1, smooth between; and its slope.
double smooth(double part) {
  const double c = std::clamp(part, 0.0, 1.0);
  return c * c * (3 - 2 * c);
}
double smooth_slope(double part) {
  const double c = std::clamp(part, 0.0, 1.0);
  return 6 * c * (1 - c);
}

// A unit vector but at corners and centers, where the depth has a kink.
Vector2d depth_gradient(const sim::SurfacePatch& patch, const Vector2d& place_m, double step_m) {
  Vector2d gradient;
  for (int axis = 0; axis < 2; ++axis) {
    const Vector2d step = step_m * Vector2d::Unit(axis);
    gradient[axis] = (sim::depth_m(patch, place_m + step) - sim::depth_m(patch, place_m - step)) / (2 * step_m);
  }
  return gradient;
}

}  // namespace

PatchedFloor::PatchedFloor(const sim::Surface& surface, double ball_radius_m)
    : patches_(surface.patches),
      floor_resistance_(surface.rolling_resistance),
      greatest_resistance_(surface.rolling_resistance),
      reference_(surface.static_friction),
      grip_is_bounded_(std::isfinite(surface.static_friction)),
      band_m_(kBand * ball_radius_m) {
  for (const sim::SurfacePatch& patch : patches_) {
    greatest_resistance_ = std::max(greatest_resistance_, patch.rolling_resistance);
    if (!grip_is_bounded_) reference_ = std::min(reference_, patch.static_friction);
  }
  if (has_patches()) floor_weight_ = weight_of(surface.static_friction);
  for (const sim::SurfacePatch& patch : patches_) weights_.push_back(weight_of(patch.static_friction));
}

double PatchedFloor::weight_of(double static_friction) const {
  if (grip_is_bounded_) return std::max(1.0, reference_ / static_friction);
  if (std::isinf(reference_)) return 1;  // infinite everywhere
  return reference_ / static_friction;
}

// Patches are laid on the floor one after another. One that costs more than what lies below it counts from margin_m
// outside its border, one that costs less from margin_m inside; the band lies beyond that.
PatchedFloor::Weight PatchedFloor::weight(const Vector2d& place_m, double margin_m) const {
  Weight out;
  out.value = floor_weight_;
  for (std::size_t k = 0; k < patches_.size(); ++k) {
    const double depth = sim::depth_m(patches_[k], place_m);
    const bool dearer = weights_[k] > out.value;
    const double part = (dearer ? depth + margin_m + band_m_ : depth - margin_m) / band_m_;
    if (!(part > 0)) continue;
    const double gain = weights_[k] - out.value, share = smooth(part);
    out.gradient *= 1 - share;
    if (part < 1) {
      out.gradient += gain * smooth_slope(part) / band_m_ * depth_gradient(patches_[k], place_m, 1e-4 * band_m_);
    }
    out.value = share < 1 ? out.value + share * gain : weights_[k];
  }
  return out;
}

double PatchedFloor::weight_at(const Vector2d& place_m) const {
  std::size_t next = patches_.size();
  while (next > 0 && !(sim::depth_m(patches_[next - 1], place_m) >= 0)) --next;
  return next > 0 ? weights_[next - 1] : floor_weight_;
}

double PatchedFloor::least_weight(const Vector2d& place_m, double within_m) const {
  double least = weight_at(place_m);
  bool near_border = false;
  for (const sim::SurfacePatch& patch : patches_) {
    near_border = near_border || std::abs(sim::depth_m(patch, place_m)) < within_m;
  }
  if (!near_border) return least;
  least = std::min(least, floor_weight_);
  for (const double weight : weights_) least = std::min(least, weight);
  return least;
}

double PatchedFloor::rolling_resistance(const Vector2d& place_m) const {
  double resistance = floor_resistance_;
  for (const sim::SurfacePatch& patch : patches_) {
    if (patch.rolling_resistance == resistance) continue;
    const double share = smooth(0.5 + sim::depth_m(patch, place_m) / band_m_);
    resistance += share * (patch.rolling_resistance - resistance);
  }
  return resistance;
}

}  // namespace ballast::plan
