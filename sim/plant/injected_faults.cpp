#include "sim/plant/injected_faults.h"

#include <algorithm>
#include <limits>

namespace ballast::sim {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

InjectedFaults::InjectedFaults(const PlantModel& model) : faults_(model.faults), active_(model.faults.size(), 0) {
  for (std::size_t k = 0; k < faults_.size(); ++k) {
    const PlantFault& fault = faults_[k];
    edges_.push_back({fault.time_s, k, true});
    if (fault.end_s > fault.time_s && fault.end_s < kInfinity) edges_.push_back({fault.end_s, k, false});
  }
  std::stable_sort(edges_.begin(), edges_.end(), [](const Edge& a, const Edge& b) { return a.time_s < b.time_s; });
}

double InjectedFaults::next_s() const {
  if (next_edge_ == edges_.size()) return kInfinity;
  return edges_[next_edge_].time_s;
}

bool InjectedFaults::update(Dynamics& dynamics) {
  const std::size_t first = next_edge_;
  for (; next_s() <= dynamics.time_s; ++next_edge_) {
    const Edge& edge = edges_[next_edge_];
    const PlantFault& fault = faults_[edge.fault];
    active_[edge.fault] = static_cast<char>(edge.begins);
    if (!edge.begins) continue;
    MotorDrives& motors = dynamics.equations.motors;
    if (fault.kind == PlantFaultKind::kLostSteps) {
      motors.stepper(fault.mass).swallow(static_cast<std::int64_t>(fault.value));
    }
    if (fault.kind == PlantFaultKind::kBlockedRail) motors.block(fault.mass, dynamics.now.y[kTheta + fault.mass]);
  }
  if (next_edge_ == first) return false;
  apply_active(dynamics.equations);
  return true;
}

void InjectedFaults::apply_active(Equations& equations) const {
  std::array<bool, kMaxMasses> stalled{}, reversed{}, blocked{};
  PerMass coil{};
  coil.fill(1);
  Eigen::Vector3d push_W_n = Eigen::Vector3d::Zero();
  double static_friction = kInfinity;
  for (std::size_t k = 0; k < faults_.size(); ++k) {
    if (active_[k] == 0) continue;
    const PlantFault& fault = faults_[k];
    const std::size_t i = fault.mass;
    if (fault.kind == PlantFaultKind::kMotorStall) stalled[i] = true;
    if (fault.kind == PlantFaultKind::kReversedWiring) reversed[i] = true;
    if (fault.kind == PlantFaultKind::kBlockedRail) blocked[i] = true;
    if (fault.kind == PlantFaultKind::kWeakCoil) coil[i] = std::min(coil[i], fault.value);
    if (fault.kind == PlantFaultKind::kFrictionFalls) static_friction = std::min(static_friction, fault.value);
    if (fault.kind == PlantFaultKind::kPush) push_W_n += fault.value * fault.direction_W;
  }
  for (std::size_t i = 0; i < equations.mass_count() && equations.driven(); ++i) {
    Stepper& stepper = equations.motors.stepper(i);
    stepper.power(!stalled[i]);
    stepper.reverse(reversed[i]);
    stepper.weaken_coil(coil[i]);
    if (!blocked[i]) equations.motors.release(i);
  }
  equations.floor.fall_to(static_friction);
  equations.lay_floor();
  equations.body.external_force.set_push(vec3(push_W_n));
}

}  // namespace ballast::sim
