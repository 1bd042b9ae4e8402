// The currents that the supply can drive: against the winding's own differential equations, and the greatest torque
// against a search.
#include "sim/motors/phase_current.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <numbers>

#include "sim/motors/motor_presets.h"

namespace ballast::sim {
namespace {

constexpr double kPi = std::numbers::pi;

Motor motor(const MotorPreset& preset) {
  Motor m;
  m.steps_per_revolution = preset.steps_per_revolution;
  m.holding_torque_nm = preset.holding_torque_nm;
  m.rated_current_a = preset.rated_current_a;
  m.resistance_ohm = preset.resistance_ohm;
  m.inductance_h = preset.inductance_h;
  m.supply_voltage_v = preset.supply_voltage_v;
  m.corner_speed_radps = PhaseCurrent(m).corner_speed_radps();
  return m;
}

// L di/dt = v - R i - e of both phases, stator frame, with the rotor at constant speed and the commanded currents a
// constant lag ahead; the chopper is a steep amplifier of the current error. By Runge-Kutta.
struct Winding {
  const Motor& m;
  bool square;  // each phase has the supply for itself; else the voltage vector is no longer than the supply
  double gain_vpa = 1e4;

  struct Currents {
    double a = 0, b = 0;
  };
  [[nodiscard]] double constant() const { return m.holding_torque_nm / (std::numbers::sqrt2 * m.rated_current_a); }
  [[nodiscard]] Currents rate(const Currents& i, double angle, double lag, double speed) const {
    const double amplitude = std::numbers::sqrt2 * m.rated_current_a, supply = m.supply_voltage_v;
    double v_a = gain_vpa * (amplitude * std::cos(angle + lag) - i.a);
    double v_b = gain_vpa * (amplitude * std::sin(angle + lag) - i.b);
    if (square) {
      v_a = std::clamp(v_a, -supply, supply);
      v_b = std::clamp(v_b, -supply, supply);
    } else if (const double length = std::hypot(v_a, v_b); length > supply) {
      v_a *= supply / length;
      v_b *= supply / length;
    }
    const double emf = constant() * speed;
    return {(v_a - m.resistance_ohm * i.a + emf * std::sin(angle)) / m.inductance_h,
            (v_b - m.resistance_ohm * i.b - emf * std::cos(angle)) / m.inductance_h};
  }
  // Mean over the last electrical turns.
  [[nodiscard]] double torque_nm(double lag, double speed) const {
    const double electrical = m.steps_per_revolution / 4.0 * speed;
    // Ten time constants of the winding to settle; then whole turns.
    const double settle_s = 10 * m.inductance_h / m.resistance_ohm, turns_s = 4 * 2 * kPi / electrical;
    const double h = 0.2 * m.inductance_h / gain_vpa;  // Runge-Kutta is stable up to 2.8
    const auto total = static_cast<std::int64_t>((settle_s + turns_s) / h),
               from = static_cast<std::int64_t>(settle_s / h);
    Currents i;
    double sum = 0;
    for (std::int64_t k = 0; k < total; ++k) {
      const double angle = electrical * h * static_cast<double>(k), half = electrical * h / 2;
      const Currents k1 = rate(i, angle, lag, speed);
      const Currents k2 = rate({i.a + h / 2 * k1.a, i.b + h / 2 * k1.b}, angle + half, lag, speed);
      const Currents k3 = rate({i.a + h / 2 * k2.a, i.b + h / 2 * k2.b}, angle + half, lag, speed);
      const Currents k4 = rate({i.a + h * k3.a, i.b + h * k3.b}, angle + 2 * half, lag, speed);
      i.a += h / 6 * (k1.a + 2 * k2.a + 2 * k3.a + k4.a);
      i.b += h / 6 * (k1.b + 2 * k2.b + 2 * k3.b + k4.b);
      const double after = angle + 2 * half;
      if (k >= from) sum += constant() * (i.b * std::cos(after) - i.a * std::sin(after));
    }
    return sum / static_cast<double>(total - from);
  }
};

// The voltage needed is greatest, |Z| I + K w, where all of it adds up.
TEST(PhaseCurrent, IsTheCommandedOneWhereTheSupplySuffices) {
  for (const MotorPreset& preset : motor_presets()) {
    const Motor m = motor(preset);
    const PhaseCurrent phases(m);
    const double amplitude = std::numbers::sqrt2 * m.rated_current_a;
    for (const double lag : {-1.5, -0.7, 0.0, 0.3, 1.2, 2.5}) {
      double needed_v = 0;
      for (double speed = 0; needed_v <= m.supply_voltage_v; speed += 0.5) {
        EXPECT_NEAR(phases.torque_nm(lag, speed, speed), m.holding_torque_nm * std::sin(lag),
                    1e-14 * m.holding_torque_nm);
        EXPECT_NEAR(phases.copper_loss_w(phases.at(lag, speed, speed)),
                    2 * m.rated_current_a * m.rated_current_a * m.resistance_ohm,
                    1e-12);  // as datasheets state the heat: rounding
        needed_v = std::hypot(m.resistance_ohm, 50 * m.inductance_h * (speed + 0.5)) * amplitude +
                   m.holding_torque_nm / amplitude * (speed + 0.5);
      }
    }
  }
}

TEST(PhaseCurrent, UpToTheCornerSpeedTheHoldingTorqueIsThereAndNotBeyond) {
  for (const MotorPreset& preset : motor_presets()) {
    const Motor m = motor(preset);
    const PhaseCurrent phases(m);
    EXPECT_EQ(phases.pull_out(0.999 * m.corner_speed_radps).torque_nm, m.holding_torque_nm);
    EXPECT_LT(phases.pull_out(1.01 * m.corner_speed_radps).torque_nm, m.holding_torque_nm * (1 - 1e-6));
    EXPECT_LT(phases.pull_out(1.5 * m.corner_speed_radps).torque_nm, 0.9 * m.holding_torque_nm);
  }
}

TEST(PhaseCurrent, IsContinuousAndTheSameBothWays) {
  const Motor m = motor(*find_motor_preset("nema17"));
  const PhaseCurrent phases(m);
  const double amplitude = std::numbers::sqrt2 * m.rated_current_a, k = m.holding_torque_nm / amplitude;
  // The most by which a change of the needed voltage (back EMF and inductance) can change the current.
  const double steepest = k * (k + 50 * m.inductance_h * amplitude) / m.resistance_ohm;
  for (double lag = -3; lag <= 3; lag += 0.1) {
    double before = phases.torque_nm(lag, 0, 0);
    for (double speed = 0.01; speed < 400; speed += 0.01) {
      const double torque = phases.torque_nm(lag, speed, speed);
      ASSERT_LT(std::abs(torque - before), 0.01 * steepest) << lag << ' ' << speed;
      before = torque;
    }
    EXPECT_NEAR(phases.torque_nm(-lag, -200, -200), -phases.torque_nm(lag, 200, 200), 1e-14);
  }
}

// Electrical power in = heat + back EMF times its current, which is torque times speed.
TEST(PhaseCurrent, PowerInIsHeatAndMechanicalPower) {
  const Motor m = motor(*find_motor_preset("nema23"));
  const PhaseCurrent phases(m);
  for (const double lag : {-2.0, -0.4, 0.9, 2.2}) {
    for (const double speed : {3.0, -60.0, 200.0, 700.0}) {
      const auto i = phases.at(lag, speed, speed);
      EXPECT_NEAR(phases.terminal_power_w(i, speed, speed),
                  phases.copper_loss_w(i) + phases.torque_nm(lag, speed, speed) * speed,
                  1e-11);  // rounding of some 100 W
    }
  }
}

// The chopper's amplifier is 1e4 V/A steep, so 30 V take 3 mA: 0.25 % of the smallest motor's current; twice that. With
// each phase at the supply for itself the voltages of a starved winding are square waves, whose fundamental is up to
// 4/pi of the supply: the model, which takes the supply as the sine's peak, is on the careful side, by no more than
// that.
TEST(PhaseCurrent, IsWhatTheWindingSettlesAt) {
  for (const MotorPreset& preset : motor_presets()) {
    const Motor m = motor(preset);
    const PhaseCurrent phases(m);
    Motor richer = m;
    richer.supply_voltage_v *= 4 / kPi;
    for (const double corners : {0.8, 1.5, 4.0}) {
      const double speed = corners * m.corner_speed_radps;
      for (const double lag : {0.5, 1.4}) {
        const double here = phases.torque_nm(lag, speed, speed);
        EXPECT_NEAR(here, (Winding{m, false}.torque_nm(lag, speed)), 0.005 * m.holding_torque_nm)
            << preset.name << ' ' << corners << ' ' << lag;
      }
      const double lag = phases.pull_out(speed).lag_rad;
      const double square = Winding{m, true}.torque_nm(lag, speed);
      EXPECT_GT(square, phases.torque_nm(lag, speed, speed) - 0.005 * m.holding_torque_nm)
          << preset.name << ' ' << corners;
      EXPECT_LT(square, PhaseCurrent(richer).pull_out(speed).torque_nm + 0.005 * m.holding_torque_nm)
          << preset.name << ' ' << corners;
    }
  }
}

TEST(PhaseCurrent, PullOutIsTheGreatestTorqueOverAllLags) {
  for (const MotorPreset& preset : motor_presets()) {
    Motor m = motor(preset);
    for (const double supply : {1.0, 0.6, 3.0}) {
      m.supply_voltage_v = preset.supply_voltage_v * supply;
      const PhaseCurrent phases(m);
      for (double speed = 1; speed < 2000; speed *= 1.13) {
        double best = 0;
        constexpr int kLags = 20000;
        for (int k = 0; k < kLags; ++k)
          best = std::max(best, phases.torque_nm(-kPi + 2 * kPi * k / kLags, speed, speed));
        const auto most = phases.pull_out(speed);
        // Half a place from the greatest: 1.6e-4 rad, squared; where currents' and voltages' limits cross it is a
        // corner, and the slope there a few times the torque.
        EXPECT_NEAR(most.torque_nm, std::max(best, 1e-6 * m.holding_torque_nm), 2e-3 * m.holding_torque_nm)
            << preset.name << ' ' << supply << ' ' << speed;
        if (most.torque_nm > 1e-5 * m.holding_torque_nm) {
          EXPECT_NEAR(phases.torque_nm(most.lag_rad, speed, speed), most.torque_nm, 1e-9)
              << preset.name << ' ' << speed;
        }
        EXPECT_EQ(phases.pull_out(-speed).torque_nm, most.torque_nm);
      }
    }
  }
}

// Windings of little inductance at 2000 rad/s: their own voltage, some 300 V, is greater than the supply's and that
// which the current takes together. No lag drives the shaft, and the torque is the least there is.
TEST(PhaseCurrent, NoLagDrivesAShaftThatIsFarTooFast) {
  Motor m = motor(*find_motor_preset("nema17"));
  m.inductance_h /= 20;
  const PhaseCurrent phases(m);
  for (int k = 0; k <= 100; ++k) EXPECT_LT(phases.torque_nm(kPi * k / 100, 2000, 2000), 0);
  EXPECT_EQ(phases.pull_out(2000).lag_rad, kPi / 2);
  EXPECT_NEAR(phases.pull_out(2000).torque_nm, 1e-6 * m.holding_torque_nm, 1e-18);
}

TEST(PhaseCurrent, MostBrakingIsTheGreatestTorqueTheOtherWay) {
  for (const MotorPreset& preset : motor_presets()) {
    Motor m = motor(preset);
    const PhaseCurrent phases(m);
    for (double speed = 1; speed < 1000; speed *= 1.3) {
      double best = 0;
      constexpr int kLags = 20000;
      for (int k = 0; k < kLags; ++k) best = std::max(best, -phases.torque_nm(-kPi * k / kLags, speed, speed));
      const auto most = phases.most_braking(speed);
      // As above: half a place, and a corner.
      EXPECT_NEAR(most.torque_nm, best, 2e-3 * m.holding_torque_nm) << preset.name << ' ' << speed;
      EXPECT_GE(most.torque_nm, phases.pull_out(speed).torque_nm * (1 - 1e-9)) << preset.name << ' ' << speed;
    }
  }
}

// Far above the corner the curve is that of a synchronous machine on a voltage V: K (V / Z - K w R / Z^2).
TEST(PhaseCurrent, TorqueFallsAsThatOfASynchronousMachine) {
  const Motor m = motor(*find_motor_preset("nema11"));
  const double k = m.holding_torque_nm / (std::numbers::sqrt2 * m.rated_current_a);
  for (const double speed : {200.0, 300.0}) {
    const double z = std::hypot(m.resistance_ohm, 50 * m.inductance_h * speed);
    EXPECT_NEAR(PhaseCurrent(m).pull_out(speed).torque_nm,
                k * (m.supply_voltage_v / z - k * speed * m.resistance_ohm / (z * z)), 1e-12);
  }
}

}  // namespace
}  // namespace ballast::sim
