// Child processes. All of the project's are started here. None outlives its Subprocess or stays a zombie.
// A Subprocess belongs to one thread.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

namespace ballast::program {

// The file that a shell would start for this name, found in PATH; empty if there is none.
std::filesystem::path find_program(const std::string& name);

// The file of this name in the folder of this executable, or in that of use_programs_in(), whether it exists or not.
std::filesystem::path beside_this_program(const std::string& name);

// For a library in a foreign program, such as Python, and for tests with programs of their own: where this project's
// programs are. To be called before any other thread uses them.
void use_programs_in(const std::filesystem::path& folder);
// Empty where this is a program of the project.
[[nodiscard]] const std::filesystem::path& used_programs_folder();

// How a process ended.
struct ProcessEnd {
  int exit_status = -1;  // -1: a signal ended it
  int signal = 0;        // 0: it ended by itself

  // "exit status 3", or the signal's name: "Killed".
  [[nodiscard]] std::string text() const;
};

struct ProcessStart {
  static constexpr int kInherit = -1;  // the child shares this process's descriptor
  static constexpr int kNull = -2;     // /dev/null

  std::vector<std::string> arguments;  // [0] is looked up in PATH unless it contains a slash
  // Descriptors of this process that become the child's standard files.
  int input = kInherit, output = kInherit, error = kInherit;
  std::vector<int> further = {};  // become the child's descriptors 3, 4, ...
  // The kernel kills the child when the thread that started it ends, however that happens.
  bool ends_with_parent = false;
  // A terminal's signals, such as that of Ctrl-C, do not reach the child.
  bool own_group = false;
};

class Subprocess {
 public:
  Subprocess() = default;
  // Kills the child if it is still running.
  ~Subprocess();
  Subprocess(Subprocess&& other) noexcept;
  Subprocess& operator=(Subprocess&& other) noexcept;

  // Starts a program. Returns after the program has replaced the copy of this process, so a program that cannot be
  // started is an error here. The child has the default action for every signal that this process handles.
  [[nodiscard]] std::error_code start(const ProcessStart& start);

  // Runs `body` in a copy of this process; it ends with the status that `body` returns, without running destructors.
  // The copy ends with this thread, as with ProcessStart::ends_with_parent.
  [[nodiscard]] std::error_code start(const std::function<int()>& body);

  // Whether the child was started and its end has not been observed by wait().
  [[nodiscard]] bool running() const { return pid_ > 0; }
  // 0 unless running().
  [[nodiscard]] pid_t pid() const { return pid_; }

  void send(int signal) const;

  // Waits for the end of the child.
  ProcessEnd wait();
  // nullopt: the child is still running after the timeout. With a timeout of 0 it does not wait. Where the end was
  // observed earlier, returns it again.
  std::optional<ProcessEnd> wait(std::chrono::duration<double> timeout);

 private:
  bool reap(int options);
  std::error_code not_forked();

  pid_t pid_ = 0;
  ProcessEnd end_;
};

struct ProgramOutcome {
  int exit_status = -1;  // -1: it could not be started, or a signal ended it
  std::string output;    // stdout and stderr
};

// Runs a program to its end, with an empty input, and collects its output. `arguments` as in ProcessStart.
ProgramOutcome run_program(const std::vector<std::string>& arguments);

// Replaces this process with a program. Returns only on failure, with the reason.
std::string become_program(const std::vector<std::string>& arguments);

// "NAME: cannot be started: REASON".
std::string cannot_start(const std::string& name, const std::error_code& reason);

}  // namespace ballast::program
