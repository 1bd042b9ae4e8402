// Rolls several balls at once, one in each lane of a vector register, by the paper's equations with prescribed masses
// (tools/docs/physics.md, section 1) and Runge-Kutta steps of fixed length (RK4). All balls share rails and motions,
// so that the curves of their masses are evaluated once for all of them; masses, inertias, forces and start may differ.
//
// A lane's result depends on nothing in the other lanes, and has the same bits for AVX-512, AVX2 and portable code:
// the operations are the same, with fused multiply-add where the code says so and nowhere else. N and f_s are sampled
// at every step; extrema between the samples are taken from a polynomial through five of them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "sim/scenario/scenario.h"

namespace ballast::sweep {

inline constexpr std::size_t kLanes = 8;

// One ball of a batch.
struct BatchBall {
  double shell_mass_kg = 0;
  std::array<double, 3> inertia_kgm2{}, center_of_mass_B_m{};
  std::array<double, sim::kMaxMasses> mass_kg{};
  std::array<double, 3> force_W_n{};  // on the geometric centre
  std::array<double, 4> orientation{1, 0, 0, 0};
  std::array<double, 3> angular_velocity_B_radps{};
  std::array<double, 2> position_W_m{};
};

struct BatchExtremum {
  double value = 0, time_s = 0;
};

struct BatchResult {
  BatchExtremum normal_force_min, normal_force_max, static_friction_max;
  BatchExtremum mu_required_max;  // meaningful where N stays above 0
  std::array<double, 4> orientation{};
  std::array<double, 3> angular_velocity_B_radps{};
  std::array<double, 2> position_W_m{};
  // Length of the quaternion before it was normalized: by as much as it differs from that at the start, the steps are
  // too long for the rotation.
  double orientation_length = 1;
};

// One mass at one time, body frame: what its curve chi contributes to the equations, for a mass of 1 kg.
struct CurvePoint {
  std::array<double, 3> position_m, twice_rate_mps, acceleration_mps2;
  std::array<double, 3> position_x_acceleration;           // chi x chi''
  std::array<double, 3> inertia_diagonal, inertia_others;  // |chi|^2 - chi chi^T: xx, yy, zz; xy, xz, yz
  std::array<std::array<double, 3>, 3> turning;            // 2 (chi . chi' - chi' chi^T), row by row
};

// The curves of all masses at the nodes and the middles of the steps. No step crosses an instant at which a motion is
// not smooth; there a segment ends, and another begins with accelerations of its own.
class MotionTable {
 public:
  // Steps of at most `step_s`, at least kLeastSteps per segment.
  MotionTable(const sim::Scenario& scenario, double step_s);

  struct Segment {
    double start_s, step_s;
    std::size_t steps, first_point;  // points: node, middle, node, ..., node; each mass_count() long
  };
  static constexpr std::size_t kLeastSteps = 8;

  [[nodiscard]] const std::vector<Segment>& segments() const { return segments_; }
  // `half_steps` from the segment's start.
  [[nodiscard]] const CurvePoint* points(const Segment& segment, std::size_t half_steps) const {
    return &points_[segment.first_point + half_steps * mass_count_];
  }
  [[nodiscard]] std::size_t mass_count() const { return mass_count_; }
  [[nodiscard]] std::size_t total_steps() const { return total_steps_; }
  [[nodiscard]] std::size_t longest_segment() const { return longest_; }
  [[nodiscard]] double radius_m() const { return radius_m_; }
  [[nodiscard]] double gravity_mps2() const { return gravity_mps2_; }

 private:
  std::size_t mass_count_, total_steps_ = 0, longest_ = 0;
  double radius_m_, gravity_mps2_;
  std::vector<Segment> segments_;
  std::vector<CurvePoint> points_;
};

// The instructions that a batch uses.
enum class Lanes { kPortable, kAvx2, kAvx512 };
[[nodiscard]] Lanes best_lanes();

class RollingBatch {
 public:
  // `table` must outlive the object.
  explicit RollingBatch(const MotionTable& table, Lanes lanes = best_lanes());

  void roll(const std::array<BatchBall, kLanes>& balls, std::array<BatchResult, kLanes>& results);

 private:
  const MotionTable& table_;
  Lanes lanes_;
  // Samples of one segment: N, f_s^2 and (f_s / N)^2 of every lane; and where a lane may have a new extremum.
  std::vector<double> samples_;
  struct Candidate {
    std::size_t step;
    std::uint32_t which;  // bit 8 quantity + lane
  };
  std::vector<Candidate> candidates_;
};

}  // namespace ballast::sweep
