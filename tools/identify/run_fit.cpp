#include "tools/identify/run_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "sim/sensors/sensors.h"

namespace ballast::identify {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// Differences of the rolled model are central: their error is the square of the step, their rounding 1e-12 of the
// motion over it.
constexpr double kDifference = 1e-5;

// Least errors of sensors without any: what the model's steps and the averaging leave.
constexpr double kLeastNoise = 1e-5;  // of sqrt(g / r), of g
constexpr double kLeastFix = 1e-4;    // of r
constexpr double kLeastError = 1e-7;  // scale and misalignment

// A segment's start has these sigmas, so that a heading that nothing shows is no singularity. Nothing pulls the start.
constexpr double kAnyTurn = 1, kAnyRate = 10, kAnyPlace = 10;  // rad, sqrt(g / r), r

// 1 sigma of the place in which a mass on a stepper was homed, in full steps, and of its lag as computed, in parts.
constexpr double kHoming = 0.25, kLagError = 0.3;

constexpr double kKnotSpacing = 16;  // sqrt(r / g) between knots of the biases

double square(double x) { return x * x; }

Matrix3d hat(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return m;
}

Eigen::Quaterniond quaternion(const BallState& state) { return {state.q[0], state.q[1], state.q[2], state.q[3]}; }

// scale, misalignment: y = x + diag(x) s + m x x.
Vector3d misread(const Vector3d& x, const VectorXd& errors, Index at) {
  return x + x.cwiseProduct(errors.segment<3>(at)) + errors.segment<3>(at + 3).cross(x);
}

double time_unit(const firmware::BallParams& ball) { return std::sqrt(ball.radius_m / ball.gravity_mps2); }

// Attitude and place by the IMU alone, at each sample: where rolling takes the ball that turns so.
std::vector<BallState> reckon(const Recording& recording) {
  const Known& known = recording.known;
  const Held& held = recording.held;
  BallState state;
  state.q = {known.start.w(), known.start.x(), known.start.y(), known.start.z()};
  state.place_W_m = known.start_W_m;
  Vector3d bias = Vector3d::Zero();
  if (held.samples > 0) {
    // The shortest turn to the weight as it was felt.
    const Vector3d expected_B = held_force_B(known.robot.ball, state);
    const auto turn = Eigen::Quaterniond::FromTwoVectors(held.accelerometer_B_mps2, expected_B);
    const Eigen::Quaterniond q = quaternion(state) * turn;
    state.q = {q.w(), q.x(), q.y(), q.z()};
    bias = held.gyro_B_radps;
  }
  std::vector<BallState> out;
  const ImuSample* before = nullptr;
  for (const ImuSample& sample : recording.imu) {
    if (before != nullptr) {
      const double dt_s = static_cast<double>(sample.tick - before->tick) * known.control_period_s;
      const Vector3d turn_B = dt_s * ((before->gyro_B_radps + sample.gyro_B_radps) / 2 - bias);
      const Vector3d turn_W = quaternion(state) * turn_B;
      state = turned(state, turn_B);
      state.place_W_m += known.robot.ball.radius_m * Eigen::Vector2d(turn_W[1], -turn_W[0]);
    }
    state.omega_B_radps = sample.gyro_B_radps - bias;
    out.push_back(state);
    before = &sample;
  }
  return out;
}

}  // namespace

RunFit::RunFit(Recording recording, const Parameters& parameters)
    : recording_(std::move(recording)), parameters_(&parameters), timeline_(recording_.commanded, recording_.known) {
  take_samples();
  set_sensor_noise();
  const double span = windows() * timeline_.window_s() / time_unit(recording_.known.robot.ball);
  knots_ = 1 + std::max(1, static_cast<int>(std::ceil(span / kKnotSpacing)));
  knot_spacing_windows_ = std::max(1.0, static_cast<double>(windows()) / (knots_ - 1));
  own_ = VectorXd::Zero(biases_at(knots_));
  own_.segment(masses_at() + parameters.masses(), parameters.masses()).setOnes();
  if (recording_.held.samples > 0)
    for (int knot = 0; knot < knots_; ++knot) own_.segment<3>(biases_at(knot)) = recording_.held.gyro_B_radps;
  before_ = own_;
  place_masses(own_);
}

