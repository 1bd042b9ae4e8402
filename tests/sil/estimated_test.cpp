// Runs in which the firmware estimates its attitude, and the errors of the estimate that a run reports.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>

#include "tests/sil/kept_laps.h"
#include "tools/sil/estimate_watch.h"
#include "tools/summary/summary.h"
#include "tools/summary/summary_tree.h"

namespace ballast::sil {
namespace {

sim::Scenario load(const std::vector<std::string>& overrides) {
  const auto found = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/desk_ball.toml", overrides);
  for (const auto& error : found.errors) ADD_FAILURE() << to_string(error);
  return found.scenario;
}

struct OfScenario : Rolled {
  sim::Scenario scenario;
};

OfScenario roll(const std::vector<std::string>& overrides) {
  const sim::Scenario scenario = load(overrides);
  OfScenario run{sil::roll(scenario), scenario};
  EXPECT_EQ(run.result.status, hal::Status::kOk) << run.result.trouble;
  return run;
}

std::vector<std::string> with(std::vector<std::string> more) {
  more.insert(more.begin(), {"duration=0.6", "run.hold=0.5", "sensors.preset=bmi088_calibrated"});
  return more;
}

double weight_n(const sim::Scenario& scenario) {
  double mass_kg = scenario.ball.mass_kg;
  for (const sim::Mass& mass : scenario.masses) mass_kg += mass.mass_kg;
  return mass_kg * scenario.gravity_mps2;
}

// The plant's equations at the attitude that the controller senses or has published, against the firmware's closed
// forms: the greatest difference of N and f_s over a run.
double apart_n(const std::vector<Lap>& laps, bool sensed = false) {
  double apart = 0;
  int compared = 0;
  for (std::size_t k = 1; k < laps.size(); ++k) {
    const contact_t& contact = laps[k].plant.contact;
    const controller_status_t& status = laps[sensed ? k : k - 1].answer->status;
    EXPECT_EQ(contact.commanded_tick, sensed ? contact.tick : contact.tick - 1);
    if (contact.tick < 0) {
      EXPECT_TRUE(std::isnan(contact.commanded_normal_force_n)) << "the countdown";
      continue;
    }
    if (contact.last != 0 && std::isnan(contact.commanded_normal_force_n)) continue;
    EXPECT_EQ(contact.commanded_tick, status.tick);
    apart = std::max({apart, std::abs(contact.commanded_normal_force_n - status.normal_force_n),
                      std::abs(contact.commanded_static_friction_n - status.static_friction_n)});
    ++compared;
  }
  EXPECT_GT(compared, 500);
  return apart;
}

// A thousand roundings of forces as large as the weight: the two derivations share no line.
constexpr double kRounding = 1e-12;

TEST(EstimatedRun, PlantAndControllerAgreeAtTheEstimate) {
  for (const auto& more : {std::vector<std::string>{},
                           {"sensors.latency=0.004", "sensors.rate=500"},
                           {"believed.ball.mass=1.0", "believed.surface.slope.angle=0.02"}}) {
    const OfScenario rolled = roll(with(more));
    EXPECT_EQ(rolled.result.end_reason, EndReason::kCompleted);
    EXPECT_EQ(rolled.result.trip.tripped, 0);
    EXPECT_LE(apart_n(rolled.laps), kRounding * weight_n(rolled.scenario));
  }
}

// The attitude is sensed, and the angular velocity read from a gyro that errs: the plant's equations take its reading.
TEST(EstimatedRun, PlantAndControllerAgreeAtASensedAttitudeAndANoisyGyro) {
  for (const auto& more : {std::vector<std::string>{"sensors.gyro.noise_density=0.01"},
                           {"sensors.latency=0.004", "sensors.rate=500"},
                           {"believed.ball.mass=1.0"}}) {
    std::vector<std::string> set = with(more);
    set.emplace_back("sensors.attitude=sensed");
    const OfScenario rolled = roll(set);
    EXPECT_EQ(rolled.result.end_reason, EndReason::kCompleted);
    EXPECT_EQ(rolled.result.trip.tripped, 0);
    EXPECT_LE(apart_n(rolled.laps, true), kRounding * weight_n(rolled.scenario));
  }
}

TEST(EstimatedRun, SaysThatThereIsNoEstimate) {
  for (const char* saturated : {"sensors.gyro.bias=1000", "sensors.accelerometer.range=5"}) {
    const Rolled rolled = sil::roll(load(with({"sensors.gyro.range=30", saturated})));
    EXPECT_EQ(rolled.result.status, hal::Status::kPeerLost) << saturated;
    EXPECT_NE(rolled.result.trouble.find("no estimate of its attitude"), std::string::npos) << rolled.result.trouble;
  }
}

TEST(EstimatedRun, IsWarnedOfSensorsThatTellNoAttitude) {
  const auto warned = [](const std::vector<std::string>& overrides) {
    std::string keys;
    const auto found = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/desk_ball.toml", with(overrides));
    for (const auto& warning : found.warnings) keys += warning.key + " ";
    return keys;
  };
  EXPECT_EQ(warned({}), "");
  EXPECT_EQ(warned({"sensors.gyro.bias=100"}), "sensors.gyro.bias ");
  EXPECT_EQ(warned({"sensors.gyro.noise_density=1e10"}), "sensors.gyro.noise_density ");
  EXPECT_EQ(warned({"sensors.accelerometer.range=5"}), "sensors.accelerometer.range ");
  EXPECT_EQ(warned({"sensors.accelerometer.range=5", "sensors.attitude=sensed"}), "");
  // At this attitude each axis reads g / sqrt(3).
  EXPECT_EQ(warned({"sensors.accelerometer.range=7", "sensors.accelerometer.bias=0",
                    "initial.orientation=[0.8880738, 0.3250576, -0.3250576, 0]"}),
            "");
}

// Nothing that the firmware could use tells it the attitude, and no step depends on its estimate.
TEST(EstimatedRun, TheAttitudeIsNotInTheMessage) {
  const OfScenario estimated = roll(with({})), sensed = roll(with({"sensors.attitude=sensed"}));
  ASSERT_EQ(estimated.laps.size(), sensed.laps.size());
  for (std::size_t k = 0; k < estimated.laps.size(); ++k) {
    const PlantMessages &a = estimated.laps[k].plant, &b = sensed.laps[k].plant;
    ASSERT_EQ(a.sensors.attitude_valid, 0);
    ASSERT_EQ(b.sensors.attitude_valid, 1);
    ASSERT_TRUE(std::equal(std::begin(kNoAttitude), std::end(kNoAttitude), a.sensors.orientation));
    ASSERT_TRUE(std::ranges::equal(a.sensors.gyro_B_radps, b.sensors.gyro_B_radps));
    ASSERT_TRUE(std::ranges::equal(a.state.orientation, b.state.orientation));
    ASSERT_EQ(b.contact.commanded_tick, b.contact.tick);
    const controller_status_t &of_a = estimated.laps[k].answer->status, &of_b = sensed.laps[k].answer->status;
    ASSERT_EQ(of_a.estimate_valid, 1) << k;
    ASSERT_EQ(of_b.estimate_valid, 0);
    ASSERT_EQ(of_b.estimated_orientation[0], 1);
    ASSERT_EQ(of_b.tilt_sigma_rad, 0);
  }
  EXPECT_TRUE(estimated.result.estimate);
  EXPECT_FALSE(sensed.result.estimate);
  EXPECT_TRUE(summary_tree(sensed.scenario, sensed.result)["estimate"].is_null());
  EXPECT_EQ(summary_text(sensed.scenario, sensed.result, "out").find("  estimate "), std::string::npos);
}

// Half a second of rest and a gentle start: the bars are those of issue-wide figures, far above what a calibrated part
// leaves in this time.
TEST(EstimatedRun, TheSummaryHasTheErrors) {
  const OfScenario rolled = roll(with({}));
  const auto json = summary_tree(rolled.scenario, rolled.result)["estimate"];
  ASSERT_TRUE(json.is_object());
  const double degree = std::acos(-1.0) / 180;
  EXPECT_GT(json["tilt_rms"].get<double>(), 0);
  EXPECT_LT(json["tilt_rms"].get<double>(), degree);
  EXPECT_LT(json["yaw_error"].get<double>(), degree);
  EXPECT_LT(json["gyro_bias_error"].get<double>(), 0.2 * degree);
  EXPECT_LT(json["position_rms"].get<double>(), 0.01);
  EXPECT_TRUE(json["friction_rms"].is_number());
  EXPECT_GE(json["friction_error"].get<double>(), json["friction_rms"].get<double>());
  const std::string text = summary_text(rolled.scenario, rolled.result, "out");
  EXPECT_NE(text.find("  estimate    at the end ("), std::string::npos) << text;
  EXPECT_NE(text.find("in truth ("), std::string::npos) << text;
}

// Prescribed masses have no controller, which could estimate.
TEST(EstimatedRun, APrescribedRunEstimatesNothing) {
  const sim::Scenario scenario = load(with({"run.actuation=prescribed"}));
  const RunResult result = sil::roll(scenario).result;
  EXPECT_EQ(result.end_reason, EndReason::kCompleted);
  EXPECT_FALSE(result.estimate);
}

// Messages of one tick with a known difference between truth and estimate.
struct KnownErrors {
  contact_t contact{};
  plant_state_t truth{};
  controller_status_t status{};
  Eigen::Quaterniond real = Eigen::Quaterniond(0.7, 0.1, -0.5, 0.5).normalized();

