// Courses as their numbers, and a robot that can follow them.
#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "firmware/control/course.h"
#include "tests/firmware/paper_ball.h"

namespace ballast::firmware::testing {

inline constexpr int kCourseMasses = 3;

// A robot that hangs at rest below its centre, armed.
inline ControllerParams hanging_params() {
  ControllerParams params = paper_params();
  params.governor.on = true;
  params.governor.friction = 0.5;
  params.ball.center_of_mass_B_m = Vector3(0, 0, Real(-0.05));
  for (std::size_t i = 0; i < kCourseMasses; ++i) {
    params.motor[i].max_step_rate_hz = 1.1 * 0.15 * params.motor[i].steps_per_unit;
    params.motor[i].max_acceleration = 1.02;
    params.motor[i].max_jerk = 10;
    params.ball.rail[i] =
        circle(Vector3(0, 0, 0), Real(0.5), Vector3(0, 0, -1), Vector3(i == 2 ? 0 : 1, i == 2 ? 1 : 0, 0));
    EXPECT_TRUE(params.motion[i].set(0, 0, nullptr, 0));
  }
  return params;
}

// A course whose reference is the ball upright at the origin, without feedback.
struct CourseNumbers {
  std::int64_t number = 5;
  std::int64_t from_tick = 0;
  Wide period_s = 1, holds = 1;
  int rows = 2;
  struct Mass {
    Wide position = 0, velocity = 0;
    std::vector<ProfilePiece> pieces;
  };
  std::vector<Mass> mass;

  [[nodiscard]] std::vector<Wide> values() const {
    std::vector<Wide> out{static_cast<Wide>(from_tick), static_cast<Wide>(mass.size()), static_cast<Wide>(rows),
                          period_s, holds};
    for (const Mass& m : mass) out.insert(out.end(), {static_cast<Wide>(m.pieces.size()), m.position, m.velocity});
    for (const Mass& m : mass) {
      for (const ProfilePiece& p : m.pieces) {
        out.insert(out.end(), {p.duration_s, p.acceleration_start, p.acceleration_end});
      }
    }
    for (int k = 0; k < rows; ++k) {
      out.push_back(1);
      out.insert(out.end(), static_cast<std::size_t>(reference_row(kCourseMasses) - 1), 0);
    }
    return out;
  }
};

inline std::vector<CoursePart> parts_of(std::int64_t number, const std::vector<Wide>& values) {
  std::vector<CoursePart> parts;
  for (std::size_t first = 0; first < values.size(); first += kCoursePart) {
    CoursePart part;
    part.course = number;
    part.first = static_cast<std::int32_t>(first);
    part.total = static_cast<std::int32_t>(values.size());
    for (std::size_t k = first; k < values.size() && k < first + kCoursePart; ++k) {
      part.value[static_cast<std::size_t>(part.count++)] = values[k];
    }
    parts.push_back(part);
  }
  return parts;
}

// A mass goes by 0.005 rad within 0.8 s, forth or back.
inline std::vector<ProfilePiece> push(Wide sign) {
  const Wide a = 0.0625 * sign;
  return {{0.2, 0, a}, {0.2, a, 0}, {0.2, 0, -a}, {0.2, -a, 0}};
}

inline CourseNumbers course_forth() {
  CourseNumbers course;
  course.mass.resize(kCourseMasses);
  course.mass[0].pieces = push(1);
  return course;
}

}  // namespace ballast::firmware::testing