void RunFit::place_masses(const VectorXd& own) {
  plan::PerMass<double> offset{}, factor{};
  for (int i = 0; i < parameters_->masses(); ++i) {
    offset[static_cast<std::size_t>(i)] = own[masses_at() + i];
    factor[static_cast<std::size_t>(i)] = own[masses_at() + parameters_->masses() + i];
  }
  timeline_.place(offset, factor);
}

void RunFit::take_samples() {
  const Known& known = recording_.known;
  const auto every = std::max<std::int64_t>(1, sim::ticks_per_sample(known.sensors.rate_hz, known.control_period_s));
  const std::int64_t per_window = timeline_.window_ticks() / every;
  const auto expected = static_cast<double>(per_window);
  window_.assign(static_cast<std::size_t>(windows()), {});
  std::vector<double> saturated(2 * window_.size(), 0);
  const auto beyond = [](const Vector3d& v, double range) { return range > 0 && v.cwiseAbs().maxCoeff() >= range; };
  for (const ImuSample& sample : recording_.imu) {
    const auto index = static_cast<std::size_t>(sample.tick / timeline_.window_ticks());
    if (index >= window_.size()) break;
    Window& window = window_[index];
    window.measured.head<3>() += sample.gyro_B_radps;
    window.measured.tail<3>() += sample.accelerometer_B_mps2;
    window.samples += 1;
    saturated[2 * index] += beyond(sample.gyro_B_radps, known.sensors.gyro.range) ? 1 : 0;
    saturated[2 * index + 1] += beyond(sample.accelerometer_B_mps2, known.sensors.accelerometer.range) ? 1 : 0;
  }
  for (std::size_t k = 0; k < window_.size(); ++k) {
    Window& window = window_[k];
    const bool whole = window.samples == expected;
    if (window.samples > 0) window.measured /= window.samples;
    window.gyro = whole && saturated[2 * k] == 0;
    window.accelerometer = whole && saturated[2 * k + 1] == 0;
  }
}

void RunFit::set_sensor_noise() {
  const Known& known = recording_.known;
  const firmware::BallParams& ball = known.robot.ball;
  const auto variance = [&](const sim::ImuTriad& triad, double unit) {
    const double noise = square(triad.noise_density) * known.sensors.rate_hz / 2 + square(triad.resolution) / 12;
    return noise + square(kLeastNoise * unit);
  };
  sample_variance_.head<3>().setConstant(variance(known.sensors.gyro, 1 / time_unit(ball)));
  sample_variance_.tail<3>().setConstant(variance(known.sensors.accelerometer, ball.gravity_mps2));
}

// The variance of the means over the hold, against the biases at its end.
RunFit::Row RunFit::held_variance() const {
  const Known& known = recording_.known;
  const double third_s = static_cast<double>(known.hold_ticks) * known.control_period_s / 3;
  Row walk;
  walk.head<3>().setConstant(square(known.sensors.gyro.bias_walk) * third_s);
  walk.tail<3>().setConstant(square(known.sensors.accelerometer.bias_walk) * third_s);
  return sample_variance_ / recording_.held.samples + walk;
}

int RunFit::residuals() const {
  int count = 0;
  for (const Window& window : window_) count += (window.gyro ? 3 : 0) + (window.accelerometer ? 3 : 0);
  return count;
}

