// A prescribed run integrated by an independent program: SUNDIALS CVODE (Adams) on a law of motion given by the test,
// with the masses along the firmware's profiles. Nothing of sim/ but the scenario is used.
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <memory>
#include <vector>

#include "firmware/model/rolling.h"
#include "sim/scenario/scenario.h"

namespace ballast::test {

// The firmware's parameters of this ball. Throws the reason of a refusal.
firmware::BallParams ball_params(const sim::Scenario& scenario);

class PrescribedRun {
 public:
  // dy/dt of the state y at time_s, with the masses as they are then.
  using Law = std::function<void(double time_s, const firmware::MassMotion& masses, const double* y, double* dydt)>;

  // `kinks_s`: where the law's rate of time jumps, beside the ends of motion pieces; in any order.
  PrescribedRun(const sim::Scenario& scenario, const std::vector<double>& y0, Law law,
                const std::vector<double>& kinks_s = {});
  ~PrescribedRun();
  PrescribedRun(const PrescribedRun&) = delete;
  PrescribedRun& operator=(const PrescribedRun&) = delete;

  // Integrates on to time_s, restarting at every kink. False if CVODE gave up.
  bool advance(double time_s);

  [[nodiscard]] double time_s() const;
  [[nodiscard]] const double* y() const;
  [[nodiscard]] firmware::MassMotion masses() const;  // at a jump: after it

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The unit attitude in y[0..3] = (w, x, y, z), and its rate q Omega / 2 into dydt[0..3].
Eigen::Quaterniond attitude(const double* y);
void attitude_rate(const double* y, const Eigen::Vector3d& angular_velocity_B, double* dydt);

}  // namespace ballast::test
