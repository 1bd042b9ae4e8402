// Every member of the controller's parameters, changed in turn by as little as there is: the fingerprint is another,
// and a target that has it so is refused by a host that does not, before anything is armed.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "hal/target/serve.h"
#include "tests/firmware/paper_ball.h"

namespace ballast::hal::target {
namespace {

// The host's parameters, and the pieces from which its motions were built.
struct Robot {
  firmware::ControllerParams params = firmware::testing::paper_params();
  struct Motion {
    firmware::Wide position, velocity;
    std::vector<firmware::ProfilePiece> pieces;
  };
  std::vector<Motion> motions;
  Robot() {
    // A circle, a line with ends, and a spline: between them they use every member of a rail.
    params.ball.rail[1] = firmware::line(firmware::Vector3(0, 0, 0), firmware::Vector3(1, 0, 0));
    params.ball.rail[1].lower_end = -0.9;
    params.ball.rail[1].upper_end = 0.9;
    params.ball.rail[2] = firmware::testing::wavy_spline();
    params.tracking.samples = 2;
    params.tracking.period_s = 0.5;
    for (std::size_t k = 0; k < static_cast<std::size_t>(reference_values(params)); ++k) {
      params.tracking.values[k] = 0.25F * static_cast<float>(k % 7);
    }
    for (std::size_t k = 0; k < 2; ++k) {
      const std::size_t row = k * static_cast<std::size_t>(firmware::reference_row(3));
      for (std::size_t c = 0; c < 4; ++c) params.tracking.values[row + c] = c == k ? 1 : 0;
    }
    for (int i = 0; i < 3; ++i) motions.push_back({0.1, 0, {{0.1, 1, 1}, {0.1, 1, 0}}});
    build();
  }
  void build() {
    for (std::size_t i = 0; i < motions.size(); ++i) {
      const Motion& m = motions[i];
      EXPECT_TRUE(params.motion[i].set(m.position, m.velocity, m.pieces.data(), static_cast<int>(m.pieces.size())));
    }
  }
};

// A microcontroller of which only the link is there: bytes in, bytes out.
struct LinkOnly {
  static constexpr const char* kName = "link_only";
  static constexpr std::uint32_t kCounterHz = 1000000;
  std::vector<std::uint8_t> in, out;
  std::size_t taken = 0;
  bool started = false;

  Status read(std::span<std::uint8_t> bytes, std::size_t& count) {
    count = std::min(bytes.size(), in.size() - taken);
    std::copy_n(in.begin() + static_cast<std::ptrdiff_t>(taken), count, bytes.begin());
    taken += count;
    return count == 0 ? Status::kPeerLost : Status::kOk;
  }
  Status write(std::span<const std::uint8_t> bytes) {
    out.insert(out.end(), bytes.begin(), bytes.end());
    return Status::kOk;
  }
  bool start(const firmware::ControllerParams&, const Commit&) { return started = true; }
  std::uint32_t wait_tick() { return 1; }
  [[nodiscard]] bool tick_due() const { return false; }
  [[nodiscard]] std::uint32_t counter() const { return 0; }
  void load(const firmware::StepCommand&) {}
  void played(PlayedPulses&) const {}
  void kick_watchdog() {}
  void report(EndReport&) const {}

