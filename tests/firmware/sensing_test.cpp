// A controller that estimates its attitude: what it needs to be armed, and the faults that come of it.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>

#include "firmware/model/rolling.h"
#include "tests/firmware/paper_ball.h"
#include "tests/firmware/whole_tick.h"

namespace ballast::firmware {
namespace {

constexpr Real kNan = std::numeric_limits<Real>::quiet_NaN();

ControllerParams estimating_params() {
  ControllerParams params = testing::paper_params();
  params.estimation.estimated = params.estimation.measures_contact = true;
  params.estimation.gyro.noise = static_cast<Real>(1e-3);
  params.estimation.accelerometer.noise = static_cast<Real>(1e-2);
  return params;
}

// A ball that is held still and level, and whose sensors read just that. The monitor is content.
class HeldBall {
 public:
  HeldBall() : HeldBall(estimating_params()) {}
  explicit HeldBall(const ControllerParams& params)
      : params_(std::make_unique<ControllerParams>(params)), state_(std::make_unique<ControllerState>()) {
    EXPECT_STREQ(validate(*params_).field, nullptr);
    reset(*params_, *state_);
    in.tick = -100;
    in.sensors.attitude_valid = false;
    in.sensors.accelerometer_B_mps2 = Vector3(0, 0, params_->ball.gravity_mps2);
  }

  // `sampled`: the IMU gives a new sample.
  void tick(OperatorCommand command = OperatorCommand::kNone, bool sampled = true) {
    in.sensors.tick = in.monitor.tick = in.tick;
    if (sampled) {
      ++in.sensors.imu_count;
      in.sensors.imu_tick = in.tick;
      // No two readings of a real sensor are alike.
      const Real noise = static_cast<Real>(1e-5) * static_cast<Real>(in.tick % 2);
      in.sensors.gyro_B_radps = Vector3(noise, -noise, noise);
      in.sensors.accelerometer_B_mps2 = Vector3(noise, -noise, params_->ball.gravity_mps2 + noise);
    }
    in.operator_command = command;
    whole_tick(*params_, *state_, in, out);
    ++in.tick;
  }
  void run() {
    tick();
    tick(OperatorCommand::kArm);
    tick(OperatorCommand::kStart);
    EXPECT_EQ(out.status.mode, Mode::kRunning);
  }

  Inputs in;
  Outputs out;
  [[nodiscard]] const ControllerParams& params() const { return *params_; }
  ControllerState& state() { return *state_; }

