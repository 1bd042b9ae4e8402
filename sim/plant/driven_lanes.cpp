#include "sim/plant/driven_lanes.h"

#include <cmath>
#include <cstdint>
#include <cstring>

#include "firmware/model/sin_cos.h"

namespace ballast::sim {

namespace {

#define BALLAST_LANES "sim/plant/driven_lanes.inc"
#include "sim/plant/each_instruction_set.inc"

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
