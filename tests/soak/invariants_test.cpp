// Every invariant can break: recorded runs in which all hold are changed by hand, one thing at a time.
#include "tools/soak/invariants.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>

#include "tools/faults/injection.h"
#include "tools/program/params.h"
#include "tools/recording/recorder.h"
#include "tools/soak/bounds.h"
#include "tools/soak/fault_windows.h"
#include "tools/soak/mode_rules.h"
#include "tools/soak/seed_run.h"

namespace ballast::soak {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct Tick {
  sil::Lap lap;
  sim::Plant::Sample truth;
};

// A run with its log, to be looked at as often as one likes.
struct Recorded {
  sim::Scenario scenario;
  std::vector<Tick> ticks;
  sil::RunResult result;
  std::string log;  // its bytes

  explicit Recorded(const std::vector<std::string>& overrides, const std::vector<std::string>& faults = {},
                    const std::string& name = "paper_ball") {
    const auto read = sim::read_scenario(BALLAST_SOURCE_DIR "/sim/scenarios/" + name + ".toml", overrides, faults);
    for (const auto& error : read.errors) ADD_FAILURE() << to_string(error);
    scenario = read.scenario;
    auto params = std::make_unique<firmware::ControllerParams>();
    EXPECT_FALSE(program::to_controller_params(scenario, *params));
    const auto peers = sil::peers_in_process(scenario, params.get(), program::to_monitor_limits(scenario));
    const std::string path = testing::TempDir() + "soak-recorded-" + std::to_string(getpid()) + ".lcmlog";
    sil::Recorder recorder(path);
    sil::RunOptions options;
    options.observe = [this](const sil::Lap& lap, const sim::Plant::Sample& truth) { ticks.push_back({lap, truth}); };
    result = sil::run_with_faults(scenario, *peers, recorder, options);
    EXPECT_TRUE(recorder.close());
    std::ifstream file(path, std::ios::binary);
    log.assign(std::istreambuf_iterator<char>(file), {});
    std::filesystem::remove(path);
  }

  // The index of the first tripped tick.
  [[nodiscard]] std::size_t trip() const {
    return static_cast<std::size_t>(
        std::find_if(ticks.begin(), ticks.end(), [](const Tick& t) { return t.lap.verdict->tripped != 0; }) -
        ticks.begin());
  }

