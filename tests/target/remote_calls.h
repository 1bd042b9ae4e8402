// What the conformance suite asks of the board on the other side: u32 call, u32 size, arguments; u32 size, results.
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
