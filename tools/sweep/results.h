// sweep.nc: one row per run, in the order of the rows, whatever computed them.
//   row, seed (int64), exit_status, held (byte)   of every run
//   every varied key and every kept value         `_` for dots; number: double, text: string, list: a second dimension
// A value that a run does not have is NaN or an empty text. The attributes sweep_toml and scenario_toml hold the sweep.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "tools/sweep/block.h"

namespace ballast::sweep {

// The block of a number; nullopt: it is missing.
using TakeBlock = std::function<std::optional<Block>(std::uint64_t block)>;

// Writes the whole file or none, in a process of its own, because HDF5 may crash where the disk is full. Goes through
// the blocks twice, one at a time. Empty, or what could not be done.
[[nodiscard]] std::string write_results(const std::string& file, const Spec& spec, const TakeBlock& take_block);

// Empty, or why the file holds no results of this sweep.
[[nodiscard]] std::string results_refusal(const std::string& file, const Spec& spec);

}  // namespace ballast::sweep
