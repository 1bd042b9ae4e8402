#include "tools/qemu/qemu_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>
#include <sstream>
#include <string_view>
#include <thread>
#include <utility>

namespace ballast::sil {
namespace {

using hal::Status;
using Clock = std::chrono::steady_clock;

constexpr const char* kQemu = "qemu-system-arm";
constexpr int kFirstChildFd = 3;

int milliseconds_until(Clock::time_point deadline) {
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
  return left < 0 ? 0 : static_cast<int>(std::min<decltype(left)>(left + 1, 1000));
}

Clock::time_point deadline_in(Seconds timeout) {
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(timeout);
}

// A pipe nobody reads is an error of write(), not the end of this process.
class NoPipeSignal {
 public:
  NoPipeSignal() {
    sigset_t pipe;
    sigemptyset(&pipe);
    sigaddset(&pipe, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &pipe, &before_);
  }
  void raised() { raised_ = true; }  // write() said EPIPE
  ~NoPipeSignal() {
    if (raised_ && sigismember(&before_, SIGPIPE) == 0) {
      sigset_t pipe;
      sigemptyset(&pipe);
      sigaddset(&pipe, SIGPIPE);
      const timespec now{};
      while (sigtimedwait(&pipe, nullptr, &now) == SIGPIPE) {
      }
    }
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }
  NoPipeSignal(const NoPipeSignal&) = delete;
  NoPipeSignal& operator=(const NoPipeSignal&) = delete;

 private:
  sigset_t before_{};
  bool raised_ = false;
};

// A file descriptor that is closed with the object.
class Fd {
 public:
  Fd() = default;
  explicit Fd(int fd) : fd_(fd) {}
  Fd(Fd&& other) noexcept : fd_(other.release()) {}
  Fd& operator=(Fd&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~Fd() {
    if (fd_ >= 0) close(fd_);
  }
  [[nodiscard]] int get() const { return fd_; }
  int release() { return std::exchange(fd_, -1); }

 private:
  int fd_ = -1;
};

struct Pipe {
  Fd reading, writing;
};

// Both ends at `above` or higher. nullopt: errno says why.
std::optional<Pipe> open_pipe(int above) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return std::nullopt;
  const Fd low_reading(ends[0]), low_writing(ends[1]);
  Pipe pipe{Fd(fcntl(ends[0], F_DUPFD_CLOEXEC, above)), Fd(fcntl(ends[1], F_DUPFD_CLOEXEC, above))};
  if (pipe.reading.get() < 0 || pipe.writing.get() < 0) {
    const int error = errno;  // closing may change it
    pipe = Pipe();
    errno = error;
    return std::nullopt;
  }
  return pipe;
}

// In the child, between fork and exec: nothing that allocates.
[[noreturn]] void become_qemu(char** argv, std::span<const Fd> fds, int said, int report, pid_t parent) {
  // Ends with the process that started it, however that ends; a terminal's signals are for that one alone.
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(127);
  setpgid(0, 0);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  signal(SIGPIPE, SIG_DFL);
  const int null = open("/dev/null", O_RDWR);
  dup2(null, STDIN_FILENO);
  dup2(null, STDOUT_FILENO);
  dup2(said, STDERR_FILENO);
  // They are above all numbers they are to get (start() sees to it), so none is overwritten before it is used.
  for (std::size_t i = 0; i < fds.size(); ++i) dup2(fds[i].get(), kFirstChildFd + static_cast<int>(i));
  execvp(argv[0], argv);
  const int error = errno;
  static_cast<void>(!::write(report, &error, sizeof error));
  _exit(127);
}

// A program for a 32-bit ARM, by its header (System V ABI, "ELF header"). QEMU would take anything else for machine
// code.
bool is_arm_program(const std::filesystem::path& file) {
  constexpr std::string_view kIdentity("\177ELF\1\1\1", 7);    // 32 bits, little-endian
  constexpr std::string_view kExecutableArm("\2\0\x28\0", 4);  // e_type, e_machine
  char header[20] = {};
  std::ifstream(file, std::ios::binary).read(header, sizeof header);
  const std::string_view bytes(header, sizeof header);
  return bytes.starts_with(kIdentity) && bytes.substr(16) == kExecutableArm;
}

}  // namespace

std::string QemuProcess::start(const QemuOptions& options) {
  if (!std::filesystem::is_regular_file(options.elf))
    return options.elf.string() + ": no such file; tools/firmware builds the firmware";
  if (!is_arm_program(options.elf)) {
    return options.elf.string() + ": is no program for " + options.board +
           "; allowed: an ELF file for ARM, as tools/firmware builds it";
  }
  std::string arguments = "enable=on,target=native,arg=";
  std::vector<Fd> child_fds;
  const int above = kFirstChildFd + 2 * options.pipe_pairs + 1;
  const auto no_pipe = [] { return std::string("no pipe: ") + std::strerror(errno); };
  for (int i = 0; i < options.pipe_pairs; ++i) {
    std::optional<Pipe> to = open_pipe(above);
    if (!to) return no_pipe();
    std::optional<Pipe> from = open_pipe(above);
    if (!from) return no_pipe();
    child_fds.push_back(std::move(to->reading));
    child_fds.push_back(std::move(from->writing));
    pairs_.push_back({to->writing.release(), from->reading.release()});
    fcntl(pairs_.back().to, F_SETFL, O_NONBLOCK);
    const int child = kFirstChildFd + 2 * i;
    arguments += "/dev/fd/" + std::to_string(child) + ",arg=/dev/fd/" + std::to_string(child + 1) + ",arg=";
  }
  arguments += options.arguments.empty() ? "-" : options.arguments;
  const std::string icount = "shift=" + std::to_string(options.icount_shift) + ",sleep=off";
  std::string machine = options.board;
  std::replace(machine.begin(), machine.end(), '_', '-');
  std::vector<std::string> words{kQemu, "-M", machine, "-nodefaults", "-no-user-config"};
  for (const char* none : {"-display", "-monitor", "-serial"}) words.insert(words.end(), {none, "none"});
  words.insert(words.end(), {"-icount", icount, "-semihosting-config", arguments, "-kernel", options.elf.string()});
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  std::optional<Pipe> said = open_pipe(above);
  if (!said) return no_pipe();
  std::optional<Pipe> report = open_pipe(above);
  if (!report) return no_pipe();
  said_ = said->reading.release();
  // Nobody reads it before the end: what is too much is lost, and holds nobody up.
  for (const int fd : {said_, said->writing.get()}) fcntl(fd, F_SETFL, O_NONBLOCK);
  const pid_t parent = getpid();
  turns_.start();
  pid_ = fork();
  int error = pid_ < 0 ? errno : 0;
  if (pid_ == 0) become_qemu(argv.data(), child_fds, said->writing.get(), report->writing.get(), parent);
  // The child's ends: nothing comes to an end while they are open here too.
  child_fds.clear();
  said->writing = Fd();
  report->writing = Fd();
  while (pid_ > 0 && ::read(report->reading.get(), &error, sizeof error) < 0 && errno == EINTR) {
  }
  if (error == 0) return "";
  if (error == ENOENT) return std::string(kQemu) + ": not found; Debian has it in qemu-system-arm";
  return std::string(kQemu) + ": cannot be started: " + std::strerror(error);
}

void QemuProcess::take_turns() {
  // QEMU's main loop is woken in every control tick and has nothing to do: it waits until the machine's own thread
  // does, instead of interrupting it. It is the thread that has the process's number.
  const sched_param none{};
  static_cast<void>(sched_setscheduler(pid_, SCHED_BATCH, &none));
  turns_.take_with(pid_);
}

Status QemuProcess::write(int pair, std::span<const std::uint8_t> bytes, Seconds timeout) {
  NoPipeSignal guard;
  const int fd = pairs_[static_cast<std::size_t>(pair)].to;
  if (fd < 0) return Status::kPeerLost;
  const auto deadline = deadline_in(timeout);
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written > 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    } else if (errno == EAGAIN) {
      if (Clock::now() >= deadline) return Status::kPeerLost;
      pollfd wait{fd, POLLOUT, 0};
      poll(&wait, 1, milliseconds_until(deadline));
    } else if (errno != EINTR) {
      if (errno == EPIPE) guard.raised();
      return Status::kPeerLost;
    }
  }
  return Status::kOk;
}

