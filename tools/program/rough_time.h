// A long time as a person plans by it.
#pragma once

#include <fmt/format.h>

#include <string>

namespace ballast::program {

// "45 s", "12 min", "83 h", "40 days".
inline std::string rough_time(double time_s) {
  constexpr double kMinute_s = 60, kHour_s = 3600, kDay_s = 86400;
  if (time_s < 2 * kMinute_s) return fmt::format("{:.0f} s", time_s);
  if (time_s < 2 * kHour_s) return fmt::format("{:.0f} min", time_s / kMinute_s);
  if (time_s < 5 * kDay_s) return fmt::format("{:.0f} h", time_s / kHour_s);
  return fmt::format("{:.0f} days", time_s / kDay_s);
}

}  // namespace ballast::program
