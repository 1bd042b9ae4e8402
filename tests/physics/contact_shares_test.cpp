// The causes' shares of the contact force: against the paper's closed forms, a case by hand, and the rest when a cause
// is taken away.
#include "sim/plant/contact_shares.h"

#include <gtest/gtest.h>

#include "firmware/model/rolling.h"
#include "sim/plant/plant.h"
#include "tests/physics/closed_form_run.h"
#include "tests/physics/random_robot.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

using Eigen::Vector3d;

struct RandomInstant {
  Scenario scenario;
  std::array<double, 4> q;
  std::array<double, 3> omega;
  std::array<double, kMaxMasses> position{}, velocity{}, acceleration{};
};

RandomInstant draw(test::RandomRobot& random) {
  RandomInstant s{.scenario = random.scenario(random.integer(1, kMaxMasses)), .q = {}, .omega = {}};
  const double rate = std::sqrt(s.scenario.gravity_mps2 / s.scenario.ball.radius_m);
  const Eigen::Quaterniond q = random.attitude();
  s.q = {q.w(), q.x(), q.y(), q.z()};
  for (double& o : s.omega) o = rate * random.uniform(-1, 1);
  for (std::size_t i = 0; i < s.scenario.masses.size(); ++i) {
    const double unit = s.scenario.masses[i].rail.shape == firmware::RailShape::kCircle ? 1 : s.scenario.ball.radius_m;
    s.position[i] = unit * random.uniform(-3, 3);
    s.velocity[i] = unit * rate * random.uniform(-1, 1);
    s.acceleration[i] = unit * rate * rate * random.uniform(-1, 1);
  }
  return s;
}

Vector3d force_W_n(const Body& body, const RandomInstant& s, const CarriedMasses& masses) {
  MotionOf<double> motion;
  rolling_prescribed(body, 0, s.q.data(), s.omega.data(), masses, motion);
  return motion.rotation_B_to_W * motion.contact_force_B_n;
}

// The sum is the force the paper's closed forms give; without a mass's own motion exactly that share is missing;
// without gravity all the weights are; with nothing turning, and the masses still, all that was carried round.
TEST(ContactShares, AddUpAndAreWhatIsMissingWithoutTheirCause) {
  const std::uint64_t seed = ballast::test::random_seed(20261121);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  for (int trial = 0; trial < 2000; ++trial) {
    const RandomInstant s = draw(random);
    const Body body(s.scenario);
    CarriedMasses masses;
    carry_along(body, s.position.data(), s.velocity.data(), s.acceleration.data(), masses);
    const ContactShares shares = contact_shares(body, 0, s.q.data(), s.omega.data(), masses);

    firmware::MassMotion motion;
    motion.position = s.position;
    motion.velocity = s.velocity;
    motion.acceleration = s.acceleration;
    const auto paper =
        firmware::rolling_forces(test::ball_params(s.scenario), firmware::Quaternion(s.q[0], s.q[1], s.q[2], s.q[3]),
                                 Vector3d(s.omega[0], s.omega[1], s.omega[2]), motion);
    // Rounding: a thousand operations on forces of this size, with a matrix conditioned like that of any ball.
    const double rounding_n = 1e-12 * (body.total_mass_kg * body.gravity_mps2 + shares.force_W_n.norm());
    EXPECT_NEAR(shares.force_W_n[2], paper.normal_force_n, rounding_n);
    EXPECT_NEAR((shares.force_W_n.head<2>() - paper.friction_force_W_n).norm(), 0, rounding_n);

    const Vector3d all = force_W_n(body, s, masses);
    Vector3d weights = shares.shell.weight_W_n;
    for (int i = 0; i < body.mass_count; ++i) {
      const auto j = static_cast<std::size_t>(i);
      CarriedMasses one_still = masses;
      one_still[j].velocity_B_mps = one_still[j].acceleration_B_mps2 = {0, 0, 0};
      const Vector3d missing = all - force_W_n(body, s, one_still);
      EXPECT_NEAR((missing - shares.mass[j].motion_W_n).norm(), 0, rounding_n) << "mass " << i;
      weights += shares.mass[j].weight_W_n;
    }
    Body weightless = body;
    weightless.gravity_mps2 = 0;
    EXPECT_NEAR((all - force_W_n(weightless, s, masses) - weights).norm(), 0, rounding_n);

    CarriedMasses still = masses;
    for (CarriedMass& mass : still) mass.velocity_B_mps = mass.acceleration_B_mps2 = {0, 0, 0};
    RandomInstant held = s;
    held.omega = {};
    Vector3d turning = shares.shell.turning_W_n;
    for (int i = 0; i < body.mass_count; ++i) turning += shares.mass[static_cast<std::size_t>(i)].turning_W_n;
    EXPECT_NEAR((force_W_n(body, s, still) - force_W_n(body, held, still) - turning).norm(), 0, rounding_n);

    if (shares.static_weight_n > 0) {
      double parts = part_of_friction(shares, shares.shell) + part_of_friction(shares, shares.outside);
      for (int i = 0; i < body.mass_count; ++i) {
        parts += part_of_friction(shares, shares.mass[static_cast<std::size_t>(i)]);
      }
      // Forces that nearly cancel make parts far above 1, with their rounding.
      const double sharpest = std::max(1.0, shares.force_W_n.norm() / shares.force_W_n.head<2>().norm());
      EXPECT_NEAR(parts, 1, 1e-10 * sharpest * body.total_mass_kg * body.gravity_mps2 / shares.static_weight_n);
    }
  }
}

