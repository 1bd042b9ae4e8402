// Exact derivatives of the closed forms by complex step: the imaginary part of f(x + i h e_k) is h df/dx_k to rounding,
// because with so small an h no difference is taken and the next term vanishes (Squire and Trapp 1998,
// doi:10.1137/S003614459631241X).
#pragma once

#include <array>
#include <complex>

#include "firmware/model/ball.h"

namespace ballast::closed_forms {

using firmware::MassMotion;
using firmware::Real;
using Complex = std::complex<Real>;
inline constexpr Real kComplexStep = 1e-200;

// The masses with one complex coordinate.
struct ComplexMotion {
  ComplexMotion(const MassMotion& masses, int count) {
    for (int i = 0; i < count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      position[k] = masses.position[k];
      velocity[k] = masses.velocity[k];
      acceleration[k] = masses.acceleration[k];
    }
  }
  firmware::PerMass<Complex> position{}, velocity{}, acceleration{};
};

// The derivatives of a closed form. Its columns are those of the ball's or the disk's own state, then the positions of
// all masses, their velocities and their accelerations.
inline constexpr int kMostColumns = 6 + 3 * firmware::kMaxMasses;
template <class Value>
struct Derivative {
  int columns = 0;
  std::array<Value, kMostColumns> by{};
};

// form(column, masses) is the derivative: the imaginary part over the step. With column < own_columns it moves the
// state by i h along that column; otherwise the column is -1 and a mass is moved.
template <class Value, class Form>
Derivative<Value> differentiate(int own_columns, const MassMotion& masses, int mass_count, const Form& form) {
  Derivative<Value> out;
  ComplexMotion moved(masses, mass_count);
  const auto put = [&](const Value& value) { out.by[static_cast<std::size_t>(out.columns++)] = value; };
  for (int k = 0; k < own_columns; ++k) put(form(k, moved));
  for (auto* coordinate : {&moved.position, &moved.velocity, &moved.acceleration}) {
    for (int i = 0; i < mass_count; ++i) {
      Complex& x = (*coordinate)[static_cast<std::size_t>(i)];
      x = {x.real(), kComplexStep};
      put(form(-1, moved));
      x = x.real();
    }
  }
  return out;
}

}  // namespace ballast::closed_forms
