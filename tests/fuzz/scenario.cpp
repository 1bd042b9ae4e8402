// The reader of scenarios. Input: a scenario file.
#include "tests/fuzz/accepted_scenario.h"
#include "tests/fuzz/change_toml.h"

namespace ballast::fuzz {

Bytes change_one_thing(Bytes input, std::mt19937_64& random) { return change_toml(std::move(input), random); }

bool take(std::span<const std::uint8_t> input) {
  return check(sim::parse_scenario({reinterpret_cast<const char*>(input.data()), input.size()}, "fuzz.toml"));
}

}  // namespace ballast::fuzz
