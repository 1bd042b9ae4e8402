#include "tools/sweep/rolling_batch.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/masses/motion.h"

namespace ballast::sweep {
namespace {

#define BALLAST_LANES "tools/sweep/rolling_batch.inc"
#define BALLAST_LANES_AVX512
#include "sim/plant/each_instruction_set.inc"

using Hit = void (*)(void* context, std::size_t step, std::uint32_t which);

// The functions of one instruction set.
struct Functions {
  void (*begin)(void* memory, const BatchBall* given, const MotionTable& table);
  void (*next)(void* memory, const MotionTable& table, const MotionTable::Segment& part, double* samples, Hit hit,
               void* context);
  void (*finish)(const void* memory, std::array<BatchResult, kLanes>& results);
};

const Functions& functions(Lanes lanes) {
  static constexpr Functions kPortable{portable::begin, portable::next, portable::finish};
#ifdef __x86_64__
  static constexpr Functions kAvx2{avx2::begin, avx2::next, avx2::finish};
  static constexpr Functions kAvx512{avx512::begin, avx512::next, avx512::finish};
  if (lanes == Lanes::kAvx2) return kAvx2;
  if (lanes == Lanes::kAvx512) return kAvx512;
#endif
  static_cast<void>(lanes);
  return kPortable;
}

// The samples of one quantity of one lane, with the sign that makes its extremum a maximum.
struct Series {
  const double* first;
  double sign;
  std::size_t last;  // the place of the last sample

