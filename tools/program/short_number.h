// Numbers as people read them.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <string>

namespace ballast::program {

// Three significant digits. A value below 1e-9, which is rounding in the quantities of a run, is "0", without a sign.
inline std::string short_number(double value) { return std::abs(value) < 1e-9 ? "0" : fmt::format("{:.3g}", value); }

// A fixed number of decimals. A value that rounds to zero has no sign.
inline std::string fixed_number(double value, int decimals) {
  const double scale = std::pow(10, decimals);
  return fmt::format("{:.{}f}", std::round(scale * value) / scale + 0.0, decimals);
}

}  // namespace ballast::program
