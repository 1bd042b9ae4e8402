#include "tools/soak/random_scenario.h"

#include <algorithm>
#include <iterator>
#include <memory>
#include <vector>

#include "firmware/control/controller.h"
#include "sim/scenario/reader.h"
#include "tools/program/params.h"
#include "tools/soak/random.h"

namespace ballast::soak {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// A scenario that is refused is followed by another of the same seed.
constexpr int kMostDrawn = 50;

// Random numbers of their own, so that a change of these parts leaves every seed its robot and its faults.
constexpr std::uint64_t kOfTolerance = 0x746f6c6572616e63, kOfAimedFaults = 0x61696d6564206661,
                        kOfEnds = 0x656e6473206f6620, kOfPatches = 0x7061746368657320, kOfFloor = 0x666c6f6f72206f66,
                        kOfSensors = 0x73656e736f727320, kOfControl = 0x636f6e74726f6c20;

std::string text(double value) { return sim::number_text(value); }

template <class V>
std::string text(const V& v) {
  std::string out = "[";
  for (Eigen::Index i = 0; i < v.size(); ++i) out += (i > 0 ? ", " : "") + text(static_cast<double>(v[i]));
  return out + "]";
}

std::string line(const char* key, const std::string& value) { return std::string(key) + " = " + value + "\n"; }
std::string line(const char* key, double value) { return line(key, text(value)); }

class Draw {
 public:
  Draw(Random& random, bool calm) : random_(random), calm_(calm) {}

  std::string scenario(std::uint64_t seed) {
    of_ends_ = Random(seed ^ kOfEnds);
    of_patches_ = Random(seed ^ kOfPatches);
    of_floor_ = Random(seed ^ kOfFloor);
    of_sensors_ = Random(seed ^ kOfSensors);
    of_control_ = Random(seed ^ kOfControl);
    hand_size_ = random_.chance(0.6);
    radius_ = hand_size_ ? random_.log_uniform(0.06, 0.3) : random_.uniform(0.5, 1.5);
    gravity_ = hand_size_ ? 9.81 : random_.uniform(1, 10);
    shell_mass_ = hand_size_ ? random_.log_uniform(0.2, 3) : random_.log_uniform(0.5, 5);
    pendulum_rate_ = std::sqrt(gravity_ / radius_);
    duration_ = calm_ ? random_.uniform(0.6, 1) : random_.uniform(0.2, 2);
    period_ = calm_ ? random_.log_uniform(0.001, 0.004) : std::min(random_.log_uniform(0.0005, 0.02), duration_ / 10);
    stepper_ = calm_ || random_.chance(0.92);

    const std::string governed = calm_ || !stepper_ ? "" : control();

    std::string out = line("name", "\"soak_" + std::to_string(seed) + "\"");
    out += line("duration", duration_) + line("gravity", gravity_);
    out += line("seed", std::to_string(random_.integer(0, 1'000'000)));
    if (!calm_) out += external_force();
    out += ball();
    if (!calm_) out += drag();
    out += surface();
    const std::string sensed = calm_ || !stepper_ ? "" : sensors();
    out += sensed;
    out += start();
    // Three masses and fewer are what people build; more are rarer.
    const int mass_count =
        calm_ || random_.chance(0.85) ? random_.integer(1, 3) : random_.integer(0, firmware::kMaxMasses);
    for (int i = 0; i < mass_count; ++i) out += mass();
    out += "\n[run]\n" + line("actuation", ideal_ ? "\"ideal\"" : stepper_ ? "\"stepper\"" : "\"prescribed\"");
    out += line("control_period", period_);
    out += line("timer_frequency", random_.one_of({1e6, 1e7, 1e7, 84e6}));
    // Some seconds of hold would be most of the run. An estimate needs a sample in it, which may be ten periods late.
    if (!sensed.empty()) out += line("hold", period_ * of_sensors_.integer(estimates_ ? 20 : 0, 200));
    out += line("on_violation", calm_ || random_.chance(0.6) ? "\"continue\"" : "\"stop\"");
    if (!calm_) out += tolerance(seed) + envelope();
    return out + governed + believed();
  }

