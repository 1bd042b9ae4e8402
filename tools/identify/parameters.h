// The parameters that are identified, as one vector:
//   masses of the moving masses (n), centre of mass of the shell (3), its inertia (3), rolling resistance (1).
//
// The shell's mass is the total mass less the others. A rolling ball moves alike when all masses and inertias are
// scaled by one factor, so the total mass must be known from elsewhere: a scale.
#pragma once

#include <Eigen/Core>
#include <string>

#include "tools/identify/recording.h"

namespace ballast::identify {

class Parameters {
 public:
  explicit Parameters(const Known& known, double total_mass_kg);

  [[nodiscard]] int masses() const { return masses_; }
  [[nodiscard]] int count() const { return masses_ + 7; }
  [[nodiscard]] int center_of_mass() const { return masses_; }  // index of its first component
  [[nodiscard]] int inertia() const { return masses_ + 3; }
  [[nodiscard]] int rolling_resistance() const { return masses_ + 6; }
  [[nodiscard]] double time_unit_s() const;  // sqrt(r / g)
  [[nodiscard]] double total_mass_kg() const { return total_mass_kg_; }

  // The believed values. Their masses need not have the total mass: all are scaled to it, with the inertias.
  [[nodiscard]] const Eigen::VectorXd& believed() const { return believed_; }
  // An error of 1 of each parameter: its believed size, a tenth of the radius, a resistance of 0.01.
  [[nodiscard]] const Eigen::VectorXd& scale() const { return scale_; }
  // The key in a scenario.
  [[nodiscard]] std::string name(int parameter) const;
  [[nodiscard]] std::string unit(int parameter) const;

  [[nodiscard]] double shell_mass_kg(const Eigen::VectorXd& values) const {
    return total_mass_kg_ - values.head(masses_).sum();
  }
  // Masses and inertias are positive, and the centre of mass is inside the ball.
  [[nodiscard]] bool possible(const Eigen::VectorXd& values) const;
  // The robot with these values.
  [[nodiscard]] plan::Robot robot(const Eigen::VectorXd& values) const;

 private:
  int masses_;
  double total_mass_kg_;
  plan::Robot robot_;
  Eigen::VectorXd believed_, scale_;
};

}  // namespace ballast::identify
