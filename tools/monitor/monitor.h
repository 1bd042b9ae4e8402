// The monitor's judgement: is the ball inside its performance envelope, and is everybody still talking?
// Shares its limits with the rest of Ballast, and not a line of logic. No clock, no input or output.
#pragma once

#include <ballast/contact_t.hpp>
#include <ballast/plant_state_t.hpp>
#include <ballast/sensors_t.hpp>
#include <ballast/trip_t.hpp>
#include <cstdint>
#include <limits>
#include <optional>

namespace ballast::monitor {

struct MonitorLimits {
  double min_normal_force_n = 0;     // trips when N <= this, in every regime
  double friction_use = 1;           // trips when f_s > friction_use mu_s N; > 0
  double static_friction = 0;        // mu_s > 0; infinity: perfect friction
  bool controller_expected = false;  // false in prescribed runs
  // How far plant and controller may be apart about N or f_s; infinity: they need not agree.
  double disagreement_n = std::numeric_limits<double>::infinity();
  std::int64_t scenario_id = 0;  // only passed on, in every trip_t
};

// The controller's own N and f_s, in one status.
struct Estimate {
  double normal_force_n = 0;
  double static_friction_n = 0;
};

// What has been heard about one tick. nullptr: it did not come.
struct Samples {
  const contact_t* contact = nullptr;
  const plant_state_t* plant_state = nullptr;
  const sensors_t* sensors = nullptr;
  std::optional<std::int64_t> controller_tick;  // of the newest controller_status_t ever heard
  std::optional<Estimate> estimate;             // in that one
};

// Call judge() once per tick. The first cause found is kept for ever, with its tick, time, value and limit. Causes are
// looked for in this order:
//   repeated      the tick is not after the last one                         value: tick seen, limit: tick expected
//   missing       it is not the one after the last one (any tick may be      value: tick seen, limit: tick expected
//                 the first), or a message is absent or of another tick
//                 (then seen: its tick; absent: the last tick judged)
//   nonfinite     a NaN or infinity in time, N, f_s, friction force,         value: 0, limit: 0
//                 plant state or sensors; mu_required may be +infinity
//   normal_force  N <= min_normal_force, now or since the message before     value: least N, limit: min_normal_force
//   friction      f_s > friction_use mu_s N, likewise, or the ball slides    value: greatest f_s / N,
//                 after it has been seen to roll (the kinetic friction is    limit: friction_use mu_s; +infinity
//                 less, but rolling is lost); with perfect friction only              with perfect friction
//                 the latter, of a floor that is not what it should be
//   stale         the controller's newest status is older than the tick      value: age, limit: age allowed, in ticks
//                 before; one never heard counts as one tick too old;
//                 at the first tick there is nothing yet to be heard; or
//                 it is of a tick still to come (then the age is negative)
//   disagreement  while the ball rolls: N or f_s of the masses as          value: the greater difference, in N,
//                 commanded, by the plant's equations, and by the          limit: disagreement_n
//                 controller's of the same instant, which came in its
//                 status a tick later. Two derivations that share no
//                 line: one of them is wrong, or was told another robot,
//                 attitude or motion. Not judged where either is not
//                 finite, or the plant's floor would have to pull.
//                 Also a margin that is better than N and f_s of the       value: the f_s it hides, in N,
//                 same message make it on the floor of the limits          limit: what rounding can hide
//                 (a worse floor makes it less); none with perfect
//                 friction
class Monitor {
 public:
  explicit Monitor(const MonitorLimits& limits);

  trip_t judge(const Samples& samples);

  // The whole plant has been silent for longer than allowed: trips as stale on the tick that was expected.
  trip_t silence(double silent_ticks, double allowed_ticks);

  // The latest verdict; before the first tick: alive, waiting (tick -3).
  [[nodiscard]] const trip_t& verdict() const { return verdict_; }

  static constexpr std::int64_t kAllowedControllerAge =
      1;  // the status of tick k-1 is the newest there can be in tick k

 private:
  void trip(std::int8_t cause, double value, double limit);
  void judge_envelope(const Samples& samples);
  void judge_agreement(const Samples& samples);

  MonitorLimits limits_;
  std::optional<std::int64_t> last_tick_;  // the latest judged
  double time_s_ = 0;                      // of the sample being judged
  bool has_rolled_ = false;                // in some sample judged
  std::optional<Estimate> commanded_;      // by the plant, at last_tick_
  trip_t verdict_{};
};

}  // namespace ballast::monitor
