// The plant keeps the conserved quantities of mechanics: energy, the work of motors and friction, and the integrals of
// Jellett, Routh and Chaplygin.
//
// Derivations, in the space frame: G the geometric centre, X the vector from G to the centre of mass of the whole, s =
// r e3 + X the vector from the contact point to it, L the angular momentum about it, R the contact force, M the whole
// mass, F the external force at G. Newton and Euler are
//   M xddot = R + F - M g e3,   Ldot = -s x R - X x F,
// whatever R is: rolling, sliding, flight, and with impulses in its place impacts.
//
// Tolerances. A step of the integrator adds at most 1e-12 (1 + |y|) to each component of the state, and an error in a
// conserved quantity stays what it is: such errors add up and do not grow. A run here takes up to some thousand steps,
// and the errors have no common sign; what is measured is below 1e-11 of the quantity's own scale. The bar is 1e-10.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "sim/plant/plant.h"
#include "tests/physics/mechanics.h"
#include "tests/physics/random_robot.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

using Eigen::Vector3d;

constexpr double kBar = 1e-10;

// Speed, momentum and energy of things that fall by a radius.
struct Scale {
  explicit Scale(const Scenario& s) : speed(std::sqrt(s.gravity_mps2 * s.ball.radius_m)) {
    double mass = s.ball.mass_kg;
    for (const auto& m : s.masses) mass += m.mass_kg;
    energy = mass * speed * speed;
    angular_momentum = mass * s.ball.radius_m * speed;
    time = s.ball.radius_m / speed;
  }
  double speed, energy, angular_momentum, time;
};

void hold_still(Scenario& s) {
  for (auto& m : s.masses) {
    m.initial_velocity = 0;
    m.motion.clear();
  }
}

void start_with(Scenario& s, const Vector3d& velocity_W_mps, double height_m) {
  s.initial.has_velocity = true;
  s.initial.velocity_W_mps = velocity_W_mps;
  s.initial.height_m = height_m;
}

// A floor that bounces and on which the ball slides and rolls, and a throw onto it.
void throw_onto_a_floor(Scenario& s, test::RandomRobot& random) {
  const Scale scale(s);
  const double mu = random.uniform(0.1, 0.4);
  s.run.on_violation = OnViolation::kContinue;
  s.surface = {
      .static_friction = mu, .kinetic_friction = mu * random.uniform(0.6, 1), .restitution = random.uniform(0.2, 0.6)};
  s.initial.angular_velocity_B_radps = random.vector(3) / scale.time;
  start_with(s, scale.speed * random.vector(1), 0.3 * s.ball.radius_m);
  s.duration_s = 6 * scale.time;
}

// Runs to the end in `ticks` ticks and gives the largest |value() - value() at the start|.
template <class Value>
double greatest_change(Plant& plant, double duration_s, int ticks, Value value) {
  const auto start = value();
  double worst = 0;
  for (int k = 1; k <= ticks && plant.end() == PhysicsEnd::kNone; ++k) {
    plant.advance(duration_s * k / ticks, {});
    const Eigen::VectorXd change = value() - start;
    worst = std::max(worst, change.norm());
  }
  return worst;
}

using Scalar = Eigen::Matrix<double, 1, 1>;

struct Seen {
  int rolling = 0, sliding = 0, flight = 0, impacts = 0;
  void count(const Plant& plant) {
    for (const auto& r : plant.regimes()) {
      (r.regime == Regime::kRolling ? rolling : r.regime == Regime::kSliding ? sliding : flight) += 1;
    }
    impacts += static_cast<int>(plant.impacts().size());
  }
  // Each of them is among what was tested.
  void expect_everything() const {
    EXPECT_GE(rolling, 5);
    EXPECT_GE(sliding, 10);
    EXPECT_GE(flight, 10);
    EXPECT_GE(impacts, 20);
  }
};

