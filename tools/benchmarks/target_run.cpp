#include "tools/benchmarks/target_run.h"

#include <memory>
#include <stdexcept>
#include <utility>

#include "tools/program/params.h"
#include "tools/sil/local_peers.h"
#include "tools/sil/run.h"

namespace ballast::benchmarks {

namespace {

// Ticks are stretched to two million instructions, so that none is late, and no pulses interrupt them.
constexpr hal::target::Commit kMeasuring{.stretch = 512, .play = false};

}  // namespace

CountedRun count_instructions(const sim::Scenario& scenario, const std::string& board,
                              const std::filesystem::path& programs, const soak::OperatorScript& script,
                              std::vector<std::int64_t>* instructions) {
  auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto refusal = program::to_controller_params(scenario, *params)) throw std::runtime_error(*refusal);
  sil::QemuFirmwareOptions options;
  options.qemu.board = board;
  options.qemu.elf = programs / ("ballast-" + board + ".elf");
  options.qemu.icount_shift = kInstructionShift;
  options.commit = kMeasuring;
  options.peer_timeout = sil::Seconds(60);
  options.instructions = instructions;
  auto owned = std::make_unique<sil::QemuFirmware>(scenario, *params, options);
  const sil::QemuFirmware& firmware = *owned;
  const auto peers =
      soak::with_operator(std::make_unique<sil::LocalPeers>(program::to_monitor_limits(scenario), std::move(owned)),
                          script, scenario.run.control_period_s);
  if (peers->connect() != hal::Status::kOk) throw std::runtime_error(peers->trouble());
  sil::NoRecord recorder;
  const sil::RunResult result = sil::run(scenario, *peers, recorder, {});
  if (result.status != hal::Status::kOk) throw std::runtime_error(result.trouble);
  return {firmware.record(), result.extrema.normal_force_min.value, result.controller_trip.has_value()};
}

}  // namespace ballast::benchmarks
