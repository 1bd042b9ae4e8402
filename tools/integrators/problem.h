// The problem an integrator solves: M y' = f(t, y), with M the unit matrix, or the unit matrix with a 0 in the row
// of a constraint 0 = f_c(t, y).
#pragma once

#include <array>
#include <cstddef>

namespace ballast::integrators {

inline constexpr std::size_t kMaxSize = 9;
using State = std::array<double, kMaxSize>;  // the first size() entries are used

class Problem {
 public:
  Problem() = default;
  virtual ~Problem() = default;
  Problem(const Problem&) = delete;
  Problem& operator=(const Problem&) = delete;

  [[nodiscard]] virtual std::size_t size() const = 0;
  virtual void rhs(double t, const double* y, double* f) const = 0;
  virtual void jacobian(double t, const double* y, double* out) const = 0;  // df_i/dy_k at out[i + size k]

  // Constrained problems.
  [[nodiscard]] virtual int constraint() const { return -1; }  // its row; -1: none
  // y' at a y that obeys the constraint.
  virtual void slope(double t, const double* y, double* dydt) const { rhs(t, y, dydt); }
  // Takes the best row from y on. To be called before the first step and after every one. True: the row has changed,
  // and values of f that a method has kept are no longer valid.
  virtual bool choose_constraint(const double*) { return false; }
};

}  // namespace ballast::integrators