 private:
  std::unique_ptr<ControllerParams> params_;
  std::unique_ptr<ControllerState> state_;
};

TEST(Sensing, WithoutAnEstimateItCannotBeArmed) {
  HeldBall ball;
  ball.tick(OperatorCommand::kArm, false);
  EXPECT_EQ(ball.out.status.mode, Mode::kDisarmed);
  EXPECT_EQ(ball.out.status.refusal.reason, Refusal::kNoEstimate);
  EXPECT_EQ(ball.out.status.faults, 0u) << "a filter that has only begun is no fault";
  // Unknown quantities are published as fixed numbers, and N as unknown.
  EXPECT_FALSE(ball.out.status.estimate.valid);
  EXPECT_EQ(ball.out.status.estimate.orientation.w(), 1);
  EXPECT_FALSE(ball.out.status.measured.valid);
  EXPECT_TRUE(std::isnan(ball.out.status.predicted.normal_force_n));
  EXPECT_EQ(ball.out.status.margin, -1);
  ball.tick(OperatorCommand::kArm);
  EXPECT_EQ(ball.out.status.mode, Mode::kArmed);
  EXPECT_EQ(ball.out.status.refusal.reason, Refusal::kNone);
  EXPECT_TRUE(ball.out.status.estimate.valid);
}

// The forces are those of the published estimate; what stands in the message's orientation is not read.
TEST(Sensing, ForcesAreOfThePublishedEstimate) {
  HeldBall ball;
  ball.in.sensors.orientation = Quaternion(kNan, 2, 0, 0);
  ball.run();
  for (int k = 0; k < 50; ++k) ball.tick();
  const ControllerStatus& status = ball.out.status;
  ASSERT_TRUE(status.estimate.valid);
  EXPECT_EQ(status.faults, 0u);
  const RollingForces due = rolling_forces(ball.params().ball, status.estimate.orientation,
                                           status.estimate.angular_velocity_B_radps, ball.state().now);
  EXPECT_EQ(status.predicted.normal_force_n, due.normal_force_n);
  EXPECT_EQ(status.predicted.static_friction_n, due.static_friction_n);
  EXPECT_TRUE(status.measured.valid);
}

// An attitude that is to be sensed and is not valid is a fault of the sensors.
TEST(Sensing, ASensedAttitudeHasToBeValid) {
  HeldBall ball{testing::paper_params()};
  ball.tick(OperatorCommand::kArm);
  EXPECT_EQ(ball.out.status.mode, Mode::kDisarmed);
  EXPECT_EQ(ball.out.status.faults, bit(Fault::kSensorNotFinite));
  ball.in.sensors.attitude_valid = true;
  ball.tick(OperatorCommand::kArm);
  EXPECT_EQ(ball.out.status.mode, Mode::kArmed);
  EXPECT_FALSE(ball.out.status.estimate.valid);
  EXPECT_FALSE(ball.out.status.measured.valid);
}

// The filter is reset, or broken, while the robot runs.
TEST(Sensing, ALostEstimateTrips) {
  for (const bool broken : {false, true}) {
    HeldBall ball;
    ball.run();
    ball.tick();
    if (broken) {
      ball.state().filter.orientation = Quaternion(kNan, kNan, kNan, kNan);
      ball.state().estimate.orientation = Quaternion(kNan, kNan, kNan, kNan);
    } else {
      reset(ball.params().ball, ball.params().estimation, ball.state().filter);
      ball.in.sensors.imu_count = 0;
      ball.state().estimate = {};
    }
    ball.tick(OperatorCommand::kNone, false);
    EXPECT_EQ(ball.out.status.mode, Mode::kTripped) << broken;
    EXPECT_EQ(ball.out.status.faults, bit(Fault::kNoEstimate)) << broken;
    EXPECT_FALSE(ball.out.status.estimate.valid) << "and no NaN is published";
    EXPECT_EQ(ball.out.status.estimate.orientation.w(), 1);
  }
}

// At 0.5 rad, 1 sigma, the tilt says nothing of where masses push.
TEST(Sensing, ATiltThatIsNotKnownTrips) {
  for (const bool known : {true, false}) {
    HeldBall ball;
    ball.run();
    ball.tick();
    const Real sigma_rad = static_cast<Real>(known ? 0.49 : 0.5);
    auto& covariance = ball.state().filter.covariance.xx;
    for (std::size_t j = 0; j < 2; ++j) covariance[j][j] = sigma_rad * sigma_rad;
    ball.tick(OperatorCommand::kNone, false);
    EXPECT_TRUE(ball.state().estimate.valid) << "the filter goes on";
    EXPECT_EQ(ball.state().estimate.tilt_sigma_rad < static_cast<Real>(0.5), known);
    EXPECT_EQ(ball.out.status.mode, known ? Mode::kRunning : Mode::kTripped);
    EXPECT_EQ(ball.out.status.faults, known ? 0u : bit(Fault::kNoEstimate));
    EXPECT_EQ(ball.out.status.estimate.valid, known);
  }
}

// The IMU gives no more samples: the result of the last one stands for 16 periods.
TEST(Sensing, AContactOfLongAgoIsNotPublished) {
  HeldBall ball;
  ball.run();
  ball.tick();
  for (int k = 1; k <= 20; ++k) {
    ball.tick(OperatorCommand::kNone, false);
    EXPECT_EQ(ball.out.status.measured.valid, k <= 16) << k;
  }
  EXPECT_EQ(ball.out.status.measured.normal_force_n, 0);
  ball.tick();
  EXPECT_TRUE(ball.out.status.measured.valid);
}

// The flags are acted on in the tick after, and only while a motion or a move is under way.
TEST(Sensing, MeasuredSlipAndLightContactTripARunningRobot) {
  const struct {
    bool MeasuredContact::*flag;
    Fault fault;
  } cases[] = {{&MeasuredContact::slip_detected, Fault::kSlipMeasured},
               {&MeasuredContact::light_detected, Fault::kLightMeasured}};
  for (const auto& [flag, fault] : cases) {
    HeldBall ball;
    ball.tick();
    ball.tick(OperatorCommand::kArm);
    ball.state().measured.*flag = true;
    ball.tick();
    EXPECT_EQ(ball.out.status.mode, Mode::kArmed) << "nothing moves";
    ball.tick(OperatorCommand::kStart);
    EXPECT_EQ(ball.out.status.mode, Mode::kRunning);
    ball.state().measured.*flag = true;
    ball.tick();
    EXPECT_EQ(ball.out.status.mode, Mode::kTripped);
    EXPECT_EQ(ball.out.status.faults, bit(fault));
    // The stop ends in rest, and a reset releases it.
    for (int k = 0; k < 3000 && !ball.out.status.at_rest; ++k) ball.tick();
    ball.tick(OperatorCommand::kReset);
    EXPECT_EQ(ball.out.status.mode, Mode::kDisarmed);
    EXPECT_EQ(ball.out.status.faults, 0u);
  }
}

}  // namespace
}  // namespace ballast::firmware
