#include "sim/plant/plant_model.h"

#include <algorithm>

namespace ballast::sim {

double PlantModel::greatest_force_n() const {
  double greatest = external_force_W_n.norm();
  for (const Eigen::Vector3d& force : force_table.forces_W_n) greatest = std::max(greatest, force.norm());
  for (const PlantFault& fault : faults) {
    if (fault.kind == PlantFaultKind::kPush) greatest += fault.value;
  }
  return greatest;
}

}  // namespace ballast::sim
