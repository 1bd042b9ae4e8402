#include "hal/mps2/machine.h"

#include <array>
#include <cmath>

#include "hal/mps2/semihosting.h"
#include "hal/mps2/startup.h"

namespace ballast::hal::mps2 {
namespace {

std::array<char, 512> command_line{};
const char* rest = "";

// Waits with NOPs. QEMU counts every instruction, and its WFI loses interrupts (7.2, with icount and sleep=off). It is
// fastest when the loop is one translation block that jumps back to itself: at most 512 instructions inside an aligned
// KiB.
[[gnu::noinline, gnu::naked, gnu::aligned(1024)]] void idle_while(const volatile std::uint32_t*, std::uint32_t) {
  asm volatile("1: .rept 505\n nop\n .endr\n ldr r3, [r0]\n cmp r3, r1\n beq.w 1b\n bx lr\n");
}

}  // namespace

Machine the_machine;

const char* command_line_rest() { return rest; }

bool Machine::open_link() {
  if (!semihosting::command_line(command_line)) return false;
  const char* at = command_line.data();
  const auto next_word = [&at](std::size_t& length) {
    while (*at == ' ') ++at;
    const char* begin = at;
    while (*at != 0 && *at != ' ') ++at;
    length = static_cast<std::size_t>(at - begin);
    return begin;
  };
  std::size_t length = 0;
  // Semihosting wants names that end in a zero, so each word is copied.
  std::array<char, 256> name{};
  for (const auto& [file, mode] :
       {std::pair{&in_, semihosting::Mode::kRead}, std::pair{&out_, semihosting::Mode::kWrite}}) {
    const char* word = next_word(length);
    if (length == 0 || length >= name.size()) return false;
    for (std::size_t i = 0; i < length; ++i) name[i] = word[i];
    name[length] = 0;
    *file = semihosting::open(name.data(), length, mode);
    if (*file < 0) return false;
  }
  next_word(length);
  rest = at - length;
  return true;
}

Status Machine::read(std::span<std::uint8_t> bytes, std::size_t& count) {
  count = semihosting::read(in_, bytes);
  return count == 0 ? Status::kPeerLost : Status::kOk;
}

Status Machine::write(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const std::size_t count = semihosting::write(out_, bytes);
    if (count == 0) return Status::kPeerLost;
    bytes = bytes.subspan(count);
  }
  return Status::kOk;
}

bool Machine::start(const firmware::ControllerParams& params, const target::Commit& commit) {
  const double counts = static_cast<double>(params.control_period_s) * commit.stretch * kClockHz;
  if (!(counts >= 2 && counts <= kLongestTickCounts)) return false;
  const double counts_per_step_tick = commit.stretch * (kClockHz / static_cast<double>(params.timer_frequency_hz));
  if (!(counts_per_step_tick >= 1.0 / 32 && counts_per_step_tick < 4096)) return false;
  play_ = commit.play;
  player_.configure(counts_per_step_tick);

  reg(kTimer0 + 8) = 0xffffffff;  // reload
  StepPins::cancel();
  reg(kTimer0) = 9;  // enable, interrupt
  const auto period = static_cast<std::uint32_t>(std::lround(counts));
  reg(kWatchdogBase) = kWatchdogTicks * period;
  reg(kWatchdogBase + 8) = 1;  // the first expiry interrupts
  reg(kNvicEnable) = 1u << kTimer0Irq;
  reg(kSysTickReload) = StepPins::reload = period - 1;
  reg(kSysTickValue) = 0;
  reg(kSysTickControl) = 7;  // enable, interrupt, processor clock
  return true;
}

std::uint32_t Machine::wait_tick() {
  if (ticks_begun_ == ticks_served_) idle_while(&ticks_begun_, ticks_served_);
  const std::uint32_t begun = ticks_begun_;
  const std::uint32_t since = begun - ticks_served_;
  ticks_served_ = begun;
  return since;
}

void Machine::report(target::EndReport& end_report) const {
  end_report.stack_bytes = stack_bytes();
  end_report.stack_used_bytes = stack_used_bytes();
}

}  // namespace ballast::hal::mps2
