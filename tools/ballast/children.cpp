#include "tools/ballast/children.h"

#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <thread>

#include "tools/program/subprocess.h"

extern char** environ;

namespace ballast {

std::string Children::start(const std::string& name, const std::vector<std::string>& arguments) {
  const auto path = program::beside_this_program(name);
  std::vector<char*> argv;
  argv.push_back(const_cast<char*>(path.c_str()));  // posix_spawn only reads them
  for (const auto& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_t pid = 0;
  if (const int error = posix_spawn(&pid, path.c_str(), nullptr, nullptr, argv.data(), environ); error != 0) {
    return path.string() + ": cannot be started: " + std::strerror(error);
  }
  children_.push_back({name, pid});
  return "";
}

std::string Children::ended() {
  for (auto child = children_.begin(); child != children_.end(); ++child) {
    int status = 0;
    if (waitpid(child->pid, &status, WNOHANG) != child->pid) continue;
    std::string line = child->name + " ended";
    if (WIFSIGNALED(status)) line += std::string(": ") + strsignal(WTERMSIG(status));
    if (WIFEXITED(status)) line += " with exit status " + std::to_string(WEXITSTATUS(status));
    children_.erase(child);
    return line;
  }
  return "";
}

Children::~Children() {
  using namespace std::chrono_literals;
  const auto all_gone_within = [this](std::chrono::milliseconds time) {
    const auto deadline = std::chrono::steady_clock::now() + time;
    for (;;) {
      while (!ended().empty()) {
      }
      if (children_.empty()) return true;
      if (std::chrono::steady_clock::now() >= deadline) return false;
      std::this_thread::sleep_for(5ms);
    }
  };
  if (all_gone_within(1000ms)) return;
  for (const auto& child : children_) kill(child.pid, SIGTERM);
  if (all_gone_within(1000ms)) return;
  for (const auto& child : children_) kill(child.pid, SIGKILL);
  all_gone_within(1000ms);
}

}  // namespace ballast