// Contact forces do no work in rolling, and the external force has a potential.
TEST(Conserved, EnergyOfARollingBallWhoseMassesRest) {
  const std::uint64_t seed = ballast::test::random_seed(41);
  double worst = 0;
  for (int trial = 0; trial < 30; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(trial % 4);
    hold_still(s);
    const Scale scale(s);
    s.ball.center_of_mass_B_m = 0.4 * s.ball.radius_m * random.direction();
    s.initial.angular_velocity_B_radps = random.vector(0.5) / scale.time;
    s.duration_s = 10 * scale.time;
    Plant plant(s);
    const Vector3d before = plant.sample().angular_velocity_B_radps;
    const double change =
        greatest_change(plant, s.duration_s, 50, [&] { return Scalar(test::whole(s, plant.sample()).energy_j); });
    ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
    EXPECT_GT((plant.sample().angular_velocity_B_radps - before).norm() * scale.time, 1e-3);
    EXPECT_LT(change, kBar * scale.energy);
    worst = std::max(worst, change / scale.energy);
  }
  RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
}

// A body of revolution about E3 whose centre of mass is on it: shell with d1 = d2, masses resting on the axis. X = l
// E3, and the whole has the moments I1 = I2 and I3 about its centre of mass. The external force is vertical.
struct Revolution {
  Scenario scenario;
  double mass, l, i1, i3;
};

Revolution body_of_revolution(test::RandomRobot& random, int mass_count) {
  Revolution b{random.scenario(mass_count), 0, 0, 0, 0};
  Scenario& s = b.scenario;
  const double r = s.ball.radius_m;
  s.ball.inertia_kgm2[1] = s.ball.inertia_kgm2[0];
  if (s.ball.inertia_kgm2[2] > 2 * s.ball.inertia_kgm2[0]) s.ball.inertia_kgm2[2] = s.ball.inertia_kgm2[0];
  s.ball.center_of_mass_B_m = {0, 0, r * random.uniform(-0.4, 0.4)};
  s.external_force_W_n = {0, 0, s.external_force_W_n[2]};
  b.mass = s.ball.mass_kg;
  b.l = s.ball.mass_kg * s.ball.center_of_mass_B_m[2];
  for (auto& m : s.masses) {
    m.rail = firmware::line({0, 0, 0}, {0, 0, 1});
    m.initial_position = r * random.uniform(-0.8, 0.8);
    b.mass += m.mass_kg;
    b.l += m.mass_kg * m.initial_position;
  }
  hold_still(s);
  b.l /= b.mass;
  b.i1 = s.ball.inertia_kgm2[0] + s.ball.mass_kg * std::pow(s.ball.center_of_mass_B_m[2] - b.l, 2);
  for (const auto& m : s.masses) b.i1 += m.mass_kg * std::pow(m.initial_position - b.l, 2);
  b.i3 = s.ball.inertia_kgm2[2];
  return b;
}

// Jellett's integral L . s (Jellett 1872; Routh, Advanced Part, 1905, art. 243; the tippe top's). d(L . s)/dt = -(s x
// R) . s - (X x F) . s + L . sdot. The first is 0; so is the second for a vertical F; and sdot = omega x X, so that
// L . sdot = l (I1 omega + (I3 - I1) Omega_3 E3) . (omega x E3) = 0. Nothing was said of R: L . s = I Omega . (r Gamma
// + l E3) keeps its value in rolling, sliding and flight and through impacts.
TEST(Conserved, JellettsIntegralThroughEveryRegime) {
  const std::uint64_t seed = ballast::test::random_seed(42);
  double worst = 0;
  Seen seen;
  for (int trial = 0; trial < 30; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = body_of_revolution(random, trial % 3).scenario;
    throw_onto_a_floor(s, random);
    const Scale scale(s);
    Plant plant(s);
    const double change = greatest_change(plant, s.duration_s, 60, [&] {
      const auto p = plant.sample();
      const test::Whole w = test::whole(s, p);
      const Vector3d to_center = w.center_W_m - p.position_W_m + Vector3d(0, 0, s.ball.radius_m);
      return Scalar(w.angular_momentum_W.dot(to_center));
    });
    ASSERT_EQ(plant.end(), PhysicsEnd::kNone) << plant.end_text();
    EXPECT_LT(change, kBar * scale.angular_momentum * s.ball.radius_m);
    worst = std::max(worst, change / (scale.angular_momentum * s.ball.radius_m));
    seen.count(plant);
  }
  seen.expect_everything();
  RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
}

