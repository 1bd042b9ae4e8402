// Runs the blocks of a sweep in processes of their own, which write them into the results' folder themselves.
#pragma once

#include <csignal>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tools/sweep/folder.h"
#include "tools/sweep/row_runner.h"

namespace ballast::sweep {

// Rows that the workers have finished.
struct WorkDone {
  std::uint64_t rows = 0, held = 0;
};

inline constexpr int kMostJobs = 1024;

struct WorkOptions {
  int jobs = 1;  // at most kMostJobs
  std::filesystem::path folder;
  const volatile std::sig_atomic_t* interrupted = nullptr;  // nonzero: no more
};

// Computes one block and writes it. `row_done` is called after each row; false: the block is given up. Empty, or what
// could not be done.
[[nodiscard]] std::string run_block(RowRunner& runner, const BlockPlan& plan, const std::filesystem::path& folder,
                                    std::uint64_t block, const std::function<bool(const RowResult&)>& row_done);

// Calls `show` several times a second. Empty if all blocks are done or it was interrupted, otherwise what could not be
// done; blocks that are finished stay.
[[nodiscard]] std::string run_blocks(const Spec& spec, const std::vector<std::uint64_t>& blocks,
                                     const WorkOptions& options, const std::function<void(const WorkDone&)>& show);

}  // namespace ballast::sweep
