// The assignments of --set, and --fault. Input: one after the other, each but the last ended by a zero byte; what
// begins with '!' is a --fault.
#include <string>
#include <vector>

#include "tests/fuzz/accepted_scenario.h"
#include "tests/fuzz/change_toml.h"

namespace ballast::fuzz {
namespace {

// Every kind of value, table and array that an assignment can meet.
constexpr char kScenario[] = R"(duration = 1.0
gravity = 9.81
seed = 3
[ball]
radius = 1.0
mass = 2.0
inertia = [0.9, 0.9, 0.9]
[surface]
static_friction = 0.5
[[mass]]
mass = 0.5
initial_position = 0.1
rail = { shape = "circle", center = [0, 0, 0], radius = 0.9, axes = [[1, 0, 0], [0, 0, 1]] }
motor = { gear_ratio = 1, holding_torque = 20, rotor_inertia = 0.01, viscous_damping = 0.1, corner_speed = 50, max_step_rate = 20000, max_acceleration = 20, max_jerk = 2000 }
[[mass.motion]]
duration = 0.5
acceleration = [0.1, -0.1]
[[mass]]
mass = 0.4
rail = { shape = "line", origin = [0, 0, 0], direction = [1, 0, 0] }
motor = { travel_per_revolution = 0.1, holding_torque = 20, rotor_inertia = 0.01, viscous_damping = 0.1, corner_speed = 50, max_step_rate = 20000, max_acceleration = 20, max_jerk = 2000 }
)";

}  // namespace

Bytes change_one_thing(Bytes input, std::mt19937_64& random) { return change_toml(std::move(input), random); }

bool take(std::span<const std::uint8_t> input) {
  std::vector<std::string> overrides(1);
  for (const std::uint8_t byte : input) {
    if (byte == 0) {
      overrides.emplace_back();
    } else {
      overrides.back() += static_cast<char>(byte);
    }
  }
  std::vector<std::string> faults;
  std::erase_if(overrides, [&faults](const std::string& text) {
    const bool fault = text.starts_with('!');
    if (fault) faults.push_back(text.substr(1));
    return fault;
  });
  return check(sim::parse_scenario(kScenario, "fuzz.toml", overrides, faults));
}

}  // namespace ballast::fuzz
