// The scenario's faults of sensors, applied to the message as it leaves them, before anybody hears it.
#pragma once

#include <ballast/sensors_t.hpp>
#include <cstdint>
#include <optional>
#include <vector>

#include "sim/scenario/scenario.h"

namespace ballast::sil {

class SensorFaults {
 public:
  explicit SensorFaults(const sim::Scenario& scenario);

  // Call once per tick with the true sensors, from the countdown on.
  void apply(double time_s, sensors_t& sensors);

 private:
  struct State {
    sim::Fault fault;
    std::uint64_t random;  // one per fault, so that the draws of one do not depend on another
    sensors_t kept{};      // the values that a frozen sensor repeats
    bool frozen = false;
  };
  std::vector<State> states_;
  std::optional<sensors_t> previous_;  // the message of the tick before
};

}  // namespace ballast::sil
