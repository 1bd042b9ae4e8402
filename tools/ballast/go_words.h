// The words of `ballast operate go` by which the live page follows its planner.
#pragma once

#include <algorithm>
#include <iterator>
#include <string_view>

#include "tools/go/go_plan.h"

namespace ballast {

// Go halts a ball by itself; the reason stands before it.
inline constexpr std::string_view kHaltsFirst = "halts it first";
// A course ends at a rest; the place that it is planned to stands behind it. The remaining way is planned while the
// ball rolls there.
inline constexpr std::string_view kOnItsWay = "on its way to";
// No course is needed.
inline constexpr std::string_view kRestsThere = "rests there already";
// Go waits for another operator, or for the end of a stop or a halt.
inline constexpr std::string_view kWaitsFor = "waits for ";
inline constexpr std::string_view kPlansAgain = "plans again";
inline constexpr std::string_view kTakesItsPlace = "takes its place";
// In front of each line of a refusal or an error.
inline constexpr std::string_view kErrorPrefix = "ballast: ";

// Whether this line is no answer yet: go says more.
inline bool is_progress(std::string_view line) {
  constexpr std::string_view kWords[] = {kHaltsFirst,    kOnItsWay,       kWaitsFor,        kPlansAgain,
                                         kTakesItsPlace, go::kSearchesOn, go::kLooksForMore};
  return !line.starts_with(kErrorPrefix) && std::any_of(std::begin(kWords), std::end(kWords), [&](auto words) {
    return line.find(words) != std::string_view::npos;
  });
}

}  // namespace ballast