// Routh's sphere, the rolling body of revolution: Omega_3 sqrt(D) is constant, with (gamma = Gamma_3, a = r gamma + l)
//   D = I1 I3 + M (I1 r^2 (1 - gamma^2) + I3 a^2)
// (Routh, Advanced Part, art. 244; Chaplygin 1897; D = I1 I3 + M s . I s in Borisov and Mamaev, "Rolling of a rigid
// body on plane and sphere. Hierarchy of dynamics", Regul. Chaotic Dyn. 7 (2002), sect. 3). Derived here: with nu = E3
// x e3, Euler along E3 is I3 Omega_3dot = -r R . nu = -r M vdot . nu, v = omega x s the velocity of the centre of mass.
// v . nu = Omega_3 (r + l gamma) - a omega_z and v . nudot = -r omega_z gammadot, hence
//   vdot . nu = d/dt (Omega_3 (r + l gamma)) - a d/dt omega_z,
// and Jellett's I1 r omega_z + Omega_3 (I3 a - I1 r gamma) = const gives omega_z; all terms together are
// D Omega_3dot + Ddot Omega_3 / 2 = 0.
TEST(Conserved, RouthsIntegralInRolling) {
  const std::uint64_t seed = ballast::test::random_seed(43);
  double worst = 0;
  for (int trial = 0; trial < 30; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Revolution b = body_of_revolution(random, trial % 3);
    Scenario& s = b.scenario;
    const Scale scale(s);
    const double r = s.ball.radius_m;
    s.initial.angular_velocity_B_radps = random.vector(0.6) / scale.time;
    s.duration_s = 10 * scale.time;
    Plant plant(s);
    double spin_least = 1e9, spin_most = -1e9;
    const double change = greatest_change(plant, s.duration_s, 50, [&] {
      const auto p = plant.sample();
      const double gamma = p.up_B[2], a = r * gamma + b.l, spin = p.angular_velocity_B_radps[2];
      spin_least = std::min(spin_least, spin), spin_most = std::max(spin_most, spin);
      return Scalar(spin * std::sqrt(b.i1 * b.i3 + b.mass * (b.i1 * r * r * (1 - gamma * gamma) + b.i3 * a * a)));
    });
    ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
    EXPECT_GT((spin_most - spin_least) * scale.time, 1e-4);  // Omega_3 itself is not constant
    EXPECT_LT(change, kBar * scale.angular_momentum);
    worst = std::max(worst, change / scale.angular_momentum);
  }
  RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
}

// Masses in pairs, each the other's image in the geometric centre, moving alike: the centre of mass of the whole stays
// in the geometric centre, whatever the inertia.
Scenario mirrored(test::RandomRobot& random, int pairs) {
  Scenario s = random.scenario(pairs);
  s.ball.center_of_mass_B_m.setZero();
  s.external_force_W_n = {0, 0, s.external_force_W_n[2]};
  const auto masses = s.masses;
  for (Mass image : masses) {
    image.rail.origin_B_m *= -1;
    image.rail.axis_cos_B *= -1;
    image.rail.axis_sin_B *= -1;
    s.masses.push_back(image);
  }
  return s;
}

// Chaplygin's ball (X = 0): the momentum about the contact point's place, K = L + r e3 x M v, is a constant vector in
// space (Chaplygin 1903 for rolling). Kdot = -r e3 x R + r e3 x (R + F - M g e3) = 0 for a vertical F: in every regime,
// through impacts, and with masses moving, whose momentum is part of L. Of a billiard ball this is the law of 5/7.
TEST(Conserved, ChaplyginsMomentumThroughEveryRegimeWithMovingMasses) {
  const std::uint64_t seed = ballast::test::random_seed(44);
  double worst = 0;
  Seen seen;
  for (int trial = 0; trial < 24; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = mirrored(random, trial % 3);
    if (trial % 5 == 0) {
      s.duration_s = 5 * Scale(s).time;  // rolling from the start
    } else {
      throw_onto_a_floor(s, random);
    }
    const Scale scale(s);
    Plant plant(s);
    const double change = greatest_change(plant, s.duration_s, 60, [&] {
      const test::Whole w = test::whole(s, plant.sample());
      const Vector3d k = w.angular_momentum_W + Vector3d(0, 0, s.ball.radius_m).cross(w.mass_kg * w.velocity_W_mps);
      return k;
    });
    ASSERT_EQ(plant.end(), PhysicsEnd::kNone) << plant.end_text();
    EXPECT_LT(change, kBar * scale.angular_momentum);
    worst = std::max(worst, change / scale.angular_momentum);
    seen.count(plant);
  }
  seen.expect_everything();
  RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
}