void RunFit::cut_into(int windows_each) {
  const std::vector<BallState> reckoned = reckon(recording_);
  const int most = std::max(1, windows() / std::max(1, windows_each));
  segments_.clear();
  std::size_t sample = 0;
  for (int k = 0; k < most; ++k) {
    const int first = k * windows_each;
    const int count = k + 1 == most ? windows() - first : windows_each;
    const std::int64_t tick = static_cast<std::int64_t>(first) * timeline_.window_ticks();
    while (sample + 1 < reckoned.size() && recording_.imu[sample].tick < tick) ++sample;
    BallState start = reckoned[sample];
    // The rate: a mean over half a window on both sides, as far as there are samples.
    Vector3d sum = Vector3d::Zero();
    double samples = 0;
    for (std::size_t j = 0; j < reckoned.size(); ++j) {
      if (2 * std::abs(recording_.imu[j].tick - tick) > timeline_.window_ticks()) continue;
      sum += reckoned[j].omega_B_radps;
      samples += 1;
    }
    if (samples > 0) start.omega_B_radps = sum / samples;
    segments_.push_back({first, count, start});
  }
  segments_before_ = segments_;
}

void RunFit::join() {
  std::vector<Segment> joined;
  for (std::size_t k = 0; k < segments_.size(); k += 2) {
    Segment segment = segments_[k];
    if (k + 1 < segments_.size()) segment.windows += segments_[k + 1].windows;
    joined.push_back(segment);
  }
  segments_ = joined;
  segments_before_ = segments_;
}

std::pair<int, double> RunFit::knot_of(int window) const {
  const double at = (window + 0.5) / knot_spacing_windows_;
  const int knot = std::min(knots_ - 2, static_cast<int>(at));
  return {knot, at - knot};
}

RunFit::Row RunFit::read(const Row& truth, int window) const {
  const auto [knot, part] = knot_of(window);
  Row out;
  out << misread(truth.head<3>(), own_, 0), misread(truth.tail<3>(), own_, 6);
  return out + (1 - part) * own_.segment<kBiases>(biases_at(knot)) + part * own_.segment<kBiases>(biases_at(knot + 1));
}

RunFit::Row RunFit::variance(int window) const {
  const double samples = std::max(1.0, window_[static_cast<std::size_t>(window)].samples);
  return sample_variance_.cwiseProduct(excess_) / samples;
}

RunFit::Prediction RunFit::predict(const plan::Robot& robot, const Segment& segment, const BallState& start) {
  const Known& known = recording_.known;
  roll(robot, known.sensors.accelerometer_position_B_m, timeline_, segment.first, segment.windows, start, nodes_);
  Prediction out;
  const auto every = std::max<std::int64_t>(1, sim::ticks_per_sample(known.sensors.rate_hz, known.control_period_s));
  // Samples stand for the time from half a period before to half a period after them, so the first one's share begins
  // before the window.
  const double shift = static_cast<double>(every) / (2.0 * timeline_.window_ticks());
  const auto reading = [this](std::size_t node) {
    Row row;
    row << nodes_[node].state.omega_B_radps, nodes_[node].specific_force_B_mps2;
    return row;
  };
  for (int w = 0; w < segment.windows; ++w) {
    const auto k = static_cast<std::size_t>(kStepsPerWindow * w);
    const Row first = reading(k), last = reading(k + 4);
    const Row mean = (first + 4 * reading(k + 1) + 2 * reading(k + 2) + 4 * reading(k + 3) + last) / 12;
    out.truth.push_back(mean - shift * (last - first));
  }
  const std::int64_t from = static_cast<std::int64_t>(segment.first) * timeline_.window_ticks();
  const std::int64_t to = from + static_cast<std::int64_t>(segment.windows) * timeline_.window_ticks();
  for (const FixSample& fix : recording_.fixes) {
    if (fix.tick < from || fix.tick >= to) continue;
    const auto k = static_cast<std::size_t>((fix.tick - from) / timeline_.step_ticks());
    const double part = static_cast<double>((fix.tick - from) % timeline_.step_ticks()) / timeline_.step_ticks();
    out.fixes.emplace_back((1 - part) * nodes_[k].state.place_W_m + part * nodes_[k + 1].state.place_W_m);
  }
  out.rolls = std::isfinite(nodes_.back().state.omega_B_radps.sum());
  return out;
}

