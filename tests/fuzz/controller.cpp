// The firmware behind its link: parameters, whatever validate() accepts of them, and ticks with whatever comes.
#include <cmath>
#include <memory>
#include <utility>

#include "hal/target/serve.h"
#include "tests/fuzz/byte_link.h"
#include "tests/fuzz/fuzz_target.h"

namespace ballast::fuzz {
namespace {

namespace target = hal::target;

// Everything commanded is a number, and every pulse is one of the tick's.
void check(const target::Reply& reply, const firmware::ControllerParams& params) {
  const firmware::ControllerStatus& status = reply.status;
  require(status.motor_count == params.ball.mass_count, "a status speaks of all masses");
  for (std::size_t i = 0; i < static_cast<std::size_t>(status.motor_count); ++i) {
    require(std::isfinite(status.commanded_position[i]) && std::isfinite(status.commanded_velocity[i]),
            "what is commanded is a number");
    require(std::isfinite(status.next[i].position) && std::isfinite(status.next[i].velocity) &&
                std::isfinite(status.next[i].acceleration),
            "what is commanded next is a number");
    require(std::abs(reply.steps.steps[i]) <= firmware::kMaxStepsPerTick, "no more pulses than a tick has room for");
  }
  const double ticks = params.control_period_s * params.timer_frequency_hz;
  for (std::size_t b = 0; b < static_cast<std::size_t>(reply.steps.burst_count); ++b) {
    const firmware::StepBurst& burst = reply.steps.bursts[b];
    const std::int64_t j = burst.count - 1;
    const std::int64_t last = burst.first_ticks + j * burst.interval_ticks + burst.add_ticks * (j * (j - 1) / 2);
    require(burst.first_ticks >= 0 && last >= burst.first_ticks && static_cast<double>(last) <= ticks,
            "pulses come inside their tick");
  }
}

}  // namespace

Bytes change_one_thing(Bytes input, std::mt19937_64& random) {
  const auto frames = frames_of(input);
  return change_one_part(std::move(input), frames, random);
}

bool take(std::span<const std::uint8_t> input) {
  static const auto params = std::make_unique<firmware::ControllerParams>();
  *params = firmware::ControllerParams();
  BareMachine machine(input);
  const auto link = std::make_unique<target::Link<BareMachine>>(machine);
  if (target::take_params(machine, *link, target::Identity(), *params, [] {}) != hal::Status::kOk) return false;

  const auto board = std::make_unique<target::LinkBoard<BareMachine>>(machine, *link);
  const auto loop = std::make_unique<hal::ControlLoop<target::LinkBoard<BareMachine>>>(*params, *board);
  static const auto reply = std::make_unique<target::Reply>();
  bool through = false;
  for (;;) {
    machine.said().clear();
    if (loop->step() != hal::Status::kOk) return through;
    target::Frame frame;
    require(
        target::decode_frame(machine.said(), frame).error == target::FrameError::kNone && target::decode(frame, *reply),
        "the host understands the reply");
    check(*reply, *params);
    through = true;
  }
}

}  // namespace ballast::fuzz
