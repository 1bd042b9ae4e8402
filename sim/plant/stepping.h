// The integrator's steps: as long as the error estimate allows, and the state at any place inside them.
//
// Masses under a controller, and slides, are integrated from pulse to pulse and tick to tick. Dormand-Prince 5(4) takes
// them where its step reaches the next pulse, and slides always. DOP853 takes twice the evaluations and steps more than
// twice as far. The state inside a step comes from integrating again from its start.
//
// Rolling and flying with prescribed masses are smooth and known in advance: DOP853 steps ahead over any number of
// ticks, and its dense output gives the state inside a step. The quaternion is brought back to unit length after each
// step.
#pragma once

#include <string>

#include "sim/integrators/dop853.h"
#include "sim/integrators/dormand_prince.h"
#include "sim/plant/equations.h"

namespace ballast::sim {

// A stretch of time from where the plant is that has been integrated but not yet judged. Length 0: there is none.
struct Span {
  double length_s = 0;
  bool exact = false;  // its end is to be called end_s, whatever rounding makes of start + length_s
  double end_s = 0;
};

class Stepping {
 public:
  // Within one call of advance(); a robot at 1 kHz takes a few.
  static constexpr int kMaxSteps = 2'000'000;

  explicit Stepping(const PlantModel& model);

  // Bounds the number of trial steps from here to the next call.
  void begin_advance();

  // The next span on the way to target_s. Its length is 0 if the trial step was too long; the next call tries a shorter
  // one. Forces and prescribed motion have to be smooth up to smooth_until_s >= target_s.
  Span next_span(Dynamics& dynamics, double target_s, double smooth_until_s);
  // Why no further step is possible. kPainleve: sliding has no solution from here on.
  enum class Failure { kNone, kTooSmall, kPainleve, kNotFinite, kTooStiff };
  [[nodiscard]] Failure failure() const { return failure_; }

  // The state at dynamics.time_s + offset_s, inside the latest step.
  void look_inside(const Dynamics& dynamics, double offset_s, Point& out);
  // The same by the step's interpolation where that is cheaper: good enough to search by.
  void glance_inside(const Dynamics& dynamics, double offset_s, Point& out);
  // The end of a span, and the state and motion in its middle.
  void look_at_span(const Dynamics& dynamics, const Span& span, Point& middle, Point& end);

  // Whether the part of a slide's step that look_inside() last integrated is within the tolerance. If not, the next
  // step is shorter.
  [[nodiscard]] bool slide_part_holds(double part_s);
  // The regime has ended at dynamics.time_s, inside a step: what follows starts from there.
  void cut_step(Dynamics& dynamics);

  static void normalise(State& y);

 private:
  template <class Method>
  [[nodiscard]] double relative_error(const Method& method, const Equations& equations) const;
  template <class Method>
  double try_step(Method& method, double& allowed_s, Dynamics& dynamics, double longest_s);
  Span next_driven_span(Dynamics& dynamics, double target_s);
  template <class Method>
  void look_again(Method& probe, const Dynamics& dynamics, double offset_s, Point& out);
  void aim_slip(Dynamics& dynamics);

  double tolerance_;
  State mass_scale_{};  // of driven masses: what their errors while rolling are relative to
  double control_period_s_;
  double fifth_step_s_, eighth_step_s_;  // the lengths that the error estimates last allowed
  int steps_left_ = 0;
  Failure failure_ = Failure::kNone;
  Instant scratch_{};  // the motion at the latest evaluation
  // State at the start of the latest step.
  State step_y_{};
  State step_dydt_{};
  DormandPrince<kStateCapacity> fifth_;
  Dop853<kStateCapacity> eighth_;
  // The latest step of driven masses is eighth_'s, and its dense output is prepared.
  bool by_eighth_ = false, dense_ = false;
  // Integrate again from the start of a step.
  DormandPrince<kStateCapacity> fifth_probe_;
  Dop853<kStateCapacity> eighth_probe_;
  // The span of a step ahead.
  double ahead_start_s_ = 0;
  double ahead_end_s_ = -1;  // before the time now: no step reaches beyond it
};

}  // namespace ballast::sim
