// The folder that holds a run's results.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace ballast::sil {

inline constexpr char kBlackBox[] = "blackbox";  // its subfolder for a run that ended badly

class OutputDir {
 public:
  // Creates it if need be, keeps other runs out of it as long as the object lives (where the file system has locks),
  // and sees that files can be written there. error() says what could not be done.
  explicit OutputDir(std::filesystem::path path);
  // Removes folders that it has made and that are still empty.
  ~OutputDir();
  OutputDir(const OutputDir&) = delete;
  OutputDir& operator=(const OutputDir&) = delete;

  [[nodiscard]] bool good() const { return error_.empty(); }
  [[nodiscard]] const std::string& error() const { return error_; }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::string log_path() const { return (path_ / "run.lcmlog").string(); }

  // False: the folder was moved away or removed, and one there now may be another run's. error() says so.
  bool is_still_there();
  // Removes an earlier run's files, so that none is of another run than the log.
  void clear();
  void clear_black_box();
  // Writes a whole file or none. False: error() says why.
  bool write(const std::string& name, const std::string& text);
  // Always false: error() says it.
  bool fail(const std::string& why);
  bool write_summary(const std::string& text) { return write("summary.json", text); }

 private:
  std::filesystem::path path_;
  std::vector<std::filesystem::path> made_;  // the innermost first
  int lock_ = -1;                            // on the folder itself, so that nothing is left when its holder is killed
  std::string error_;
};

}  // namespace ballast::sil
