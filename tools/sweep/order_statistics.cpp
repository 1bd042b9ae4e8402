#include "tools/sweep/order_statistics.h"

#include <bit>
#include <cmath>

namespace ballast::sweep {
namespace {

constexpr std::uint64_t kSign = std::uint64_t{1} << 63;
constexpr int kDigitBits = 16, kDigits = 4;

// Bits in the order of the numbers.
std::uint64_t ordered_bits(double number) {
  const auto bits = std::bit_cast<std::uint64_t>(number);
  return (bits & kSign) != 0 ? ~bits : bits | kSign;
}

double number_of(std::uint64_t ordered) {
  return std::bit_cast<double>((ordered & kSign) != 0 ? ordered & ~kSign : ~ordered);
}

// A rank whose value is known up to some leading digits.
struct Search {
  std::uint64_t prefix = 0;
  std::uint64_t rank = 0;  // among the numbers with that prefix
  std::vector<std::uint64_t> counts;
};

}  // namespace

std::vector<double> values_at_ranks(const ForEachNumber& for_each, const std::vector<std::uint64_t>& ranks) {
  std::vector<Search> searches;
  for (const std::uint64_t rank : ranks) searches.push_back({0, rank, {}});
  for (int digit = kDigits - 1; digit >= 0; --digit) {
    const int shift = digit * kDigitBits;
    for (Search& search : searches) search.counts.assign(std::size_t{1} << kDigitBits, 0);
    for_each([&](double number) {
      if (std::isnan(number)) return;
      const std::uint64_t bits = ordered_bits(number);
      for (Search& search : searches) {
        const bool matches = digit == kDigits - 1 || bits >> (shift + kDigitBits) == search.prefix;
        if (matches) ++search.counts[(bits >> shift) & ((1u << kDigitBits) - 1)];
      }
    });
    for (Search& search : searches) {
      std::uint64_t place = 0;
      while (place + 1 < search.counts.size() && search.rank >= search.counts[place])
        search.rank -= search.counts[place++];
      search.prefix = search.prefix << kDigitBits | place;
    }
  }
  std::vector<double> values;
  for (const Search& search : searches) values.push_back(number_of(search.prefix));
  return values;
}

}  // namespace ballast::sweep
