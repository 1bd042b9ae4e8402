// The board's side of the conformance suite. The suite's calls come through pipes of their own; over the link the suite
// plays the world.
#include "hal/mps2/machine.h"
#include "hal/mps2/semihosting.h"
#include "hal/mps2/startup.h"
#include "hal/target/link_board.h"
#include "tests/target/remote_calls.h"

using namespace ballast;
using namespace ballast::hal;
using hal::test::Call;

namespace {

using mps2::Machine;
namespace semihosting = mps2::semihosting;

target::Link<Machine> link(mps2::the_machine);
target::LinkBoard<Machine> board(mps2::the_machine, link);
std::uint8_t request[target::kMaxPayload];
std::uint8_t reply[target::kMaxPayload];
firmware::StepCommand steps;
firmware::ControllerStatus status;

bool read_all(std::int32_t file, std::span<std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const std::size_t count = semihosting::read(file, bytes);
    if (count == 0) return false;
    bytes = bytes.subspan(count);
  }
  return true;
}

// Makes the call and writes its results.
bool serve(Call call, target::Reader& in, target::Writer& out) {
  switch (call) {
    case Call::kWaitTick: {
      std::int64_t tick = 0;
      out(static_cast<std::uint8_t>(board.wait_tick(tick)));
      out(tick);
      return true;
    }
    case Call::kReadSensors: {
      firmware::Sensors sensors;
      const Status s = board.read_sensors(sensors);
      out(static_cast<std::uint8_t>(s));
      if (s == Status::kOk) visit(out, sensors);
      return true;
    }
    case Call::kReadVerdict: {
      firmware::MonitorVerdict verdict;
      const Status s = board.read_verdict(verdict);
      out(static_cast<std::uint8_t>(s));
      if (s == Status::kOk) visit(out, verdict);
      return true;
    }
    case Call::kReadOperator: {
      firmware::OperatorInput command;
      const Status s = board.read_operator(command);
      out(static_cast<std::uint8_t>(s));
      if (s == Status::kOk) visit(out, command);
      return true;
    }
    case Call::kWriteSteps:
      visit(in, steps);
      if (!in.complete()) return false;
      out(static_cast<std::uint8_t>(board.write_steps(steps)));
      return true;
    case Call::kWriteStatus:
      visit(in, status);
      if (!in.complete()) return false;
      out(static_cast<std::uint8_t>(board.write_status(status)));
      return true;
    case Call::kKickWatchdog:
      board.kick_watchdog();
      return true;
    case Call::kCounters: {
      const LinkCounters counters = board.counters();
      visit(out, counters);
      out(board.watchdog_kicks());
      out(board.overruns());
      return true;
    }
    case Call::kToDouble: {
      std::int64_t n = 0;
      in(n);
      out(static_cast<double>(n));
      out(static_cast<double>(static_cast<std::uint64_t>(n)));
      return in.complete();
    }
  }
  return false;
}

}  // namespace

int main() {
  if (!mps2::the_machine.open_link()) return static_cast<int>(mps2::Exit::kNoLink);
  // The rest of the command line names the calls' pipes, "/dev/fd/5 /dev/fd/6".
  constexpr std::size_t kNameSize = 9;
  char from[kNameSize + 1] = {}, to[kNameSize + 1] = {};
  for (std::size_t i = 0; i < kNameSize; ++i) {
    from[i] = mps2::command_line_rest()[i];
    to[i] = mps2::command_line_rest()[kNameSize + 1 + i];
  }
  const std::int32_t calls = semihosting::open(from, kNameSize, semihosting::Mode::kRead);
  const std::int32_t answers = semihosting::open(to, kNameSize, semihosting::Mode::kWrite);
  if (calls < 0 || answers < 0) return static_cast<int>(mps2::Exit::kNoLink);
  // The suite's steps are random numbers, so they are not given.
  static firmware::ControllerParams params;
  params.control_period_s = 0.001;
  params.timer_frequency_hz = 1e7;
  if (!mps2::the_machine.start(params, {.play = false})) return static_cast<int>(mps2::Exit::kRefused);
  for (;;) {
    std::uint8_t header[8];
    if (!read_all(calls, header)) return 0;
    std::uint32_t call = 0, size = 0;
    target::Reader head(header);
    head(call);
    head(size);
    if (size > sizeof request || !read_all(calls, std::span(request).first(size))) return 1;
    target::Reader in(std::span<const std::uint8_t>(request).first(size));
    target::Writer out{std::span<std::uint8_t>(reply).subspan(4)};
    if (!serve(static_cast<Call>(call), in, out)) return 1;
    target::Writer length{std::span<std::uint8_t>(reply).first(4)};
    length(static_cast<std::uint32_t>(out.size()));
    static_cast<void>(semihosting::write(answers, std::span<const std::uint8_t>(reply).first(4 + out.size())));
    // Most tests of the suite do not kick the watchdog themselves.
    mps2::the_machine.kick_watchdog();
  }
}
