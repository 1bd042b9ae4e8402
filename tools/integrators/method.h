// A numerical method, step by step. Which there are: methods.h.
#pragma once

#include <cstdint>
#include <string>

#include "tools/integrators/problem.h"

namespace ballast::integrators {

struct Counters {
  std::int64_t steps = 0;     // accepted
  std::int64_t rejected = 0;  // by the error estimate, or because Newton's iteration did not converge
  std::int64_t right_hand_sides = 0;
  std::int64_t jacobians = 0;
};

class Method {
 public:
  Method() = default;
  virtual ~Method() = default;
  Method(const Method&) = delete;
  Method& operator=(const Method&) = delete;

  // Begins at (t, y), forgetting whatever was before: at the start, and after a kink.
  virtual void start(double t, const State& y) = 0;

  // One accepted step, its length the method's choice but not beyond `stop`, which the last step before it meets
  // exactly. False: it cannot go on, and failure() says why in words, without the time.
  [[nodiscard]] virtual bool step(double stop) = 0;

  [[nodiscard]] double time() const { return time_; }
  [[nodiscard]] const State& state() const { return y_; }
  [[nodiscard]] double step_start() const { return step_start_; }

  // The solution at t inside the last step, by the method's own interpolant.
  virtual void dense(double t, State& y) = 0;
  // The same as accurately as the step itself: one-step methods go there by a step from step_start().
  virtual void exact(double t, State& y) { dense(t, y); }

  [[nodiscard]] const Counters& counters() const { return counters_; }  // dense() and exact() do not count
  [[nodiscard]] const std::string& failure() const { return failure_; }

 protected:
  double time_ = 0, step_start_ = 0;
  State y_{};
  Counters counters_;
  std::string failure_;
};

}  // namespace ballast::integrators
