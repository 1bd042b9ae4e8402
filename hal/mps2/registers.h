// Memory-mapped registers.
#pragma once

#include <cstdint>

namespace ballast::hal::mps2 {

inline volatile std::uint32_t& reg(std::uintptr_t address) {
  return *reinterpret_cast<volatile std::uint32_t*>(address);  // NOLINT: a register is an address
}

// The processor's own registers (ARMv7-M, B3).
inline constexpr std::uintptr_t kSysTickControl = 0xe000e010;
inline constexpr std::uintptr_t kSysTickReload = 0xe000e014;
inline constexpr std::uintptr_t kSysTickValue = 0xe000e018;
inline constexpr std::uintptr_t kNvicEnable = 0xe000e100;
inline constexpr std::uintptr_t kNvicClearPending = 0xe000e280;
inline constexpr std::uintptr_t kNvicPriority = 0xe000e400;     // one byte per interrupt
inline constexpr std::uintptr_t kSystemPriority3 = 0xe000ed20;  // top byte: SysTick
inline constexpr std::uintptr_t kCfsr = 0xe000ed28;
inline constexpr std::uintptr_t kHfsr = 0xe000ed2c;
inline constexpr std::uintptr_t kMmfar = 0xe000ed34;
inline constexpr std::uintptr_t kBfar = 0xe000ed38;
inline constexpr std::uintptr_t kCcr = 0xe000ed14;
inline constexpr std::uintptr_t kMpuControl = 0xe000ed94;
inline constexpr std::uintptr_t kMpuRegion = 0xe000ed98;
inline constexpr std::uintptr_t kMpuBase = 0xe000ed9c;
inline constexpr std::uintptr_t kMpuAttributes = 0xe000eda0;

}  // namespace ballast::hal::mps2
