// The invariants: statements that hold in every run, for every scenario and every fault. They are judged by the plant's
// true state and the scenario's limits, without any code of the monitor, the firmware or the run.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"
#include "tools/sil/lap.h"
#include "tools/sil/run.h"
#include "tools/soak/fault_windows.h"

namespace ballast::soak {

enum class Invariant {
  kDetected,
  kNoFalseAlarm,
  kTruthful,
  kAgreed,
  kInRegime,
  kSwitched,
  kObeyed,
  kLatched,
  kAtRest,
  kLogged,
  kEnded,
  kFinite,
  kInOrder,
  kPatient,
  kRepeatable,
  kGoverned,
  kHalted,
};
inline constexpr int kInvariantCount = 17;

struct InvariantText {
  const char* name;
  const char* statement;
};
const InvariantText& text_of(Invariant invariant);

// The first time that an invariant did not hold.
struct Broken {
  Invariant invariant;
  std::int64_t tick;
  std::string text;  // the observed and the expected value
};

// Checks one run: observe() after every tick, finish() at its end.
class Invariants {
 public:
  explicit Invariants(const sim::Scenario& scenario);

  // `truth` is the plant's true state in that lap.
  void observe(const sil::Lap& lap, const sim::Plant::Sample& truth);
  // Also checks the log.
  void finish(const sil::RunResult& result, const std::string& log_path);

  // At most one entry per invariant, in the order in which they broke.
  [[nodiscard]] const std::vector<Broken>& broken() const { return broken_; }
  // The run has had more ticks than its duration allows and should be ended.
  [[nodiscard]] bool too_long() const { return laps_ > most_laps_; }
  // Hash of all events in the log.
  [[nodiscard]] std::uint64_t log_hash() const { return log_hash_; }
  // The true ball has left the envelope at some time.
  [[nodiscard]] bool violated() const { return violated_; }

 private:
  using Sample = sim::Plant::Sample;

  void fail(Invariant invariant, std::int64_t tick, const std::string& text);
  void check_order(const sil::Lap& lap);
  void check_steps(const sil::Lap& lap);
  void check_verdict(const sil::Lap& lap);
  void check_trip(const sil::Lap& lap, const Sample& truth);
  void check_modes(const sil::Lap& lap);
  void compare_forces(const sil::Lap& lap);
  void check_agreement(const sil::Lap& lap);
  void check_regime(const sil::Lap& lap, const Sample& truth);
  void check_switches(const sil::Lap& lap, const Sample& truth);
  void check_finite(const sil::Lap& lap);
  void check_envelope(const sil::Lap& lap, const Sample& truth);
  [[nodiscard]] bool governs_exactly(const sil::Lap& lap) const;
  void check_governed(const sil::Lap& lap, const Sample& truth);
  void check_monitors_alarm(const Sample& truth);
  void check_controllers_alarm(const sil::Lap& lap);
  void check_obeyed(const sil::Lap& lap);
  void check_stop(const sil::Lap& lap, const Sample& truth);
  void expect_in_log(const sil::Lap& lap);
  void finish_detected(const sil::RunResult& result);
  void finish_stop(const sil::RunResult& result);
  void finish_end(const sil::RunResult& result);
  void read_log(const std::string& path, bool cut_short);

  void note_disturbances(const sil::Lap& lap, const Sample& truth);
  [[nodiscard]] bool has_fault(sim::FaultKind kind) const;
  [[nodiscard]] bool explained(const trip_t& trip) const;
  [[nodiscard]] std::vector<operator_t> counted_commands(const controller_status_t& status);

  const sim::Scenario& scenario_;
  bool has_controller_;
  FaultWindows windows_;
  bool bus_faults_active_ = false;  // in this tick messages may be missing, late or wrong
  std::vector<Broken> broken_;

  std::int64_t laps_ = 0, most_laps_;
  bool starts_rolling_, has_rolled_;
  std::int64_t tick_ = 0;  // of the latest lap
  bool has_ended_ = false;
  bool violated_ = false;
  std::int64_t undetected_ticks_ = 0;  // consecutive ticks in which the ball was outside without a trip
  // In the latest lap: the ball is outside or within rounding of it; monitor and controller are both silent.
  bool outside_within_rounding_ = false, outside_ = false, too_light_ = false, all_silent_ = false;
  std::int8_t regime_ = contact_t::REGIME_ROLLING;  // by the latest contact message
  // So far: the ball has been off the floor or slid on it; a fault has begun, or a mass was far from where it is sent;
  // masses have swung hard.
  bool has_slid_ = false, disturbed_ = false;
  double most_swing_ = 0;     // of the real forces about the commanded ones, in N
  bool no_estimate_ = false;  // the controller has had no estimate to go by
  bool over_an_end_ = false;  // commanded over a closed switch: now, or since messages are late

  bool monitor_tripped_ = false;      // by its latest message
  std::int64_t first_trip_tick_ = 0;  // tick of its first message with a trip
  trip_t trip_{};                     // that message
  bool has_status_ = false;
  controller_status_t status_{};         // the latest
  bool controller_tripped_ = false;      // now
  bool controller_has_tripped_ = false;  // at some time
  std::uint32_t faults_ = 0;             // the controller's, since it tripped
  std::deque<operator_t> commands_;      // given, and not yet counted by the controller
  // The latest tick's difference of plant and controller in N or f_s where they can be compared, and whether the
  // monitor can see it.
  double apart_n_ = 0;
  std::int64_t apart_tick_ = std::numeric_limits<std::int64_t>::min();
  // A latch that has opened because a peer was restarted. The run has to end in that tick with that reason.
  std::optional<Broken> reopened_latch_;

  std::array<std::int64_t, sim::kMaxMasses> position_steps_{}, steps_issued_{};
  bool stopping_ = false;                             // by a trip or by the operator
  std::int64_t rest_due_tick_ = 0;                    // from the start of this tick on the masses have to stand
  double stop_ticks_ = 0;                             // duration of the planned stop
  std::array<bool, sim::kMaxMasses> carried_away_{};  // masses that are further away than their motors could hold
  double top_speed_mps_ = 0;
  Sample truth_{};  // the latest

  struct Logged {
    const char* channel;
    std::int64_t tick;
    std::uint64_t hash;  // of its number, time and bytes
  };
  std::vector<Logged> expected_;
  std::vector<char> bytes_;
  std::uint64_t log_hash_ = 0;
};

}  // namespace ballast::soak
