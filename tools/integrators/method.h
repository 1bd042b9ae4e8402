// A numerical method, step by step. methods.h lists them.
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

  // Begins at (t, y) and forgets all earlier steps. Called at the start and after a kink.
  virtual void start(double t, const State& y) = 0;

  // Makes one accepted step. The method chooses its length and does not pass `stop`; the last step ends exactly there.
  // False: it cannot go on, and failure() gives the reason, without the time.
  [[nodiscard]] virtual bool step(double stop) = 0;

  [[nodiscard]] double time() const { return time_; }
  [[nodiscard]] const State& state() const { return y_; }
  [[nodiscard]] double step_start() const { return step_start_; }

  // The solution at t inside the last step, by the method's own interpolant.
  virtual void dense(double t, State& y) = 0;
  // The solution as accurate as the step itself. One-step methods make a step from step_start() to t.
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
