#include "tools/soak/random_faults.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/scenario/reader.h"

namespace ballast::soak {

namespace {

using sim::FaultKind;
using sim::FaultLayer;
using sim::FaultSensor;

std::string line(const char* key, const std::string& value) { return std::string(key) + " = " + value + "\n"; }
std::string line(const char* key, double value) { return line(key, sim::number_text(value)); }
std::string quoted(const char* word) { return std::string("\"") + word + "\""; }

struct SeverityText {
  const char* mild;
  const char* severe;
};

// One entry per kind, in the order of FaultKind; FaultDraw draws from them.
constexpr SeverityText kSeverities[] = {
    {"for one tick", "all of a channel"},                                       // messages_dropped
    {"1 tick late, for one tick", "2 to 20 ticks late"},                        // messages_delayed
    {"for one tick", "all of a channel"},                                       // messages_doubled
    {"for one tick", "every other one"},                                        // messages_reordered
    {"1 bit, for one tick", "8 to 64 bits in each"},                            // messages_corrupted
    {"1 byte, for one tick", "1 to 64 bytes of each"},                          // messages_truncated
    {"for good", "for good"},                                                   // peer_killed
    {"for one tick", "for good"},                                               // peer_frozen
    {"once", "once"},                                                           // peer_restarted
    {"1 tick late", "2 to 20 ticks late"},                                      // peer_too_slow
    {"1 to 5 % of g, of the pendulum's rate, of a radian", "1 to 5 times it"},  // sensor_bias
    {"1 to 5 % of g, of the pendulum's rate, of a radian", "1 to 5 times it"},  // sensor_noise
    {"for one tick", "for good"},                                               // sensor_freeze
    {"for one tick", "for good"},                                               // sensor_nan
    {"1 to 5 % of g, of the pendulum's rate, of a radian", "1 to 5 times it"},  // sensor_spike
    {"at 2 to 4 g, or times the pendulum's rate", "at 1 to 10 % of them"},      // sensor_saturation
    {"for 5 ticks", "for good"},                                                // motor_stall
    {"80 to 95 % of its current", "0 to 30 % of its current"},                  // weak_coil
    {"1 to 16 microsteps", "one to ten teeth"},                                 // lost_steps
    {"for 5 ticks", "for good"},                                                // reversed_wiring
    {"for 5 ticks", "for good"},                                                // blocked_rail
    {"to 80 to 95 %", "to 1 to 20 %"},                                          // friction_falls
    {"1 to 5 % of the weight", "0.5 to 3 times the weight"},                    // push
    {"1 tick", "2 to 10,000 ticks"},                                            // clock_jump
    {"1 tick", "2 to 100 ticks"},                                               // controller_overrun
    {"for good", "for good"},                                                   // disk_full
};

class FaultDraw {
 public:
  FaultDraw(const sim::Scenario& scenario, Random& random)
      : scenario_(scenario),
        random_(random),
        has_controller_(scenario.run.actuation == sim::Actuation::kStepper),
        has_motors_(has_controller_ && !scenario.masses.empty()) {}

  [[nodiscard]] bool applies(const sim::FaultKindInfo& kind) const {
    switch (kind.layer) {
      case FaultLayer::kMotor:
        return has_motors_;
      case FaultLayer::kPeer:
        return has_controller_ || kind.kind == FaultKind::kPeerRestarted;
      case FaultLayer::kMessage:
      case FaultLayer::kSensor:
      case FaultLayer::kWorld:
        return true;
      case FaultLayer::kProgram:
        return has_controller_ || kind.kind != FaultKind::kControllerOverrun;
    }
    return false;
  }

  // Lost steps of this mass, instead of one that chance chooses.
  RandomFault lost_steps(int mass, double time_s) {
    mass_ = mass;
    const auto& kind = sim::info(FaultKind::kLostSteps);
    const std::string out = "\n[[fault]]\n" + line("kind", quoted(kind.name)) + line("time", time_s);
    return {kind.kind, 1, out + line("mass", std::to_string(mass)) + severe(kind)};
  }

  // At a tick's start, or anywhere.
  double time_s(double earliest_s, double latest_s) {
    const double time_s = random_.uniform(earliest_s, latest_s), period_s = scenario_.run.control_period_s;
    return random_.chance(0.5) ? period_s * std::floor(time_s / period_s) : time_s;
  }

  RandomFault fault(const sim::FaultKindInfo& kind, int severity, double time_s) {
    std::string out = "\n[[fault]]\n" + line("kind", quoted(kind.name)) + line("time", time_s);
    out += target(kind);
    out += severity == 0 ? mild(kind) : severe(kind);
    return {kind.kind, severity, out};
  }

 private:
  std::string target(const sim::FaultKindInfo& kind) {
    switch (kind.layer) {
      case FaultLayer::kMessage:
        return channel();
      case FaultLayer::kPeer: {
        const bool controller = has_controller_ && random_.chance(0.5);
        return line("peer", quoted(controller ? "controller" : "monitor"));
      }
      case FaultLayer::kSensor:
        return sensor(kind.kind);
      case FaultLayer::kMotor:
        mass_ = mass();
        return line("mass", std::to_string(mass_));
      case FaultLayer::kWorld:
      case FaultLayer::kProgram:
        return "";
    }
    return "";
  }

