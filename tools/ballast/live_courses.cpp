#include "tools/ballast/live_courses.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace ballast {

namespace {

// More than an operator hands over in vain while one course is followed.
constexpr std::size_t kMostPaths = 32;
constexpr std::size_t kPlaceInRow = 7;  // after attitude (4) and Omega (3)

LiveCourses::Path path_of(const go::HostCourse& course) {
  LiveCourses::Path path;
  const auto row = static_cast<std::size_t>(firmware::reference_row(static_cast<int>(course.mass.size())));
  const auto& values = course.reference.values;
  for (std::size_t k = 0; k < static_cast<std::size_t>(course.reference.samples); ++k) {
    const std::size_t at = k * row + kPlaceInRow;
    if (!std::isfinite(values[at]) || !std::isfinite(values[at + 1])) return {};
    path.push_back({values[at], values[at + 1]});
  }
  return path;
}

}  // namespace

void LiveCourses::take(const operator_t& message) {
  if (message.command != operator_t::COMMAND_GO || message.course_total > firmware::kMostCourseValues) return;
  const auto course = parts_.take(message);
  if (!course || path(course->number) != nullptr) return;
  Path path = path_of(*course);
  if (path.empty()) return;
  paths_.emplace_back(course->number, std::move(path));
  if (paths_.size() > kMostPaths) paths_.pop_front();
}

const LiveCourses::Path* LiveCourses::path(std::int64_t number) const {
  const auto found = std::find_if(paths_.begin(), paths_.end(), [&](const auto& one) { return one.first == number; });
  return found != paths_.end() ? &found->second : nullptr;
}

}  // namespace ballast
