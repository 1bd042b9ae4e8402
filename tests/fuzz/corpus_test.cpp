// corpus_test FOLDER...: gives a fuzz target every file of its corpus, then mutations of them: wild ones of all files,
// and changes of one thing (change_one_thing) in files that are let through. A crash or a broken promise ends it, as it
// would end a fuzzer's run, and leaves the input in `fuzz_finding`. BALLAST_SEED repeats a run's mutations.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "tests/fuzz/fuzz_target.h"
#include "tests/random_seed.h"

namespace ballast::fuzz {
namespace {

constexpr int kMutations = 4000;           // of each kind
constexpr std::size_t kLongest = 1 << 17;  // of a mutation, bytes

// The input that take() is given.
Bytes current;

// Saves the input, whatever ends the program: an abort, a fault of memory or arithmetic, the end of the stack.
void keep_finding(int signal) {
  const int file = open("fuzz_finding", O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (file >= 0 && write(file, current.data(), current.size()) == static_cast<ssize_t>(current.size())) {
    static const char text[] = "the input is in fuzz_finding\n";
    static_cast<void>(!write(STDERR_FILENO, text, sizeof text - 1));
  }
  raise(signal);  // its default now: SA_RESETHAND
}

void keep_findings() {
  static std::array<char, 1 << 16> alternate;  // a stack that has ended cannot carry a handler
  stack_t stack{};
  stack.ss_sp = alternate.data();
  stack.ss_size = alternate.size();
  sigaltstack(&stack, nullptr);
  struct sigaction action {};
  action.sa_handler = keep_finding;
  action.sa_flags = static_cast<int>(SA_ONSTACK | SA_RESETHAND | SA_NODEFER);
  for (const int signal : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTRAP, SIGALRM, SIGTERM, SIGXCPU}) {
    sigaction(signal, &action, nullptr);
  }
}

// As fuzzers do it: bits, bytes, runs of them gone, doubled, moved in from another, and numbers that hurt.
Bytes mutated_wildly(Bytes bytes, const Bytes& other, std::mt19937_64& random) {
  const auto below = [&](std::size_t n) { return fuzz::below(n, random); };
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

std::vector<Bytes> read_corpus(const std::vector<std::string>& folders) {
  std::vector<std::filesystem::path> files;
  for (const std::string& folder : folders) {
    for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());  // a folder has no order of its own
  std::vector<Bytes> corpus;
  for (const std::filesystem::path& file : files) {
    std::ifstream stream(file, std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>());
  }
  return corpus;
}

int run(const std::vector<std::string>& folders) {
  const std::vector<Bytes> corpus = read_corpus(folders);
  std::vector<Bytes> sound;
  for (const Bytes& bytes : corpus) {
    if (give(bytes)) sound.push_back(bytes);
  }
  std::printf("%zu files, %zu let through\n", corpus.size(), sound.size());
  if (sound.empty()) {
    std::fprintf(stderr, "the corpus tests nothing: none of it is let through; was a format changed?\n");
    return 1;
  }
  std::printf("%d mutations of each kind\n", kMutations);
  const std::uint64_t seed = ballast::test::random_seed();
  std::fflush(stdout);
  std::mt19937_64 random(seed);
  const auto any = [&](const std::vector<Bytes>& inputs) -> const Bytes& {
    return inputs[below(inputs.size(), random)];
  };
  int wild = 0, whole = 0;
  for (int i = 0; i < kMutations; ++i) {
    const Bytes& base = any(corpus);
    wild += give(mutated_wildly(base, any(corpus), random)) ? 1 : 0;
    whole += give(change_one_thing(any(sound), random)) ? 1 : 0;
  }
  std::printf("let through: %d of the wild ones, %d of those with one thing changed\n", wild, whole);
  if (2 * whole >= kMutations) return 0;
  std::fprintf(stderr, "fewer than half of the inputs with one thing changed get past the parser\n");
  return 1;
}

}  // namespace
}  // namespace ballast::fuzz

int main(int argc, char** argv) {
  ballast::fuzz::keep_findings();
  return ballast::fuzz::run({argv + 1, argv + argc});
}