  // The invariants that it breaks after a change.
  [[nodiscard]] std::vector<Invariant> broken(const std::function<void(Recorded&)>& change = {}) const {
    auto changed = std::make_unique<Recorded>(*this);
    if (change) change(*changed);
    const std::string path = testing::TempDir() + "soak-changed-" + std::to_string(getpid()) + ".lcmlog";
    std::ofstream(path, std::ios::binary) << changed->log;
    Invariants invariants(changed->scenario);
    for (const Tick& tick : changed->ticks) invariants.observe(tick.lap, tick.truth);
    invariants.finish(changed->result, path);
    std::filesystem::remove(path);
    std::vector<Invariant> which;
    for (const Broken& broken : invariants.broken()) {
      which.push_back(broken.invariant);
      words_ = broken.text;
      EXPECT_FALSE(broken.text.empty());
    }
    return which;
  }
  mutable std::string words_;  // of the last one broken
};

// Completes; and trips at t = 0.4 s or so, after which its masses need time to stop.
const Recorded& completed() {
  static const Recorded run({"duration=0.5"});
  return run;
}
const Recorded& tripped() {
  static const Recorded run({"duration=3", "envelope.friction_use=0.3"});
  return run;
}

// Estimates its attitude, and completes.
const Recorded& estimated() {
  static const Recorded run({"duration=0.4", "run.hold=0.2", "sensors.preset=bmi088_calibrated"}, {}, "desk_ball");
  return run;
}

bool has(const std::vector<Invariant>& broken, Invariant invariant) {
  return std::find(broken.begin(), broken.end(), invariant) != broken.end();
}

// The messages that a change makes others than those of the log are no fault of the log: that breaks only beside.
std::vector<Invariant> but_logged(std::vector<Invariant> broken) {
  std::erase(broken, Invariant::kLogged);
  return broken;
}

// A floor that gives too much, and a slip that no message says, break that beside.
std::vector<Invariant> but_in_regime(std::vector<Invariant> broken) {
  std::erase(broken, Invariant::kInRegime);
  return broken;
}

using Which = std::vector<Invariant>;

TEST(Invariants, HoldInRunsAsTheyAre) {
  EXPECT_EQ(completed().result.end_reason, sil::EndReason::kCompleted);
  EXPECT_EQ(completed().broken(), Which{}) << completed().words_;
  ASSERT_EQ(tripped().result.end_reason, sil::EndReason::kTripped);
  EXPECT_EQ(tripped().broken(), Which{}) << tripped().words_;
  EXPECT_TRUE(tripped().result.masses_rested);
  // There is a stop to speak of.
  EXPECT_GT(tripped().ticks.size() - tripped().trip(), 20u);
}

// Both end switches of mass 1, which moves.
void close_both_switches(Tick& tick) {
  tick.lap.plant.sensors.limit_switch[1] = 3;
  EXPECT_NE(tick.lap.answer->status.commanded_velocity[1], 0);
}

// Motor 0 is commanded a tenth faster than it may be stepped, and the status says so.
void command_too_fast(const sim::Scenario& scenario, controller_status_t& status) {
  const sim::Motor& motor = scenario.masses[0].motor;
  status.overload_error = controller_status_t::OVERLOAD_TOO_FAST;
  status.overload_motor = 0;
  status.overload_tick = status.tick + 1;
  status.overload_limit = motor.max_step_rate_hz;
  status.overload_value = 1.1 * motor.max_step_rate_hz;
  status.next_velocity[0] = status.overload_value / motor.microsteps_per_rail_unit();
}

TEST(Invariants, AViolationThatNobodyReports) {
  const auto unseen = [](auto change) {
    return but_in_regime(completed().broken([&](Recorded& run) { change(run.ticks[200].truth); }));
  };
  // A run that says exit status 0 of it is wrong too.
  const Which due{Invariant::kDetected, Invariant::kEnded};
  EXPECT_EQ(unseen([](auto& truth) { truth.normal_force_n = 0; }), due);
  EXPECT_EQ(unseen([](auto& truth) { truth.normal_force_min_n = 0; }), due);
  EXPECT_EQ(unseen([](auto& truth) { truth.friction_force_W_n[0] = 100; }), due);
  EXPECT_EQ(unseen([](auto& truth) { truth.mu_required_max = 0.36; }), due);  // the floor gives 0.35
  EXPECT_EQ(unseen([](auto& truth) { truth.regime = sim::Regime::kSliding; }), due);
}

// The run was to end where the ball slips, and nobody says that it has.
TEST(Invariants, ALossOfRollingThatNobodyReports) {
  for (const sil::EndReason reason : {sil::EndReason::kSlipped, sil::EndReason::kDetached}) {
    const Recorded& stops = completed();
    const auto broken = stops.broken([reason](Recorded& run) {
      run.scenario.run.on_violation = sim::OnViolation::kStop;
      run.result.end_reason = reason;
      run.result.rolling_lost = true;
    });
    EXPECT_EQ(but_in_regime(broken), Which{Invariant::kDetected}) << stops.words_;
    EXPECT_EQ(has(broken, Invariant::kInRegime), reason == sil::EndReason::kSlipped);
  }
}

// On a floor that has become slippery f_s is far below what the scenario's floor would give.
TEST(Invariants, AFloorThatBecomesSlipperyIsNoticedWhereTheRunEndsToo) {
  for (const char* on_violation : {"stop", "continue"}) {
    const Recorded run({"duration=0.5", std::string("run.on_violation=\"") + on_violation + "\""},
                       {"friction_falls@0.2:0.001"});
    EXPECT_EQ(run.result.end_reason == sil::EndReason::kSlipped, std::string_view(on_violation) == "stop");
    EXPECT_EQ(run.result.trip.cause, trip_t::CAUSE_FRICTION) << on_violation;
    EXPECT_EQ(run.broken(), Which{}) << run.words_;
  }
}

TEST(Invariants, AFalseAlarm) {
  const auto but_end = [](Which broken) {  // a trip that is made up ends no run, and takes no stop
    std::erase_if(broken, [](Invariant i) { return i != Invariant::kNoFalseAlarm; });
    return broken;
  };
  const Which due{Invariant::kNoFalseAlarm};
  EXPECT_EQ(but_end(completed().broken([](Recorded& run) {
              trip_t& trip = *run.ticks[200].lap.verdict;
              trip.tripped = 1;
              trip.cause = trip_t::CAUSE_DISAGREEMENT;
              trip.trip_tick = trip.tick;
            })),
            due);
  // A fault explains only what it can do, and only while it can do it.
  const Recorded faulted({"duration=0.5"}, {"motor_stall@0.1:mass=1",
                                            "messages_delayed@0.05:1,duration=0.001,"
                                            "channel=BALLAST_STEP_COMMAND"});
  ASSERT_EQ(faulted.broken(), Which{}) << faulted.words_;
  for (const std::int8_t cause : {trip_t::CAUSE_DISAGREEMENT, trip_t::CAUSE_STALE, trip_t::CAUSE_NONFINITE}) {
    EXPECT_EQ(but_end(faulted.broken([cause](Recorded& run) {
                trip_t& trip = *run.ticks[200].lap.verdict;
                trip.tripped = 1;
                trip.cause = cause;
                trip.trip_tick = trip.tick;
              })),
              due);
  }
  // One in whose tick the true ball was inside.
  EXPECT_EQ(but_end(tripped().broken([](Recorded& run) {
              Tick& trip = run.ticks[run.trip()];
              trip.truth = run.ticks[run.trip() - 1].truth;
            })),
            due);
  const auto with_faults = [&](firmware::Fault fault, auto change) {
    return but_end(completed().broken([&](Recorded& run) {
      run.ticks[200].lap.answer->status.faults = static_cast<std::int32_t>(fault);
      change(run.ticks[200]);
    }));
  };
  using firmware::Fault;
  for (const Fault fault : {Fault::kSensorNotFinite, Fault::kSensorStale, Fault::kMonitorStale, Fault::kMonitorTrip,
                            Fault::kStepOverload, Fault::kTickOutOfOrder, Fault::kInternal, Fault::kEndSwitch}) {
    EXPECT_EQ(with_faults(fault, [](Tick&) {}), due) << static_cast<std::uint32_t>(fault);
  }
  EXPECT_EQ(with_faults(Fault::kEndSwitch, close_both_switches), Which{});
  // An end that a mass has been driven over is no reason ten ticks later.
  EXPECT_EQ(but_end(completed().broken([](Recorded& run) {
              close_both_switches(run.ticks[190]);
              run.ticks[200].lap.answer->status.faults = static_cast<std::int32_t>(Fault::kEndSwitch);
            })),
            due);
  // Numbers of the controller alone are no reason either.
  EXPECT_EQ(with_faults(Fault::kStepOverload,
                        [](Tick& tick) {
                          tick.lap.answer->status.overload_value = 5;
                          tick.lap.answer->status.overload_limit = 4;
                        }),
            due);
  EXPECT_EQ(with_faults(Fault::kStepOverload,
                        [](Tick& tick) { command_too_fast(completed().scenario, tick.lap.answer->status); }),
            Which{});
}

// Faults of the estimation need a cause in the ball or in an injected fault, which they may outlast.
TEST(Invariants, AFalseAlarmOfTheEstimation) {
  using firmware::Fault;
  ASSERT_EQ(estimated().result.end_reason, sil::EndReason::kCompleted);
  ASSERT_EQ(estimated().broken(), Which{}) << estimated().words_;
  // In tick 130; the hold has 200 ticks.
  const auto alarm = [](const Recorded& run, Fault fault, const std::function<void(Recorded&)>& change = {}) {
    return has(run.broken([&](Recorded& changed) {
      changed.ticks[330].lap.answer->status.faults = static_cast<std::int32_t>(fault);
      if (change) change(changed);
    }),
               Invariant::kNoFalseAlarm);
  };
  // Masses of desk_ball swing by more than 4 % of N. Here they are where they are commanded to be.
  const auto no_swing = [](Recorded& run) {
    for (Tick& tick : run.ticks) {
      contact_t& contact = tick.lap.plant.contact;
      contact.normal_force_n = contact.commanded_normal_force_n;
      contact.static_friction_n = contact.commanded_static_friction_n;
    }
  };
  const auto swing = [&](double of_n) {
    return [&no_swing, of_n](Recorded& run) {
      no_swing(run);
      run.ticks[320].lap.plant.contact.normal_force_n *= 1 + of_n;
    };
  };
  const auto slide = [&](Recorded& run) {
    no_swing(run);
    run.ticks[320].lap.plant.contact.regime = contact_t::REGIME_SLIDING;
  };
  const auto drag = [&](Recorded& run) {
    no_swing(run);
    run.scenario.drag.coefficient_kgpm = 0.1;
  };
  const auto patch = [&](double rolling_resistance) {
    return [&no_swing, rolling_resistance](Recorded& run) {
      no_swing(run);
      sim::SurfacePatch resisting;
      resisting.rolling_resistance = rolling_resistance;
      run.scenario.surface.patches = {resisting};
    };
  };
  for (const Fault fault : {Fault::kSlipMeasured, Fault::kLightMeasured, Fault::kNoEstimate}) {
    SCOPED_TRACE(static_cast<std::uint32_t>(fault));
    EXPECT_TRUE(alarm(estimated(), fault, patch(0)));
    EXPECT_EQ(alarm(estimated(), fault, patch(0.01)), fault != Fault::kSlipMeasured);
    EXPECT_TRUE(alarm(estimated(), fault, no_swing));
    EXPECT_TRUE(alarm(estimated(), fault, swing(0.035)));
    EXPECT_EQ(alarm(estimated(), fault, swing(0.05)), fault != Fault::kSlipMeasured);
    EXPECT_EQ(alarm(estimated(), fault, swing(0.26)), fault == Fault::kNoEstimate);
    EXPECT_EQ(alarm(estimated(), fault, slide), fault == Fault::kNoEstimate);
    EXPECT_EQ(alarm(estimated(), fault, drag), fault == Fault::kNoEstimate);
  }
  const Recorded spiked({"duration=0.4", "run.hold=0.2", "sensors.preset=bmi088_calibrated"},
                        {"sensor_spike@0.1:0.001,sensor=gyro"}, "desk_ball");
  ASSERT_EQ(spiked.broken(), Which{}) << spiked.words_;
  for (const Fault fault : {Fault::kSlipMeasured, Fault::kLightMeasured, Fault::kNoEstimate}) {
    EXPECT_FALSE(alarm(spiked, fault, no_swing)) << static_cast<std::uint32_t>(fault);
  }
}

// A trip that has been taken back explains nothing any more: neither a controller's fault nor a violation.
TEST(Invariants, ATripOfThePastIsNoExcuse) {
  const auto after_the_trip = [](auto change) {
    return tripped().broken([&](Recorded& run) {
      for (std::size_t k = run.trip() + 5; k < run.ticks.size(); ++k) {
        run.ticks[k].truth.friction_force_W_n.setZero();
        run.ticks[k].truth.mu_required_max = 0;
        run.ticks[k].lap.verdict->tripped = 0;
        run.ticks[k].lap.answer->status.mode = controller_status_t::MODE_DISARMED;
        run.ticks[k].lap.answer->status.faults = 0;
      }
      change(run.ticks[run.trip() + 10]);
    });
  };
  const auto unchanged = after_the_trip([](Tick&) {});
  EXPECT_FALSE(has(unchanged, Invariant::kNoFalseAlarm));
  EXPECT_FALSE(has(unchanged, Invariant::kDetected));
  EXPECT_TRUE(has(after_the_trip([](Tick& tick) {
                    tick.lap.answer->status.faults = static_cast<std::int32_t>(firmware::Fault::kMonitorTrip);
                  }),
                  Invariant::kNoFalseAlarm));
  EXPECT_TRUE(has(after_the_trip([](Tick& tick) { tick.truth.normal_force_n = 0; }), Invariant::kDetected));
}

TEST(Invariants, ATripOneTickLate) {
  EXPECT_EQ(
      but_logged(tripped().broken([](Recorded& run) {
        const std::size_t trip = run.trip();
        run.ticks[trip].lap.verdict = run.ticks[trip - 1].lap.verdict;
        run.ticks[trip].lap.verdict->tick += 1;
        run.ticks[trip].lap.answer->status.mode = controller_status_t::MODE_RUNNING;
        run.ticks[trip].lap.answer->status.faults = 0;
      })),
      (Which{Invariant::kDetected, Invariant::kLatched, Invariant::kTruthful}));  // the later ones have another tick
}

TEST(Invariants, AControllerThatGoesOnAfterATrip) {
  EXPECT_EQ(but_logged(tripped().broken([](Recorded& run) {
              run.ticks[run.trip()].lap.answer->status.mode = controller_status_t::MODE_RUNNING;
            })),
            (Which{Invariant::kObeyed, Invariant::kLatched}));  // and its fault has not tripped it
}

// A peer whose messages are injured may be heard a tick late, and no later.
TEST(Invariants, PeersThatSuffer) {
  const Recorded faulted({"duration=0.5"}, {"messages_doubled@0.05:channel=BALLAST_STEP_COMMAND"});
  ASSERT_EQ(faulted.broken(), Which{}) << faulted.words_;
  const auto outside_for = [&](std::size_t ticks) {
    return faulted.broken([&](Recorded& run) {
      for (std::size_t k = 100; k < 100 + ticks; ++k) run.ticks[k].truth.normal_force_n = 0;
    });
  };
  EXPECT_FALSE(has(outside_for(1), Invariant::kDetected));
  EXPECT_TRUE(has(outside_for(2), Invariant::kDetected));
}

// Outside the fault's time a run is as sound as any other.
TEST(Invariants, AFaultOfOneTickExcusesThatTime) {
  const Recorded faulted({"duration=0.5"},
                         {"messages_delayed@0.05:1,duration=0.001,channel=BALLAST_TRIP,peer=controller"});
  ASSERT_EQ(faulted.broken(), Which{}) << faulted.words_;
  const auto outside_in = [&](std::size_t k) {
    return faulted.broken([&](Recorded& run) { run.ticks[k].truth.normal_force_n = 0; });
  };
  // The countdown has two ticks: tick 50 is the fault's.
  EXPECT_FALSE(has(outside_in(52), Invariant::kDetected));
  EXPECT_TRUE(has(outside_in(45), Invariant::kDetected));
  EXPECT_TRUE(has(outside_in(60), Invariant::kDetected));
  EXPECT_EQ(but_logged(faulted.broken([](Recorded& run) { run.ticks[60].lap.verdict->tick -= 1; })),
            Which{Invariant::kInOrder});
}

// A peer that is late judges late whatever befalls the others.
TEST(FaultWindows, LastAsLongAsTheLatestAnswers) {
  sim::Scenario scenario;
  scenario.run.control_period_s = 0.001;
  sim::Fault nan;
  nan.kind = sim::FaultKind::kSensorNan;
  nan.time_s = 0.05;
  nan.end_s = 0.051;
  scenario.faults = {nan};
  EXPECT_TRUE(FaultWindows(scenario).nan(53));
  EXPECT_FALSE(FaultWindows(scenario).nan(54));
  sim::Fault slow;
  slow.kind = sim::FaultKind::kPeerTooSlow;
  slow.value = 20;
  scenario.faults.push_back(slow);
  EXPECT_TRUE(FaultWindows(scenario).nan(73));
  EXPECT_FALSE(FaultWindows(scenario).nan(74));
}

TEST(Invariants, ATripThatIsNotWhatHappened) {
  const auto all = [](auto change) {
    return but_logged(tripped().broken([&](Recorded& run) {
      for (std::size_t k = run.trip(); k < run.ticks.size(); ++k) change(*run.ticks[k].lap.verdict);
      change(run.result.trip);
    }));
  };
  const Which due{Invariant::kTruthful};
  EXPECT_EQ(all([](trip_t&) {}), Which{});
  EXPECT_EQ(all([](trip_t& trip) { trip.value *= 1 + 1e-6; }), due);
  EXPECT_EQ(all([](trip_t& trip) { trip.limit = 1e9; }), due);
  EXPECT_EQ(all([](trip_t& trip) { trip.trip_time_s = 12345; }), due);
  EXPECT_EQ(all([](trip_t& trip) { trip.trip_time_s += 1e-9; }), due);
  EXPECT_EQ(all([](trip_t& trip) {
              trip.cause = trip_t::CAUSE_NORMAL_FORCE;
              trip.value = trip.limit = 0;
            }),
            due);
}

TEST(Invariants, AnEstimateThatIsNotThePlants) {
  const auto off = [](double by_n) {
    return but_logged(
        completed().broken([=](Recorded& run) { run.ticks[100].lap.answer->status.normal_force_n += by_n; }));
  };
  // The paper's ball weighs 4 N; rounding makes 1e-15 of that.
  EXPECT_EQ(off(1e-12), Which{});
  EXPECT_EQ(off(1e-7), Which{Invariant::kAgreed});
  // 5 % of the weight trip a monitor that works; a difference that a fault explains is no exception.
  const Recorded biased({"duration=0.5"}, {"sensor_bias@0.05:0.01,sensor=orientation"});
  ASSERT_EQ(biased.broken(), Which{}) << biased.words_;
  const auto biased_by = [&](double by_n) {
    return but_logged(
        biased.broken([=](Recorded& run) { run.ticks[100].lap.answer->status.static_friction_n += by_n; }));
  };
  EXPECT_EQ(biased_by(0.1), Which{});
  EXPECT_EQ(biased_by(0.5), Which{Invariant::kAgreed});
}

// The plant's forces in a message are those of the estimate of the tick before, with its masses.
TEST(Invariants, AnEstimatedRunsForcesThatAreNotThePlants) {
  const auto off = [](double by_n) {
    return but_logged(
        estimated().broken([=](Recorded& run) { run.ticks[300].lap.answer->status.normal_force_n += by_n; }));
  };
  // The robot weighs 16 N; rounding makes 1e-15 of that.
  EXPECT_EQ(off(1e-12), Which{});
  EXPECT_EQ(off(1e-7), Which{Invariant::kAgreed});
  EXPECT_EQ(but_logged(estimated().broken(
                [](Recorded& run) { run.ticks[300].lap.plant.contact.commanded_static_friction_n += 1e-7; })),
            Which{Invariant::kAgreed});
  // 5 % of the weight trip a monitor that works, even where a fault explains the difference.
  const Recorded biased({"duration=0.4", "run.hold=0.2", "sensors.preset=bmi088_calibrated"},
                        {"sensor_bias@0.05:0.001,sensor=gyro"}, "desk_ball");
  ASSERT_EQ(biased.broken(), Which{}) << biased.words_;
  const auto biased_by = [&](double by_n) {
    return but_logged(
        biased.broken([=](Recorded& run) { run.ticks[300].lap.answer->status.static_friction_n += by_n; }));
  };
  EXPECT_EQ(biased_by(0.1), Which{});
  EXPECT_EQ(biased_by(1), Which{Invariant::kAgreed});
}

TEST(Invariants, ARegimeThatIsNotTheBalls) {
  const auto with = [](auto change) {
    return but_logged(completed().broken([&](Recorded& run) { change(run.ticks[100]); }));
  };
  const Which due{Invariant::kInRegime};
  EXPECT_EQ(with([](Tick& tick) { tick.lap.plant.contact.regime = contact_t::REGIME_SLIDING; }), due);
  EXPECT_EQ(with([](Tick& tick) { tick.lap.plant.contact.regime = contact_t::REGIME_FLIGHT; }), due);
  EXPECT_EQ(with([](Tick& tick) { tick.truth.velocity_W_mps[0] += 1e-6; }), due);
  EXPECT_EQ(with([](Tick& tick) { tick.truth.floor_static_friction = 1e-3; }), due);
  EXPECT_EQ(with([](Tick& tick) {
              tick.truth.regime = sim::Regime::kFlight;
              tick.lap.plant.contact.regime = contact_t::REGIME_FLIGHT;
            }),
            due);
  // The last message of a run that ends by slip.
  const Recorded slips({"duration=0.5", "run.on_violation=\"stop\""}, {"friction_falls@0.2:0.001"});
  ASSERT_EQ(slips.result.end_reason, sil::EndReason::kSlipped);
  EXPECT_TRUE(has(slips.broken([](Recorded& run) {
    run.ticks.back().truth.regime = sim::Regime::kRolling;
    run.ticks.back().lap.plant.contact.regime = contact_t::REGIME_ROLLING;
  }),
                  Invariant::kInRegime));
}

// In tick 100 mass 1 is at the end of a rail that it moves towards.
void arrive_at_the_end(Recorded& run) {
  Tick& tick = run.ticks[100];
  const double way = tick.lap.answer->status.commanded_velocity[1] > 0 ? 1 : -1;
  run.scenario.masses[1].rail.lower_end = -1e3;
  run.scenario.masses[1].rail.upper_end = 1e3;
  tick.truth.mass_position[1] = way * 1e3;
  tick.lap.plant.sensors.limit_switch[1] = way > 0 ? 2 : 1;
}

TEST(Invariants, AnEndSwitchThatIsNotTheMasss) {
  const auto with = [](auto change) { return but_logged(completed().broken(change)); };
  const Which due{Invariant::kSwitched};
  const auto stand = [](Recorded& run) { run.ticks[100].lap.answer->status.commanded_velocity[1] = 0; };
  EXPECT_EQ(with([&](Recorded& run) {
              arrive_at_the_end(run);
              stand(run);
            }),
            Which{});
  // The switch is open at the end; it is closed elsewhere.
  EXPECT_EQ(with([&](Recorded& run) {
              arrive_at_the_end(run);
              run.ticks[100].lap.plant.sensors.limit_switch[1] = 0;
            }),
            due);
  EXPECT_EQ(with([&](Recorded& run) {
              run.ticks[100].lap.plant.sensors.limit_switch[1] = 2;
              stand(run);
            }),
            due);
  // The mass is commanded on, and the controller has no fault; it has one.
  EXPECT_EQ(with(arrive_at_the_end), due);
  EXPECT_FALSE(has(with([&](Recorded& run) {
                     arrive_at_the_end(run);
                     run.ticks[100].lap.answer->status.faults = static_cast<std::int32_t>(firmware::Fault::kEndSwitch);
                   }),
                   Invariant::kSwitched));
  // A switch that an injected fault has frozen.
  const Recorded frozen({"duration=0.5"}, {"sensor_freeze@0.05:sensor=limit_switch,duration=0.001"});
  ASSERT_EQ(frozen.broken(), Which{}) << frozen.words_;
  for (const std::size_t k : {52u, 60u}) {
    const auto broken = but_logged(frozen.broken([k](Recorded& run) {
      run.ticks[k].lap.plant.sensors.limit_switch[1] = 3;
      run.ticks[k].lap.answer->status.commanded_velocity[1] = 0;
    }));
    EXPECT_EQ(broken, k == 52 ? Which{} : due);
  }
}

TEST(Invariants, AModeThatNobodyCommanded) {
  using Status = controller_status_t;
  const auto step = [](std::int8_t before_mode, std::int8_t mode, std::int8_t command, bool monitor_tripped = false) {
    Status before{}, now{};
    before.mode = before_mode;
    now.mode = mode;
    now.at_rest = 1;
    std::optional<operator_t> given;
    if (command != 0) given.emplace().command = command;
    return judge({before, now, given, monitor_tripped});
  };
  constexpr std::int8_t kNothing = 0;
  EXPECT_EQ(step(Status::MODE_ARMED, Status::MODE_RUNNING, operator_t::COMMAND_START), ModeError::kNone);
  EXPECT_EQ(step(Status::MODE_ARMED, Status::MODE_RUNNING, kNothing), ModeError::kNotCommanded);
  EXPECT_EQ(step(Status::MODE_DISARMED, Status::MODE_RUNNING, operator_t::COMMAND_START), ModeError::kNotCommanded);
  EXPECT_EQ(step(Status::MODE_RUNNING, Status::MODE_DISARMED, operator_t::COMMAND_STOP), ModeError::kNotCommanded);
  EXPECT_EQ(step(Status::MODE_RUNNING, Status::MODE_RUNNING, operator_t::COMMAND_STOP), ModeError::kStopIgnored);
  EXPECT_EQ(step(Status::MODE_RUNNING, Status::MODE_STOPPING, operator_t::COMMAND_STOP), ModeError::kNone);
  EXPECT_EQ(step(Status::MODE_TRIPPED, Status::MODE_DISARMED, operator_t::COMMAND_RESET), ModeError::kNone);
  EXPECT_EQ(step(Status::MODE_TRIPPED, Status::MODE_DISARMED, operator_t::COMMAND_RESET, true),
            ModeError::kTripReleased);
  EXPECT_EQ(step(Status::MODE_TRIPPED, Status::MODE_DISARMED, kNothing), ModeError::kTripReleased);
  EXPECT_EQ(step(Status::MODE_TRIPPED, Status::MODE_ARMED, operator_t::COMMAND_RESET), ModeError::kTripReleased);

  // In a run: running, then disarmed by the trip.
  const auto broken = tripped().broken([](Recorded& run) {
    for (std::size_t k = run.trip(); k < run.ticks.size(); ++k)
      run.ticks[k].lap.answer->status.mode = Status::MODE_DISARMED;
  });
  EXPECT_TRUE(has(broken, Invariant::kLatched));
}

TEST(Invariants, ATripTakenBack) {
  const auto later = [](auto change) {
    return but_logged(tripped().broken([&](Recorded& run) { change(run.ticks[run.trip() + 5].lap); }));
  };
  EXPECT_EQ(later([](sil::Lap& lap) { lap.verdict->cause = trip_t::CAUSE_NORMAL_FORCE; }), Which{Invariant::kLatched});
  EXPECT_EQ(later([](sil::Lap& lap) { lap.verdict->trip_tick += 1; }), Which{Invariant::kLatched});
  EXPECT_EQ(later([](sil::Lap& lap) { lap.verdict->value += 1; }), Which{Invariant::kLatched});
  EXPECT_EQ(later([](sil::Lap& lap) { lap.answer->status.faults = 0; }), Which{Invariant::kLatched});
  EXPECT_TRUE(has(later([](sil::Lap& lap) { lap.verdict->tripped = 0; }), Invariant::kLatched));
  EXPECT_TRUE(has(later([](sil::Lap& lap) { lap.answer->status.mode = controller_status_t::MODE_ARMED; }),
                  Invariant::kLatched));
}

// A monitor that has been started again may trip again, then, and keeps that trip.
TEST(Invariants, ARestartedMonitorTripsOnceMore) {
  const auto trips_again = [](std::size_t after_restart, double value) {
    return but_logged(tripped().broken([=](Recorded& run) {
      const std::size_t restart = run.trip() + 5, again = restart + after_restart;
      sim::Fault fault;
      fault.kind = sim::FaultKind::kPeerRestarted;
      fault.peer = sim::FaultPeer::kMonitor;
      fault.time_s = fault.end_s = run.ticks[restart].truth.time_s;
      run.scenario.faults.push_back(fault);
      for (std::size_t k = again; k < run.ticks.size(); ++k) {
        trip_t& trip = *run.ticks[k].lap.verdict;
        trip.trip_tick = run.ticks[again].lap.plant.contact.tick;
        trip.trip_time_s = run.ticks[again].truth.time_s;
        if (k > again + 5) trip.value += value;
      }
    }));
  };
  EXPECT_EQ(trips_again(0, 0), Which{});
  EXPECT_EQ(trips_again(0, 1), Which{Invariant::kLatched});
  EXPECT_EQ(trips_again(10, 0), Which{Invariant::kLatched});
}

TEST(Invariants, MassesThatDoNotStop) {
  EXPECT_EQ(but_logged(tripped().broken([](Recorded& run) { run.ticks.back().lap.answer->status.at_rest = 0; })),
            Which{Invariant::kAtRest});
  // A stop that takes longer than the motors need, and says so.
  EXPECT_EQ(but_logged(tripped().broken([](Recorded& run) {
              for (Tick& tick : run.ticks) tick.lap.answer->status.plan_duration_s *= 50;
            })),
            Which{Invariant::kAtRest});
  // The promise is the plan's; a shorter one is not kept.
  EXPECT_EQ(but_logged(tripped().broken([](Recorded& run) {
              for (Tick& tick : run.ticks) tick.lap.answer->status.plan_duration_s /= 2;
            })),
            Which{Invariant::kAtRest});
  // A pulse after the end. The counts have to agree with it.
  EXPECT_EQ(but_logged(tripped().broken([](Recorded& run) {
              sil::Lap& lap = run.ticks.back().lap;
              lap.answer->steps.burst_count = 1;
              lap.answer->steps.motor[0] = 0;
              lap.answer->steps.direction[0] = 1;
              lap.answer->steps.steps[0] = 1;
              lap.answer->steps.count[0] = 1;
              lap.answer->steps.position_steps[0] += 1;
              lap.answer->status.steps_issued[0] += 1;
            })),
            Which{Invariant::kAtRest});
  // Pulses that cancel each other are pulses.
  EXPECT_EQ(but_logged(tripped().broken([](Recorded& run) {
              sil::Lap& lap = run.ticks.back().lap;
              lap.answer->steps.burst_count = 2;
              for (int b = 0; b < 2; ++b) {
                lap.answer->steps.motor[b] = 0;
                lap.answer->steps.direction[b] = static_cast<std::int8_t>(1 - 2 * b);
                lap.answer->steps.count[b] = 1;
              }
              lap.answer->status.steps_issued[0] += 2;
            })),
            Which{Invariant::kAtRest});
  // The stop of a controller that is silent afterwards is kept.
  const auto silent_once = [](auto is_time) {
    return but_logged(tripped().broken([&](Recorded& run) {
      bool silent = false;
      for (Tick& tick : run.ticks) {
        if (silent) tick.lap.answer.reset();
        silent = silent || is_time(tick.lap.answer->status);
      }
    }));
  };
  EXPECT_EQ(silent_once([](const auto& status) { return status.faults != 0 && status.at_rest != 0; }), Which{});
  EXPECT_EQ(silent_once([](const auto& status) { return status.faults != 0; }), Which{Invariant::kAtRest});
  // No promise at all.
  EXPECT_EQ(but_logged(tripped().broken([](Recorded& run) {
              for (Tick& tick : run.ticks) tick.lap.answer->status.plan_duration_s = 0;
            })),
            Which{Invariant::kAtRest});
}

TEST(Invariants, MassesThatAreNotWhereTheyWereStopped) {
  const auto astray = [](Recorded& run) {
    run.ticks.back().truth.mass_position[1] += 0.2;  // a tooth is 2 pi / 50 = 0.126 rad
  };
  EXPECT_EQ(tripped().broken(astray), Which{Invariant::kAtRest});
  // It is reported.
  EXPECT_EQ(tripped().broken([&](Recorded& run) {
    astray(run);
    run.result.motors[1].slips = 2;
  }),
            Which{});
  // At rest, they say.
  EXPECT_EQ(tripped().broken([](Recorded& run) { run.ticks.back().truth.mass_velocity[1] = 0.5; }),
            Which{Invariant::kAtRest});
  // Stopped, they say, and it is the middle of the stop.
  EXPECT_TRUE(has(tripped().broken([](Recorded& run) { run.ticks.resize(run.trip() + 5); }), Invariant::kAtRest));
}

TEST(Invariants, ALogThatIsNotWhole) {
  const auto with_log = [](auto change) { return completed().broken([&](Recorded& run) { change(run.log); }); };
  EXPECT_EQ(with_log([](std::string& log) { log.pop_back(); }), Which{Invariant::kLogged});
  EXPECT_EQ(with_log([](std::string& log) { log.clear(); }), Which{Invariant::kLogged});
  EXPECT_EQ(with_log([](std::string& log) { log[log.size() / 2] ^= 1; }), Which{Invariant::kLogged});
  EXPECT_EQ(with_log([](std::string& log) { log += log; }), Which{Invariant::kLogged});
  EXPECT_EQ(with_log([](std::string& log) { log[11] ^= 1; }), Which{Invariant::kLogged});  // the first event's number
  // The last tick is not in it.
  EXPECT_EQ(completed().broken([](Recorded& run) { run.log.resize(run.log.rfind("BALLAST_CONTACT") - 28); }),
            Which{Invariant::kLogged});
  // A message that was said otherwise than it was logged.
  EXPECT_EQ(completed().broken([](Recorded& run) { run.ticks[77].lap.plant.state.motor_torque_nm[0] += 1e-9; }),
            Which{Invariant::kLogged});
}

TEST(Invariants, AnEndThatIsNotWhatHappened) {
  using sil::EndReason;
  for (const EndReason reason : {EndReason::kTripped, EndReason::kSlipped, EndReason::kDetached,
                                 EndReason::kInconsistent, EndReason::kStepTiming}) {
    SCOPED_TRACE(to_string(reason));
    const auto broken = completed().broken([&](Recorded& run) { run.result.end_reason = reason; });
    // A loss of rolling would have to be noticed besides.
    const bool lost = reason == EndReason::kSlipped || reason == EndReason::kDetached;
    EXPECT_EQ(has(broken, Invariant::kInRegime), reason == EndReason::kSlipped);
    EXPECT_EQ(but_in_regime(broken),
              lost ? (Which{Invariant::kDetected, Invariant::kEnded}) : Which{Invariant::kEnded});
  }
  EXPECT_EQ(completed().broken([](Recorded& run) { run.result.status = hal::Status::kPeerLost; }),
            Which{Invariant::kEnded});
  EXPECT_EQ(completed().broken([](Recorded& run) { run.result.final_sample.time_s = 0.3; }), Which{Invariant::kEnded});
  // Trips that the summary does not know of: exit status 0.
  EXPECT_EQ(tripped().broken([](Recorded& run) {
    run.result.trip = {};
    run.result.controller_trip.reset();
    run.result.end_reason = EndReason::kCompleted;
    run.result.final_sample.time_s = 3;
  }),
            Which{Invariant::kEnded});
  EXPECT_EQ(but_logged(completed().broken([](Recorded& run) {
              contact_t& contact = run.ticks.back().lap.plant.contact;
              contact.last = run.ticks.back().lap.plant.state.last = run.ticks.back().lap.plant.sensors.last = 0;
            })),
            Which{Invariant::kEnded});
}

TEST(Invariants, ANumberThatIsNone) {
  const auto with = [](auto change) {
    return but_logged(completed().broken([&](Recorded& run) { change(run.ticks[100].lap); }));
  };
  const Which due{Invariant::kFinite};
  EXPECT_EQ(with([](sil::Lap& lap) { lap.plant.contact.normal_force_n = kNan; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.plant.contact.friction_force_W_n[1] = kNan; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.plant.contact.mu_required_max = kNan; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.plant.contact.commanded_mu_required = kNan; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.plant.contact.margin = -INFINITY; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.plant.state.mass_position_B_m[2][0] = kNan; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.plant.state.motor_torque_nm[1] = INFINITY; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.plant.sensors.accelerometer_B_mps2[2] = kNan; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.verdict->value = kNan; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.answer->status.next_acceleration[0] = kNan; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.answer->status.mu_required = kNan; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.answer->status.plan_margin_min = kNan; }), due);
  EXPECT_EQ(completed().broken([](Recorded& run) { run.result.extrema.mu_required_max.value = kNan; }), due);
  // Where the floor would have to pull, f_s / N is +infinity, and that is no fault.
  EXPECT_EQ(with([](sil::Lap& lap) { lap.plant.contact.mu_required = INFINITY; }), Which{});
}

TEST(Invariants, TicksAndStepsThatDoNotAddUp) {
  const Which due{Invariant::kInOrder};
  EXPECT_EQ(but_logged(completed().broken([](Recorded& run) { run.ticks.erase(run.ticks.begin() + 50); })), due);
  EXPECT_EQ(but_logged(completed().broken([](Recorded& run) {
              const Tick again = run.ticks[50];
              run.ticks.insert(run.ticks.begin() + 50, again);
            })),
            due);
  const auto with = [](auto change) {
    return but_logged(completed().broken([&](Recorded& run) { change(run.ticks[100].lap); }));
  };
  EXPECT_EQ(with([](sil::Lap& lap) { lap.plant.sensors.tick -= 1; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.plant.state.tick -= 1; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.verdict->tick += 1; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.answer->status.tick += 1; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.answer->steps.tick -= 1; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.plant.contact.time_s += 1e-9; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.answer->status.scenario_id ^= 1; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.answer->steps.steps[0] += 1; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.answer->steps.position_steps[2] -= 1; }), due);
  EXPECT_EQ(with([](sil::Lap& lap) { lap.answer->status.steps_issued[1] += 1; }), due);
}

TEST(Invariants, ARunWithoutEnd) {
  Invariants invariants(completed().scenario);
  Tick tick = completed().ticks[0];
  const double ticks = completed().scenario.duration_s / completed().scenario.run.control_period_s;
  for (int k = 0; k < ticks + 10; ++k) invariants.observe(tick.lap, tick.truth);
  EXPECT_TRUE(invariants.too_long());
  EXPECT_TRUE(std::any_of(invariants.broken().begin(), invariants.broken().end(),
                          [](const Broken& broken) { return broken.invariant == Invariant::kPatient; }));
}

TEST(Invariants, AnotherLogHasAnotherHash) {
  const auto hash = [](const Recorded& run) {
    const std::string path = testing::TempDir() + "soak-hash-" + std::to_string(getpid()) + ".lcmlog";
    std::ofstream(path, std::ios::binary) << run.log;
    Invariants invariants(run.scenario);
    for (const Tick& tick : run.ticks) invariants.observe(tick.lap, tick.truth);
    invariants.finish(run.result, path);
    std::filesystem::remove(path);
    return invariants.log_hash();
  };
  EXPECT_EQ(hash(completed()), hash(Recorded({"duration=0.5"})));
  EXPECT_NE(hash(completed()), hash(Recorded({"duration=0.5", "seed=1"})));
}

// Seed 32 is one of those that are run twice.
TEST(Invariants, ARunThatIsNotRepeatable) {
  int runs = 0;
  const auto result = run_seed(32, [&runs](const RandomScenario&) {
    SeedRun run{};
    run.log_hash = static_cast<std::uint64_t>(++runs);
    return run;
  });
  EXPECT_EQ(runs, 2);
  EXPECT_EQ(result.broken, static_cast<std::int32_t>(Invariant::kRepeatable));
  const auto same = run_seed(32, [](const RandomScenario&) { return SeedRun(); });
  EXPECT_EQ(same.broken, -1);
}

// A motor with a_max 2 and jerk 4 takes sqrt(v / j) up and down again below v = 1, and v / 2 + 1/2 above.
TEST(Bounds, TheLongestStopIsThatOfTheMotorsLimits) {
  sim::Scenario scenario;
  scenario.masses.resize(1);
  scenario.masses[0].motor.max_acceleration = 2;
  scenario.masses[0].motor.max_jerk = 4;
  const auto longest_s = [&](double v, double a) { return longest_stop_s(scenario, &v, &a); };
  EXPECT_EQ(longest_s(0, 0), 0);
  EXPECT_DOUBLE_EQ(longest_s(0.25, 0), 0.5);
  EXPECT_DOUBLE_EQ(longest_s(-3, 0), 2);
  EXPECT_DOUBLE_EQ(longest_s(0, 2), 0.5 + 2 * std::sqrt(0.5 / 4));
}

TEST(Bounds, AnOverloadIsWhatTheCommandedMassesNeed) {
  sim::Scenario scenario;
  scenario.run.control_period_s = 0.01;
  scenario.masses.resize(1);
  sim::Motor& motor = scenario.masses[0].motor;
  motor.shaft_ratio = 1;
  motor.max_step_rate_hz = 5000;
  motor.max_acceleration = 10;
  controller_status_t possible{};
  possible.tick = 41;
  command_too_fast(scenario, possible);
  const auto with = [&](auto change) {
    controller_status_t status = possible;
    change(status);
    return overload_possible(scenario, status);
  };
  using Status = controller_status_t;
  EXPECT_TRUE(with([](Status&) {}));
  EXPECT_FALSE(with([](Status& s) { s.overload_tick = 41; }));
  EXPECT_FALSE(with([](Status& s) { s.overload_motor = -1; }));
  EXPECT_FALSE(with([](Status& s) { s.overload_motor = 1; }));
  EXPECT_FALSE(with([](Status& s) { s.overload_limit = 4000; }));
  EXPECT_FALSE(with([](Status& s) { s.overload_value = 5000; }));
  EXPECT_FALSE(with([](Status& s) { s.overload_error = Status::OVERLOAD_NONE; }));
  EXPECT_FALSE(with([](Status& s) { s.next_velocity[0] *= 0.5; }));
  EXPECT_TRUE(with([](Status& s) { s.next_velocity[0] = 0.05; }));  // it may turn in that tick
  // In 10 ms at 5500 microsteps/s there are 55, which is not more than 64, but more than 32 bursts.
  const auto many_steps = [](Status& s) {
    s.overload_error = Status::OVERLOAD_TOO_MANY_STEPS;
    s.overload_limit = 64;
    s.overload_value = 65;
  };
  EXPECT_FALSE(with(many_steps));
  EXPECT_TRUE(with([&](Status& s) {
    many_steps(s);
    s.next_velocity[0] *= 1.2;
  }));
  EXPECT_TRUE(with([](Status& s) {
    s.overload_error = Status::OVERLOAD_TOO_MANY_BURSTS;
    s.overload_limit = 32;
    s.overload_value = 33;
  }));
}

// Chance alone hardly drives a mass into the end of its rail, or makes a ball slip within its envelope.
TEST(RandomScenarios, DrawEndsOfRailsSlipperyFloorsAndTolerances) {
  int lost_steps = 0, slippery = 0, tolerances = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const sim::Scenario scenario = random_scenario(seed).scenario;
    const auto has_fault = [&scenario](auto selects) { return std::ranges::any_of(scenario.faults, selects); };
    lost_steps += has_fault([&scenario](const sim::Fault& fault) {
      return fault.kind == sim::FaultKind::kLostSteps &&
             std::isfinite(scenario.masses[static_cast<std::size_t>(fault.mass)].rail.lower_end);
    });
    slippery += has_fault([](const sim::Fault& fault) { return fault.kind == sim::FaultKind::kFrictionFalls; });
    tolerances += scenario.run.tolerance != sim::Scenario().run.tolerance;
  }
  EXPECT_GT(lost_steps, 10);
  EXPECT_GT(slippery, 10);
  EXPECT_GT(tolerances, 20);
}

