// The committed set of random tasks, random_tasks.jsonl: 50 robots, then tasks that name their robot. Written by
// plan_tasks --write; read by plan_tasks and plan_test, so that figures belong to the same tasks everywhere.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace ballast::plan {

struct SetTask {
  int number = 0;
  bool sure = true;  // a motion has shown that it can be done
  std::string toml;
};

// Empty, and `why` in words, if the file is no such set.
[[nodiscard]] std::vector<SetTask> read_task_set(const std::filesystem::path& file, std::string& why);

// random_task() numbers 0 to count - 1 of a seed. False, and `why`: one could not be made or the file not be written.
[[nodiscard]] bool write_task_set(const std::filesystem::path& file, std::uint64_t seed, int count, std::string& why);

}  // namespace ballast::plan
