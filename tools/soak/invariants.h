// What has to hold in every run, whatever the scenario and whatever goes wrong in it. This is the one place where it is
// written down. Nothing of the monitor, the firmware or the run is used to judge them: the truth is the plant's state,
// the limits are the scenario's.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"
#include "tools/sil/lap.h"
#include "tools/sil/run.h"

namespace ballast::soak {

enum class Invariant {
  kDetected,
  kNoFalseAlarm,
  kObeyed,
  kLatched,
  kAtRest,
  kLogged,
  kEnded,
  kFinite,
  kInOrder,
  kPatient,
  kRepeatable,
};
inline constexpr int kInvariantCount = 11;

struct InvariantText {
  const char* name;
  const char* statement;
};
const InvariantText& text_of(Invariant invariant);

// The first time that one of them did not hold.
struct Broken {
  Invariant invariant;
  std::int64_t tick;
  std::string text;  // what was seen, and what was due
};

// Of one run: see() after every tick, finish() at its end. It changes nothing.
class Invariants {
 public:
  explicit Invariants(const sim::Scenario& scenario);

  // `truth` is the plant's state of that lap.
  void see(const sil::Lap& lap, const sim::Plant::Sample& truth);
  // Also reads the log.
  void finish(const sil::RunResult& result, const std::string& log_path);

  // At most one of each, in the order in which they broke.
  [[nodiscard]] const std::vector<Broken>& broken() const { return broken_; }
  // The run has had more ticks than it can need: it should be ended.
  [[nodiscard]] bool endless() const { return laps_ > most_laps_; }
  // Of every byte that had to be in the log.
  [[nodiscard]] std::uint64_t log_hash() const { return log_hash_; }
  // The truth has left the envelope at some time.
  [[nodiscard]] bool violated() const { return violated_; }

 private:
  using Sample = sim::Plant::Sample;

  void fail(Invariant invariant, std::int64_t tick, const char* format, ...) __attribute__((format(printf, 4, 5)));
  void see_order(const sil::Lap& lap);
  void see_steps(const sil::Lap& lap);
  void see_verdict(const sil::Lap& lap);
  void see_controller_latch(const sil::Lap& lap);
  void see_finite(const sil::Lap& lap);
  void see_envelope(const sil::Lap& lap, const Sample& truth);
  void see_alarm(const sil::Lap& lap, const Sample& truth);
  void see_obeyed(const sil::Lap& lap);
  void see_stop(const sil::Lap& lap, const Sample& truth);
  void expect_in_log(const sil::Lap& lap);
  void finish_detected(const sil::RunResult& result);
  void finish_stop(const sil::RunResult& result);
  void finish_end(const sil::RunResult& result);
  void read_log(const std::string& path, bool cut_short);

  [[nodiscard]] bool suffers(sim::FaultKind kind) const;

  const sim::Scenario& scenario_;
  bool has_controller_;
  // Messages, peers or the sensors' clock suffer: from then on who speaks may be late, and believe what was not said.
  double bus_suffers_from_s_ = std::numeric_limits<double>::infinity();
  bool bus_suffers_ = false;
  std::vector<Broken> broken_;

  std::int64_t laps_ = 0, most_laps_;
  std::int64_t tick_ = 0;  // of the latest lap
  bool has_ended_ = false;
  bool has_rolled_ = false, violated_ = false;
  std::int64_t undetected_ticks_ = 0;  // in which the truth was outside, on end
  // In the latest lap: the truth is outside, or at the edge; both who could notice are silent.
  bool outside_but_for_rounding_ = false, nobody_left_ = false;
  bool at_an_end_ = false;  // some true mass has been at an end of its rail

  bool monitor_tripped_ = false;      // as it last said
  std::int64_t heard_trip_tick_ = 0;  // in which it first did
  trip_t trip_{};                     // the first that is tripped
  bool controller_heard_ = false;
  controller_status_t status_{};  // the latest
  bool controller_tripped_ = false;
  std::uint32_t faults_ = 0;  // of the controller, since it tripped
  // A latch that has opened: a peer was started again, and the run has to end in that tick, saying so.
  std::optional<Broken> taken_back_;

  std::array<std::int64_t, sim::kMaxMasses> position_steps_{}, steps_issued_{};
  std::int64_t rest_due_tick_ = 0;                    // of a stop: from whose start on the masses have to stand
  double stop_ticks_ = 0;                             // what it promised to take
  std::array<bool, sim::kMaxMasses> carried_away_{};  // a mass further from there than its motor's field could hold it
  double top_speed_mps_ = 0;
  Sample truth_{};  // the latest

  struct Logged {
    const char* channel;
    std::int64_t tick;
    std::uint64_t hash;  // of time and bytes
  };
  std::vector<Logged> expected_;
  std::vector<char> bytes_;
  std::uint64_t log_hash_ = 0;
};

}  // namespace ballast::soak
