#include "tools/python/arguments.h"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <utility>

namespace ballast::python {
namespace {

std::string joined(const Shape& shape) {
  std::string text;
  for (const py::ssize_t length : shape) text += (text.empty() ? "" : ", ") + std::to_string(length);
  return text;
}

std::string shape_text(const Shape& shape) { return "(" + joined(shape) + ")"; }

}  // namespace

Argument::Argument(const char* name, const py::object& value, int width) : name_(name), width_(width) {
  const py::array given = py::array::ensure(value);
  if (!given) PyErr_Clear();
  // numpy.generic kinds: b, i, u and f are real numbers; object, complex, text and dates are not.
  const std::string kind = given ? std::string(1, given.dtype().kind()) : "";
  if (kind.empty() || std::string("iuf").find(kind) == std::string::npos) {
    const std::string found = given ? py::str(static_cast<py::object>(given.dtype())).cast<std::string>()
                                    : py::str(py::type::of(value).attr("__name__")).cast<std::string>();
    throw py::type_error(fmt::format("{}: {} is not allowed; allowed: an array of real numbers", name, found));
  }
  values_ = decltype(values_)(given);
  const Shape shape(values_.shape(), values_.shape() + values_.ndim());
  rows_shape_ = shape;
  if (width != kScalar) {
    if (shape.empty() || shape.back() != width) {
      throw py::value_error(
          fmt::format("{}: shape {} is not allowed; allowed: (..., {})", name, shape_text(shape), width));
    }
    rows_shape_.pop_back();
  }
  at_ = values_.data();
}

void Argument::broadcast_to(const Shape& shape) {
  steps_.assign(shape.size(), 0);
  const std::size_t missing = shape.size() - rows_shape_.size();
  py::ssize_t step = width_ == kScalar ? 1 : width_;
  for (std::size_t axis = rows_shape_.size(); axis-- > 0;) {
    if (rows_shape_[axis] != 1) steps_[missing + axis] = step;
    step *= rows_shape_[axis];
  }
  if (!steps_.empty()) last_step_ = steps_.back();
}

bool Argument::finite() const {
  const int count = width_ == kScalar ? 1 : width_;
  bool all = true;
  for (int i = 0; i < count; ++i) all &= std::isfinite((*this)[i]);
  return all;
}

bool Argument::all_finite() const {
  // Adding the exponent's lowest bit to an exponent of ones carries into the sign's place.
  constexpr std::uint64_t kExponent = 0x7ff0000000000000, kLowest = 0x0010000000000000;
  std::uint64_t carries = 0;
  const double* const data = values_.data();
  for (py::ssize_t i = 0, count = values_.size(); i < count; ++i)
    carries |= (std::bit_cast<std::uint64_t>(data[i]) & kExponent) + kLowest;
  return (carries >> 63) == 0;
}

Rows::Rows(std::vector<Argument*> arguments) : arguments_(std::move(arguments)) {
  const Argument* widest = nullptr;  // of the greatest length along some axis, for the message
  for (const Argument* argument : arguments_) {
    const Shape& shape = argument->rows_shape();
    if (shape.size() > shape_.size()) shape_.insert(shape_.begin(), shape.size() - shape_.size(), 1);
    for (std::size_t i = 0; i < shape.size(); ++i) {
      py::ssize_t& length = shape_[shape_.size() - shape.size() + i];
      if (shape[i] == 1 || shape[i] == length) continue;
      if (length != 1) {
        throw py::value_error(fmt::format("{}: its rows {} do not broadcast with those of {}, {}", argument->name(),
                                          shape_text(shape), widest->name(), shape_text(widest->rows_shape())));
      }
      length = shape[i];
      widest = argument;
    }
  }
  for (Argument* argument : arguments_) argument->broadcast_to(shape_);
  for (const py::ssize_t length : shape_) count_ *= length;
  place_.assign(shape_.size(), 0);
}

Array Rows::output(const Shape& per_row) const {
  Shape shape = shape_;
  shape.insert(shape.end(), per_row.begin(), per_row.end());
  return Array(shape);
}

bool Rows::all_finite() const {
  return std::all_of(arguments_.begin(), arguments_.end(), [](const Argument* a) { return a->all_finite(); });
}

const char* Rows::not_finite() const {
  for (const Argument* argument : arguments_) {
    if (!argument->finite()) return argument->name();
  }
  return nullptr;
}

void Rows::next_line() {
  for (std::size_t axis = shape_.size(); axis-- > 0;) {
    const bool last = axis + 1 == shape_.size();
    if (!last && ++place_[axis] < shape_[axis]) {
      for (Argument* argument : arguments_) argument->step(axis, 1);
      return;
    }
    for (Argument* argument : arguments_) argument->step(axis, 1 - shape_[axis]);
    place_[axis] = 0;
  }
}

void Rows::raise_refusal(const Refusal& refusal) const {
  if (shape_.empty()) throw py::value_error(refusal.text);
  Shape place(shape_.size());
  py::ssize_t rest = refusal.row;
  for (std::size_t axis = shape_.size(); axis-- > 0; rest /= shape_[axis]) place[axis] = rest % shape_[axis];
  throw py::value_error(fmt::format("row {}: {}", joined(place), refusal.text));
}

}  // namespace ballast::python
