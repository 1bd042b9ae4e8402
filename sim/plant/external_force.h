// The force on the ball at its geometric centre: constant, or a table of time, drag in a wind, and pushes.
#pragma once

#include <cmath>

#include "sim/plant/vec3.h"
#include "sim/plant/world.h"

namespace ballast::sim {

class ExternalForce {
 public:
  explicit ExternalForce(const World& world);

  // Whether the equations have to take a force into account.
  [[nodiscard]] bool present() const { return present_; }
  // Whether there is a table or drag, which the controller is not told of.
  [[nodiscard]] bool has_untold() const { return !times_s_.empty() || drag_kgpm_ > 0; }
  // Leaves out table and drag: keeps the constant force, and pushes as they are now.
  void keep_told();
  // To be called at the start of a run that injects pushes.
  void expect_pushes() { present_ = true; }

  // Space frame, N. `velocity_W_mps` is the geometric centre's; complex for derivatives by complex step.
  template <class T>
  [[nodiscard]] Vec3<T> at(double time_s, const Vec3<T>& velocity_W_mps) const {
    const Vec3<double> f = of_time(time_s);
    Vec3<T> force{T(f.x), T(f.y), T(f.z)};
    if (drag_kgpm_ > 0) {
      using std::sqrt;
      const Vec3<T> relative{velocity_W_mps.x - wind_W_mps_.x, velocity_W_mps.y - wind_W_mps_.y,
                             velocity_W_mps.z - wind_W_mps_.z};
      const T squared = dot(relative, relative);
      // At rest relative to the wind, |v| v is 0 with all its first derivatives. The square root of a complex 0 is not
      // smooth, so it is avoided.
      if (squared != T(0)) force = force - drag_kgpm_ * sqrt(squared) * relative;
    }
    return force;
  }

  // A push on top of the other forces, from now on. It is state, not a function of time: it jumps between two steps of
  // the integrator, never inside one.
  void set_push(const Vec3<double>& force_W_n) { push_W_n_ = force_W_n; }
  [[nodiscard]] const Vec3<double>& push_W_n() const { return push_W_n_; }

  // The first instant after time_s at which the force's time derivative jumps; +infinity if there is none.
  [[nodiscard]] double next_kink_s(double time_s) const;

 private:
  [[nodiscard]] Vec3<double> of_time(double time_s) const {
    return (times_s_.empty() ? constant_W_n_ : of_table(time_s)) + push_W_n_;
  }
  [[nodiscard]] Vec3<double> of_table(double time_s) const;

  bool present_;
  Vec3<double> constant_W_n_;
  std::vector<double> times_s_;
  std::vector<Vec3<double>> forces_W_n_;
  Vec3<double> push_W_n_{0, 0, 0};
  double drag_kgpm_;
  Vec3<double> wind_W_mps_;
};

}  // namespace ballast::sim
