// Speeds at which a stepper is in trouble: its resonance, and where the torque runs out. The rotor swings on the
// field's stiffness with sqrt(N_r tau_hold / J): steps that come at that rate shake it most. BALLAST_RESONANCE_OUT=CSV
// writes the sweeps for tools/plots/stepper_resonance.py.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <numbers>

#include "sim/motors/motor_presets.h"
#include "sim/motors/phase_current.h"
#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"

namespace ballast::sim {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kFullStep = 2 * kPi / 200;
constexpr double kTravel = 0.008;  // m per revolution

// A NEMA 17 that lifts a mass by a screw, straight through the centre of a ball that stays where it is.
Scenario lift(int microsteps, double damping_ratio, double detent_nm, double step_error) {
  const MotorPreset& preset = *find_motor_preset("nema17");
  Scenario s;
  s.duration_s = 100;
  s.gravity_mps2 = 9.81;
  s.ball = {.radius_m = 1, .mass_kg = 5, .inertia_kgm2 = {2, 2, 2}, .center_of_mass_B_m = {0, 0, 0}};
  Mass m;
  m.mass_kg = 0.28;
  m.rail = firmware::line({0, 0, 0}, {0, 0, 1});
  Motor& motor = m.motor;
  motor.microsteps = microsteps;
  motor.holding_torque_nm = preset.holding_torque_nm;
  motor.detent_torque_nm = detent_nm;
  motor.rotor_inertia_kgm2 = preset.rotor_inertia_kgm2;
  motor.rated_current_a = preset.rated_current_a;
  motor.resistance_ohm = preset.resistance_ohm;
  motor.inductance_h = preset.inductance_h;
  motor.supply_voltage_v = preset.supply_voltage_v;
  motor.corner_speed_radps = PhaseCurrent(motor).corner_speed_radps();
  motor.step_error = step_error;
  motor.shaft_ratio = 2 * kPi / kTravel;
  const double inertia = motor.rotor_inertia_kgm2 + m.mass_kg / (motor.shaft_ratio * motor.shaft_ratio);
  motor.viscous_damping_nms = 2 * damping_ratio * std::sqrt(50 * motor.holding_torque_nm * inertia);
  s.masses = {m};
  return s;
}

double natural_hz(const Scenario& s) {
  const Motor& m = s.masses[0].motor;
  const double inertia = m.rotor_inertia_kgm2 + s.masses[0].mass_kg / (m.shaft_ratio * m.shaft_ratio);
  return std::sqrt(50 * m.holding_torque_nm / inertia) / (2 * kPi);
}

struct Peak {
  double rate_hz = 0;        // of pulses
  double amplitude_rad = 0;  // of the shaft about the even motion, half of peak to peak
};

// Pulses at a rate that grows linearly, slowly, from low to high; how far the rotor swings about the even motion, in
// each of `bins` stretches of equal time. No step may get lost, unless `lost_steps` is asked for.
std::vector<Peak> sweep(const Scenario& s, double low_hz, double high_hz, double seconds, int bins,
                        std::int64_t* lost_steps = nullptr) {
  Plant plant(s);
  const Motor& motor = s.masses[0].motor;
  const double growth = (high_hz - low_hz) / seconds;
  const double microstep = kFullStep / motor.microsteps;
  const double start = motor.shaft_ratio * plant.sample().mass_position[0];
  std::vector<Peak> peaks;
  std::int64_t pulses = 0;
  for (int bin = 0; bin < bins; ++bin) {
    double least = 1e9, most = -1e9;
    const double until_s = seconds * (bin + 1) / bins;
    while (plant.time_s() < until_s && plant.end() == PhysicsEnd::kNone) {
      // Pulse k comes where low t + growth t^2 / 2 = k + 1/2: the even motion is in the middle of the steps.
      const double count = static_cast<double>(pulses) + 0.5;
      const double pulse_s = 2 * count / (low_hz + std::sqrt(low_hz * low_hz + 2 * growth * count));
      // Some 20 looks in a swing.
      const double look_s = std::min({pulse_s, until_s, plant.time_s() + 0.05 / natural_hz(s)});
      plant.advance(look_s, {});
      const double t = plant.time_s();
      const double even = start + microstep * (low_hz * t + growth * t * t / 2);
      const double off = motor.shaft_ratio * plant.sample().mass_position[0] - even;
      least = std::min(least, off);
      most = std::max(most, off);
      if (look_s == pulse_s) {
        // At once: an interval of no length does not execute it, the next one does.
        const StepPulse pulse{0, 0, +1};
        plant.advance(std::nextafter(pulse_s, 1e9), {&pulse, 1});
        ++pulses;
      }
    }
    EXPECT_EQ(plant.end(), PhysicsEnd::kNone);
    const double middle_s = seconds * (bin + 0.5) / bins;
    peaks.push_back({low_hz + growth * middle_s, (most - least) / 2});
  }
  if (lost_steps == nullptr) {
    EXPECT_EQ(plant.sample().lost_steps[0], 0);
  } else {
    *lost_steps = plant.sample().lost_steps[0];
  }
  // Against the rotor's true angle: what is more than the lag, some 0.3 of a full step, is whole teeth.
  const double behind =
      static_cast<double>(pulses) - (motor.shaft_ratio * plant.sample().mass_position[0] - start) / microstep;
  EXPECT_NEAR(plant.motor_steps_behind(0), behind, 1e-6);
  EXPECT_EQ(4LL * motor.microsteps * std::abs(std::llround(behind / (4 * motor.microsteps))),
            plant.sample().lost_steps[0]);
  return peaks;
}

Peak highest(const std::vector<Peak>& peaks) {
  return *std::max_element(peaks.begin(), peaks.end(),
                           [](const Peak& a, const Peak& b) { return a.amplitude_rad < b.amplitude_rad; });
}

// Sixteenths of a step, so that the swing is small and the spring straight. Pulses of rate f are a sawtooth of
// amplitude half a microstep; of it the part at f, (1/pi) of a microstep, is magnified by 1/(2 zeta sqrt(1 - zeta^2))
// at f_n sqrt(1 - 2 zeta^2).
TEST(Resonance, IsWhereTheFieldsStiffnessPutsIt) {
  const double zeta = 0.05;
  const Scenario s = lift(16, zeta, 0, 0);
  const double expected_hz = natural_hz(s) * std::sqrt(1 - 2 * zeta * zeta);
  // 80 Hz in 4 s: the swing, which forgets in 1/(2 pi zeta f_n) = 12 ms, is 0.2 Hz behind. Bins of 2 Hz.
  const auto peaks = sweep(s, expected_hz - 40, expected_hz + 40, 4, 40);
  EXPECT_NEAR(highest(peaks).rate_hz, expected_hz, 0.015 * expected_hz);
  // Harmonics of the sawtooth, 2 f_n and up, are not magnified: half a microstep altogether.
  const double fundamental = kFullStep / 16 / kPi / (2 * zeta * std::sqrt(1 - zeta * zeta));
  EXPECT_NEAR(highest(peaks).amplitude_rad, fundamental, 0.1 * fundamental);
}

// The same speeds in full steps, half steps and sixteenths; detent and step errors as motors have them. Full steps
// shake the rotor at f_n, and where their harmonics meet it; so far at f_n that the spring is no longer straight: it
// softens, and the peak comes before. Half steps do where their own rate is f_n. Of sixteenths next to nothing is left;
// what shows is the detent, which beats once a full step.
TEST(Resonance, MicrosteppingCalmsIt) {
  const char* out = std::getenv("BALLAST_RESONANCE_OUT");
  std::ofstream csv;
  if (out != nullptr) csv.open(out);
  const auto peak_of = [&](int microsteps) {
    const Scenario s = lift(microsteps, 0.1, 0.025, 0.015);
    const double f = natural_hz(s);
    const auto peaks = sweep(s, 0.2 * f * microsteps, 1.8 * f * microsteps, 4, 200);
    for (const Peak& p : peaks) {
      csv << microsteps << ',' << f << ',' << p.rate_hz / microsteps << ',' << p.amplitude_rad / kFullStep << '\n';
    }
    const Peak peak = highest(peaks);
    return Peak{peak.rate_hz / microsteps / f, peak.amplitude_rad / kFullStep};
  };
  const Peak full = peak_of(1), half = peak_of(2), fine = peak_of(16);
  EXPECT_GT(full.amplitude_rad, 0.9);
  // A pendulum that swings by 1.1 steps, 100 degrees of the electrical angle, is slower by 20 %.
  EXPECT_NEAR(full.rate_hz, 0.82, 0.07);
  EXPECT_LT(half.amplitude_rad, 0.75 * full.amplitude_rad);
  EXPECT_NEAR(half.rate_hz, 0.5 * 0.93, 0.04);  // 0.7 steps, 63 degrees: 8 %
  EXPECT_LT(fine.amplitude_rad, 0.25 * full.amplitude_rad);
  EXPECT_NEAR(fine.rate_hz, 0.99, 0.03);  // sqrt(1 - 2 zeta^2)
}

// A drive with next to no friction throws the rotor out of its teeth: full steps get lost at the resonance, finer ones
// do not.
TEST(Resonance, UndampedFullStepsGetLostThere) {
  for (const int microsteps : {1, 16}) {
    const Scenario s = lift(microsteps, 0.05, 0.025, 0.015);
    const double f = natural_hz(s);
    std::int64_t lost = 0;
    sweep(s, 0.2 * f * microsteps, 1.8 * f * microsteps, 4, 20, &lost);
    if (microsteps == 1) {
      EXPECT_GT(lost, 0);
    } else {
      EXPECT_EQ(lost, 0);
    }
  }
}

// A motor driven faster and faster under load holds until its field gives no more than load, friction and the
// acceleration take: the pull-out curve, found by the rotor.
TEST(PullOut, IsWhereARampLosesTheRotor) {
  for (const double part : {0.4, 0.7}) {
    Scenario s = lift(16, 0.1, 0, 0);
    Motor& motor = s.masses[0].motor;
    s.masses[0].mass_kg = part * motor.holding_torque_nm * motor.shaft_ratio / s.gravity_mps2;
    const double inertia = motor.rotor_inertia_kgm2 + s.masses[0].mass_kg / (motor.shaft_ratio * motor.shaft_ratio);
    const double growth = 30;  // rad/s^2 of the shaft
    const auto needed_nm = [&](double speed) {
      return part * motor.holding_torque_nm + motor.viscous_damping_nms * speed + inertia * growth;
    };
    const PhaseCurrent phases(motor);
    double expected = motor.corner_speed_radps;
    while (phases.pull_out(expected).torque_nm > needed_nm(expected)) expected += 0.01;

    Plant plant(s);
    const double microstep = kFullStep / motor.microsteps;
    double fastest = 0;
    for (std::int64_t k = 0; plant.sample().lost_steps[0] == 0 && k < 200000; ++k) {
      const StepPulse pulse{0, 0, +1};
      plant.advance(std::sqrt(2 * (static_cast<double>(k) + 0.5) * microstep / growth), {});
      plant.advance(std::nextafter(plant.time_s(), 1e9), {&pulse, 1});
      fastest = growth * plant.time_s();
    }
    ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
    // Past the greatest torque the rotor takes some 15 ms to fall back by a tooth, in which the field goes 0.5 rad/s
    // on.
    EXPECT_GT(fastest, expected - 0.1) << part;
    EXPECT_LT(fastest, expected + 1) << part;
  }
}

}  // namespace
}  // namespace ballast::sim
