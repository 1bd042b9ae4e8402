// Everything a controller needs from the world. A backend is one class that satisfies Board, chosen at compile time.
// All calls come from the control loop, never from an interrupt. Time is the tick number: no code above this contract
// reads a wall clock.
#pragma once

#include <concepts>
#include <cstdint>

#include "firmware/motion/step_command.h"
#include "hal/host_link.h"
#include "hal/status.h"

namespace ballast::hal {

// wait_tick(tick): waits until a control tick is due and writes its number. Each tick is handed out once, in order.
//   kOk: the caller serves the tick. kEmpty: no tick is due, and this clock does not block. Any other: no tick follows.
// overruns(): ticks that were late since the start, >= 0.
template <class B>
concept Clock = requires(B& board, const B& const_board, std::int64_t& tick) {
  { board.wait_tick(tick) } -> std::same_as<Status>;
  { const_board.overruns() } -> std::same_as<std::int64_t>;
};

// read_sensors(sensors):
//   kOk: a sample that has not been read before, bit for bit. NaN passes; the firmware judges it.
//   kEmpty: none came. `sensors` keeps the old sample with its old tick.
template <class B>
concept SensorSource = requires(B& board, firmware::Sensors& sensors) {
  { board.read_sensors(sensors) } -> std::same_as<Status>;
};

// write_steps(steps): hands over the pulses of control tick `steps.tick`, the one after the tick being served.
template <class B>
concept StepOutput = requires(B& board, const firmware::StepCommand& steps) {
  { board.write_steps(steps) } -> std::same_as<Status>;
};

// kick_watchdog(): called once per tick, after its outputs were written. Without a kick in a tick, the watchdog cuts
// the motors' power.
template <class B>
concept Watchdog = requires(B& board) {
  { board.kick_watchdog() } -> std::same_as<void>;
};

template <class B>
concept Board = Clock<B> && SensorSource<B> && StepOutput<B> && HostLink<B> && Watchdog<B>;

}  // namespace ballast::hal
