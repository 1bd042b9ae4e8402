// A controller and a ball that rolls by the firmware's closed forms, with masses exactly where they are commanded and
// exact sensors. One Runge-Kutta step per control tick; accelerations are linear in a tick.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "firmware/governor/backup.h"
#include "firmware/governor/turning.h"
#include "firmware/model/rolling.h"
#include "tests/firmware/paper_ball.h"
#include "tests/firmware/whole_tick.h"

namespace ballast::firmware::testing {

class GovernedBall {
 public:
  explicit GovernedBall(const ControllerParams& params, std::int64_t first_tick = -2)
      : params_(std::make_unique<ControllerParams>(params)), state_(std::make_unique<ControllerState>()) {
    const ParamError error = validate(*params_);
    EXPECT_TRUE(error.ok()) << error.field;
    reset(*params_, *state_);
    set_truth(params.ball, params.governor.friction);
    ball.orientation = params.estimation.initial_orientation;
    ball.angular_velocity_B_radps = params.estimation.initial_angular_velocity_B_radps;
    ball.position_W_m = params.estimation.initial_position_W_m;
    for (int i = 0; i < params.ball.mass_count; ++i) {
      points_[static_cast<std::size_t>(i)] = {params.motion[static_cast<std::size_t>(i)].at(0).position, 0, 0};
    }
    in.tick = first_tick;
  }

  // The ball that rolls, and the friction that it is judged by. Without it they are the believed ones.
  void set_truth(const BallParams& truth, Real friction) {
    truth_ = truth;
    friction_ = friction;
  }

  // A control tick. Before tick 0 the ball is held.
  void tick(const OperatorInput& command = OperatorCommand::kNone) {
    in.sensors.tick = in.monitor.tick = in.tick;
    in.sensors.attitude_valid = true;
    in.sensors.orientation = ball.orientation;
    in.sensors.gyro_B_radps = ball.angular_velocity_B_radps;
    in.operator_command = command;
    whole_tick(*params_, *state_, in, out);
    const PerMass<ProfilePoint> start = points_;
    points_ = out.status.next;
    if (in.tick >= 0) {
      judge(start, 0);
      roll(start);
      judge(start, params_->control_period_s);
    }
    ++in.tick;
  }
  void start() {
    tick(OperatorCommand::kArm);
    tick(OperatorCommand::kStart);
  }
  void run_until(std::int64_t end_tick) {
    while (in.tick < end_tick) tick();
  }
  // Ball and masses at the start of the tick.
  [[nodiscard]] RobotState robot() const {
    RobotState robot = ball;
    for (int i = 0; i < params_->ball.mass_count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      robot.mass_position[k] = static_cast<Real>(points_[k].position);
      robot.mass_velocity[k] = static_cast<Real>(points_[k].velocity);
    }
    return robot;
  }
  [[nodiscard]] const ControllerParams& params() const { return *params_; }
  ControllerState& state() { return *state_; }

  Inputs in;
  Outputs out;
  RobotState ball;    // its mass_ fields are not used
  Real most_use = 0;  // f_s / (kappa N) at both ends of all ticks; infinite where N <= 0
  std::int64_t most_use_tick = 0;
  int bent = 0, backup = 0;
  Real largest_bend = 0;

 private:
  // The cubic of a tick, at a time after its start.
  [[nodiscard]] MassMotion masses_at(const PerMass<ProfilePoint>& start, Wide s) const {
    const Wide h = params_->control_period_s;
    MassMotion masses;
    for (int i = 0; i < params_->ball.mass_count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const ProfilePoint& p = start[k];
      // The acceleration jumps where a motion begins: the cubic has that of the end's velocity.
      const Wide begin = 2 * (points_[k].velocity - p.velocity) / h - points_[k].acceleration;
      const Wide jerk = (points_[k].acceleration - begin) / h;
      masses.position[k] = static_cast<Real>(p.position + s * (p.velocity + s * (begin / 2 + s * jerk / 6)));
      masses.velocity[k] = static_cast<Real>(p.velocity + s * (begin + s * jerk / 2));
      masses.acceleration[k] = static_cast<Real>(begin + s * jerk);
    }
    return masses;
  }
  void judge(const PerMass<ProfilePoint>& start, Wide s) {
    const RollingForces f =
        rolling_forces(truth_, ball.orientation, ball.angular_velocity_B_radps, masses_at(start, s));
    const Real use = use_of(friction_, f.static_friction_n, f.normal_force_n);
    if (use > most_use) {
      most_use = use;
      most_use_tick = in.tick;
    }
    if (s > 0) return;
    bent += out.status.governor.bent ? 1 : 0;
    backup += out.status.governor.backup ? 1 : 0;
    for (int i = 0; i < params_->ball.mass_count && out.status.governor.governs; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Wide planned = params_->motion[k].at(static_cast<Wide>(in.tick + 1) * params_->control_period_s).position;
      largest_bend = std::max(largest_bend, static_cast<Real>(std::fabs(points_[k].position - planned)));
    }
  }
  void roll(const PerMass<ProfilePoint>& start) {
    const auto h = static_cast<Real>(params_->control_period_s);
    const auto rate = [&](const RobotState& x, Real s) {
      const RollingForces f =
          rolling_forces(truth_, x.orientation, x.angular_velocity_B_radps, masses_at(start, Wide{s}));
      return turning_rate(x.orientation, x.angular_velocity_B_radps, f.angular_acceleration_B_radps2, truth_.radius_m);
    };
    const auto moved = [&](const TurningRate& k, Real s) {
      RobotState x = ball;
      TurningRate change;
      change.add(k, s);
      apply(change, x);
      return x;
    };
    const TurningRate a = rate(ball, 0), b = rate(moved(a, h / 2), h / 2), c = rate(moved(b, h / 2), h / 2),
                      d = rate(moved(c, h), h);
    TurningRate mean;
    mean.add(a, Real(1) / 6), mean.add(b, Real(1) / 3), mean.add(c, Real(1) / 3), mean.add(d, Real(1) / 6);
    ball = moved(mean, h);
  }

  std::unique_ptr<ControllerParams> params_;
  std::unique_ptr<ControllerState> state_;
  BallParams truth_;
  Real friction_ = 0;
  PerMass<ProfilePoint> points_{};  // of the masses at the start of the tick
};

}  // namespace ballast::firmware::testing
