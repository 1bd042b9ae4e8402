// The LCM backend, over the loopback network; the world is interleaved with the board in one thread.
#include <limits>
#include <optional>

#include "hal/lcm/channels.h"
#include "hal/lcm/lcm_board.h"
#include "hal/lcm/scenario_piece.h"
#include "tests/conformance/board_conformance.h"
#include "tests/conformance/test_bus.h"
#include "tests/random_seed.h"

namespace ballast::hal::test {
namespace {

// Timeouts that only tests of silence wait for, so that the other tests pass on a busy machine.
constexpr Seconds kShort{0.2};
constexpr Seconds kLong{30};

constexpr std::int64_t kRunId = 7;

class LcmWorld {
 public:
  using BoardType = LcmBoard;

  LcmWorld() : LcmWorld(kLong) {}
  explicit LcmWorld(Seconds start_timeout)
      : board_bus_(test_bus_url()),
        world_bus_(test_bus_url()),
        board_(board_bus_, {.scenario_id = kScenarioId,
                            .control_period_s = kControlPeriod_s,
                            .start_timeout = start_timeout,
                            .peer_timeout = Seconds(1)}) {
    EXPECT_TRUE(board_bus_.good() && world_bus_.good()) << "no multicast on this machine?";
    world_bus_.join(kRunId);
    world_bus_.subscribe<step_command_t>(kChannelStepCommand, [this](const step_command_t& m) { steps_ = m; });
    world_bus_.subscribe<controller_status_t>(kChannelControllerStatus, [this](const controller_status_t& m) {
      if (m.tick == kWaitingTick) {
        waiting_ = m;
      } else {
        status_ = m;
      }
    });
  }

  LcmBoard& board() { return board_; }
  Bus& bus() { return world_bus_; }

  void send(const WorldTick& tick) {
    for (const firmware::OperatorInput& command : tick.commands) send_operator(command);
    publish(kChannelSensors, sensors(tick.sensors, tick.last));
    publish(kChannelTrip, trip(tick.verdict));
  }
  void send_sensors_only(const firmware::Sensors& s) { publish(kChannelSensors, sensors(s, false)); }
  void send_operator(const firmware::OperatorInput& command) {
    publish(kChannelOperator, to_message(command, 0, ++sequence_, kControlPeriod_s));
  }
  bool receive(firmware::StepCommand& steps, firmware::ControllerStatus& status) {
    steps_.reset();
    status_.reset();
    const auto both = [this] { return steps_ && status_; };
    if (world_bus_.receive_until(after(WallClock::now(), kLong), both) != Status::kOk) return false;
    EXPECT_EQ(steps_->utime, tick_utime(steps_->tick, kControlPeriod_s));
    EXPECT_EQ(status_->utime, tick_utime(status_->tick, kControlPeriod_s));
    steps = from_message(*steps_);
    status = from_message(*status_);
    return true;
  }
  LinkCounters counters() { return board_.counters(); }
  std::int64_t watchdog_kicks() { return board_.watchdog_kicks(); }

  void expect_silence(Status status) {
    EXPECT_EQ(status, Status::kPeerLost);
    EXPECT_STREQ(board_.peer(), "plant");
    EXPECT_EQ(board_.trouble(), "lost plant: no sensors for 1 s after tick 0");
  }
  void expect_no_verdict(Status status) {
    EXPECT_EQ(status, Status::kPeerLost);
    EXPECT_STREQ(board_.peer(), "monitor");
    EXPECT_EQ(board_.trouble(), "lost monitor: no verdict for 1 s after tick 0");
  }

  static sensors_t sensors(const firmware::Sensors& s, bool last) {
    return to_message(s, kMassCount, last, kScenarioId, kControlPeriod_s);
  }
  static trip_t trip(const firmware::MonitorVerdict& verdict) {
    trip_t message{};
    message.tick = verdict.tick;
    message.scenario_id = kScenarioId;
    message.tripped = verdict.tripped ? 1 : 0;
    return message;
  }
  template <class M>
  void publish(const char* channel, const M& message) {
    ASSERT_EQ(world_bus_.publish(channel, message), Status::kOk);
  }
  const std::optional<controller_status_t>& waiting() const { return waiting_; }
  std::int64_t refused_messages() const { return status_->refused_messages; }