  template <class M>
  void say(const M& message) {
    std::vector<std::uint8_t> bytes(kMaxFrame);
    bytes.resize(encode(message, 0, bytes));
    ASSERT_FALSE(bytes.empty());
    in.insert(in.end(), bytes.begin(), bytes.end());
  }
};

// A target's answer to the parameters that were sent to it.
Verdict verdict_of(const Robot& robot) {
  LinkOnly machine;
  machine.say(robot.params);
  for (std::size_t i = 0; i < static_cast<std::size_t>(robot.params.ball.mass_count); ++i) {
    const auto mass = std::make_unique<MassParams>();
    mass->mass_kg = robot.params.ball.mass_kg[i];
    mass->rail = robot.params.ball.rail[i];
    mass->motor = robot.params.motor[i];
    const Robot::Motion& motion = robot.motions[i];
    mass->initial_position = motion.position;
    mass->initial_velocity = motion.velocity;
    mass->piece_count = static_cast<std::int32_t>(motion.pieces.size());
    std::copy(motion.pieces.begin(), motion.pieces.end(), mass->pieces.begin());
    machine.say(*mass);
  }
  const auto part = std::make_unique<ReferencePart>();
  const int values = reference_values(robot.params);
  for (int first = 0; first < values; first += part->count) {
    get_reference(robot.params.tracking, first, values, *part);
    machine.say(*part);
  }
  machine.say(Commit{});
  const auto link = std::make_unique<Link<LinkOnly>>(machine);
  const auto params = std::make_unique<firmware::ControllerParams>();
  static_cast<void>(take_params(machine, *link, Identity{}, *params, [] {}));
  // After its Hello.
  Frame frame;
  const FrameResult hello = decode_frame(machine.out, frame);
  EXPECT_EQ(hello.error, FrameError::kNone);
  Verdict verdict;
  EXPECT_EQ(decode_frame(std::span(machine.out).subspan(hello.size), frame).error, FrameError::kNone);
  EXPECT_TRUE(decode(frame, verdict));
  EXPECT_EQ(machine.started, verdict.acceptance == Acceptance::kAccepted);
  return verdict;
}

// As little as a number can change.
void nudge(double& x) { x = std::isinf(x) ? 1 : std::nextafter(x, std::numeric_limits<double>::infinity()); }
void nudge(std::int64_t& x) { ++x; }
void nudge(int& x) { ++x; }
void nudge(bool& x) { x = !x; }

struct Change {
  std::string what;
  std::function<void(Robot&)> make;
};

// The members are taken apart by structured bindings: of a member more or less than named here no binding compiles.
std::vector<Change> changes() {
  std::vector<Change> list;
  const auto add = [&list](const std::string& what, std::function<void(Robot&)> make) {
    list.push_back({what, std::move(make)});
  };
  // `find`: the member of a robot.
  const auto number = [&add](const std::string& what, auto find) { add(what, [find](Robot& r) { nudge(find(r)); }); };
  const auto vector = [&add](const std::string& what, auto find) {
    for (int j = 0; j < 3; ++j) {
      add(what + '[' + std::to_string(j) + ']', [find, j](Robot& r) { nudge(find(r)[j]); });
    }
  };

  const Robot robot;
  {
    [[maybe_unused]] const auto& [scenario_id, control_period, timer, friction, sensors, monitor, ball, estimation,
                                  motor, motion, tracking, governor] = robot.params;
    number(
        "scenario_id", [](Robot & r) -> auto& { return r.params.scenario_id; });
    number(
        "control_period_s", [](Robot & r) -> auto& { return r.params.control_period_s; });
    number(
        "timer_frequency_hz", [](Robot & r) -> auto& { return r.params.timer_frequency_hz; });
    number(
        "static_friction", [](Robot & r) -> auto& { return r.params.static_friction; });
    number(
        "sensor_stale_ticks", [](Robot & r) -> auto& { return r.params.sensor_stale_ticks; });
    number(
        "monitor_stale_ticks", [](Robot & r) -> auto& { return r.params.monitor_stale_ticks; });
  }
  {
    [[maybe_unused]] const auto& [on, friction, friction_use, min_normal_force, swing, belief_error] =
        robot.params.governor;
    [[maybe_unused]] const auto& [mass_share, center_of_mass] = belief_error;
    [[maybe_unused]] const auto& [natural, damping, microstep, full_step, step_error, detent] = swing[0];
    number(
        "governor.on", [](Robot & r) -> auto& { return r.params.governor.on; });
    number(
        "governor.friction", [](Robot & r) -> auto& { return r.params.governor.friction; });
    number(
        "governor.friction_use", [](Robot & r) -> auto& { return r.params.governor.friction_use; });
    number(
        "governor.min_normal_force_n", [](Robot & r) -> auto& { return r.params.governor.min_normal_force_n; });
    number(
        "governor.belief_error.mass_share",
        [](Robot & r) -> auto& { return r.params.governor.belief_error.mass_share; });
    number(
        "governor.belief_error.center_of_mass_m",
        [](Robot & r) -> auto& { return r.params.governor.belief_error.center_of_mass_m; });
    for (std::size_t i : {0, 7}) {
      using Swing = firmware::MotorSwing;
      const auto of = [&number, i](const std::string& what, firmware::Real Swing::*member) {
        number(
            "governor.swing." + what, [=](Robot & r) -> auto& { return r.params.governor.swing[i].*member; });
      };
      of("natural_radps", &Swing::natural_radps);
      of("damping_ratio", &Swing::damping_ratio);
      of("microstep", &Swing::microstep);
      of("full_step", &Swing::full_step);
      of("step_error", &Swing::step_error);
      of("detent", &Swing::detent);
    }
  }
  {
    [[maybe_unused]] const auto& [estimated, measures, period, latency, gyro, accelerometer, position, delay, fix,
                                  encoders, resolution, orientation, rate, place] = robot.params.estimation;
    const auto of = [&number](const std::string& what, auto find) {
      number(
          "estimation." + what, [find](Robot & r) -> auto& { return find(r.params.estimation); });
    };
    using Estimation = firmware::EstimationParams;
    of(
        "estimated", [](Estimation & e) -> auto& { return e.estimated; });
    of(
        "measures_contact", [](Estimation & e) -> auto& { return e.measures_contact; });
    of(
        "imu_period_ticks", [](Estimation & e) -> auto& { return e.imu_period_ticks; });
    of(
        "imu_latency_ticks", [](Estimation & e) -> auto& { return e.imu_latency_ticks; });
    for (const bool of_gyro : {true, false}) {
      const auto triad = [of_gyro](Estimation& e) -> firmware::TriadErrors& {
        return of_gyro ? e.gyro : e.accelerometer;
      };
      const std::string name = of_gyro ? "gyro." : "accelerometer.";
      [[maybe_unused]] const auto& [noise, bias, walk, scale, axes, range, step] = of_gyro ? gyro : accelerometer;
      of(
          name + "noise", [triad](Estimation & e) -> auto& { return triad(e).noise; });
      of(
          name + "bias", [triad](Estimation & e) -> auto& { return triad(e).bias; });
      of(
          name + "bias_walk", [triad](Estimation & e) -> auto& { return triad(e).bias_walk; });
      of(
          name + "scale_error", [triad](Estimation & e) -> auto& { return triad(e).scale_error; });
      of(
          name + "misalignment_rad", [triad](Estimation & e) -> auto& { return triad(e).misalignment_rad; });
      of(
          name + "range", [triad](Estimation & e) -> auto& { return triad(e).range; });
      of(
          name + "resolution", [triad](Estimation & e) -> auto& { return triad(e).resolution; });
    }
    vector(
        "estimation.accelerometer_position_B_m",
        [](Robot & r) -> auto& { return r.params.estimation.accelerometer_position_B_m; });
    of(
        "fix_delay_ticks", [](Estimation & e) -> auto& { return e.fix_delay_ticks; });
    of(
        "fix_noise_m", [](Estimation & e) -> auto& { return e.fix_noise_m; });
    of(
        "has_encoders", [](Estimation & e) -> auto& { return e.has_encoders; });
    for (std::size_t i = 0; i < resolution.size(); ++i) {
      of(
          "encoder_resolution[" + std::to_string(i) + ']', [i](Estimation & e) -> auto& {
            return e.encoder_resolution[i];
          });
    }
    for (int j = 0; j < 4; ++j) {
      of(
          "initial_orientation[" + std::to_string(j) + ']', [j](Estimation & e) -> auto& {
            return e.initial_orientation.coeffs()[j];
          });
    }
    vector(
        "estimation.initial_angular_velocity",
        [](Robot & r) -> auto& { return r.params.estimation.initial_angular_velocity_B_radps; });
    for (int j = 0; j < 2; ++j) {
      of(
          "initial_position_W_m[" + std::to_string(j) + ']', [j](Estimation & e) -> auto& {
            return e.initial_position_W_m[j];
          });
    }
  }
  {
    [[maybe_unused]] const auto& [samples, period, holds, values] = robot.params.tracking;
    add("tracking.samples", [](Robot& r) { r.params.tracking.samples = 3; });
    number(
        "tracking.period_s", [](Robot & r) -> auto& { return r.params.tracking.period_s; });
    number(
        "tracking.holds", [](Robot & r) -> auto& { return r.params.tracking.holds; });
    for (std::size_t k = 0; k < static_cast<std::size_t>(reference_values(robot.params)); ++k) {
      add("tracking.values[" + std::to_string(k) + ']', [k](Robot& r) {
        float& value = r.params.tracking.values[k];
        value = std::nextafter(value, 2.0F);
      });
    }
  }
  {
    [[maybe_unused]] const auto& [radius, gravity, shell, inertia, center, force, down, resistance, spin, creep, count,
                                  mass, rail] = robot.params.ball;
    number(
        "ball.radius_m", [](Robot & r) -> auto& { return r.params.ball.radius_m; });
    number(
        "ball.gravity_mps2", [](Robot & r) -> auto& { return r.params.ball.gravity_mps2; });
    number(
        "ball.shell_mass_kg", [](Robot & r) -> auto& { return r.params.ball.shell_mass_kg; });
    vector(
        "ball.inertia_kgm2", [](Robot & r) -> auto& { return r.params.ball.inertia_kgm2; });
    vector(
        "ball.center_of_mass_B_m", [](Robot & r) -> auto& { return r.params.ball.center_of_mass_B_m; });
    vector(
        "ball.external_force_W_n", [](Robot & r) -> auto& { return r.params.ball.external_force_W_n; });
    vector(
        "ball.down_W", [](Robot & r) -> auto& { return r.params.ball.down_W; });
    number(
        "ball.rolling_resistance", [](Robot & r) -> auto& { return r.params.ball.rolling_resistance; });
    number(
        "ball.spin_friction_m", [](Robot & r) -> auto& { return r.params.ball.spin_friction_m; });
    number(
        "ball.creep_radps", [](Robot & r) -> auto& { return r.params.ball.creep_radps; });
    add("ball.mass_count", [](Robot& r) {
      --r.params.ball.mass_count;
      r.motions.pop_back();
    });
  }
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string of = " of mass " + std::to_string(i);
    number(
        "ball.mass_kg" + of, [i](Robot & r) -> auto& { return r.params.ball.mass_kg[i]; });
    {
      [[maybe_unused]] const auto& [shape, origin, axis_cos, axis_sin, radius, lower, upper, closed, pieces, length,
                                    knots] = robot.params.ball.rail[i];
      const auto rail = [i](Robot& r) -> firmware::Rail& { return r.params.ball.rail[i]; };
      add("rail.shape" + of, [rail](Robot& r) {
        using firmware::RailShape;
        rail(r).shape = rail(r).shape == RailShape::kLine ? RailShape::kCircle : RailShape::kLine;
      });
      vector(
          "rail.origin_B_m" + of, [rail](Robot & r) -> auto& { return rail(r).origin_B_m; });
      vector(
          "rail.axis_cos_B" + of, [rail](Robot & r) -> auto& { return rail(r).axis_cos_B; });
      vector(
          "rail.axis_sin_B" + of, [rail](Robot & r) -> auto& { return rail(r).axis_sin_B; });
      number(
          "rail.radius_m" + of, [rail](Robot & r) -> auto& { return rail(r).radius_m; });
      add("rail.lower_end" + of, [rail](Robot& r) {
        firmware::Real& end = rail(r).lower_end;
        end = std::isinf(end) ? -1 : std::nextafter(end, -2.0);
      });
      number(
          "rail.upper_end" + of, [rail](Robot & r) -> auto& { return rail(r).upper_end; });
      number(
          "rail.closed" + of, [rail](Robot & r) -> auto& { return rail(r).closed; });
      add("rail.piece_count" + of,
          [rail](Robot& r) { rail(r).piece_count += rail(r).piece_count == firmware::kMaxRailPieces ? -1 : 1; });
      number(
          "rail.piece_length_m" + of, [rail](Robot & r) -> auto& { return rail(r).piece_length_m; });
      if (shape == firmware::RailShape::kSpline) {
        [[maybe_unused]] const auto& [position, d2] = knots[0];
        for (std::size_t k = 0; k <= static_cast<std::size_t>(pieces); ++k) {
          const std::string knot = "rail.knots[" + std::to_string(k) + "].";
          vector(
              knot + "position_B_m" + of, [=](Robot & r) -> auto& { return rail(r).knots[k].position_B_m; });
          vector(
              knot + "d2_B_per_m" + of, [=](Robot & r) -> auto& { return rail(r).knots[k].d2_B_per_m; });
        }
      }
    }
    {
      [[maybe_unused]] const auto& [steps, rate, acceleration, jerk, setup, swing] = robot.params.motor[i];
      const auto motor = [i](Robot& r) -> firmware::MotorParams& { return r.params.motor[i]; };
      number(
          "motor.steps_per_unit" + of, [motor](Robot & r) -> auto& { return motor(r).steps_per_unit; });
      number(
          "motor.max_step_rate_hz" + of, [motor](Robot & r) -> auto& { return motor(r).max_step_rate_hz; });
      number(
          "motor.max_acceleration" + of, [motor](Robot & r) -> auto& { return motor(r).max_acceleration; });
      number(
          "motor.max_jerk" + of, [motor](Robot & r) -> auto& { return motor(r).max_jerk; });
      number(
          "motor.direction_setup_s" + of, [motor](Robot & r) -> auto& { return motor(r).direction_setup_s; });
      number(
          "motor.swing" + of, [motor](Robot & r) -> auto& { return motor(r).swing; });
    }
    // A motion is what it was built from.
    const auto motion = [&](const std::string& what, auto change) {
      add("motion: " + what + of, [i, change](Robot& r) {
        change(r.motions[i]);
        r.build();
      });
    };
    motion("position", [](Robot::Motion& m) { nudge(m.position); });
    motion("velocity", [](Robot::Motion& m) { m.velocity = 1e-12; });
    for (std::size_t k = 0; k < 2; ++k) {
      [[maybe_unused]] const auto& [duration, start, end] = robot.motions[i].pieces[k];
      const std::string piece = "piece " + std::to_string(k);
      motion(piece + " duration", [k](Robot::Motion& m) { nudge(m.pieces[k].duration_s); });
      motion(piece + " start", [k](Robot::Motion& m) { nudge(m.pieces[k].acceleration_start); });
      motion(piece + " end", [k](Robot::Motion& m) { m.pieces[k].acceleration_end += 1e-12; });
    }
    motion("one piece less", [](Robot::Motion& m) { m.pieces.pop_back(); });
  }
  return list;
}

// As tools/qemu/qemu_firmware.cpp judges: accepted over there, and the same over there as here.
bool would_run(const Verdict& verdict, const Robot& host) {
  return verdict.acceptance == Acceptance::kAccepted && verdict.fingerprint == fingerprint(host.params);
}

TEST(TargetParams, ATargetWithTheSameRuns) {
  const auto robot = std::make_unique<Robot>();
  const Verdict verdict = verdict_of(*robot);
  EXPECT_TRUE(would_run(verdict, *robot)) << verdict.field.c_str() << ' ' << verdict.allowed.c_str();
}

TEST(TargetParams, AnyMemberThatDiffersIsSeenAndRefused) {
  const auto host = std::make_unique<Robot>();
  const std::uint32_t ours = fingerprint(host->params);
  int accepted_there = 0;
  for (const Change& change : changes()) {
    SCOPED_TRACE(change.what);
    const auto other = std::make_unique<Robot>();
    change.make(*other);
    EXPECT_NE(fingerprint(other->params), ours);
    const Verdict verdict = verdict_of(*other);
    EXPECT_FALSE(would_run(verdict, *host));
    // It is the change that is seen, not the way there.
    EXPECT_EQ(verdict.fingerprint, fingerprint(other->params));
    accepted_there += verdict.acceptance == Acceptance::kAccepted ? 1 : 0;
  }
  EXPECT_GT(accepted_there, 100) << "most are as good as the host's, so that only the fingerprint tells";
}

}  // namespace
}  // namespace ballast::hal::target
