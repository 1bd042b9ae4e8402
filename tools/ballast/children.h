// Programs of this project that run beside this one and end with it.
#pragma once

#include <string>
#include <vector>

#include "tools/program/subprocess.h"

namespace ballast {

class Children {
 public:
  Children() = default;
  // Waits a second for the children to end by themselves, sends them SIGTERM, waits another second, and kills the rest.
  ~Children();
  Children(const Children&) = delete;
  Children& operator=(const Children&) = delete;

  // Starts the program of this name in the folder of this executable. Empty, or the reason why it could not.
  std::string start(const std::string& name, const std::vector<std::string>& arguments);

  // Signals the child of this name, if it is running.
  void signal(const std::string& name, int number);
  // Kills the child of this name and starts it again with the same arguments. Empty, or the reason why it could not.
  std::string restart(const std::string& name);

  // A line about a child that has ended since the last call, or empty.
  std::string ended();

 private:
  struct Child {
    std::string name;
    std::vector<std::string> arguments;
    program::Subprocess process;
  };
  bool all_end_soon();

  std::vector<Child> children_;
};

}  // namespace ballast
