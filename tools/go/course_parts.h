// A course on its way to a controller: the numbers of firmware/control/course.h, in parts, and back.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "firmware/control/course.h"
#include "hal/lcm/messages.h"
#include "sim/scenario/scenario.h"

namespace ballast::go {

// A course as a host knows it.
struct HostCourse {
  std::int64_t number = 0;
  std::int64_t from_tick = 0;  // 0: as soon as it is certified
  struct Mass {
    double position = 0, velocity = 0;  // at its beginning, rail unit (rad or m), per s
    std::vector<sim::MotionPiece> motion;
  };
  std::vector<Mass> mass;
  firmware::ReferenceTable reference;
};

// The motion of `moved`, which is set down where the course begins.
[[nodiscard]] HostCourse make_course(std::int64_t number, std::int64_t from_tick, const sim::Scenario& moved,
                                     const firmware::ReferenceTable& reference);

[[nodiscard]] std::vector<firmware::CoursePart> parts_of(const HostCourse& course);

// Puts together what observers hear of courses. Parts may come in any order, repeatedly, and of several courses.
class CourseParts {
 public:
  // The course, once all of its parts are there; only once for each course.
  std::optional<HostCourse> take(const operator_t& message);

 private:
  struct Course {
    std::int64_t number = 0;
    std::int32_t total = 0;
    bool complete = false;
    std::map<std::int32_t, std::vector<double>> values;  // by the place of the first
  };
  static constexpr std::size_t kMostCourses = 8;

  std::deque<Course> courses_;  // the newest last
};

}  // namespace ballast::go
