// The entry points that libFuzzer calls.
#include <algorithm>

#include "tests/fuzz/fuzz_target.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ballast::fuzz::take({data, size});
  return 0;
}

// Two in three keep the input's form; the rest are libFuzzer's own.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned int seed) {
  std::mt19937_64 random(seed);
  if (random() % 3 == 0) return LLVMFuzzerMutate(data, size, max_size);
  const ballast::fuzz::Bytes changed = ballast::fuzz::change_one_thing({data, data + size}, random);
  const std::size_t length = std::min(changed.size(), max_size);
  std::copy_n(changed.begin(), length, data);
  return length;
}
