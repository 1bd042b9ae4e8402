// A course on its way to a controller: the numbers of firmware/control/course.h, in parts, and back.
#pragma once

#include <cstdint>
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

// Puts together what observers hear of courses. Parts of one course come in order; a part that does not continue the
// course before it is left out.
class CourseParts {
 public:
  // The course, with its last part.
  std::optional<HostCourse> take(const operator_t& message);

 private:
  std::int64_t number_ = 0;
  std::vector<double> values_;
};

}  // namespace ballast::go
