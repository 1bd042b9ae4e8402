// Reference trajectory and feedback gains about a motion: time-varying LQR. A controller that measures the error e of
// the ball accelerates its masses by u = u_plan - K e.
//
// e has 2 n + 8 components: the masses' positions (n) and rates (n) in rail units; the rotation vector phi that turns
// the planned attitude into the true one, Lambda = Lambda_plan exp(phi^), body frame; Omega (3), body frame; the place
// of the geometric centre (2), space frame. To first order
//   d(theta) = rate,  d(rate) = u,  d(phi) = phi x Omega_plan + omega,
//   d(omega) = dOmegadot/d(phi, Omega, theta, thetadot) e + dOmegadot/d(thetaddot) u,  d(place) = dv/d(phi, Omega) e
// with the exact derivatives of rolling_model.h: e' = A e + B u. Over a step h, with A and B the means of both ends,
//   Phi = exp(A h),  G = integral of exp(A s) ds B,
// and the gains are those of the discrete Riccati recursion, backward from the end:
//   K = (R + G^T P G)^-1 G^T P Phi,   P <- Q + Phi^T P (Phi - G K).
//
// The controller's own gains (firmware/tracking) have two more columns: the integral of the place's error over time,
// m s. Its equation, d(integral) = place, is appended to A and B.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "sim/scenario/scenario.h"
#include "tools/tracking/rolling_model.h"

namespace ballast::plan {

// Errors and corrections that count as much as one another, in radii, radians and the time sqrt(r / g).
struct TrackingWeights {
  double mass_position = 0.5, mass_rate = 0.5;
  double attitude_rad = 0.2, angular_velocity = 0.2;
  double place = 0.05;
  // Weight of attitude and Omega about the vertical, over that about level axes. A ball at rest can hardly turn about
  // the vertical, and large gains come from asking it to.
  double about_vertical = 1;
  double acceleration = 0.2;
  double place_integral = 0;  // radii times sqrt(r / g); 0: e has no integral
  double at_end = 10;         // the weight of the last error over that of a whole sqrt(r / g) before
};

struct TrackingOptions {
  static constexpr int kMostSteps = 20000;  // of a motion; a longer one has no reference
  TrackingWeights weights;
  double step = 0.1;  // in sqrt(r / g)
  // A motion that ends at rest is held for ever: the recursion begins with the P of a long hold there.
  bool holds = false;
  // Drag, forces that change and masses without a motion, which the planner's model does not know, are no reason to
  // refuse; the reference has neither drag nor such forces. A ball that leaves the floor ends the reference there.
  bool lenient = false;
};

struct ReferencePoint {
  RollingState state;
  std::array<double, 2> place_m;
};

// e' = A e + B u about one state of the rolling ball.
struct Linear {
  Eigen::MatrixXd a, b;
};
[[nodiscard]] Linear linearise(const Robot& robot, const RollingState& state);

// Exact over a step in which A and B are constant.
struct Step {
  Eigen::MatrixXd transition, input;  // Phi, G
};
[[nodiscard]] Step discretise(const Linear& linear, double step_s);

// e, of the true state about a point of the reference.
[[nodiscard]] Eigen::VectorXd tracking_error(const ReferencePoint& reference, const ReferencePoint& truth, int masses);

struct Tracking {
  Robot robot;
  double step_s = 0;
  std::vector<ReferencePoint> reference;  // one more than steps
  std::vector<Step> step;
  std::vector<Eigen::MatrixXd> gain;           // K of each step, n rows
  std::vector<Eigen::MatrixXd> cost;           // P at each point: e^T P e is what is still to come
  Eigen::MatrixXd state_weight, input_weight;  // Q, alike about all axes, and R of a step
  bool ends_at_rest = false;                   // masses and ball, up to a little rocking
  bool has_integral = false;
  double less_about_vertical = 0;  // part of the weights of attitude and Omega that is missing there

  [[nodiscard]] int masses() const { return robot.ball.mass_count; }
  [[nodiscard]] int errors() const { return 2 * masses() + (has_integral ? 10 : 8); }
  [[nodiscard]] Eigen::MatrixXd state_weight_at(std::size_t k) const;
};

// The plant's states under the scenario's motion with prescribed masses, on a floor that holds whatever it needs: one
// more than `steps`, or fewer if the ball leaves the floor. Faults, drag and forces that change are left out.
[[nodiscard]] std::vector<ReferencePoint> roll_motion(const sim::Scenario& scenario, int steps);

// The plant rolls the scenario's motion with prescribed masses. `ball` is that of the scenario. None, and `why` in
// words: the scenario has no motion, does not roll to its end, or has what the planner's model does not know.
[[nodiscard]] std::optional<Tracking> track(const sim::Scenario& scenario, const firmware::BallParams& ball,
                                            std::string& why, const TrackingOptions& options = {});

// Table that travels to a controller: floats at equal times, linear between. Of each time the attitude (4), Omega (3),
// place (2) and K by rows; the masses' own motion is in the controller's profile.
struct GainTable {
  int masses = 0, errors = 0, samples = 0;
  double period_s = 0;
  std::vector<float> values;

  [[nodiscard]] std::size_t row() const { return row_of(masses, errors); }
  [[nodiscard]] std::size_t bytes() const { return values.size() * sizeof(float); }
  [[nodiscard]] Eigen::MatrixXd gain_at(double time_s) const;
  static std::size_t row_of(int masses, int errors) {
    return 9 + static_cast<std::size_t>(masses) * static_cast<std::size_t>(errors);
  }
};

inline constexpr std::size_t kMostGainBytes = std::size_t{32} * 1024;

// As many times as there are steps, or as fit.
[[nodiscard]] GainTable gain_table(const Tracking& tracking, std::size_t most_bytes = kMostGainBytes);

// The table as CSV: time, then a row's values.
[[nodiscard]] std::string gain_csv(const GainTable& table);

}  // namespace ballast::plan
