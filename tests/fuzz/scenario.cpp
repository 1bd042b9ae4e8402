// The reader of scenarios. Input: a scenario file.
#include "tests/fuzz/accepted_scenario.h"

namespace ballast::fuzz {

bool take(std::span<const std::uint8_t> input) {
  return check(sim::parse_scenario({reinterpret_cast<const char*>(input.data()), input.size()}, "fuzz.toml"));
}

}  // namespace ballast::fuzz
