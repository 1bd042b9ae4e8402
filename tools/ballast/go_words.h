// What `ballast operate go` prints while it is at work, for the live page, which reads it from its planner.
#pragma once

#include <algorithm>
#include <iterator>
#include <string_view>

namespace ballast {

// Before it halts a ball by itself, behind the reason.
inline constexpr std::string_view kHaltsFirst = "halts it first";
// With a course that ends at a rest, before the place that it is planned to. The remaining way is planned while the
// ball rolls there.
inline constexpr std::string_view kOnItsWay = "on its way to";
// Instead of a course, where none is needed.
inline constexpr std::string_view kRestsThere = "rests there already";

// Whether something follows this line, so that it is not yet the answer.
inline bool is_progress(std::string_view line) {
  constexpr std::string_view kWords[] = {
      kHaltsFirst,   kOnItsWay,       "; searches on",    "; looks for what can be done",
      ": waits for", ": plans again", ": takes its place"};
  return !line.starts_with("ballast: ") && std::any_of(std::begin(kWords), std::end(kWords), [&](auto words) {
    return line.find(words) != std::string_view::npos;
  });
}

}  // namespace ballast
