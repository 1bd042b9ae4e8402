#include "tools/identify/fit.h"

#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace ballast::identify {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double kTwoSided95 = 1.96;
constexpr double kUnseenErrors = 2;  // widens intervals for errors of the model that residuals hide (identify.md)
constexpr int kMostIterations = 25;  // of a stage
constexpr double kNear = 0.3, kConverged = 1e-3;  // step in units of sigma: of a stage, of the last
constexpr double kLongestStep = 0.3;              // of a parameter's scale
constexpr double kFirstSegment = 8;               // sqrt(r / g)
constexpr double kShortest = 16;                  // sqrt(r / g) of a recording: two segments
constexpr double kCorrelated = 4;                 // sqrt(r / g) over which residuals' correlation counts
constexpr double kWorse = 5;                      // half of chi-square, for each unknown that joining removes
constexpr double kStates = 6;                     // attitude and rate at the start of a segment
constexpr double kBelief = 0.2;                   // 1 sigma of what is believed, of the parameters' scale

struct Problem {
  const Parameters& parameters;
  std::vector<RunFit> runs;
  VectorXd values;
  int iterations = 0;

  void take(const Problem& other) {
    runs = other.runs;
    values = other.values;
  }
  double cost() {
    double sum = 0;
    for (RunFit& run : runs) sum += run.cost(values);
    return sum;
  }
  Reduced linearise(double damping) {
    Reduced sum{MatrixXd::Zero(parameters.count(), parameters.count()), VectorXd::Zero(parameters.count())};
    for (RunFit& run : runs) {
      const Reduced one = run.linearise(values, damping);
      sum.information += one.information;
      sum.pull += one.pull;
    }
    return sum;
  }
};

// The information in units of the scale, by its eigenvectors.
struct Spectrum {
  Spectrum(const MatrixXd& information, const VectorXd& scale)
      : solver(scale.asDiagonal() * information * scale.asDiagonal()) {}

  [[nodiscard]] bool known(Index k) const { return solver.eigenvalues()[k] * kUnknown * kUnknown > 1; }

  Eigen::SelfAdjointEigenSolver<MatrixXd> solver;
};

// A^-1 in the known directions, in units of the parameters.
MatrixXd inverse(const Spectrum& spectrum, const VectorXd& scale) {
  const MatrixXd& v = spectrum.solver.eigenvectors();
  MatrixXd out = MatrixXd::Zero(v.rows(), v.cols());
  for (Index k = 0; k < v.cols(); ++k)
    if (spectrum.known(k)) out += v.col(k) * v.col(k).transpose() / spectrum.solver.eigenvalues()[k];
  return scale.asDiagonal() * out * scale.asDiagonal();
}

// The step to the least cost, not longer than allowed. Resistance stays at 0 or above; a step that would lead below
// goes to 0, and the others make the best of that.
VectorXd step_of(const Parameters& parameters, const VectorXd& values, Reduced reduced) {
  const int k = parameters.rolling_resistance();
  const auto solve = [&] {
    const Spectrum spectrum(reduced.information, parameters.scale());
    return VectorXd(inverse(spectrum, parameters.scale()) * reduced.pull);
  };
  VectorXd step = solve();
  if (step[k] < -values[k]) {
    reduced.pull += reduced.information.col(k) * values[k];
    const double diagonal = reduced.information(k, k);
    reduced.information.row(k).setZero();
    reduced.information.col(k).setZero();
    reduced.information(k, k) = diagonal;
    reduced.pull[k] = 0;
    step = solve();
    step[k] = -values[k];
  }
  const double longest = step.cwiseQuotient(parameters.scale()).cwiseAbs().maxCoeff();
  return longest > kLongestStep ? VectorXd(step * (kLongestStep / longest)) : step;
}

// Goes to the least cost with the segments as they are. False: the fit was ended.
bool converge(Problem& problem, double near, double& cost, const std::function<bool()>& progress) {
  double damping = 1e-4;
  cost = problem.cost();
  for (int k = 0; k < kMostIterations; ++k) {
    ++problem.iterations;
    const Reduced reduced = problem.linearise(damping);
    const VectorXd step = step_of(problem.parameters, problem.values, reduced);
    const VectorXd before = problem.values;
    for (RunFit& run : problem.runs) run.step(step);
    problem.values += step;
    const double next =
        problem.parameters.possible(problem.values) ? problem.cost() : std::numeric_limits<double>::infinity();
    if (progress && !progress()) return false;
    if (next <= cost) {
      const double gained = cost - next;
      cost = next;
      damping = std::max(damping / 10, 1e-9);
      // Half the square of the step in units of sigma is what it gains.
      if (gained < near * near / 2 + 1e-9 * cost) return true;
    } else {
      problem.values = before;
      for (RunFit& run : problem.runs) run.restore();
      if (next - cost < 1e-9 * (1 + cost) || damping > 1e6) return true;
      damping *= 30;
    }
  }
  return true;
}

std::size_t segments(const Problem& problem) {
  std::size_t most = 0;
  for (const RunFit& run : problem.runs) most = std::max(most, run.segments());
  return most;
}

// Joins segments as long as the residuals stay what they were.
bool join_segments(Problem& problem, double& cost, const std::function<bool()>& progress) {
  while (segments(problem) > 1) {
    const Problem before = problem;
    std::size_t removed = 0;
    for (RunFit& run : problem.runs) {
      removed += run.segments();
      run.join();
      removed -= run.segments();
    }
    double joined = 0;
    if (!converge(problem, kNear, joined, progress)) return false;
    if (!(joined - cost < kWorse * kStates * static_cast<double>(removed))) {
      problem.take(before);
      return true;
    }
    cost = joined;
    for (RunFit& run : problem.runs) run.set_lag(problem.values);
  }
  return true;
}

