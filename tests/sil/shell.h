// Programs run as people run them: through a shell, in a folder of their own, with everything they say caught.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

// The text has these words.
#define EXPECT_SAYS(text, words) EXPECT_NE((text).find(words), std::string::npos) << (text)

namespace ballast::test {

inline std::string read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

struct Outcome {
  int exit_status;  // -1: killed by a signal
  std::string out, err;
};

// A fresh folder that goes with the object.
class Folder {
 public:
  Folder() {
    // mkdtemp puts six letters of its own in the place of the six X.
    std::string name = (std::filesystem::temp_directory_path() / "ballast-").string() + std::string(6, 'X');
    path_ = mkdtemp(name.data());
  }
  ~Folder() {
    std::error_code code;
    std::filesystem::permissions(path_, std::filesystem::perms::owner_all, code);
    std::filesystem::remove_all(path_, code);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

  // Runs `line` in this folder with the programs on the path.
  Outcome run(const std::string& line) const {
    const std::string command = "cd '" + path_.string() + "' && PATH=" BALLAST_BIN_DIR ":$PATH; { " + line + "\n} >'" +
                                (path_ / ".out").string() + "' 2>'" + (path_ / ".err").string() + "' </dev/null";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(path_ / ".out"), read_file(path_ / ".err")};
  }

  [[nodiscard]] nlohmann::json summary(const std::string& run) const {
    return nlohmann::json::parse(read_file(path_ / run / "summary.json"));
  }

  void write(const std::string& name, const std::string& text) const { std::ofstream(path_ / name) << text; }

  // The folder's content, without the files in which run() caught the output.
  [[nodiscard]] int entries() const {
    int count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(path_))
      count += entry.path().filename().string()[0] != '.';
    return count;
  }

 private:
  std::filesystem::path path_;
};

// One of 375 places that no other test process has while this one runs: a lock says so, which ends with the process.
inline int place_of_this_process() {
  for (int tried = 0; tried < 375; ++tried) {
    const int place = (getpid() + tried) % 375;
    const auto lock = std::filesystem::temp_directory_path() / ("ballast-test-bus-" + std::to_string(place));
    int file = open(lock.c_str(), O_RDONLY | O_CLOEXEC);  // another user's may be read
    if (file < 0) file = open(lock.c_str(), O_CREAT | O_RDONLY | O_CLOEXEC, 0666);
    if (file >= 0 && flock(file, LOCK_EX | LOCK_NB) == 0) return place;  // kept open
    if (file >= 0) close(file);
  }
  ADD_FAILURE() << "no bus is free";
  return 0;
}

// A bus of this test process alone, `which` < 32 of them. The ports are below those the system hands out itself.
inline std::string bus_url(int which) {
  EXPECT_LT(which, 32);
  static const int place = place_of_this_process();
  return "udpm://239.255.76.67:" + std::to_string(20000 + place * 32 + which) + "?ttl=0";
}

}  // namespace ballast::test
