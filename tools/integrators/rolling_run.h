// A prescribed run by a chosen method: rolling from the scenario's start to its end, or to where rolling ends.
//
// The method starts anew at every kink of the motion and of the external force. Between kinks the run searches every
// step for extrema of N, f_s and f_s / N and for the end of rolling (N = 0, or f_s = mu_s N). It searches on the
// method's interpolant and takes the values from Method::exact().
//
// The run ends, `slipped` or `detached`, with rolling, whatever the scenario's on_violation says. There is no monitor,
// so the result's trip stays empty.
#pragma once

#include <string>

#include "sim/plant/rolling_ode.h"
#include "sim/scenario/scenario.h"
#include "tools/integrators/methods.h"
#include "tools/sil/run.h"

namespace ballast::integrators {

// How the scenario starts, or empty if it starts rolling.
std::string why_not_rolling(const sim::Scenario& scenario);

// A fixed step that suits a tolerance: a method of order 4 errs by about (h / sqrt(r/g))^4 in a run like the paper's.
double fixed_step_for(const sim::Scenario& scenario, double tolerance);

// The rolling ball as rolling_ball_ode_f or rolling_ball_dae_g. In the latter |q|^2 - 1 = 0 replaces the rate of one
// component of q. The paper always replaces that of q_0. The DAE has index 1 only while that component is not 0, and
// q_0 passes 0 with every half turn of the ball. Here the largest component is taken, and chosen again when it has
// fallen below 0.4 (one of the four is at least 0.5).
class RollingProblem : public Problem {
 public:
  RollingProblem(const sim::Scenario& scenario, Form form) : ode(scenario), form_(form) {}

  [[nodiscard]] std::size_t size() const override { return sim::RollingOde::kSize; }
  void rhs(double t, const double* y, double* f) const override;
  void jacobian(double t, const double* y, double* out) const override;
  [[nodiscard]] int constraint() const override { return constraint_; }
  void slope(double t, const double* y, double* dydt) const override { ode.derivative(t, y, dydt); }
  bool choose_constraint(const double* y) override;

  sim::RollingOde ode;

 private:
  Form form_;
  int constraint_ = -1;
};

struct RollingRun {
  sil::RunResult result;
  Counters counters;
  State end_state{};
  double constraint_error = 0;  // largest | |q|^2 - 1 | after any step
  std::string failure;          // why the method could not go on; empty: it could
};
RollingRun run_rolling(const sim::Scenario& scenario, const MethodInfo& method, const Settings& settings);

// The integration alone, to end_s, without searches inside the steps. Its cost is what methods are compared by.
struct BareRun {
  double wall_time_s = 0;
  Counters counters;
  State end_state{};
};
BareRun integrate_only(const sim::Scenario& scenario, const MethodInfo& method, const Settings& settings, double end_s);

}  // namespace ballast::integrators
