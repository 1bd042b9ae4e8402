// The steps of a sweep around its runs, for every program that computes one: taking a folder, and completing it.
#pragma once

#include <string>

#include "tools/recording/output_dir.h"
#include "tools/sweep/folder.h"
#include "tools/sweep/results.h"

namespace ballast::sweep {

// Empty, or why the folder cannot take this sweep's results.
[[nodiscard]] std::string folder_refusal(const std::filesystem::path& folder, const Spec& spec, bool resume);

// Prepares the folder for blocks of this build. Empty, or what could not be done.
[[nodiscard]] std::string begin_work(sil::OutputDir& output, const Spec& spec);

// The blocks of a shard that are to be computed, and the rows that are there.
struct Work {
  std::vector<std::uint64_t> blocks;
  std::uint64_t rows = 0;                          // of the shard
  std::uint64_t rows_before = 0, held_before = 0;  // in finished blocks
};
[[nodiscard]] Work work_of(const BlockPlan& plan, const std::filesystem::path& folder, const Shard& shard);

// Writes sweep.nc from all blocks. Empty, or what could not be done.
[[nodiscard]] std::string write_all(sil::OutputDir& output, const Spec& spec, const TakeBlock& take_block);

// Writes summary.txt of complete results and removes the blocks. Returns the summary; empty: `error` says why.
[[nodiscard]] std::string summarise(sil::OutputDir& output, const Spec& spec, std::string& error);

}  // namespace ballast::sweep
