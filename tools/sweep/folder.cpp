#include "tools/sweep/folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <sstream>

namespace ballast::sweep {
namespace {

namespace fs = std::filesystem;

constexpr const char* kBlocks = "blocks";

std::string text_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

std::uint64_t block_size(const Spec& spec) {
  // Enough blocks to divide the work evenly and to show progress; at least some rows each, since each is a file.
  constexpr std::uint64_t kBlocksWanted = 256, kMostRows = 4096;
  return std::clamp(spec.rows() / kBlocksWanted, std::uint64_t{1}, kMostRows);
}

}  // namespace

BlockPlan::BlockPlan(const Spec& spec) : sweep_(identity(spec)), rows_(spec.rows()), size_(block_size(spec)) {}

FolderHolds content_of(const fs::path& folder, const Spec& spec) {
  std::error_code code;
  if (!fs::exists(folder / "sweep.toml", code)) {
    const bool of_a_run = fs::exists(folder / "scenario.toml", code) || fs::exists(folder / "summary.json", code);
    return of_a_run || fs::exists(results_file(folder), code) ? FolderHolds::kOther : FolderHolds::kNothing;
  }
  if (text_of(folder / "sweep.toml") != to_toml(spec) || text_of(folder / "scenario.toml") != spec.base_toml)
    return FolderHolds::kOther;
  return fs::exists(results_file(folder), code) ? FolderHolds::kItsResults : FolderHolds::kThisSweep;
}

fs::path results_file(const fs::path& folder) { return folder / "sweep.nc"; }

fs::path block_file(const fs::path& folder, std::uint64_t block) {
  return folder / kBlocks / fmt::format("{:010}", block);
}

std::vector<bool> blocks_there(const fs::path& folder, const BlockPlan& plan) {
  std::vector<bool> there(plan.blocks());
  std::error_code code;
  for (fs::directory_iterator entry(folder / kBlocks, code), end; !code && entry != end; entry.increment(code)) {
    const std::string name = entry->path().filename().string();
    std::uint64_t block = 0;
    const auto [stop, error] = std::from_chars(name.data(), name.data() + name.size(), block);
    if (error == std::errc{} && stop == name.data() + name.size() && block < there.size()) there[block] = true;
  }
  return there;
}

std::optional<Block> read_block_of(const fs::path& folder, const BlockPlan& plan, std::uint64_t block) {
  std::optional<Block> read = read_block(block_file(folder, block));
  const bool good = read && read->sweep == plan.sweep() && read->first_row == plan.first_row(block) &&
                    read->rows.size() == plan.rows_of(block);
  return good ? std::move(read) : std::nullopt;
}

void remove_drafts(const fs::path& folder) {
  std::error_code code;
  for (const fs::path& place : {folder, folder / kBlocks}) {
    for (fs::directory_iterator entry(place, code), end; !code && entry != end; entry.increment(code)) {
      std::error_code ignored;
      if (entry->path().extension() == ".part") fs::remove(entry->path(), ignored);
    }
  }
}

void remove_blocks(const fs::path& folder) {
  std::error_code code;
  fs::remove_all(folder / kBlocks, code);
}

bool begin_folder(sil::OutputDir& output, const Spec& spec) {
  // The scenario first: a folder without sweep.toml is none of a sweep.
  if (!output.write("scenario.toml", spec.base_toml) || !output.write("sweep.toml", to_toml(spec))) return false;
  std::error_code code;
  fs::create_directory(output.path() / kBlocks, code);
  if (code) return output.fail((output.path() / kBlocks).string() + ": cannot be made: " + code.message());
  return true;
}

}  // namespace ballast::sweep
