// The board in QEMU under the conformance suite. Calls go to it through pipes of their own, the world's messages over
// the link.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "hal/target/messages.h"
#include "tests/conformance/board_conformance.h"
#include "tests/target/remote_calls.h"
#include "tools/qemu/qemu_process.h"

namespace ballast::hal::test {

inline constexpr int kLinkPair = 0, kCallPair = 1;
inline constexpr sil::Seconds kPatience{30};  // for QEMU on a busy machine; nothing is measured
inline constexpr sil::Seconds kSilence{
    5};  // of the board, after which it counts as silent; long enough for a busy machine

// hal::Board: each function calls the board in QEMU.
class RemoteBoard {
 public:
  explicit RemoteBoard(sil::QemuProcess& qemu) : qemu_(qemu) {}

  Status wait_tick(std::int64_t& tick) {
    send(Call::kWaitTick, {});
    // The board waits with its clock stopped, so this end detects silence and cuts the link.
    std::vector<std::uint8_t> answer = receive(kSilence);
    if (answer.empty()) {
      qemu_.close_writing(kLinkPair);
      answer = receive(kPatience);
    }
    target::Reader in(answer);
    const Status status = status_of(in);
    std::int64_t number = 0;
    in(number);
    EXPECT_TRUE(in.complete());
    if (status == Status::kOk) tick = number;
    return status;
  }
  [[nodiscard]] std::int64_t overruns() const { return counters().overruns; }
  Status read_sensors(firmware::Sensors& sensors) {
    const auto answer = call(Call::kReadSensors, {});
    target::Reader in(answer);
    const Status status = status_of(in);
    if (status == Status::kOk) visit(in, sensors);
    EXPECT_TRUE(in.complete());
    return status;
  }
  Status read_verdict(firmware::MonitorVerdict& verdict) {
    const auto answer = call(Call::kReadVerdict, {});
    target::Reader in(answer);
    const Status status = status_of(in);
    if (status == Status::kOk) visit(in, verdict);
    EXPECT_TRUE(in.complete());
    return status;
  }
  Status read_operator(firmware::OperatorInput& command) {
    const auto answer = call(Call::kReadOperator, {});
    target::Reader in(answer);
    const Status status = status_of(in);
    if (status == Status::kOk) visit(in, command);
    EXPECT_TRUE(in.complete());
    return status;
  }
  Status write_steps(const firmware::StepCommand& steps) {
    return write(Call::kWriteSteps, [&](target::Writer& out) { visit(out, steps); });
  }
  Status write_status(const firmware::ControllerStatus& status) {
    return write(Call::kWriteStatus, [&](target::Writer& out) { visit(out, status); });
  }
  void kick_watchdog() { call(Call::kKickWatchdog, {}); }

  struct Counters {
    LinkCounters link;
    std::int64_t watchdog_kicks = 0, overruns = 0;
  };
  [[nodiscard]] Counters counters() const {
    const auto answer = call(Call::kCounters, {});
    target::Reader in(answer);
    Counters c;
    visit(in, c.link);
    in(c.watchdog_kicks);
    in(c.overruns);
    EXPECT_TRUE(in.complete());
    return c;
  }

  // Converts n as a signed and as an unsigned integer.
  [[nodiscard]] std::pair<double, double> to_double(std::int64_t n) const {
    std::vector<std::uint8_t> argument(sizeof n);
    target::Writer out(argument);
    out(n);
    const auto answer = call(Call::kToDouble, argument);
    target::Reader in(answer);
    std::pair<double, double> is;
    in(is.first);
    in(is.second);
    EXPECT_TRUE(in.complete());
    return is;
  }

