#include "tools/sil/step_ledger.h"

#include <array>
#include <cmath>

namespace ballast::sil {

namespace {

// A corrupted command may hold any number, so differences wrap instead of overflowing.
std::int64_t minus(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b));
}

bool inside(const step_command_t& command, int b, double timer_ticks) {
  const std::int64_t pulses = command.count[b], interval = command.interval[b], add = command.add[b];
  const std::int64_t last = command.first[b] + (pulses - 1) * interval + add * ((pulses - 1) * (pulses - 2) / 2);
  const bool in_order = pulses < 2 || (interval >= 0 && interval + add * (pulses - 2) >= 0);
  return in_order && command.first[b] >= 0 && static_cast<double>(last) <= timer_ticks;
}

}  // namespace

std::string StepLedger::fault_of(const step_command_t& command, double timer_ticks) {
  for (int b = 0; b < command.burst_count; ++b) {
    if (inside(command, b, timer_ticks)) continue;
    return "the step command of tick " + std::to_string(command.tick) + " has pulses of motor " +
           std::to_string(command.motor[b]) + " outside their tick";
  }
  std::int64_t sum[8]{};
  for (int b = 0; b < command.burst_count; ++b)
    sum[command.motor[b]] += static_cast<std::int64_t>(command.direction[b]) * command.count[b];
  for (int i = 0; i < command.motor_count; ++i) {
    if (sum[i] == command.steps[i]) continue;
    return "the step command of tick " + std::to_string(command.tick) + " counts " + std::to_string(command.steps[i]) +
           " microsteps of motor " + std::to_string(i) + ", its pulses make " + std::to_string(sum[i]);
  }
  return "";
}

bool StepLedger::gives(const step_command_t& command, double timer_frequency_hz,
                       std::span<const sim::StepPulse> pulses) {
  struct Sums {
    std::int64_t forth = 0, back = 0, timer_ticks = 0;
    bool operator==(const Sums&) const = default;
  };
  std::array<Sums, sim::kMaxMasses> said{}, given{};
  for (int b = 0; b < command.burst_count; ++b) {
    Sums& sums = said[static_cast<std::size_t>(command.motor[b])];
    const std::int64_t n = command.count[b];
    (command.direction[b] > 0 ? sums.forth : sums.back) += n;
    // Sums of j and of j (j - 1) / 2 over j = 0..n-1. Without an error all times are inside the tick, so nothing
    // overflows.
    sums.timer_ticks +=
        n * command.first[b] + n * (n - 1) / 2 * command.interval[b] + n * (n - 1) * (n - 2) / 6 * command.add[b];
  }
  double last_s = 0;
  for (const sim::StepPulse& pulse : pulses) {
    if (pulse.offset_s < last_s || pulse.motor < 0 || pulse.motor >= sim::kMaxMasses) return false;
    last_s = pulse.offset_s;
    Sums& sums = given[static_cast<std::size_t>(pulse.motor)];
    ++(pulse.direction > 0 ? sums.forth : sums.back);
    sums.timer_ticks += std::llround(pulse.offset_s * timer_frequency_hz);
  }
  return given == said;
}

bool StepLedger::enter(const step_command_t& command) {
  bool agrees = true;
  for (int i = 0; i < command.motor_count; ++i) {
    const std::int64_t before = minus(command.position_steps[i], command.steps[i]);
    const std::int64_t missing = minus(before, given_[i]);
    agrees = agrees && missing == missing_[i];
    if (missing != missing_[i] && text_.empty()) {
      text_ = "not all steps reach the motors: before tick " + std::to_string(command.tick) +
              " the controller counts motor " + std::to_string(i) + " at " + std::to_string(before) +
              " microsteps, and the motor has been given " + std::to_string(given_[i]);
    }
    missing_[i] = missing;
    given_[i] += command.steps[i];
  }
  return agrees;
}

}  // namespace ballast::sil