 private:
  // One controlled robot in five is governed, and half of these have ideal masses.
  std::string control() {
    constexpr double kMostPeriod = 0.04;  // of sqrt(r / g): the governor refuses 0.05
    if (!of_control_.chance(0.2) || period_ * pendulum_rate_ > kMostPeriod) return "";
    ideal_ = of_control_.chance(0.5);
    std::string out = "\n[control]\ngovernor = true\n" + line("friction_use", of_control_.log_uniform(0.1, 1));
    if (!of_control_.chance(0.4)) return out;
    off_ = of_control_.log_uniform(0.001, 0.05);
    out += line("belief_error.mass", off_);
    return out + line("belief_error.center_of_mass", kOffCenter * off_ * radius_);
  }

  // Inside of what is declared.
  std::string believed() {
    if (off_ == 0) return "";
    const auto part = [&] { return 1 / (1 + of_control_.uniform(-off_, off_)); };
    const Vector3d off(of_control_.uniform(-1, 1), of_control_.uniform(-1, 1), of_control_.uniform(-1, 1));
    std::string out = "\n[believed.ball]\n" + line("mass", shell_mass_ * part());
    out += line("center_of_mass", text(Vector3d(center_ + kOffCenter * off_ * radius_ * off)));
    out += line("inertia", text(Vector3d(inertia_.cwiseProduct(Vector3d(part(), part(), part())))));
    for (const double mass : masses_) out += "\n[[believed.mass]]\n" + line("mass", mass * part());
    return out;
  }

  std::string external_force() {
    const double weight = shell_mass_ * gravity_;
    if (random_.chance(0.7)) return "";
    if (random_.chance(0.5)) return line("external_force", text(random_.vector(0, 0.3 * weight)));
    std::string times, forces;
    double time = 0;
    const int rows = random_.integer(2, 5);
    for (int i = 0; i < rows; ++i) {
      times += (i > 0 ? ", " : "") + text(time);
      forces += (i > 0 ? ", " : "") + text(random_.vector(0, 0.4 * weight));
      time += random_.uniform(0.05, 0.6);
    }
    return "external_force = { times = [" + times + "], forces = [" + forces + "] }\n";
  }

  std::string ball() {
    // The principal moments of a body are pairwise sums of three positive numbers; a thin shell has 1/3 each.
    const double a = random_.uniform(0.1, 0.35), b = random_.uniform(0.1, 0.35), c = random_.uniform(0.1, 0.35);
    const double unit = shell_mass_ * radius_ * radius_;
    std::string out = "\n[ball]\n" + line("radius", radius_) + line("mass", shell_mass_);
    inertia_ = unit * Vector3d(a + b, b + c, a + c);
    out += line("inertia", text(inertia_));
    if (random_.chance(0.5)) center_ = random_.vector(0, 0.15 * radius_);
    if (center_ != Vector3d::Zero()) out += line("center_of_mass", text(center_));
    return out;
  }

  std::string drag() {
    if (random_.chance(0.9)) return "";
    std::string out = "\n[drag]\n" + line("coefficient", random_.uniform(0, 0.5) * radius_ * radius_);
    return out + line("wind", text(random_.vector(0, 5)));
  }

  std::string surface() {
    if (calm_) return "\n[surface]\n" + line("static_friction", random_.uniform(0.6, 1));
    floor_slides_ = !random_.chance(0.15);
    std::string out = "\n[surface]\n";
    if (!floor_slides_) return out + resistance();
    const double static_friction = random_.log_uniform(0.05, 1.2);
    out += line("static_friction", static_friction);
    out += line("kinetic_friction", static_friction * random_.uniform(0.5, 1));
    if (random_.chance(0.5)) out += line("restitution", random_.uniform(0, 0.9));
    return out + resistance() + patches();
  }