Status QemuProcess::read(int pair, std::vector<std::uint8_t>& bytes, Seconds timeout,
                         const volatile std::sig_atomic_t* interrupted) {
  const int fd = pairs_[static_cast<std::size_t>(pair)].from;
  const auto begin = Clock::now(), deadline = begin + std::chrono::duration_cast<Clock::duration>(timeout);
  if (!turns_.apart()) turns_.wait_together();
  for (bool looking = turns_.apart();;) {
    if (interrupted != nullptr && *interrupted != 0) return Status::kInterrupted;
    pollfd wait{fd, POLLIN, 0};
    if (poll(&wait, 1, looking ? 0 : milliseconds_until(deadline)) > 0) {
      std::array<std::uint8_t, 65536> chunk;  // as large as a pipe
      const ssize_t count = ::read(fd, chunk.data(), chunk.size());
      bytes.insert(bytes.end(), chunk.begin(), chunk.begin() + std::max<ssize_t>(count, 0));
      if (count > 0) {
        if (looking) turns_.came();
        return Status::kOk;
      }
      if (count == 0 || errno != EINTR) return Status::kPeerLost;
    } else if (looking) {
      looking = Clock::now() < std::min(begin + Turns::kLookedFor, deadline);
      if (!looking) turns_.did_not_come();
    } else if (Clock::now() >= deadline) {
      return Status::kEmpty;
    }
  }
}

void QemuProcess::close_writing(int pair) {
  int& fd = pairs_[static_cast<std::size_t>(pair)].to;
  if (fd >= 0) close(fd);
  fd = -1;
}

std::string QemuProcess::ended(Seconds timeout) {
  const auto deadline = deadline_in(timeout);
  while (pid_ > 0) {
    int status = 0;
    if (waitpid(pid_, &status, WNOHANG) == pid_) {
      pid_ = 0;
      if (WIFEXITED(status)) {
        exit_status_ = WEXITSTATUS(status);
        end_ = "exit status " + std::to_string(exit_status_);
      } else {
        end_ = strsignal(WTERMSIG(status));
      }
    } else if (Clock::now() >= deadline) {
      break;
    } else {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  }
  return end_;
}

std::string QemuProcess::said() {
  std::string text(65536, ' ');
  const ssize_t count = said_ < 0 ? 0 : ::read(said_, text.data(), text.size());
  text.resize(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
  std::istringstream lines(text);
  std::string kept;
  for (std::string line; std::getline(lines, line);) {
    if (line.find("warning:") == std::string::npos) kept += (kept.empty() ? "" : "; ") + line;
  }
  return kept;
}

QemuProcess::~QemuProcess() {
  for (const Pair& pair : pairs_) {
    if (pair.to >= 0) close(pair.to);
    close(pair.from);
  }
  if (said_ >= 0) close(said_);
  if (pid_ <= 0) return;
  kill(pid_, SIGKILL);
  while (waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

}  // namespace ballast::sil
