// corpus_test FOLDER...: gives a fuzz target every file of its corpus, and mutations of them. A crash or a broken
// promise aborts, as it would end a fuzzer's run.
#include <algorithm>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "tests/fuzz/fuzz_target.h"

namespace ballast::fuzz {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr int kMutations = 4000;
constexpr std::size_t kLongest = 1 << 17;  // of a mutation, bytes

// The input that was being taken, for whoever has to look at it.
Bytes current;

void keep_finding(int) {
  static const char path[] = "fuzz_finding";
  if (std::FILE* file = std::fopen(path, "wb"); file != nullptr) {
    std::fwrite(current.data(), 1, current.size(), file);
    std::fclose(file);
  }
  std::fprintf(stderr, "the input is in %s\n", path);
  std::signal(SIGABRT, SIG_DFL);
  std::abort();
}

// As fuzzers do it: bits, bytes, runs of them gone, doubled, moved in from another, and numbers that hurt.
Bytes mutated(Bytes bytes, const Bytes& other, std::mt19937_64& random) {
  const auto below = [&](std::size_t n) { return n == 0 ? 0 : static_cast<std::size_t>(random() % n); };
  static const std::uint64_t kNumbers[] = {0,
                                           1,
                                           0x7f,
                                           0x80,
                                           0xff,
                                           0x7fff,
                                           0xffff,
                                           0x7fffffff,
                                           0x80000000,
                                           0xffffffff,
                                           0x7fffffffffffffff,
                                           0x8000000000000000,
                                           0x7ff8000000000000 /* NaN */,
                                           0x7ff0000000000000 /* infinity */};
  for (std::size_t edit = 1 + below(4); edit > 0; --edit) {
    const std::size_t at = below(bytes.size() + 1);
    const std::size_t length = std::min(below(32), bytes.size() - at);
    const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(at);
    switch (below(6)) {
      case 0:
        if (at < bytes.size()) bytes[at] ^= static_cast<std::uint8_t>(1 << below(8));
        break;
      case 1:
        if (at < bytes.size()) bytes[at] = static_cast<std::uint8_t>(random());
        break;
      case 2:
        bytes.erase(begin, begin + static_cast<std::ptrdiff_t>(length));
        break;
      case 3: {
        const Bytes run(begin, begin + static_cast<std::ptrdiff_t>(length));
        const std::size_t to = below(bytes.size() + 1);
        bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(to), run.begin(), run.end());
        break;
      }
      case 4: {
        const std::uint64_t number = kNumbers[below(std::size(kNumbers))];
        const std::size_t size = std::min<std::size_t>(std::size_t{1} << below(4), bytes.size() - at);
        const bool big_endian = below(2) == 0;
        for (std::size_t i = 0; i < size; ++i) {
          bytes[at + i] = static_cast<std::uint8_t>(number >> 8 * (big_endian ? size - 1 - i : i));
        }
        break;
      }
      default: {
        const std::size_t from = below(other.size() + 1), count = std::min(below(256), other.size() - from);
        bytes.insert(begin, other.begin() + static_cast<std::ptrdiff_t>(from),
                     other.begin() + static_cast<std::ptrdiff_t>(from + count));
      }
    }
  }
  bytes.resize(std::min(bytes.size(), kLongest));
  return bytes;
}

bool give(Bytes bytes) {
  current = std::move(bytes);
  return take(current);
}

int run(const std::vector<std::string>& folders) {
  std::vector<std::filesystem::path> files;
  for (const std::string& folder : folders) {
    for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());  // the order of a folder is nobody's
  std::vector<Bytes> corpus;
  int through = 0;
  for (const std::filesystem::path& file : files) {
    std::ifstream stream(file, std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>());
    through += give(corpus.back()) ? 1 : 0;
  }
  std::printf("%zu files, %d let through\n", files.size(), through);
  if (through == 0) {
    std::fprintf(stderr, "the corpus tests nothing: none of it is let through; was a format changed?\n");
    return 1;
  }
  const std::uint64_t seed = std::random_device{}();
  std::printf("%d mutations, seed %llu\n", kMutations, static_cast<unsigned long long>(seed));
  std::fflush(stdout);
  std::mt19937_64 random(seed);
  through = 0;
  for (int i = 0; i < kMutations; ++i) {
    const Bytes& base = corpus[random() % corpus.size()];
    through += give(mutated(base, corpus[random() % corpus.size()], random)) ? 1 : 0;
  }
  std::printf("%d of them let through\n", through);
  return 0;
}

}  // namespace
}  // namespace ballast::fuzz

int main(int argc, char** argv) {
  std::signal(SIGABRT, ballast::fuzz::keep_finding);
  return ballast::fuzz::run({argv + 1, argv + argc});
}
