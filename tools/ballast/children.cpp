#include "tools/ballast/children.h"

#include <fmt/core.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

namespace ballast {

std::string Children::start(const std::string& name, const std::vector<std::string>& arguments) {
  const std::string path = program::beside_this_program(name);
  program::ProcessStart start{.arguments = {path}};
  start.arguments.insert(start.arguments.end(), arguments.begin(), arguments.end());
  program::Subprocess process;
  if (const auto error = process.start(start)) return program::cannot_start(path, error);
  children_.push_back({name, arguments, std::move(process)});
  return "";
}

void Children::signal(const std::string& name, int number) {
  for (const Child& child : children_) {
    if (child.name == name) child.process.send(number);
  }
}

std::string Children::restart(const std::string& name) {
  const auto child = std::find_if(children_.begin(), children_.end(), [&](const Child& c) { return c.name == name; });
  if (child == children_.end()) return name + ": is not running, and cannot be started again";
  const std::vector<std::string> arguments = child->arguments;
  children_.erase(child);  // kills it
  return start(name, arguments);
}

std::string Children::ended() {
  for (auto child = children_.begin(); child != children_.end(); ++child) {
    const auto end = child->process.wait(std::chrono::seconds(0));
    if (!end) continue;
    const std::string line = fmt::format("{} ended{}{}", child->name, end->signal != 0 ? ": " : " with ", end->text());
    children_.erase(child);
    return line;
  }
  return "";
}

bool Children::all_end_soon() {
  constexpr std::chrono::seconds kPatience{1};
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  for (;;) {
    while (!ended().empty()) {
    }
    if (children_.empty()) return true;
    if (std::chrono::steady_clock::now() >= deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

Children::~Children() {
  for (const int number : {SIGCONT, SIGTERM}) {  // a stopped process would not notice that its peers are gone
    for (const auto& child : children_) child.process.send(number);
    if (all_end_soon()) return;
  }
}

}  // namespace ballast
