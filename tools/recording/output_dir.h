// The folder a run leaves its results in.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace ballast::sil {

inline constexpr char kBlackBox[] = "blackbox";  // the folder in it that a run leaves that ended badly

class OutputDir {
 public:
  // Creates it if need be, keeps other runs out of it as long as the object lives (where the file system has locks),
  // and sees that files can be written there. error() says what could not be done.
  explicit OutputDir(std::filesystem::path path);
  // Folders that were made and have stayed empty are taken away again.
  ~OutputDir();
  OutputDir(const OutputDir&) = delete;
  OutputDir& operator=(const OutputDir&) = delete;

  [[nodiscard]] bool good() const { return error_.empty(); }
  [[nodiscard]] const std::string& error() const { return error_; }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::string log_path() const { return (path_ / "run.lcmlog").string(); }

  // False: it was moved away, or removed, and what is there now may be another run's. error() says so.
  bool is_still_there();
  // Takes away what an earlier run has left, so that no file there speaks of another run than the log.
  void clear();
  void clear_black_box();
  // All of it or nothing. False: error() says why.
  bool write(const std::string& name, const std::string& text);
  // Always false: error() says it.
  bool fail(const std::string& why);
  bool write_summary(const std::string& text) { return write("summary.json", text); }

 private:
  std::filesystem::path path_;
  std::vector<std::filesystem::path> made_;  // the innermost first
  int lock_ = -1;                            // the folder itself: nothing is left when its holder is killed
  std::string error_;
};

}  // namespace ballast::sil
