// Fits the parameters to recordings: Levenberg and Marquardt's method, over segments that get longer.
//
// Short segments come first, because a believed robot that is some per cent off is out of step with the true one after
// a few swings. Neighbours are then joined, pair by pair, as long as the residuals stay what they were: a model that
// explains the whole run from one start says the most.
//
// The intervals take the residuals as they are. Masses that swing about their commands and biases that walk leave
// residuals that are not white, so that the covariance is A^-1 S A^-1 with S from the residuals' own autocorrelation
// (Newey and West 1987), and never less than A^-1.
//
// Directions in the space of the parameters of which the motion says less than kUnknown (in units of
// Parameters::scale()) are not excited. The fit leaves them as they are believed.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tools/identify/parameters.h"
#include "tools/identify/run_fit.h"

namespace ballast::identify {

inline constexpr double kUnknown = 0.05;  // 1 sigma of a direction, in parts of the parameters' scale

// A combination of parameters, in units of their scale, of which nothing is known.
struct UnknownDirection {
  Eigen::VectorXd direction;  // unit length
};

struct Identified {
  Eigen::VectorXd believed, value;
  Eigen::VectorXd half_width;  // of the 95 % interval; infinite: unknown
  std::vector<UnknownDirection> unknown;
  double shell_mass_kg = 0, believed_shell_mass_kg = 0, shell_half_width_kg = 0;
  // The part of the run that was used.
  double used_s = 0, segment_s = 0;
  double excess = 1;  // greatest variance of a row of residuals over that of the sensors' noise
  int iterations = 0;
};

struct FitOutcome {
  std::optional<Identified> fit;
  std::string trouble;  // without a fit: why, in one line
};

// `progress`: after each iteration; false ends the fit.
[[nodiscard]] FitOutcome fit(const Parameters& parameters, std::vector<Recording> recordings,
                             const std::function<bool()>& progress = {});

// The parameters' errors that an IMU without swinging masses would leave: 1 sigma of each in units of its scale, by
// the information of the believed robot's motion. Unknown ones are 1 or more.
[[nodiscard]] Eigen::VectorXd predicted_sigma(const Parameters& parameters, RunFit& run);

}  // namespace ballast::identify
