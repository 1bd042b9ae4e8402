// The plant's side of the bus, against a monitor and a controller that are played: whatever else is said, what a lap
// holds are the first answers to its own tick.
#include "tools/sil/lcm_peers.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/sil/shell.h"

namespace ballast::sil {
namespace {

using hal::Status;

constexpr std::int64_t kScenarioId = 4711;
constexpr std::int64_t kRunId = 7;
constexpr std::int64_t kTick = 5;
constexpr int kRight = 1, kWrong = 2;  // marks in the messages

// Everything the peers say is on its way before exchange() is called, so that its order is known; one process and one
// sender, so the bus keeps that order.
class LcmPeersTest : public testing::Test {
 protected:
  LcmPeersTest() : url_(test::bus_url(24)), plant_bus_(url_), peer_bus_(url_), peers_(plant_bus_, options()) {
    EXPECT_TRUE(plant_bus_.good() && peer_bus_.good()) << "no multicast on this machine?";
    peer_bus_.join(kRunId);
    lap_.plant.contact.tick = lap_.plant.state.tick = lap_.plant.sensors.tick = kTick;
    lap_.plant.sensors.scenario_id = kScenarioId;
  }

  static LcmPeersOptions options() {
    LcmPeersOptions o;
    o.scenario_id = kScenarioId;
    o.run_id = kRunId;
    o.peer_timeout = hal::Seconds(2);  // only ever waited for where an answer never comes
    return o;
  }

  void trip(std::int64_t tick, int mark, bool tripped = false) {
    trip_t m{};
    m.tick = tick;
    m.tripped = tripped ? 1 : 0;
    m.scenario_id = kScenarioId;
    m.value = mark;
    ASSERT_EQ(peer_bus_.publish(hal::kChannelTrip, m), Status::kOk);
  }
  void status(std::int64_t tick, int mark) {
    controller_status_t m{};
    m.tick = tick;
    m.scenario_id = kScenarioId;
    m.overruns = mark;
    ASSERT_EQ(peer_bus_.publish(hal::kChannelControllerStatus, m), Status::kOk);
  }
  void steps(std::int64_t tick, int mark) {
    step_command_t m{};
    m.tick = tick;
    m.motor_count = 1;
    m.position_steps[0] = mark;
    ASSERT_EQ(peer_bus_.publish(hal::kChannelStepCommand, m), Status::kOk);
  }

  // Either the peers are caught out, or nobody has noticed because nothing wrong came through.
  void expect_nothing_wrong_in_the_lap() {
    if (peers_.exchange(lap_) != Status::kOk) {
      EXPECT_NE(peers_.trouble(), "");
      return;
    }
    expect_right_lap();
  }
  void expect_right_lap() const {
    EXPECT_EQ(lap_.verdict->tick, kTick);
    EXPECT_EQ(lap_.verdict->value, kRight);
    EXPECT_EQ(lap_.answer->status.tick, kTick);
    EXPECT_EQ(lap_.answer->status.overruns, kRight);
    EXPECT_EQ(lap_.answer->steps.tick, kTick + 1);
    EXPECT_EQ(lap_.answer->steps.position_steps[0], kRight);
  }

