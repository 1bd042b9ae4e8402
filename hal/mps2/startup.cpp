#include "hal/mps2/startup.h"

#include "hal/mps2/machine.h"
#include "hal/mps2/semihosting.h"

using namespace ballast::hal;
using namespace ballast::hal::mps2;

// Symbols of the linker script.
extern "C" {
extern std::uint32_t ballast_guard_begin[], ballast_stack_begin[], ballast_stack_end[];
extern std::uint32_t ballast_data_begin[], ballast_data_end[], ballast_data_load[];
extern std::uint32_t ballast_bss_begin[], ballast_bss_end[];
extern void (*ballast_init_begin[])();
extern void (*ballast_init_end[])();
int main();
void ballast_start();
[[noreturn]] void ballast_fault_report(const std::uint32_t* registers, const std::uint32_t* frame, std::uint32_t cause,
                                       std::uint32_t exc_return);
}

namespace {

constexpr std::uint32_t kPaint = 0xa5a5a5a5;
constexpr std::uint32_t kGuardLog2 = 11;  // 2 KiB, as in the linker script

// Fault handlers have a stack of their own, because the main stack may have overflowed.
alignas(8) std::uint32_t fault_stack[512];

void guard_stack() {
  reg(kMpuRegion) = 0;
  reg(kMpuBase) = reinterpret_cast<std::uint32_t>(ballast_guard_begin);
  reg(kMpuAttributes) = 1u << 28 | (kGuardLog2 - 1) << 1 | 1;  // execute never, no access, enabled
  // Memory outside the guard is as without MPU. NMI and HardFault run without MPU: their frame may lie in the guard.
  reg(kMpuControl) = 1u << 2 | 1;
  asm volatile("dsb\n isb" ::: "memory");
}

}  // namespace

std::uint32_t mps2::stack_bytes() { return static_cast<std::uint32_t>(ballast_stack_end - ballast_stack_begin) * 4; }

std::uint32_t mps2::stack_used_bytes() {
  const std::uint32_t* untouched = ballast_stack_begin;
  while (untouched != ballast_stack_end && *untouched == kPaint) ++untouched;
  return static_cast<std::uint32_t>(ballast_stack_end - untouched) * 4;
}

