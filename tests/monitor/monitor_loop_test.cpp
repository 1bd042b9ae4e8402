// The monitor as a process: over the loopback network, against a plant and a controller played by the test.
#include "tools/monitor/monitor_loop.h"

#include <gtest/gtest.h>

#include <deque>
#include <thread>

#include "hal/lcm/channels.h"
#include "tests/conformance/test_bus.h"

namespace ballast::monitor {
namespace {

using hal::Seconds;
using hal::Status;

constexpr std::int64_t kScenarioId = 42;
constexpr double kControlPeriod_s = 0.001;
constexpr Seconds kLong{30};  // waited for only if the test fails
constexpr Seconds kShort{2};  // the monitor's patience

MonitorLimits limits(bool controller_expected) {
  MonitorLimits l;
  l.static_friction = 0.3;
  l.controller_expected = controller_expected;
  l.scenario_id = kScenarioId;
  return l;
}

// The world, and the monitor in a thread of its own (each with its own bus, so nothing is shared but what is read after
// join).
class MonitorLoopTest : public ::testing::Test {
 protected:
  MonitorLoopTest() : bus_(hal::test::test_bus_url()), loop_bus_(hal::test::test_bus_url()) {
    EXPECT_TRUE(bus_.good() && loop_bus_.good()) << "no multicast on this machine?";
    bus_.join(7);
    bus_.subscribe<trip_t>(hal::kChannelTrip, [this](const trip_t& m) { trips_.push_back(m); });
  }
  ~MonitorLoopTest() override {
    if (thread_.joinable()) thread_.join();
  }

  void start(bool controller_expected, Seconds start_timeout = kLong, Seconds peer_timeout = kShort) {
    monitor_.emplace(limits(controller_expected));
    loop_.emplace(
        loop_bus_, *monitor_, limits(controller_expected),
        MonitorLoopOptions{
            .control_period_s = kControlPeriod_s, .start_timeout = start_timeout, .peer_timeout = peer_timeout});
    thread_ = std::thread([this] { end_ = loop_->run(); });
  }
  Status end() {
    thread_.join();
    return end_;
  }

  void send_contact(std::int64_t tick, bool last = false, double normal_force_n = 10) {
    contact_t m{};
    m.tick = tick;
    m.utime = 1000 * tick;
    m.time_s = 0.001 * static_cast<double>(tick);
    m.normal_force_n = m.normal_force_min_n = normal_force_n;
    m.last = last ? 1 : 0;
    ASSERT_EQ(bus_.publish(hal::kChannelContact, m), Status::kOk);
  }
  void send_state(std::int64_t tick, bool last = false) {
    plant_state_t m{};
    m.tick = tick;
    m.orientation[0] = 1;
    m.last = last ? 1 : 0;
    ASSERT_EQ(bus_.publish(hal::kChannelPlantState, m), Status::kOk);
  }
  void send_sensors(std::int64_t tick, bool last = false, std::int64_t scenario_id = kScenarioId) {
    sensors_t m{};
    m.tick = tick;
    m.scenario_id = scenario_id;
    m.orientation[0] = 1;
    m.last = last ? 1 : 0;
    ASSERT_EQ(bus_.publish(hal::kChannelSensors, m), Status::kOk);
  }
  void send_plant(std::int64_t tick, bool last = false, double normal_force_n = 10) {
    send_contact(tick, last, normal_force_n);
    send_state(tick, last);
    send_sensors(tick, last);
  }
  void send_status(std::int64_t tick, std::int64_t scenario_id = kScenarioId) {
    controller_status_t m{};
    m.tick = tick;
    m.scenario_id = scenario_id;
    ASSERT_EQ(bus_.publish(hal::kChannelControllerStatus, m), Status::kOk);
  }
  // The next verdict that is not the waiting one.
  trip_t verdict() {
    const auto there = [this] {
      while (!trips_.empty() && trips_.front().tick == hal::kWaitingTick) trips_.pop_front();
      return !trips_.empty();
    };
    if (bus_.receive_until(hal::after(hal::WallClock::now(), kLong), there) != Status::kOk) {
      ADD_FAILURE() << "no verdict";
      return {};
    }
    const trip_t trip = trips_.front();
    trips_.pop_front();
    return trip;
  }
  void wait_until_ready() {
    ASSERT_EQ(bus_.receive_until(hal::after(hal::WallClock::now(), kLong), [this] { return !trips_.empty(); }),
              Status::kOk);
    EXPECT_EQ(trips_.front().tick, hal::kWaitingTick);
    EXPECT_EQ(trips_.front().scenario_id, kScenarioId);
    EXPECT_EQ(trips_.front().tripped, 0);
  }

