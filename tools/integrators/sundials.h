// What the SUNDIALS methods share: owners of its objects, and its complaints in words.
#pragma once

#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "tools/integrators/problem.h"

namespace ballast::integrators {

class SunContext {
 public:
  SunContext() {
    if (SUNContext_Create(nullptr, &context_) != 0) throw std::runtime_error("SUNDIALS gives no context");
  }
  ~SunContext() { SUNContext_Free(&context_); }
  SunContext(const SunContext&) = delete;
  SunContext& operator=(const SunContext&) = delete;
  operator SUNContext() const { return context_; }

 private:
  SUNContext context_ = nullptr;
};

class SunVector {
 public:
  SunVector(std::size_t size, SUNContext context) : vector_(N_VNew_Serial(static_cast<sunindextype>(size), context)) {}
  ~SunVector() { N_VDestroy(vector_); }
  SunVector(const SunVector&) = delete;
  SunVector& operator=(const SunVector&) = delete;
  operator N_Vector() const { return vector_; }
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

// Of a set-up that cannot go wrong but for memory and our own mistakes.
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

}  // namespace ballast::integrators
