// The monitor's judgement: is the ball inside its performance envelope, and do plant and controller still report?
// Shares its limits with the rest of Ballast, and not a line of logic. Has no clock, input or output.
#pragma once

#include <ballast/contact_t.hpp>
#include <ballast/controller_status_t.hpp>
#include <ballast/plant_state_t.hpp>
#include <ballast/sensors_t.hpp>
#include <ballast/trip_t.hpp>
#include <cstdint>
#include <limits>
#include <optional>

namespace ballast::monitor {

struct MonitorLimits {
  double min_normal_force_n = 0;  // trips when N <= this, in every regime
  double friction_use = 1;        // trips when f_s > friction_use mu_s N; > 0
  double static_friction = 0;     // mu_s > 0; infinity: perfect friction
  // mu_s of the floor that the plant's margins belong to, of its roughest place where it changes; 0: static_friction.
  // Another one where the limits are those of a floor that is only believed.
  double margin_friction = 0;
  bool starts_rolling = false;       // a ball that slides from the first message on has slipped
  bool controller_expected = false;  // false in prescribed runs
  // How far plant and controller may differ in N or f_s; infinity: they need not agree.
  double disagreement_n = std::numeric_limits<double>::infinity();
  // The part of the contact force by which |friction_force_W_n| and static_friction_n of rolling may differ.
  double turned_part = 1e-10;
  std::int64_t scenario_id = 0;  // passed on in every trip_t
  std::int64_t first_tick = -2;  // of the run; any tick may be the first judged
};

// The messages heard about one tick. A null pointer: the message did not come.
struct Samples {
  const contact_t* contact = nullptr;
  const plant_state_t* plant_state = nullptr;
  const sensors_t* sensors = nullptr;
  const controller_status_t* status = nullptr;  // the newest ever heard
};

// Call judge() once per tick. The first cause found is kept for ever, with its tick, time, value and limit. The causes
// are checked in this order:
//
//   repeated      The tick is not after the last one.
//                 value: its tick; limit: the tick expected.
//   missing       The tick is not the one after the last (any tick may be the first), or a message is absent or of
//                 another tick.
//                 value: the tick of that message, or of the last one judged if it is absent; limit: the tick expected.
//   nonfinite     A NaN or infinity in time, N, f_s, friction force, plant state or sensors. mu_required may be
//                 +infinity.
//                 value and limit: 0.
//   normal_force  N <= min_normal_force, now or since the message before.
//                 value: the least N; limit: min_normal_force.
//   friction      f_s > friction_use mu_s N, now or since the message before; or the ball slides after it has been seen
//                 to roll, where the kinetic friction is less but rolling is lost. With perfect friction only the
//                 latter trips: the floor is then not what it should be.
//                 value: the greatest f_s / N; limit: friction_use mu_s, +infinity with perfect friction.
//   stale         The controller's newest status is older than the tick before, or of a tick still to come. A status
//                 never heard counts as one tick too old, except at the first tick.
//                 value: its age, negative if it is of a tick to come; limit: the age allowed; both in ticks.
//   disagreement  While the ball rolls, N or f_s of the commanded masses differs between the plant's equations and the
//                 controller's, at the instant that both name (commanded_tick). The controller's come in its status a
//                 tick later with a sensed attitude; an estimated one comes with them, and the plant answers it a tick
//                 later. The two derivations share no line: one is wrong, or was told another robot, attitude or
//                 motion. Not judged where either is not finite, or where the plant's floor would have to pull. value:
//                 the greater difference; limit: disagreement_n; both in N. Also a margin better than N and f_s of the
//                 same message allow on the plant's floor (a worse floor lowers it), or a margin of NaN; not with
//                 perfect friction. value: the f_s it hides; limit: the f_s that rounding can hide; both in N. Also,
//                 while the ball rolls, a friction force whose magnitude is not the f_s of the same message. value: the
//                 difference; limit: what rounding can make of it; both in N.
class Monitor {
 public:
  explicit Monitor(const MonitorLimits& limits);

  trip_t judge(const Samples& samples);

  // Call when the whole plant has been silent for longer than allowed: trips as stale on the expected tick.
  trip_t silence(double silent_ticks, double allowed_ticks);

  // The latest verdict; before the first tick one of hal::kWaitingTick.
  [[nodiscard]] const trip_t& verdict() const { return verdict_; }

  // In tick k the status of tick k-1 is the newest there can be.
  static constexpr std::int64_t kAllowedControllerAge = 1;

 private:
  [[nodiscard]] std::int64_t due_tick() const;
  void trip(std::int8_t cause, double value, double limit);
  void judge_envelope(const Samples& samples);
  void judge_agreement(const Samples& samples);
  void judge_forces(const controller_status_t* status);

  // N and f_s of the commanded masses, for comparison with the status of `tick`.
  struct Forces {
    std::int64_t tick;
    double normal_n, static_friction_n;
    [[nodiscard]] bool known() const;
  };

  MonitorLimits limits_;
  std::optional<std::int64_t> last_tick_;  // the latest judged
  double time_s_ = 0;                      // of the sample being judged
  bool has_rolled_;                        // in some sample judged
  std::optional<Forces> commanded_;        // by the plant, in the newest contact of rolling
  trip_t verdict_{};
};

}  // namespace ballast::monitor
