// The plant's messages, and step commands as the plant takes them.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "hal/lcm/messages.h"
#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"
#include "sim/sensors/sensors.h"

namespace ballast::sil {

// The three messages the plant sends in one control tick.
struct PlantMessages {
  contact_t contact;
  plant_state_t state;
  sensors_t sensors;
};

// The orientation in sensors_t where nothing senses it: w, x, y, z.
inline constexpr double kNoAttitude[4] = {1, 0, 0, 0};

// Before t = 0 (tick < 0) time_s is the sample's, 0, and utime the tick's own. `commanded`: N and f_s of the
// commanded masses at this instant, under the external forces that the controller is told of; none where nothing is
// commanded.
PlantMessages plant_messages(const sim::Scenario& scenario, const sim::Plant::Sample& sample, std::int64_t tick,
                             bool last, const std::optional<sim::Plant::ContactForces>& commanded = std::nullopt);

// Takes the ball's motion out of a sample of t = 0: in the scenario's `hold` it is held still. Its masses, N and f_s
// stay those of t = 0, as in the countdown.
void hold_still(sim::Plant::Sample& sample);

// Replaces what ideal sensors say by what the scenario's do.
void set_sensors(const sim::SensorReadings& readings, const sim::SensorModel& model, sensors_t& sensors);

// The motion that sensors measure.
sim::TrueMotion true_motion(const sim::Scenario& scenario, const sim::Plant::Sample& sample);

// Sets the commanded_ fields of a message whose regime is set.
void set_commanded(const std::optional<sim::Plant::ContactForces>& commanded, contact_t& contact);

// The unused part of the friction cone: 1 - f_s / (mu_s N), at least -1; 1 with perfect friction; -1 where N <= 0.
double friction_margin(double normal_force_n, double static_friction_n, double static_friction_coefficient);

// The single pulses of a command, in order of time (equal times: in order of the motors), into `pulses`.
void expand(const step_command_t& command, double timer_frequency_hz, std::vector<sim::StepPulse>& pulses);

}  // namespace ballast::sil
