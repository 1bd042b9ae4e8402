#include "tests/plan/task_set.h"

#include <fmt/core.h>

#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "tools/plan/random_task.h"

namespace ballast::plan {
namespace {

// A task's file in parts: its name, what belongs to the robot, and the [task].
struct Parts {
  std::string name, robot, task;
};

Parts split(const std::string& toml) {
  const std::size_t line = toml.find('\n') + 1, task = toml.find("[task]");
  return {toml.substr(0, line), toml.substr(line, task - line), toml.substr(task)};
}

}  // namespace

std::vector<SetTask> read_task_set(const std::filesystem::path& file, std::string& why) {
  std::ifstream in(file);
  if (!in) why = file.string() + ": cannot be read";
  std::map<int, std::string> robots;
  std::vector<SetTask> out;
  for (std::string line; std::getline(in, line);) {
    const auto row = nlohmann::json::parse(line, nullptr, false);
    if (row.is_object() && row.contains("toml")) {
      robots[row.value("robot", -1)] = row.value("toml", "");
    } else if (row.is_object() && row.contains("task") && robots.count(row.value("robot", -1)) == 1) {
      const int number = row.value("number", -1);
      out.push_back(
          {number, row.value("sure", false),
           fmt::format("name = \"task_{}\"\n", number) + robots[row.value("robot", -1)] + row.value("task", "")});
    } else {
      why = fmt::format("{}: line {} is neither a robot nor a task of one before it", file.string(),
                        robots.size() + out.size() + 1);
      return {};
    }
  }
  return out;
}

bool write_task_set(const std::filesystem::path& file, std::uint64_t seed, int count, std::string& why) {
  std::string robots, tasks;
  for (int number = 0; number < count; ++number) {
    const auto toml = random_task(seed, number, why);
    if (!toml) {
      why = fmt::format("task {}: {}", number, why);
      return false;
    }
    const Parts parts = split(*toml);
    const int robot = number % kRandomRobots;
    if (number < kRandomRobots) {
      robots += nlohmann::ordered_json{{"robot", robot}, {"toml", parts.robot}}.dump() + "\n";
    }
    tasks +=
        nlohmann::ordered_json{
            {"number", number}, {"robot", robot}, {"sure", is_surely_possible(number)}, {"task", parts.task}}
            .dump() +
        "\n";
  }
  std::ofstream out(file, std::ios::binary);
  out << robots << tasks;
  out.close();
  if (!out) why = file.string() + ": cannot be written";
  return static_cast<bool>(out);
}

}  // namespace ballast::plan