  // Floors that resist or slope.
  std::string resistance() {
    std::string out;
    if (of_floor_.chance(0.2)) out += line("rolling_resistance", of_floor_.log_uniform(1e-3, 0.1));
    if (of_floor_.chance(0.1)) out += line("spin_friction", radius_ * of_floor_.log_uniform(1e-3, 0.1));
    if (of_floor_.chance(0.1)) out += line("creep", pendulum_rate_ * of_floor_.log_uniform(1e-4, 1e-2));
    if (of_floor_.chance(0.2)) {
      const double angle = of_floor_.uniform(0, 0.2);
      out += "slope = { angle = " + text(angle) + ", downhill = " + text(of_floor_.uniform(-4, 4)) + " }\n";
    }
    return out;
  }

  // Sensors as one buys them; in two of three the attitude is estimated.
  std::string sensors() {
    if (!of_sensors_.chance(0.25)) return "";
    std::string out = "\n[sensors]\n";
    out +=
        line("preset",
             of_sensors_.one_of<const char*>({"\"bmi088\"", "\"bmi088_calibrated\"", "\"icm42688p\"", "\"lsm6dso\""}));
    estimates_ = !of_sensors_.chance(0.35);
    if (!estimates_) out += line("attitude", "\"sensed\"");
    if (of_sensors_.chance(0.3)) out += line("rate", 1 / (period_ * of_sensors_.integer(2, 5)));
    if (of_sensors_.chance(0.3)) out += line("latency", of_sensors_.uniform(0, 5 * period_));
    if (of_sensors_.chance(0.3)) {
      out += line("accelerometer.position", text(of_sensors_.vector(0, 0.5 * radius_)));
    }
    if (of_sensors_.chance(0.3)) {
      out += "position_fix = { rate = " + text(1 / (period_ * of_sensors_.integer(1, 50))) +
             ", noise = " + text(radius_ * of_sensors_.log_uniform(1e-3, 1e-1)) +
             ", delay = " + text(of_sensors_.uniform(0, 5 * period_)) + " }\n";
    }
    if (of_sensors_.chance(0.3)) out += line("encoder.resolution", of_sensors_.log_uniform(1e-5, 1e-2));
    return out;
  }

  // A few circles and triangles about the start, which overlap.
  std::string patches() {
    if (!of_patches_.chance(0.2)) return "";
    const auto near = [&](double reach) { return Eigen::Vector2d(reach * of_patches_.vector(0, 1).head<2>()); };
    std::string out;
    for (int left = of_patches_.integer(1, 4); left > 0; --left) {
      const Eigen::Vector2d at = near(1.5 * radius_);
      out += "[[surface.patch]]\n";
      if (of_patches_.chance(0.5)) {
        out += "circle = { center = " + text(at) + ", radius = " + text(radius_ * of_patches_.log_uniform(0.01, 2)) +
               " }\n";
      } else {
        const Eigen::Vector2d along = near(2 * radius_), aside(-along[1], along[0]);
        out += "polygon = [" + text(at) + ", " + text(Eigen::Vector2d(at + along)) + ", " +
               text(Eigen::Vector2d(at + 0.5 * along + of_patches_.uniform(0.01, 1) * aside)) + "]\n";
      }
      if (of_patches_.chance(0.7)) out += line("static_friction", of_patches_.log_uniform(0.05, 1.2));
      if (of_patches_.chance(0.5)) out += line("rolling_resistance", of_patches_.uniform(0, 0.1));
    }
    return out;
  }

  std::string start() {
    std::string out = "\n[initial]\n";
    const auto q = random_.attitude();
    out += line("orientation", text(Eigen::Vector4d(q.w(), q.x(), q.y(), q.z())));
    if (calm_ || random_.chance(0.6)) return out;  // at rest
    out += line("angular_velocity", text(random_.vector(0, pendulum_rate_)));
    const double speed = std::sqrt(gravity_ * radius_);
    if (floor_slides_ && random_.chance(0.3)) {
      const Vector3d velocity = random_.vector(0, speed);
      out += line("velocity", text(Vector3d(velocity[0], velocity[1], 0)));
    } else if (random_.chance(0.2)) {
      out += line("height", radius_ * random_.uniform(0, 0.2));
      out += line("velocity", text(random_.vector(0, 0.5 * speed)));
    }
    return out;
  }