  KnownErrors() {
    status.estimate_valid = 1;
    set(truth.orientation, real);
    estimate(Eigen::Quaterniond::Identity());
  }
  // The estimate is the truth, turned by this in space.
  void estimate(const Eigen::Quaterniond& turn_W) { set(status.estimated_orientation, turn_W * real); }
  static void set(double (&to)[4], const Eigen::Quaterniond& q) {
    to[0] = q.w();
    to[1] = q.x();
    to[2] = q.y();
    to[3] = q.z();
  }
};

Eigen::Quaterniond turn(double angle_rad, const Eigen::Vector3d& axis) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, axis));
}

TEST(EstimateWatch, TellsTiltFromYaw) {
  const auto watched = [](const sim::Scenario& scenario, const Eigen::Quaterniond& turn_W) {
    KnownErrors known;
    known.estimate(turn_W);
    EstimateWatch watch(scenario);
    watch.observe(known.contact, known.truth, known.status, Eigen::Vector3d::Zero());
    return *watch.result();
  };
  const sim::Scenario level = load({});
  for (const double angle : {1e-9, 0.3, -0.3, 3.0}) {
    const EstimateErrors yawed = watched(level, turn(angle, Eigen::Vector3d::UnitZ()));
    EXPECT_NEAR(yawed.yaw_error_rad, std::abs(angle), 1e-15);
    EXPECT_NEAR(yawed.tilt_rms_rad, 0, 1e-15);
    const EstimateErrors tilted = watched(level, turn(angle, Eigen::Vector3d(0.6, 0.8, 0)));
    EXPECT_NEAR(tilted.tilt_rms_rad, std::abs(angle), 1e-15);
    EXPECT_NEAR(tilted.yaw_error_rad, 0, 1e-15);
  }
  // A right attitude on a floor that is believed to slope puts gravity wrong by the slope.
  const sim::Scenario believed = load({"believed.surface.slope.angle=0.1"});
  EXPECT_NEAR(watched(believed, Eigen::Quaterniond::Identity()).tilt_rms_rad, 0.1, 1e-15);
}

