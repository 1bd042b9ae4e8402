#include "tools/recording/output_dir.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <system_error>

namespace ballast::sil {

namespace fs = std::filesystem;

namespace {

// All files of a run, with the pictures of tools/plots and the pages of tools/report.
constexpr const char* kFiles[] = {"summary.json",          "integrators.json", "run.lcmlog",           "robot.json",
                                  "scenario.toml",         "normal_force.png", "static_friction.png",  "path.png",
                                  "friction_required.png", "masses.png",       "angular_velocity.png", "body_frame.png",
                                  "motor_share.png",       "motors.png",       "height.png",           "report.html",
                                  "compare.html",          "belief.csv",       "estimate.png",         "belief.png"};

bool write_file(const fs::path& path, const std::string& text) {
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (file == nullptr) return false;
  const bool written = std::fwrite(text.data(), 1, text.size(), file) == text.size();
  return (std::fclose(file) == 0) && written;
}

}  // namespace

OutputDir::OutputDir(fs::path path) : path_(std::move(path)) {
  std::error_code code;
  if (fs::exists(path_, code) && !fs::is_directory(path_, code)) {
    error_ = path_.string() + ": is a file; allowed: a folder, which is made if there is none";
    return;
  }
  for (fs::path p = fs::absolute(path_); !p.empty() && !fs::exists(p, code); p = p.parent_path()) made_.push_back(p);
  fs::create_directories(path_, code);
  if (code) {
    error_ = path_.string() + ": cannot be made: " + code.message();
    return;
  }
  // Not inherited by programs that this one starts: the lock must end with this process, however that ends.
  lock_ = open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (lock_ >= 0 && flock(lock_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    error_ = path_.string() + ": another run is writing there; allowed: another folder (--out), or to wait for its end";
    made_.clear();  // it is the other one's now
    return;
  }
  if (!is_still_there()) return;
  const fs::path probe = path_ / ".ballast-probe";
  if (!write_file(probe, "")) error_ = path_.string() + ": cannot be written to: " + std::strerror(errno);
  fs::remove(probe, code);
}

OutputDir::~OutputDir() {
  std::error_code code;
  for (const fs::path& folder : made_) {
    fs::remove(folder, code);  // not if there is something in it
  }
  if (lock_ >= 0) close(lock_);
}

bool OutputDir::is_still_there() {
  struct stat locked {};
  struct stat named {};
  if (lock_ < 0 || (fstat(lock_, &locked) == 0 && stat(path_.c_str(), &named) == 0 && locked.st_dev == named.st_dev &&
                    locked.st_ino == named.st_ino)) {
    return true;
  }
  return fail(path_.string() + ": is no longer the folder that it was: it was moved or removed");
}

void OutputDir::clear() {
  std::error_code code;
  // A file that cannot be removed cannot be replaced either; writing it reports the error.
  for (const char* name : kFiles) {
    if (!fs::is_directory(path_ / name, code)) fs::remove(path_ / name, code);
  }
  clear_black_box();
}

void OutputDir::clear_black_box() {
  if (!is_still_there()) return;  // it is another run's
  std::error_code code;
  // Only files of a black box; other files stay.
  const fs::path box = path_ / kBlackBox;
  for (const char* name : {"run.lcmlog", "scenario.toml", "blackbox.json"}) fs::remove(box / name, code);
  if (fs::is_directory(box, code)) fs::remove(box, code);
}

bool OutputDir::fail(const std::string& why) {
  error_ = why;
  return false;
}

bool OutputDir::write(const std::string& name, const std::string& text) {
  if (!is_still_there()) return false;
  const fs::path target = path_ / name, draft = path_ / (name + ".part");
  std::error_code code;
  if (!write_file(draft, text)) {
    error_ = target.string() + ": cannot be written: " + std::strerror(errno);
    fs::remove(draft, code);
    return false;
  }
  fs::rename(draft, target, code);
  if (code) error_ = target.string() + ": cannot be written: " + code.message();
  return good();
}

}  // namespace ballast::sil
