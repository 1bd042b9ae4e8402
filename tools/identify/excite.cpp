#include "tools/identify/excite.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "sim/masses/motion.h"
#include "sim/scenario/fingerprint.h"
#include "sim/scenario/tree_nodes.h"

namespace ballast::identify {

using sim::Mass;
using sim::MotionPiece;

namespace {

// In units of sqrt(r / g).
constexpr double kDuration = 100;
constexpr double kLeastPiece = 1;                                // length of a piece
constexpr double kLeastFrequency = 0.02, kMostFrequency = 0.08;  // a piece is a ninth of the shortest period
constexpr double kFade = 8;

constexpr int kSines = 4;
constexpr int kMostPieces = 120;    // a scenario takes 128
constexpr double kMostSwing = 0.8;  // rad of a circle; on other rails, of the radius
constexpr double kLimitUse = 0.5;   // part of a motor's limits
constexpr double kEndsUse = 0.8;    // part of the way to the nearer end of a rail
constexpr double kSwing = 0.035;    // of g, by motors: the residuals of desk_ball's fits
constexpr int kKept = 10;
constexpr int kSmaller = 12;
constexpr double kShrink = 0.85;

// 53 bits, so that draws are alike on every platform.
double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
}

struct Sines {
  double amplitude[kSines], frequency_hz[kSines], phase_rad[kSines];
};

Sines draw(std::mt19937_64& random, double unit_s) {
  Sines out{};
  double sum = 0;
  for (int k = 0; k < kSines; ++k) {
    const double part = uniform(random, 0, 1);
    out.frequency_hz[k] = kLeastFrequency * std::pow(kMostFrequency / kLeastFrequency, part) / unit_s;
    out.phase_rad[k] = uniform(random, 0, 2 * std::numbers::pi);
    // Slow swings may be wide.
    out.amplitude[k] = uniform(random, 0.2, 1) * std::pow(kLeastFrequency / kMostFrequency, part / 2);
    sum += out.amplitude[k];
  }
  for (double& amplitude : out.amplitude) amplitude /= sum;
  return out;
}

double faded(double time_s, double duration_s, double fade_s) {
  const double x = std::min({time_s / fade_s, (duration_s - time_s) / fade_s, 1.0});
  return x <= 0 ? 0 : x * x * (3 - 2 * x);
}

double offset(const Sines& sines, double time_s, double duration_s, double fade_s) {
  double sum = 0;
  for (int k = 0; k < kSines; ++k)
    sum += sines.amplitude[k] * std::sin(2 * std::numbers::pi * sines.frequency_hz[k] * time_s + sines.phase_rad[k]);
  return faded(time_s, duration_s, fade_s) * sum;
}

// Accelerations at the knots: second differences of the offset, corrected by a + b t so that the mass ends at rest
// where it began. The first and the last are 0.
std::vector<double> accelerations(const Sines& sines, double piece_s, int pieces, double fade_s) {
  const double duration_s = piece_s * pieces;
  std::vector<double> a(static_cast<std::size_t>(pieces) + 1, 0.0);
  for (int k = 1; k < pieces; ++k) {
    const auto at = [&](int knot) { return offset(sines, knot * piece_s, duration_s, fade_s); };
    a[static_cast<std::size_t>(k)] = (at(k + 1) - 2 * at(k) + at(k - 1)) / (piece_s * piece_s);
  }
  // The rate at the end is the sum of a_k, the way that of (n - k) a_k, in units of the piece.
  double rate = 0, way = 0, s0 = 0, s1 = 0, s2 = 0;
  for (int k = 1; k < pieces; ++k) {
    const double left = pieces - k;
    rate += a[static_cast<std::size_t>(k)];
    way += left * a[static_cast<std::size_t>(k)];
    s0 += 1;
    s1 += left;
    s2 += left * left;
  }
  const double determinant = s0 * s2 - s1 * s1;
  const double c0 = (s2 * rate - s1 * way) / determinant, c1 = (s0 * way - s1 * rate) / determinant;
  for (int k = 1; k < pieces; ++k) a[static_cast<std::size_t>(k)] -= c0 + c1 * (pieces - k);
  return a;
}

std::vector<MotionPiece> as_motion(const std::vector<double>& a, double piece_s, double factor) {
  std::vector<MotionPiece> motion;
  for (std::size_t k = 0; k + 1 < a.size(); ++k) motion.push_back({piece_s, factor * a[k], factor * a[k + 1]});
  return motion;
}

// Positions, velocities and accelerations at the control ticks.
std::vector<firmware::MassMotion> at_ticks(const std::vector<Mass>& masses, double duration_s, double period_s) {
  sim::PrescribedMasses motion(masses);
  std::vector<firmware::MassMotion> out;
  const auto ticks = static_cast<int>(std::floor(duration_s / period_s + 1e-6));
  for (int tick = 0; tick <= ticks; ++tick) {
    motion.enter_pieces(tick * period_s);
    const sim::MassPoint at = motion.at(tick * period_s);
    firmware::MassMotion point;
    for (std::size_t i = 0; i < masses.size(); ++i) {
      point.position[i] = at.position[i];
      point.velocity[i] = at.velocity[i];
      point.acceleration[i] = at.acceleration[i];
    }
    out.push_back(point);
  }
  return out;
}

// The greatest part of this motion that mass and motor allow.
double allowed_part(const Mass& mass, const std::vector<double>& a, double piece_s) {
  double position = 0, velocity = 0, most_position = 0, most_velocity = 0, most_acceleration = 0, most_jerk = 0;
  for (std::size_t k = 0; k + 1 < a.size(); ++k) {
    position += piece_s * velocity + piece_s * piece_s * (2 * a[k] + a[k + 1]) / 6;
    velocity += piece_s * (a[k] + a[k + 1]) / 2;
    most_position = std::max(most_position, std::abs(position));
    most_velocity = std::max(most_velocity, std::abs(velocity));
    most_acceleration = std::max(most_acceleration, std::abs(a[k]));
    most_jerk = std::max(most_jerk, std::abs(a[k + 1] - a[k]) / piece_s);
  }
  const sim::Motor& motor = mass.motor;
  const double room =
      kEndsUse * std::min(mass.rail.upper_end - mass.initial_position, mass.initial_position - mass.rail.lower_end);
  double part = std::min(room / most_position, kLimitUse * motor.max_acceleration / most_acceleration);
  part = std::min(part, kLimitUse * motor.max_jerk / most_jerk);
  return std::min(part, kLimitUse * motor.max_step_rate_hz / motor.microsteps_per_rail_unit() / most_velocity);
}

Recording recording_of(const Known& known, const std::vector<Mass>& masses, double duration_s, double imu_ticks) {
  Recording out;
  out.known = known;
  out.commanded = at_ticks(masses, duration_s, known.control_period_s);
  // Readings do not matter to what they would tell; those of a ball that stands begin the model at rest.
  for (std::int64_t tick = 0; tick < static_cast<std::int64_t>(out.commanded.size());
       tick += static_cast<std::int64_t>(imu_ticks)) {
    out.imu.push_back({tick, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()});
  }
  return out;
}

}  // namespace

