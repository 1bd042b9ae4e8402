#include "tools/sweep/correlation.h"

#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tools/sweep/normal_quantile.h"

namespace ballast::sweep {
namespace {

// P(Z < z), within (0, 1).
double normal_probability(double z) {
  constexpr double kLeast = 0x1p-60, kMost = 1 - 0x1p-53;
  return std::clamp(std::erfc(-z / std::numbers::sqrt2) / 2, kLeast, kMost);
}

}  // namespace

std::string factor_correlations(Spec& spec) {
  std::vector<std::size_t>& places = spec.copula.places;
  places.clear();
  for (std::size_t i = 0; i < spec.vary.size(); ++i) {
    const bool named = std::any_of(spec.correlations.begin(), spec.correlations.end(), [&](const Correlation& c) {
      return c.first == spec.vary[i].key || c.second == spec.vary[i].key;
    });
    if (named) places.push_back(i);
  }
  const auto size = static_cast<Eigen::Index>(places.size());
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(size, size);
  const auto place_of = [&](const std::string& key) {
    const auto found =
        std::find_if(places.begin(), places.end(), [&](std::size_t i) { return spec.vary[i].key == key; });
    return static_cast<Eigen::Index>(found - places.begin());
  };
  for (const Correlation& c : spec.correlations) {
    const Eigen::Index i = place_of(c.first), j = place_of(c.second);
    matrix(i, j) = matrix(j, i) = c.value;
  }
  const Eigen::LLT<Eigen::MatrixXd> factored(matrix);
  if (factored.info() != Eigen::Success) {
    const double least = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix).eigenvalues().minCoeff();
    return fmt::format(
        "contradict each other: the matrix of all correlations is not positive definite (least eigenvalue {:.3g})",
        least);
  }
  const Eigen::MatrixXd lower = factored.matrixL();
  spec.copula.factor.clear();
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) spec.copula.factor.push_back(lower(i, j));
  }
  return "";
}

void correlate(const Copula& copula, std::span<double> uniform) {
  std::vector<double> independent;
  independent.reserve(copula.places.size());
  for (const std::size_t place : copula.places) independent.push_back(normal_quantile(uniform[place]));
  const double* factor = copula.factor.data();
  for (std::size_t i = 0; i < copula.places.size(); ++i) {
    double sum = 0;
    for (std::size_t j = 0; j <= i; ++j) sum += *factor++ * independent[j];
    uniform[copula.places[i]] = normal_probability(sum);
  }
}

}  // namespace ballast::sweep
