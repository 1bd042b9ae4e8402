// Programs of ours that run beside this one, and end with it.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace ballast {

class Children {
 public:
  Children() = default;
  // Whoever is still there gets a little time to end by itself, then SIGTERM, then SIGKILL.
  ~Children();
  Children(const Children&) = delete;
  Children& operator=(const Children&) = delete;

  // Starts the program of this name that lies beside this executable. Empty, or why it could not.
  std::string start(const std::string& name, const std::vector<std::string>& arguments);

  // To the one of this name, if it is there.
  void signal(const std::string& name, int number);
  // Kills it, and starts it as it was started. Empty, or why it could not.
  std::string restart(const std::string& name);

  // A line about a child that has ended although nobody asked it to, or empty.
  std::string ended();

 private:
  struct Child {
    std::string name;
    std::vector<std::string> arguments;
    pid_t pid;
  };
  std::vector<Child> children_;
};

}  // namespace ballast
