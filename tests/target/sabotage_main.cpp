// The firmware with a fault built in. The rest of the command line is "WHAT@TICK": what happens when that tick is
// served.
#include <cstring>

#include "hal/mps2/machine.h"
#include "hal/mps2/semihosting.h"
#include "hal/mps2/startup.h"
#include "hal/target/build_id.h"
#include "hal/target/serve.h"

using namespace ballast;
using namespace ballast::hal;
using mps2::the_machine;

namespace {

bool is(const char* what) { return std::strncmp(mps2::command_line_rest(), what, std::strlen(what)) == 0; }

std::int64_t when() {
  const char* at = std::strchr(mps2::command_line_rest(), '@');
  if (at == nullptr) return INT64_MAX;
  std::int64_t tick = 0;
  for (++at; *at >= '0' && *at <= '9'; ++at) tick = 10 * tick + (*at - '0');
  return tick;
}

// Each call takes more of the stack than it gives back.
[[gnu::noinline]] std::uint32_t recurse(volatile std::uint32_t* before) {
  volatile std::uint32_t room[64];
  for (auto& word : room) word = *before;
  return room[0] == 1 ? 0 : recurse(room) + room[1];
}

void spin(std::uint32_t instructions) {
  for (std::uint32_t i = 0; i < instructions / 3; ++i) asm volatile("nop");  // with the loop's own two
}

// Faults with the stack pointer in r0: with the FPU's registers on the stack or without, on a multiple of 8 or not.
void fault_telling_sp(bool fpu, bool aligned) {
  if (fpu) {
    asm volatile("vmov s0, s0");
  } else {  // CONTROL.FPCA
    asm volatile("mrs r0, control\n bic r0, r0, #4\n msr control, r0\n isb" ::: "r0");
  }
  asm volatile("mov r0, sp\n bic r0, r0, #7\n sub r0, r0, %0\n mov sp, r0\n udf #0" ::"r"(aligned ? 0 : 4) : "r0");
}

void sabotage() {
  static std::uint8_t junk[100];
  volatile std::uint32_t zero = 0;
  if (is("undefined")) asm volatile("udf #0");
  if (is("sp-fpu@")) fault_telling_sp(true, true);
  if (is("sp-fpu-odd@")) fault_telling_sp(true, false);
  if (is("sp-plain@")) fault_telling_sp(false, true);
  if (is("sp-plain-odd@")) fault_telling_sp(false, false);
  if (is("unmapped")) zero = *reinterpret_cast<volatile std::uint32_t*>(0x80000000);
  if (is("divide")) zero = 7 / zero;  // 1 / x would be a comparison
  if (is("overflow")) zero = recurse(&zero);
  if (is("assert")) __builtin_trap();
  while (is("hang")) {
  }
  if (is("masked")) asm volatile("cpsid i\n 1: b 1b");
  if (is("late@")) spin(500000);  // two control periods of 1 ms; the watchdog waits for four
  if (is("quit")) mps2::semihosting::exit(0);
  if (is("junk")) static_cast<void>(the_machine.write(junk));
  std::size_t count = 0;
  if (is("silent")) static_cast<void>(the_machine.read(junk, count));  // what it waits for will never come
}

// The board, but for what has been built in.
template <Board B>
class Sabotaged {
 public:
  explicit Sabotaged(B& board) : board_(board) {}
  Status wait_tick(std::int64_t& tick) {
    const Status status = board_.wait_tick(tick);
    due_ = tick == when();
    return status;
  }
  [[nodiscard]] std::int64_t overruns() const { return board_.overruns(); }
  Status read_sensors(firmware::Sensors& sensors) {
    if (due_) sabotage();
    return board_.read_sensors(sensors);
  }
  Status read_verdict(firmware::MonitorVerdict& verdict) { return board_.read_verdict(verdict); }
  Status read_operator(firmware::OperatorInput& command) { return board_.read_operator(command); }
  Status write_steps(const firmware::StepCommand& steps) {
    static firmware::StepCommand other;
    other = steps;
    if (due_ && is("steps-tick")) --other.tick;
    if (due_ && is("steps-motors")) other.motor_count = other.burst_count = 0;
    const Status status = board_.write_steps(other);
    if (due_ && is("pins")) {  // something else reaches them than the host is told
      other.motor_count = 1;
      other.burst_count = 1;
      other.bursts[0] = {.motor = 0, .direction = 1, .count = 1, .first_ticks = 17};
      the_machine.load(other);
    }
    return status;
  }
  Status write_status(const firmware::ControllerStatus& status) {
    static firmware::ControllerStatus other;
    if (!due_ || !is("status-motors")) return board_.write_status(status);
    other = status;
    --other.motor_count;
    return board_.write_status(other);
  }
  void kick_watchdog() {
    if (due_ && is("late-after")) spin(300000);  // the tick is served, but so is the beginning of the next one over
    board_.kick_watchdog();
  }

 private:
  B& board_;
  bool due_ = false;
};

template <Board B>
class SabotagedLoop {
 public:
  SabotagedLoop(const firmware::ControllerParams& params, B& board) : board_(board), loop_(params, board_) {}
  Status run() { return loop_.run(); }

 private:
  Sabotaged<B> board_;
  ControlLoop<Sabotaged<B>> loop_;
};

}  // namespace

int main() {
  if (!the_machine.open_link()) return static_cast<int>(mps2::Exit::kNoLink);
  target::Identity identity{.sources = target::kSourcesId};
  if (is("sources")) ++identity.sources;
  if (is("real")) identity.real_bytes = 2;
  if (is("single")) identity.real_bytes = 4;
  return mps2::exit_of(target::serve<SabotagedLoop>(the_machine, identity));
}