TEST(EstimateWatch, KeepsRootMeanSquaresAndTheEnd) {
  EstimateWatch watch(load({}));
  EXPECT_FALSE(watch.result());
  KnownErrors known;
  known.status.estimate_valid = 0;
  watch.observe(known.contact, known.truth, known.status, Eigen::Vector3d::Zero());
  EXPECT_FALSE(watch.result()) << "no estimate";
  known.status.estimate_valid = 1;
  known.status.estimated_position_W_m[0] = 3;
  known.contact.mu_required = 0.2;
  known.status.measured_mu_required = 0.9;  // not valid
  watch.observe(known.contact, known.truth, known.status, Eigen::Vector3d(0, 0, 0.5));
  EXPECT_FALSE(watch.result()->friction_rms);
  known.status.estimated_position_W_m[0] = 0;
  known.status.estimated_position_W_m[1] = 4;
  known.status.measured_valid = 1;
  known.status.measured_mu_required = 0.5;
  watch.observe(known.contact, known.truth, known.status, Eigen::Vector3d(0, 0, 0.5));
  known.status.measured_mu_required = 0.1;
  known.status.estimated_gyro_bias_B_radps[2] = 0.2;
  watch.observe(known.contact, known.truth, known.status, Eigen::Vector3d(0, 0.4, 0.5));
  known.status.measured_mu_required = std::numeric_limits<double>::infinity();  // no error has a number
  watch.observe(known.contact, known.truth, known.status, Eigen::Vector3d(0, 0.4, 0.5));
  const EstimateErrors errors = *watch.result();
  EXPECT_NEAR(errors.position_rms_m, std::sqrt((9.0 + 3 * 16) / 4), 1e-15);
  EXPECT_NEAR(errors.gyro_bias_error_radps, 0.5, 1e-15);
  EXPECT_NEAR(*errors.friction_rms, std::sqrt((0.09 + 0.01) / 2), 1e-15);
  EXPECT_NEAR(*errors.friction_error, 0.3, 1e-15);
  EXPECT_EQ(errors.position_W_m, Eigen::Vector2d(0, 4));
}

}  // namespace
}  // namespace ballast::sil
