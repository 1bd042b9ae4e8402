// The faults injected into motors, rails, floor and ball. They begin and end between two steps of the integrator.
#pragma once

#include <vector>

#include "sim/plant/equations.h"

namespace ballast::sim {

class InjectedFaults {
 public:
  explicit InjectedFaults(const PlantModel& model);

  // Begins and ends the faults that are due at dynamics.time_s. True: there were some.
  bool update(Dynamics& dynamics);
  // The time at which the next fault begins or ends; +infinity if there is none.
  [[nodiscard]] double next_s() const;

 private:
  struct Edge {
    double time_s;
    std::size_t fault;  // of faults_
    bool begins;
  };
  // The worst of several active faults of one kind counts; pushes add up.
  void apply_active(Equations& equations) const;

  std::vector<PlantFault> faults_;
  std::vector<char> active_;  // per fault
  std::vector<Edge> edges_;   // in order of time
  std::size_t next_edge_ = 0;
};

}  // namespace ballast::sim
