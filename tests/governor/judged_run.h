// Runs of random robots, judged by whether they leave the friction cone of the true robot.
#pragma once

#include <cstdint>
#include <string>

#include "tests/governor/random_robot.h"

namespace ballast::governor_test {

struct Judged {
  bool started = false;  // false: no stop could be certified
  bool broken = false;   // slipped or lifted off
  double most_use = 0;   // greatest f_s / (mu_s N)
  double time_s = 0;     // of that
  double largest_bend = 0;
  // The plant's runs, at ticks, as parts of mu_s: what the motors added to the commanded f_s / N at most, and what the
  // governor kept free for them at most.
  double motors_added = 0, allowed = 0;
  std::string other;  // another trouble than the cone, such as lost steps
};

// Ideal masses: the controller's ticks and the firmware's closed forms of the true robot.
[[nodiscard]] Judged run_ideal(const Draw& draw, bool governed);

// The plant and its motors.
[[nodiscard]] Judged run_plant(const Draw& draw, bool governed);

// A robot whose errors are at corners of their bounds beside the believed one, with the same commands: the motion for a
// random time, then brakes, then 16 sqrt(r / g) with held masses.
struct Astrayed {
  bool rolled = false;  // the believed robot needs less than 0.6 of friction all the time
  // Greatest f_s / N of the true robot over the believed one's with all that its errors may add, where that is less
  // than 0.3; below 0: never more. And the greatest part of the bound that was seen.
  double over = -1, part = 0;
};
[[nodiscard]] Astrayed lead_astray(const Draw& draw);

// Certified plans that are run to their end from random instants of a robot's run.
struct Instants {
  struct Margins {
    int count = 0, off = 0;  // off by more than 0.02: issue 22
    double worst = 0;
  };
  int forks = 0;         // of these:
  int broken = 0;        // left the cone before backup_until_tick
  double worst_use = 0;  // greatest f_s / (mu_s N)
  // Margins predicted against those seen, of plans begun before their switch. The margin of a plan that holds for ever
  // is a bound, which is off where less is seen. Others are off in both directions; `far` are those begun more than a
  // horizon (16 sqrt(r / g)) before their switch.
  Margins near, far, for_ever;
};
[[nodiscard]] Instants fork_at_instants(const Draw& draw, int count);

}  // namespace ballast::governor_test
