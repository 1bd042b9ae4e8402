#include "tools/program/subprocess.h"

#include <fmt/core.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <thread>

#include "tools/program/descriptor.h"

namespace ballast::program {
namespace {

constexpr int kNotStarted = 127;  // the status a shell gives

std::filesystem::path programs_folder;  // use_programs_in()

std::error_code last_error() { return {errno, std::generic_category()}; }

std::vector<char*> pointers(const std::vector<std::string>& arguments) {
  std::vector<char*> out;
  out.reserve(arguments.size() + 1);
  for (const auto& argument : arguments) out.push_back(const_cast<char*>(argument.c_str()));  // exec only reads them
  out.push_back(nullptr);
  return out;
}

// Blocks every signal of this thread, so that a child's first steps are not interrupted by this process's handlers.
class SignalsBlocked {
 public:
  SignalsBlocked() {
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  ~SignalsBlocked() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  SignalsBlocked(const SignalsBlocked&) = delete;
  SignalsBlocked& operator=(const SignalsBlocked&) = delete;

 private:
  sigset_t before_;
};

// The functions below run in the child between fork and exec, where only async-signal-safe calls are allowed.

void end_with(pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(kNotStarted);  // it ended before the call above
}

void reset_signals() {
  for (int number = 1; number < NSIG; ++number) {
    struct sigaction action {};
    if (sigaction(number, nullptr, &action) == 0 && action.sa_handler != SIG_IGN) signal(number, SIG_DFL);
  }
  signal(SIGPIPE, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
}

// Makes sources[i] the descriptor i. The first pass moves all of them above the targets, so that none is overwritten
// before it is used.
bool place_descriptors(std::vector<int>& sources, int& report) {
  const int above = static_cast<int>(sources.size());
  const int moved = fcntl(report, F_DUPFD_CLOEXEC, above);
  if (moved < 0) return false;
  report = moved;
  for (int& source : sources) {
    if (source == ProcessStart::kInherit) continue;
    source = fcntl(source, F_DUPFD_CLOEXEC, above);
    if (source < 0) return false;
  }
  for (int target = 0; target < above; ++target) {
    const int source = sources[static_cast<std::size_t>(target)];
    if (source != ProcessStart::kInherit && dup2(source, target) < 0) return false;
  }
  return true;
}

[[noreturn]] void become_child(const ProcessStart& start, char** arguments, std::vector<int>& sources, int report,
                               pid_t parent) {
  if (start.ends_with_parent) end_with(parent);
  if (start.own_group) setpgid(0, 0);
  reset_signals();
  if (place_descriptors(sources, report)) execvp(arguments[0], arguments);
  const int error = errno;
  static_cast<void>(!write(report, &error, sizeof error));
  _exit(kNotStarted);
}

}  // namespace

std::filesystem::path find_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const auto candidate = std::filesystem::path(folder.empty() ? "." : folder) / name;
    std::error_code code;
    if (std::filesystem::is_regular_file(candidate, code) && access(candidate.c_str(), X_OK) == 0) return candidate;
  }
  return {};
}

std::filesystem::path beside_this_program(const std::string& name) {
  if (!programs_folder.empty()) return programs_folder / name;
  std::error_code code;
  return std::filesystem::read_symlink("/proc/self/exe", code).parent_path() / name;
}

void use_programs_in(const std::filesystem::path& folder) { programs_folder = folder; }

const std::filesystem::path& used_programs_folder() { return programs_folder; }

std::string ProcessEnd::text() const {
  return signal != 0 ? strsignal(signal) : fmt::format("exit status {}", exit_status);
}

Subprocess::Subprocess(Subprocess&& other) noexcept : pid_(std::exchange(other.pid_, 0)), end_(other.end_) {}

Subprocess& Subprocess::operator=(Subprocess&& other) noexcept {
  std::swap(pid_, other.pid_);
  std::swap(end_, other.end_);
  return *this;
}

Subprocess::~Subprocess() {
  if (!running()) return;
  send(SIGKILL);
  wait();
}

std::error_code Subprocess::start(const ProcessStart& start) {
  if (running()) return std::make_error_code(std::errc::device_or_resource_busy);
  std::vector<char*> arguments = pointers(start.arguments);
  const Descriptor null(open("/dev/null", O_RDWR | O_CLOEXEC));
  auto report = open_pipe();
  if (!null.good() || !report) return last_error();
  std::vector<int> sources{start.input, start.output, start.error};
  for (int& source : sources) source = source == ProcessStart::kNull ? null.get() : source;
  sources.insert(sources.end(), start.further.begin(), start.further.end());
  const pid_t parent = getpid();
  {
    const SignalsBlocked blocked;
    pid_ = fork();
    if (pid_ == 0) become_child(start, arguments.data(), sources, report->writing.get(), parent);
  }
  if (pid_ < 0) return not_forked();
  report->writing = Descriptor();
  int error = 0;
  while (read(report->reading.get(), &error, sizeof error) < 0 && errno == EINTR) {
  }
  if (error != 0) wait();
  return {error, std::generic_category()};
}

std::error_code Subprocess::start(const std::function<int()>& body) {
  if (running()) return std::make_error_code(std::errc::device_or_resource_busy);
  const pid_t parent = getpid();
  pid_ = fork();
  if (pid_ == 0) {
    end_with(parent);
    // An exception must not unwind the parent's copied stack: it ends the child here.
    _exit([&]() noexcept { return body(); }());
  }
  return pid_ < 0 ? not_forked() : std::error_code();
}

std::error_code Subprocess::not_forked() {
  pid_ = 0;
  return last_error();
}

void Subprocess::send(int signal) const {
  if (running()) kill(pid_, signal);
}

bool Subprocess::reap(int options) {
  int status = 0;
  pid_t ended = 0;
  do {
    ended = waitpid(pid_, &status, options);
  } while (ended < 0 && errno == EINTR);
  if (ended == 0) return false;
  pid_ = 0;
  end_ = {};
  if (ended > 0 && WIFEXITED(status)) end_.exit_status = WEXITSTATUS(status);
  if (ended > 0 && WIFSIGNALED(status)) end_.signal = WTERMSIG(status);
  return true;
}

ProcessEnd Subprocess::wait() {
  if (running()) reap(0);
  return end_;
}

std::optional<ProcessEnd> Subprocess::wait(std::chrono::duration<double> timeout) {
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  while (running() && !reap(WNOHANG)) {
    if (Clock::now() - begin >= timeout) return std::nullopt;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return end_;
}

ProgramOutcome run_program(const std::vector<std::string>& arguments) {
  ProgramOutcome outcome;
  auto pipe = open_pipe();
  if (!pipe) return outcome;
  Subprocess child;
  const int both = pipe->writing.get();
  if (child.start({.arguments = arguments, .input = ProcessStart::kNull, .output = both, .error = both}))
    return outcome;
  pipe->writing = Descriptor();
  char buffer[4096];
  for (;;) {
    const ssize_t size = read(pipe->reading.get(), buffer, sizeof buffer);
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) break;
    outcome.output.append(buffer, static_cast<std::size_t>(size));
  }
  outcome.exit_status = child.wait().exit_status;
  return outcome;
}

std::string become_program(const std::vector<std::string>& arguments) {
  execvp(arguments[0].c_str(), pointers(arguments).data());
  return cannot_start(arguments[0], last_error());
}

std::string cannot_start(const std::string& name, const std::error_code& reason) {
  return fmt::format("{}: cannot be started: {}", name, reason.message());
}

}  // namespace ballast::program