// About one scenario in five has sensors, a slope or a floor that resists.
TEST(RandomScenarios, DrawSensorsSlopesAndRollingResistance) {
  int sensed = 0, estimated = 0, fixes = 0, encoders = 0, slopes = 0, resistances = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const sim::Scenario scenario = random_scenario(seed).scenario;
    const sim::SensorModel& sensors = scenario.sensors;
    estimated += sensors.attitude_estimated ? 1 : 0;
    sensed += sensors.present && !sensors.attitude_estimated ? 1 : 0;
    fixes += sensors.fix.rate_hz > 0 ? 1 : 0;
    encoders += sensors.encoder_resolution.empty() ? 0 : 1;
    slopes += scenario.surface.slope_rad > 0 ? 1 : 0;
    resistances += scenario.surface.rolling_resistance > 0 ? 1 : 0;
  }
  for (const int count : {sensed, estimated, fixes, encoders, slopes, resistances}) {
    EXPECT_GT(count, 5);
  }
}

// The same seed, the same commands; every command comes up.
TEST(OperatorScripts, HaveEveryCommandInOrder) {
  std::array<int, 6> seen{};
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const OperatorScript script = random_scenario(seed).script;
    EXPECT_EQ(comments(script), comments(random_scenario(seed).script));
    for (std::size_t i = 0; i < script.commands.size(); ++i) {
      if (i > 0) {
        EXPECT_LT(script.commands[i - 1].tick, script.commands[i].tick);
      }
      ++seen[static_cast<std::size_t>(script.commands[i].input.command)];
    }
  }
  for (std::size_t command = 1; command < seen.size(); ++command) EXPECT_GT(seen[command], 5) << command;
}

// The invariants of the docs are those of the code.
TEST(Invariants, AreThoseOfTheDocs) {
  std::ifstream file(BALLAST_SOURCE_DIR "/tools/docs/soak.md");
  const std::string page(std::istreambuf_iterator<char>(file), {});
  for (int i = 0; i < kInvariantCount; ++i) {
    const InvariantText& text = text_of(static_cast<Invariant>(i));
    const std::string row = std::string("| `") + text.name + "` | " + text.statement + " |";
    EXPECT_NE(page.find(row), std::string::npos) << row;
  }
}

}  // namespace
}  // namespace ballast::soak
