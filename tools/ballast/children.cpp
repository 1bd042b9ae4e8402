#include "tools/ballast/children.h"

#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
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
  children_.push_back({name, arguments, pid});
  return "";
}

void Children::signal(const std::string& name, int number) {
  for (const Child& child : children_) {
    if (child.name == name) kill(child.pid, number);
  }
}

std::string Children::restart(const std::string& name) {
  const auto child = std::find_if(children_.begin(), children_.end(), [&](const Child& c) { return c.name == name; });
  if (child == children_.end()) return name + ": is not there, and cannot be started again";
  const std::vector<std::string> arguments = child->arguments;
  kill(child->pid, SIGKILL);
  waitpid(child->pid, nullptr, 0);
  children_.erase(child);
  return start(name, arguments);
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
  const auto all_gone = [this] {
    constexpr std::chrono::seconds kPatience{1};
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    for (;;) {
      while (!ended().empty()) {
      }
      if (children_.empty()) return true;
      if (std::chrono::steady_clock::now() >= deadline) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  };
  // One that is stopped would hear of nothing.
  for (const auto& child : children_) kill(child.pid, SIGCONT);
  if (all_gone()) return;
  for (const auto& child : children_) kill(child.pid, SIGTERM);
  if (all_gone()) return;
  for (const auto& child : children_) kill(child.pid, SIGKILL);
  all_gone();
}

}  // namespace ballast
