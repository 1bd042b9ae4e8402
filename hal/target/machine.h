// What a board must be able to do so that the firmware runs on it over a link: all that a port supplies.
#pragma once

#include <concepts>
#include <cstdint>
#include <span>

#include "firmware/motion/step_generator.h"
#include "hal/status.h"
#include "hal/target/messages.h"

namespace ballast::hal::target {

// kName, kCounterHz      its name, and the rate of all counts
// read(bytes, count)     waits for bytes of the link: at least one. kPeerLost: there will be no more
// write(bytes)           all of them
// start(params, commit)  control ticks, step timer and watchdog from now on. False: this board cannot keep the period
// wait_tick()            waits for the beginning of a control tick; how many have begun since the last call: 1, or
//                        more if some were late
// tick_due()             whether one has begun meanwhile: then the one being served is late
// counter()              free-running, wraps
// load(steps)            the pulses of the next control tick
// played(pulses)         the pulses given during the control tick before this one
// kick_watchdog()        the control tick is served
// report(farewell)       fills in what only the board knows: stack
template <class M>
concept Machine = requires(M& machine, const M& constant, std::span<std::uint8_t> in, std::span<const std::uint8_t> out,
                           std::size_t& count, const firmware::StepCommand& steps,
                           const firmware::ControllerParams& params, const Commit& commit, Farewell& farewell,
                           PlayedPulses& pulses) {
  { M::kName } -> std::convertible_to<const char*>;
  { M::kCounterHz } -> std::convertible_to<std::uint32_t>;
  { machine.read(in, count) } -> std::same_as<Status>;
  { machine.write(out) } -> std::same_as<Status>;
  { machine.start(params, commit) } -> std::same_as<bool>;
  { machine.wait_tick() } -> std::same_as<std::uint32_t>;
  { constant.tick_due() } -> std::same_as<bool>;
  { constant.counter() } -> std::same_as<std::uint32_t>;
  machine.load(steps);
  constant.played(pulses);
  machine.kick_watchdog();
  constant.report(farewell);
};

}  // namespace ballast::hal::target