double RunFit::data_cost(const Segment& segment, const Prediction& predicted) const {
  if (!predicted.rolls) return std::numeric_limits<double>::infinity();
  double sum = 0;
  for (int w = 0; w < segment.windows; ++w) {
    const int window = segment.first + w;
    const Window& at = window_[static_cast<std::size_t>(window)];
    const Row residual = at.measured - read(predicted.truth[static_cast<std::size_t>(w)], window);
    const Row per_variance = variance(window).cwiseInverse();
    for (int row = 0; row < kRows; ++row)
      if (at.usable(row)) sum += square(residual[row]) * per_variance[row];
  }
  std::size_t next = 0;
  const double fix_variance =
      square(recording_.known.sensors.fix.noise_m) + square(kLeastFix * recording_.known.robot.ball.radius_m);
  const std::int64_t from = static_cast<std::int64_t>(segment.first) * timeline_.window_ticks();
  for (const FixSample& fix : recording_.fixes) {
    if (fix.tick < from || next == predicted.fixes.size()) continue;
    sum += (fix.place_W_m - predicted.fixes[next++]).squaredNorm() / fix_variance;
  }
  return sum / 2;
}

namespace {

// Priors of the run's own unknowns as rows: weight (b - a x) for one or two unknowns.
struct PriorRow {
  Index unknown;
  Index minus;  // -1: none
  double value, information;

  // The unknowns' distance from it.
  [[nodiscard]] double off(const VectorXd& own) const { return own[unknown] - (minus < 0 ? 0 : own[minus]) - value; }
};

std::vector<PriorRow> prior_rows(const Known& known, Index masses_at, Index biases_at, int per_knot, int knots,
                                 double knot_s) {
  std::vector<PriorRow> rows;
  const double g = known.robot.ball.gravity_mps2, unit = 1 / time_unit(known.robot.ball);
  const auto add = [&](Index unknown, Index minus, double sigma, double least) {
    rows.push_back({unknown, minus, 0, 1 / (square(sigma) + square(least))});
  };
  const Index masses = (biases_at - masses_at) / 2;
  for (Index i = 0; i < masses; ++i) {
    const sim::Motor& motor = known.belief.masses[static_cast<std::size_t>(i)].motor;
    const double step = motor.microsteps / motor.microsteps_per_rail_unit();
    add(masses_at + i, -1, known.steppers ? kHoming * step : 0, kLeastError);
    add(masses_at + masses + i, -1, known.steppers ? kLagError : 0, kLeastError);
    rows.back().value = 1;
  }
  for (int triad = 0; triad < 2; ++triad) {
    const sim::ImuTriad& model = triad == 0 ? known.sensors.gyro : known.sensors.accelerometer;
    const double least = kLeastNoise * (triad == 0 ? unit : g);
    for (int j = 0; j < 3; ++j) {
      add(6 * triad + j, -1, model.scale_error, kLeastError);
      add(6 * triad + 3 + j, -1, model.misalignment_rad, kLeastError);
      for (int knot = 0; knot < knots; ++knot) {
        const Index at = biases_at + static_cast<Index>(per_knot) * knot + Index{3} * triad + j;
        if (knot == 0) {
          add(at, -1, model.bias, least);
        } else {
          add(at, at - per_knot, model.bias_walk * std::sqrt(knot_s), least / 10);
        }
      }
    }
  }
  return rows;
}

}  // namespace