// On a sloping floor that resists, its moment is one load more.
TEST(ContactShares, AddUpOnRealFloors) {
  const std::uint64_t seed = ballast::test::random_seed(20261123);
  SCOPED_TRACE("seed " + std::to_string(seed));
  test::RandomRobot random(seed);
  int resisted = 0;
  for (int trial = 0; trial < 500; ++trial) {
    RandomInstant s = draw(random);
    random.make_floor_real(s.scenario);
    const Body body(s.scenario);
    CarriedMasses masses;
    carry_along(body, s.position.data(), s.velocity.data(), s.acceleration.data(), masses);
    const ContactShares shares = contact_shares(body, 0, s.q.data(), s.omega.data(), masses);
    const Vector3d all = force_W_n(body, s, masses);
    EXPECT_LT((shares.force_W_n - all).norm(), 1e-12 * (body.total_mass_kg * body.gravity_mps2 + all.norm()));
    resisted += shares.floor.turning_W_n.isZero(0) ? 0 : 1;
    if (!(shares.static_weight_n > 0)) continue;
    double parts = part_of_friction(shares, shares.shell) + part_of_friction(shares, shares.outside) +
                   part_of_friction(shares, shares.floor);
    for (int i = 0; i < body.mass_count; ++i) {
      parts += part_of_friction(shares, shares.mass[static_cast<std::size_t>(i)]);
    }
    const double sharpest = std::max(1.0, shares.force_W_n.norm() / shares.force_W_n.head<2>().norm());
    EXPECT_NEAR(parts, 1, 1e-10 * sharpest * body.total_mass_kg * body.gravity_mps2 / shares.static_weight_n);
  }
  EXPECT_GE(resisted, 200);
}

