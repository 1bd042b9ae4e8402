// Proof that the tick does not touch the heap: every allocator of this program is replaced by one that counts.
#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <iostream>
#include <limits>
#include <memory>
#include <new>

#include "firmware/model/rolling.h"
#include "sim/closed_forms/detached.h"
#include "sim/closed_forms/rolling_disk.h"
#include "tests/firmware/course_numbers.h"
#include "tests/firmware/governed_ball.h"
#include "tests/firmware/paper_ball.h"
#include "tests/firmware/whole_tick.h"

namespace {

// Plain variables: this program has one thread.
volatile bool counting = false;
volatile long allocations = 0;

void count() {
  if (counting) allocations = allocations + 1;
}

}  // namespace

#if defined(__SANITIZE_ADDRESS__)
// The sanitizer owns malloc, but tells of every use.
extern "C" int __sanitizer_install_malloc_and_free_hooks(void (*)(const volatile void*, std::size_t),
                                                         void (*)(const volatile void*));
namespace {
const int hooks = __sanitizer_install_malloc_and_free_hooks([](const volatile void*, std::size_t) { count(); },
                                                            [](const volatile void*) { count(); });
}
#else
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);

void* malloc(std::size_t size) {
  count();
  return __libc_malloc(size);
}
void* calloc(std::size_t n, std::size_t size) {
  count();
  return __libc_calloc(n, size);
}
void* realloc(void* p, std::size_t size) {
  count();
  return __libc_realloc(p, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  count();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** p, std::size_t alignment, std::size_t size) {
  count();
  *p = __libc_memalign(alignment, size);
  return *p == nullptr ? ENOMEM : 0;
}
void free(void* p) {
  count();
  __libc_free(p);
}
}  // extern "C"

