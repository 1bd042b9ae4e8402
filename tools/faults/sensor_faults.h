// What faults make of the sensors: of the message as it leaves them, before anybody hears it.
#pragma once

#include <ballast/sensors_t.hpp>
#include <cstdint>
#include <vector>

#include "sim/scenario/scenario.h"

namespace ballast::sil {

class SensorFaults {
 public:
  explicit SensorFaults(const sim::Scenario& scenario);

  // To be called tick by tick with the true sensors, from the countdown on.
  void suffer(double time_s, sensors_t& sensors);

 private:
  struct State {
    sim::Fault fault;
    std::uint64_t random;  // its own, so that one fault's draws do not depend on another's
    sensors_t kept{};      // what a frozen one goes on saying
    bool frozen = false;
  };
  std::vector<State> states_;
  sensors_t said_{};  // in the tick before
  bool spoken_ = false;
};

}  // namespace ballast::sil
