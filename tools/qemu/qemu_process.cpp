#include "tools/qemu/qemu_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>
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

// Blocks SIGPIPE, so that a pipe without a reader is an error of write() and not the end of this process.
class NoPipeSignal {
 public:
  NoPipeSignal() {
    sigset_t pipe;
    sigemptyset(&pipe);
    sigaddset(&pipe, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &pipe, &before_);
  }
  void raised() { raised_ = true; }  // write() returned EPIPE
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

OneProcessor::OneProcessor() {
  const int here = sched_getcpu();
  if (here < 0 || sched_getaffinity(0, sizeof before_, &before_) != 0) return;
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(static_cast<std::size_t>(here), &one);
  moved_ = sched_setaffinity(0, sizeof one, &one) == 0;
}

OneProcessor::~OneProcessor() {
  if (moved_) sched_setaffinity(0, sizeof before_, &before_);
}

std::string QemuProcess::start(const QemuOptions& options) {
  if (!std::filesystem::is_regular_file(options.elf))
    return options.elf.string() + ": no such file; tools/firmware builds the firmware";
  if (!is_arm_program(options.elf)) {
    return options.elf.string() + ": is no program for " + options.board +
           "; allowed: an ELF file for ARM, as tools/firmware builds it";
  }
  const auto no_pipe = [] { return std::string("no pipe: ") + std::strerror(errno); };
  std::vector<program::Descriptor> child_ends;
  program::ProcessStart start{.ends_with_parent = true, .own_group = true};
  std::string arguments = "enable=on,target=native,arg=";
  for (int i = 0; i < options.pipe_pairs; ++i) {
    std::optional<program::Pipe> to = program::open_pipe();
    if (!to) return no_pipe();
    std::optional<program::Pipe> from = program::open_pipe();
    if (!from) return no_pipe();
    start.further.insert(start.further.end(), {to->reading.get(), from->writing.get()});
    child_ends.push_back(std::move(to->reading));
    child_ends.push_back(std::move(from->writing));
    fcntl(to->writing.get(), F_SETFL, O_NONBLOCK);
    pairs_.push_back({std::move(to->writing), std::move(from->reading)});
    const int child = kFirstChildFd + 2 * i;
    arguments += fmt::format("/dev/fd/{},arg=/dev/fd/{},arg=", child, child + 1);
  }
  arguments += options.arguments.empty() ? "-" : options.arguments;
  std::optional<program::Pipe> messages = program::open_pipe();
  if (!messages) return no_pipe();
  // Nobody reads this pipe before the end. Once it is full, more messages are lost and block nobody.
  for (const auto* end : {&messages->reading, &messages->writing}) fcntl(end->get(), F_SETFL, O_NONBLOCK);
  messages_ = std::move(messages->reading);

  std::string machine = options.board;
  std::replace(machine.begin(), machine.end(), '_', '-');
  start.arguments = {kQemu, "-M", machine, "-nodefaults", "-no-user-config"};
  for (const char* none : {"-display", "-monitor", "-serial"}) {
    start.arguments.insert(start.arguments.end(), {none, "none"});
  }
  const std::string icount = fmt::format("shift={},sleep=off", options.icount_shift);
  start.arguments.insert(start.arguments.end(),
                         {"-icount", icount, "-semihosting-config", arguments, "-kernel", options.elf.string()});
  start.input = start.output = program::ProcessStart::kNull;
  start.error = messages->writing.get();
  one_processor_.emplace();
  const std::error_code error = qemu_.start(start);
  if (!error) return "";
  if (error == std::errc::no_such_file_or_directory) {
    return std::string(kQemu) + ": not found; Debian has it in qemu-system-arm";
  }
  return program::cannot_start(kQemu, error);
}

void QemuProcess::expect_answers() {
  // QEMU's main loop is woken in every control tick without work. As SCHED_BATCH it waits until the machine's own
  // thread pauses, instead of preempting it. It is the thread that has the process's number.
  const sched_param none{};
  static_cast<void>(sched_setscheduler(pid(), SCHED_BATCH, &none));
}

Status QemuProcess::write(int pair, std::span<const std::uint8_t> bytes, Seconds timeout) {
  NoPipeSignal guard;
  const int fd = pairs_[static_cast<std::size_t>(pair)].to.get();
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
  const int fd = pairs_[static_cast<std::size_t>(pair)].from.get();
  const auto deadline = deadline_in(timeout);
  for (;;) {
    if (interrupted != nullptr && *interrupted != 0) return Status::kInterrupted;
    pollfd wait{fd, POLLIN, 0};
    if (poll(&wait, 1, milliseconds_until(deadline)) > 0) {
      std::array<std::uint8_t, 65536> chunk;  // as large as a pipe
      const ssize_t count = ::read(fd, chunk.data(), chunk.size());
      bytes.insert(bytes.end(), chunk.begin(), chunk.begin() + std::max<ssize_t>(count, 0));
      if (count > 0) return Status::kOk;
      if (count == 0 || errno != EINTR) return Status::kPeerLost;
    } else if (Clock::now() >= deadline) {
      return Status::kEmpty;
    }
  }
}

void QemuProcess::close_writing(int pair) { pairs_[static_cast<std::size_t>(pair)].to = program::Descriptor(); }

std::string QemuProcess::ended(Seconds timeout) {
  const std::optional<program::ProcessEnd> end = qemu_.wait(timeout);
  if (!end) return "";
  exit_status_ = end->exit_status;
  return end->text();
}

std::string QemuProcess::messages() {
  std::string text(65536, ' ');
  const ssize_t count = messages_.good() ? ::read(messages_.get(), text.data(), text.size()) : 0;
  text.resize(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
  std::istringstream lines(text);
  std::string kept;
  for (std::string line; std::getline(lines, line);) {
    if (line.find("warning:") == std::string::npos) kept += (kept.empty() ? "" : "; ") + line;
  }
  return kept;
}

}  // namespace ballast::sil