void* operator new(std::size_t size) {
  count();
  if (void* p = __libc_malloc(size)) return p;
  std::abort();
}
void* operator new[](std::size_t size) { return operator new(size); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  count();
  if (void* p = __libc_memalign(static_cast<std::size_t>(alignment), size)) return p;
  std::abort();
}
void* operator new[](std::size_t size, std::align_val_t alignment) { return operator new(size, alignment); }
void operator delete(void* p) noexcept { free(p); }
void operator delete[](void* p) noexcept { free(p); }
void operator delete(void* p, std::size_t) noexcept { free(p); }
void operator delete[](void* p, std::size_t) noexcept { free(p); }
void operator delete(void* p, std::align_val_t) noexcept { free(p); }
void operator delete[](void* p, std::align_val_t) noexcept { free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { free(p); }
void operator delete[](void* p, std::size_t, std::align_val_t) noexcept { free(p); }
#endif

namespace ballast::firmware {
namespace {

using namespace closed_forms;

// Keeps the compiler from removing an allocation it can see through.
void* volatile sink;

template <class Work>
long allocations_during(Work work) {
  allocations = 0;
  counting = true;
  work();
  counting = false;
  return allocations;
}

TEST(NoHeap, TheGuardCounts) {
  EXPECT_GE(allocations_during([] {
              sink = std::malloc(10);
              std::free(sink);
            }),
            2);
  EXPECT_GE(allocations_during([] { sink = new int(3); }), 1);
  delete static_cast<int*>(sink);
  EXPECT_GE(allocations_during([] { sink = std::calloc(2, 8); }), 1);
  EXPECT_GE(allocations_during([] { sink = std::realloc(sink, 1000); }), 1);
  EXPECT_GE(allocations_during([] { std::free(sink); }), 1);
  EXPECT_GE(allocations_during([] { sink = std::aligned_alloc(64, 64); }), 1);
  std::free(sink);
  struct alignas(128) Wide {
    char bytes[128];
  };
  EXPECT_GE(allocations_during([] { sink = new Wide(); }), 1);
  delete static_cast<Wide*>(sink);
  void* p = nullptr;
  EXPECT_GE(allocations_during([&] {
              if (posix_memalign(&p, 64, 64) == 0) sink = p;
            }),
            1);
  std::free(p);
  EXPECT_EQ(allocations_during([] {}), 0);
}

TEST(NoHeap, TheClosedFormsOutsideTheTick) {
  BallParams ball = testing::paper_ball();
  ball.rail[1] = testing::wavy_spline();
  MassMotion masses;
  masses.velocity.fill(0.1);
  Real sum = 0;
  EXPECT_EQ(allocations_during([&] {
              const Quaternion q(0.6, 0, 0.8, 0);
              const Vector3 omega(0.1, 0.2, 0.3);
              const DiskState disk{0.3, 0.2};
              sum += rolling_forces_3d(ball, q, omega, along_rails(ball, masses)).normal_force_n;
              sum += detached_motion(ball, q, omega, masses).acceleration_W_mps2[2];
              sum += rolling_disk_forces(ball, disk, masses).normal_force_n;
              sum += detached_disk_motion(ball, disk, masses).acceleration_W_mps2[2];
            }),
            0);
  EXPECT_TRUE(std::isfinite(sum));
}

TEST(NoHeap, AMillionTicks) {
  const auto params = std::make_unique<ControllerParams>(testing::paper_params());
  // Turns the masses to and fro for the whole run: 60 pieces of 16 s.
  ProfilePiece pieces[60];
  for (int i = 0; i < 60; ++i) {
    const Real a = i % 2 == 0 ? 0.2 : -0.2;
    pieces[i] = {16, a, -a};
  }
  for (std::size_t i = 0; i < 3; ++i) {
    ASSERT_TRUE(params->motion[i].set(testing::kPaperStart[i], 0.3, pieces, 60));
  }
  params->ball.rail[1] = testing::wavy_spline();
  ASSERT_TRUE(validate(*params).ok());
  const auto state = std::make_unique<ControllerState>();
  const auto out = std::make_unique<Outputs>();
  reset(*params, *state);

  Inputs in;
  bool overloaded = false;
  std::int64_t pulses_before_trip = 0;
  const long during = allocations_during([&] {
    for (std::int64_t k = 0; k < 1'000'000; ++k) {
      const Real t = static_cast<Real>(k) * 1e-3;
      in.tick = in.sensors.tick = in.monitor.tick = k;
      in.sensors.orientation = Quaternion(std::cos(t / 3), std::sin(t / 3), 0, 0);
      in.sensors.gyro_B_radps = Vector3(2.0 / 3, 0, 0);
      in.operator_command =
          k == 1 ? OperatorCommand::kArm : (k == 2 ? OperatorCommand::kStart : OperatorCommand::kNone);
      in.monitor.tripped = k >= 990'000;
      if (k == 990'000) pulses_before_trip = out->status.steps_issued[0];
      whole_tick(*params, *state, in, *out);
      overloaded = overloaded || (state->faults & static_cast<std::uint32_t>(Fault::kStepOverload)) != 0;
    }
  });
  EXPECT_EQ(during, 0);
  EXPECT_FALSE(overloaded);
  EXPECT_GT(pulses_before_trip, 100'000) << "the masses have to move for this to prove anything";
  EXPECT_EQ(out->status.mode, Mode::kTripped);
  EXPECT_TRUE(out->status.at_rest);
}

// The filter, encoders, places from outside and the measured contact force, with samples that stay away or are none.
TEST(NoHeap, AnEstimatedAttitude) {
  const auto params = std::make_unique<ControllerParams>(testing::paper_params());
  EstimationParams& estimation = params->estimation;
  estimation.estimated = estimation.measures_contact = estimation.has_encoders = true;
  estimation.imu_latency_ticks = 3;
  estimation.fix_delay_ticks = 20;
  estimation.fix_noise_m = 0.01;
  estimation.gyro.noise = 1e-3;
  estimation.accelerometer.noise = 1e-2;
  estimation.encoder_resolution.fill(1e-3);
  ASSERT_TRUE(validate(*params).ok());
  const auto state = std::make_unique<ControllerState>();
  const auto out = std::make_unique<Outputs>();
  Inputs in;
  in.sensors.attitude_valid = false;
  in.sensors.has_encoders = true;
  int estimates = 0, running = 0;
  EXPECT_EQ(allocations_during([&] {
              reset(*params, *state);
              for (std::int64_t k = -1000; k < 99'000; ++k) {
                in.tick = in.sensors.tick = in.monitor.tick = k;
                const Real t = static_cast<Real>(k > 0 ? k : 0) * 1e-3, noise = static_cast<Real>(k % 7 - 3) * 1e-3;
                if (k % 1000 < 990) {
                  in.sensors.imu_count += 1;
                  in.sensors.imu_tick = k - 3;
                }
                in.sensors.gyro_B_radps = Vector3(k > 0 ? 2.0 / 3 : 0, 0, 0) + Vector3(noise, -noise, noise);
                in.sensors.accelerometer_B_mps2 = Vector3(noise, std::sin(2 * t / 3), std::cos(2 * t / 3) + noise);
                if (k % 5000 == 4321) in.sensors.gyro_B_radps[1] = std::numeric_limits<Real>::quiet_NaN();
                if (k % 100 == 0) {
                  in.sensors.fix_count += 1;
                  in.sensors.fix_tick = k - 20;
                }
                for (std::size_t i = 0; i < 3; ++i) in.sensors.encoder[i] = out->status.commanded_position[i] + noise;
                in.operator_command = state->mode == Mode::kTripped    ? OperatorCommand::kReset
                                      : state->mode == Mode::kDisarmed ? OperatorCommand::kArm
                                      : state->mode == Mode::kArmed    ? OperatorCommand::kStart
                                                                       : OperatorCommand::kNone;
                whole_tick(*params, *state, in, *out);
                estimates += out->status.estimate.valid;
                running += state->mode == Mode::kRunning;
              }
            }),
            0);
  EXPECT_GT(estimates, 90'000);
  EXPECT_GT(running, 0);
}

TEST(NoHeap, GovernedMotion) {
  const auto params = std::make_unique<ControllerParams>(testing::paper_params());
  params->governor.on = true;
  params->governor.friction = Real(0.17);
  params->governor.swing[0] = {Real(10), Real(0.2), Real(0.002), Real(0.03), Real(0.015)};
  const auto state = std::make_unique<ControllerState>();
  const auto out = std::make_unique<Outputs>();
  Inputs in;
  int governed = 0, bent = 0;
  EXPECT_EQ(allocations_during([&] {
              reset(*params, *state);
              for (std::int64_t k = 0; k < 10'000; ++k) {
                in.tick = in.sensors.tick = in.monitor.tick = k;
                in.sensors.gyro_B_radps = Vector3(0, Real(1e-4) * static_cast<Real>(k % 3000), 0);
                in.operator_command = k == 0   ? OperatorCommand::kArm
                                      : k == 1 ? OperatorCommand::kStart
                                               : OperatorCommand::kNone;
                whole_tick(*params, *state, in, *out);
                governed += out->status.governor.governs;
                bent += out->status.governor.bent;
              }
            }),
            0);
  EXPECT_GT(governed, 5000);
  EXPECT_GT(bent, 100);
}

// Feedback along a whole table, through its end and the hold there, with a ball that is off by turns little and far, so
// that masses saturate and the integral waits; then a stop.
TEST(NoHeap, ATrackedRun) {
  const auto params = std::make_unique<ControllerParams>(testing::paper_params());
  ReferenceTable& table = params->tracking;
  const int masses = params->ball.mass_count, row = reference_row(masses);
  table.samples = kMostReferenceFloats / row;
  table.period_s = 0.5;
  table.holds = true;
  for (int k = 0; k < table.samples; ++k) {
    float* values = table.values.data() + static_cast<std::ptrdiff_t>(k) * row;
    values[0] = 1;
    for (int c = kReferenceStateFloats; c < row; ++c) values[c] = 0.125f * static_cast<float>((c + k) % 5 - 2);
  }
  ASSERT_TRUE(validate(*params).ok());
  const auto state = std::make_unique<ControllerState>();
  const auto out = std::make_unique<Outputs>();
  Inputs in;
  int tracked = 0, integrated = 0;
  EXPECT_EQ(allocations_during([&] {
              reset(*params, *state);
              for (std::int64_t k = 0; k < 100'000; ++k) {
                in.tick = in.sensors.tick = in.monitor.tick = k;
                const Real t = static_cast<Real>(k) * 1e-3, size = k % 4000 < 3000 ? 1e-3 : 0.3;
                in.sensors.orientation = Quaternion(std::cos(size), std::sin(size), 0, 0);
                in.sensors.gyro_B_radps = size * Vector3(std::sin(t), std::cos(t), 1);
                in.operator_command = k == 1        ? OperatorCommand::kArm
                                      : k == 2      ? OperatorCommand::kStart
                                      : k == 90'000 ? OperatorCommand::kStop
                                                    : OperatorCommand::kNone;
                const Vector2 before = state->tracking.integral_W_ms;
                whole_tick(*params, *state, in, *out);
                tracked += state->tracking.follows && state->mode == Mode::kRunning;
                integrated += state->tracking.integral_W_ms != before;
              }
            }),
            0);
  EXPECT_GT(tracked, 89'000) << state->faults;
  EXPECT_GT(integrated, 1'000);
  EXPECT_LT(integrated, 89'000);  // it waited
  EXPECT_GT(out->status.steps_issued[0], 1'000);
}

// A course that arrives, is certified and begins, and one that replaces it while the masses move.
TEST(NoHeap, Courses) {
  testing::GovernedBall robot(testing::hanging_params());
  const auto first = testing::parts_of(5, testing::course_forth().values());
  testing::CourseNumbers back = testing::course_forth();
  back.from_tick = 15'000;
  back.mass[0].position = 0.005;
  back.mass[0].pieces = testing::push(-1);
  const auto second = testing::parts_of(6, back.values());
  int first_ticks = 0, second_ticks = 0;
  EXPECT_EQ(allocations_during([&] {
              robot.tick(OperatorCommand::kArm);
              for (std::int64_t k = 0; k < 20'000; ++k) {
                const auto part = [&](std::int64_t from, const std::vector<CoursePart>& parts) {
                  const std::int64_t place = k - from;
                  return place >= 0 && place < static_cast<std::int64_t>(parts.size())
                             ? &parts[static_cast<std::size_t>(place)]
                             : nullptr;
                };
                const CoursePart *one = part(10, first), *other = part(8000, second);
                if (one != nullptr || other != nullptr) {
                  robot.tick(one != nullptr ? *one : *other);
                } else {
                  robot.tick();
                }
                first_ticks += robot.out.status.course.in_force == 5;
                second_ticks += robot.out.status.course.in_force == 6;
              }
            }),
            0);
  EXPECT_GT(first_ticks, 5000);
  EXPECT_GT(second_ticks, 1000);
}

TEST(NoHeap, MovesAndStops) {
  const auto params = std::make_unique<ControllerParams>(testing::paper_params());
  const auto state = std::make_unique<ControllerState>();
  const auto out = std::make_unique<Outputs>();
  reset(*params, *state);
  Inputs in;
  int moves = 0, stops = 0, refusals = 0;
  EXPECT_EQ(allocations_during([&] {
              for (std::int64_t k = 0; k < 100'000; ++k) {
                in.tick = in.sensors.tick = in.monitor.tick = k;
                in.operator_command = OperatorCommand::kNone;
                MoveRequest move;
                move.masses = k % 3 == 0 ? 9 : 7;
                move.target_position.fill(static_cast<Real>(k % 7));
                if (k % 5000 == 0 || state->mode == Mode::kDisarmed) in.operator_command = OperatorCommand::kArm;
                if (state->mode == Mode::kArmed) in.operator_command = move;
                if (k % 700 == 699 && state->mode == Mode::kMoving) in.operator_command = OperatorCommand::kStop;
                const Mode before = state->mode;
                whole_tick(*params, *state, in, *out);
                moves += before == Mode::kPending && state->mode == Mode::kMoving;
                stops += before == Mode::kMoving && state->mode == Mode::kStopping;
                refusals += before == Mode::kArmed && state->refusal.reason == Refusal::kUnknownMass;
              }
            }),
            0);
  EXPECT_GT(moves, 10);
  EXPECT_GT(stops, 10);
  EXPECT_GT(refusals, 10);
}

TEST(NoHeap, OverloadAndOutOfOrderTicks) {
  const auto params = std::make_unique<ControllerParams>(testing::paper_params());
  ASSERT_TRUE(params->motion[1].set(0, 1000, nullptr, 0));
  const auto state = std::make_unique<ControllerState>();
  const auto out = std::make_unique<Outputs>();
  Inputs in;
  EXPECT_EQ(allocations_during([&] {
              reset(*params, *state);
              for (std::int64_t k = 0; k < 1000; ++k) {
                in.tick = in.sensors.tick = in.monitor.tick = k % 100 == 99 ? k - 1 : k;
                in.operator_command = k % 10 == 0 ? OperatorCommand::kReset
                                                  : (k % 10 == 1 ? OperatorCommand::kArm : OperatorCommand::kStart);
                whole_tick(*params, *state, in, *out);
              }
            }),
            0);
  EXPECT_NE(state->faults, 0u);
}

}  // namespace
}  // namespace ballast::firmware