// Values and intervals at the fit.
void conclude(Problem& problem, Identified& out) {
  const Parameters& parameters = problem.parameters;
  const VectorXd& scale = parameters.scale();
  const Reduced reduced = problem.linearise(0);
  const Spectrum spectrum(reduced.information, scale);
  const MatrixXd covariance = inverse(spectrum, scale);
  MatrixXd spread = MatrixXd::Zero(parameters.count(), parameters.count());
  for (RunFit& run : problem.runs) {
    const double windows = kCorrelated * parameters.time_unit_s() / run.window_s();
    spread += run.pull_covariance(std::max(1, static_cast<int>(windows)));
    out.excess = std::max(out.excess, run.excess());
    out.used_s += run.windows() * run.window_s();
    out.segment_s = std::max(out.segment_s, run.windows() * run.window_s() / static_cast<double>(run.segments()));
  }
  const MatrixXd sandwich = covariance * spread * covariance;
  out.believed = parameters.believed();
  out.value = problem.values;
  VectorXd variance = covariance.diagonal().cwiseMax(sandwich.diagonal());
  const VectorXd ones = VectorXd::Ones(parameters.masses());
  const auto of_shell = [&](const MatrixXd& m) {
    return ones.dot(m.topLeftCorner(parameters.masses(), parameters.masses()) * ones);
  };
  double shell = std::max(of_shell(covariance), of_shell(sandwich));
  for (Index k = 0; k < parameters.count(); ++k) {
    if (spectrum.known(k)) continue;
    const VectorXd direction = spectrum.solver.eigenvectors().col(k);
    out.unknown.push_back({direction});
    const double information = std::max(spectrum.solver.eigenvalues()[k], 1 / (kBelief * kBelief));
    variance += scale.cwiseProduct(direction).cwiseAbs2() / information;
    const double along = scale.cwiseProduct(direction).head(parameters.masses()).sum();
    shell += along * along / information;
  }
  const auto half_width = [](double variance_of, double size) {
    const double sigma = std::sqrt(variance_of);
    return sigma > kUnknown * size ? std::numeric_limits<double>::infinity() : kUnseenErrors * kTwoSided95 * sigma;
  };
  out.half_width.resize(parameters.count());
  for (Index k = 0; k < parameters.count(); ++k) out.half_width[k] = half_width(variance[k], scale[k]);
  out.shell_mass_kg = parameters.shell_mass_kg(out.value);
  out.believed_shell_mass_kg = parameters.shell_mass_kg(out.believed);
  out.shell_half_width_kg = half_width(shell, out.believed_shell_mass_kg);
  out.iterations = problem.iterations;
}

}  // namespace

FitOutcome fit(const Parameters& parameters, std::vector<Recording> recordings, const std::function<bool()>& progress) {
  Problem problem{parameters, {}, parameters.believed()};
  for (Recording& recording : recordings) {
    const std::string whose = recording.name.empty() ? "" : recording.name + ": ", cut = recording.cut;
    RunFit run(std::move(recording), parameters);
    const double shortest_s = kShortest * parameters.time_unit_s();
    if (run.windows() * run.window_s() < shortest_s) {
      return {std::nullopt, fmt::format("{}{:.3g} s of the run can be used; allowed: at least {:.3g} s{}{}", whose,
                                        run.windows() * run.window_s(), shortest_s, cut.empty() ? "" : "; ", cut)};
    }
    if (2 * run.residuals() < 6 * run.windows())
      return {std::nullopt, whose + "more than half of the IMU's samples are missing or saturated"};
    run.cut_into(static_cast<int>(std::ceil(kFirstSegment * parameters.time_unit_s() / run.window_s())));
    problem.runs.push_back(std::move(run));
  }
  double cost = 0;
  const auto ended = [] { return FitOutcome{std::nullopt, "interrupted"}; };
  // The masses' lag and the residuals' size are those of a first fit.
  for (int pass = 0; pass < 2; ++pass) {
    if (!converge(problem, kNear, cost, progress)) return ended();
    for (RunFit& run : problem.runs) {
      run.set_lag(problem.values);
      run.set_variances();
    }
  }
  if (!converge(problem, kNear, cost, progress) || !join_segments(problem, cost, progress) ||
      !converge(problem, kConverged, cost, progress)) {
    return ended();
  }
  if (!std::isfinite(cost)) return {std::nullopt, "the believed robot does not roll along the recorded motion"};
  Identified out;
  conclude(problem, out);
  return {std::move(out), ""};
}

VectorXd predicted_sigma(const Parameters& parameters, RunFit& run) {
  run.cut_into(run.windows());
  const Reduced reduced = run.linearise(parameters.believed(), 0);
  const Spectrum spectrum(reduced.information, parameters.scale());
  VectorXd variance = VectorXd::Zero(parameters.count());
  for (Index k = 0; k < parameters.count(); ++k) {
    const double information = std::max(spectrum.solver.eigenvalues()[k], 1.0);
    variance += spectrum.solver.eigenvectors().col(k).cwiseAbs2() / information;
  }
  return variance.cwiseSqrt();
}

}  // namespace ballast::identify