extern "C" {

#if (__ARM_FP & 8) != 0
// Conversions of 64-bit integers to double, as ARM's run-time ABI names them (IHI 0043, 4.1.2). libgcc's versions do
// not use the FPU and take five times as many instructions. Only the sum is rounded.
[[gnu::pcs("aapcs")]] double __aeabi_l2d(std::int64_t value) {
  return static_cast<double>(static_cast<std::int32_t>(value >> 32)) * 0x1p32 +
         static_cast<double>(static_cast<std::uint32_t>(value));
}
[[gnu::pcs("aapcs")]] double __aeabi_ul2d(std::uint64_t value) {
  return static_cast<double>(static_cast<std::uint32_t>(value >> 32)) * 0x1p32 +
         static_cast<double>(static_cast<std::uint32_t>(value));
}
#endif

// Turns the FPU on, which must come before any C++, and paints the stack.
[[gnu::naked, noreturn]] void ballast_reset() {
  asm volatile(
      "ldr r0, =0xe000ed88\n"
      "ldr r1, [r0]\n"
      "orr r1, r1, #0xf00000\n"
      "str r1, [r0]\n"
      "dsb\n isb\n"
      "ldr r0, =ballast_stack_begin\n"
      "ldr r1, =ballast_stack_end\n"
      "ldr r2, =0xa5a5a5a5\n"
      "1: cmp r0, r1\n"
      "it lo\n"
      "strlo r2, [r0], #4\n"
      "blo 1b\n"
      "b ballast_start\n");
}

void ballast_start() {
  const std::uint32_t* from = ballast_data_load;
  for (std::uint32_t* to = ballast_data_begin; to != ballast_data_end; ++to) *to = *from++;
  for (std::uint32_t* to = ballast_bss_begin; to != ballast_bss_end; ++to) *to = 0;
  guard_stack();
  reg(kCcr) = reg(kCcr) | 1u << 4;  // a division by zero is a fault
  // Tick and step interrupt have the same priority, so neither interrupts the other.
  reg(kSystemPriority3) = 0x40u << 24;
  reg(kNvicPriority + kTimer0Irq) = 0x40;
  reg(kTimer1 + 8) = 0xffffffff;  // free-running, counts down
  reg(kTimer1 + 4) = 0xffffffff;
  reg(kTimer1) = 1;
  for (auto init = ballast_init_begin; init != ballast_init_end; ++init) (*init)();
  semihosting::exit(static_cast<std::uint32_t>(main()));
}

void ballast_sys_tick() { the_machine.on_tick(); }
void ballast_timer0() { the_machine.on_step_timer(); }

// Saves r4..r11 on the fault stack and calls C++. The processor pushed its frame at msp; psp is not used.
#define BALLAST_FAULT_ENTRY(cause)                         \
  asm volatile(                                            \
      "mrs r1, msp\n"                                      \
      "ldr r0, =%c0\n"                                     \
      "mov sp, r0\n"                                       \
      "push {r4-r11}\n"                                    \
      "mov r0, sp\n"                                       \
      "mov r2, %1\n"                                       \
      "mov r3, lr\n"                                       \
      "b ballast_fault_report\n" ::"i"(fault_stack + 512), \
      "i"(cause))

[[gnu::naked, noreturn]] void ballast_fault() { BALLAST_FAULT_ENTRY(0); }
[[gnu::naked, noreturn]] void ballast_nmi() { BALLAST_FAULT_ENTRY(2); }

void ballast_fault_report(const std::uint32_t* registers, const std::uint32_t* frame, std::uint32_t cause,
                          std::uint32_t exc_return) {
  reg(kTimer0) = 0;  // no more pulses
  target::FaultReport report;
  report.cause = static_cast<target::Cause>(cause);
  report.cfsr = reg(kCfsr);
  report.hfsr = reg(kHfsr);
  report.mmfar = reg(kMmfar);
  report.bfar = reg(kBfar);
  // These bits say that the frame could not be pushed, so its content is unknown.
  constexpr std::uint32_t kStackingErrors = 1u << 4 | 1u << 5 | 1u << 12 | 1u << 13;
  const bool in_guard = frame < ballast_stack_begin && frame >= ballast_guard_begin;
  const auto guard = reinterpret_cast<std::uint32_t>(ballast_guard_begin);
  const bool guard_hit = (report.cfsr & 1u << 7) != 0 && report.mmfar >= guard &&
                         report.mmfar < reinterpret_cast<std::uint32_t>(ballast_stack_begin);
  if (cause == 0 && (in_guard || guard_hit || (report.cfsr & kStackingErrors) != 0)) {
    report.cause = target::Cause::kStackOverflow;
  }
  // ARMv7-M, B1.5.7: the frame holds the FPU's registers (s0..s15, FPSCR, one reserved) if EXC_RETURN's bit 4 is clear,
  // and a padding word if bit 9 of the pushed xPSR is set.
  const std::uint32_t pushed = (exc_return & 1u << 4) == 0 ? 26 : 8;
  report.sp = reinterpret_cast<std::uint32_t>(frame + pushed);
  if ((report.cfsr & kStackingErrors) == 0) {
    report.sp += (frame[7] >> 9 & 1) * 4;
    for (std::size_t i = 0; i < 4; ++i) report.r[i] = frame[i];
    report.r[12] = frame[4];
    report.lr = frame[5];
    report.pc = frame[6];
    report.xpsr = frame[7];
  }
  for (std::size_t i = 0; i < 8; ++i) report.r[4 + i] = registers[i];
  static std::uint8_t bytes[256];
  const std::size_t size = target::encode(report, 0, bytes);
  static_cast<void>(the_machine.write(std::span<const std::uint8_t>(bytes).first(size)));
  semihosting::exit(static_cast<std::uint32_t>(cause == 2 ? Exit::kWatchdog : Exit::kFault));
}

using Vector = void (*)();
struct Vectors {
  const std::uint32_t* stack;
  Vector system[15];
  Vector irq[kIrqCount];
};

extern const Vectors ballast_vectors;
[[gnu::section(".vectors")]] constinit const Vectors ballast_vectors = [] {
  Vectors v{ballast_stack_end, {}, {}};
  for (Vector& vector : v.system) vector = ballast_fault;
  for (Vector& vector : v.irq) vector = ballast_fault;
  v.system[0] = ballast_reset;
  v.system[1] = ballast_nmi;
  v.system[14] = ballast_sys_tick;
  v.irq[kTimer0Irq] = ballast_timer0;
  return v;
}();
}
