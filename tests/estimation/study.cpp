#include "tests/estimation/study.h"

#include <Eigen/Dense>
#include <cmath>

namespace ballast::test {

namespace e = firmware::estimation;

namespace {

constexpr double kNormal95 = 1.959963984540054;

// chi-square / degrees at a quantile of the standard normal.
double chi_square_mean(double degrees, double quantile) {
  const double a = 2 / (9 * degrees), b = 1 - a + quantile * std::sqrt(a);
  return b * b * b;
}

template <class States>
double squared_error(const Eigen::Matrix<double, e::kErrors, 1>& error, const e::Covariance& covariance,
                     const States& states) {
  const int n = static_cast<int>(std::size(states));
  Eigen::MatrixXd p(n, n);
  Eigen::VectorXd x(n);
  for (int i = 0; i < n; ++i) {
    x[i] = error[static_cast<int>(states[i])];
    for (int j = 0; j < n; ++j) p(i, j) = covariance.xx[states[i]][states[j]];
  }
  return x.dot(p.ldlt().solve(x));
}

void add(Consistency& c, std::size_t time, double value) {
  if (c.mean.size() <= time) c.mean.resize(time + 1, 0);
  c.mean[time] += value;
}

}  // namespace

std::pair<double, double> Consistency::band() const {
  const double degrees = static_cast<double>(states) * seeds;
  return {states * chi_square_mean(degrees, -kNormal95), states * chi_square_mean(degrees, kNormal95)};
}

double Consistency::inside() const {
  const auto [low, high] = band();
  double count = 0;
  for (const double value : mean) count += value >= low && value <= high ? 1 : 0;
  return count / static_cast<double>(mean.size());
}

double Consistency::average() const {
  double sum = 0;
  for (const double value : mean) sum += value;
  return sum / static_cast<double>(mean.size());
}

Study study(const RecordedRun& run, const sim::SensorModel& model, int seeds, std::uint64_t first_seed) {
  const auto& ball = run.params->ball;
  const double period_s = run.scenario.run.control_period_s;
  const auto params = estimation_params(run.scenario, model);
  const auto state = std::make_unique<firmware::FilterState>();
  Study found;
  double tilts = 0, biases = 0, yaws = 0, places = 0;
  std::size_t ticks = 0;
  for (int k = 0; k < seeds; ++k) {
    Imu imu(model, period_s, first_seed + static_cast<std::uint64_t>(k));
    firmware::Sensors sensors;
    firmware::Estimate out;
    reset(ball, params, *state);
    std::size_t time = 0;
    std::int64_t due = run.ticks.back().tick / 20;
    const std::int64_t every = run.ticks.back().tick / 20;
    for (const TrueTick& truth : run.ticks) {
      imu.read(truth, sensors);
      update(ball, params, period_s, sensors, truth.commanded, truth.tick, *state, out);
      const Eigen::Vector3d up = truth.orientation.conjugate() * Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d up_estimate = out.orientation.conjugate() * Eigen::Vector3d::UnitZ();
      const double tilt = std::atan2(up.cross(up_estimate).norm(), up.dot(up_estimate));
      const Eigen::Vector3d bias_error = imu.gyro_bias() - out.gyro_bias_B_radps;
      if (truth.tick == 0) {
        biases += bias_error.squaredNorm() / 3;
        found.gyro_bias_most_radps = std::max(found.gyro_bias_most_radps, bias_error.cwiseAbs().maxCoeff());
      }
      if (truth.tick < 0) continue;
      tilts += tilt * tilt;
      ++ticks;
      found.tilt_most_rad = std::max(found.tilt_most_rad, tilt);
      // The covariance is that of the anchor, at the end of a window.
      const bool comparable = state->window.samples == 0 && state->anchor_tick == truth.tick;
      if (truth.tick < due || !comparable) continue;
      due += every;
      Eigen::AngleAxisd turn(truth.orientation * state->orientation.conjugate());
      Eigen::Matrix<double, e::kErrors, 1> error;
      error << turn.angle() * turn.axis(), bias_error, 0, 0, 0, truth.motion.position_W_m[0] - state->position_W_m[0],
          truth.motion.position_W_m[1] - state->position_W_m[1];
      add(found.all, time,
          squared_error(error, state->covariance, std::array<std::size_t, 8>{0, 1, 2, 3, 4, 5, 9, 10}));
      add(found.tilt, time, squared_error(error, state->covariance, std::array<std::size_t, 2>{0, 1}));
      add(found.yaw, time, squared_error(error, state->covariance, std::array<std::size_t, 1>{2}));
      add(found.bias, time, squared_error(error, state->covariance, std::array<std::size_t, 3>{3, 4, 5}));
      add(found.place, time, squared_error(error, state->covariance, std::array<std::size_t, 2>{9, 10}));
      ++time;
    }
    const TrueTick& last = run.ticks.back();
    const double off = std::hypot(last.motion.position_W_m[0] - out.position_W_m[0],
                                  last.motion.position_W_m[1] - out.position_W_m[1]) /
                       run.path_m;
    places += off * off;
    found.place_most = std::max(found.place_most, off);
    const Eigen::AngleAxisd turn(last.orientation * out.orientation.conjugate());
    yaws += std::pow(turn.angle() * turn.axis()[2], 2);
  }
  const auto n = static_cast<double>(seeds);
  found.tilt_rms_rad = std::sqrt(tilts / static_cast<double>(ticks));
  found.gyro_bias_rms_radps = std::sqrt(biases / n);
  found.yaw_rms_rad = std::sqrt(yaws / n);
  found.place_rms = std::sqrt(places / n);
  for (const auto& [consistency, states] :
       {std::pair{&found.all, 8}, {&found.tilt, 2}, {&found.yaw, 1}, {&found.bias, 3}, {&found.place, 2}}) {
    consistency->states = states;
    consistency->seeds = seeds;
    for (double& value : consistency->mean) value /= n;
  }
  return found;
}

}  // namespace ballast::test
