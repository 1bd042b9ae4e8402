#include "tools/sweep/workers.h"

#include <fmt/core.h>
#include <sys/mman.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <new>

#include "tools/program/subprocess.h"

namespace ballast::sweep {
namespace {

constexpr int kFailed = 1;  // exit status of a worker that has said why

// The rows that a worker has begun.
struct RowsAtWork {
  std::atomic<std::uint64_t> first, count;
};

// Memory that the parent and all workers share.
struct Shared {
  std::atomic<std::uint64_t> taken;  // places in the list of blocks that workers have begun
  std::atomic<std::uint64_t> rows, held;
  std::atomic_flag failed;  // the first worker that fails sets it, and writes `trouble`
  char trouble[2000];
  RowsAtWork at_work[kMostJobs];
};

// Shared memory of this process and its children.
class SharedMemory {
 public:
  SharedMemory() {
    void* memory = mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory != MAP_FAILED) shared_ = new (memory) Shared{};
  }
  ~SharedMemory() {
    if (shared_ != nullptr) munmap(shared_, sizeof(Shared));
  }
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;
  [[nodiscard]] Shared* get() { return shared_; }

 private:
  Shared* shared_ = nullptr;
};

// Where a worker has died, in words.
std::string place_of(const RowsAtWork& rows) {
  const std::uint64_t first = rows.first, count = rows.count;
  if (count == 0) return "before its first row";
  return count == 1 ? fmt::format("in row {}", first) : fmt::format("in rows {} to {}", first, first + count - 1);
}

// One worker: takes blocks until none is left.
int work(const Spec& spec, const std::vector<std::uint64_t>& blocks, const std::filesystem::path& folder,
         Shared& shared, RowsAtWork& at_work) {
  const RowScenarios scenarios(spec);
  const BlockPlan plan(spec);
  RowRunner runner(spec, scenarios);
  runner.set_beginning([&at_work](std::uint64_t first, std::uint64_t count) {
    at_work.first = first;
    at_work.count = count;
  });
  const auto row_done = [&shared](const RowResult& row) {
    ++shared.rows;
    if (row.held()) ++shared.held;
    return true;
  };
  for (;;) {
    const std::uint64_t mine = shared.taken.fetch_add(1);
    if (mine >= blocks.size()) return 0;
    const std::string why = run_block(runner, plan, folder, blocks[mine], row_done);
    if (why.empty()) continue;
    if (!shared.failed.test_and_set()) shared.trouble[why.copy(shared.trouble, sizeof shared.trouble - 1)] = '\0';
    return kFailed;
  }
}

}  // namespace

std::string run_block(RowRunner& runner, const BlockPlan& plan, const std::filesystem::path& folder,
                      std::uint64_t block, const std::function<bool(const RowResult&)>& row_done) {
  Block out{plan.sweep(), plan.first_row(block), {}};
  bool wanted = true;
  runner.run(out.first_row, plan.rows_of(block), [&](RowResult&& row) {
    wanted = row_done(row);
    out.rows.push_back(std::move(row));
    return wanted;
  });
  return wanted ? write_block(block_file(folder, block), out) : "";
}

std::string run_blocks(const Spec& spec, const std::vector<std::uint64_t>& blocks, const WorkOptions& options,
                       const std::function<void(const WorkDone&)>& show) {
  std::fflush(nullptr);  // otherwise each worker would print what is still buffered here
  SharedMemory memory;
  Shared* shared = memory.get();
  if (shared == nullptr) return std::strerror(errno);
  std::vector<program::Subprocess> workers(static_cast<std::size_t>(options.jobs));
  for (std::size_t i = 0; i < workers.size(); ++i) {
    const auto error =
        workers[i].start([&, i] { return work(spec, blocks, options.folder, *shared, shared->at_work[i]); });
    if (error) return error.message();
  }
  std::string trouble;
  const auto interrupted = [&] { return options.interrupted != nullptr && *options.interrupted != 0; };
  for (bool working = true; working && trouble.empty() && !interrupted();) {
    working = false;
    for (std::size_t i = 0; i < workers.size(); ++i) {
      program::Subprocess& worker = workers[i];
      if (!worker.running()) continue;
      const auto end = worker.wait(std::chrono::milliseconds(working ? 0 : 100));
      if (!end) {
        working = true;
      } else if (end->exit_status == kFailed) {
        trouble = shared->trouble;
      } else if (end->exit_status != 0) {
        trouble = fmt::format("a worker died {}: {}", place_of(shared->at_work[i]), end->text());
      }
    }
    show({shared->rows, shared->held});
  }
  return trouble;  // the workers that are left end with their objects
}

}  // namespace ballast::sweep
