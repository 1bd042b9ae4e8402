// A short motion that makes a robot's parameters observable.
//
// Each mass moves by a sum of sines about its place, faded in and out, as pieces of linear acceleration. Frequencies,
// amplitudes and phases are drawn at random; what breaks a motor's limit, a rail's end or the friction that may be used
// is made smaller. Of the candidates that whose worst predicted interval is narrowest is taken.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tools/identify/fit.h"

namespace ballast::identify {

struct ExciteOptions {
  double duration_s = 0;  // 0: 100 sqrt(r / g)
  int candidates = 40;
  std::uint64_t seed = 1;
  double friction_use = 0.6;         // part of what the envelope allows that the believed robot may use
  std::function<bool()> progress{};  // after each candidate; false ends the search
};

// Motions of all masses, and what they do to the believed robot with its masses exactly on them.
struct Excitation {
  std::vector<std::vector<sim::MotionPiece>> motion;
  double duration_s = 0;
  Eigen::VectorXd sigma;  // predicted_sigma()
  RunFit::Contact contact;
};

// The best candidates, best first; none: nothing moves inside the limits.
[[nodiscard]] std::vector<Excitation> excitations(const sim::Scenario& scenario, const Known& known,
                                                  const Parameters& parameters, const ExciteOptions& options);

// A robot that is not what is believed: masses and inertias up to `part` off, the centre of mass up to a tenth of
// `part` of the radius, sensors with the errors of another seed. The scenario's own robot is believed.
[[nodiscard]] sim::Scenario robot_off(const sim::Scenario& believed, double part, std::uint64_t seed);

// The scenario's file with this motion and duration, this name, and without [plan], [task], [[published]]
// and [[fault]].
[[nodiscard]] std::string excite_toml(const std::string& toml, const std::string& name, const Excitation& excitation);

}  // namespace ballast::identify
