// The firmware with its model in single precision against the one in double: two programs, built from
// precision_run.cpp.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "tests/random_seed.h"

namespace ballast {
namespace {

constexpr double kEpsilon = std::numeric_limits<float>::epsilon();  // 1.2e-7

// Relative to the sum of the forces' terms, if all roundings on the way from an input to a force add up. An angle of
// 10 rad is known to 4 epsilons. Each of at most 32 inputs and operations rounds by half of one: 6 for a mass's place,
// 6 for the cross products with the angular velocity, 6 for its sum with the other accelerations and its mass, 4 for
// the sum of the bodies, 10 for the attitude and the product with it.
constexpr double kTolerance = 20 * kEpsilon;

// The rows of a program's output, by name.
using Rows = std::map<std::string, std::vector<std::vector<double>>>;

Rows output_of(const std::string& program, const std::string& argument) {
  Rows rows;
  FILE* pipe = popen((program + " " + argument).c_str(), "r");
  if (pipe == nullptr) return rows;
  std::array<char, 512> line;
  while (std::fgets(line.data(), line.size(), pipe) != nullptr) {
    std::istringstream words(line.data());
    std::string name, number;
    words >> name;
    std::vector<double> numbers;
    while (words >> number) numbers.push_back(std::strtod(number.c_str(), nullptr));
    rows[name].push_back(numbers);
  }
  EXPECT_EQ(pclose(pipe), 0) << program << " " << argument;
  return rows;
}

struct Both {
  explicit Both(const std::string& argument)
      : wide(output_of(BALLAST_PRECISION_DOUBLE, argument)), single(output_of(BALLAST_PRECISION_FLOAT, argument)) {}
  Rows wide, single;
};

// Rows of N, f_s, f_s/N and the sum of the terms. f_s/N is compared where N is more than a tenth of that sum.
void compare_forces(Both& both, const std::string& name, std::size_t count) {
  const auto &wide = both.wide[name], &single = both.single[name];
  ASSERT_EQ(wide.size(), count);
  ASSERT_EQ(single.size(), count);
  double worst = 0;
  for (std::size_t k = 0; k < count; ++k) {
    SCOPED_TRACE(name + " " + std::to_string(k));
    const double n = wide[k][0], mu = wide[k][2], scale = wide[k][3], allowed = kTolerance * scale;
    for (std::size_t j = 0; j < 2; ++j) {
      ASSERT_NEAR(single[k][j], wide[k][j], allowed);
      worst = std::fmax(worst, std::fabs(single[k][j] - wide[k][j]) / scale);
    }
    // d(f/N) = df / N + f dN / N^2
    if (n > 0.1 * scale) {
      ASSERT_NEAR(single[k][2], mu, allowed * (1 + mu) / n);
    }
  }
  std::cout << name << ": off by " << worst / kEpsilon << " epsilons of the forces' terms\n";
  EXPECT_GT(worst, 0) << "is this single precision?";
}

TEST(SinglePrecision, EnvelopeOfRandomStates) {
  Both both("states " + std::to_string(test::random_seed(20240719)));
  compare_forces(both, "state", 20'000);
}

// Times, positions and steps are double in both, so the steps are the same.
TEST(SinglePrecision, StepsOfThePapersRunAreTheSame) {
  Both both("motion");
  EXPECT_GT(both.wide["burst"].size(), 3'000u);
  EXPECT_TRUE(both.single["burst"] == both.wide["burst"]);
  compare_forces(both, "tick", 20'000);
}

TEST(SinglePrecision, StopsAndMovesTakeTheSameStepsAndArePredictedAlike) {
  Both both("stop");
  EXPECT_GT(both.wide["burst"].size(), 1'000u);
  EXPECT_TRUE(both.single["burst"] == both.wide["burst"]);
  const auto &wide = both.wide["plan"], &single = both.single["plan"];
  ASSERT_EQ(single.size(), wide.size());
  ASSERT_GE(wide.size(), 2u) << "a stop and a move at least";
  for (std::size_t k = 0; k < wide.size(); ++k) {
    EXPECT_EQ(single[k][0], wide[k][0]) << "duration";
    // Up to 44 evaluations along an attitude integrated in single precision. Its errors, an epsilon a step, add up, and
    // grow with the ball's motion by no more than a factor of ten in these times.
    for (std::size_t j = 1; j < 4; ++j) EXPECT_NEAR(single[k][j], wide[k][j], 8 * 10 * kTolerance);
  }
}

}  // namespace
}  // namespace ballast
