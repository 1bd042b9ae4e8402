// True robots at the corners of what is declared of a believed one.
#pragma once

#include "firmware/governor/governor_params.h"

namespace ballast::firmware::testing {

// Every error is as great as its bound, with a random sign.
template <class Random>
BallParams corner_ball(const BallParams& believed, const BeliefErrors& errors, Random& random) {
  const auto corner = [&] { return random() % 2 == 0 ? Real(1) : Real(-1); };
  BallParams out = believed;
  out.shell_mass_kg *= 1 + corner() * errors.mass_share;
  for (std::size_t i = 0; i < static_cast<std::size_t>(out.mass_count); ++i) {
    out.mass_kg[i] *= 1 + corner() * errors.mass_share;
  }
  for (int k = 0; k < 3; ++k) {
    out.inertia_kgm2[k] *= 1 + corner() * errors.mass_share;
    out.center_of_mass_B_m[k] += corner() * errors.center_of_mass_m;
  }
  return out;
}

}  // namespace ballast::firmware::testing
