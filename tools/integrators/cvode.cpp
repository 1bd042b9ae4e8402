// SUNDIALS CVODE: Adams-Moulton of orders 1 to 12 with fixed-point iteration (as ode113 is a variable-order Adams
// code), and BDF of orders 1 to 5 with Newton's iteration on the complex-step Jacobian (as ode15s is, with NDFs).
#include <cvode/cvode.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include "tools/integrators/methods.h"
#include "tools/integrators/sundials.h"

namespace ballast::integrators {

namespace {

class Cvode : public SunMethod {
 public:
  Cvode(Problem& problem, double tolerance, int family) : SunMethod(problem) {
    memory_ = CVodeCreate(family, context_);
    if (memory_ == nullptr) throw std::runtime_error("SUNDIALS gives no CVODE");
    must(CVodeSetErrHandlerFn(memory_, keep_complaint, &complaint_), "an error handler");
    must(CVodeInit(memory_, rhs, 0, y_sun_), "the problem");
    must(CVodeSStolerances(memory_, tolerance, tolerance), "the tolerance");
    must(CVodeSetUserData(memory_, static_cast<SunMethod*>(this)), "user data");
    must(CVodeSetMaxHnilWarns(memory_, -1), "silence");
    if (family == CV_ADAMS) {
      fixed_point_ = SUNNonlinSol_FixedPoint(y_sun_, 0, context_);
      must(CVodeSetNonlinearSolver(memory_, fixed_point_), "fixed-point iteration");
    } else {
      must(CVodeSetLinearSolver(memory_, solver_, matrix_), "a linear solver");
      must(CVodeSetJacFn(memory_, jacobian), "a Jacobian");
    }
  }

  ~Cvode() override {
    CVodeFree(&memory_);
    if (fixed_point_ != nullptr) SUNNonlinSolFree(fixed_point_);
  }

  void start(double t, const State& y) override {
    begin(t, y);
    must(CVodeReInit(memory_, t, y_sun_), "a new start");
  }

  bool step(double stop) override {
    step_start_ = time_;
    CVodeSetStopTime(memory_, stop);
    const int flag = CVode(memory_, stop, y_sun_, &time_, CV_ONE_STEP);
    return took(flag, CVodeGetReturnFlagName, CVodeGetNumErrTestFails, CVodeGetNumNonlinSolvConvFails);
  }

  // The polynomial of the method's own history.
  void dense(double t, State& y) override {
    CVodeGetDky(memory_, t, 0, inside_);
    get(inside_, y);
  }

 private:
  sundials::experimental::NVectorView inside_ = vector();
  SUNNonlinearSolver fixed_point_ = nullptr;
};

}  // namespace

std::unique_ptr<Method> make_adams(Problem& problem, const Settings& settings) {
  return std::make_unique<Cvode>(problem, settings.tolerance, CV_ADAMS);
}
std::unique_ptr<Method> make_bdf(Problem& problem, const Settings& settings) {
  return std::make_unique<Cvode>(problem, settings.tolerance, CV_BDF);
}

}  // namespace ballast::integrators
