// Arrays that a function over rows takes and gives. An argument has one row of numbers per state in its last axis. The
// axes before it are broadcast with those of the other arguments, as NumPy does it.
#pragma once

#include <pybind11/numpy.h>

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "tools/python/bindings.h"

namespace ballast::python {

using Shape = std::vector<py::ssize_t>;
using Array = py::array_t<double>;

class Argument {
 public:
  static constexpr int kScalar = -1;  // one number per row, and no axis for it

  // Raises TypeError unless `value` is an array of real numbers or becomes one, and ValueError unless its last axis has
  // `width` numbers.
  Argument(const char* name, const py::object& value, int width);

  [[nodiscard]] const Shape& rows_shape() const { return rows_shape_; }
  [[nodiscard]] const char* name() const { return name_; }

  // Lays out the rows over the axes of `shape`, with which rows_shape() must broadcast.
  void broadcast_to(const Shape& shape);
  // Goes `count` rows along an axis of that shape, or to the next row along the last one.
  void step(std::size_t axis, py::ssize_t count) { at_ += count * steps_[axis]; }
  void next() { at_ += last_step_; }

  // A number of the row.
  [[nodiscard]] double operator[](int i) const { return at_[i]; }
  [[nodiscard]] bool finite() const;  // the row
  [[nodiscard]] bool all_finite() const;

 private:
  const char* name_;
  py::array_t<double, py::array::c_style | py::array::forcecast | py::detail::npy_api::NPY_ARRAY_ALIGNED_> values_;
  int width_;
  Shape rows_shape_, steps_;
  py::ssize_t last_step_ = 0;
  const double* at_ = nullptr;
};

// The rows of all arguments together.
class Rows {
 public:
  // Raises ValueError unless the axes before the last broadcast. The arguments must outlive the rows.
  explicit Rows(std::vector<Argument*> arguments);

  // A new array with this shape per row; none: one number.
  [[nodiscard]] Array output(const Shape& per_row) const;

  // Calls body(row) with the arguments at each row in turn, without the interpreter's lock; looks for signals now and
  // then. `body` returns null, or what is wrong with the row. Raises ValueError then, or if an argument is not finite.
  template <class Body>
  void for_each(const Body& body);

 private:
  static constexpr py::ssize_t kRowsBetweenClocks = 1 << 8;
  // Other threads may hold the interpreter's lock for as long as its switch interval, 5 ms.
  static constexpr std::chrono::milliseconds kBetweenSignals{100};

  struct Refusal {
    py::ssize_t row = 0;
    std::string text;
  };
  [[nodiscard]] bool all_finite() const;
  [[nodiscard]] const char* not_finite() const;  // the name of the first such argument in the row; null: there is none
  void next_line();                              // from the last row along the last axis
  [[noreturn]] void raise_refusal(const Refusal& refusal) const;

  std::vector<Argument*> arguments_;
  Shape shape_, place_;
  py::ssize_t count_ = 1;
};

template <class Body>
void Rows::for_each(const Body& body) {
  std::optional<Refusal> refusal;
  {
    const py::gil_scoped_release unlocked;
    const bool finite = all_finite();
    const py::ssize_t line = shape_.empty() ? 1 : shape_.back();
    py::ssize_t left = line;
    auto next_look = std::chrono::steady_clock::now() + kBetweenSignals;
    for (py::ssize_t row = 0; row < count_ && !refusal; ++row) {
      if (const char* name = finite ? nullptr : not_finite())
        refusal = Refusal{row, std::string(name) + " is not finite; allowed: finite numbers"};
      else if (const char* why = body(row))
        refusal = Refusal{row, why};
      if (--left > 0) {
        for (Argument* argument : arguments_) argument->next();
      } else {
        next_line();
        left = line;
      }
      if (row % kRowsBetweenClocks != kRowsBetweenClocks - 1 || std::chrono::steady_clock::now() < next_look) continue;
      look_for_signals();
      next_look = std::chrono::steady_clock::now() + kBetweenSignals;
    }
  }
  if (refusal) raise_refusal(*refusal);
}

}  // namespace ballast::python
