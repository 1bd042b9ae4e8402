// SUNDIALS CVODE: Adams-Moulton of orders 1 to 12 with fixed-point iteration (as ode113 is a variable-order Adams
// code), and BDF of orders 1 to 5 with Newton's iteration on the complex-step Jacobian (as ode15s is, with NDFs).
#include <cvode/cvode.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <optional>

#include "tools/integrators/methods.h"
#include "tools/integrators/step_control.h"
#include "tools/integrators/sundials.h"

namespace ballast::integrators {

namespace {

class Cvode : public Method {
 public:
  Cvode(Problem& problem, double tolerance, int family) : problem_(problem), size_(problem.size()) {
    y_sun_.set(y_);
    memory_ = CVodeCreate(family, context_);
    if (memory_ == nullptr) throw std::runtime_error("SUNDIALS gives no CVODE");
    must(CVodeSetErrHandlerFn(memory_, keep_complaint, &complaint_), "an error handler");
    must(CVodeInit(memory_, rhs, 0, y_sun_), "the problem");
    must(CVodeSStolerances(memory_, tolerance, tolerance), "the tolerance");
    must(CVodeSetUserData(memory_, this), "user data");
    must(CVodeSetMaxHnilWarns(memory_, -1), "silence");
    if (family == CV_ADAMS) {
      fixed_point_ = SUNNonlinSol_FixedPoint(y_sun_, 0, context_);
      must(CVodeSetNonlinearSolver(memory_, fixed_point_), "fixed-point iteration");
    } else {
      dense_.emplace(y_sun_, context_);
      must(CVodeSetLinearSolver(memory_, dense_->solver(), dense_->matrix()), "a linear solver");
      must(CVodeSetJacFn(memory_, jacobian), "a Jacobian");
    }
  }

  ~Cvode() override {
    CVodeFree(&memory_);
    if (fixed_point_ != nullptr) SUNNonlinSolFree(fixed_point_);
  }

  void start(double t, const State& y) override {
    time_ = step_start_ = t;
    y_ = y;
    y_sun_.set(y);
    rejected_before_ = counters_.rejected;
    must(CVodeReInit(memory_, t, y_sun_), "a new start");
  }

  bool step(double stop) override {
    step_start_ = time_;
    CVodeSetStopTime(memory_, stop);
    const int flag = CVode(memory_, stop, y_sun_, &time_, CV_ONE_STEP);
    if (flag < 0) {
      char* name = CVodeGetReturnFlagName(flag);
      failure_ = std::string(name) + ": " + complaint_;
      free(name);
      return false;
    }
    if (stalled(step_start_, time_)) {
      failure_ = too_small(time_ - step_start_);
      return false;
    }
    y_sun_.get(y_);
    ++counters_.steps;
    long error_test = 0, convergence = 0;
    CVodeGetNumErrTestFails(memory_, &error_test);
    CVodeGetNumNonlinSolvConvFails(memory_, &convergence);
    counters_.rejected = rejected_before_ + error_test + convergence;
    return true;
  }

  // The polynomial of the method's own history.
  void dense(double t, State& y) override {
    CVodeGetDky(memory_, t, 0, inside_);
    inside_.get(y);
  }

 private:
  static int rhs(double t, N_Vector y, N_Vector f, void* self) {
    auto& method = *static_cast<Cvode*>(self);
    ++method.counters_.right_hand_sides;
    method.problem_.rhs(t, NV_DATA_S(y), NV_DATA_S(f));
    return recoverable(NV_DATA_S(f), method.size_);
  }

  static int jacobian(double t, N_Vector y, N_Vector, SUNMatrix j, void* self, N_Vector, N_Vector, N_Vector) {
    auto& method = *static_cast<Cvode*>(self);
    ++method.counters_.jacobians;
    method.problem_.jacobian(t, NV_DATA_S(y), SM_DATA_D(j));
    return recoverable(SM_DATA_D(j), method.size_ * method.size_);
  }

  Problem& problem_;
  std::size_t size_;
  SunContext context_;
  SunVector y_sun_{size_, context_}, inside_{size_, context_};
  std::optional<SunDense> dense_;
  SUNNonlinearSolver fixed_point_ = nullptr;
  void* memory_ = nullptr;
  std::int64_t rejected_before_ = 0;
  std::string complaint_;
};

}  // namespace

std::unique_ptr<Method> make_adams(Problem& problem, const Settings& settings) {
  return std::make_unique<Cvode>(problem, settings.tolerance, CV_ADAMS);
}
std::unique_ptr<Method> make_bdf(Problem& problem, const Settings& settings) {
  return std::make_unique<Cvode>(problem, settings.tolerance, CV_BDF);
}

}  // namespace ballast::integrators
