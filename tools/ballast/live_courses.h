// The planned paths of the newest courses of a run, for the live page and `ballast operate status`.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <utility>
#include <vector>

#include "hal/lcm/messages.h"
#include "tools/go/course_parts.h"

namespace ballast {

class LiveCourses {
 public:
  using Path = std::vector<std::array<double, 2>>;  // m, of the geometric centre; not empty

  // The next run begins.
  void clear() { *this = LiveCourses(); }
  // Messages of the shown run, as they are given and as the run repeats them for observers.
  void take(const operator_t& message);

  // The path of this course; null: its parts have not been heard.
  [[nodiscard]] const Path* path(std::int64_t number) const;

 private:
  go::CourseParts parts_;
  std::deque<std::pair<std::int64_t, Path>> paths_;  // oldest first
};

}  // namespace ballast
