#include "tools/program/subprocess.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <sstream>

extern char** environ;

namespace ballast::program {

namespace {

std::vector<char*> pointers(const std::vector<std::string>& argv) {
  std::vector<char*> out;
  out.reserve(argv.size() + 1);
  for (const auto& argument : argv) out.push_back(const_cast<char*>(argument.c_str()));  // exec only reads them
  out.push_back(nullptr);
  return out;
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
  std::error_code code;
  return std::filesystem::read_symlink("/proc/self/exe", code).parent_path() / name;
}

ProgramOutcome run_program(const std::vector<std::string>& argv) {
  ProgramOutcome outcome;
  int ends[2];
  if (pipe(ends) != 0) return outcome;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", 0, 0);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  posix_spawn_file_actions_addclose(&actions, ends[0]);
  posix_spawn_file_actions_addclose(&actions, ends[1]);
  pid_t pid = 0;
  const int error = posix_spawnp(&pid, argv[0].c_str(), &actions, nullptr, pointers(argv).data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  if (error == 0) {
    char buffer[4096];
    for (ssize_t size; (size = read(ends[0], buffer, sizeof buffer)) > 0 || (size < 0 && errno == EINTR);) {
      if (size > 0) outcome.output.append(buffer, static_cast<std::size_t>(size));
    }
    int status = 0;
    while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
    }
    if (WIFEXITED(status)) outcome.exit_status = WEXITSTATUS(status);
  }
  close(ends[0]);
  return outcome;
}

std::string become_program(const std::vector<std::string>& argv) {
  execvp(argv[0].c_str(), pointers(argv).data());
  return argv[0] + ": cannot be started: " + std::strerror(errno);
}

}  // namespace ballast::program
