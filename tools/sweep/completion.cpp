#include "tools/sweep/completion.h"

#include <algorithm>

#include "tools/sweep/build_record.h"
#include "tools/sweep/summary_page.h"

namespace ballast::sweep {

std::string folder_refusal(const std::filesystem::path& folder, const Spec& spec, bool resume) {
  switch (content_of(folder, spec)) {
    case FolderHolds::kOther:
      return folder.string() + ": holds the results of another sweep or run; allowed: another --out, or a new folder";
    case FolderHolds::kThisSweep:
      if (resume) return build_refusal(folder);
      return folder.string() + ": holds an unfinished run of this sweep; allowed: --resume, or another --out";
    case FolderHolds::kNothing:
    case FolderHolds::kItsResults:
      break;
  }
  return "";
}

std::string begin_work(sil::OutputDir& output, const Spec& spec) {
  if (content_of(output.path(), spec) == FolderHolds::kItsResults) {
    // Old results beside an unfinished run again would pass for complete ones.
    remove_blocks(output.path());
    std::error_code ignored;
    std::filesystem::remove(results_file(output.path()), ignored);
    std::filesystem::remove(output.path() / "summary.txt", ignored);
  }
  remove_drafts(output.path());
  // The build first: a folder with sweep.toml is resumed only by the build that is recorded.
  const bool begun = record_build(output) && begin_folder(output, spec);
  return begun ? "" : output.error();
}

Work work_of(const BlockPlan& plan, const std::filesystem::path& folder, const Shard& shard) {
  Work work;
  const std::vector<bool> there = blocks_there(folder, plan);
  for (std::uint64_t block = shard.number - 1; block < plan.blocks(); block += shard.count) {
    work.rows += plan.rows_of(block);
    const auto finished = there[block] ? read_block_of(folder, plan, block) : std::nullopt;
    if (!finished) {
      work.blocks.push_back(block);
      continue;
    }
    work.rows_before += plan.rows_of(block);
    work.held_before += static_cast<std::uint64_t>(
        std::count_if(finished->rows.begin(), finished->rows.end(), [](const auto& row) { return row.held(); }));
  }
  return work;
}

std::string write_all(sil::OutputDir& output, const Spec& spec, const TakeBlock& take_block) {
  const std::string error = write_results(results_file(output.path()).string(), spec, take_block);
  return error;
}

std::string summarise(sil::OutputDir& output, const Spec& spec, std::string& error) {
  error = results_refusal(results_file(output.path()).string(), spec);
  if (!error.empty()) return "";
  const std::string page = summary_page(results_file(output.path()).string(), spec, error);
  if (!error.empty()) return "";
  if (!output.write("summary.txt", page)) {
    error = output.error();
    return "";
  }
  remove_blocks(output.path());
  return page;
}

}  // namespace ballast::sweep
