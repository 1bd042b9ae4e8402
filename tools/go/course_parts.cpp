#include "tools/go/course_parts.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace ballast::go {

namespace {

// Reads numbers one by one. Nothing is left after an end that came too early.
class Numbers {
 public:
  explicit Numbers(const std::vector<double>& values) : values_(values) {}
  double next() {
    if (at_ >= values_.size()) {
      good_ = false;
      return 0;
    }
    return values_[at_++];
  }
  // A whole number from 0 to `most`.
  int count(int most) {
    const double value = next();
    if (!(value >= 0 && value <= most && value == std::floor(value))) good_ = false;
    return good_ ? static_cast<int>(value) : 0;
  }
  [[nodiscard]] bool good() const { return good_; }
  [[nodiscard]] bool at_end() const { return good_ && at_ == values_.size(); }

 private:
  const std::vector<double>& values_;
  std::size_t at_ = 0;
  bool good_ = true;
};

std::vector<double> numbers_of(const HostCourse& course) {
  const firmware::ReferenceTable& reference = course.reference;
  const auto n = static_cast<int>(course.mass.size());
  std::vector<double> out{static_cast<double>(course.from_tick), static_cast<double>(n),
                          static_cast<double>(reference.samples), reference.period_s, reference.holds ? 1.0 : 0.0};
  for (const HostCourse::Mass& mass : course.mass) {
    out.insert(out.end(), {static_cast<double>(mass.motion.size()), mass.position, mass.velocity});
  }
  for (const HostCourse::Mass& mass : course.mass) {
    for (const sim::MotionPiece& piece : mass.motion) {
      out.insert(out.end(), {piece.duration_s, piece.acceleration_start, piece.acceleration_end});
    }
  }
  const auto values = static_cast<std::size_t>(reference.samples * firmware::reference_row(n));
  for (std::size_t k = 0; k < values; ++k) out.push_back(static_cast<double>(reference.values[k]));
  return out;
}

std::optional<HostCourse> course_of(std::int64_t number, const std::vector<double>& values) {
  Numbers numbers(values);
  HostCourse course;
  course.number = number;
  course.from_tick = static_cast<std::int64_t>(std::clamp(numbers.next(), 0.0, 9e15));
  course.mass.resize(static_cast<std::size_t>(numbers.count(firmware::kMaxMasses)));
  const int row = firmware::reference_row(static_cast<int>(course.mass.size()));
  course.reference.samples = numbers.count(firmware::kMostReferenceFloats / row);
  course.reference.period_s = numbers.next();
  course.reference.holds = numbers.next() == 1;
  for (HostCourse::Mass& mass : course.mass) {
    mass.motion.resize(static_cast<std::size_t>(numbers.count(firmware::kMaxPieces)));
    mass.position = numbers.next();
    mass.velocity = numbers.next();
  }
  for (HostCourse::Mass& mass : course.mass) {
    for (sim::MotionPiece& piece : mass.motion) {
      piece.duration_s = numbers.next();
      piece.acceleration_start = numbers.next();
      piece.acceleration_end = numbers.next();
    }
  }
  for (int k = 0; numbers.good() && k < course.reference.samples * row; ++k) {
    course.reference.values[static_cast<std::size_t>(k)] = static_cast<float>(numbers.next());
  }
  if (!numbers.at_end()) return std::nullopt;
  return course;
}

}  // namespace

HostCourse make_course(std::int64_t number, std::int64_t from_tick, const sim::Scenario& moved,
                       const firmware::ReferenceTable& reference) {
  HostCourse course;
  course.number = number;
  course.from_tick = from_tick;
  for (const sim::Mass& mass : moved.masses) {
    course.mass.push_back({mass.initial_position, mass.initial_velocity, mass.motion});
  }
  course.reference = reference;
  return course;
}

std::vector<firmware::CoursePart> parts_of(const HostCourse& course) {
  const std::vector<double> numbers = numbers_of(course);
  std::vector<firmware::CoursePart> parts;
  for (std::size_t first = 0; first < numbers.size(); first += firmware::kCoursePart) {
    firmware::CoursePart part;
    part.course = course.number;
    part.first = static_cast<std::int32_t>(first);
    part.total = static_cast<std::int32_t>(numbers.size());
    const std::size_t count = std::min<std::size_t>(firmware::kCoursePart, numbers.size() - first);
    part.count = static_cast<std::int32_t>(count);
    std::copy_n(numbers.begin() + static_cast<std::ptrdiff_t>(first), count, part.value.begin());
    parts.push_back(part);
  }
  return parts;
}

std::optional<HostCourse> CourseParts::take(const operator_t& message) {
  if (message.command != operator_t::COMMAND_GO) return std::nullopt;
  const auto same = [&](const Course& course) {
    return course.number == message.course && course.total == message.course_total;
  };
  auto found = std::find_if(courses_.begin(), courses_.end(), same);
  if (found == courses_.end()) {
    courses_.push_back({message.course, message.course_total, false, {}});
    if (courses_.size() > kMostCourses) courses_.pop_front();
    found = std::prev(courses_.end());
  }
  if (found->complete) return std::nullopt;
  found->values[message.course_first].assign(message.course_value, message.course_value + message.course_count);
  std::vector<double> values;
  for (const auto& [first, part] : found->values) {
    if (static_cast<std::size_t>(first) != values.size()) return std::nullopt;
    values.insert(values.end(), part.begin(), part.end());
  }
  if (values.size() != static_cast<std::size_t>(message.course_total)) return std::nullopt;
  found->complete = true;
  found->values.clear();
  return course_of(message.course, values);
}

}  // namespace ballast::go