  int mass() { return random_.integer(0, static_cast<int>(scenario_.masses.size()) - 1); }

  std::string channel() {
    std::vector<sim::FaultChannel> there;
    for (const sim::FaultChannel& candidate : sim::fault_channels()) {
      if (has_controller_ || !candidate.of_controller) there.push_back(candidate);
    }
    const auto& channel = there[static_cast<std::size_t>(random_.integer(0, static_cast<int>(there.size()) - 1))];
    const std::string out = line("channel", quoted(channel.name));
    if (!has_controller_ || !channel.to_controller || !channel.to_monitor || random_.chance(0.5)) return out;
    return out + line("peer", quoted(random_.chance(0.5) ? "controller" : "monitor"));
  }

  std::string sensor(FaultKind kind) {
    const bool saturates = kind == FaultKind::kSensorSaturation, whole = kind == FaultKind::kSensorNan;
    if (kind == FaultKind::kSensorFreeze && has_motors_ && random_.chance(0.2)) {
      sensor_ = FaultSensor::kLimitSwitch;
      return line("sensor", quoted("limit_switch"));
    }
    sensor_ = saturates ? random_.one_of({FaultSensor::kGyro, FaultSensor::kAccelerometer})
                        : random_.one_of({FaultSensor::kOrientation, FaultSensor::kGyro, FaultSensor::kAccelerometer});
    if (sensor_ == FaultSensor::kOrientation && scenario_.sensors.attitude_estimated) sensor_ = FaultSensor::kGyro;
    const std::string out = line("sensor", quoted(to_string(sensor_)));
    const bool attitude = sensor_ == FaultSensor::kOrientation;
    if ((attitude && (whole || kind == FaultKind::kSensorFreeze)) || random_.chance(0.5)) return out;
    return out + line("axis", std::to_string(random_.integer(0, 2)));
  }

  // The sensor's usual value.
  [[nodiscard]] double usual() const {
    switch (sensor_) {
      case FaultSensor::kGyro:
        return std::sqrt(scenario_.gravity_mps2 / scenario_.ball.radius_m);
      case FaultSensor::kAccelerometer:
        return scenario_.gravity_mps2;
      case FaultSensor::kOrientation:
      case FaultSensor::kLimitSwitch:
      case FaultSensor::kEncoder:
      case FaultSensor::kPositionFix:
        return 1;
    }
    return 1;
  }

  [[nodiscard]] double weight_n() const {
    double mass_kg = scenario_.ball.mass_kg;
    for (const sim::Mass& m : scenario_.masses) mass_kg += m.mass_kg;
    return mass_kg * scenario_.gravity_mps2;
  }

  [[nodiscard]] std::string for_ticks(int ticks) const {
    return line("duration", ticks * scenario_.run.control_period_s);
  }

  std::string value(double low, double high) { return line("value", random_.uniform(low, high)); }
  std::string whole(int low, int high) { return line("value", std::to_string(random_.integer(low, high))); }
  int sign() { return random_.chance(0.5) ? 1 : -1; }

  // Share of the floor's friction; of 1 where it is perfect.
  std::string friction(double low, double high) {
    const double now = std::min(scenario_.surface.static_friction, 1.0);
    return value(low * now, high * now);
  }

  std::string push(double low, double high) {
    const std::string out = value(low * weight_n(), high * weight_n());
    const Eigen::Vector3d way = random_.direction();
    return out + "direction = [" + sim::number_text(way[0]) + ", " + sim::number_text(way[1]) + ", " +
           sim::number_text(way[2]) + "]\n";
  }

  std::string mild(const sim::FaultKindInfo& kind) {
    switch (kind.kind) {
      case FaultKind::kMessagesDropped:
      case FaultKind::kMessagesDoubled:
      case FaultKind::kMessagesReordered:
      case FaultKind::kPeerFrozen:
      case FaultKind::kSensorFreeze:
      case FaultKind::kSensorNan:
        return for_ticks(1);
      case FaultKind::kMessagesDelayed:
      case FaultKind::kMessagesCorrupted:
      case FaultKind::kMessagesTruncated:
        return line("value", "1") + for_ticks(1);
      case FaultKind::kPeerTooSlow:
      case FaultKind::kControllerOverrun:
        return line("value", "1");
      case FaultKind::kPeerKilled:
      case FaultKind::kPeerRestarted:
      case FaultKind::kDiskFull:
        return "";
      case FaultKind::kSensorBias:
      case FaultKind::kSensorNoise:
      case FaultKind::kSensorSpike:
        return value(0.01 * usual(), 0.05 * usual());
      case FaultKind::kSensorSaturation:
        return value(2 * usual(), 4 * usual());
      case FaultKind::kMotorStall:
      case FaultKind::kReversedWiring:
      case FaultKind::kBlockedRail:
        return for_ticks(5);
      case FaultKind::kWeakCoil:
        return value(0.8, 0.95);
      case FaultKind::kLostSteps:
        return whole(1, 16);
      case FaultKind::kFrictionFalls:
        return friction(0.8, 0.95);
      case FaultKind::kPush:
        return push(0.01, 0.05);
      case FaultKind::kClockJump:
        return line("value", std::to_string(sign()));
    }
    return "";
  }

