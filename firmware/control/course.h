// A course: a motion with its reference that an operator hands over during a run. Types only.
//
// It travels as numbers in this order (n masses; rail units: rad or m):
//   at which tick's start it begins (0: as soon as it is certified, for a ball at rest under masses that hold), n,
//   rows of the reference, their period in s, and 1 if its last row holds for ever or 0;
//   for each mass: number of pieces, initial position, initial velocity;
//   for each mass, for each piece: duration in s, acceleration at its start, at its end (ProfilePiece);
//   the values of the reference (ReferenceTable), row by row.
#pragma once

#include "firmware/motion/profile.h"
#include "firmware/tracking/reference.h"

namespace ballast::firmware {

inline constexpr int kCourseHead = 5, kCourseMassHead = 3, kCoursePieceValues = 3;
inline constexpr int kMostCourseValues =
    kCourseHead + kMaxMasses * (kCourseMassHead + kCoursePieceValues * kMaxPieces) + kMostReferenceFloats;

// Parts come in order. The first one drops a course that is on its way.
inline constexpr int kCoursePart = 96;
struct CoursePart {
  std::int64_t course = 0;  // its number, drawn by the operator, not 0
  std::int32_t first = 0;   // place of the part's first value in the course
  std::int32_t total = 0;   // values of the whole course
  std::int32_t count = 0;   // values of this part, at most kCoursePart
  std::array<Wide, kCoursePart> value{};
};

struct Course {
  PerMass<Profile> motion{};
  ReferenceTable reference;
};

// How far a course that was handed over has come.
enum class CourseStage : std::uint8_t {
  kNone,
  kArriving,   // parts are missing
  kChecking,   // against the motors' limits and the rails, a mass per tick
  kSearching,  // for a certificate, while the masses hold
  kAwaited,    // while they move: its tick
};

// Place in a course that arrives.
struct CourseReader {
  int taken = 0;  // values
  std::array<Wide, kCourseHead> head{};
  PerMass<int> pieces{};
  PerMass<Wide> position{}, velocity{};
  int mass = 0;                                  // whose pieces arrive
  int values = 0;                                // of them
  std::array<ProfilePiece, kMaxPieces> piece{};  // of that mass
  int reference = 0;                             // values of it
};

// Two courses: one is followed while the next arrives.
struct CourseState {
  std::array<Course, 2> slot;
  int in_force = -1;      // slot that the masses follow; -1: the parameters' motion
  std::size_t place = 0;  // slot of the course that comes
  std::int64_t number_in_force = 0;
  std::int64_t tick_in_force = 0;  // at whose start it began
  CourseStage stage = CourseStage::kNone;
  std::int64_t number = 0;      // of the course that comes
  std::int64_t from_tick = 0;   // at whose start it begins; 0: as soon as it is certified
  std::int64_t rest_ticks = 0;  // after its beginning its motion rests; 0: it does not
  int checked = 0;              // masses
  CourseReader reader;

  [[nodiscard]] Course& coming() { return slot[place]; }
  [[nodiscard]] const Course& coming() const { return slot[place]; }
};

}  // namespace ballast::firmware
