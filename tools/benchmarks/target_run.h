// A run with the firmware in QEMU that counts the instructions of its ticks: the same numbers every time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "sim/scenario/scenario.h"
#include "tools/qemu/qemu_firmware.h"
#include "tools/soak/operator_script.h"

namespace ballast::benchmarks {

// An instruction takes 256 ns of the machine's time, 6.4 counts of its 25 MHz: whole instructions come of whole counts.
inline constexpr int kInstructionShift = 8;

struct CountedRun {
  sil::TargetRecord record;
  double normal_force_min_n = 0;
  bool tripped = false;
};

// `board`: a folder of hal/. `programs`: the folder of its programs. `script`: what an operator gives beside the run's
// own commands. `instructions`: of each tick; null: not kept. Throws std::runtime_error where the run fails.
[[nodiscard]] CountedRun count_instructions(const sim::Scenario& scenario, const std::string& board,
                                            const std::filesystem::path& programs,
                                            const soak::OperatorScript& script = {},
                                            std::vector<std::int64_t>* instructions = nullptr);

}  // namespace ballast::benchmarks
