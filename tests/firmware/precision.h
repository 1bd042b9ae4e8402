// What the firmware makes of a state and of the paper's run, in plain numbers, so that one program can hold the
// firmware in single precision beside the one in double.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace precision {

// A ball with three masses on circles, and its state.
struct State {
  double radius_m, gravity_mps2, shell_mass_kg;
  std::array<double, 3> inertia_kgm2, center_of_mass_B_m, force_W_n;
  std::array<double, 3> mass_kg, rail_radius_m, azimuth_rad, elevation_rad;
  std::array<double, 4> orientation;  // w, x, y, z
  std::array<double, 3> omega_B_radps, position_rad, velocity_radps, acceleration_radps2;
};

struct Envelope {
  double normal_force_n, static_friction_n, mu_required;
};

// A burst, without padding.
struct Pulse {
  std::int64_t tick;
  int motor, direction, count, first_ticks, interval_ticks, add_ticks;
  bool operator==(const Pulse&) const = default;
};

struct PaperRun {
  bool accepted = false;
  std::vector<Envelope> envelope;  // one per tick
  std::vector<Pulse> pulses;
  std::vector<std::array<double, 6>> plans;  // of the stop: duration, least N, most f_s/N, least margin, tick, mode
};

// Real: double or float.
template <class Real>
Envelope envelope_of(const State& state);

// The paper's ball and motion, `ticks` of 1 ms: armed, started, stopped at stop_tick (-1: not), then moved. The
// attitude sensed turns as the sines and cosines of the time.
template <class Real>
PaperRun paper_run(int ticks, int stop_tick);

}  // namespace precision