  std::string severe(const sim::FaultKindInfo& kind) {
    switch (kind.kind) {
      case FaultKind::kMessagesDropped:
      case FaultKind::kMessagesDoubled:
      case FaultKind::kPeerKilled:
      case FaultKind::kPeerFrozen:
      case FaultKind::kPeerRestarted:
      case FaultKind::kSensorFreeze:
      case FaultKind::kSensorNan:
      case FaultKind::kMotorStall:
      case FaultKind::kReversedWiring:
      case FaultKind::kBlockedRail:
      case FaultKind::kDiskFull:
        return "";
      case FaultKind::kMessagesDelayed:
      case FaultKind::kPeerTooSlow:
        return whole(2, 20);
      case FaultKind::kMessagesReordered:
        return line("value", "0.5");
      case FaultKind::kMessagesCorrupted:
        return whole(8, 64);
      case FaultKind::kMessagesTruncated:
        return whole(1, 64);
      case FaultKind::kSensorBias:
      case FaultKind::kSensorNoise:
      case FaultKind::kSensorSpike:
        return value(usual(), 5 * usual());
      case FaultKind::kSensorSaturation:
        return value(0.01 * usual(), 0.1 * usual());
      case FaultKind::kWeakCoil:
        return value(0, 0.3);
      case FaultKind::kLostSteps: {
        const int tooth = 4 * scenario_.masses[static_cast<std::size_t>(mass_)].motor.microsteps;
        return whole(tooth, 10 * tooth);
      }
      case FaultKind::kFrictionFalls:
        return friction(0.01, 0.2);
      case FaultKind::kPush:
        return push(0.5, 3);
      case FaultKind::kClockJump: {
        const int way = sign();
        return line("value", std::to_string(way * random_.integer(2, 10'000)));
      }
      case FaultKind::kControllerOverrun:
        return whole(2, 100);
    }
    return "";
  }

  const sim::Scenario& scenario_;
  Random& random_;
  bool has_controller_, has_motors_;
  FaultSensor sensor_ = FaultSensor::kGyro;  // of the latest fault
  int mass_ = 0;                             // likewise
};

}  // namespace

const char* severity_text(sim::FaultKind kind, int severity) {
  const SeverityText& texts = kSeverities[static_cast<std::size_t>(kind)];
  return severity == 0 ? texts.mild : texts.severe;
}

std::vector<RandomFault> random_faults(const sim::Scenario& scenario, Random& random) {
  static_assert(std::size(kSeverities) == static_cast<std::size_t>(FaultKind::kDiskFull) + 1);
  FaultDraw draw(scenario, random);
  std::vector<sim::FaultKindInfo> kinds;
  std::ranges::copy_if(sim::fault_kinds(), std::back_inserter(kinds), [&](const auto& k) { return draw.applies(k); });
  std::vector<RandomFault> faults;
  const int count = random.one_of({0, 0, 0, 1, 1, 1, 1, 2, 2, 3});
  for (int i = 0; i < count; ++i) {
    const auto& kind = kinds[static_cast<std::size_t>(random.integer(0, static_cast<int>(kinds.size()) - 1))];
    const int severity = random.integer(0, 1);
    const double time_s = random.chance(0.05) ? 0 : draw.time_s(0, 0.9 * scenario.duration_s);
    faults.push_back(draw.fault(kind, severity, time_s));
  }
  return faults;
}

std::vector<RandomFault> aimed_faults(const sim::Scenario& scenario, Random& random) {
  FaultDraw draw(scenario, random);
  std::vector<RandomFault> faults;
  const bool driven = scenario.run.actuation == sim::Actuation::kStepper;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const bool has_ends = std::isfinite(scenario.masses[i].rail.lower_end);
    if (!driven || !has_ends || !random.chance(0.75)) continue;
    const double time_s = draw.time_s(0, 0.15 * scenario.duration_s);  // on its way out
    faults.push_back(draw.lost_steps(static_cast<int>(i), time_s));
  }
  if (random.chance(0.08)) {
    const double time_s = draw.time_s(0, 0.5 * scenario.duration_s);
    faults.push_back(draw.fault(sim::info(FaultKind::kFrictionFalls), 1, time_s));
  }
  return faults;
}

RandomFault random_fault(const sim::Scenario& scenario, FaultKind kind, int severity, Random& random) {
  FaultDraw draw(scenario, random);
  const double time_s = draw.time_s(0.1 * scenario.duration_s, 0.5 * scenario.duration_s);
  return draw.fault(sim::info(kind), severity, time_s);
}

}  // namespace ballast::soak