  hal::Bus bus_, loop_bus_;
  std::deque<trip_t> trips_;
  std::optional<Monitor> monitor_;
  std::optional<MonitorLoop> loop_;
  std::thread thread_;
  Status end_ = Status::kOk;
};

TEST_F(MonitorLoopTest, JudgesEveryTickToTheEnd) {
  start(true);
  wait_until_ready();
  for (std::int64_t k = -2; k <= 20; ++k) {
    if (k == 5) {  // any order will do
      send_sensors(k);
      send_state(k);
      send_contact(k);
      send_status(k - 1);
    } else {
      send_status(k - 1);
      send_plant(k, k == 20);
    }
    const trip_t trip = verdict();
    EXPECT_EQ(trip.tick, k);
    EXPECT_EQ(trip.utime, 1000 * k);
    EXPECT_EQ(trip.tripped, 0);
    EXPECT_EQ(trip.scenario_id, kScenarioId);
  }
  EXPECT_EQ(end(), Status::kEnded);
  EXPECT_EQ(loop_->trouble(), "");
  EXPECT_EQ(loop_->verdict().tripped, 0);
}

TEST_F(MonitorLoopTest, TripsAndGoesOn) {
  start(false);
  wait_until_ready();
  send_plant(0);
  EXPECT_EQ(verdict().tripped, 0);
  send_plant(1, false, 0);
  EXPECT_EQ(verdict().cause, trip_t::CAUSE_NORMAL_FORCE);
  send_plant(2, true);
  const trip_t trip = verdict();
  EXPECT_EQ(trip.tick, 2);
  EXPECT_EQ(trip.tripped, 1);
  EXPECT_EQ(trip.trip_tick, 1);
  EXPECT_EQ(end(), Status::kEnded);
  EXPECT_EQ(loop_->verdict().cause, trip_t::CAUSE_NORMAL_FORCE);
}

TEST_F(MonitorLoopTest, SilentPlantIsNamedAfterAStaleVerdict) {
  start(true);
  wait_until_ready();
  for (std::int64_t k = 0; k < 3; ++k) {
    send_plant(k);
    EXPECT_EQ(verdict().tripped, 0);
    send_status(k);
  }
  const trip_t trip = verdict();
  EXPECT_EQ(trip.tick, 3);
  EXPECT_EQ(trip.cause, trip_t::CAUSE_STALE);
  EXPECT_GE(trip.value, trip.limit);
  EXPECT_EQ(trip.limit, kShort.count() / kControlPeriod_s);
  EXPECT_EQ(end(), Status::kPeerLost);
  EXPECT_EQ(loop_->trouble(), "lost plant: no contact for 2 s after tick 2");
}

TEST_F(MonitorLoopTest, SilentControllerIsNamedThoughThePlantStopsWithIt) {
  start(true);
  wait_until_ready();
  send_plant(0);
  EXPECT_EQ(verdict().tripped, 0);
  send_status(0);
  send_plant(1);
  EXPECT_EQ(verdict().tripped, 0);  // and no status of tick 1 any more, so no plant either
  EXPECT_EQ(verdict().cause, trip_t::CAUSE_STALE);
  EXPECT_EQ(end(), Status::kPeerLost);
  EXPECT_EQ(loop_->trouble(), "lost controller: no status for 2 s after tick 1");
}

// The controller cannot answer a tick of which it got nothing: that it is silent too is no fault of its own.
TEST_F(MonitorLoopTest, PlantThatEndsWithinATickIsNamed) {
  start(true);
  wait_until_ready();
  send_plant(0);
  EXPECT_EQ(verdict().tripped, 0);
  send_status(0);
  send_contact(1);  // and then the plant is gone
  EXPECT_EQ(verdict().cause, trip_t::CAUSE_MISSING);
  EXPECT_EQ(verdict().tick, 2);
  EXPECT_EQ(end(), Status::kPeerLost);
  EXPECT_EQ(loop_->trouble(), "lost plant: no contact for 2 s after tick 1");
}

TEST_F(MonitorLoopTest, VerdictsGoOnWithoutTheController) {
  start(true);
  wait_until_ready();
  send_plant(0);
  EXPECT_EQ(verdict().tripped, 0);
  for (std::int64_t k = 1; k < 5; ++k) {
    send_plant(k, k == 4);
    const trip_t trip = verdict();
    EXPECT_EQ(trip.tick, k);
    EXPECT_EQ(trip.cause, trip_t::CAUSE_STALE);
    EXPECT_EQ(trip.trip_tick, 1);
  }
  EXPECT_EQ(end(), Status::kEnded);
  EXPECT_EQ(loop_->trouble(), "lost controller: no status for 1 s after tick 0");
}

TEST_F(MonitorLoopTest, PartOfATickTripsAsMissingBeforeTheTimeout) {
  start(false);
  wait_until_ready();
  send_plant(0);
  EXPECT_EQ(verdict().tripped, 0);
  send_contact(1);
  send_sensors(1);
  trip_t trip = verdict();
  EXPECT_EQ(trip.tick, 1);
  EXPECT_EQ(trip.cause, trip_t::CAUSE_MISSING);
  send_plant(2, true);
  trip = verdict();
  EXPECT_EQ(trip.tick, 2);
  EXPECT_EQ(trip.trip_tick, 1);
  EXPECT_EQ(end(), Status::kEnded);
}

TEST_F(MonitorLoopTest, SkippedTickTripsAsMissing) {
  start(false);
  wait_until_ready();
  send_plant(0);
  EXPECT_EQ(verdict().tripped, 0);
  send_plant(2, true);
  const trip_t trip = verdict();
  EXPECT_EQ(trip.cause, trip_t::CAUSE_MISSING);
  EXPECT_EQ(trip.value, 2);
  EXPECT_EQ(trip.limit, 1);
  EXPECT_EQ(end(), Status::kEnded);
}

TEST_F(MonitorLoopTest, MessageLostForGoodIsMissingAsSoonAsThePlantGoesOn) {
  start(false);
  wait_until_ready();
  send_plant(0);
  EXPECT_EQ(verdict().tripped, 0);
  send_contact(1);
  send_state(1);
  send_plant(2, true);
  EXPECT_EQ(verdict().cause, trip_t::CAUSE_MISSING);
  EXPECT_EQ(verdict().tick, 2);
  EXPECT_EQ(end(), Status::kEnded);
}

TEST_F(MonitorLoopTest, RepeatedTickTrips) {
  start(false);
  wait_until_ready();
  send_plant(0);
  EXPECT_EQ(verdict().tripped, 0);
  send_contact(0);
  trip_t trip = verdict();
  EXPECT_EQ(trip.cause, trip_t::CAUSE_REPEATED);
  EXPECT_EQ(trip.value, 0);
  EXPECT_EQ(trip.limit, 1);
  send_plant(1, true);
  EXPECT_EQ(verdict().tick, 1);
  EXPECT_EQ(end(), Status::kEnded);
  EXPECT_EQ(loop_->counters().repeated, 1);
}

// A repeated tick never gets complete. The verdict on it comes at once and not half a peer timeout later: the
// controller waits for it, and the masses move on.
TEST_F(MonitorLoopTest, RepeatedTickIsJudgedAtOnce) {
  start(false, kLong, 2 * kLong);
  wait_until_ready();
  send_plant(0);
  EXPECT_EQ(verdict().tripped, 0);
  const auto sent = hal::WallClock::now();
  send_contact(0);
  EXPECT_EQ(verdict().cause, trip_t::CAUSE_REPEATED);
  EXPECT_LT(Seconds(hal::WallClock::now() - sent), kLong / 3);  // half a peer timeout is kLong
  send_plant(1, true);
  EXPECT_EQ(verdict().tick, 1);
  EXPECT_EQ(end(), Status::kEnded);
}

TEST_F(MonitorLoopTest, MessageTwiceWithinATickTrips) {
  start(false);
  wait_until_ready();
  send_contact(0);
  send_plant(0, true);
  EXPECT_EQ(verdict().cause, trip_t::CAUSE_REPEATED);
  EXPECT_EQ(end(), Status::kEnded);
}

TEST_F(MonitorLoopTest, RefusesAnotherScenario) {
  start(true);
  wait_until_ready();
  send_sensors(0, false, kScenarioId + 1);
  EXPECT_EQ(end(), Status::kForeignScenario);
  EXPECT_EQ(loop_->trouble(), "plant runs another scenario");
  EXPECT_EQ(loop_->counters().foreign, 1);
}

TEST_F(MonitorLoopTest, RefusesAControllerOfAnotherScenario) {
  start(true);
  wait_until_ready();
  send_status(hal::kWaitingTick, kScenarioId + 1);
  EXPECT_EQ(end(), Status::kForeignScenario);
  EXPECT_EQ(loop_->trouble(), "controller runs another scenario");
}

// A stranger who says N = 0, of a run before this one or of none, does not trip it.
TEST_F(MonitorLoopTest, OtherRunsAreCountedAndNotJudged) {
  start(false);
  wait_until_ready();
  send_plant(0);
  EXPECT_EQ(verdict().tripped, 0);
  for (const std::int64_t run_id : {8, 0}) {
    bus_.join(run_id);
    send_contact(1, true, 0);
  }
  bus_.join(7);
  send_plant(1, true);
  EXPECT_EQ(verdict().tripped, 0);
  EXPECT_EQ(end(), Status::kEnded);
  EXPECT_EQ(loop_->counters().foreign, 2);
}

TEST_F(MonitorLoopTest, MalformedMessagesAreCountedAndIgnored) {
  start(false);
  wait_until_ready();
  contact_t bad{};
  bad.regime = 99;
  ASSERT_EQ(bus_.publish(hal::kChannelContact, bad), Status::kOk);
  ASSERT_EQ(bus_.publish(hal::kChannelSensors, bad), Status::kOk);
  send_plant(0, true);
  EXPECT_EQ(verdict().tripped, 0);
  EXPECT_EQ(end(), Status::kEnded);
  EXPECT_EQ(loop_->counters().malformed, 2);
}

TEST_F(MonitorLoopTest, NobodyThereIsSaid) {
  start(true, Seconds(0.2));
  EXPECT_EQ(end(), Status::kPeerLost);
  EXPECT_EQ(loop_->trouble(), "lost plant and controller: no message for 0.2 s before the first tick");
}

}  // namespace
}  // namespace ballast::monitor
