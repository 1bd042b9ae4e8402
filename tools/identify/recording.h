// A recorded run as the robot knew it: how it commanded its masses and what its sensors said. The truth that a log of a
// simulation also holds is never read.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hal/lcm/messages.h"
#include "sim/scenario/scenario.h"
#include "tools/tracking/rolling_model.h"

namespace ballast::identify {

// Known before a run: the believed robot and its sensors' data.
struct Known {
  sim::World belief;
  plan::Robot robot;  // the belief, as the model takes it
  sim::SensorModel sensors;
  double control_period_s = 0;
  bool steppers = false;                 // masses lag behind their commands
  std::int64_t hold_ticks = 0;           // before tick 0, in which the ball is held still; 0: it is not
  double scale_mass_kg = 0;              // total mass of the robot, as a scale says it
  Eigen::Quaterniond start{1, 0, 0, 0};  // attitude in which the ball is set down
  Eigen::Vector2d start_W_m = Eigen::Vector2d::Zero();
};

// Sets what is known from a scenario. Its [ball] and [[mass]] give the total mass, and nothing else beside [believed].
// Returns why nothing can be identified with it; empty: it can.
[[nodiscard]] std::string know(const sim::Scenario& scenario, Known& known);

// A sample of the IMU.
struct ImuSample {
  std::int64_t tick = 0;
  Eigen::Vector3d gyro_B_radps, accelerometer_B_mps2;
};

struct FixSample {
  std::int64_t tick = 0;
  Eigen::Vector2d place_W_m;
};

// Means while the ball was held still before tick 0.
struct Held {
  int samples = 0;
  Eigen::Vector3d gyro_B_radps = Eigen::Vector3d::Zero();
  Eigen::Vector3d accelerometer_B_mps2 = Eigen::Vector3d::Zero();
};

struct Recording {
  std::string name;  // for messages: the folder
  Known known;
  std::vector<firmware::MassMotion> commanded;  // at ticks 0, 1, ...; where pieces meet, the later one's acceleration
  std::vector<ImuSample> imu;                   // at ticks 0 up to the last of `commanded`
  std::vector<FixSample> fixes;
  Held held;
  std::string cut;  // why the recording ends before the run did; empty: it does not
};

// Collects the messages of a run.
class Collector {
 public:
  explicit Collector(const Known& known);

  // Messages in order of their ticks.
  void take(const sensors_t& sensors);
  void take(const controller_status_t& status);
  // The masses have left their commands, the ball its rolling, or the record its end: nothing after this is used.
  void cut(const std::string& why);
  [[nodiscard]] bool is_cut() const { return !out_.cut.empty(); }

  [[nodiscard]] Recording finish() &&;

 private:
  void take_sample(const sensors_t& sensors);
  void check_encoders(const controller_status_t& status);

  Recording out_;
  std::optional<sensors_t> sensors_;           // the newest
  std::optional<controller_status_t> status_;  // the newest
  std::int64_t samples_ = 0, fixes_ = 0;       // counted by the messages
};

// Reads the folder of a run. Without a recording, `trouble` says why in one line.
struct ReadRun {
  std::optional<Recording> recording;
  std::string trouble;
  bool usage = false;  // the trouble is what was asked for, not a file
};
[[nodiscard]] ReadRun read_run(const std::string& folder);

// The first difference in the geometry of two robots: number of masses, radius, rails; empty: there is none.
[[nodiscard]] std::string other_geometry(const firmware::BallParams& a, const firmware::BallParams& b);

// Why two recordings cannot be of one robot; empty: they may be.
[[nodiscard]] std::string other_robot(const Known& a, const Known& b);

}  // namespace ballast::identify