 private:
  static Status status_of(target::Reader& in) {
    std::uint8_t status = static_cast<std::uint8_t>(Status::kIo);
    in(status);
    return static_cast<Status>(status);
  }
  template <class Fields>
  Status write(Call call_made, const Fields& fields) {
    std::vector<std::uint8_t> arguments(target::kMaxPayload);
    target::Writer out(arguments);
    fields(out);
    arguments.resize(out.size());
    const auto answer = call(call_made, arguments);
    target::Reader in(answer);
    return status_of(in);
  }
  std::vector<std::uint8_t> call(Call call_made, std::span<const std::uint8_t> arguments) const {
    send(call_made, arguments);
    return receive(kPatience);
  }
  void send(Call call_made, std::span<const std::uint8_t> arguments) const {
    std::vector<std::uint8_t> bytes(8);
    target::Writer out(bytes);
    out(static_cast<std::uint32_t>(call_made));
    out(static_cast<std::uint32_t>(arguments.size()));
    bytes.insert(bytes.end(), arguments.begin(), arguments.end());
    EXPECT_EQ(qemu_.write(kCallPair, bytes, kPatience), Status::kOk);
  }
  // Empty: nothing came in time.
  std::vector<std::uint8_t> receive(sil::Seconds timeout) const {
    std::vector<std::uint8_t> bytes;
    for (;;) {
      std::uint32_t size = 0;
      target::Reader in(bytes);
      in(size);
      if (in.ok() && bytes.size() == 4 + size) return {bytes.begin() + 4, bytes.end()};
      const Status status = qemu_.read(kCallPair, bytes, timeout, nullptr);
      if (status == Status::kEmpty) return {};
      if (status != Status::kOk) {
        ADD_FAILURE() << "QEMU has ended: " << qemu_.ended(kPatience) << ' ' << qemu_.messages();
        return {};
      }
    }
  }

  sil::QemuProcess& qemu_;
};

static_assert(Board<RemoteBoard>);

struct Mps2An500 {
  static constexpr const char* kName = "mps2_an500";
  static constexpr bool kSinglePrecision = false;
};
struct Mps2An386 {
  static constexpr const char* kName = "mps2_an386";
  static constexpr bool kSinglePrecision = true;
};

template <class Target>
sil::QemuOptions conformance_program() {
  return {.board = Target::kName,
          .elf = std::string(BALLAST_BUILD_DIR) + "/" + Target::kName + "/bin/conformance.elf",
          .pipe_pairs = 2};
}

template <class Target>
class QemuWorld {
 public:
  using BoardType = RemoteBoard;
  static constexpr bool kSinglePrecision = Target::kSinglePrecision;

  QemuWorld() : board_(qemu_) { EXPECT_EQ(qemu_.start(conformance_program<Target>()), ""); }
  RemoteBoard& board() { return board_; }

  void send(const WorldTick& tick) {
    world_ = {};
    world_.last = tick.last;
    world_.sensors = tick.sensors;
    world_.verdict = tick.verdict;
    for (const auto& command : tick.commands) {
      world_.commands[static_cast<std::size_t>(world_.command_count++)] = command;
    }
    send_world();
  }
  void send_sensors_only(const firmware::Sensors& sensors) {
    world_ = {};
    world_.sensors = sensors;
    world_.has_verdict = false;
    send_world();
  }
  bool receive(firmware::StepCommand& steps, firmware::ControllerStatus& status) {
    for (;;) {
      target::Frame frame;
      const target::FrameResult result = target::decode_frame(received_, frame);
      if (result.error == target::FrameError::kNone) {
        const auto reply = std::make_unique<target::Reply>();
        const bool good = target::decode(frame, *reply);
        received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(result.size));
        steps = reply->steps;
        status = reply->status;
        return good;
      }
      if (result.error != target::FrameError::kIncomplete) return false;
      if (qemu_.read(kLinkPair, received_, kPatience, nullptr) != Status::kOk) return false;
    }
  }
  LinkCounters counters() { return board_.counters().link; }
  std::int64_t watchdog_kicks() { return board_.counters().watchdog_kicks; }
  void expect_silence(Status status) { EXPECT_EQ(status, Status::kPeerLost); }
  // The world's message says that it has no verdict.
  void expect_no_verdict(Status status) {
    EXPECT_EQ(status, Status::kOk);
    firmware::MonitorVerdict verdict;
    EXPECT_EQ(board_.read_verdict(verdict), Status::kEmpty);
  }

 private:
  void send_world() {
    std::vector<std::uint8_t> bytes(target::kMaxFrame);
    const std::size_t size = target::encode(world_, world_.sensors.tick, bytes);
    ASSERT_GT(size, 0u);
    ASSERT_EQ(qemu_.write(kLinkPair, std::span(bytes).first(size), kPatience), Status::kOk);
  }

  sil::QemuProcess qemu_;
  RemoteBoard board_;
  target::World world_;
  std::vector<std::uint8_t> received_;
};

}  // namespace ballast::hal::test
