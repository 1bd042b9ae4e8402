// SUNDIALS ARKODE: the methods of ode23tb and ode23t, diagonally implicit Runge-Kutta of order 2 with Newton's
// iteration on the complex-step Jacobian. Both advance the solution of order 2 and take its error from a companion of
// order 3, so that the estimate is the local error itself, O(h^3).
//
// The interpolant is the cubic through values and slopes at both ends of a step. ARKODE's own one for order 2 is a
// line.
#include <arkode/arkode_arkstep.h>

#include <memory>

#include "tools/integrators/methods.h"
#include "tools/integrators/step_control.h"
#include "tools/integrators/sundials.h"

namespace ballast::integrators {

namespace {

struct FreeTable {
  void operator()(ARKodeButcherTable table) const { ARKodeButcherTable_Free(table); }
};
using Table = std::unique_ptr<std::remove_pointer_t<ARKodeButcherTable>, FreeTable>;

// The error of both is O(h^3), which ARKODE calls an embedding of order 2.
constexpr int kOrder = 2, kEstimate = 2;

// Bank et al. (1985) in the form of Hosea and Shampine (1996): a trapezoidal step over 2 - sqrt 2 of the step, then
// BDF2. The L-stable solution is advanced.
Table trbdf2() {
  Table table(ARKodeButcherTable_LoadDIRK(ARKODE_TRBDF2_3_3_2));
  if (!table) throw std::runtime_error("SUNDIALS gives no TR-BDF2 table");
  return table;
}

// The trapezoidal rule over the whole step, y1 = y0 + h/2 (f0 + f1). The companion is Simpson's rule on 0, 1/2, 1, for
// which a trapezoidal half step is added. Simpson's rule is of order 3: sum b c^2 = 2/3 1/4 + 1/6 = 1/3, sum b A c =
// 2/3 1/8 + 1/6 1/2 = 1/6.
Table trapezoid() {
  double c[] = {0, 0.5, 1};
  double a[] = {0, 0, 0, 0.25, 0.25, 0, 0.5, 0, 0.5};
  double b[] = {0.5, 0, 0.5};
  double simpson[] = {1. / 6, 2. / 3, 1. / 6};
  return Table(ARKodeButcherTable_Create(3, kOrder, kEstimate, c, a, b, simpson));
}

class Arkode : public SunMethod {
 public:
  Arkode(Problem& problem, double tolerance, const Table& table) : SunMethod(problem) {
    memory_ = ARKStepCreate(nullptr, rhs, 0, y_sun_, context_);
    if (memory_ == nullptr) throw std::runtime_error("SUNDIALS gives no ARKODE");
    must(ARKStepSetErrHandlerFn(memory_, keep_complaint, &complaint_), "an error handler");
    must(ARKStepSetTables(memory_, kOrder, kEstimate, table.get(), nullptr), "a table");
    must(ARKStepSStolerances(memory_, tolerance, tolerance), "the tolerance");
    must(ARKStepSetUserData(memory_, static_cast<SunMethod*>(this)), "user data");
    must(ARKStepSetMaxHnilWarns(memory_, -1), "silence");
    must(ARKStepSetInterpolantDegree(memory_, 1), "an interpolant");
    must(ARKStepSetLinearSolver(memory_, solver_, matrix_), "a linear solver");
    must(ARKStepSetJacFn(memory_, jacobian), "a Jacobian");
  }
  ~Arkode() override { ARKStepFree(&memory_); }

  void start(double t, const State& y) override {
    begin(t, y);
    must(ARKStepReInit(memory_, nullptr, rhs, t, y_sun_), "a new start");
  }

  bool step(double stop) override {
    step_start_ = time_;
    start_ = y_;
    slopes_ready_ = false;
    ARKStepSetStopTime(memory_, stop);
    const int flag = ARKStepEvolve(memory_, stop, y_sun_, &time_, ARK_ONE_STEP);
    return took(flag, ARKStepGetReturnFlagName, ARKStepGetNumErrTestFails, ARKStepGetNumNonlinSolvConvFails);
  }

  void dense(double t, State& y) override {
    if (!slopes_ready_) {
      problem_.rhs(step_start_, start_.data(), start_slope_.data());
      problem_.rhs(time_, y_.data(), end_slope_.data());
      slopes_ready_ = true;
    }
    const double h = time_ - step_start_;
    hermite((t - step_start_) / h, h, start_, start_slope_, y_, end_slope_, size_, y);
  }

 private:
  bool slopes_ready_ = false;
  State start_{}, start_slope_{}, end_slope_{};
};

}  // namespace

std::unique_ptr<Method> make_trbdf2(Problem& problem, const Settings& settings) {
  return std::make_unique<Arkode>(problem, settings.tolerance, trbdf2());
}
std::unique_ptr<Method> make_trapezoid(Problem& problem, const Settings& settings) {
  return std::make_unique<Arkode>(problem, settings.tolerance, trapezoid());
}

}  // namespace ballast::integrators