double RunFit::prior_cost() const {
  const Known& known = recording_.known;
  double sum = 0;
  const double knot_s = knot_spacing_windows_ * timeline_.window_s();
  for (const PriorRow& row : prior_rows(known, masses_at(), biases_at(0), kBiases, knots_, knot_s)) {
    const double value = row.off(own_);
    sum += square(value) * row.information;
  }
  if (const Held& held = recording_.held; held.samples > 0) {
    const Row variance = held_variance();
    const Vector3d force_B = misread(held_force_B(known.robot.ball, segments_.front().start), own_, 6);
    Row residual;
    residual << held.gyro_B_radps - own_.segment<3>(biases_at(0)),
        held.accelerometer_B_mps2 - force_B - own_.segment<3>(biases_at(0) + 3);
    sum += residual.cwiseProduct(residual).cwiseQuotient(variance).sum();
  }
  return sum / 2;
}

double RunFit::cost(const VectorXd& values) {
  const plan::Robot robot = parameters_->robot(values);
  double sum = prior_cost();
  for (const Segment& segment : segments_) sum += data_cost(segment, predict(robot, segment, segment.start));
  return std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity();
}

void RunFit::add_priors(MatrixXd& h, VectorXd& g) const {
  const Known& known = recording_.known;
  const Index p = parameters_->count();
  const double knot_s = knot_spacing_windows_ * timeline_.window_s();
  for (const PriorRow& row : prior_rows(known, masses_at(), biases_at(0), kBiases, knots_, knot_s)) {
    const double value = row.off(own_);
    const Index i = p + row.unknown, j = p + row.minus;
    h(i, i) += row.information;
    g[i] -= row.information * value;
    if (row.minus < 0) continue;
    h(j, j) += row.information;
    h(i, j) -= row.information;
    h(j, i) -= row.information;
    g[j] += row.information * value;
  }
  const Held& held = recording_.held;
  if (held.samples == 0) return;
  const Row information = held_variance().cwiseInverse();
  const Vector3d force_B = held_force_B(known.robot.ball, segments_.front().start);
  Row residual;
  residual << held.gyro_B_radps - own_.segment<3>(biases_at(0)),
      held.accelerometer_B_mps2 - misread(force_B, own_, 6) - own_.segment<3>(biases_at(0) + 3);
  MatrixXd jacobian = MatrixXd::Zero(kRows, h.rows());
  jacobian.middleCols<kBiases>(p + biases_at(0)).setIdentity();
  jacobian.block<3, 3>(3, p + 6) = force_B.asDiagonal();
  jacobian.block<3, 3>(3, p + 9) = -hat(force_B);
  jacobian.block<3, 3>(3, p + start_at(0)) = hat(force_B);  // d(Lambda^T v) = (Lambda^T v) x phi
  h += jacobian.transpose() * information.asDiagonal() * jacobian;
  g += jacobian.transpose() * information.asDiagonal() * residual;
}

Index RunFit::slopes_of_masses() const { return recording_.known.steppers ? 2 * parameters_->masses() : 0; }

RunFit::Slopes RunFit::slopes(const VectorXd& values, const Segment& segment, std::size_t fixes) {
  const firmware::BallParams& ball = recording_.known.robot.ball;
  const Index p = parameters_->count();
  const Index count = p + 6 + slopes_of_masses();
  Slopes out;
  out.by_window.assign(static_cast<std::size_t>(segment.windows), MatrixXd(kRows, count));
  out.by_fix.assign(fixes, MatrixXd(2, count));
  for (Index k = 0; k < count; ++k) {
    Prediction ends[2];
    double step[2];
    for (int side = 0; side < 2; ++side) {
      const double sign = side == 0 ? -1 : 1;
      VectorXd varied = values;
      BallState start = segment.start;
      if (k < p) {
        step[side] = sign * kDifference * parameters_->scale()[k];
        // Resistance is never negative.
        if (k == parameters_->rolling_resistance()) step[side] = std::max(step[side], -values[k]);
        varied[k] += step[side];
      } else if (k < p + 3) {
        step[side] = sign * kDifference;
        start = turned(start, step[side] * Vector3d::Unit(k - p));
      } else if (k < p + 6) {
        step[side] = sign * kDifference / time_unit(ball);
        start.omega_B_radps[k - p - 3] += step[side];
      } else {
        VectorXd own = own_;
        const Index unknown = k - p - 6;
        // A lag is some thousandths of a rail unit.
        step[side] = sign * (unknown < parameters_->masses() ? kDifference : 1e2 * kDifference);
        own[masses_at() + unknown] += step[side];
        place_masses(own);
      }
      ends[side] = predict(parameters_->robot(varied), segment, start);
    }
    if (k >= p + 6) place_masses(own_);
    const double per = 1 / (step[1] - step[0]);
    for (std::size_t w = 0; w < out.by_window.size(); ++w)
      out.by_window[w].col(k) = per * (ends[1].truth[w] - ends[0].truth[w]);
    for (std::size_t f = 0; f < fixes; ++f) out.by_fix[f].col(k) = per * (ends[1].fixes[f] - ends[0].fixes[f]);
  }
  return out;
}

