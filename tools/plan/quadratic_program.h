// A dense quadratic program with elastic limits and, if asked for, the greatest of some rows to be made small:
//
//   minimise over x, t, s >= 0   x' H x / 2 + g' x + level_weight t + penalty sum s
//   subject to                   lower - s <= value + J x <= upper + s      for limit rows
//                                -t        <= value + J x <= t              for level rows
//
// It always has a solution, since the limits yield at a price. A primal-dual interior-point method with Mehrotra's
// predictor and corrector solves it (Nocedal and Wright, Numerical Optimization, section 16.6). Slacks of the limits
// are eliminated, so that each iteration factorises one matrix of the size of x and t.
#pragma once

#include <vector>

namespace ballast::plan {

struct ProgramRow {
  std::size_t offset = 0;  // of its coefficients in QuadraticProgram::coefficients, which belong to variables
  int begin = 0, end = 0;  // begin to end - 1; all others are 0
  double value = 0;
  double lower = 0, upper = 0;  // infinite: no limit on that side; ignored by level rows
  bool level = false;
  bool whole = false;  // its coefficients are stored for all variables, zeros included
};

struct QuadraticProgram {
  int size = 0;
  std::vector<double> hessian;  // row-major, its lower triangle, positive definite
  std::vector<double> gradient;
  std::vector<double> coefficients;
  std::vector<ProgramRow> rows;
  double level_weight = 0;  // 0: there are no level rows
  double penalty = 1;
};

struct ProgramSolution {
  std::vector<double> x;
  double level = 0;              // t
  double decrease = 0;           // of the objective from x = 0 with the best t and s there
  std::vector<double> pressure;  // per row: multiplier of its upper limit less that of its lower
  // Cholesky factor of the Hessian with the limits' resistance at the solution, of x and (with level rows) t: the
  // metric in which a small change disturbs the solution least. Empty if it could not be computed.
  std::vector<double> factor;
  int iterations = 0;
};

// Deterministic. Returns x = 0 if the numbers fail, which a larger Hessian cures.
[[nodiscard]] ProgramSolution solve(const QuadraticProgram& program);

// Solves A x = b by Cholesky; `a` holds the lower triangle of a positive definite matrix, row-major, and is overwritten
// by its factor. False if it is not positive definite.
[[nodiscard]] bool factorise(std::vector<double>& a, int size);
void solve_factorised(const std::vector<double>& factor, int size, std::vector<double>& b);

}  // namespace ballast::plan