  struct Rail {
    std::string toml{};
    bool circle = false;
    bool ends = false;             // at `lower` and `upper`, or a little beyond
    double unit = 1;               // a way along it that is as long as a radian of a circle
    double lower = -1, upper = 1;  // where a mass may start and go
  };

  Rail circle() {
    Rail rail{.circle = true, .lower = -3, .upper = 3};
    if (random_.chance(0.3)) {
      const double size = radius_ * random_.uniform(0.3, 0.95), azimuth = random_.uniform(0, 6);
      const double elevation = random_.uniform(-1.5, 1.5);
      rail.toml = "{ shape = \"circle\", radius = " + text(size) + ", direction = { azimuth = " + text(azimuth) +
                  ", elevation = " + text(elevation) + " } }";
      return rail;
    }
    const Eigen::Matrix3d axes = random_.attitude().toRotationMatrix();
    const double size = radius_ * random_.uniform(0.2, 0.7);
    const Vector3d center = random_.vector(0, 0.25 * radius_);
    rail.toml = "{ shape = \"circle\", radius = " + text(size) + ", center = " + text(center) + ", axes = [" +
                text(Vector3d(axes.col(0))) + ", " + text(Vector3d(axes.col(1))) + "] }";
    return rail;
  }

  Rail on_line() {
    const double half = radius_ * random_.uniform(0.3, 0.7);  // with an origin this near it stays in the ball
    Rail rail{.unit = 0.3 * radius_, .lower = -half, .upper = half};
    rail.toml = "{ shape = \"line\", origin = " + text(random_.vector(0, 0.3 * radius_));
    rail.toml += ", direction = " + text(random_.direction());
    rail.ends = random_.chance(0.5);
    if (rail.ends) {
      rail.toml += ", end_stops = [" + text(-half) + ", " + text(half) + "]";
      rail.toml += ", end_stop_restitution = " + text(random_.uniform(0.1, 1));
    }
    rail.toml += " }";
    return rail;
  }

  // Closed: a circle that winds up and down as it goes round. Open: an arc that climbs.
  Rail spline() {
    const bool closed = random_.chance(0.5);
    const int points = random_.integer(8, 16);
    const double size = radius_ * random_.uniform(0.3, 0.6), wave = size * random_.uniform(0, 0.4);
    const double angle = closed ? 2 * std::numbers::pi : random_.uniform(1, 4);
    const int waves = random_.integer(1, 2);
    const Eigen::Matrix3d turned = random_.attitude().toRotationMatrix();
    const Vector3d center = random_.vector(0, 0.15 * radius_);
    std::string list;
    for (int i = 0; i < points; ++i) {
      const double t = angle * i / (closed ? points : points - 1);
      const double height = closed ? wave * std::sin(waves * t) : wave * (2 * t / angle - 1);
      const Vector3d point = center + turned * Vector3d(size * std::cos(t), size * std::sin(t), height);
      list += (i > 0 ? ", " : "") + text(point);
    }
    Rail rail{.unit = size, .lower = closed ? -3 * size : 0, .upper = closed ? 3 * size : 0.95 * size * angle};
    rail.ends = !closed;
    rail.toml =
        "{ shape = \"spline\", closed = " + std::string(closed ? "true" : "false") + ", points = [" + list + "] }";
    return rail;
  }

  static std::string piece(double duration, double from, double to) {
    return "{ duration = " + text(duration) + ", acceleration = [" + text(from) + ", " + text(to) + "] }";
  }

  // From rest to rest, by `way` in `time`: the acceleration goes up and down like two triangles, of which the first
  // half makes the speed a time / 4, and so way = a time^2 / 8.
  static void add_trip(double way, double time, std::vector<std::string>& pieces) {
    const double a = 8 * way / (time * time);
    pieces.push_back(piece(time / 4, 0, a));
    pieces.push_back(piece(time / 4, a, 0));
    pieces.push_back(piece(time / 4, 0, -a));
    pieces.push_back(piece(time / 4, -a, 0));
  }