  [[nodiscard]] double operator[](std::size_t place) const { return sign * first[place * 3 * kLanes]; }
};

// A maximum between samples: its value and its place in steps.
struct Peak {
  double value, place;
};

// The maximum near a sample of the polynomial through five samples around it. Newton's form about the first of them.
Peak refined(const Series& series, std::size_t near) {
  const std::size_t first = std::min(std::max(near, std::size_t{2}) - 2, series.last - 4);
  double c[5];
  for (std::size_t i = 0; i < 5; ++i) c[i] = series[first + i];
  for (std::size_t order = 1; order < 5; ++order) {
    for (std::size_t i = 4; i >= order; --i) c[i] = (c[i] - c[i - 1]) / static_cast<double>(order);
  }
  const auto value_at = [&c](double t) {
    return c[0] + t * (c[1] + (t - 1) * (c[2] + (t - 2) * (c[3] + (t - 3) * c[4])));
  };
  // Golden-section search between the neighbours. Its bracket shrinks to 1e-7 of a step, whose square is rounding.
  double low = static_cast<double>(near - first) - 1, high = low + 2;
  low = std::max(low, 0.0);
  high = std::min(high, 4.0);
  constexpr double kGolden = 0.6180339887498949;
  double a = high - kGolden * (high - low), b = low + kGolden * (high - low), at_a = value_at(a), at_b = value_at(b);
  for (int i = 0; i < 34; ++i) {
    if (at_a >= at_b) {
      high = b, b = a, at_b = at_a;
      a = high - kGolden * (high - low), at_a = value_at(a);
    } else {
      low = a, a = b, at_a = at_b;
      b = low + kGolden * (high - low), at_b = value_at(b);
    }
  }
  return {std::max(at_a, at_b), static_cast<double>(first) + (at_a >= at_b ? a : b)};
}

// Raises the extremum of one quantity of one lane. The first of equal values counts.
void raise(BatchExtremum& extremum, double value, double time_s) {
  if (value > extremum.value) extremum = {value, time_s};
}

}  // namespace

MotionTable::MotionTable(const sim::Scenario& scenario, double step_s)
    : mass_count_(scenario.masses.size()), radius_m_(scenario.ball.radius_m), gravity_mps2_(scenario.gravity_mps2) {
  sim::PrescribedMasses motion(scenario.masses);
  const auto add_points = [&](double time_s) {
    const sim::MassPoint at = motion.at(time_s);
    for (std::size_t i = 0; i < mass_count_; ++i) {
      const auto rail = firmware::evaluate<double>(scenario.masses[i].rail, at.position[i]);
      const Eigen::Vector3d rate = at.velocity[i] * rail.d1;
      const Eigen::Vector3d acceleration = at.velocity[i] * at.velocity[i] * rail.d2 + at.acceleration[i] * rail.d1;
      points_.push_back({{rail.position[0], rail.position[1], rail.position[2]},
                         {rate[0], rate[1], rate[2]},
                         {acceleration[0], acceleration[1], acceleration[2]}});
    }
  };
  for (double time_s = 0; time_s < scenario.duration_s;) {
    motion.enter_pieces(time_s);
    const double end_s = std::min(motion.smooth_until_s(time_s), scenario.duration_s);
    const auto steps = std::max(kLeastSteps, static_cast<std::size_t>(std::ceil((end_s - time_s) / step_s)));
    Segment segment{time_s, (end_s - time_s) / static_cast<double>(steps), steps, points_.size()};
    for (std::size_t k = 0; k <= 2 * steps; ++k)
      add_points(time_s + (end_s - time_s) * (static_cast<double>(k) / static_cast<double>(2 * steps)));
    segments_.push_back(segment);
    total_steps_ += steps;
    longest_ = std::max(longest_, steps);
    time_s = end_s;
  }
}

Lanes best_lanes() {
#ifdef __x86_64__
  static const bool has_avx512 =
      __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  static const bool has_avx2 = __builtin_cpu_supports("avx2");
  if (has_avx512) return Lanes::kAvx512;
  if (has_avx2) return Lanes::kAvx2;
#endif
  return Lanes::kPortable;
}

RollingBatch::RollingBatch(const MotionTable& table, Lanes lanes)
    : table_(table), lanes_(lanes), samples_((table.longest_segment() + 1) * 3 * kLanes) {}

void RollingBatch::roll(const std::array<BatchBall, kLanes>& balls, std::array<BatchResult, kLanes>& results) {
  alignas(64) unsigned char memory[portable::kRollerBytes];
  const Functions& lanes = functions(lanes_);
  lanes.begin(memory, balls.data(), table_);
  constexpr double kLow = -std::numeric_limits<double>::infinity();
  constexpr std::size_t kQuantities = 4;  // -N, N, f_s^2, (f_s / N)^2
  std::array<std::array<BatchExtremum, kLanes>, kQuantities> best;
  for (auto& of_lanes : best) of_lanes.fill({kLow, 0});
  const Hit hit = [](void* context, std::size_t step, std::uint32_t which) {
    static_cast<std::vector<Candidate>*>(context)->push_back({step, which});
  };
  for (const MotionTable::Segment& part : table_.segments()) {
    candidates_.clear();
    lanes.next(memory, table_, part, samples_.data(), hit, &candidates_);
    candidates_.push_back({0, ~0u});
    candidates_.push_back({part.steps, ~0u});
    for (const Candidate& candidate : candidates_) {
      for (std::size_t q = 0; q < kQuantities; ++q) {
        for (std::size_t l = 0; l < kLanes; ++l) {
          if ((candidate.which >> (kLanes * q + l) & 1) == 0) continue;
          const Series series{&samples_[(q == 0 ? 0 : q - 1) * kLanes + l], q == 0 ? -1.0 : 1.0, part.steps};
          // A segment's ends count as they are; a maximum between the last two samples is found from the inner one.
          const bool at_end = candidate.step == 0 || candidate.step == part.steps;
          raise(best[q][l], series[candidate.step], part.start_s + static_cast<double>(candidate.step) * part.step_s);
          const std::size_t near = candidate.step == 0 ? 1 : at_end ? part.steps - 1 : candidate.step;
          const Peak peak = refined(series, near);
          raise(best[q][l], peak.value, part.start_s + peak.place * part.step_s);
        }
      }
    }
  }
  for (std::size_t l = 0; l < kLanes; ++l) {
    results[l].normal_force_min = {-best[0][l].value, best[0][l].time_s};
    results[l].normal_force_max = best[1][l];
    results[l].static_friction_max = {std::sqrt(best[2][l].value), best[2][l].time_s};
    results[l].mu_required_max = {std::sqrt(best[3][l].value), best[3][l].time_s};
  }
  lanes.finish(memory, results);
}

}  // namespace ballast::sweep
