#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "firmware/motion/motion_limits.h"
#include "tests/firmware/paper_ball.h"

namespace ballast::firmware {
namespace {

constexpr Real kNan = std::numeric_limits<Real>::quiet_NaN();
constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

using Change = std::function<void(ControllerParams&)>;

ParamError validated(const Change& change) {
  const auto params = std::make_unique<ControllerParams>(testing::paper_params());
  change(*params);
  return validate(*params);
}

void expect_refused(const std::string& field, int index, const Change& change) {
  const ParamError error = validated(change);
  ASSERT_FALSE(error.ok()) << field;
  EXPECT_EQ(error.field, field);
  EXPECT_EQ(error.index, index) << field;
  EXPECT_GT(std::string(error.allowed).size(), 0u) << field;
}

void expect_refused_values(const std::string& field, int index, std::initializer_list<Real> values,
                           const std::function<Real&(ControllerParams&)>& place) {
  for (const Real value : values) {
    SCOPED_TRACE(::testing::Message() << field << " = " << value);
    expect_refused(field, index, [&](ControllerParams& p) { place(p) = value; });
    // The value itself is reported.
    const ParamError error = validated([&](ControllerParams& p) { place(p) = value; });
    EXPECT_TRUE(error.value == value || (std::isnan(value) && std::isnan(error.value)));
  }
}

TEST(Validate, AcceptsThePaperBall) {
  const ParamError error = validated([](ControllerParams&) {});
  EXPECT_TRUE(error.ok()) << error.field << " " << error.value << " " << error.allowed;
}

TEST(Validate, AcceptsTheEdges) {
  EXPECT_TRUE(validated([](ControllerParams& p) { p.static_friction = kInfinity; }).ok());
  EXPECT_TRUE(validated([](ControllerParams& p) { p.ball.gravity_mps2 = 0; }).ok());
  EXPECT_TRUE(validated([](ControllerParams& p) { p.ball.mass_count = 0; }).ok());
  EXPECT_TRUE(validated([](ControllerParams& p) { p.sensor_stale_ticks = p.monitor_stale_ticks = 0; }).ok());
  EXPECT_TRUE(validated([](ControllerParams& p) { p.motor[1].steps_per_unit = -5; }).ok()) << "wiring";
  EXPECT_TRUE(validated([](ControllerParams& p) { p.ball.inertia_kgm2 = Vector3(1, 1, 2); }).ok()) << "a flat disk";
  EXPECT_TRUE(validated([](ControllerParams& p) { p.timer_frequency_hz = 1e6; }).ok());
  EXPECT_TRUE(validated([](ControllerParams& p) { p.timer_frequency_hz = 1e8; }).ok());
  EXPECT_TRUE(validated([](ControllerParams& p) { p.motor[1].direction_setup_s = 1e-3; }).ok());
  EXPECT_TRUE(validated([](ControllerParams& p) { p.ball.rail[0] = line(Vector3::Zero(), Vector3(1, 1, 1)); }).ok());
  EXPECT_TRUE(validated([](ControllerParams& p) { p.ball.mass_kg[3] = kNan; }).ok()) << "beyond the count";
}

TEST(Validate, Scalars) {
  expect_refused_values("control_period_s", -1, {0, -1, kNan, kInfinity, 1e-7, 1000},
                        [](auto& p) -> Real& { return p.control_period_s; });
  expect_refused_values("timer_frequency_hz", -1, {0, -1, kNan, kInfinity, 0.99e6, 1.01e8},
                        [](auto& p) -> Real& { return p.timer_frequency_hz; });
  expect_refused_values("static_friction", -1, {0, -0.1, kNan, -kInfinity},
                        [](auto& p) -> Real& { return p.static_friction; });
  for (const int ticks : {-1, 1001}) {
    expect_refused("sensor_stale_ticks", -1, [ticks](auto& p) { p.sensor_stale_ticks = ticks; });
    expect_refused("monitor_stale_ticks", -1, [ticks](auto& p) { p.monitor_stale_ticks = ticks; });
  }
}

TEST(Validate, Ball) {
  expect_refused_values("ball.radius_m", -1, {0, -1, kNan, kInfinity},
                        [](auto& p) -> Real& { return p.ball.radius_m; });
  expect_refused_values("ball.gravity_mps2", -1, {-1, kNan, kInfinity},
                        [](auto& p) -> Real& { return p.ball.gravity_mps2; });
  expect_refused_values("ball.shell_mass_kg", -1, {0, -1, kNan, kInfinity},
                        [](auto& p) -> Real& { return p.ball.shell_mass_kg; });
  for (int j = 0; j < 3; ++j) {
    expect_refused_values("ball.inertia_kgm2", -1, {0, -1, kNan, kInfinity, 2.5},
                          [j](auto& p) -> Real& { return p.ball.inertia_kgm2[j]; });
    expect_refused_values("ball.center_of_mass_B_m", -1, {kNan, kInfinity},
                          [j](auto& p) -> Real& { return p.ball.center_of_mass_B_m[j]; });
    expect_refused_values("ball.external_force_W_n", -1, {kNan, kInfinity},
                          [j](auto& p) -> Real& { return p.ball.external_force_W_n[j]; });
  }
  expect_refused("ball.center_of_mass_B_m", -1, [](auto& p) { p.ball.center_of_mass_B_m = Vector3(0.8, 0.8, 0); });
  for (int j = 0; j < 3; ++j) {
    for (const Real value : {Real(1), kNan, kInfinity}) {
      expect_refused("ball.down_W", -1, [j, value](auto& p) { p.ball.down_W[j] = value; });
    }
  }
  expect_refused("ball.down_W", -1, [](auto& p) { p.ball.down_W = Vector3(0, 0, 1); });
  expect_refused("ball.down_W", -1, [](auto& p) { p.ball.down_W = Vector3(0, 1, 0); });
  expect_refused_values("ball.rolling_resistance", -1, {-1, kNan, kInfinity},
                        [](auto& p) -> Real& { return p.ball.rolling_resistance; });
  expect_refused_values("ball.spin_friction_m", -1, {-1, kNan, kInfinity},
                        [](auto& p) -> Real& { return p.ball.spin_friction_m; });
  expect_refused_values("ball.creep_radps", -1, {-1, kNan, kInfinity},
                        [](auto& p) -> Real& { return p.ball.creep_radps; });
  expect_refused("ball.creep_radps", -1, [](auto& p) { p.ball.rolling_resistance = 0.01; });
  expect_refused("ball.creep_radps", -1, [](auto& p) { p.ball.spin_friction_m = 0.01; });
  expect_refused("ball.mass_count", -1, [](auto& p) { p.ball.mass_count = -1; });
  expect_refused("ball.mass_count", -1, [](auto& p) {
    for (std::size_t i = 3; i < kMaxMasses; ++i) {
      p.ball.mass_kg[i] = p.ball.mass_kg[0];
      p.ball.rail[i] = p.ball.rail[0];
      p.motor[i] = p.motor[0];
    }
    p.ball.mass_count = 9;
  });
}

// A table of two rows: the ball stands, no feedback.
void add_reference(ControllerParams& p) {
  p.tracking.samples = 2;
  p.tracking.period_s = 0.5;
  for (std::size_t k = 0; k < 2; ++k) p.tracking.values[k * static_cast<std::size_t>(reference_row(3))] = 1;
}

TEST(Validate, Reference) {
  EXPECT_TRUE(validated([](auto& p) { add_reference(p); }).ok());
  EXPECT_TRUE(validated([](auto& p) { p.tracking.period_s = kNan; }).ok()) << "no samples: not read";
  const int most = kMostReferenceFloats / reference_row(3);
  for (const int samples : {-1, 1, most + 1, kMostReferenceFloats}) {
    expect_refused("tracking.samples", -1, [samples](auto& p) {
      add_reference(p);
      p.tracking.samples = samples;
    });
  }
  for (const Real period : {Real(0), Real(-1), kNan, kInfinity}) {
    expect_refused("tracking.period_s", -1, [period](auto& p) {
      add_reference(p);
      p.tracking.period_s = period;
    });
  }
  const int last = 2 * reference_row(3) - 1;
  for (const float value : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    expect_refused("tracking.values", last, [=](auto& p) {
      add_reference(p);
      p.tracking.values[static_cast<std::size_t>(last)] = value;
    });
  }
  expect_refused("tracking.values", reference_row(3), [](auto& p) {
    add_reference(p);
    p.tracking.values[static_cast<std::size_t>(reference_row(3))] = 0.999F;
  });
}

void expect_refused_triad(const std::string& name, TriadErrors EstimationParams::*triad) {
  const std::pair<const char*, Real TriadErrors::*> fields[] = {{"noise", &TriadErrors::noise},
                                                                {"bias", &TriadErrors::bias},
                                                                {"bias_walk", &TriadErrors::bias_walk},
                                                                {"scale_error", &TriadErrors::scale_error},
                                                                {"misalignment", &TriadErrors::misalignment_rad},
                                                                {"range", &TriadErrors::range},
                                                                {"resolution", &TriadErrors::resolution}};
  for (const auto& [field, member] : fields) {
    expect_refused_values("estimation." + name + "." + field, -1, {-1, kNan, kInfinity},
                          [&, m = member](auto& p) -> Real& { return p.estimation.*triad.*m; });
  }
}

TEST(Validate, Estimation) {
  expect_refused_triad("gyro", &EstimationParams::gyro);
  expect_refused_triad("accelerometer", &EstimationParams::accelerometer);
  expect_refused("estimation.measures_contact", -1, [](auto& p) { p.estimation.estimated = true; });
  EXPECT_TRUE(validated([](auto& p) { p.estimation.estimated = p.estimation.measures_contact = true; }).ok());
  for (const int ticks : {-1, 0, 1'000'000'001}) {
    expect_refused("estimation.imu_period_ticks", -1, [ticks](auto& p) { p.estimation.imu_period_ticks = ticks; });
    if (ticks == 0) continue;
    expect_refused("estimation.imu_latency_ticks", -1, [ticks](auto& p) { p.estimation.imu_latency_ticks = ticks; });
    expect_refused("estimation.fix_delay_ticks", -1, [ticks](auto& p) { p.estimation.fix_delay_ticks = ticks; });
  }
  for (int j = 0; j < 3; ++j) {
    expect_refused_values("estimation.accelerometer_position_B_m", -1, {kNan, kInfinity},
                          [j](auto& p) -> Real& { return p.estimation.accelerometer_position_B_m[j]; });
    expect_refused("estimation.accelerometer_position_B_m", -1,
                   [j](auto& p) { p.estimation.accelerometer_position_B_m[j] = Real(1.01) * p.ball.radius_m; });
    expect_refused_values("estimation.initial_angular_velocity", -1, {kNan, kInfinity},
                          [j](auto& p) -> Real& { return p.estimation.initial_angular_velocity_B_radps[j]; });
  }
  for (int j = 0; j < 2; ++j) {
    expect_refused_values("estimation.initial_position_W_m", -1, {kNan, -kInfinity},
                          [j](auto& p) -> Real& { return p.estimation.initial_position_W_m[j]; });
  }
  for (const Real w : {Real(0), Real(1.001), kNan, kInfinity}) {
    expect_refused("estimation.initial_orientation", -1,
                   [w](auto& p) { p.estimation.initial_orientation = Quaternion(w, 0, 0, 0); });
  }
  expect_refused_values("estimation.fix_noise_m", -1, {-1, kNan, kInfinity},
                        [](auto& p) -> Real& { return p.estimation.fix_noise_m; });
  for (std::size_t i : {0u, 7u}) {
    expect_refused_values("estimation.encoder_resolution", -1, {-1, kNan, kInfinity},
                          [i](auto& p) -> Real& { return p.estimation.encoder_resolution[i]; });
  }
}

TEST(Validate, MassesAndRails) {
  expect_refused_values("ball.mass_kg", 2, {0, -1, kNan, kInfinity},
                        [](auto& p) -> Real& { return p.ball.mass_kg[2]; });
  expect_refused_values("ball.rail.radius_m", 1, {0, -1, kNan, kInfinity},
                        [](auto& p) -> Real& { return p.ball.rail[1].radius_m; });
  for (int j = 0; j < 3; ++j) {
    expect_refused_values("ball.rail.origin_B_m", 0, {kNan, kInfinity},
                          [j](auto& p) -> Real& { return p.ball.rail[0].origin_B_m[j]; });
  }
  expect_refused("ball.rail.shape", 0, [](auto& p) { p.ball.rail[0].shape = static_cast<RailShape>(7); });
  for (const Vector3& axis : {Vector3(0, 0, 0), Vector3(0, 1.001, 0), Vector3(kNan, 0, 0), Vector3(kInfinity, 0, 0)}) {
    expect_refused("ball.rail.axis_cos_B", 0, [&](auto& p) { p.ball.rail[0].axis_cos_B = axis; });
    expect_refused("ball.rail.axis_sin_B", 0, [&](auto& p) { p.ball.rail[0].axis_sin_B = axis; });
  }
  expect_refused("ball.rail.axis_sin_B", 1, [](auto& p) { p.ball.rail[1].axis_sin_B = p.ball.rail[1].axis_cos_B; });
}

TEST(Validate, SplineRails) {
  const auto with_spline = [](const Change& change) {
    return [change](ControllerParams& p) {
      p.ball.rail[1] = testing::wavy_spline();
      change(p);
    };
  };
  EXPECT_TRUE(validated(with_spline([](auto&) {})).ok());
  EXPECT_TRUE(validated(with_spline([](auto& p) {
                p.ball.rail[1].piece_count = 1;
                p.ball.rail[1].closed = false;
                ASSERT_TRUE(p.motion[1].set(0, 0, nullptr, 0));  // it is a short one
                p.ball.rail[1].knots[2].position_B_m[0] = kNan;  // beyond the count
              })).ok());
  for (const int count : {0, -1, 65, 1 << 30}) {
    expect_refused("ball.rail.piece_count", 1, with_spline([&](auto& p) { p.ball.rail[1].piece_count = count; }));
  }
  for (const Real length : {0., -1., kNan, kInfinity, 1e308}) {
    expect_refused("ball.rail.piece_length_m", 1,
                   with_spline([&](auto& p) { p.ball.rail[1].piece_length_m = length; }));
  }
  for (const std::size_t knot : {0u, 17u, 64u}) {
    for (int j = 0; j < 3; ++j) {
      expect_refused("ball.rail.knots", 1,
                     with_spline([&](auto& p) { p.ball.rail[1].knots[knot].position_B_m[j] = kNan; }));
      expect_refused("ball.rail.knots", 1,
                     with_spline([&](auto& p) { p.ball.rail[1].knots[knot].d2_B_per_m[j] = kInfinity; }));
    }
  }
  // The seam of a closed one.
  expect_refused("ball.rail.knots", 1, with_spline([](auto& p) { p.ball.rail[1].knots[64].position_B_m[2] += 1e-9; }));
  expect_refused("ball.rail.knots", 1, with_spline([](auto& p) { p.ball.rail[1].knots[0].d2_B_per_m[2] += 1e-9; }));
}

TEST(Validate, MotorsAndMotion) {
  expect_refused_values("motor.steps_per_unit", 1, {0, kNan, kInfinity, -kInfinity},
                        [](auto& p) -> Real& { return p.motor[1].steps_per_unit; });
  expect_refused_values("motor.direction_setup_s", 2, {-1e-9, 1.1e-3, kNan, kInfinity},
                        [](auto& p) -> Real& { return p.motor[2].direction_setup_s; });
  expect_refused_values("motor.max_step_rate_hz", 2, {0, -1, kNan, kInfinity, 1.1e7},
                        [](auto& p) -> Real& { return p.motor[2].max_step_rate_hz; });
  EXPECT_STREQ(validated([](auto& p) { p.motor[2].max_step_rate_hz = 0.5; }).field, "motion speed")
      << "slow, but a rate";
  expect_refused_values("motor.swing", 1, {-1e-9, kNan, kInfinity}, [](auto& p) -> Real& { return p.motor[1].swing; });
  expect_refused_values("motor.max_acceleration", 0, {0, -1, kNan, kInfinity},
                        [](auto& p) -> Real& { return p.motor[0].max_acceleration; });
  expect_refused("motion", 1, [](auto& p) { ASSERT_TRUE(p.motion[1].set(1e14, 0, nullptr, 0)); });
}

// The first start begins where the motion says that the masses stand, so that has to be on the rail.
TEST(Validate, MassesStandBetweenTheirRailsEnds) {
  const auto standing_at = [](Wide position, const Change& rail) {
    return [=](ControllerParams& p) {
      rail(p);
      ASSERT_TRUE(p.motion[1].set(position, 0, nullptr, 0));
    };
  };
  const Change line_with_stops = [](ControllerParams& p) {
    p.ball.rail[1] = line(Vector3(0, 0, -0.1), Vector3::UnitX());
    p.ball.rail[1].lower_end = -0.3;
    p.ball.rail[1].upper_end = 0.2;
  };
  const Change half_line = [=](ControllerParams& p) {
    line_with_stops(p);
    p.ball.rail[1].upper_end = kInfinity;
  };
  const Change open_spline = [](ControllerParams& p) {
    p.ball.rail[1] = testing::wavy_spline();
    p.ball.rail[1].closed = false;
  };
  const Wide length = length_m(testing::wavy_spline());
  for (const Wide position : {-0.3, 0., 0.2}) {
    EXPECT_TRUE(validated(standing_at(position, line_with_stops)).ok()) << position;
    EXPECT_TRUE(validated(standing_at(position, half_line)).ok()) << position;
  }
  for (const Wide position : {0., length}) EXPECT_TRUE(validated(standing_at(position, open_spline)).ok()) << position;
  // Beyond rounding, whose bound is 1e-12 of the rail.
  for (const Wide position : {-0.3 - 1e-9, 0.2 + 1e-9, -5., 5.}) {
    expect_refused("motion", 1, standing_at(position, line_with_stops));
    EXPECT_EQ(validated(standing_at(position, line_with_stops)).value, position);
  }
  expect_refused("motion", 1, standing_at(-0.3 - 1e-9, half_line));
  for (const Wide position : {-1e-9, length + 1e-9}) expect_refused("motion", 1, standing_at(position, open_spline));
  // A line without stops ends where the ball does: sqrt(1 - 0.1^2).
  expect_refused("motion", 1, standing_at(1, [](ControllerParams& p) {
                   p.ball.rail[1] = line(Vector3(0, 0, -0.1), Vector3::UnitX());
                 }));
}

// Not only where it begins: a motion that leaves its rail in any piece, and be it inside one and back, is refused by
// piece, position and end.
TEST(Validate, AMotionStaysBetweenItsRailsEnds) {
  const auto moving = [](Wide sign, Wide first_s) {
    return [=](ControllerParams& p) {
      p.ball.rail[1] = line(Vector3(0, 0, -0.1), Vector3::UnitX());
      p.ball.rail[1].lower_end = -0.3;
      p.ball.rail[1].upper_end = 0.3;
      p.motor[1].max_jerk = 1e3;
      // There for first_s at 1 per s^2, turned round in the second piece, and back where it came from.
      const ProfilePiece pieces[] = {{first_s, sign, sign}, {2 * first_s, -sign, -sign}, {first_s, sign, sign}};
      ASSERT_TRUE(p.motion[1].set(0, 0, pieces, 3));
    };
  };
  // first_s^2 is the farthest, in the middle of the second piece.
  EXPECT_TRUE(validated(moving(1, std::sqrt(0.3))).ok()) << "to the end itself";
  EXPECT_TRUE(validated(moving(-1, std::sqrt(0.3))).ok());
  for (const Wide sign : {1., -1.}) {
    const ParamError error = validated(moving(sign, std::sqrt(0.31)));
    ASSERT_FALSE(error.ok());
    EXPECT_STREQ(error.field, "motion position");
    EXPECT_EQ(error.index, 1);
    EXPECT_EQ(error.piece, 1);
    EXPECT_NEAR(error.value, sign * 0.31, 1e-12);  // rounding
    EXPECT_EQ(error.limit, sign * 0.3);
  }
  // A line without stops ends where the ball does: sqrt(1 - 0.1^2).
  const ParamError out = validated([&](ControllerParams& p) {
    moving(1, 1.0)(p);
    p.ball.rail[1].lower_end = -kInfinity;
    p.ball.rail[1].upper_end = kInfinity;
  });
  EXPECT_STREQ(out.field, "motion position");
  EXPECT_NEAR(out.limit, std::sqrt(0.99), 1e-15);
}

TEST(Validate, AMotionThatBreaksALimitIsNamedByPieceMotorAndValue) {
  expect_refused_values("motor.max_jerk", 2, {0, -1, kNan, kInfinity},
                        [](auto& p) -> Real& { return p.motor[2].max_jerk; });
  const auto refused = [](const char* field, int piece, Real value, Real limit, const Change& change) {
    const ParamError error = validated(change);
    ASSERT_FALSE(error.ok());
    EXPECT_STREQ(error.field, field);
    EXPECT_EQ(error.index, 1);
    EXPECT_EQ(error.piece, piece);
    // A few roundings.
    EXPECT_NEAR(error.value, value, 1e-12 * value);
    EXPECT_NEAR(error.limit, limit, 1e-12 * limit);
  };
  // The paper's: 1 for 0.1 s, then to 0 in 0.1 s. Speed 0.15 after that, jerk 10 in the second piece. The jump to 1 at
  // the start is none of the jerk's.
  EXPECT_TRUE(validated([](auto& p) { p.motor[1].max_jerk = 10; }).ok());
  refused("motion jerk", 1, 10, 9.9, [](auto& p) { p.motor[1].max_jerk = 9.9; });
  EXPECT_TRUE(validated([](auto& p) { p.motor[1].max_acceleration = 1; }).ok());
  refused("motion acceleration", 0, 1, 0.99, [](auto& p) { p.motor[1].max_acceleration = 0.99; });
  const Real per_unit = 3200 / (2 * testing::kPi);
  EXPECT_TRUE(validated([&](auto& p) { p.motor[1].max_step_rate_hz = 0.15 * per_unit; }).ok());
  refused("motion speed", 1, 0.15, 0.149, [&](auto& p) { p.motor[1].max_step_rate_hz = 0.149 * per_unit; });
}

// 32 bursts for n motors, three pulses each, less two for a reversal; at constant speed a tick may have one step more
// than the mean.
TEST(Validate, AStepRateBeyondTheMotorsShareOfTheBurstsIsRefusedWithTheNumber) {
  const int steps[] = {64, 46, 28, 22, 16, 13, 10, 10};
  for (int n = 1; n <= kMaxMasses; ++n) {
    SCOPED_TRACE(n);
    EXPECT_EQ(sure_steps_per_tick(n), steps[n - 1]);
    const Real most_hz = (steps[n - 1] - 1) / 1e-3;
    const auto with_rate = [n](Real rate_hz) {
      return [n, rate_hz](ControllerParams& p) {
        p.ball.mass_count = n;
        for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
          p.ball.mass_kg[i] = p.ball.mass_kg[0];
          p.ball.rail[i] = p.ball.rail[0];
          p.motor[i] = p.motor[0];
          p.motor[i].max_step_rate_hz = 1000;
          p.motion[i] = p.motion[0];
        }
        p.motor[static_cast<std::size_t>(n - 1)].max_step_rate_hz = rate_hz;
      };
    };
    EXPECT_TRUE(validated(with_rate(most_hz)).ok());
    const ParamError error = validated(with_rate(most_hz * (1 + 1e-12)));
    ASSERT_FALSE(error.ok());
    EXPECT_STREQ(error.field, "motor.max_step_rate_hz");
    EXPECT_EQ(error.index, n - 1);
    EXPECT_DOUBLE_EQ(error.limit, most_hz);
  }
}

// To and fro within a tick of 1 ms: each reversal beyond the first takes two pulses from the 28 of a motor's 10 bursts.
TEST(Validate, AMotionWithTooManyReversalsInATickIsRefused) {
  const auto with = [](Real rate_hz, Real offset_s, Real start_radps, int turns = 8) {
    return [=](ControllerParams& p) {
      ProfilePiece pieces[13] = {{offset_s, 0, 0}};
      const Real piece_s = start_radps;  // at 2 rad/s^2 a turn is in its middle
      for (int k = 0; k < turns; ++k) pieces[k + 1] = {piece_s, k % 2 == 0 ? -2.0 : 2.0, k % 2 == 0 ? -2.0 : 2.0};
      ASSERT_TRUE(p.motion[1].set(0, start_radps, pieces, turns + 1));
      p.motor[1].max_step_rate_hz = rate_hz;
    };
  };
  // From 1e-4 rad/s at -2 rad/s^2: it turns in the middle of every piece, eight times, and is back after the last.
  EXPECT_TRUE(validated(with(9000, 1e-4, 1e-4)).ok()) << "10 pulses, one burst each";
  EXPECT_TRUE(validated(with(9000, 1e-4, 7e-5, 12)).ok()) << "as many reversals as fit into a tick at all";
  EXPECT_TRUE(validated(with(13999, 1e-4, 1e-4)).ok()) << "14 pulses, (30 - 14) / 2 = 8 reversals";
  const ParamError error = validated(with(25000, 1e-4, 1e-4));
  ASSERT_FALSE(error.ok());
  EXPECT_STREQ(error.field, "motion reversals in a tick");
  EXPECT_EQ(error.index, 1);
  EXPECT_EQ(error.value, 8);
  EXPECT_EQ(error.limit, 2) << "26 pulses: (30 - 26) / 2";
}

// From 0 at -2 rad/s^2 for 1 ms: with 1e-3 rad/s added it turns once, after 0.5 ms.
TEST(MostReversals, AddedVelocityCountsWithItsSign) {
  const ProfilePiece piece{1e-3, -2, -2};
  Profile profile;
  ASSERT_TRUE(profile.set(0, 0, &piece, 1));
  EXPECT_EQ(most_reversals(profile, 1e-3, 0), 0);
  EXPECT_EQ(most_reversals(profile, 1e-3, 1e-3), 1);
  EXPECT_EQ(most_reversals(profile, 1e-3, -1e-3), 0);
}

TEST(Validate, Governor) {
  const auto governed = [](auto& p) {
    p.governor.on = true;
    p.governor.friction = Real(0.3);
  };
  EXPECT_TRUE(validated(governed).ok());
  EXPECT_TRUE(validated([](auto& p) { p.governor.friction = kNan; }).ok()) << "off: not read";
  EXPECT_TRUE(validated([&](auto& p) {
                governed(p);
                p.governor.friction = kInfinity;
              }).ok());
  const auto refused = [&](const std::string& field, int index, std::initializer_list<Real> values,
                           const std::function<Real&(ControllerParams&)>& place) {
    for (const Real value : values) {
      SCOPED_TRACE(::testing::Message() << field << " = " << value);
      expect_refused(field, index, [&](ControllerParams& p) {
        governed(p);
        p.governor.swing[1] = {Real(10), Real(0.2), Real(0.002), Real(0.03), Real(0.015)};
        place(p) = value;
      });
    }
  };
  refused("governor.friction", -1, {0, -1, kNan}, [](auto& p) -> Real& { return p.governor.friction; });
  refused("governor.min_normal_force_n", -1, {-1, kNan, kInfinity},
          [](auto& p) -> Real& { return p.governor.min_normal_force_n; });
  refused("governor.swing.natural_radps", 1, {-1, kNan, kInfinity},
          [](auto& p) -> Real& { return p.governor.swing[1].natural_radps; });
  refused("governor.swing.damping_ratio", 1, {-1, kNan, kInfinity},
          [](auto& p) -> Real& { return p.governor.swing[1].damping_ratio; });
  refused("governor.swing.microstep", 1, {0, -1, kNan, kInfinity},
          [](auto& p) -> Real& { return p.governor.swing[1].microstep; });
  refused("governor.swing.full_step", 1, {0, -1, kNan, kInfinity},
          [](auto& p) -> Real& { return p.governor.swing[1].full_step; });
  refused("governor.swing.step_error", 1, {-1, kNan, kInfinity},
          [](auto& p) -> Real& { return p.governor.swing[1].step_error; });
  refused("governor.swing.detent", 1, {-1, kNan, kInfinity},
          [](auto& p) -> Real& { return p.governor.swing[1].detent; });
  // sqrt(r / g) = 1 s: a tick may last less than 50 ms.
  expect_refused("control_period_s", -1, [&](auto& p) {
    governed(p);
    p.control_period_s = 0.06;
    for (MotorParams& motor : p.motor) motor.max_step_rate_hz = 100;
  });
}

TEST(Validate, FirstComplaintIsKept) {
  expect_refused("control_period_s", -1, [](auto& p) {
    p.control_period_s = kNan;
    p.ball.radius_m = kNan;
  });
}

}  // namespace
}  // namespace ballast::firmware