std::vector<Excitation> excitations(const sim::Scenario& scenario, const Known& known, const Parameters& parameters,
                                    const ExciteOptions& options) {
  const double unit_s = parameters.time_unit_s();
  const double wanted_s = options.duration_s > 0 ? options.duration_s : kDuration * unit_s;
  const int pieces = std::clamp(static_cast<int>(wanted_s / (kLeastPiece * unit_s)), 4, kMostPieces);
  // Pieces end at ticks.
  const double period_s = known.control_period_s;
  const double piece_s = period_s * std::max(1.0, std::round(wanted_s / pieces / period_s));
  const double duration_s = piece_s * pieces;
  const double most_mu = options.friction_use * scenario.envelope.friction_use * known.belief.surface.static_friction;
  const double imu_ticks = std::max(1.0, std::round(1 / (known.sensors.rate_hz * period_s)));
  std::vector<Excitation> best;
  std::mt19937_64 random(options.seed);
  for (int candidate = 0; candidate < options.candidates; ++candidate) {
    std::vector<Mass> masses = known.belief.masses;
    std::vector<std::vector<double>> knots;
    std::vector<double> part;
    for (const Mass& mass : masses) {
      const double swing = kMostSwing * uniform(random, 0.4, 1) *
                           (mass.rail.shape == firmware::RailShape::kCircle ? 1 : known.robot.ball.radius_m);
      knots.push_back(accelerations(draw(random, unit_s), piece_s, pieces, kFade * unit_s));
      part.push_back(std::min(swing, allowed_part(mass, knots.back(), piece_s)));
    }
    double smaller = 1;
    for (int tries = 0; tries < kSmaller; ++tries, smaller *= kShrink) {
      Excitation out;
      out.duration_s = duration_s;
      for (std::size_t i = 0; i < masses.size(); ++i) {
        masses[i].motion = as_motion(knots[i], piece_s, smaller * part[i]);
        masses[i].initial_velocity = 0;
        out.motion.push_back(masses[i].motion);
      }
      RunFit run(recording_of(known, masses, duration_s, imu_ticks), parameters);
      run.cut_into(run.windows());
      out.contact = run.contact(parameters.believed());
      if (!(out.contact.mu_required <= most_mu) ||
          !(out.contact.least_normal_n > scenario.envelope.min_normal_force_n)) {
        continue;
      }
      if (known.steppers) run.expect_swing(kSwing * known.robot.ball.gravity_mps2);
      out.sigma = predicted_sigma(parameters, run);
      best.push_back(std::move(out));
      break;
    }
    if (options.progress && !options.progress()) break;
  }
  std::stable_sort(best.begin(), best.end(),
                   [](const Excitation& a, const Excitation& b) { return a.sigma.maxCoeff() < b.sigma.maxCoeff(); });
  if (best.size() > kKept) best.resize(kKept);
  return best;
}

