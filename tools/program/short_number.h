// Numbers as people read them. Files for programs keep all digits.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <string>
#include <utility>

namespace ballast::program {

// A value below this is rounding in the quantities of a run.
inline constexpr double kNegligible = 1e-9;

// `digits` significant digits, without trailing zeros, and without an exponent up to 1e6. A negligible value is "0",
// without a sign.
inline std::string significant(double value, int digits, double negligible = kNegligible) {
  if (std::abs(value) < negligible) return "0";
  std::string text = fmt::format("{:.{}g}", value, digits);
  const bool plain = !std::isfinite(value) || std::abs(value) < 1 || std::abs(value) >= 1e6;
  return plain || text.find('e') == std::string::npos ? text : fmt::format("{:.0f}", std::stod(text));
}

// A quantity.
inline std::string short_number(double value, double negligible = kNegligible) {
  return significant(value, 3, negligible);
}

// A time in s since the start of a run: one digit more, because the place in a plot is looked for.
inline std::string short_time(double time_s) { return significant(time_s, 4); }

// Two different numbers with as many digits as tell them apart, three at least.
inline std::pair<std::string, std::string> apart(double a, double b) {
  constexpr int kAll = 17;
  for (int digits = 3; digits < kAll; ++digits) {
    auto texts = std::pair(significant(a, digits), significant(b, digits));
    if (texts.first != texts.second || a == b) return texts;
  }
  return {significant(a, kAll, 0), significant(b, kAll, 0)};
}

// A fixed number of decimals. A value that rounds to zero has no sign.
inline std::string fixed_number(double value, int decimals) {
  std::string text = fmt::format("{:.{}f}", value, decimals);
  const bool zero = text.find_first_not_of("-0.") == std::string::npos;
  return zero && text.front() == '-' ? text.substr(1) : text;
}

}  // namespace ballast::program