  std::string url_;
  hal::Bus plant_bus_, peer_bus_;
  LcmPeers peers_;
  Lap lap_;
};

TEST_F(LcmPeersTest, TakesTheAnswersOfItsTick) {
  trip(kTick, kRight);
  status(kTick, kRight);
  steps(kTick + 1, kRight);
  ASSERT_EQ(peers_.exchange(lap_), Status::kOk) << peers_.trouble();
  expect_right_lap();
}

// The plant's own message may come back after the answers to it, where a processor stands still in between: that is
// nobody else in the next tick.
TEST_F(LcmPeersTest, ItsOwnMessageMayComeBackLast) {
  for (std::int64_t tick = kTick; tick < kTick + 3; ++tick) {
    trip(tick, kRight);
    status(tick, kRight);
    steps(tick + 1, kRight);
    lap_.plant.contact.tick = lap_.plant.state.tick = lap_.plant.sensors.tick = tick;
    ASSERT_EQ(peers_.exchange(lap_), Status::kOk) << peers_.trouble();
  }
}

class OtherTick : public LcmPeersTest, public testing::WithParamInterface<int> {};

TEST_P(OtherTick, AnswersAreNoneOfThisLap) {
  trip(kTick + GetParam(), kWrong);
  status(kTick + GetParam(), kWrong);
  steps(kTick + GetParam() + 1, kWrong);
  EXPECT_NE(peers_.exchange(lap_), Status::kOk);
  EXPECT_NE(peers_.trouble(), "");
}

INSTANTIATE_TEST_SUITE_P(LcmPeers, OtherTick, testing::Values(-1, +1));

// Here with the right answers at their heels.
TEST_F(LcmPeersTest, OldAnswersBeforeTheRightOnes) {
  trip(kTick - 1, kWrong);
  status(kTick - 1, kWrong);
  steps(kTick, kWrong);
  trip(kTick, kRight);
  status(kTick, kRight);
  steps(kTick + 1, kRight);
  expect_nothing_wrong_in_the_lap();
}

// And after them, while the last one is still missing.
TEST_F(LcmPeersTest, OldStepsAfterTheRightOnes) {
  steps(kTick + 1, kRight);
  steps(kTick, kWrong);
  status(kTick, kRight);
  trip(kTick, kRight);
  expect_nothing_wrong_in_the_lap();
}

TEST_F(LcmPeersTest, OldVerdictAndStatusAfterTheRightOnes) {
  trip(kTick, kRight);
  status(kTick, kRight);
  trip(kTick - 1, kWrong);
  status(kTick - 1, kWrong);
  steps(kTick + 1, kRight);
  expect_nothing_wrong_in_the_lap();
}

TEST_F(LcmPeersTest, ASecondStepCommandDoesNotReplaceTheFirst) {
  steps(kTick + 1, kRight);
  steps(kTick + 1, kWrong);
  status(kTick, kRight);
  trip(kTick, kRight);
  expect_nothing_wrong_in_the_lap();
}

TEST_F(LcmPeersTest, ASecondStatusDoesNotReplaceTheFirst) {
  status(kTick, kRight);
  status(kTick, kWrong);
  trip(kTick, kRight);
  steps(kTick + 1, kRight);
  expect_nothing_wrong_in_the_lap();
}

TEST_F(LcmPeersTest, ASecondVerdictDoesNotReplaceTheFirst) {
  trip(kTick, kRight);
  trip(kTick, kWrong);
  steps(kTick + 1, kRight);
  status(kTick, kRight);
  expect_nothing_wrong_in_the_lap();
}

// Messages of another run are counted, and the lap is as without them. A lap holds the same in every run.
TEST_F(LcmPeersTest, AnotherRunsAnswersAreNotHeard) {
  for (const std::int64_t run_id : {kRunId + 1, std::int64_t{0}}) {
    peer_bus_.join(run_id);
    trip(kTick, kWrong, true);
    status(kTick, kWrong);
    steps(kTick + 1, kWrong);
  }
  peer_bus_.join(kRunId);
  trip(kTick, kRight);
  status(kTick, kRight);
  steps(kTick + 1, kRight);
  ASSERT_EQ(peers_.exchange(lap_), Status::kOk) << peers_.trouble();
  expect_right_lap();
  EXPECT_EQ(peers_.refused().here.foreign, 6);
  EXPECT_EQ(lap_.verdict->run_id + lap_.answer->status.run_id + lap_.answer->steps.run_id, 0);
}

// A monitor that was started again knows of no trip; the run must not end as if there had been none.
TEST_F(LcmPeersTest, ATripTakenBackEndsTheRun) {
  trip(kTick, kRight, true);
  status(kTick, kRight);
  steps(kTick + 1, kRight);
  ASSERT_EQ(peers_.exchange(lap_), Status::kOk) << peers_.trouble();
  trip(kTick + 1, kRight, false);
  status(kTick + 1, kRight);
  steps(kTick + 2, kRight);
  lap_.plant.contact.tick = lap_.plant.state.tick = lap_.plant.sensors.tick = kTick + 1;
  EXPECT_EQ(peers_.exchange(lap_), Status::kForeignPeer);
  EXPECT_NE(peers_.trouble().find("takes back the trip"), std::string::npos) << peers_.trouble();
}

}  // namespace
}  // namespace ballast::sil
