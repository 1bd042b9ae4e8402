// A watcher's view of messages that come, do not come, come late or twice, and of the next run on the same bus.
#include "tools/watch/view.h"

#include <gtest/gtest.h>

#include <limits>

#include "hal/lcm/channels.h"

namespace ballast::watch {
namespace {

contact_t contact(std::int64_t tick, double margin = 0.5) {
  contact_t m{};
  m.tick = tick;
  m.time_s = static_cast<double>(tick) * 1e-3;
  m.normal_force_n = m.normal_force_min_n = 4;
  m.mu_required = m.mu_required_max = 0.35 * (1 - margin);
  m.margin = margin;
  return m;
}

bool says(const std::string& text, const std::string& words) { return text.find(words) != std::string::npos; }

TEST(TickCounter, CountsWhatIsMissingAndForgivesWhatIsLate) {
  TickCounter counter;
  for (const std::int64_t tick : {100, 101, 105, 103}) counter.add(tick, 0);
  EXPECT_EQ(counter.count(), 4);
  EXPECT_EQ(counter.missed(), 2) << "102 and 104; 103 was late, and what came before 100 is not known";
}

TEST(TickCounter, StartsAgainWithTheNextRun) {
  TickCounter counter;
  counter.add(5000, 0);
  counter.add(5002, 0);
  counter.add(-2, 1);
  EXPECT_EQ(counter.count(), 1);
  EXPECT_EQ(counter.missed(), 0);
}

// 500 messages evenly over 2 s are 250 per second; after them, nothing.
TEST(TickCounter, GivesTheRateAndLetsItGoToZero) {
  TickCounter counter;
  for (int i = 0; i <= 500; ++i) counter.add(i, 0.004 * i);
  EXPECT_NEAR(counter.rate_hz(2), 250, 2);  // one message more or less at the window's edge
  EXPECT_EQ(counter.rate_hz(10), 0);
}

TEST(View, NothingHeardIsNothingSaid) {
  const View view;
  EXPECT_TRUE(view.empty());
  EXPECT_FALSE(view.ended());
}

TEST(View, ShowsTheFirstOfTwoRunsAndSaysThatThereIsAnother) {
  View view;
  contact_t ours = contact(700, 0.5), theirs = contact(90, 0.1);
  ours.run_id = 11;
  theirs.run_id = 12;
  controller_status_t waiting{};  // a peer of no run: neither ours nor another's
  waiting.tick = hal::kWaitingTick;
  waiting.mode = controller_status_t::MODE_TRIPPED;
  for (int i = 0; i < 20; ++i) {
    const double now_s = 0.1 * i;
    ours.tick = 700 + i;
    ours.last = i == 19 ? 1 : 0;
    view.observe(ours, now_s);
    if (i == 5) {
      EXPECT_FALSE(says(view.page(now_s, 100, 0), "ANOTHER RUN")) << view.page(now_s, 100, 0);
    }
    view.observe(waiting, now_s);
    if (i >= 8) view.observe(theirs, now_s);
    if (i == 10) {
      EXPECT_TRUE(says(view.page(now_s, 100, 0), "ANOTHER RUN on this bus")) << view.page(now_s, 100, 0);
      EXPECT_TRUE(says(view.page(now_s, 100, 0), "tick 710")) << view.page(now_s, 100, 0);
      EXPECT_TRUE(says(view.page(now_s, 100, 0), "least 0.500")) << "of ours: " << view.page(now_s, 100, 0);
      EXPECT_TRUE(says(view.line(now_s, 0), " another_run_on_this_bus")) << view.line(now_s, 0);
      EXPECT_FALSE(says(view.line(now_s, 0), "mode=tripped")) << view.line(now_s, 0);
    }
  }
  // Ours said its last message at 1.9 s and theirs the next one: from then on theirs is shown, alone.
  EXPECT_FALSE(view.ended());
  EXPECT_TRUE(says(view.page(2, 100, 0), "tick 90")) << view.page(2, 100, 0);
  EXPECT_FALSE(says(view.page(2, 100, 0), "ANOTHER RUN")) << view.page(2, 100, 0);
}

TEST(View, ASilentRunGivesWay) {
  View view;
  contact_t ours = contact(700), theirs = contact(90);
  ours.run_id = 11;
  theirs.run_id = 12;
  view.observe(ours, 0);
  view.observe(theirs, 1);
  EXPECT_TRUE(says(view.line(1, 0), "t=0.700")) << view.line(1, 0);
  view.observe(theirs, 3);
  EXPECT_TRUE(says(view.line(3, 0), "t=0.090")) << view.line(3, 0);
}

TEST(View, SaysThatARunIsSilent) {
  View view;
  EXPECT_FALSE(says(view.line(100, 0), "silent")) << "nobody is";
  view.observe(contact(700), 0);
  EXPECT_FALSE(says(view.line(1.9, 0), "silent"));
  EXPECT_TRUE(says(view.line(7, 0), " silent=7s")) << view.line(7, 0);
  EXPECT_TRUE(says(view.page(7, 80, 0), "SILENT for 7 s: the run is stopped, or has ended without a last message\n"))
      << view.page(7, 80, 0);
  view.observe(contact(701), 8);
  EXPECT_FALSE(says(view.line(8, 0), "silent"));
  contact_t last = contact(702);
  last.last = 1;
  view.observe(last, 9);
  EXPECT_FALSE(says(view.line(20, 0), "silent")) << "it has ended";
}

TEST(View, JoinsLateKeepsExtremesAndEnds) {
  View view;
  view.observe(contact(700, 0.5), 0);
  view.observe(contact(701, 0.1), 0);
  contact_t last = contact(702, 0.8);
  last.last = 1;
  view.observe(last, 0);
  EXPECT_TRUE(view.ended());
  const std::string line = view.line(0, 0);
  for (const char* words : {"t=0.702", "rolling", "margin=0.800", "least=0.100", "mode=none", "trip=no_monitor",
                            "missed=0", "undecodable=0", "ended"}) {
    EXPECT_TRUE(says(line, words)) << words << ": " << line;
  }
  // The next run on this bus is a new one.
  view.observe(contact(-2, 0.9), 1);
  EXPECT_FALSE(view.ended());
  EXPECT_TRUE(says(view.line(1, 0), "least=0.900")) << view.line(1, 0);
}

TEST(View, SaysTripModeAndDrops) {
  View view;
  view.observe(contact(10), 0);
  view.observe(contact(14), 0);
  trip_t trip{};
  trip.tick = 14;
  trip.tripped = 1;
  trip.cause = trip_t::CAUSE_FRICTION;
  trip.value = 0.4;
  trip.limit = 0.35;
  view.observe(trip, 0);
  controller_status_t status{};
  status.tick = 14;
  status.mode = controller_status_t::MODE_TRIPPED;
  status.refused_messages = 5;
  view.observe(status, 0);
  EXPECT_TRUE(says(view.line(0, 7), "refused=5"));
  const std::string page = view.page(0, 100, 7);
  for (const char* words :
       {"messages refused 5", "TRIP   friction", "0.4, limit 0.35", "mode   tripped", "contact 3", "undecodable 7"}) {
    EXPECT_TRUE(says(page, words)) << words << "\n" << page;
  }
}

// Heartbeats of peers that wait for a plant are no ticks.
TEST(View, ShowsWhatTheRobotKnowsWhereItKnows) {
  View view;
  view.observe(contact(10), 0);
  controller_status_t status{};
  status.tick = 10;
  view.observe(status, 0);
  EXPECT_FALSE(says(view.page(0, 200, 0), "known")) << view.page(0, 200, 0);
  EXPECT_FALSE(says(view.line(0, 0), "measured")) << view.line(0, 0);

  status.measured_valid = status.estimate_valid = status.slip_detected = 1;
  status.measured_mu_required = 0.25;
  status.measured_mu_sigma = 0.01;
  status.measured_normal_force_n = 16;
  status.measured_normal_sigma_n = 0.5;
  status.estimated_position_W_m[0] = 1.5;
  status.position_sigma_m = 0.125;
  status.tilt_sigma_rad = 0.01;
  plant_state_t state{};
  state.tick = 10;
  state.position_W_m[0] = 1.5;
  state.position_W_m[1] = -0.25;
  view.observe(status, 0);
  view.observe(state, 0);
  const std::string page = view.page(0, 200, 0);
  EXPECT_TRUE(says(page, "f_s/N 0.250 +-0.020, N 16 +-1 N measured  SLIP\n")) << page;
  EXPECT_TRUE(says(page, "place (1.500, 0.000) +-0.250 m, off by 0.25 m, tilt +-1.15 deg")) << page;
  EXPECT_TRUE(says(view.line(0, 0), " measured=0.250 slip mode=")) << view.line(0, 0);
}

TEST(View, PeersThatWaitAreShownWithoutAPlant) {
  View view;
  trip_t trip{};
  trip.tick = hal::kWaitingTick;
  view.observe(trip, 0);
  view.observe(trip, 1);
  EXPECT_FALSE(view.empty());
  EXPECT_TRUE(says(view.line(1, 0), "no plant yet")) << view.line(1, 0);
  EXPECT_TRUE(says(view.line(1, 0), "missed=0")) << view.line(1, 0);
}

// In flight N = 0 and the margin -1; a controller gone mad sends NaN; a narrow terminal cuts lines, never the program.
TEST(View, NonsenseAndNarrowTerminalsAreDrawnToo) {
  View view;
  contact_t nonsense = contact(0, std::numeric_limits<double>::quiet_NaN());
  nonsense.normal_force_n = -std::numeric_limits<double>::infinity();
  nonsense.mu_required = std::numeric_limits<double>::infinity();
  view.observe(nonsense, 0);
  contact_t flight = contact(1, -1);
  flight.regime = contact_t::REGIME_FLIGHT;
  flight.normal_force_n = 0;
  view.observe(flight, 0);
  plant_state_t state{};
  state.mass_count = 8;
  view.observe(state, 0);
  for (const int width : {1, 20, 79, 500}) {
    const std::string page = view.page(0, width, 0);
    std::size_t start = 0;
    for (std::size_t end; (end = page.find('\n', start)) != std::string::npos; start = end + 1) {
      EXPECT_LE(end - start, static_cast<std::size_t>(width));
    }
    EXPECT_EQ(start, page.size()) << "every line ends";
  }
}

}  // namespace
}  // namespace ballast::watch