sim::Scenario robot_off(const sim::Scenario& believed, double part, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  sim::Scenario out = believed;
  if (!out.believed) out.believed = static_cast<const sim::World&>(believed);
  const auto factor = [&] { return 1 + part * uniform(random, -1, 1); };
  out.ball.mass_kg *= factor();
  for (Mass& mass : out.masses) mass.mass_kg *= factor();
  for (int j = 0; j < 3; ++j) {
    out.ball.inertia_kgm2[j] *= factor();
    out.ball.center_of_mass_B_m[j] += out.ball.radius_m / 10 * (factor() - 1);
  }
  out.seed = static_cast<decltype(out.seed)>(random() >> 32);
  out.id = sim::fingerprint(out);
  return out;
}

std::string excite_toml(const std::string& toml, const std::string& name, const Excitation& excitation) {
  sim::Node root;
  std::vector<sim::ScenarioError> errors;
  static_cast<void>(sim::read_tree(toml, "scenario", root, errors));  // it has been read before
  std::erase_if(root.entries, [](const auto& entry) {
    return entry.first == "published" || entry.first == "plan" || entry.first == "task" || entry.first == "fault";
  });
  sim::set_entry(root, "name", sim::text_node(name));
  sim::set_entry(root, "duration", sim::number_node(excitation.duration_s));
  sim::Node* masses = root.find("mass");
  for (std::size_t i = 0; i < masses->items.size() && i < excitation.motion.size(); ++i) {
    sim::Node motion = sim::array_node();
    for (const MotionPiece& piece : excitation.motion[i]) {
      motion.items.push_back(
          sim::motion_piece_node(piece.duration_s, piece.acceleration_start, piece.acceleration_end));
    }
    sim::set_entry(masses->items[i], "motion", std::move(motion));
    sim::set_entry(masses->items[i], "initial_velocity", sim::number_node(0));
  }
  return sim::to_toml(root) + "\n";
}

}  // namespace ballast::identify
