#include "tools/soak/workers.h"

#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <climits>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <optional>
#include <type_traits>
#include <vector>

namespace ballast::soak {

namespace {

// One write of it is never mixed with another process's.
static_assert(std::is_trivially_copyable_v<SeedResult> && sizeof(SeedResult) <= PIPE_BUF);

std::int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

// What a worker is at; written by it, read by the parent.
struct Desk {
  std::atomic<std::uint64_t> seed;
  std::atomic<std::int64_t> since_ns;  // 0: between two seeds
};

// Seen by all.
struct Shared {
  std::atomic<std::uint64_t> taken;  // how many of the seeds
  Desk desks[];                      // one per worker; zeroed by mmap
};

struct Worker {
  pid_t pid = -1;  // -1: there is none
  bool hung = false;
  std::optional<std::uint64_t> answered = std::nullopt;  // the latest seed of which it has told the result
};

[[noreturn]] void work(const WorkerOptions& options, Shared& shared, Desk& desk, int pipe,
                       const std::function<SeedResult(std::uint64_t)>& run) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  const std::uint64_t count = options.last - options.first + 1;
  for (;;) {
    const std::uint64_t mine = shared.taken.fetch_add(1);
    if (mine >= count) _exit(0);
    desk.seed = options.first + mine;
    desk.since_ns = now_ns();
    const SeedResult result = run(options.first + mine);
    if (write(pipe, &result, sizeof result) != static_cast<ssize_t>(sizeof result)) _exit(1);
    desk.since_ns = 0;
  }
}

SeedResult lost(std::uint64_t seed, const WorkerOptions& options, const Worker& worker, int wait_status) {
  SeedResult result;
  result.seed = seed;
  result.outcome = Outcome::kGivenUp;
  result.broken = static_cast<std::int32_t>(worker.hung ? Invariant::kPatient : Invariant::kEnded);
  if (worker.hung) {
    std::snprintf(result.broken_text, sizeof result.broken_text, "still running after %g s on the clock; killed",
                  options.seed_limit_s);
  } else if (WIFSIGNALED(wait_status)) {
    std::snprintf(result.broken_text, sizeof result.broken_text, "the process died of signal %d (%s)",
                  WTERMSIG(wait_status), strsignal(WTERMSIG(wait_status)));
  } else {
    std::snprintf(result.broken_text, sizeof result.broken_text, "the process ended with status %d",
                  WEXITSTATUS(wait_status));
  }
  return result;
}

class Pool {
 public:
  Pool(const WorkerOptions& options, const std::function<SeedResult(std::uint64_t)>& run,
       const std::function<void(const SeedResult&)>& done)
      : options_(options), run_(run), done_(done), workers_(static_cast<std::size_t>(options.jobs)) {
    size_ = sizeof(Shared) + workers_.size() * sizeof(Desk);
    void* memory = mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory != MAP_FAILED) shared_ = new (memory) Shared{};
    if (shared_ == nullptr || pipe(pipe_) != 0) trouble_ = std::strerror(errno);
  }
  ~Pool() {
    for (Worker& worker : workers_) {
      if (worker.pid < 0) continue;
      kill(worker.pid, SIGKILL);
      waitpid(worker.pid, nullptr, 0);
    }
    for (const int end : pipe_) {
      if (end >= 0) close(end);
    }
    if (shared_ != nullptr) munmap(shared_, size_);
  }
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;

  std::string run(const std::function<void()>& wait) {
    for (std::size_t i = 0; i < workers_.size(); ++i) start(i);
    while (trouble_.empty() && working() && (options_.interrupted == nullptr || *options_.interrupted == 0)) {
      pollfd ready{pipe_[0], POLLIN, 0};
      if (poll(&ready, 1, 100) > 0) read_one();
      look_after();
      wait();
    }
    return trouble_;
  }

 private:
  void start(std::size_t i) {
    const pid_t pid = fork();
    if (pid == 0) work(options_, *shared_, shared_->desks[i], pipe_[1], run_);
    if (pid < 0) trouble_ = std::strerror(errno);
    workers_[i] = {pid, false, std::nullopt};
  }

  [[nodiscard]] bool working() const {
    for (const Worker& worker : workers_) {
      if (worker.pid >= 0) return true;
    }
    return false;
  }

  void read_one() {
    SeedResult result;
    if (read(pipe_[0], &result, sizeof result) != static_cast<ssize_t>(sizeof result)) return;
    for (std::size_t i = 0; i < workers_.size(); ++i) {
      if (shared_->desks[i].seed == result.seed) workers_[i].answered = result.seed;
    }
    done_(result);
  }

  void drain() {
    for (pollfd ready{pipe_[0], POLLIN, 0}; poll(&ready, 1, 0) > 0;) read_one();
  }

  void look_after() {
    for (std::size_t i = 0; i < workers_.size(); ++i) {
      Worker& worker = workers_[i];
      Desk& desk = shared_->desks[i];
      if (worker.pid < 0) continue;
      const std::int64_t since_ns = desk.since_ns;
      if (since_ns != 0 && !worker.hung && static_cast<double>(now_ns() - since_ns) > 1e9 * options_.seed_limit_s) {
        worker.hung = true;
        kill(worker.pid, SIGKILL);
      }
      int status = 0;
      if (waitpid(worker.pid, &status, WNOHANG) != worker.pid) continue;
      drain();  // what it still said
      worker.pid = -1;
      if (WIFEXITED(status) && WEXITSTATUS(status) == 0) continue;  // all seeds are taken
      // It may have been killed between its answer and the next seed.
      if (desk.since_ns != 0 && worker.answered != desk.seed) done_(lost(desk.seed, options_, worker, status));
      desk.since_ns = 0;
      start(i);
    }
  }

  const WorkerOptions& options_;
  const std::function<SeedResult(std::uint64_t)>& run_;
  const std::function<void(const SeedResult&)>& done_;
  std::vector<Worker> workers_;
  std::size_t size_ = 0;
  Shared* shared_ = nullptr;
  int pipe_[2] = {-1, -1};
  std::string trouble_;
};

}  // namespace

std::string run_seeds(const WorkerOptions& options, const std::function<SeedResult(std::uint64_t)>& run,
                      const std::function<void(const SeedResult&)>& done, const std::function<void()>& wait) {
  std::fflush(nullptr);  // or the workers would have it too
  return Pool(options, run, done).run(wait);
}

}  // namespace ballast::soak
