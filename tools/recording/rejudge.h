// Judges a recorded run again: the monitor is run on the recorded messages and its verdicts are compared with the
// recorded ones, and the plant's messages are held to what every message of a plant satisfies.
//
//   time          time_s is the tick's, also in the last message unless the run ended between two ticks; utime is
//                 time_s in us; plant state and sensors have the same.
//   forces        |friction_force_W| is f_s; commanded_tick is the tick, or the one before where the attitude is
//                 estimated; mu_required, commanded_mu_required and margin are those of N and f_s; N is
//                 not below the least N, nor f_s / N above the greatest. In flight all are 0.
//   state         The orientation is a unit quaternion. While the ball rolls, the geometric centre is at height 0 and
//                 moves at omega x r e3. Each mass is on its rail where mass_position says, and the centre of mass is
//                 that of shell and masses.
//   sensors       Attitude and rate are the plant state's, unless the scenario has faults of sensors; the rate also
//                 unless it has [sensors]. An attitude that is estimated is not in the message. No sample is of a tick
//                 still to come.
//
// Each rule recomputes a number from others of the same tick, so its tolerance is rounding. Accelerometer, torques,
// lost steps, mass velocities and the place on the floor follow from no other field and are not judged.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "sim/plant/local_floor.h"
#include "sim/scenario/scenario.h"
#include "tools/sil/local_peers.h"

namespace ballast::sil {

// The first finding.
struct Misjudged {
  std::int64_t tick = 0;
  std::string text;
};

class Rejudge {
 public:
  // The scenario must outlive the object.
  Rejudge(const sim::Scenario& scenario, const monitor::MonitorLimits& limits);

  // A recorded tick, with the recorded verdict and answer if there are any.
  void observe(const Lap& recorded);
  [[nodiscard]] const std::optional<Misjudged>& first() const { return first_; }
  [[nodiscard]] std::int64_t ticks_with_findings() const { return ticks_with_findings_; }
  // Whether verdicts are compared. With faults of messages or peers the log does not tell what the monitor heard.
  [[nodiscard]] bool judges_verdicts() const { return monitor_ != nullptr; }

 private:
  void expect(bool good, const std::string& text);
  void check_verdict(const Lap& recorded);
  void check_time(const Lap& recorded);
  void check_forces(const contact_t& contact, const Eigen::Vector2d& place_W_m);
  void check_state(const Lap& recorded);
  void check_sensors(const Lap& recorded);

  const sim::Scenario& scenario_;
  double turned_part_;
  bool sensors_are_true_, floor_is_known_;
  sim::LocalFloor floor_;
  std::unique_ptr<LocalMonitor> monitor_;
  std::int64_t tick_ = 0;
  bool found_ = false;  // in this tick
  std::optional<Misjudged> first_;
  std::int64_t ticks_with_findings_ = 0;
};

}  // namespace ballast::sil
