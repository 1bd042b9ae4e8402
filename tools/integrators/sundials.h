// Shared by the SUNDIALS methods: owners of its objects, its complaints in words, and what goes before and after a
// step.
#pragma once

#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "tools/integrators/method.h"
#include "tools/integrators/problem.h"
#include "tools/integrators/step_control.h"

namespace ballast::integrators {

class SunContext {
 public:
  SunContext() {
    if (SUNContext_Create(nullptr, &context_) != 0) throw std::runtime_error("SUNDIALS gives no context");
  }
  ~SunContext() { SUNContext_Free(&context_); }
  SunContext(const SunContext&) = delete;
  SunContext& operator=(const SunContext&) = delete;
  // To be handed to SUNDIALS as it is.
  operator SUNContext() const { return context_; }  // NOLINT(google-explicit-constructor)

 private:
  SUNContext context_ = nullptr;
};

class SunVector {
 public:
  SunVector(std::size_t size, SUNContext context) : vector_(N_VNew_Serial(static_cast<sunindextype>(size), context)) {}
  ~SunVector() { N_VDestroy(vector_); }
  SunVector(const SunVector&) = delete;
  SunVector& operator=(const SunVector&) = delete;
  operator N_Vector() const { return vector_; }  // NOLINT(google-explicit-constructor)
  double* data() { return NV_DATA_S(vector_); }
  void set(const State& y) { std::copy_n(y.begin(), NV_LENGTH_S(vector_), data()); }
  void get(State& y) { std::copy_n(data(), NV_LENGTH_S(vector_), y.begin()); }

 private:
  N_Vector vector_;
};

// A dense matrix and the solver of its linear systems.
class SunDense {
 public:
  SunDense(N_Vector like, SUNContext context)
      : matrix_(SUNDenseMatrix(NV_LENGTH_S(like), NV_LENGTH_S(like), context)),
        solver_(SUNLinSol_Dense(like, matrix_, context)) {}
  ~SunDense() {
    SUNLinSolFree(solver_);
    SUNMatDestroy(matrix_);
  }
  SunDense(const SunDense&) = delete;
  SunDense& operator=(const SunDense&) = delete;
  [[nodiscard]] SUNMatrix matrix() const { return matrix_; }
  [[nodiscard]] SUNLinearSolver solver() const { return solver_; }

 private:
  SUNMatrix matrix_;
  SUNLinearSolver solver_;
};

// SUNDIALS calls this with its reason when it gives up; warnings (positive) are not complaints.
inline void keep_complaint(int code, const char* /*module*/, const char* /*function*/, char* message, void* text) {
  if (code < 0) *static_cast<std::string*>(text) = message;
}

// Checks a set-up that only lack of memory or our own mistake can make fail.
inline void must(int flag, const char* what) {
  if (flag != 0) throw std::runtime_error(std::string("SUNDIALS refuses ") + what);
}

// Steps that change nothing but the rounding of the time: SUNDIALS itself would go on like that without end.
inline bool stalled(double from, double to) { return to - from < 1e-15 * std::abs(to); }

// A right-hand side that is not finite makes SUNDIALS try a shorter step.
inline int recoverable(const double* f, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) {
    if (!(f[i] - f[i] == 0)) return 1;
  }
  return 0;
}

// One of SUNDIALS' codes, whose functions differ by name only. User data of the code is this object.
class SunMethod : public Method {
 protected:
  explicit SunMethod(Problem& problem) : problem_(problem), size_(problem.size()) { y_sun_.set(y_); }

  void begin(double t, const State& y) {
    time_ = step_start_ = t;
    y_ = y;
    y_sun_.set(y);
    rejected_before_ = counters_.rejected;
  }

  // The result of step() after a step that ended with `flag`. `name_of` gives its name, to be freed; the counts are of
  // what was rejected since the code's own new start.
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
    y_sun_.get(y_);
    ++counters_.steps;
    long by_error = 0, by_newton = 0;
    error_tests(memory_, &by_error);
    convergence(memory_, &by_newton);
    counters_.rejected = rejected_before_ + by_error + by_newton;
    return true;
  }

  // f(t, y) and its Jacobian, for the codes that take them so.
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

  Problem& problem_;
  std::size_t size_;
  SunContext context_;
  SunVector y_sun_{size_, context_};
  void* memory_ = nullptr;  // the code's; whoever makes it frees it
  std::string complaint_;

 private:
  std::int64_t rejected_before_ = 0;
};

}  // namespace ballast::integrators
