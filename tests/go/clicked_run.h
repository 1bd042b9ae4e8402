// A run in which an operator clicks places, one after the other, and the ball goes there.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "sim/scenario/scenario.h"
#include "tools/sil/run_result.h"

namespace ballast::go_test {

struct Click {
  std::int64_t tick = 0;
  Eigen::Vector2d to_m = Eigen::Vector2d::Zero();
  int lost_part = -1;     // this part of the course is not sent
  int delayed_ticks = 0;  // by which its planner is later than it said
  double duration_s = 0;  // asked for; 0: none
  bool halt = false;      // instead of a place: a halt of the ball
  bool sets_out = false;  // a long way is planned up to a rest on it, and from there on when the ball is there
};

struct Clicked {
  bool planned = false;
  std::string why;          // not planned
  double plan_s = 0;        // wall time of planning, up to the ball's setting out
  int courses = 0;          // that came in force, one after the other
  bool on_the_way = false;  // the newest of them ends at a rest on the way
  int parts = 0;
  std::int64_t sent_tick = 0, decided_tick = 0;  // of the first part; of the answer
  bool in_force = false;
  int refusal = 0;       // of the controller: controller_status_t
  bool rolling = false;  // the course began while the ball rolled
  double way_m = 0;      // from the ball's place at the click to the place clicked
  double off_m = 0;      // from the place clicked to the ball's at the run's end or the next click
  double duration_s = 0;
  bool over = false;  // the course was, when off_m was taken
};

// A halt that was clicked while the ball rolled.
struct Halted {
  std::int64_t tick = 0;  // of the command
  bool said = false;      // how far the ball still rolls, last said
  std::int64_t said_tick = 0, from_tick = 0;
  double said_m = 0;
  double rolled_m = 0;  // from from_tick on, up to the last tick in which the ball was faster than rest
  double rest_s = 0;    // up to there, from the command on
  bool rests = false;
};

struct ClickedRun {
  sil::RunResult result;
  std::vector<Clicked> clicked;
  std::vector<Halted> halted;
  int halts = 0;                 // before a click, of a ball that the governor had on its backup
  double greatest_jerk_use = 0;  // of the commanded accelerations' changes, over max_jerk times the period
};

// desk_ball, armed, governed, without a motion of its own.
[[nodiscard]] sim::Scenario clickable(double duration_s, const std::vector<std::string>& overrides = {});

// Each click is planned in its own tick; the course is sent `latency` ticks later, as a planner takes them. A click
// while another course is being handed over waits for its end. A plan that takes more than `time_limit_s` of wall time
// is given up.
[[nodiscard]] ClickedRun run_clicked(const sim::Scenario& scenario, const std::vector<Click>& clicks, int latency,
                                     double time_limit_s = 60);

}  // namespace ballast::go_test
