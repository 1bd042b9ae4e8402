// A block of rows in a file, for a sweep that may be killed at any instant: written whole or not at all, and checked
// when it is read. The bytes are this machine's; blocks are not an exchange format.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tools/sweep/run_row.h"

namespace ballast::sweep {

struct Block {
  std::uint64_t sweep = 0;  // identity of the sweep
  std::uint64_t first_row = 0;
  std::vector<RowResult> rows;  // numbered first_row, first_row + 1, ...
};

// The file's content: header, rows, CRC-32 of all before.
[[nodiscard]] std::string encoded(const Block& block);

// nullopt: the bytes are no block, or damaged.
[[nodiscard]] std::optional<Block> decoded(const std::string& bytes);

// Writes the block under a draft's name and renames it. Empty, or what could not be done.
[[nodiscard]] std::string write_block(const std::filesystem::path& file, const Block& block);

// nullopt: there is no such file, or it is no undamaged block.
[[nodiscard]] std::optional<Block> read_block(const std::filesystem::path& file);

}  // namespace ballast::sweep