// With driven masses flight keeps momentum too, the motors' forces being internal (prescribed masses: Flight.* in
// regimes_test.cpp).
TEST(Conserved, MomentumOfDrivenMassesInFlight) {
  const std::uint64_t seed = ballast::test::random_seed(45);
  for (int trial = 0; trial < 8; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(1 + trial % 4);
    const Scale scale(s);
    s.run.actuation = Actuation::kStepper;
    s.external_force_W_n.setZero();
    s.initial.angular_velocity_B_radps = random.vector(1) / scale.time;
    start_with(s, scale.speed * Vector3d(random.uniform(-1, 1), 0.5, 3), s.ball.radius_m);
    s.duration_s = 2 * scale.time;
    Plant plant(s);
    const test::Whole start = test::whole(s, plant.sample());
    const auto first = plant.sample().mass_position;
    constexpr int kTicks = 200;
    double moved = 0;
    for (int k = 1; k <= kTicks; ++k) {
      const int which = k % static_cast<int>(s.masses.size());
      plant.advance(s.duration_s * k / kTicks, std::array{StepPulse{0, which, k % 3 == 0 ? -1 : 1}});
      const double t = plant.time_s();
      const test::Whole now = test::whole(s, plant.sample());
      const Vector3d gravity(0, 0, -s.gravity_mps2);
      EXPECT_LT((now.center_W_m - start.center_W_m - t * start.velocity_W_mps - t * t / 2 * gravity).norm(),
                kBar * s.ball.radius_m);
      EXPECT_LT((now.velocity_W_mps - start.velocity_W_mps - t * gravity).norm(), kBar * scale.speed);
      EXPECT_LT((now.angular_momentum_W - start.angular_momentum_W).norm(), kBar * scale.angular_momentum);
    }
    ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
    ASSERT_EQ(plant.regimes().size(), 1u);
    for (std::size_t i = 0; i < s.masses.size(); ++i) {
      moved = std::max(moved, std::abs(plant.sample().mass_position[i] - first[i]));
    }
    EXPECT_GT(moved, 1e-3);
  }
}

// The integral of power() from where the plant is to end_s by Gauss and Legendre's five points on equal panels of u,
// with t = start + (end - start) u^3 (10 - 15 u + 6 u^2): the points crowd at both ends, where a slip that begins or
// vanishes may leave power() without derivatives.
template <class Power>
double work(Plant& plant, double end_s, int panels, Power power) {
  constexpr std::array<double, 5> kNode{0.04691007703066800, 0.2307653449471585, 0.5, 0.7692346550528415,
                                        0.9530899229693320};
  constexpr std::array<double, 5> kWeight{0.1184634425280945, 0.2393143352496832, 0.2844444444444444,
                                          0.2393143352496832, 0.1184634425280945};
  const double start_s = plant.time_s(), length = end_s - start_s;
  double sum = 0;
  for (int i = 0; i < panels; ++i) {
    for (std::size_t j = 0; j < 5; ++j) {
      const double u = (i + kNode[j]) / panels;
      plant.advance(start_s + length * u * u * u * (10 - u * (15 - 6 * u)), {});
      sum += length / panels * kWeight[j] * 30 * u * u * (1 - u) * (1 - u) * power(plant.sample());
    }
  }
  plant.advance(end_s, {});
  return sum;
}

// Power of motors and friction: the torque at each shaft times its speed, the rotor's share included, and
// f . slip.
double power_w(const Scenario& s, const Plant::Sample& p) {
  double power = p.friction_force_W_n.dot(test::contact_velocity_W_mps(s, p).head<2>());
  for (std::size_t i = 0; i < s.masses.size(); ++i) {
    power += p.motor_torque_nm[i] * s.masses[i].motor.shaft_ratio * p.mass_velocity[i];
  }
  return power;
}

