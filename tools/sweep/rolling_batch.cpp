#include "tools/sweep/rolling_batch.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

// Clang has no pragma for the instructions of some functions; with it, the portable code computes the same bits.
#if defined(__x86_64__) && !defined(__clang__)
#define BALLAST_HAS_LANES
#include <immintrin.h>
#endif

#include "sim/masses/motion.h"

// Functions with vector arguments are all inlined, so no calling convention matters.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace ballast::sweep {
namespace {

namespace portable {
constexpr std::size_t kWidth = 2;
using V = double __attribute__((vector_size(8 * kWidth)));
using M = std::int64_t __attribute__((vector_size(8 * kWidth)));
// A processor without fused multiply-add computes the same in software, slowly.
[[gnu::always_inline]] inline V mul_add(const V& a, const V& b, const V& c) {
  V sum;
  for (std::size_t l = 0; l < kWidth; ++l) sum[l] = __builtin_fma(a[l], b[l], c[l]);
  return sum;
}
[[gnu::always_inline]] inline V mul_sub(const V& a, const V& b, const V& c) { return mul_add(a, b, -c); }
[[gnu::always_inline]] inline V sub_mul(const V& a, const V& b, const V& c) { return mul_add(-a, b, c); }
[[gnu::always_inline]] inline unsigned lanes_of(const M& mask) {
  unsigned lanes = 0;
  for (unsigned l = 0; l < kWidth; ++l) lanes |= static_cast<unsigned>(mask[l] & 1) << l;
  return lanes;
}
#include "tools/sweep/rolling_batch.inc"
}  // namespace portable

#ifdef BALLAST_HAS_LANES
#pragma GCC push_options
#pragma GCC target("avx2,fma")
namespace avx2 {
constexpr std::size_t kWidth = 4;
using V = double __attribute__((vector_size(8 * kWidth)));
using M = std::int64_t __attribute__((vector_size(8 * kWidth)));
[[gnu::always_inline]] inline V mul_add(const V& a, const V& b, const V& c) { return _mm256_fmadd_pd(a, b, c); }
[[gnu::always_inline]] inline V mul_sub(const V& a, const V& b, const V& c) { return _mm256_fmsub_pd(a, b, c); }
[[gnu::always_inline]] inline V sub_mul(const V& a, const V& b, const V& c) { return _mm256_fnmadd_pd(a, b, c); }
[[gnu::always_inline]] inline unsigned lanes_of(const M& mask) {
  return static_cast<unsigned>(_mm256_movemask_pd(reinterpret_cast<V>(mask)));
}
#include "tools/sweep/rolling_batch.inc"
}  // namespace avx2
#pragma GCC pop_options
#pragma GCC push_options
#pragma GCC target("avx512f,avx512dq,avx512vl")
namespace avx512 {
constexpr std::size_t kWidth = 8;
using V = double __attribute__((vector_size(8 * kWidth)));
using M = std::int64_t __attribute__((vector_size(8 * kWidth)));
[[gnu::always_inline]] inline V mul_add(const V& a, const V& b, const V& c) { return _mm512_fmadd_pd(a, b, c); }
[[gnu::always_inline]] inline V mul_sub(const V& a, const V& b, const V& c) { return _mm512_fmsub_pd(a, b, c); }
[[gnu::always_inline]] inline V sub_mul(const V& a, const V& b, const V& c) { return _mm512_fnmadd_pd(a, b, c); }
[[gnu::always_inline]] inline unsigned lanes_of(const M& mask) {
  return _mm512_movepi64_mask(reinterpret_cast<__m512i>(mask));
}
#include "tools/sweep/rolling_batch.inc"
}  // namespace avx512
#pragma GCC pop_options
#endif

using Hit = void (*)(void* context, std::size_t step, std::uint32_t which);

// The functions of one instruction set.
struct Functions {
  void (*begin)(void* memory, const BatchBall* given, const MotionTable& table);
  void (*next)(void* memory, const MotionTable& table, const MotionTable::Segment& part, double* samples, Hit hit,
               void* context);
  void (*finish)(const void* memory, std::array<BatchResult, kLanes>& results);
};

#ifdef BALLAST_HAS_LANES
constexpr std::size_t kMostBytes = std::max({portable::kRollerBytes, avx2::kRollerBytes, avx512::kRollerBytes});
#else
constexpr std::size_t kMostBytes = portable::kRollerBytes;
#endif

const Functions& functions(Lanes lanes) {
  static constexpr Functions kPortable{portable::begin, portable::next, portable::finish};
#ifdef BALLAST_HAS_LANES
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

// The polynomial through five samples at 0, 1, 2, 3, 4.
class Quartic {
 public:
  explicit Quartic(std::array<double, 5> values) : newton_(values) {
    std::array<double, 5>& c = newton_;
    for (std::size_t order = 1; order < 5; ++order) {
      for (std::size_t i = 4; i >= order; --i) c[i] = (c[i] - c[i - 1]) / static_cast<double>(order);
    }
    // Powers of t of t (t - 1) (t - 2) (t - 3) and of its first factors.
    slope_ = {c[1] - c[2] + 2 * c[3] - 6 * c[4], 2 * (c[2] - 3 * c[3] + 11 * c[4]), 3 * (c[3] - 6 * c[4]), 4 * c[4]};
  }

  [[nodiscard]] double value_at(double t) const {
    const std::array<double, 5>& c = newton_;
    return c[0] + t * (c[1] + (t - 1) * (c[2] + (t - 2) * (c[3] + (t - 3) * c[4])));
  }

  // The place of a maximum between low and high, by Newton's method for the slope from `start` on. NaN: not found so.
  [[nodiscard]] double peak(double start, double low, double high) const {
    const std::array<double, 4>& d = slope_;
    constexpr double kEnough = 1e-7;  // of a step; the value's error is its square
    double t = start;
    for (int i = 0; i < 8; ++i) {
      const double slope = d[0] + t * (d[1] + t * (d[2] + t * d[3]));
      const double curvature = d[1] + t * (2 * d[2] + t * (3 * d[3]));
      const double step = slope / curvature;
      t -= step;
      if (!(curvature < 0) || !(t >= low && t <= high)) break;
      if (std::abs(step) < kEnough) return t;
    }
    return std::nan("");
  }

 private:
  std::array<double, 5> newton_;  // divided differences
  std::array<double, 4> slope_;   // powers of t
};

// The place of the greatest value between low and high, by golden-section search to 1e-7.
double searched(const Quartic& quartic, double low, double high) {
  constexpr double kGolden = 0.6180339887498949;
  double a = high - kGolden * (high - low), b = low + kGolden * (high - low);
  double at_a = quartic.value_at(a), at_b = quartic.value_at(b);
  for (int i = 0; i < 34; ++i) {
    if (at_a >= at_b) {
      high = b, b = a, at_b = at_a;
      a = high - kGolden * (high - low), at_a = quartic.value_at(a);
    } else {
      low = a, a = b, at_a = at_b;
      b = low + kGolden * (high - low), at_b = quartic.value_at(b);
    }
  }
  return at_a >= at_b ? a : b;
}

// The maximum between the neighbours of a sample, by the polynomial through five samples around it.
Peak refined(const Series& series, std::size_t near) {
  const std::size_t first = std::min(std::max(near, std::size_t{2}) - 2, series.last - 4);
  const Quartic quartic({series[first], series[first + 1], series[first + 2], series[first + 3], series[first + 4]});
  const auto start = static_cast<double>(near - first);
  const double low = std::max(start - 1, 0.0), high = std::min(start + 1, 4.0);
  double place = quartic.peak(start, low, high);
  if (std::isnan(place)) place = searched(quartic, low, high);
  return {quartic.value_at(place), static_cast<double>(first) + place};
}

// More than any value between the neighbours of a sample: the greatest of the three, and twice the height that a
// parabola can have above them, as a margin for the other terms.
double most_near(const Series& series, std::size_t near) {
  const double before = series[near - 1], at = series[near], after = series[near + 1];
  return std::max({before, at, after}) + 0.25 * (std::abs(at - before) + std::abs(at - after));
}

// Raises the extremum of one quantity of one lane. The first of equal values counts.
void raise(BatchExtremum& extremum, double value, double time_s) {
  if (value > extremum.value) extremum = {value, time_s};
}

CurvePoint curve_point(const Eigen::Vector3d& c, const Eigen::Vector3d& rate, const Eigen::Vector3d& acceleration) {
  const auto array_of = [](const Eigen::Vector3d& v) { return std::array{v[0], v[1], v[2]}; };
  const Eigen::Matrix3d turning = 2 * (c.dot(rate) * Eigen::Matrix3d::Identity() - rate * c.transpose());
  CurvePoint point;
  point.position_m = array_of(c);
  point.twice_rate_mps = array_of(2 * rate);
  point.acceleration_mps2 = array_of(acceleration);
  point.position_x_acceleration = array_of(c.cross(acceleration));
  point.inertia_diagonal = {c[1] * c[1] + c[2] * c[2], c[0] * c[0] + c[2] * c[2], c[0] * c[0] + c[1] * c[1]};
  point.inertia_others = {-c[0] * c[1], -c[0] * c[2], -c[1] * c[2]};
  for (int row = 0; row < 3; ++row) point.turning[static_cast<std::size_t>(row)] = array_of(turning.row(row));
  return point;
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
      points_.push_back(curve_point(rail.position, rate, acceleration));
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
#ifdef BALLAST_HAS_LANES
  static const bool has_avx512 =
      __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
  static const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (has_avx512) return Lanes::kAvx512;
  if (has_avx2) return Lanes::kAvx2;
#endif
  return Lanes::kPortable;
}

RollingBatch::RollingBatch(const MotionTable& table, Lanes lanes)
    : table_(table), lanes_(lanes), samples_((table.longest_segment() + 1) * 3 * kLanes) {}

void RollingBatch::roll(const std::array<BatchBall, kLanes>& balls, std::array<BatchResult, kLanes>& results) {
  alignas(64) unsigned char memory[kMostBytes];
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
    const auto for_each = [&](const auto& take) {
      for (const Candidate& candidate : candidates_) {
        for (std::uint32_t rest = candidate.which; rest != 0; rest &= rest - 1) {
          const auto bit = static_cast<std::size_t>(std::countr_zero(rest));
          const std::size_t q = bit / kLanes, l = bit % kLanes;
          take(candidate.step, Series{&samples_[(q == 0 ? 0 : q - 1) * kLanes + l], q == 0 ? -1.0 : 1.0, part.steps},
               best[q][l]);
        }
      }
    };
    // The samples first, so that few maxima between them are left that may be greater.
    for_each([&part](std::size_t step, const Series& series, BatchExtremum& extremum) {
      raise(extremum, series[step], part.start_s + static_cast<double>(step) * part.step_s);
    });
    for_each([&part](std::size_t step, const Series& series, BatchExtremum& extremum) {
      // A maximum beside a segment's end is found from the inner sample.
      const std::size_t near = std::clamp(step, std::size_t{1}, part.steps - 1);
      if (most_near(series, near) < extremum.value) return;
      const Peak peak = refined(series, near);
      raise(extremum, peak.value, part.start_s + peak.place * part.step_s);
    });
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
