// Calls of the conformance suite to the board in QEMU: u32 call, u32 size, arguments; answered by u32 size, results.
#pragma once

#include <cstdint>

namespace ballast::hal::test {

enum class Call : std::uint32_t {
  kWaitTick,
  kReadSensors,
  kReadVerdict,
  kReadOperator,
  kWriteSteps,
  kWriteStatus,
  kKickWatchdog,
  kCounters,
  kToDouble,  // i64 n: double(n), double(uint64(n))
};

}  // namespace ballast::hal::test