double all_energy(const Scenario& s, const Plant::Sample& p) {
  return test::whole(s, p).energy_j + test::rotor_energy_j(s, p);
}

// Up to where the first impact is, if there is one.
std::vector<double> smooth_stretches(const Scenario& s) {
  Plant scout(s);
  for (int k = 1; k <= 200 && scout.end() == PhysicsEnd::kNone; ++k) scout.advance(s.duration_s * k / 200, {});
  double end_s = scout.time_s();
  if (!scout.impacts().empty()) end_s = scout.impacts().front().time_s;
  std::vector<double> times;
  for (const auto& r : scout.regimes()) times.push_back(r.time_s);
  for (const auto& m : s.masses) {
    double knot_s = 0;
    for (const auto& piece : m.motion) times.push_back(knot_s += piece.duration_s);
  }
  std::sort(times.begin(), times.end());
  std::vector<double> out;
  for (const double t : times) {
    if (t > 1e-9 && t < end_s - 1e-9 && (out.empty() || t > out.back() + 1e-9)) out.push_back(t);
  }
  // Not into the impact, whose impulse does work of its own.
  out.push_back(scout.impacts().empty() ? end_s : end_s - 1e-9);
  return out;
}

enum class Start { kRolling, kSliding, kFlight };

class WorkOf : public testing::TestWithParam<Start> {};

// Prescribed masses: the change of energy, stretch by stretch, is the motors' and the friction's work.
TEST_P(WorkOf, MotorsAndFrictionIsTheChangeOfEnergy) {
  const std::uint64_t seed = ballast::test::random_seed(46);
  double worst = 0, most_motor_work = 0, most_heat = 0;
  for (int trial = 0; trial < 12; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(trial % 5);
    const Scale scale(s);
    s.run.on_violation = OnViolation::kContinue;
    s.initial.angular_velocity_B_radps = random.vector(1) / scale.time;
    s.duration_s = 3 * scale.time;
    if (GetParam() == Start::kSliding) {
      s.surface = {.static_friction = 0.3, .kinetic_friction = 0.2, .restitution = 0};
      start_with(s, 2 * scale.speed * Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), 0), 0);
    } else if (GetParam() == Start::kFlight) {
      start_with(s, scale.speed * Vector3d(1, 0, 1), s.ball.radius_m);
    } else {
      s.run.on_violation = OnViolation::kStop;
    }
    Plant plant(s);
    for (const double end_s : smooth_stretches(s)) {
      const double before = all_energy(s, plant.sample());
      double motors = 0;
      const double done = work(plant, end_s, 40, [&](const Plant::Sample& p) {
        const double friction = p.friction_force_W_n.dot(test::contact_velocity_W_mps(s, p).head<2>());
        motors = std::max(motors, std::abs(power_w(s, p) - friction));
        if (p.regime == Regime::kSliding) {
          // Coulomb's law: f = -mu_k N e, so the rate is -mu_k N |slip|.
          const double speed = test::contact_velocity_W_mps(s, p).norm();
          EXPECT_NEAR(friction, -0.2 * p.normal_force_n * speed, 1e-12 * scale.energy / scale.time);
          most_heat = std::max(most_heat, -friction * scale.time / scale.energy);
        } else {
          EXPECT_NEAR(friction, 0, 1e-12 * scale.energy / scale.time);
        }
        return power_w(s, p);
      });
      const double error = std::abs(all_energy(s, plant.sample()) - before - done) / scale.energy;
      EXPECT_LT(error, kBar) << "from a stretch that ends at " << end_s;
      worst = std::max(worst, error);
      most_motor_work = std::max(most_motor_work, motors * scale.time / scale.energy);
    }
  }
  EXPECT_GT(most_motor_work, 0.01);
  if (GetParam() == Start::kSliding) {
    EXPECT_GT(most_heat, 0.1);
  }
  RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
}

INSTANTIATE_TEST_SUITE_P(Conserved, WorkOf, testing::Values(Start::kRolling, Start::kSliding, Start::kFlight),
                         [](const auto& start) {
                           return std::string(start.param == Start::kRolling   ? "Rolling"
                                              : start.param == Start::kSliding ? "Sliding"
                                                                               : "Flight");
                         });