void RunFit::add_windows(std::size_t index, const Prediction& here, const Slopes& slopes, MatrixXd& h, VectorXd& g) {
  const Segment& segment = segments_[index];
  const Index p = parameters_->count(), of_masses = slopes_of_masses();
  // Columns of one window: parameters, errors, masses, two knots of biases, start. Everything else is 0.
  const Index both = static_cast<Index>(2) * kBiases;  // of the knots on both sides
  const Index biases = p + biases_at(0), local = biases + both + kStart;
  MatrixXd jacobian(kRows, local);
  const auto column = [&](Index j, int knot) -> Index {
    if (j < biases) return j;
    if (j < biases + both) return p + biases_at(knot) + (j - biases);
    return p + start_at(index) + (j - biases - both);
  };
  Matrix3d gyro = Matrix3d::Identity(), accelerometer = Matrix3d::Identity();
  gyro += own_.segment<3>(0).asDiagonal();
  gyro += hat(own_.segment<3>(3));
  accelerometer += own_.segment<3>(6).asDiagonal();
  accelerometer += hat(own_.segment<3>(9));
  for (int w = 0; w < segment.windows; ++w) {
    const int window = segment.first + w;
    const Window& at = window_[static_cast<std::size_t>(window)];
    const Row& truth = here.truth[static_cast<std::size_t>(w)];
    const auto [knot, part] = knot_of(window);
    jacobian.setZero();
    MatrixXd read_by = slopes.by_window[static_cast<std::size_t>(w)];
    read_by.topRows<3>() = gyro * read_by.topRows<3>();
    read_by.bottomRows<3>() = accelerometer * read_by.bottomRows<3>();
    jacobian.leftCols(p) = read_by.leftCols(p);
    jacobian.block<3, 3>(0, p) = truth.head<3>().asDiagonal();
    jacobian.block<3, 3>(0, p + 3) = -hat(truth.head<3>());
    jacobian.block<3, 3>(3, p + 6) = truth.tail<3>().asDiagonal();
    jacobian.block<3, 3>(3, p + 9) = -hat(truth.tail<3>());
    for (int j = 0; j < kBiases; ++j) {
      jacobian(j, biases + j) = 1 - part;
      jacobian(j, biases + kBiases + j) = part;
    }
    jacobian.middleCols<6>(biases + both) = read_by.middleCols<6>(p);
    jacobian.middleCols(p + masses_at(), of_masses) = read_by.rightCols(of_masses);
    Row information = variance(window).cwiseInverse();
    for (int row = 0; row < kRows; ++row)
      if (!at.usable(row)) information[row] = 0;
    const Row residual = at.measured - read(truth, window);
    residual_[static_cast<std::size_t>(window)] = residual;
    const MatrixXd weighted = jacobian.transpose() * information.asDiagonal();
    const MatrixXd block = weighted * jacobian;
    const VectorXd score = weighted * residual;
    VectorXd& all = scores_[static_cast<std::size_t>(window)];
    for (Index a = 0; a < local; ++a) {
      const Index to = column(a, knot);
      g[to] += score[a];
      all[to] += score[a];
      for (Index b = 0; b < local; ++b) h(to, column(b, knot)) += block(a, b);
    }
  }
}