// Two masses on the level of the centre, at x and -y of it along e1, everything at rest. By hand: about the contact
// line the inertia is A = d + M r^2 + m x^2 + n y^2; m alone turns the ball by m g x / A, so it takes the friction
// M r m g x / A and lifts its own weight by (m x - n y) m g x / A.
TEST(ContactShares, TwoMassesByHand) {
  Scenario scenario;
  scenario.gravity_mps2 = 10;
  scenario.ball.radius_m = 0.5;
  scenario.ball.mass_kg = 2;
  scenario.ball.inertia_kgm2 = {0.3, 0.3, 0.3};
  scenario.masses.resize(2);
  scenario.masses[0].mass_kg = 1;
  scenario.masses[1].mass_kg = 0.5;
  const Body body(scenario);
  const double m = 1, n = 0.5, x = 0.3, y = 0.2, g = 10, r = 0.5, total = 3.5;
  CarriedMasses masses{};
  masses[0].position_B_m = {x, 0, 0};
  masses[1].position_B_m = {-y, 0, 0};
  const double q[] = {1, 0, 0, 0}, omega[] = {0, 0, 0};
  const ContactShares shares = contact_shares(body, 0, q, omega, masses);
  const double inertia = 0.3 + total * r * r + m * x * x + n * y * y;
  const double turn_m = m * g * x / inertia, turn_n = -n * g * y / inertia;
  constexpr double kRounding = 1e-13;
  EXPECT_NEAR(shares.mass[0].weight_W_n[0], total * r * turn_m, kRounding);
  EXPECT_NEAR(shares.mass[1].weight_W_n[0], total * r * turn_n, kRounding);
  EXPECT_NEAR(shares.mass[0].weight_W_n[2], m * g - (m * x - n * y) * turn_m, kRounding);
  EXPECT_NEAR(shares.mass[1].weight_W_n[2], n * g - (m * x - n * y) * turn_n, kRounding);
  EXPECT_NEAR(shares.shell.weight_W_n[2], 20, kRounding);
  const double turn = turn_m + turn_n, friction = total * r * turn, normal = total * g - (m * x - n * y) * turn;
  const double mu = friction / normal;
  EXPECT_NEAR(mu * part_of_friction(shares, shares.mass[0]),
              (total * r * turn_m + mu * (m * x - n * y) * turn_m) / (total * g), kRounding);
  EXPECT_NEAR(part_of_friction(shares, shares.mass[0]), turn_m / turn, kRounding);
  EXPECT_NEAR(part_of_friction(shares, shares.shell), 0, kRounding);
}

// Nothing pushes sideways, and one of two masses throws itself down faster than the floor could follow: N < 0 is all
// its doing.
TEST(ContactShares, WhereNFallsToZeroOnlyLiftingCounts) {
  Scenario scenario;
  scenario.gravity_mps2 = 10;
  scenario.ball.radius_m = 0.5;
  scenario.ball.mass_kg = 2;
  scenario.ball.inertia_kgm2 = {0.3, 0.3, 0.3};
  scenario.masses.resize(2);
  scenario.masses[0].mass_kg = scenario.masses[1].mass_kg = 1;
  CarriedMasses masses{};
  masses[1].acceleration_B_mps2 = {0, 0, -60};
  const double q[] = {1, 0, 0, 0}, omega[] = {0, 0, 0};
  const ContactShares shares = contact_shares(Body(scenario), 0, q, omega, masses);
  EXPECT_NEAR(shares.force_W_n[2], -20, 1e-12);
  EXPECT_NEAR(part_of_friction(shares, shares.mass[0]), 0, 1e-14);
  EXPECT_NEAR(part_of_friction(shares, shares.mass[1]), 1, 1e-14);
}

TEST(ContactShares, WithoutAWeightOnTheFloorNothingCanBeSaid) {
  EXPECT_TRUE(std::isnan(part_of_friction(ContactShares{}, Vector3d::Zero(), 0)));
}

// The plant's record of the instant of its greatest f_s / N gives that f_s / N again.
TEST(ContactShares, ThePlantsAreThoseOfItsMaximum) {
  for (const char* name : {"paper_ball", "paper_disk", "paper_detach", "seam_ball", "tumbleweed"}) {
    SCOPED_TRACE(name);
    const auto read = read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + name + ".toml",
                                    {"run.actuation=prescribed", "surface.static_friction=inf"});
    ASSERT_TRUE(read.ok());
    Plant plant(read.scenario);
    plant.advance(read.scenario.duration_s, {});
    const auto shares = plant.shares_at_mu_required_max();
    ASSERT_TRUE(shares);
    const double friction = shares->force_W_n.head<2>().norm(), normal = shares->force_W_n[2];
    const double mu = plant.extrema().mu_required_max.value;
    // paper_detach ends at N = 0, located to rounding of the forces it is a difference of.
    if (std::isinf(mu)) {
      EXPECT_NEAR(normal, 0, 1e-9 * shares->static_weight_n);
    } else {
      EXPECT_NEAR(friction / normal, mu, 1e-12);
    }
  }
}

}  // namespace
}  // namespace ballast::sim
