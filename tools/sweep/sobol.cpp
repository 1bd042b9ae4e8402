#include "tools/sweep/sobol.h"

#include <bit>

namespace ballast::sweep {
namespace {

constexpr int kIndexBits = 53;  // of an index; more than kMostRuns needs
constexpr int kBits = 64;       // of a number
constexpr int kMostDegree = 9;

// A primitive polynomial over GF(2), its coefficients as bits, and the first direction numbers m_1, m_2, ...
struct Direction {
  std::uint32_t polynomial;
  std::array<std::uint32_t, kMostDegree> first;
};

// Dimensions from the second on: lines d = 2 to 64 of the file new-joe-kuo-6.21201 by Stephen Joe and Frances Y. Kuo,
// with the leading and the last coefficient of the polynomial written out.
constexpr std::array<Direction, kSobolDimensions - 1> kJoeKuo{{
    // clang-format off
    {3, {1}}, {7, {1, 3}}, {11, {1, 3, 1}}, {13, {1, 1, 1}}, {19, {1, 1, 3, 3}}, {25, {1, 3, 5, 13}},
    {37, {1, 1, 5, 5, 17}}, {41, {1, 1, 5, 5, 5}}, {47, {1, 1, 7, 11, 19}}, {55, {1, 1, 5, 1, 1}},
    {59, {1, 1, 1, 3, 11}}, {61, {1, 3, 5, 5, 31}}, {67, {1, 3, 3, 9, 7, 49}}, {91, {1, 1, 1, 15, 21, 21}},
    {97, {1, 3, 1, 13, 27, 49}}, {103, {1, 1, 1, 15, 7, 5}}, {109, {1, 3, 1, 15, 13, 25}},
    {115, {1, 1, 5, 5, 19, 61}}, {131, {1, 3, 7, 11, 23, 15, 103}}, {137, {1, 3, 7, 13, 13, 15, 69}},
    {143, {1, 1, 3, 13, 7, 35, 63}}, {145, {1, 3, 5, 9, 1, 25, 53}}, {157, {1, 3, 1, 13, 9, 35, 107}},
    {167, {1, 3, 1, 5, 27, 61, 31}}, {171, {1, 1, 5, 11, 19, 41, 61}}, {185, {1, 3, 5, 3, 3, 13, 69}},
    {191, {1, 1, 7, 13, 1, 19, 1}}, {193, {1, 3, 7, 5, 13, 19, 59}}, {203, {1, 1, 3, 9, 25, 29, 41}},
    {211, {1, 3, 5, 13, 23, 1, 55}}, {213, {1, 3, 7, 3, 13, 59, 17}}, {229, {1, 3, 1, 3, 5, 53, 69}},
    {239, {1, 1, 5, 5, 23, 33, 13}}, {241, {1, 1, 7, 7, 1, 61, 123}}, {247, {1, 1, 7, 9, 13, 61, 49}},
    {253, {1, 3, 3, 5, 3, 55, 33}}, {285, {1, 3, 1, 15, 31, 13, 49, 245}}, {299, {1, 3, 5, 15, 31, 59, 63, 97}},
    {301, {1, 3, 1, 11, 11, 11, 77, 249}}, {333, {1, 3, 1, 11, 27, 43, 71, 9}}, {351, {1, 1, 7, 15, 21, 11, 81, 45}},
    {355, {1, 3, 7, 3, 25, 31, 65, 79}}, {357, {1, 3, 1, 1, 19, 11, 3, 205}}, {361, {1, 1, 5, 9, 19, 21, 29, 157}},
    {369, {1, 3, 7, 11, 1, 33, 89, 185}}, {391, {1, 3, 3, 3, 15, 9, 79, 71}}, {397, {1, 3, 7, 11, 15, 39, 119, 27}},
    {425, {1, 1, 3, 1, 11, 31, 97, 225}}, {451, {1, 1, 1, 3, 23, 43, 57, 177}}, {463, {1, 3, 7, 7, 17, 17, 37, 71}},
    {487, {1, 3, 1, 5, 27, 63, 123, 213}}, {501, {1, 1, 3, 5, 11, 43, 53, 133}},
    {529, {1, 3, 5, 5, 29, 17, 47, 173, 479}}, {539, {1, 3, 3, 11, 3, 1, 109, 9, 69}},
    {545, {1, 1, 1, 5, 17, 39, 23, 5, 343}}, {557, {1, 3, 1, 5, 25, 15, 31, 103, 499}},
    {563, {1, 1, 1, 11, 11, 17, 63, 105, 183}}, {601, {1, 1, 5, 11, 9, 29, 97, 231, 363}},
    {607, {1, 1, 5, 15, 19, 45, 41, 7, 383}}, {617, {1, 3, 7, 7, 31, 19, 83, 137, 221}},
    {623, {1, 1, 1, 3, 23, 15, 111, 223, 83}}, {631, {1, 1, 5, 13, 31, 15, 55, 25, 161}},
    {637, {1, 1, 3, 13, 25, 47, 39, 87, 257}}
    // clang-format on
}};

using Directions = std::array<std::array<std::uint64_t, kIndexBits>, kSobolDimensions>;

// The recurrence for v_k = m_k 2^(64 - k): equations (2) and (3) of the source.
Directions make_directions() {
  Directions v{};
  for (int k = 0; k < kIndexBits; ++k) v[0][k] = std::uint64_t{1} << (kBits - 1 - k);
  for (std::size_t d = 1; d < kSobolDimensions; ++d) {
    const Direction& of = kJoeKuo[d - 1];
    const int degree = static_cast<int>(std::bit_width(of.polynomial)) - 1;
    for (int k = 0; k < kIndexBits; ++k) {
      if (k < degree) {
        v[d][k] = std::uint64_t{of.first[k]} << (kBits - 1 - k);
        continue;
      }
      v[d][k] = v[d][k - degree] ^ (v[d][k - degree] >> degree);
      for (int j = 1; j < degree; ++j) {
        if ((of.polynomial >> (degree - j) & 1) != 0) v[d][k] ^= v[d][k - j];
      }
    }
  }
  return v;
}

}  // namespace

std::uint64_t sobol_bits(std::size_t dimension, std::uint64_t index) {
  static const Directions kDirections = make_directions();
  std::uint64_t bits = 0;
  for (std::uint64_t gray = index ^ (index >> 1); gray != 0; gray &= gray - 1)
    bits ^= kDirections[dimension][std::countr_zero(gray)];
  return bits;
}

}  // namespace ballast::sweep
