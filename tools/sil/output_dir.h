// The folder a run leaves its results in.
#pragma once

#include <filesystem>
#include <string>

namespace ballast::sil {

inline constexpr char kBlackBox[] = "blackbox";  // the folder in it that a run leaves that ended badly

class OutputDir {
 public:
  // Creates it if need be and sees that files can be written there. On failure nothing is left behind; error() says
  // why.
  explicit OutputDir(std::filesystem::path path);

  [[nodiscard]] bool good() const { return error_.empty(); }
  [[nodiscard]] const std::string& error() const { return error_; }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::string log_path() const { return (path_ / "run.lcmlog").string(); }

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
  std::string error_;
};

}  // namespace ballast::sil
