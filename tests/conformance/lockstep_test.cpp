// The in-process backend.
#include "hal/lockstep/lockstep_board.h"
#include "tests/conformance/board_conformance.h"

namespace ballast::hal::test {
namespace {

class LockstepWorld {
 public:
  using BoardType = LockstepBoard;
  LockstepBoard& board() { return board_; }

  void send(const WorldTick& tick) {
    for (const firmware::OperatorInput& command : tick.commands) send_operator(command);
    board_.give_sensors(tick.sensors);
    board_.give_verdict(tick.verdict);
    board_.release_tick(tick.sensors.tick, tick.last);
  }
  void send_sensors_only(const firmware::Sensors& sensors) {
    board_.give_sensors(sensors);
    board_.release_tick(sensors.tick);
  }
  void send_operator(const firmware::OperatorInput& command) { ASSERT_EQ(board_.give_operator(command), Status::kOk); }
  bool receive(firmware::StepCommand& steps, firmware::ControllerStatus& status) {
    return board_.take_steps(steps) == Status::kOk && board_.take_status(status) == Status::kOk;
  }
  LinkCounters counters() { return board_.counters(); }
  std::int64_t watchdog_kicks() { return board_.watchdog_kicks(); }

  // In one process nothing is waited for: an empty mailbox is reported as empty.
  void expect_silence(Status status) { EXPECT_EQ(status, Status::kEmpty); }
  // A tick is due without a verdict, too; the firmware judges the verdict's age.
  void expect_no_verdict(Status status) {
    EXPECT_EQ(status, Status::kOk);
    firmware::MonitorVerdict verdict;
    EXPECT_EQ(board_.read_verdict(verdict), Status::kEmpty);
  }

 private:
  LockstepBoard board_;
};

INSTANTIATE_TYPED_TEST_SUITE_P(Lockstep, BoardConformance, LockstepWorld);

TEST(LockstepBoard, OperatorQueueSaysWhenItIsFull) {
  LockstepBoard board;
  for (int i = 0; i < 8; ++i) ASSERT_EQ(board.give_operator(firmware::OperatorCommand::kArm), Status::kOk);
  EXPECT_EQ(board.give_operator(firmware::OperatorCommand::kArm), Status::kIo);
  firmware::OperatorInput command = firmware::OperatorCommand::kNone;
  ASSERT_EQ(board.read_operator(command), Status::kOk);
  EXPECT_EQ(board.give_operator(firmware::OperatorCommand::kArm), Status::kOk);
  EXPECT_EQ(board.counters().dropped, 1);
}

TEST(LockstepBoard, OutputsAreTakenOnce) {
  LockstepBoard board;
  firmware::StepCommand steps;
  firmware::ControllerStatus status;
  EXPECT_EQ(board.take_steps(steps), Status::kEmpty);
  EXPECT_EQ(board.take_status(status), Status::kEmpty);
  ASSERT_EQ(board.write_steps(steps), Status::kOk);
  ASSERT_EQ(board.write_status(status), Status::kOk);
  EXPECT_EQ(board.take_steps(steps), Status::kOk);
  EXPECT_EQ(board.take_status(status), Status::kOk);
  EXPECT_EQ(board.take_steps(steps), Status::kEmpty);
  EXPECT_EQ(board.take_status(status), Status::kEmpty);
}

}  // namespace
}  // namespace ballast::hal::test
