#include "tools/sil/trip_watch.h"

#include <gtest/gtest.h>

namespace ballast::sil {
namespace {

class Watched {
 public:
  void lap(std::int64_t tick, std::int8_t mode, bool at_rest) {
    Lap lap;
    lap.plant.contact.tick = tick;
    lap.answer.emplace();
    lap.answer->status.tick = tick;
    lap.answer->status.mode = mode;
    lap.answer->status.at_rest = at_rest ? 1 : 0;
    watch.observe(lap, {});
  }

  TripWatch watch{true};
};

// The status says what holds from the next tick on, whose steps are executed a tick later.
TEST(TripWatch, AStopIsDoneWhenItsLastStepsAre) {
  Watched run;
  run.lap(10, controller_status_t::MODE_RUNNING, false);
  EXPECT_FALSE(run.watch.stopping());
  run.lap(11, controller_status_t::MODE_TRIPPED, false);
  EXPECT_TRUE(run.watch.stopping());
  EXPECT_FALSE(run.watch.stop_done(20));
  run.lap(12, controller_status_t::MODE_TRIPPED, true);
  EXPECT_FALSE(run.watch.stop_done(13));
  EXPECT_TRUE(run.watch.stop_done(14));
}

// An operator resets and starts again: the run must not end before the second stop does.
TEST(TripWatch, ASecondStopIsNotDoneWithTheFirst) {
  Watched run;
  run.lap(10, controller_status_t::MODE_RUNNING, false);
  run.lap(11, controller_status_t::MODE_TRIPPED, true);
  run.lap(12, controller_status_t::MODE_DISARMED, true);
  EXPECT_FALSE(run.watch.stop_done(13)) << "released by the operator";
  run.lap(13, controller_status_t::MODE_RUNNING, false);
  run.lap(14, controller_status_t::MODE_TRIPPED, false);
  EXPECT_FALSE(run.watch.stop_done(16));
  run.lap(15, controller_status_t::MODE_TRIPPED, true);
  EXPECT_TRUE(run.watch.stop_done(17));
  ASSERT_TRUE(run.watch.controller_trip());
  EXPECT_EQ(run.watch.controller_trip()->tick, 11) << "the first trip is the one that is told";
}

}  // namespace
}  // namespace ballast::sil