 private:
  Bus board_bus_, world_bus_;
  LcmBoard board_;
  std::optional<step_command_t> steps_;
  std::optional<controller_status_t> status_, waiting_;
  std::int64_t sequence_ = 0;
};

INSTANTIATE_TYPED_TEST_SUITE_P(Lcm, BoardConformance, LcmWorld);

template <class M>
std::vector<std::uint8_t> encoded(const M& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  EXPECT_EQ(message.encode(bytes.data(), 0, static_cast<int>(bytes.size())), static_cast<int>(bytes.size()));
  return bytes;
}

// Lets the board serve a tick, whatever messages came before it.
void serve(LcmWorld& world, const WorldTick& tick) {
  world.send(tick);
  std::int64_t number = -99;
  ASSERT_EQ(world.board().wait_tick(number), Status::kOk);
  ASSERT_EQ(number, tick.sensors.tick);
}

TEST(LcmBoard, MalformedMessagesAreCountedAndIgnored) {
  LcmWorld world;
  lcm::LCM raw(test_bus_url());
  ASSERT_TRUE(raw.good());
  std::int64_t sent = 0;
  const auto send = [&](const char* channel, const std::vector<std::uint8_t>& bytes) {
    ASSERT_EQ(raw.publish(channel, bytes.data(), static_cast<unsigned>(bytes.size())), 0);
    ++sent;
  };
  const std::vector<std::uint8_t> good = encoded(LcmWorld::sensors(world_tick(5).sensors, false));

  auto truncated = good;
  truncated.pop_back();
  send(kChannelSensors, truncated);
  send(kChannelSensors, {good.begin(), good.begin() + 7});
  send(kChannelSensors, {});
  auto longer = good;
  longer.push_back(0);
  send(kChannelSensors, longer);
  auto wrong_hash = good;
  wrong_hash[3] ^= 1;
  send(kChannelSensors, wrong_hash);
  send(kChannelSensors, encoded(LcmWorld::trip(world_tick(5).verdict)));
  send(kChannelTrip, good);

  for (const int count : {-1, 9, 127, -128}) {
    sensors_t message = LcmWorld::sensors(world_tick(5).sensors, false);
    message.mass_count = static_cast<std::int8_t>(count);
    send(kChannelSensors, encoded(message));
  }
  sensors_t switches = LcmWorld::sensors(world_tick(5).sensors, false);
  switches.limit_switch[7] = 4;
  send(kChannelSensors, encoded(switches));
  sensors_t last = LcmWorld::sensors(world_tick(5).sensors, false);
  last.last = 2;
  send(kChannelSensors, encoded(last));
  trip_t tripped = LcmWorld::trip(world_tick(5).verdict);
  tripped.tripped = -1;
  send(kChannelTrip, encoded(tripped));
  trip_t cause = LcmWorld::trip(world_tick(5).verdict);
  cause.cause = 8;
  send(kChannelTrip, encoded(cause));
  for (const int command : {0, 8, -1}) {
    operator_t message = to_message(firmware::OperatorCommand::kArm, 0, 1, kControlPeriod_s);
    message.command = static_cast<std::int8_t>(command);
    send(kChannelOperator, encoded(message));
  }

  serve(world, world_tick(0));
  // Two sockets may overtake each other, so further ticks wait for the rest.
  for (std::int64_t tick = 1; world.counters().malformed < sent && tick < 100; ++tick) serve(world, world_tick(tick));
  EXPECT_EQ(world.counters().malformed, sent);
  firmware::OperatorInput command = firmware::OperatorCommand::kNone;
  EXPECT_EQ(world.board().read_operator(command), Status::kEmpty);
}

TEST(LcmBoard, SaysItIsWaitingBeforeTheFirstTick) {
  LcmWorld world(kShort);
  std::int64_t tick = -99;
  EXPECT_EQ(world.board().wait_tick(tick), Status::kPeerLost);
  EXPECT_STREQ(world.board().peer(), "plant");
  EXPECT_EQ(world.board().trouble(), "lost plant: no sensors for 0.2 s before the first tick");
  ASSERT_EQ(world.bus().receive_until(after(WallClock::now(), kLong), [&] { return world.waiting().has_value(); }),
            Status::kOk);
  EXPECT_EQ(world.waiting()->tick, kWaitingTick);
  EXPECT_EQ(world.waiting()->utime, 1000 * kWaitingTick);
  EXPECT_EQ(world.waiting()->scenario_id, kScenarioId);
  EXPECT_EQ(world.waiting()->mode, controller_status_t::MODE_DISARMED);
  EXPECT_EQ(world.board().wait_tick(tick), Status::kPeerLost) << "a lost peer stays lost";
}

TEST(LcmBoard, NamesTheMonitorIfItNeverSpeaks) {
  LcmWorld world(kShort);
  world.send_sensors_only(world_tick(-2).sensors);
  std::int64_t tick = -99;
  EXPECT_EQ(world.board().wait_tick(tick), Status::kPeerLost);
  EXPECT_STREQ(world.board().peer(), "monitor");
}

// The board keeps a trip by itself, so the conversion is tested by itself.
TEST(LcmMessages, AVerdictKeepsItsTickAndItsTrip) {
  for (const bool tripped : {false, true}) {
    const firmware::MonitorVerdict verdict = from_message(LcmWorld::trip({.tick = 7, .tripped = tripped}));
    EXPECT_EQ(verdict.tick, 7);
    EXPECT_EQ(verdict.tripped, tripped);
  }
}

TEST(LcmBoard, VerdictMayComeBeforeTheSensors) {
  LcmWorld world;
  world.publish(kChannelTrip, LcmWorld::trip({.tick = kWaitingTick, .tripped = false}));
  for (std::int64_t k = -2; k < 3; ++k) {
    world.publish(kChannelTrip, LcmWorld::trip({.tick = k, .tripped = k >= 1}));
    world.send_sensors_only(world_tick(k).sensors);
    std::int64_t tick = -99;
    ASSERT_EQ(world.board().wait_tick(tick), Status::kOk);
    EXPECT_EQ(tick, k);
    firmware::MonitorVerdict verdict;
    ASSERT_EQ(world.board().read_verdict(verdict), Status::kOk);
    EXPECT_EQ(verdict.tripped, k >= 1);
  }
  EXPECT_EQ(world.counters().repeated + world.counters().out_of_order, 0);
}

TEST(LcmBoard, AnotherScenarioIsAnErrorThatNamesTheSender) {
  {
    LcmWorld world;
    sensors_t message = LcmWorld::sensors(world_tick(0).sensors, false);
    message.scenario_id = kScenarioId + 1;
    world.publish(kChannelSensors, message);
    std::int64_t tick = -99;
    EXPECT_EQ(world.board().wait_tick(tick), Status::kForeignScenario);
    EXPECT_EQ(world.board().trouble(), "plant runs another scenario");
    EXPECT_EQ(world.counters().foreign, 1);
  }
  {
    LcmWorld world;
    serve(world, world_tick(0));
    trip_t message = LcmWorld::trip({.tick = kWaitingTick, .tripped = false});
    message.scenario_id = 0;
    world.publish(kChannelTrip, message);
    std::int64_t tick = -99;
    EXPECT_EQ(world.board().wait_tick(tick), Status::kForeignScenario);
    EXPECT_EQ(world.board().trouble(), "monitor runs another scenario");
  }
}

TEST(LcmBoard, RepeatedOperatorMessageIsObeyedOnce) {
  LcmWorld world;
  const operator_t arm = to_message(firmware::OperatorCommand::kArm, 0, 1, kControlPeriod_s);
  operator_t start_of_another_sender = to_message(firmware::OperatorCommand::kStart, 0, 1, kControlPeriod_s);
  start_of_another_sender.sender = 1;
  for (const operator_t& message : {arm, arm, start_of_another_sender, arm}) world.publish(kChannelOperator, message);
  serve(world, world_tick(0));
  firmware::OperatorInput command = firmware::OperatorCommand::kNone;
  ASSERT_EQ(world.board().read_operator(command), Status::kOk);
  EXPECT_EQ(command.command, firmware::OperatorCommand::kArm);
  ASSERT_EQ(world.board().read_operator(command), Status::kOk);
  EXPECT_EQ(command.command, firmware::OperatorCommand::kStart);
  EXPECT_EQ(world.board().read_operator(command), Status::kEmpty);
  EXPECT_EQ(world.counters().repeated, 2);
}

TEST(LcmBoard, CommandsOlderThanTheirSendersNewestAreNotObeyedButStopsAre) {
  using enum firmware::OperatorCommand;
  LcmWorld world;
  const auto say = [&](firmware::OperatorCommand command, std::int64_t sequence) {
    world.publish(kChannelOperator, to_message(command, 0, sequence, kControlPeriod_s));
  };
  std::int64_t tick = 0;
  const auto expect_obeyed = [&](std::initializer_list<firmware::OperatorCommand> commands) {
    serve(world, world_tick(tick++));
    firmware::OperatorInput command;
    for (const firmware::OperatorCommand obeyed : commands) {
      ASSERT_EQ(world.board().read_operator(command), Status::kOk);
      EXPECT_EQ(command.command, obeyed);
    }
    EXPECT_EQ(world.board().read_operator(command), Status::kEmpty);
  };
  say(kArm, 5), say(kStart, 6), say(kArm, 5), say(kReset, 4);
  expect_obeyed({kArm, kStart});
  say(kStop, 3), say(kStop, 3), say(kReset, 7);
  expect_obeyed({kStop, kReset});
  say(kStop, 7), say(kStop, 7), say(kStop, 3);  // of a tool that does not count; an old stop after a newer one
  expect_obeyed({kStop});
  EXPECT_EQ(world.counters().old, 3);
  EXPECT_EQ(world.counters().repeated, 2);
  EXPECT_EQ(world.counters().dropped, 0);
}

TEST(LcmBoard, AStopHeardBeforeTheRunIsKnownIsNotLost) {
  LcmWorld world;
  world.send_operator(firmware::OperatorCommand::kStop);
  for (int i = 0; i < 64; ++i) world.send_operator(firmware::OperatorCommand::kReset);
  serve(world, world_tick(0));
  firmware::OperatorInput command;
  ASSERT_EQ(world.board().read_operator(command), Status::kOk);
  EXPECT_EQ(command.command, firmware::OperatorCommand::kStop);
  EXPECT_EQ(world.counters().dropped, 1);
}

operator_t said(firmware::OperatorCommand command, std::int64_t tick, std::int64_t sequence, std::int64_t sender) {
  operator_t message = to_message(command, tick, sequence, kControlPeriod_s);
  message.sender = sender;
  return message;
}

TEST(OperatorInbox, AStopGoesFirstWhateverComesBeforeAndAfterIt) {
  using enum firmware::OperatorCommand;
  OperatorInbox inbox;
  std::int64_t sequence = 0;
  for (int i = 0; i < 10; ++i) inbox.hear(said(kReset, 0, ++sequence, 1));
  inbox.hear(said(kStop, 0, ++sequence, 1));
  for (int i = 0; i < 200; ++i) inbox.hear(said(kArm, 0, ++sequence, 1 + i % 3));
  auto message = inbox.next();
  ASSERT_TRUE(message);
  EXPECT_EQ(message->command, operator_t::COMMAND_STOP);
  int after = 0;
  while ((message = inbox.next())) {
    EXPECT_EQ(message->command, operator_t::COMMAND_ARM);
    EXPECT_EQ(message->sequence, 12 + after++) << "the first of them are kept";
  }
  EXPECT_EQ(after, 63);
  EXPECT_EQ(inbox.counters().dropped, 10 + 200 - after);
}

TEST(OperatorInbox, WhatFoundNoRoomCanBeSaidAgain) {
  using enum firmware::OperatorCommand;
  OperatorInbox inbox;
  for (std::int64_t k = 1; k <= 65; ++k) inbox.hear(said(kArm, 0, k, 1));
  EXPECT_EQ(inbox.counters().dropped, 1);
  while (inbox.next()) {
  }
  inbox.hear(said(kArm, 0, 65, 1));
  ASSERT_TRUE(inbox.next());
  inbox.hear(said(kArm, 0, 65, 1));
  EXPECT_FALSE(inbox.next());
  EXPECT_EQ(inbox.counters().repeated, 1);
}

// No command is obeyed twice, however many other senders speak in the meantime.
TEST(OperatorInbox, CopiesAreRefusedWhateverCameBetween) {
  using enum firmware::OperatorCommand;
  const std::uint64_t seed = ballast::test::random_seed();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  OperatorInbox inbox;
  inbox.know(said(kArm, 0, 5, 0));
  std::vector<operator_t> all;
  for (std::int64_t tick = 1; tick <= 300; ++tick) {
    all.push_back(said(tick % 2 == 0 ? kMove : kArm, tick, 1000 + tick, tick));
    inbox.hear(all.back());
    ASSERT_TRUE(inbox.next()) << "a new sender's, of this tick: " << tick;
    for (int copies = 0; copies < 20; ++copies) inbox.hear(all[random() % all.size()]);
    inbox.hear(said(kArm, 0, 5, 0));  // one's own
    ASSERT_FALSE(inbox.next());
  }
  EXPECT_EQ(inbox.counters().repeated + inbox.counters().old, 300 * 20);
  // A stop of a sender that was replaced is obeyed once.
  inbox.hear(said(kStop, 1, 2000, 1));
  ASSERT_TRUE(inbox.next());
  inbox.hear(said(kStop, 1, 2000, 1));
  EXPECT_FALSE(inbox.next());
  // An old stop makes a replaced sender known again. Its commands after that stop are still not obeyed twice.
  inbox.hear(said(kStop, 2, 1, 2));
  ASSERT_TRUE(inbox.next());
  inbox.hear(all[1]);
  EXPECT_FALSE(inbox.next());
  // More new senders than places in one tick: senders without a place are heard in the next tick.
  int taken = 0;
  for (int sender = 1000; sender < 1100; ++sender) {
    inbox.hear(said(kArm, 400, 1, sender));
    while (inbox.next()) ++taken;
  }
  EXPECT_EQ(taken, 32);
  inbox.hear(said(kArm, 401, 1, 1099));
  EXPECT_TRUE(inbox.next());
}

// Once its sender is replaced, a command with a future tick would silence every sender that is not known yet.
TEST(OperatorInbox, ACommandOfATickStillToComeIsNotBelieved) {
  using enum firmware::OperatorCommand;
  OperatorInbox inbox;
  inbox.now(100);
  inbox.hear(said(kArm, 100 + OperatorInbox::kMostAhead + 1, 1, 1));
  inbox.hear(said(kMove, std::int64_t{1} << 61, 2, 1));
  EXPECT_FALSE(inbox.next());
  EXPECT_EQ(inbox.counters().old, 2);
  inbox.hear(said(kArm, 100 + OperatorInbox::kMostAhead, 3, 1));
  EXPECT_TRUE(inbox.next());
  inbox.hear(said(kStop, std::int64_t{1} << 61, 4, 2));
  ASSERT_TRUE(inbox.next()) << "a stop is obeyed";
  // Each of these replaces another sender.
  for (int sender = 1000; sender < 1100; ++sender) {
    inbox.hear(said(kStop, std::int64_t{1} << 61, 1, sender));
    ASSERT_TRUE(inbox.next());
  }
  inbox.now(103);
  inbox.hear(said(kArm, 103, 1, 5000));
  EXPECT_TRUE(inbox.next()) << "of a sender who is not known, and speaks in time";
}

// Messages of a log played back and of an earlier run have no effect, before the first tick and after it, whatever
// their ticks and sequences are.
TEST(LcmBoard, OtherRunsAreCountedAndNeverUsed) {
  LcmWorld world;
  const auto say_all = [&](std::int64_t run_id, std::int64_t tick) {
    world.bus().join(run_id);
    world.send_operator(firmware::OperatorCommand::kStop);
    world.publish(kChannelTrip, LcmWorld::trip({.tick = tick, .tripped = true}));
    if (run_id == 0 || tick > 0) world.send_sensors_only(world_tick(tick).sensors);
    world.bus().join(kRunId);
  };
  say_all(0, 0), say_all(kRunId + 1, 0);
  for (std::int64_t tick = 0; tick < 2; ++tick) {
    serve(world, world_tick(tick));
    firmware::MonitorVerdict verdict;
    ASSERT_EQ(world.board().read_verdict(verdict), Status::kOk);
    EXPECT_FALSE(verdict.tripped);
    firmware::OperatorInput command;
    EXPECT_EQ(world.board().read_operator(command), Status::kEmpty);
    if (tick == 0) say_all(0, 1), say_all(kRunId + 1, 1);
  }
  EXPECT_EQ(world.counters().foreign, 11);
  firmware::ControllerStatus status;
  ASSERT_EQ(world.board().write_status(status), Status::kOk);
  ASSERT_EQ(world.board().write_steps({}), Status::kOk);
  firmware::StepCommand steps;
  ASSERT_TRUE(world.receive(steps, status));
  EXPECT_EQ(world.refused_messages(), 11);
}

TEST(LcmBoard, ATripIsTakenBackByAnOperatorsResetOnly) {
  LcmWorld world;
  const bool says[] = {false, true, false, false, false};
  const bool heard[] = {false, true, true, false, false};
  for (std::int64_t k = 0; k < 5; ++k) {
    WorldTick tick = world_tick(k);
    tick.verdict.tripped = says[k];
    if (k == 3) tick.commands = {firmware::OperatorCommand::kReset};
    serve(world, tick);
    firmware::MonitorVerdict verdict;
    ASSERT_EQ(world.board().read_verdict(verdict), Status::kOk);
    EXPECT_EQ(verdict.tripped, heard[k]) << k;
    firmware::OperatorInput command;
    EXPECT_EQ(world.board().read_operator(command), k == 3 ? Status::kOk : Status::kEmpty);
  }
  EXPECT_EQ(world.counters().taken_back, 1);
}

// A later trip stays after each of these: the same reset again, an older reset, a reset of another run, and verdicts of
// this run and tick without a trip.
TEST(LcmBoard, AReplayedOrForgedResetTakesNoTripBack) {
  LcmWorld world;
  operator_t reset = to_message(firmware::OperatorCommand::kReset, 0, 5, kControlPeriod_s);
  std::int64_t tick = 0;
  const auto heard = [&](bool said) {
    WorldTick now = world_tick(tick++);
    now.verdict.tripped = said;
    serve(world, now);
    firmware::MonitorVerdict verdict;
    EXPECT_EQ(world.board().read_verdict(verdict), Status::kOk);
    return verdict.tripped;
  };
  firmware::OperatorInput command;
  EXPECT_TRUE(heard(true));
  world.publish(kChannelOperator, reset);
  EXPECT_FALSE(heard(false));
  EXPECT_EQ(world.board().read_operator(command), Status::kOk);
  EXPECT_TRUE(heard(true));

  world.publish(kChannelOperator, reset);
  EXPECT_TRUE(heard(false)) << "replayed";
  --reset.sequence;
  world.publish(kChannelOperator, reset);
  EXPECT_TRUE(heard(false)) << "older";
  world.bus().join(kRunId + 1);
  reset.sequence = 100;
  world.publish(kChannelOperator, reset);
  world.bus().join(kRunId);
  EXPECT_TRUE(heard(false)) << "of another run";
  for (int i = 0; i < 3; ++i) world.publish(kChannelTrip, LcmWorld::trip({.tick = tick, .tripped = false}));
  EXPECT_TRUE(heard(true)) << "verdicts of this run";
  EXPECT_EQ(world.board().read_operator(command), Status::kEmpty);
  EXPECT_EQ(world.counters().repeated, 1 + 2);  // the monitor's own comes when the tick is served
  EXPECT_EQ(world.counters().old, 1);
  EXPECT_EQ(world.counters().foreign, 1);
  EXPECT_EQ(world.counters().taken_back, 4);
}

TEST(LcmBoard, InterruptEndsTheWait) {
  const volatile std::sig_atomic_t interrupted = 1;
  Bus bus(test_bus_url(), &interrupted);
  ASSERT_TRUE(bus.good());
  LcmBoard board(bus, {.scenario_id = kScenarioId, .control_period_s = kControlPeriod_s});
  std::int64_t tick = -99;
  EXPECT_EQ(board.wait_tick(tick), Status::kInterrupted);
  EXPECT_EQ(board.trouble(), "interrupted");
}

TEST(LcmBus, BadUrlIsNotGood) { EXPECT_FALSE(Bus("nonsense://").good()); }

// Gives decode() good messages with any bytes changed, and noise. It must refuse them or give a message in range, and
// leave its output alone when it refuses.
template <class M>
void decode_noise(std::mt19937_64& random) {
  const auto good = encoded(M{});
  for (int round = 0; round < 2000; ++round) {
    auto bytes = good;
    const std::size_t from = round % 2 == 0 ? 8 : 0;  // with and without the right hash
    for (std::size_t i = from; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(random());
    if (round % 3 == 0) bytes.resize(random() % bytes.size());
    M message{};
    message.tick = 4711;
    if (decode(bytes.data(), bytes.size(), message)) {
      EXPECT_TRUE(in_range(message));
    } else {
      EXPECT_EQ(message.tick, 4711);
    }
  }
}

TEST(LcmMessages, NoiseNeverGetsThrough) {
  const std::uint64_t seed = ballast::test::random_seed();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  decode_noise<contact_t>(random);
  decode_noise<plant_state_t>(random);
  decode_noise<sensors_t>(random);
  decode_noise<step_command_t>(random);
  decode_noise<controller_status_t>(random);
  decode_noise<trip_t>(random);
  decode_noise<operator_t>(random);
  decode_noise<scenario_piece_t>(random);
}

step_command_t one_burst() {
  step_command_t message{};
  message.motor_count = 2;
  message.burst_count = 1;
  message.motor[0] = 1;
  message.direction[0] = -1;
  message.count[0] = 1;
  return message;
}

TEST(LcmMessages, StepCommandsOutOfRangeAreRefused) {
  EXPECT_TRUE(in_range(one_burst()));
  const auto refused = [](auto change) {
    step_command_t message = one_burst();
    change(message);
    EXPECT_FALSE(in_range(message));
    step_command_t out{};
    const auto bytes = encoded(message);
    EXPECT_FALSE(decode(bytes.data(), bytes.size(), out));
  };
  refused([](step_command_t& m) { m.motor_count = 9; });
  refused([](step_command_t& m) { m.motor_count = -1; });
  refused([](step_command_t& m) { m.burst_count = 33; });
  refused([](step_command_t& m) { m.burst_count = -1; });
  refused([](step_command_t& m) { m.burst_count = 32767; });
  refused([](step_command_t& m) { m.motor[0] = 2; });
  refused([](step_command_t& m) { m.motor[0] = -1; });
  refused([](step_command_t& m) { m.direction[0] = 0; });
  refused([](step_command_t& m) { m.direction[0] = 2; });
  refused([](step_command_t& m) { m.count[0] = 0; });
  refused([](step_command_t& m) { m.first[0] = -1; });
  refused([](step_command_t& m) { m.interval[0] = -1; });
}

TEST(LcmMessages, OtherTypesOutOfRangeAreRefused) {
  contact_t contact{};
  EXPECT_TRUE(in_range(contact));
  contact.regime = 3;
  EXPECT_FALSE(in_range(contact));
  contact = {};
  contact.last = 2;
  EXPECT_FALSE(in_range(contact));

  plant_state_t state{};
  state.mass_count = 8;
  EXPECT_TRUE(in_range(state));
  state.mass_count = 9;
  EXPECT_FALSE(in_range(state));
  state = {};
  state.last = -1;
  EXPECT_FALSE(in_range(state));

  controller_status_t status{};
  status.mode = controller_status_t::MODE_HALTING;
  EXPECT_TRUE(in_range(status));
  status.mode = controller_status_t::MODE_HALTING + 1;
  EXPECT_FALSE(in_range(status));
  status = {};
  status.at_rest = 2;
  EXPECT_FALSE(in_range(status));
  status = {};
  status.motor_count = 9;
  EXPECT_FALSE(in_range(status));
  status = {};
  status.refusal = controller_status_t::REFUSAL_OFF_COURSE + 1;
  EXPECT_FALSE(in_range(status));
  status = {};
  status.refusal_motor = -2;
  EXPECT_FALSE(in_range(status));
  status = {};
  status.refusal_piece = 129;
  EXPECT_FALSE(in_range(status));
  status = {};
  status.planned = 2;
  EXPECT_FALSE(in_range(status));
}

// Every number of a message comes from the firmware's struct, except those that the sender adds.
TEST(LcmMessages, EveryNumberOfAMessageIsDescribed) {
  firmware::StepCommand steps;
  steps.motor_count = firmware::kMaxMasses;
  steps.burst_count = firmware::kMaxBursts;
  firmware::ControllerStatus status;
  status.motor_count = firmware::kMaxMasses;
  const auto count = [](const auto& message) { return static_cast<int>(values_of(message).size()); };
  using hal::detail::member_count;  // elements of arrays count one by one
  EXPECT_EQ(count(firmware::Sensors()) + 5, member_count<sensors_t>()) << "utime, two ids, mass_count, last";
  EXPECT_EQ(count(steps) + 2, member_count<step_command_t>()) << "utime, run_id";
  EXPECT_EQ(count(status) + 3, member_count<controller_status_t>()) << "utime, run_id, refused_messages";
  firmware::CoursePart part;
  part.count = firmware::kCoursePart;
  EXPECT_EQ(count(firmware::OperatorInput(firmware::MoveRequest())) + count(part) + 5, member_count<operator_t>())
      << "tick, utime, run_id, sender, sequence";
  EXPECT_EQ(count(firmware::MonitorVerdict()) + 8, member_count<trip_t>())
      << "utime, two ids, cause, trip_tick, trip_time_s, value, limit";
}

// Differences of ticks far from 0 would overflow, so every message with such a tick is refused.
template <class M>
void expect_ticks_bounded(M message) {
  constexpr std::int64_t kLimit = std::int64_t{1} << 62;
  for (const auto& [tick, good] :
       {std::pair(kLimit - 1, true), std::pair(1 - kLimit, true), std::pair(kLimit, false), std::pair(-kLimit, false),
        std::pair(std::numeric_limits<std::int64_t>::max(), false),
        std::pair(std::numeric_limits<std::int64_t>::min(), false)}) {
    message.tick = tick;
    M out{};
    const auto bytes = encoded(message);
    EXPECT_EQ(decode(bytes.data(), bytes.size(), out), good) << M::getTypeName() << ' ' << tick;
  }
}

TEST(LcmMessages, TicksThatCouldOverflowAreRefused) {
  expect_ticks_bounded(contact_t{});
  expect_ticks_bounded(plant_state_t{});
  expect_ticks_bounded(sensors_t{});
  expect_ticks_bounded(one_burst());
  expect_ticks_bounded(controller_status_t{});
  expect_ticks_bounded(trip_t{});
  expect_ticks_bounded(to_message(firmware::OperatorCommand::kArm, 0, 1, kControlPeriod_s));
  trip_t trip{};
  trip.trip_tick = std::int64_t{1} << 62;
  EXPECT_FALSE(in_range(trip));
}

TEST(LcmMessages, UtimeIsRounded) {
  EXPECT_EQ(tick_utime(3, 1.0 / 3), 1000000);
  EXPECT_EQ(tick_utime(-2, 0.001), -2000);
  EXPECT_EQ(tick_utime(1, 0.0000015), 2);  // 1.5 us, halves away from zero
}

}  // namespace
}  // namespace ballast::hal::test
