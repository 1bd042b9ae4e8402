// Shared by the SUNDIALS methods: the objects that all of them need, its messages, and the begin and end of a step.
#pragma once

#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <sundials/sundials_context.hpp>
#include <sundials/sundials_linearsolver.hpp>
#include <sundials/sundials_matrix.hpp>
#include <sundials/sundials_nvector.hpp>

#include "tools/integrators/method.h"
#include "tools/integrators/problem.h"
#include "tools/integrators/step_control.h"

namespace ballast::integrators {

inline void set(N_Vector vector, const State& y) { std::copy_n(y.begin(), NV_LENGTH_S(vector), NV_DATA_S(vector)); }
inline void get(N_Vector vector, State& y) { std::copy_n(NV_DATA_S(vector), NV_LENGTH_S(vector), y.begin()); }

// SUNDIALS calls this with its reason when it gives up. Warnings, whose codes are positive, are dropped.
inline void keep_complaint(int code, const char* /*module*/, const char* /*function*/, char* message, void* text) {
  if (code < 0) *static_cast<std::string*>(text) = message;
}

// Checks the result of a set-up call. Only lack of memory or a bug here makes one fail.
inline void must(int flag, const char* what) {
  if (flag != 0) throw std::runtime_error(std::string("SUNDIALS refuses ") + what);
}

// Whether a step changes nothing but the rounding of the time. SUNDIALS itself would repeat such steps for ever.
inline bool stalled(double from, double to) { return to - from < 1e-15 * std::abs(to); }

// 1, which makes SUNDIALS try a shorter step, if a value is not finite; otherwise 0.
inline int recoverable(const double* f, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) {
    if (!(f[i] - f[i] == 0)) return 1;
  }
  return 0;
}

// One of SUNDIALS' codes. Their functions differ by name only. This object is the code's user data.
class SunMethod : public Method {
 protected:
  explicit SunMethod(Problem& problem) : problem_(problem), size_(problem.size()) { set(y_sun_, y_); }

  void begin(double t, const State& y) {
    time_ = step_start_ = t;
    y_ = y;
    set(y_sun_, y);
    rejected_before_ = counters_.rejected;
  }

  // The result of step() after a step that ended with `flag`. `name_of` gives the flag's name, which has to be freed.
  // The two counts are of the rejections since the code's own new start.
  using Count = int (*)(void* memory, long* count);
  bool took(int flag, char* (*name_of)(long flag), Count error_tests, Count convergence) {
    if (flag < 0) {
      char* name = name_of(flag);
      failure_ = std::string(name) + ": " + complaint_;
      std::free(name);
      return false;
    }
    if (stalled(step_start_, time_)) {
      failure_ = too_small(time_ - step_start_);
      return false;
    }
    get(y_sun_, y_);
    ++counters_.steps;
    long by_error = 0, by_newton = 0;
    error_tests(memory_, &by_error);
    convergence(memory_, &by_newton);
    counters_.rejected = rejected_before_ + by_error + by_newton;
    return true;
  }

  // f(t, y) and its Jacobian in the form that CVODE and ARKODE take.
  static int rhs(double t, N_Vector y, N_Vector f, void* self) {
    auto& method = *static_cast<SunMethod*>(self);
    ++method.counters_.right_hand_sides;
    method.problem_.rhs(t, NV_DATA_S(y), NV_DATA_S(f));
    return recoverable(NV_DATA_S(f), method.size_);
  }
  static int jacobian(double t, N_Vector y, N_Vector, SUNMatrix j, void* self, N_Vector, N_Vector, N_Vector) {
    auto& method = *static_cast<SunMethod*>(self);
    ++method.counters_.jacobians;
    method.problem_.jacobian(t, NV_DATA_S(y), SM_DATA_D(j));
    return recoverable(SM_DATA_D(j), method.size_ * method.size_);
  }

  [[nodiscard]] sunindextype length() const { return static_cast<sunindextype>(size_); }
  [[nodiscard]] sundials::experimental::NVectorView vector() const { return {N_VNew_Serial(length(), context_)}; }

  Problem& problem_;
  std::size_t size_;
  sundials::Context context_;
  sundials::experimental::NVectorView y_sun_ = vector();
  // For the methods with Newton's iteration.
  sundials::experimental::SUNMatrixView matrix_{SUNDenseMatrix(length(), length(), context_)};
  sundials::experimental::SUNLinearSolverView solver_{SUNLinSol_Dense(y_sun_, matrix_, context_)};
  void* memory_ = nullptr;  // the code's; the derived class makes and frees it
  std::string complaint_;

 private:
  std::int64_t rejected_before_ = 0;
};

}  // namespace ballast::integrators