void RunFit::add_fixes(std::size_t index, const Prediction& here, const Slopes& slopes, MatrixXd& h, VectorXd& g) {
  const Index p = parameters_->count(), of_masses = slopes_of_masses();
  const double least_m = kLeastFix * recording_.known.robot.ball.radius_m;
  const double information = 1 / (square(recording_.known.sensors.fix.noise_m) + square(least_m));
  const std::int64_t from = static_cast<std::int64_t>(segments_[index].first) * timeline_.window_ticks();
  std::size_t next = 0;
  for (const FixSample& fix : recording_.fixes) {
    if (fix.tick < from || next == here.fixes.size()) continue;
    MatrixXd of_fix = MatrixXd::Zero(2, h.rows());
    of_fix.leftCols(p) = slopes.by_fix[next].leftCols(p);
    of_fix.middleCols<6>(p + start_at(index)) = slopes.by_fix[next].middleCols<6>(p);
    of_fix.middleCols(p + masses_at(), of_masses) = slopes.by_fix[next].rightCols(of_masses);
    of_fix.middleCols<2>(p + start_at(index) + 6).setIdentity();
    const VectorXd score = information * of_fix.transpose() * (fix.place_W_m - here.fixes[next]);
    h += information * of_fix.transpose() * of_fix;
    g += score;
    scores_[static_cast<std::size_t>(fix.tick / timeline_.window_ticks())] += score;
    ++next;
  }
}

void RunFit::add_segment(const VectorXd& values, std::size_t index, MatrixXd& h, VectorXd& g) {
  const Segment segment = segments_[index];
  const Prediction here = predict(parameters_->robot(values), segment, segment.start);
  const Slopes by = slopes(values, segment, here.fixes.size());
  add_windows(index, here, by, h, g);
  add_fixes(index, here, by, h, g);

  const firmware::BallParams& ball = recording_.known.robot.ball;
  const double any_rate_radps = kAnyRate / time_unit(ball), any_place_m = kAnyPlace * ball.radius_m;
  const double any[kStart] = {kAnyTurn,       kAnyTurn,       kAnyTurn,    any_rate_radps,
                              any_rate_radps, any_rate_radps, any_place_m, any_place_m};
  const Index start = parameters_->count() + start_at(index);
  for (int j = 0; j < kStart; ++j) h(start + j, start + j) += 1 / square(any[j]);
}

Reduced RunFit::linearise(const VectorXd& values, double damping) {
  const Index p = parameters_->count(), size = p + unknowns();
  MatrixXd h = MatrixXd::Zero(size, size);
  VectorXd g = VectorXd::Zero(size);
  scores_.assign(window_.size(), VectorXd::Zero(size));
  residual_.assign(window_.size(), Row::Zero());
  add_priors(h, g);
  prior_information_ = h.bottomRightCorner(unknowns(), unknowns());
  for (std::size_t k = 0; k < segments_.size(); ++k) add_segment(values, k, h, g);
  h.diagonal() *= 1 + damping;
  coupling_ = h.bottomLeftCorner(unknowns(), p);
  own_pull_ = g.tail(unknowns());
  own_solver_.compute(h.bottomRightCorner(unknowns(), unknowns()));
  const MatrixXd solved = own_solver_.solve(coupling_);
  Reduced out;
  out.information = h.topLeftCorner(p, p) - coupling_.transpose() * solved;
  out.information = (out.information + out.information.transpose()).eval() / 2;
  out.pull = g.head(p) - solved.transpose() * own_pull_;
  return out;
}