  // From near an end of the rail and back to there, in most of the run: a mass that loses steps on its way out is
  // driven into that end on its way back.
  void go_and_come_back(const Rail& rail, double& position, std::vector<std::string>& pieces) {
    constexpr double kNear = 5e-4;  // less than most lose
    const double length = rail.upper - rail.lower, time = 0.4 * duration_;
    const double reach = rail.unit * std::min(1.0, 0.05 * pendulum_rate_ * pendulum_rate_ * time * time);
    const double way = std::min(reach, of_ends_.uniform(0.2, 0.6) * length);
    const bool lower = of_ends_.chance(0.5);
    position = lower ? rail.lower + kNear * length : rail.upper - kNear * length;
    add_trip(lower ? way : -way, time, pieces);
    add_trip(lower ? -way : way, time, pieces);
  }

  // Sets where the mass starts.
  std::string motion(const Rail& rail, double& position) {
    std::vector<std::string> pieces;
    position = random_.uniform(0.8 * rail.lower + 0.2 * rail.upper, 0.2 * rail.lower + 0.8 * rail.upper);
    if (calm_) {
      const double reach = rail.unit * std::min(0.3, 0.02 * pendulum_rate_ * pendulum_rate_ * duration_ * duration_);
      const double to = position + (position > 0.5 * (rail.lower + rail.upper) ? -reach : reach);
      add_trip(std::clamp(to, rail.lower, rail.upper) - position, duration_, pieces);
    } else if (rail.ends && of_ends_.chance(0.8)) {
      go_and_come_back(rail, position, pieces);
    } else if (random_.chance(0.1)) {
      return "";
    } else if (random_.chance(0.7)) {
      double at = position;
      const int trips = random_.integer(1, 3);
      for (int i = 0; i < trips; ++i) {
        if (random_.chance(0.3)) pieces.push_back(piece(random_.uniform(0.01, 0.3), 0, 0));
        const double time = random_.uniform(0.15, 1.5);
        // As fast as gravity moves things, and at times three times as fast.
        const double gently = rail.unit * std::min(1.0, 0.05 * pendulum_rate_ * pendulum_rate_ * time * time);
        const double reach = random_.chance(0.15) ? 3 * gently : gently;
        const double to = std::clamp(at + random_.uniform(-reach, reach), rail.lower, rail.upper);
        add_trip(to - at, time, pieces);
        at = to;
      }
    } else {
      const double a = rail.unit * pendulum_rate_ * pendulum_rate_ * random_.log_uniform(0.02, 1);
      const int count = random_.integer(1, 6);
      for (int i = 0; i < count; ++i) {
        const double time = random_.uniform(0.02, 0.4), from = random_.uniform(-a, a), to = random_.uniform(-a, a);
        pieces.push_back(piece(time, from, to));
      }
    }
    std::string list;
    for (const std::string& p : pieces) list += (list.empty() ? "" : ",\n           ") + p;
    return "motion = [ " + list + " ]\n";
  }

  std::string mass() {
    const Rail rail = random_.chance(0.6) ? circle() : random_.chance(0.5) ? on_line() : spline();
    double position = 0;
    const std::string moved = motion(rail, position);
    masses_.push_back(shell_mass_ * random_.log_uniform(0.03, 1.5));
    std::string out = "\n[[mass]]\n" + line("mass", masses_.back());
    out += line("rail", rail.toml) + line("initial_position", position) + moved;
    if (calm_) return out + "[mass.motor]\n" + line("microsteps", std::to_string(random_.one_of({16, 32})));
    out += "[mass.motor]\n" + line("microsteps", std::to_string(random_.one_of({1, 2, 4, 8, 16, 16, 32, 64, 256})));
    if (hand_size_ && random_.chance(0.4)) {
      out += line("preset", random_.one_of<const char*>({"\"nema11\"", "\"nema17\"", "\"nema23\""}));
    }
    if (rail.circle && random_.chance(0.5)) out += line("gear_ratio", random_.log_uniform(1, 8));
    if (!rail.circle && random_.chance(0.5)) {
      out += line("travel_per_revolution", radius_ * random_.log_uniform(0.1, 1.5));
    }
    if (random_.chance(0.1)) {  // too weak, or nearly
      out += line("holding_torque", shell_mass_ * gravity_ * radius_ * random_.log_uniform(0.03, 1));
    }
    if (random_.chance(0.1)) out += line("direction_setup", random_.uniform(0, 2e-5));
    return out;
  }

