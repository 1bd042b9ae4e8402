// The Cortex-M4F's firmware, its model in single precision, beside the host's in double: the same pulses to the bit,
// and an estimate of the envelope that is off by no more than rounding makes it.
#include <gtest/gtest.h>

#include <ballast/controller_status_t.hpp>
#include <cmath>
#include <iostream>
#include <lcm/lcm-cpp.hpp>
#include <limits>
#include <map>

#include "hal/lcm/channels.h"
#include "sim/scenario/reader.h"
#include "tests/sil/shell.h"

namespace ballast {
namespace {

using Channels = std::map<std::string, std::vector<std::string>>;  // the messages of each, in order

Channels read_log(const std::filesystem::path& path) {
  Channels channels;
  lcm::LogFile log(path.string(), "r");
  while (const auto* event = log.readNextEvent()) {
    channels[event->channel].emplace_back(static_cast<const char*>(event->data), event->datalen);
  }
  return channels;
}

std::string bytes_of(const controller_status_t& status) {
  std::string bytes(static_cast<std::size_t>(status.getEncodedSize()), '\0');
  status.encode(bytes.data(), 0, status.getEncodedSize());
  return bytes;
}

constexpr double kEpsilon = std::numeric_limits<float>::epsilon();  // 1.2e-7

// The allowed difference of a status: 20 epsilons of the terms that N and f_s are sums of, which
// tests/firmware/precision_test.cpp derives. The terms, weight and what the masses' motion adds, are less than twice
// the weight here.
struct Tolerance {
  double force_n;
  explicit Tolerance(const sim::Scenario& scenario) : force_n(20 * kEpsilon * 2 * weight_n(scenario)) {}
  static double weight_n(const sim::Scenario& scenario) {
    double mass_kg = scenario.ball.mass_kg;
    for (const auto& mass : scenario.masses) mass_kg += mass.mass_kg;
    return mass_kg * scenario.gravity_mps2;
  }
  // d(f/N) = df / N + f dN / N^2
  [[nodiscard]] double ratio(double normal_force_n, double mu) const { return force_n * (1 + mu) / normal_force_n; }
};

struct Worst {
  double force_n = 0, mu_required = 0;
};

void compare(const controller_status_t& host, controller_status_t single, double static_friction,
             const Tolerance& tolerance, Worst& worst) {
  ASSERT_GT(host.normal_force_n, 0);
  EXPECT_NEAR(single.normal_force_n, host.normal_force_n, tolerance.force_n);
  EXPECT_NEAR(single.static_friction_n, host.static_friction_n, tolerance.force_n);
  const double ratio = tolerance.ratio(host.normal_force_n, host.mu_required);
  EXPECT_NEAR(single.mu_required, host.mu_required, ratio);
  // 1 - mu / mu_s; one more rounding of mu / mu_s, and of mu_s.
  const auto margin = [&](double ratio_off, double mu) {
    return (ratio_off + kEpsilon * mu) / static_friction + kEpsilon;
  };
  EXPECT_NEAR(single.margin, host.margin, margin(ratio, host.mu_required));
  worst.force_n = std::fmax(worst.force_n, std::fabs(single.normal_force_n - host.normal_force_n));
  worst.force_n = std::fmax(worst.force_n, std::fabs(single.static_friction_n - host.static_friction_n));
  worst.mu_required = std::fmax(worst.mu_required, std::fabs(single.mu_required - host.mu_required));
  if (host.planned != 0) {
    // Some 40 steps of an attitude integrated in single precision: its errors, an epsilon a step, add up, and grow with
    // the ball's motion by no more than a factor of ten in these times.
    EXPECT_NEAR(single.plan_normal_force_min_n, host.plan_normal_force_min_n, 10 * tolerance.force_n);
    const double plan_ratio = 10 * tolerance.ratio(host.plan_normal_force_min_n, host.plan_mu_required_max);
    EXPECT_NEAR(single.plan_mu_required_max, host.plan_mu_required_max, plan_ratio);
    EXPECT_NEAR(single.plan_margin_min, host.plan_margin_min, margin(plan_ratio, host.plan_mu_required_max));
    single.plan_normal_force_min_n = host.plan_normal_force_min_n;
    single.plan_mu_required_max = host.plan_mu_required_max;
    single.plan_margin_min = host.plan_margin_min;
  }
  // Nothing else is of the model. Positions and velocities are rounded for the status only.
  for (int i = 0; i < 8; ++i) {
    EXPECT_EQ(single.commanded_position[i], static_cast<double>(static_cast<float>(host.commanded_position[i])));
    EXPECT_EQ(single.commanded_velocity[i], static_cast<double>(static_cast<float>(host.commanded_velocity[i])));
    single.commanded_position[i] = host.commanded_position[i];
    single.commanded_velocity[i] = host.commanded_velocity[i];
  }
  single.normal_force_n = host.normal_force_n;
  single.static_friction_n = host.static_friction_n;
  single.mu_required = host.mu_required;
  single.margin = host.margin;
  EXPECT_TRUE(bytes_of(single) == bytes_of(host));
}

// Both runs; then every message but the status is the same to the bit, and the status is within its tolerance.
void expect_same_run(const std::string& name, const std::vector<std::string>& overrides, int exit_status) {
  std::string arguments = name;
  for (const auto& set : overrides) arguments += " --set " + set;
  SCOPED_TRACE(arguments);
  const auto read = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + name + ".toml", overrides);
  ASSERT_TRUE(read.ok());
  const test::Folder folder;
  const auto host_run = folder.run("ballast run " + arguments + " --quiet --out host");
  const auto single_run = folder.run("ballast run " + arguments + " --quiet --firmware qemu-an386 --out single");
  ASSERT_EQ(host_run.exit_status, exit_status) << host_run.err;
  ASSERT_EQ(single_run.exit_status, exit_status) << single_run.err;
  const Channels host = read_log(folder / "host/run.lcmlog"), single = read_log(folder / "single/run.lcmlog");
  ASSERT_EQ(host.size(), single.size());
  Worst worst;
  for (const auto& [channel, messages] : host) {
    SCOPED_TRACE(channel);
    ASSERT_TRUE(single.contains(channel));
    const auto& others = single.at(channel);
    ASSERT_EQ(others.size(), messages.size());
    if (channel != hal::kChannelControllerStatus) {
      EXPECT_TRUE(others == messages);
      continue;
    }
    const Tolerance tolerance(read.scenario);
    for (std::size_t k = 0; k < messages.size() && !testing::Test::HasFailure(); ++k) {
      SCOPED_TRACE("message " + std::to_string(k));
      controller_status_t a, b;
      ASSERT_GT(a.decode(messages[k].data(), 0, static_cast<int>(messages[k].size())), 0);
      ASSERT_GT(b.decode(others[k].data(), 0, static_cast<int>(others[k].size())), 0);
      compare(a, b, read.scenario.surface.static_friction, tolerance, worst);
    }
  }
  ASSERT_TRUE(host.contains(hal::kChannelStepCommand));
  EXPECT_GT(worst.force_n, 0) << "is this single precision?";
  std::cout << arguments << ": N and f_s off by at most " << worst.force_n << " N, f_s/N by " << worst.mu_required
            << "\n";
}

TEST(TargetSinglePrecision, ThePapersWholeRun) { expect_same_run("paper_ball", {}, 0); }
TEST(TargetSinglePrecision, TheWholeRunOfDeskBall) { expect_same_run("desk_ball", {}, 0); }
TEST(TargetSinglePrecision, ASpline) { expect_same_run("seam_ball", {"duration=2"}, 0); }

// A log of its own, which the host's firmware could not equal.
TEST(TargetSinglePrecision, AReplay) {
  const test::Folder folder;
  const auto run = folder.run("ballast run paper_ball --set duration=0.5 --quiet --firmware qemu-an386 --out single");
  ASSERT_EQ(run.exit_status, 0) << run.err;
  const auto replay = folder.run("ballast replay single --verify --firmware qemu-an386");
  EXPECT_EQ(replay.exit_status, 0) << replay.out << replay.err;
  EXPECT_NE(replay.out.find("given to the firmware in QEMU, on mps2_an386"), std::string::npos) << replay.out;
  EXPECT_EQ(folder.run("ballast replay single --verify").exit_status, 3);
}

// Its longest tick plans the stop, in software doubles. It is served within 1 ms.
TEST(TargetSinglePrecision, AStop) { expect_same_run("paper_ball", {"envelope.friction_use=0.3"}, 3); }

}  // namespace
}  // namespace ballast
