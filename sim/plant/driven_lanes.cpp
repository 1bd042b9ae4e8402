#include "sim/plant/driven_lanes.h"

#include <cmath>
#include <cstdint>
#include <cstring>

#include "firmware/model/sin_cos.h"

// Functions with vector arguments are all inlined, so no calling convention matters.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace ballast::sim {

namespace {

namespace portable {
#include "sim/plant/driven_lanes.inc"
}  // namespace portable

#ifdef __x86_64__
// AVX2 without FMA does the same operations in the same order, so the bits are the same.
#pragma GCC push_options
#pragma GCC target("avx2")
namespace avx2 {
#include "sim/plant/driven_lanes.inc"
}  // namespace avx2
#pragma GCC pop_options
#endif

}  // namespace

const DrivenLanes& driven_lanes() {
#ifdef __x86_64__
  static constexpr DrivenLanes kAvx2{avx2::evaluate, avx2::derivative, avx2::energies};
  static const bool has_avx2 = __builtin_cpu_supports("avx2");
  if (has_avx2) return kAvx2;
#endif
  return portable_driven_lanes();
}

const DrivenLanes& portable_driven_lanes() {
  static constexpr DrivenLanes kPortable{portable::evaluate, portable::derivative, portable::energies};
  return kPortable;
}

}  // namespace ballast::sim
