#include "tools/program/processors.h"

#include <sched.h>

#include <optional>

namespace ballast::program {

namespace {

std::optional<cpu_set_t> usable() {
  cpu_set_t usable;
  if (sched_getaffinity(0, sizeof usable, &usable) != 0) return std::nullopt;
  return usable;
}

const std::optional<cpu_set_t> kUsableAtStart = usable();

}  // namespace

void use_all_processors() {
  if (kUsableAtStart) sched_setaffinity(0, sizeof *kUsableAtStart, &*kUsableAtStart);
}

}  // namespace ballast::program
