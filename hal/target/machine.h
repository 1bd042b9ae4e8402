// Machine: everything a port supplies so that the firmware runs on its board over a link.
//
// The control loop makes all calls, with interrupts on. The board has two interrupts of the same priority: its tick
// timer and its step timer, which drive a StepPlayer (step_player.h). No function allocates. tools/docs/porting.md
// states the time and memory of each.
#pragma once

#include <concepts>
#include <cstdint>
#include <span>

#include "firmware/motion/step_command.h"
#include "hal/status.h"
#include "hal/target/messages.h"

namespace ballast::hal::target {

// kName, kCounterHz      the board's name, and the rate of every count it reports
// read(bytes, count)     waits for bytes of the link, at least one. kPeerLost: none will follow
// write(bytes)           writes all bytes to the link
// start(params, commit)  starts control ticks, step timer and watchdog. False: the board cannot keep the control period
// wait_tick()            waits for a control tick to begin; returns how many have begun since the last call, 1 or more
// tick_due()             whether a tick has begun since wait_tick(): then the one being served is late
// counter()              a free-running counter that wraps
// load(steps)            takes the pulses of the next control tick; at most one call per tick
// played(pulses)         writes the pulses given during the previous control tick
// kick_watchdog()        called once per tick, after its outputs were written
// report(end_report)       fills in the fields only the board knows: the stack's
template <class M>
concept Machine = requires(M& machine, const M& constant, std::span<std::uint8_t> in, std::span<const std::uint8_t> out,
                           std::size_t& count, const firmware::StepCommand& steps,
                           const firmware::ControllerParams& params, const Commit& commit, EndReport& end_report,
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
  constant.report(end_report);
};

}  // namespace ballast::hal::target
