// The rolling ball's closed form over rows of states in arrays, as a loop in C++. tools/benchmarks/figures python
// compares ballast.rolling_forces() with it.
#include <benchmark/benchmark.h>

#include <random>
#include <stdexcept>
#include <vector>

#include "firmware/model/rolling.h"
#include "tools/benchmarks/scenario.h"
#include "tools/program/params.h"

namespace ballast::benchmarks {
namespace {

// Row-major arrays, one row per state.
struct Rows {
  std::vector<double> q, omega, position, velocity, acceleration;
};

Rows random_rows(std::size_t count, std::size_t masses) {
  std::mt19937_64 engine(24);
  std::normal_distribution<double> normal;
  const auto fill = [&](std::vector<double>& values, std::size_t width) {
    values.resize(count * width);
    for (double& value : values) value = normal(engine);
  };
  Rows rows;
  fill(rows.q, 4);
  fill(rows.omega, 3);
  for (auto* values : {&rows.position, &rows.velocity, &rows.acceleration}) fill(*values, masses);
  for (std::size_t row = 0; row < count; ++row) Eigen::Map<Eigen::Vector4d>(rows.q.data() + 4 * row).normalize();
  return rows;
}

void ClosedFormRows(benchmark::State& state) {
  firmware::BallParams ball;
  if (const auto refusal = program::to_ball_params(paper_ball("prescribed"), ball)) throw std::runtime_error(*refusal);
  const auto count = static_cast<std::size_t>(state.range(0)), masses = static_cast<std::size_t>(ball.mass_count);
  const Rows rows = random_rows(count, masses);
  std::vector<double> turning(3 * count), normal(count), friction(2 * count), size(count);
  for (auto _ : state) {
    for (std::size_t row = 0; row < count; ++row) {
      const double* const q = rows.q.data() + 4 * row;
      firmware::MassMotion motion;
      for (std::size_t i = 0; i < masses; ++i) {
        motion.position[i] = rows.position[masses * row + i];
        motion.velocity[i] = rows.velocity[masses * row + i];
        motion.acceleration[i] = rows.acceleration[masses * row + i];
      }
      const firmware::RollingForces forces =
          firmware::rolling_forces(ball, firmware::Quaternion(q[0], q[1], q[2], q[3]),
                                   Eigen::Map<const firmware::Vector3>(rows.omega.data() + 3 * row), motion);
      Eigen::Map<firmware::Vector3>(turning.data() + 3 * row) = forces.angular_acceleration_B_radps2;
      normal[row] = forces.normal_force_n;
      Eigen::Map<firmware::Vector2>(friction.data() + 2 * row) = forces.friction_force_W_n;
      size[row] = forces.static_friction_n;
    }
    benchmark::DoNotOptimize(turning.data());
    benchmark::ClobberMemory();
  }
  state.counters["per_row"] = benchmark::Counter(
      static_cast<double>(count), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(ClosedFormRows)->Arg(10000)->Apply(as_many_calls_as_asked);

}  // namespace
}  // namespace ballast::benchmarks
