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

void filter(const RecordedRun& run, const sim::SensorModel& model, std::uint64_t seed,
            const std::function<void(const FilteredTick&)>& look,
            const std::function<void(std::int64_t tick, firmware::Sensors&)>& disturb) {
  const double period_s = run.scenario.run.control_period_s;
  const auto params = estimation_params(run.scenario, model);
  const auto state = std::make_unique<firmware::FilterState>();
  Imu imu(model, period_s, seed);
  firmware::Sensors sensors;
  firmware::Estimate out;
  reset(run.params->ball, params, *state);
  for (const TrueTick& truth : run.ticks) {
    imu.read(truth, sensors);
    firmware::Sensors heard = sensors;
    if (disturb) disturb(truth.tick, heard);
    update(run.params->ball, params, period_s, heard, truth.commanded, truth.tick, *state, out);
    look({truth, imu, *state, out});
  }
}

double tilt_error_rad(const FilteredTick& tick) {
  const Eigen::Vector3d up = tick.truth.orientation.conjugate() * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d estimated = tick.estimate.orientation.conjugate() * Eigen::Vector3d::UnitZ();
  return std::atan2(up.cross(estimated).norm(), up.dot(estimated));
}

double place_error_m(const FilteredTick& tick) {
  return (tick.truth.motion.position_W_m - tick.estimate.position_W_m).norm();
}

namespace {

// Truth minus estimate at the anchor. The accelerometer's bias is left out.
Eigen::Matrix<double, e::kErrors, 1> errors_of(const RecordedRun& run, const FilteredTick& tick) {
  const auto& state = tick.state;
  const TrueTick& truth = run.ticks[static_cast<std::size_t>(state.anchor_tick - run.ticks.front().tick)];
  const Eigen::AngleAxisd turn(truth.orientation * state.orientation.conjugate());
  Eigen::Matrix<double, e::kErrors, 1> error;
  error << turn.angle() * turn.axis(), tick.imu.gyro_bias() - state.gyro_bias_B_radps, 0, 0, 0,
      truth.motion.position_W_m[0] - state.position_W_m[0], truth.motion.position_W_m[1] - state.position_W_m[1];
  return error;
}

void compare(const RecordedRun& run, const FilteredTick& tick, std::size_t time, Study& found) {
  const auto error = errors_of(run, tick);
  const auto& covariance = tick.state.covariance;
  using Which = std::vector<std::size_t>;
  add(found.all, time, squared_error(error, covariance, Which{0, 1, 2, 3, 4, 5, 9, 10}));
  add(found.tilt, time, squared_error(error, covariance, Which{0, 1}));
  add(found.yaw, time, squared_error(error, covariance, Which{2}));
  add(found.bias, time, squared_error(error, covariance, Which{3, 4, 5}));
  add(found.place, time, squared_error(error, covariance, Which{9, 10}));
}

}  // namespace

Study study(const RecordedRun& run, const sim::SensorModel& model, int seeds, std::uint64_t first_seed) {
  constexpr int kTimes = 20;
  const TrueTick& last = run.ticks.back();
  Study found;
  double tilts = 0, biases = 0, yaws = 0, ends = 0, places = 0;
  std::size_t ticks = 0;
  for (int k = 0; k < seeds; ++k) {
    std::size_t time = 0;
    filter(run, model, first_seed + static_cast<std::uint64_t>(k), [&](const FilteredTick& tick) {
      if (tick.truth.tick == 0) {
        const Eigen::Vector3d off = tick.imu.gyro_bias() - tick.estimate.gyro_bias_B_radps;
        biases += off.squaredNorm() / 3;
        found.gyro_bias_most_radps = std::max(found.gyro_bias_most_radps, off.cwiseAbs().maxCoeff());
      }
      if (tick.truth.tick < 0) return;
      ++ticks;
      const double tilt = tilt_error_rad(tick), place = place_error_m(tick);
      tilts += tilt * tilt;
      places += place * place;
      found.tilt_most_rad = std::max(found.tilt_most_rad, tilt);
      // The covariance is that of the anchor, at the end of a window.
      const bool comparable = tick.state.window.closed;
      if (comparable && tick.truth.tick * kTimes >= static_cast<std::int64_t>(time + 1) * last.tick) {
        compare(run, tick, time++, found);
      }
      if (tick.truth.tick != last.tick) return;
      ends += place * place;
      found.place_most = std::max(found.place_most, place / run.path_m);
      yaws += std::pow(errors_of(run, tick)[2], 2);
    });
  }
  const auto n = static_cast<double>(seeds);
  found.tilt_rms_rad = std::sqrt(tilts / static_cast<double>(ticks));
  found.gyro_bias_rms_radps = std::sqrt(biases / n);
  found.yaw_rms_rad = std::sqrt(yaws / n);
  found.place_rms = std::sqrt(ends / n) / run.path_m;
  found.place_rms_m = std::sqrt(places / static_cast<double>(ticks));
  for (const auto& [consistency, states] :
       {std::pair{&found.all, 8}, {&found.tilt, 2}, {&found.yaw, 1}, {&found.bias, 3}, {&found.place, 2}}) {
    consistency->states = states;
    consistency->seeds = seeds;
    for (double& value : consistency->mean) value /= n;
  }
  return found;
}

}  // namespace ballast::test