void RunFit::step(const VectorXd& parameters_step) {
  before_ = own_;
  segments_before_ = segments_;
  const VectorXd change = own_solver_.solve(own_pull_ - coupling_ * parameters_step);
  own_ += change.head(own_.size());
  place_masses(own_);
  for (std::size_t k = 0; k < segments_.size(); ++k) {
    BallState& start = segments_[k].start;
    const Index at = start_at(k);
    start = turned(start, change.segment<3>(at));
    start.omega_B_radps += change.segment<3>(at + 3);
    start.place_W_m += change.segment<2>(at + 6);
  }
}

void RunFit::set_variances() {
  Row sum = Row::Zero(), count = Row::Zero();
  for (std::size_t w = 0; w < window_.size(); ++w) {
    for (int row = 0; row < kRows; ++row) {
      if (!window_[w].usable(row)) continue;
      sum[row] += square(residual_[w][row]) * window_[w].samples / sample_variance_[row];
      count[row] += 1;
    }
  }
  for (int row = 0; row < kRows; ++row) excess_[row] = count[row] > 0 ? std::max(1.0, sum[row] / count[row]) : 1;
}

void RunFit::expect_swing(double rms_mps2) {
  for (int row = 3; row < kRows; ++row) excess_[row] = 1 + square(rms_mps2) / sample_variance_[row];
}

void RunFit::set_lag(const VectorXd& values) {
  if (!recording_.known.steppers) return;
  const plan::Robot robot = parameters_->robot(values);
  std::vector<plan::PerMass<double>> lag(static_cast<std::size_t>(kStepsPerWindow * windows()) + 1);
  // By the commanded motion, and once by the one that lags so: more rounds would diverge with soft motors.
  for (const bool lagging : {false, true}) {
    for (const Segment& segment : segments_) {
      static_cast<void>(predict(robot, segment, segment.start));
      lag_along(robot, recording_.known, timeline_, segment.first, nodes_, lagging, lag);
    }
    // The masses begin where they are commanded to be: they were homed under their load.
    const plan::PerMass<double> first = lag.front();
    for (auto& at : lag) {
      for (std::size_t i = 0; i < first.size(); ++i) at[i] -= first[i];
    }
    timeline_.set_lag(lag);
    place_masses(own_);
  }
}

MatrixXd RunFit::pull_covariance(int lags) const {
  const Index p = parameters_->count();
  const MatrixXd through = own_solver_.solve(coupling_).transpose();  // B
  std::vector<VectorXd> scores;
  scores.reserve(scores_.size());
  for (const VectorXd& all : scores_) scores.emplace_back(all.head(p) - through * all.tail(unknowns()));
  MatrixXd out = through * prior_information_ * through.transpose();
  for (int lag = 0; lag <= lags; ++lag) {
    const double weight = 1 - lag / (lags + 1.0);
    MatrixXd sum = MatrixXd::Zero(p, p);
    for (std::size_t w = static_cast<std::size_t>(lag); w < scores.size(); ++w)
      sum += scores[w] * scores[w - static_cast<std::size_t>(lag)].transpose();
    out += lag == 0 ? sum : MatrixXd(weight * (sum + sum.transpose()));
  }
  return out;
}

RunFit::Contact RunFit::contact(const VectorXd& values) {
  const plan::Robot robot = parameters_->robot(values);
  Contact out;
  out.least_normal_n = std::numeric_limits<double>::infinity();
  for (const Segment& segment : segments_) {
    static_cast<void>(predict(robot, segment, segment.start));
    for (const Node& node : nodes_) {
      const double need = node.normal_n > 0 ? node.friction_n / node.normal_n : std::numeric_limits<double>::infinity();
      out.mu_required = std::max(out.mu_required, need);
      out.least_normal_n = std::min(out.least_normal_n, node.normal_n);
      out.farthest_m = std::max(out.farthest_m, (node.state.place_W_m - recording_.known.start_W_m).norm());
    }
  }
  return out;
}

}  // namespace ballast::identify
