// Clocks, pins, addresses and interrupts of the boards: an ARM MPS2 with the Cortex-M4F image AN386 (ARM DAI 0386) or
// the Cortex-M7 image AN500 (ARM DAI 0500), as QEMU's machines mps2-an386 and mps2-an500. They differ in the processor
// only.
#pragma once

#include <cstdint>

namespace ballast::hal::mps2 {

inline constexpr const char* kName = BALLAST_BOARD;  // the folder's name

// Clocks.
inline constexpr std::uint32_t kClockHz = 25000000;            // of the tick timer, both other timers and the watchdog
inline constexpr std::uint32_t kLongestTickCounts = 1u << 24;  // the tick timer has 24 bits

// Pins of motor i as bits of the one port's output register. The drivers step on both edges.
constexpr std::uint32_t step_pin(std::uint8_t motor) { return 1u << (2 * motor); }
constexpr std::uint32_t direction_pin(std::uint8_t motor) { return 2u << (2 * motor); }  // low: forwards

// Peripherals (Cortex-M System Design Kit, ARM DDI 0479).
inline constexpr std::uintptr_t kTimer0 = 0x40000000;        // step pulses
inline constexpr std::uintptr_t kTimer1 = 0x40001000;        // free-running
inline constexpr std::uintptr_t kWatchdogBase = 0x40008000;  // its first expiry is the NMI
inline constexpr std::uintptr_t kPins = 0x40010004;          // the port of all pins: GPIO 0, DATAOUT
inline constexpr int kTimer0Irq = 8;
inline constexpr int kIrqCount = 32;

// Control periods without a kick after which the watchdog ends the program.
inline constexpr std::uint32_t kWatchdogTicks = 4;

}  // namespace ballast::hal::mps2
