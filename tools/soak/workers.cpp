#include "tools/soak/workers.h"

#include <fmt/core.h>
#include <poll.h>
#include <signal.h>
#include <sys/mman.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <climits>
#include <cstdio>
#include <cstring>
#include <new>
#include <optional>
#include <type_traits>
#include <vector>

#include "tools/program/descriptor.h"
#include "tools/program/subprocess.h"

namespace ballast::soak {

namespace {

// Writes of up to PIPE_BUF bytes are atomic, so the results of several workers do not mix.
static_assert(std::is_trivially_copyable_v<SeedResult> && sizeof(SeedResult) <= PIPE_BUF);

std::int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

// The seed that a worker is running. The worker writes it, the parent reads it.
struct CurrentSeed {
  std::atomic<std::uint64_t> seed;
  std::atomic<std::int64_t> since_ns;  // 0: the worker is between two seeds
};

// Memory that the parent and all workers share.
struct Shared {
  std::atomic<std::uint64_t> taken;  // number of seeds that workers have begun
  CurrentSeed current[];             // one per worker; zeroed by mmap
};

struct Worker {
  program::Subprocess process = {};
  bool hung = false;
  std::optional<std::uint64_t> answered = std::nullopt;  // the latest seed whose result has arrived
};

// Runs in a worker: takes seeds until none is left. Returns the worker's exit status.
int work(const WorkerOptions& options, Shared& shared, CurrentSeed& current, int pipe,
         const std::function<SeedResult(std::uint64_t)>& run) {
  const std::uint64_t count = options.last - options.first + 1;
  for (;;) {
    const std::uint64_t mine = shared.taken.fetch_add(1);
    if (mine >= count) return 0;
    current.seed = options.first + mine;
    current.since_ns = now_ns();
    const SeedResult result = run(options.first + mine);
    if (write(pipe, &result, sizeof result) != static_cast<ssize_t>(sizeof result)) return 1;
    current.since_ns = 0;
  }
}

// The result of a seed whose worker has died.
SeedResult lost(std::uint64_t seed, const WorkerOptions& options, bool hung, const program::ProcessEnd& end) {
  SeedResult result;
  result.seed = seed;
  result.outcome = Outcome::kGivenUp;
  result.broken = static_cast<std::int32_t>(hung ? Invariant::kPatient : Invariant::kEnded);
  set_text(result.broken_text,
           hung              ? fmt::format("still running after {:g} s on the clock; killed", options.seed_limit_s)
           : end.signal != 0 ? fmt::format("the process died of signal {} ({})", end.signal, end.text())
                             : fmt::format("the process ended with status {}", end.exit_status));
  return result;
}

class Pool {
 public:
  Pool(const WorkerOptions& options, const std::function<SeedResult(std::uint64_t)>& run,
       const std::function<void(const SeedResult&)>& done)
      : options_(options),
        run_(run),
        done_(done),
        pipe_(program::open_pipe()),
        workers_(static_cast<std::size_t>(options.jobs)) {
    size_ = sizeof(Shared) + workers_.size() * sizeof(CurrentSeed);
    void* memory = mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory != MAP_FAILED) shared_ = new (memory) Shared{};
    if (shared_ == nullptr || !pipe_) trouble_ = std::strerror(errno);
  }
  ~Pool() {
    workers_.clear();  // kills them
    if (shared_ != nullptr) munmap(shared_, size_);
  }
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;

  std::string run(const std::function<void()>& wait) {
    for (std::size_t i = 0; i < workers_.size() && trouble_.empty(); ++i) start(i);
    while (trouble_.empty() && working() && (options_.interrupted == nullptr || *options_.interrupted == 0)) {
      pollfd ready{pipe_->reading.get(), POLLIN, 0};
      if (poll(&ready, 1, 100) > 0) read_one();
      for (std::size_t i = 0; i < workers_.size(); ++i) check(i);
      wait();
    }
    return trouble_;
  }

 private:
  void start(std::size_t i) {
    workers_[i] = {};
    const auto error = workers_[i].process.start(
        [&, i] { return work(options_, *shared_, shared_->current[i], pipe_->writing.get(), run_); });
    if (error) trouble_ = error.message();
  }

  [[nodiscard]] bool working() const {
    for (const Worker& worker : workers_) {
      if (worker.process.running()) return true;
    }
    return false;
  }

  void read_one() {
    SeedResult result;
    if (read(pipe_->reading.get(), &result, sizeof result) != static_cast<ssize_t>(sizeof result)) return;
    for (std::size_t i = 0; i < workers_.size(); ++i) {
      if (shared_->current[i].seed == result.seed) workers_[i].answered = result.seed;
    }
    done_(result);
  }

  void drain() {
    for (pollfd ready{pipe_->reading.get(), POLLIN, 0}; poll(&ready, 1, 0) > 0;) read_one();
  }

  // Kills a worker that hangs. Replaces one that has died, and reports its seed as lost.
  void check(std::size_t i) {
    Worker& worker = workers_[i];
    CurrentSeed& current = shared_->current[i];
    if (!worker.process.running()) return;
    const std::int64_t since_ns = current.since_ns;
    if (since_ns != 0 && !worker.hung && static_cast<double>(now_ns() - since_ns) > 1e9 * options_.seed_limit_s) {
      worker.hung = true;
      worker.process.send(SIGKILL);
    }
    const auto end = worker.process.wait(std::chrono::seconds(0));
    if (!end) return;
    drain();                            // results that it wrote before it ended
    if (end->exit_status == 0) return;  // no seed is left
    // It may have died after its answer and before the next seed.
    if (current.since_ns != 0 && worker.answered != current.seed) {
      done_(lost(current.seed, options_, worker.hung, *end));
    }
    current.since_ns = 0;
    start(i);
  }

  const WorkerOptions& options_;
  const std::function<SeedResult(std::uint64_t)>& run_;
  const std::function<void(const SeedResult&)>& done_;
  std::optional<program::Pipe> pipe_;
  std::vector<Worker> workers_;
  std::size_t size_ = 0;
  Shared* shared_ = nullptr;
  std::string trouble_;
};

}  // namespace

std::string run_seeds(const WorkerOptions& options, const std::function<SeedResult(std::uint64_t)>& run,
                      const std::function<void(const SeedResult&)>& done, const std::function<void()>& wait) {
  std::fflush(nullptr);  // otherwise each worker would print what is still buffered here
  return Pool(options, run, done).run(wait);
}

}  // namespace ballast::soak