// Masses at rest, sliding: nothing but friction changes the energy, and it takes mu_k N |slip|.
TEST(Conserved, SlidingLosesWhatFrictionTakes) {
  const std::uint64_t seed = ballast::test::random_seed(47);
  double worst = 0;
  int slid = 0;
  for (int trial = 0; trial < 20; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(trial % 4);
    hold_still(s);
    const Scale scale(s);
    s.external_force_W_n.setZero();
    s.run.on_violation = OnViolation::kContinue;
    s.surface = {.static_friction = 0.3, .kinetic_friction = 0.25, .restitution = 0};
    s.initial.angular_velocity_B_radps = random.vector(2) / scale.time;
    start_with(s, 2 * scale.speed * Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), 0), 0);
    s.duration_s = 3 * scale.time;
    Plant plant(s);
    const double first = test::whole(s, plant.sample()).energy_j;
    for (const double end_s : smooth_stretches(s)) {
      const double before = test::whole(s, plant.sample()).energy_j;
      const double heat = work(plant, end_s, 40, [&](const Plant::Sample& p) {
        return p.regime == Regime::kSliding ? 0.25 * p.normal_force_n * test::contact_velocity_W_mps(s, p).norm() : 0;
      });
      const double error = std::abs(test::whole(s, plant.sample()).energy_j - before + heat) / scale.energy;
      EXPECT_LT(error, kBar);
      worst = std::max(worst, error);
      slid += heat > 0.01 * scale.energy;
    }
    // Some take off at once and lose nothing: up to the bar.
    EXPECT_LT(test::whole(s, plant.sample()).energy_j, first + kBar * scale.energy);
  }
  EXPECT_GE(slid, 15);
  RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
}

// Driven masses: the fields move, detent and damping act. The torques at the shafts do all the work there is, and the
// rotors' energy is in the balance.
TEST(Conserved, WorkOfSteppersIsTheChangeOfEnergy) {
  const std::uint64_t seed = ballast::test::random_seed(48);
  double worst = 0, most = 0;
  for (int trial = 0; trial < 6; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(1 + trial % 3);
    const Scale scale(s);
    s.run.actuation = Actuation::kStepper;
    s.initial.angular_velocity_B_radps = random.vector(0.3) / scale.time;
    for (auto& m : s.masses) {
      m.initial_velocity = 0;
      const bool circle = m.rail.shape == firmware::RailShape::kCircle;
      m.motor.shaft_ratio = circle ? 3 : 6 / s.ball.radius_m;
      // Twice what the weight needs, so that a microstep shakes the mass with a fifth of its weight.
      const double weight = m.mass_kg * s.gravity_mps2 * (circle ? m.rail.radius_m : 1);
      m.motor.holding_torque_nm = 2 * weight / m.motor.shaft_ratio;
      m.motor.rotor_inertia_kgm2 = 0.2 * m.mass_kg * std::pow((circle ? m.rail.radius_m : 1) / m.motor.shaft_ratio, 2);
      m.motor.detent_torque_nm = 0.04 * m.motor.holding_torque_nm;
      m.motor.viscous_damping_nms = 0.01 * m.motor.holding_torque_nm * scale.time;
    }
    Plant plant(s);
    const double tick_s = 0.002 * scale.time;
    for (int k = 1; k <= 300; ++k) {
      const double before = all_energy(s, plant.sample());
      std::vector<StepPulse> pulses;
      for (int i = 0; i < static_cast<int>(s.masses.size()); ++i) pulses.push_back({0, i, +1});
      plant.advance(plant.time_s() + 1e-9 * tick_s, pulses);  // the fields move here, and the masses not yet
      const double end_s = tick_s * k;
      const double done = work(plant, end_s, 4, [&](const Plant::Sample& p) { return power_w(s, p); });
      ASSERT_EQ(plant.end(), PhysicsEnd::kNone);
      const double error = std::abs(all_energy(s, plant.sample()) - before - done) / scale.energy;
      EXPECT_LT(error, kBar);
      worst = std::max(worst, error);
      most = std::max(most, std::abs(done) / scale.energy);
    }
  }
  EXPECT_GT(most, 1e-5);
  RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
  RecordProperty("most", std::to_string(most));
}

}  // namespace
}  // namespace ballast::sim