  // The error that the plant's integrator may make changes what it finds, and must not change what is true of it.
  static std::string tolerance(std::uint64_t seed) {
    Random random(seed ^ kOfTolerance);
    return random.chance(0.2) ? line("tolerance", random.log_uniform(1e-12, 1e-8)) : "";
  }

  std::string envelope() {
    std::string out = "\n[envelope]\n";
    if (random_.chance(0.3)) out += line("min_normal_force", shell_mass_ * gravity_ * random_.uniform(0, 0.8));
    if (random_.chance(0.4)) out += line("friction_use", random_.uniform(0.2, 1));
    return out;
  }

  Random& random_;
  Random of_ends_{0}, of_patches_{0}, of_floor_{0}, of_sensors_{0}, of_control_{0};
  bool calm_;
  bool ideal_ = false, hand_size_ = true, stepper_ = true, floor_slides_ = true, estimates_ = false;
  static constexpr double kOffCenter = 0.1;  // the centre of mass, in radii, beside the masses, as a part
  double off_ = 0;                           // control.belief_error.mass
  Vector3d center_ = Vector3d::Zero(), inertia_ = Vector3d::Zero();
  std::vector<double> masses_;
  double radius_ = 0, gravity_ = 0, shell_mass_ = 0, pendulum_rate_ = 0, duration_ = 0, period_ = 0;
};

// Why it cannot be run; empty: it can.
std::string refusal(const sim::ScenarioResult& read) {
  if (!read.ok()) return to_string(read.errors.front());
  if (read.scenario.run.actuation == sim::Actuation::kPrescribed) return "";
  auto params = std::make_unique<firmware::ControllerParams>();
  if (auto trouble = program::to_controller_params(read.scenario, *params)) return *trouble;
  if (!params->governor.on) return "";
  auto state = std::make_unique<firmware::ControllerState>();
  firmware::reset(*params, *state);
  return state->governing.start.stage == firmware::StartStage::kCertified ? "" : "no stop of its start is certified";
}

template <class AddFaults>
RandomScenario draw_scenario(std::uint64_t seed, bool calm, AddFaults add_faults) {
  Random random(seed);
  RandomScenario result;
  for (result.refused = 0; result.refused < kMostDrawn; ++result.refused) {
    result.toml = Draw(random, calm).scenario(seed);
    sim::ScenarioResult read = sim::parse_scenario(result.toml, "soak");
    result.trouble = refusal(read);
    if (!result.trouble.empty()) continue;
    result.faults = add_faults(read.scenario, random);
    for (const RandomFault& fault : result.faults) result.toml += fault.toml;
    read = sim::parse_scenario(result.toml, "soak");
    result.trouble = refusal(read);
    result.scenario = std::move(read.scenario);
    return result;  // a fault that is refused is a fault of random_faults.cpp
  }
  return result;
}

}  // namespace

RandomScenario random_scenario(std::uint64_t seed) {
  Random of_aimed_faults(seed ^ kOfAimedFaults);
  RandomScenario random = draw_scenario(seed, false, [&](const sim::Scenario& scenario, Random& of_faults) {
    std::vector<RandomFault> faults = random_faults(scenario, of_faults);
    std::ranges::move(aimed_faults(scenario, of_aimed_faults), std::back_inserter(faults));
    return faults;
  });
  // Random numbers of its own too.
  Random of_script(~seed);
  if (random.trouble.empty()) random.script = random_script(random.scenario, of_script);
  random.toml = comments(random.script) + random.toml;
  return random;
}

RandomScenario calm_scenario(std::uint64_t seed, sim::FaultKind kind, int severity) {
  return draw_scenario(seed, true, [&](const sim::Scenario& scenario, Random& random) {
    return std::vector<RandomFault>{random_fault(scenario, kind, severity, random)};
  });
}

}  // namespace ballast::soak
