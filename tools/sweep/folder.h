// The folder of a sweep's results:
//   sweep.toml, scenario.toml   the sweep, complete: `ballast sweep DIR/sweep.toml --row I` runs a row of it anywhere
//   blocks/NUMBER               finished blocks (block.h) while it runs; gone once sweep.nc is there
//   sweep.nc, summary.txt       results
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "tools/recording/output_dir.h"
#include "tools/sweep/block.h"

namespace ballast::sweep {

struct Shard {
  std::uint64_t number = 1, count = 1;  // counted from 1
};

// How the rows are divided into blocks: by the sweep alone, so that all shards and jobs agree.
class BlockPlan {
 public:
  explicit BlockPlan(const Spec& spec);
  [[nodiscard]] std::uint64_t sweep() const { return sweep_; }  // its identity
  [[nodiscard]] std::uint64_t blocks() const { return (rows_ + size_ - 1) / size_; }
  [[nodiscard]] std::uint64_t rows() const { return rows_; }
  [[nodiscard]] std::uint64_t first_row(std::uint64_t block) const { return block * size_; }
  [[nodiscard]] std::uint64_t rows_of(std::uint64_t block) const {
    return block * size_ + size_ <= rows_ ? size_ : rows_ - block * size_;
  }
  // Whether a block belongs to the shard: every count-th does, so that the shards take about as long.
  [[nodiscard]] static bool is_in(std::uint64_t block, const Shard& shard) {
    return block % shard.count == shard.number - 1;
  }

 private:
  std::uint64_t sweep_, rows_, size_;
};

enum class FolderHolds {
  kNothing,     // of a sweep or a run
  kThisSweep,   // unfinished
  kItsResults,  // sweep.nc of this sweep, which is written last
  kOther,       // another sweep, or a run
};
[[nodiscard]] FolderHolds content_of(const std::filesystem::path& folder, const Spec& spec);

[[nodiscard]] std::filesystem::path results_file(const std::filesystem::path& folder);
[[nodiscard]] std::filesystem::path block_file(const std::filesystem::path& folder, std::uint64_t block);

// For each block whether it has a file, by one look at the folder.
[[nodiscard]] std::vector<bool> blocks_there(const std::filesystem::path& folder, const BlockPlan& plan);

// Reads the block of this sweep. nullopt: it is missing, damaged or of another sweep.
[[nodiscard]] std::optional<Block> read_block_of(const std::filesystem::path& folder, const BlockPlan& plan,
                                                 std::uint64_t block);

// Removes what a killed process has left unfinished.
void remove_drafts(const std::filesystem::path& folder);
void remove_blocks(const std::filesystem::path& folder);

// Writes the sweep into the folder, and makes blocks/. False: output.error() says why.
[[nodiscard]] bool begin_folder(sil::OutputDir& output, const Spec& spec);

}  // namespace ballast::sweep
