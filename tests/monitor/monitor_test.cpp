// The monitor's judgement: every cause, each on both sides of its boundary.
#include "tools/monitor/monitor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "hal/lcm/channels.h"

namespace ballast::monitor {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr int kMassCount = 3;

// Powers of two, so that friction_use mu_s N below is exact and "exactly at the limit" means just that.
MonitorLimits limits() {
  MonitorLimits l;
  l.min_normal_force_n = 0.5;
  l.friction_use = 0.5;
  l.static_friction = 0.25;
  l.controller_expected = true;
  l.scenario_id = 42;
  return l;
}

// One tick's messages, all well inside the limits.
struct Tick {
  contact_t contact{};
  plant_state_t state{};
  sensors_t sensors{};
  std::optional<controller_status_t> status;

  explicit Tick(std::int64_t tick) {
    status.emplace().tick = tick - 1;
    contact.tick = state.tick = sensors.tick = contact.commanded_tick = tick;
    contact.utime = state.utime = sensors.utime = 1000 * tick;
    contact.time_s = state.time_s = 0.001 * static_cast<double>(tick);
    contact.normal_force_n = 8;
    contact.static_friction_n = contact.friction_force_W_n[1] = 0.25;
    contact.mu_required = contact.mu_required_max = 0.25 / 8;
    contact.normal_force_min_n = 8;
    state.orientation[0] = sensors.orientation[0] = 1;
    state.mass_count = sensors.mass_count = kMassCount;
  }
  Samples samples() const { return {&contact, &state, &sensors, status ? &*status : nullptr}; }
};

void expect_trip(const trip_t& verdict, std::int8_t cause, std::int64_t tick, double value, double limit) {
  EXPECT_EQ(verdict.tripped, 1);
  EXPECT_EQ(verdict.cause, cause);
  EXPECT_EQ(verdict.trip_tick, tick);
  EXPECT_EQ(verdict.value, value);
  EXPECT_EQ(verdict.limit, limit);
}

void expect_quiet(const trip_t& verdict) {
  EXPECT_EQ(verdict.tripped, 0);
  EXPECT_EQ(verdict.cause, trip_t::CAUSE_NONE);
  EXPECT_EQ(verdict.trip_tick, 0);
  EXPECT_EQ(verdict.value, 0);
  EXPECT_EQ(verdict.limit, 0);
}

// The verdict on a tick changed by `change`, after three good ones (ticks 0, 1, 2; the changed one is 3).
trip_t judge_changed(const MonitorLimits& l, const std::function<void(Tick&)>& change) {
  Monitor monitor(l);
  for (std::int64_t k = 0; k < 3; ++k) expect_quiet(monitor.judge(Tick(k).samples()));
  Tick tick(3);
  change(tick);
  return monitor.judge(tick.samples());
}
trip_t judge_changed(const std::function<void(Tick&)>& change) { return judge_changed(limits(), change); }

TEST(Monitor, WaitsBeforeTheFirstTick) {
  const Monitor monitor(limits());
  expect_quiet(monitor.verdict());
  EXPECT_EQ(monitor.verdict().tick, hal::kWaitingTick);
  EXPECT_EQ(monitor.verdict().scenario_id, 42);
}

// A run that starts rolling, and slides in the first message: of a monitor that is started again, or on a floor that is
// worse than the limits'.
TEST(Monitor, TripsOnASlideInTheFirstMessageOfARunThatStartsRolling) {
  for (const bool starts_rolling : {true, false}) {
    MonitorLimits of_run = limits();
    of_run.starts_rolling = starts_rolling;
    Monitor monitor(of_run);
    Tick tick(7);
    tick.contact.regime = contact_t::REGIME_SLIDING;
    EXPECT_EQ(monitor.judge(tick.samples()).tripped, starts_rolling ? 1 : 0);
    if (starts_rolling) EXPECT_EQ(monitor.verdict().cause, trip_t::CAUSE_FRICTION);
  }
}

// Margins belong to the plant's floor, which may be better than the one that is believed.
TEST(Monitor, HoldsMarginsAgainstThePlantsFloor) {
  for (const double plants : {0.0, 0.8}) {
    MonitorLimits of_run = limits();
    of_run.margin_friction = plants;
    Monitor monitor(of_run);
    Tick tick(0);
    contact_t& c = tick.contact;
    c.margin = 1 - c.static_friction_n / (0.8 * c.normal_force_n);
    const trip_t verdict = monitor.judge(tick.samples());
    EXPECT_EQ(verdict.tripped, plants == 0 ? 1 : 0);
    if (plants == 0) EXPECT_EQ(verdict.cause, trip_t::CAUSE_DISAGREEMENT);
  }
}

TEST(Monitor, QuietInsideTheEnvelope) {
  Monitor monitor(limits());
  for (std::int64_t k = -2; k < 100; ++k) {
    const trip_t verdict = monitor.judge(Tick(k).samples());
    expect_quiet(verdict);
    EXPECT_EQ(verdict.tick, k);
    EXPECT_EQ(verdict.utime, 1000 * k);
    EXPECT_EQ(verdict.scenario_id, 42);
  }
}

TEST(Monitor, NormalForceTripsAtItsLimit) {
  expect_trip(judge_changed([](Tick& t) {
                t.contact.normal_force_n = 0.5;
                t.contact.static_friction_n = t.contact.friction_force_W_n[1] = 0;
              }),
              trip_t::CAUSE_NORMAL_FORCE, 3, 0.5, 0.5);
  expect_trip(judge_changed([](Tick& t) { t.contact.normal_force_n = -1; }), trip_t::CAUSE_NORMAL_FORCE, 3, -1, 0.5);
}

TEST(Monitor, NormalForceAboveItsLimitIsFine) {
  expect_quiet(judge_changed([](Tick& t) {
    t.contact.normal_force_n = std::nextafter(0.5, 1);
    t.contact.static_friction_n = t.contact.friction_force_W_n[1] = 0;
  }));
}

TEST(Monitor, NormalForceTripsInEveryRegime) {
  for (const std::int8_t regime : {contact_t::REGIME_ROLLING, contact_t::REGIME_SLIDING, contact_t::REGIME_FLIGHT}) {
    expect_trip(judge_changed([regime](Tick& t) {
                  t.contact.regime = regime;
                  t.contact.normal_force_n = 0;
                  t.contact.static_friction_n = t.contact.friction_force_W_n[1] = 0;
                }),
                trip_t::CAUSE_NORMAL_FORCE, 3, 0, 0.5);
  }
}

TEST(Monitor, FrictionAtItsLimitIsFine) {
  expect_quiet(
      judge_changed([](Tick& t) { t.contact.static_friction_n = t.contact.friction_force_W_n[1] = 0.5 * 0.25 * 8; }));
}

TEST(Monitor, FrictionAboveItsLimitTrips) {
  const double just_above_n = std::nextafter(1.0, 2);
  expect_trip(
      judge_changed([=](Tick& t) { t.contact.static_friction_n = t.contact.friction_force_W_n[1] = just_above_n; }),
      trip_t::CAUSE_FRICTION, 3, just_above_n / 8, 0.125);
}

// Kinetic friction is within the cone: what has been lost shows in the regime only.
TEST(Monitor, SlidingAfterRollingTrips) {
  expect_trip(judge_changed([](Tick& t) {
                t.contact.regime = contact_t::REGIME_SLIDING;
                t.contact.static_friction_n = t.contact.friction_force_W_n[1] = 0.5;
              }),
              trip_t::CAUSE_FRICTION, 3, 0.5 / 8, 0.125);
}

TEST(Monitor, ABallThatStartsSlidingHasLostNothing) {
  Monitor monitor(limits());
  for (std::int64_t k = 0; k < 5; ++k) {
    Tick tick(k);
    tick.contact.regime = contact_t::REGIME_SLIDING;
    tick.contact.static_friction_n = tick.contact.friction_force_W_n[1] = 0.5;
    expect_quiet(monitor.judge(tick.samples()));
  }
  expect_quiet(monitor.judge(Tick(5).samples()));  // rolls
  Tick again(6);
  again.contact.regime = contact_t::REGIME_SLIDING;
  again.contact.static_friction_n = again.contact.friction_force_W_n[1] = 0.5;
  expect_trip(monitor.judge(again.samples()), trip_t::CAUSE_FRICTION, 6, 0.5 / 8, 0.125);
}

TEST(Monitor, FrictionUseScalesTheLimit) {
  MonitorLimits whole = limits();
  whole.friction_use = 1;
  expect_quiet(
      judge_changed(whole, [](Tick& t) { t.contact.static_friction_n = t.contact.friction_force_W_n[1] = 2; }));
  expect_trip(judge_changed(whole, [](Tick& t) { t.contact.static_friction_n = t.contact.friction_force_W_n[1] = 4; }),
              trip_t::CAUSE_FRICTION, 3, 0.5, 0.25);
}

TEST(Monitor, PerfectFrictionIsNeverBroken) {
  MonitorLimits perfect = limits();
  perfect.static_friction = kInfinity;
  perfect.min_normal_force_n = 0;
  expect_quiet(judge_changed(perfect, [](Tick& t) {
    t.contact.normal_force_n = std::numeric_limits<double>::denorm_min();
    t.contact.static_friction_n = t.contact.friction_force_W_n[1] = std::numeric_limits<double>::max();
    t.contact.mu_required = kInfinity;
  }));
  expect_trip(judge_changed(perfect, [](Tick& t) { t.contact.normal_force_n = 0; }), trip_t::CAUSE_NORMAL_FORCE, 3, 0,
              0);
}

// A floor that was to be perfect, and is not.
TEST(Monitor, SlidingOnAPerfectFloorTrips) {
  MonitorLimits perfect = limits();
  perfect.static_friction = kInfinity;
  expect_trip(judge_changed(perfect,
                            [](Tick& t) {
                              t.contact.regime = contact_t::REGIME_SLIDING;
                              t.contact.static_friction_n = t.contact.friction_force_W_n[1] = 0.5;
                            }),
              trip_t::CAUSE_FRICTION, 3, 0.5 / 8, kInfinity);
}

TEST(Monitor, NumbersInAVerdictAreNeverNan) {
  MonitorLimits odd = limits();
  odd.min_normal_force_n = -1;  // so that N = 0 gets as far as the friction
  for (const double mu : {0.25, kInfinity}) {
    odd.static_friction = mu;
    for (const double friction_n : {0.0, 1.0}) {
      const trip_t verdict = judge_changed(odd, [=](Tick& t) {
        t.contact.normal_force_n = 0;
        t.contact.static_friction_n = t.contact.friction_force_W_n[1] = friction_n;
      });
      EXPECT_EQ(verdict.tripped, mu < kInfinity && friction_n > 0);
      EXPECT_FALSE(std::isnan(verdict.value) || std::isnan(verdict.limit));
    }
  }
}

TEST(Monitor, EveryFieldMustBeFinite) {
  using Field = std::pair<std::string, std::function<double*(Tick&)>>;
  std::vector<Field> fields = {
      {"contact.time_s", [](Tick& t) { return &t.contact.time_s; }},
      {"contact.normal_force_n", [](Tick& t) { return &t.contact.normal_force_n; }},
      {"contact.static_friction_n", [](Tick& t) { return &t.contact.static_friction_n; }},
      {"contact.friction_force_W_n[0]", [](Tick& t) { return &t.contact.friction_force_W_n[0]; }},
      {"contact.friction_force_W_n[1]", [](Tick& t) { return &t.contact.friction_force_W_n[1]; }},
      {"state.time_s", [](Tick& t) { return &t.state.time_s; }},
  };
  const auto add = [&fields](const std::string& name, int count, double* (*element)(Tick&, int)) {
    for (int i = 0; i < count; ++i) {
      fields.push_back({name + "[" + std::to_string(i) + "]", [element, i](Tick& t) { return element(t, i); }});
    }
  };
  add("state.orientation", 4, [](Tick& t, int i) { return &t.state.orientation[i]; });
  add("state.angular_velocity", 3, [](Tick& t, int i) { return &t.state.angular_velocity_B_radps[i]; });
  add("state.position", 3, [](Tick& t, int i) { return &t.state.position_W_m[i]; });
  add("state.velocity", 3, [](Tick& t, int i) { return &t.state.velocity_W_mps[i]; });
  add("state.center_of_mass", 3, [](Tick& t, int i) { return &t.state.center_of_mass_B_m[i]; });
  add("state.mass_position", kMassCount, [](Tick& t, int i) { return &t.state.mass_position[i]; });
  add("state.mass_velocity", kMassCount, [](Tick& t, int i) { return &t.state.mass_velocity[i]; });
  add("state.mass_position_B", 3 * kMassCount, [](Tick& t, int i) { return &t.state.mass_position_B_m[i / 3][i % 3]; });
  add("state.motor_torque", kMassCount, [](Tick& t, int i) { return &t.state.motor_torque_nm[i]; });
  add("sensors.orientation", 4, [](Tick& t, int i) { return &t.sensors.orientation[i]; });
  add("sensors.gyro", 3, [](Tick& t, int i) { return &t.sensors.gyro_B_radps[i]; });
  add("sensors.accelerometer", 3, [](Tick& t, int i) { return &t.sensors.accelerometer_B_mps2[i]; });

  for (const auto& [name, field] : fields) {
    for (const double bad : {kNan, kInfinity, -kInfinity}) {
      SCOPED_TRACE(name + " = " + std::to_string(bad));
      const trip_t verdict = judge_changed([&, &change = field](Tick& t) { *change(t) = bad; });
      expect_trip(verdict, trip_t::CAUSE_NONFINITE, 3, 0, 0);
      EXPECT_TRUE(std::isfinite(verdict.trip_time_s));
    }
  }
}

TEST(Monitor, MuRequiredMayBeInfiniteButNotNan) {
  expect_quiet(judge_changed([](Tick& t) { t.contact.mu_required = kInfinity; }));
  for (const double bad : {kNan, -kInfinity}) {
    expect_trip(judge_changed([=](Tick& t) { t.contact.mu_required = bad; }), trip_t::CAUSE_NONFINITE, 3, 0, 0);
  }
}

TEST(Monitor, MassesThatAreNotThereDoNotCount) {
  expect_quiet(judge_changed([](Tick& t) { t.state.mass_position[kMassCount] = kNan; }));
}

TEST(Monitor, ImpossibleMassCountsDoNotReadOutside) {
  for (const int count : {-128, -1, 9, 127}) {
    expect_quiet(judge_changed([=](Tick& t) { t.state.mass_count = static_cast<std::int8_t>(count); }));
  }
}

TEST(Monitor, RepeatedTickTrips) {
  Monitor monitor(limits());
  for (std::int64_t k = 0; k < 3; ++k) expect_quiet(monitor.judge(Tick(k).samples()));
  const trip_t verdict = monitor.judge(Tick(2).samples());
  expect_trip(verdict, trip_t::CAUSE_REPEATED, 2, 2, 3);
  EXPECT_EQ(verdict.tick, 2);
}

TEST(Monitor, OldTickTripsAsRepeated) {
  Monitor monitor(limits());
  for (std::int64_t k = 5; k < 8; ++k) expect_quiet(monitor.judge(Tick(k).samples()));
  expect_trip(monitor.judge(Tick(5).samples()), trip_t::CAUSE_REPEATED, 5, 5, 8);
}

TEST(Monitor, SkippedTickTrips) {
  Monitor monitor(limits());
  for (std::int64_t k = 0; k < 3; ++k) expect_quiet(monitor.judge(Tick(k).samples()));
  expect_trip(monitor.judge(Tick(4).samples()), trip_t::CAUSE_MISSING, 4, 4, 3);
}

TEST(Monitor, AbsentMessageTrips) {
  const auto judge_without = [](const std::function<void(Samples&)>& remove) {
    Monitor monitor(limits());
    for (std::int64_t k = 0; k < 3; ++k) expect_quiet(monitor.judge(Tick(k).samples()));
    const Tick tick(3);
    Samples samples = tick.samples();
    remove(samples);
    const trip_t verdict = monitor.judge(samples);
    expect_trip(verdict, trip_t::CAUSE_MISSING, 3, 2, 3);
    return verdict;
  };
  EXPECT_EQ(judge_without([](Samples& s) { s.contact = nullptr; }).utime, 3000);
  EXPECT_EQ(judge_without([](Samples& s) { s.plant_state = nullptr; }).utime, 3000);
  EXPECT_EQ(judge_without([](Samples& s) { s.sensors = nullptr; }).utime, 3000);
  judge_without([](Samples& s) {
    s.contact = nullptr;
    s.plant_state = nullptr;
  });
  judge_without([](Samples& s) {
    s.contact = nullptr;
    s.plant_state = nullptr;
    s.sensors = nullptr;
  });
}

TEST(Monitor, MessageOfAnotherTickIsMissing) {
  expect_trip(judge_changed([](Tick& t) { t.state.tick = 2; }), trip_t::CAUSE_MISSING, 3, 2, 3);
  expect_trip(judge_changed([](Tick& t) { t.sensors.tick = 4; }), trip_t::CAUSE_MISSING, 3, 4, 3);
}

TEST(Monitor, ControllerMayBeOneTickOld) {
  expect_quiet(judge_changed([](Tick& t) { t.status->tick = 2; }));
  expect_quiet(judge_changed([](Tick& t) { t.status->tick = 3; }));
}

TEST(Monitor, OlderControllerIsStale) {
  expect_trip(judge_changed([](Tick& t) { t.status->tick = 1; }), trip_t::CAUSE_STALE, 3, 2, 1);
  expect_trip(judge_changed([](Tick& t) { t.status->tick = -3; }), trip_t::CAUSE_STALE, 3, 6, 1);
  expect_trip(judge_changed([](Tick& t) { t.status.reset(); }), trip_t::CAUSE_STALE, 3, 2, 1);
}

TEST(Monitor, ControllerFromTheFutureIsAViolation) {
  expect_trip(judge_changed([](Tick& t) { t.status->tick = 4; }), trip_t::CAUSE_STALE, 3, -1, 1);
  Monitor monitor(limits());
  Tick tick(0);
  tick.status->tick = 1;
  expect_trip(monitor.judge(tick.samples()), trip_t::CAUSE_STALE, 0, -1, 1);
}

TEST(Monitor, NoControllerIsNeededAtTheFirstTick) {
  for (const std::optional<std::int64_t> heard : {std::optional<std::int64_t>(-3), std::optional<std::int64_t>()}) {
    Monitor monitor(limits());
    Tick tick(100);
    tick.status.reset();
    if (heard) tick.status.emplace().tick = *heard;
    expect_quiet(monitor.judge(tick.samples()));
    tick = Tick(101);
    tick.status.reset();
    EXPECT_EQ(monitor.judge(tick.samples()).cause, trip_t::CAUSE_STALE);
  }
}

TEST(Monitor, NoControllerIsNeededInPrescribedRuns) {
  MonitorLimits prescribed = limits();
  prescribed.controller_expected = false;
  Monitor monitor(prescribed);
  for (std::int64_t k = 0; k < 5; ++k) {
    Tick tick(k);
    tick.status.reset();
    expect_quiet(monitor.judge(tick.samples()));
  }
}

struct Estimate {
  double normal_force_n, static_friction_n;
};

// The verdict on tick 3, after a tick 2 for which plant and controller report these forces.
trip_t judge_estimates(const Estimate& plant, const Estimate& controller, std::int8_t regime, double disagreement_n) {
  MonitorLimits l = limits();
  l.disagreement_n = disagreement_n;
  Monitor monitor(l);
  Tick second(2), third(3);
  second.contact.regime = regime;
  second.contact.commanded_normal_force_n = plant.normal_force_n;
  second.contact.commanded_static_friction_n = plant.static_friction_n;
  expect_quiet(monitor.judge(second.samples()));
  third.status->normal_force_n = controller.normal_force_n;
  third.status->static_friction_n = controller.static_friction_n;
  return monitor.judge(third.samples());
}
trip_t judge_estimates(const Estimate& plant, const Estimate& controller) {
  return judge_estimates(plant, controller, contact_t::REGIME_ROLLING, 0.5);
}

TEST(Monitor, DisagreementOfPlantAndControllerTrips) {
  expect_quiet(judge_estimates({8, 1}, {8, 1}));
  expect_quiet(judge_estimates({8, 1}, {8.5, 0.5}));
  for (const double sign : {-1, 1}) {
    expect_trip(judge_estimates({8, 1}, {8 + sign * 0.75, 1}), trip_t::CAUSE_DISAGREEMENT, 3, 0.75, 0.5);
    expect_trip(judge_estimates({8, 1}, {8, 1 + sign * 0.75}), trip_t::CAUSE_DISAGREEMENT, 3, 0.75, 0.5);
  }
  expect_trip(judge_estimates({8, 1}, {6, 2}), trip_t::CAUSE_DISAGREEMENT, 3, 2, 0.5);
  expect_trip(judge_estimates({8, 1}, {-8, 1}), trip_t::CAUSE_DISAGREEMENT, 3, 16, 0.5);  // a sign
}

TEST(Monitor, DisagreementIsOfRollingBallsAndKnownNumbersOnly) {
  for (const std::int8_t regime : {contact_t::REGIME_SLIDING, contact_t::REGIME_FLIGHT}) {
    expect_quiet(judge_estimates({8, 1}, {4, 1}, regime, 0.5));
  }
  expect_quiet(judge_estimates({8, 1}, {4, 1}, contact_t::REGIME_ROLLING, kInfinity));
  expect_quiet(judge_estimates({kNan, kNan}, {8, 1}));  // nothing is commanded
  expect_quiet(judge_estimates({8, 1}, {kNan, kNan}));  // no attitude to compute from: a fault of its own
  expect_quiet(judge_estimates({0, kInfinity}, {-1, 3}));
}

// The status of tick 2 is of that instant; an older one is not held against it.
TEST(Monitor, DisagreementIsOfOneInstant) {
  MonitorLimits l = limits();
  l.disagreement_n = 0.5;
  Monitor monitor(l);
  const auto judge = [&monitor](std::int64_t k, double plant_n, double controller_n, std::int64_t controller_tick) {
    Tick tick(k);
    tick.contact.commanded_normal_force_n = plant_n;
    tick.status->tick = controller_tick;
    tick.status->normal_force_n = controller_n;
    return monitor.judge(tick.samples());
  };
  expect_quiet(judge(1, 8, 8, 0));
  expect_quiet(judge(2, 4, 8, 1));  // what the status of tick 1 says is held against contact 1, not contact 2
  expect_trip(judge(3, 4, 8, 2), trip_t::CAUSE_DISAGREEMENT, 3, 4, 0.5);
}

// With an estimated attitude the plant answers the status of the tick before, and the answer is judged at once.
TEST(Monitor, AnAnswerToTheStatusBeforeIsJudgedWithIt) {
  MonitorLimits l = limits();
  l.disagreement_n = 0.5;
  const auto judge = [](Monitor& monitor, std::int64_t k, double plant_n, double controller_n) {
    Tick tick(k);
    tick.contact.commanded_tick = k - 1;
    tick.contact.commanded_normal_force_n = plant_n;
    tick.status->normal_force_n = controller_n;
    return monitor.judge(tick.samples());
  };
  Monitor monitor(l);
  expect_quiet(judge(monitor, 1, 8, 8));
  expect_quiet(judge(monitor, 2, 4, 4));  // of tick 1 both, another than that of tick 0
  expect_trip(judge(monitor, 3, 4, 8), trip_t::CAUSE_DISAGREEMENT, 3, 4, 0.5);
  // A status that is older than the plant's answer is not held against it.
  Monitor late(l);
  expect_quiet(judge(late, 1, 8, 8));
  Tick tick(2);
  tick.contact.commanded_tick = 1;
  tick.contact.commanded_normal_force_n = 4;
  tick.status->tick = 0;
  tick.status->normal_force_n = 8;
  late.judge(tick.samples());
  EXPECT_NE(late.verdict().cause, trip_t::CAUSE_DISAGREEMENT);
}

// 1 - f_s / (mu_s N) = 1 - 0.25 / (0.25 8) = 0.875 of the messages here.
TEST(Monitor, AMarginBetterThanItsForcesTrips) {
  const auto judge_margin = [](double margin) { return judge_changed([=](Tick& t) { t.contact.margin = margin; }); };
  for (const double fine : {0.875, 0.874, 0.0, -0.5, -1.0, -2.0}) expect_quiet(judge_margin(fine));
  EXPECT_EQ(judge_margin(0.875 + 1e-9).cause, trip_t::CAUSE_DISAGREEMENT);
  expect_trip(judge_margin(1), trip_t::CAUSE_DISAGREEMENT, 3, 0.25, 1e-12 * 2);
  EXPECT_EQ(judge_margin(kInfinity).cause, trip_t::CAUSE_DISAGREEMENT);
  EXPECT_EQ(judge_margin(kNan).cause, trip_t::CAUSE_DISAGREEMENT);
  EXPECT_FALSE(std::isnan(judge_margin(kNan).value));
  MonitorLimits perfect = limits();
  perfect.static_friction = kInfinity;
  expect_quiet(judge_changed(perfect, [](Tick& t) { t.contact.margin = 1; }));
}

// |f| = 0.25 of the messages here, beside N = 8.
TEST(Monitor, AFrictionForceThatIsNotItsMagnitudeTrips) {
  const auto judge_force = [](double x, double y, std::int8_t regime) {
    return judge_changed([=](Tick& t) {
      t.contact.friction_force_W_n[0] = x;
      t.contact.friction_force_W_n[1] = y;
      t.contact.regime = regime;
    });
  };
  expect_quiet(judge_force(-0.15, 0.2, contact_t::REGIME_ROLLING));  // any direction
  expect_quiet(judge_force(0, 0.25 * (1 + 1e-10), contact_t::REGIME_ROLLING));
  expect_trip(judge_force(0, 0.5, contact_t::REGIME_ROLLING), trip_t::CAUSE_DISAGREEMENT, 3, 0.25, 1e-10 * 8.5);
  expect_trip(judge_force(0, 0, contact_t::REGIME_ROLLING), trip_t::CAUSE_DISAGREEMENT, 3, 0.25, 1e-10 * 8);
  EXPECT_EQ(judge_force(0, 0.25 + 1e-8, contact_t::REGIME_ROLLING).cause, trip_t::CAUSE_DISAGREEMENT);
  EXPECT_EQ(judge_force(0.25, 0.25, contact_t::REGIME_ROLLING).cause, trip_t::CAUSE_DISAGREEMENT);
  expect_quiet(judge_force(0, 0.5, contact_t::REGIME_FLIGHT));  // there f_s is no friction that rolling needs
}

TEST(Monitor, SilentPlantTrips) {
  Monitor monitor(limits());
  for (std::int64_t k = 0; k < 3; ++k) expect_quiet(monitor.judge(Tick(k).samples()));
  const trip_t verdict = monitor.silence(2001, 2000);
  expect_trip(verdict, trip_t::CAUSE_STALE, 3, 2001, 2000);
  EXPECT_EQ(verdict.tick, 3);
}

TEST(Monitor, TripStatesTheViolatingSample) {
  const trip_t verdict = judge_changed([](Tick& t) { t.contact.normal_force_n = 0; });
  EXPECT_EQ(verdict.tick, 3);
  EXPECT_EQ(verdict.utime, 3000);
  EXPECT_EQ(verdict.trip_tick, 3);
  EXPECT_EQ(verdict.trip_time_s, 0.003);
}

TEST(Monitor, FirstCauseIsKeptForEver) {
  Monitor monitor(limits());
  for (std::int64_t k = 0; k < 3; ++k) expect_quiet(monitor.judge(Tick(k).samples()));
  Tick slipping(3);
  slipping.contact.static_friction_n = slipping.contact.friction_force_W_n[1] = 2;
  const trip_t first = monitor.judge(slipping.samples());
  expect_trip(first, trip_t::CAUSE_FRICTION, 3, 0.25, 0.125);

  std::vector<Tick> later = {Tick(4), Tick(5), Tick(5), Tick(9), Tick(10), Tick(11)};
  later[1].contact.normal_force_n = -1;
  later[4].contact.normal_force_n = kNan;
  later[5].status->tick = 0;
  for (const Tick& tick : later) {
    const trip_t verdict = monitor.judge(tick.samples());
    expect_trip(verdict, trip_t::CAUSE_FRICTION, 3, 0.25, 0.125);
    EXPECT_EQ(verdict.trip_time_s, first.trip_time_s);
    EXPECT_EQ(verdict.tick, tick.contact.tick) << "the heartbeat goes on";
  }
  expect_trip(monitor.silence(10, 5), trip_t::CAUSE_FRICTION, 3, 0.25, 0.125);
}

// Everything wrong at once, then one wrong thing less at a time: the header's order.
TEST(Monitor, OrderOfChecks) {
  const auto judge = [](int level) {
    Monitor monitor(limits());
    for (std::int64_t k = 0; k < 3; ++k) expect_quiet(monitor.judge(Tick(k).samples()));
    Tick tick(level < 1 ? 2 : level < 2 ? 5 : 3);
    if (level < 3) tick.sensors.tick = 77;
    if (level < 4) tick.sensors.gyro_B_radps[0] = kNan;
    if (level < 5) tick.contact.normal_force_n = 0.5;
    if (level < 6) tick.contact.static_friction_n = tick.contact.friction_force_W_n[1] = 4;
    tick.status->tick = -3;
    return monitor.judge(tick.samples());
  };
  expect_trip(judge(0), trip_t::CAUSE_REPEATED, 2, 2, 3);
  expect_trip(judge(1), trip_t::CAUSE_MISSING, 5, 5, 3);
  expect_trip(judge(2), trip_t::CAUSE_MISSING, 3, 77, 3);
  expect_trip(judge(3), trip_t::CAUSE_NONFINITE, 3, 0, 0);
  expect_trip(judge(4), trip_t::CAUSE_NORMAL_FORCE, 3, 0.5, 0.5);
  expect_trip(judge(5), trip_t::CAUSE_FRICTION, 3, 0.5, 0.125);
  expect_trip(judge(6), trip_t::CAUSE_STALE, 3, 6, 1);
}

// An excursion between two ticks counts, though both samples are inside.
TEST(Monitor, TripsOnWhatHappenedBetweenTicks) {
  expect_trip(judge_changed([](Tick& t) { t.contact.normal_force_min_n = 0.5; }), trip_t::CAUSE_NORMAL_FORCE, 3, 0.5,
              0.5);
  const double allowed = limits().friction_use * limits().static_friction;
  expect_trip(judge_changed([=](Tick& t) { t.contact.mu_required_max = std::nextafter(allowed, 1); }),
              trip_t::CAUSE_FRICTION, 3, std::nextafter(allowed, 1), allowed);
  expect_quiet(judge_changed([=](Tick& t) { t.contact.mu_required_max = allowed; }));
  expect_trip(judge_changed([](Tick& t) { t.contact.normal_force_min_n = kNan; }), trip_t::CAUSE_NONFINITE, 3, 0, 0);
  expect_trip(judge_changed([](Tick& t) { t.contact.mu_required_max = kNan; }), trip_t::CAUSE_NONFINITE, 3, 0, 0);
}

}  // namespace
}  // namespace ballast::monitor
