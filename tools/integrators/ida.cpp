// SUNDIALS IDA: BDF of orders 1 to 5 for F(t, y, y') = M y' - f(t, y) = 0 (as ode15i is, and ode15s with a singular M),
// with Newton's iteration on the complex-step Jacobian dF/dy + c_j dF/dy' = c_j M - df/dy.
#include <ida/ida.h>

#include "tools/integrators/methods.h"
#include "tools/integrators/step_control.h"
#include "tools/integrators/sundials.h"

namespace ballast::integrators {

namespace {

class Ida : public SunMethod {
 public:
  Ida(Problem& problem, double tolerance) : SunMethod(problem), tolerance_(tolerance) {
    set(slope_, y_);
    memory_ = IDACreate(context_);
    if (memory_ == nullptr) throw std::runtime_error("SUNDIALS gives no IDA");
    must(IDASetErrHandlerFn(memory_, keep_complaint, &complaint_), "an error handler");
    must(IDAInit(memory_, residual, 0, y_sun_, slope_), "the problem");
    must(IDASStolerances(memory_, tolerance, tolerance), "the tolerance");
    must(IDASetUserData(memory_, static_cast<SunMethod*>(this)), "user data");
    must(IDASetLinearSolver(memory_, solver_, matrix_), "a linear solver");
    must(IDASetJacFn(memory_, jacobian), "a Jacobian");
  }
  ~Ida() override { IDAFree(&memory_); }

  void start(double t, const State& y) override {
    begin(t, y);
    State slope{};
    problem_.slope(t, y.data(), slope.data());
    set(slope_, slope);
    // IDA's own first step, half a tolerance over the slope, may be less than the rounding of the time. A hundredth of
    // what order 1 would allow, because the order rises by one with every step.
    const double h = first_step([this](double at, const double* v, double* f) { problem_.slope(at, v, f); }, t, y,
                                slope, 1, tolerance_, size_);
    counters_.right_hand_sides += 2;
    must(IDAReInit(memory_, t, y_sun_, slope_), "a new start");
    must(IDASetInitStep(memory_, 0.01 * h), "a first step");
  }

  bool step(double stop) override {
    step_start_ = time_;
    IDASetStopTime(memory_, stop);
    const int flag = IDASolve(memory_, stop, &time_, y_sun_, slope_, IDA_ONE_STEP);
    return took(flag, IDAGetReturnFlagName, IDAGetNumErrTestFails, IDAGetNumNonlinSolvConvFails);
  }

  // The polynomial of the method's own history.
  void dense(double t, State& y) override {
    IDAGetDky(memory_, t, 0, inside_);
    get(inside_, y);
  }

 private:
  static int residual(double t, N_Vector y, N_Vector slope, N_Vector out, void* self) {
    auto& method = *static_cast<Ida*>(static_cast<SunMethod*>(self));
    ++method.counters_.right_hand_sides;
    double* f = NV_DATA_S(out);
    method.problem_.rhs(t, NV_DATA_S(y), f);
    const int constraint = method.problem_.constraint();
    for (std::size_t i = 0; i < method.size_; ++i) {
      const double rate = static_cast<int>(i) == constraint ? 0 : NV_DATA_S(slope)[i];
      f[i] = rate - f[i];
    }
    return recoverable(f, method.size_);
  }

  static int jacobian(double t, double c_j, N_Vector y, N_Vector, N_Vector, SUNMatrix j, void* self, N_Vector, N_Vector,
                      N_Vector) {
    auto& method = *static_cast<Ida*>(static_cast<SunMethod*>(self));
    ++method.counters_.jacobians;
    double* out = SM_DATA_D(j);
    const std::size_t n = method.size_;
    method.problem_.jacobian(t, NV_DATA_S(y), out);
    for (std::size_t k = 0; k < n * n; ++k) out[k] = -out[k];
    for (std::size_t i = 0; i < n; ++i) {
      if (static_cast<int>(i) != method.problem_.constraint()) out[i + n * i] += c_j;
    }
    return recoverable(out, n * n);
  }

  double tolerance_;
  sundials::experimental::NVectorView slope_ = vector(), inside_ = vector();
};

}  // namespace

std::unique_ptr<Method> make_ida(Problem& problem, const Settings& settings) {
  return std::make_unique<Ida>(problem, settings.tolerance);
}

}  // namespace ballast::integrators
