// The process around QEMU: what it leaves behind when it cannot be started.
#include "tools/qemu/qemu_process.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/time.h>

#include <csignal>
#include <cstdlib>

#include "tests/sil/shell.h"

namespace ballast {
namespace {

namespace fs = std::filesystem;

std::ptrdiff_t open_files() { return std::distance(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator()); }

class QemuProcess : public testing::Test {
 protected:
  QemuProcess() {
    const char* path = std::getenv("PATH");
    path_ = path == nullptr ? "" : path;
    setenv("PATH", "/nonexistent", 1);
  }
  ~QemuProcess() override { setenv("PATH", path_.c_str(), 1); }

  [[nodiscard]] std::string start(int pipe_pairs) const {
    sil::QemuProcess qemu;
    return qemu.start({.elf = BALLAST_BUILD_DIR "/mps2_an500/bin/sabotage.elf", .pipe_pairs = pipe_pairs});
  }

  std::string path_;
};

TEST_F(QemuProcess, AFailedStartLeavesNothingOpen) {
  const std::ptrdiff_t before = open_files();
  EXPECT_EQ(start(2), "qemu-system-arm: not found; Debian has it in qemu-system-arm");
  EXPECT_EQ(open_files(), before);
  // However few files there may be.
  rlimit limit{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &limit), 0);
  const rlim_t soft = limit.rlim_cur;
  int short_of_files = 0;
  for (rlim_t few = static_cast<rlim_t>(before); few < static_cast<rlim_t>(before) + 20; ++few) {
    limit.rlim_cur = few;
    ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &limit), 0);
    const std::string why = start(2);
    limit.rlim_cur = soft;
    ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &limit), 0);
    EXPECT_NE(why, "");
    if (why == "no pipe: Too many open files") ++short_of_files;
    EXPECT_EQ(open_files(), before) << few << ": " << why;
  }
  EXPECT_GT(short_of_files, 0);
}

// A signal that interrupts does not hide that there is no QEMU.
TEST_F(QemuProcess, SignalsDoNotHideAFailedStart) {
  struct sigaction act {
  }, before{};
  act.sa_handler = [](int) {};  // without SA_RESTART
  ASSERT_EQ(sigaction(SIGALRM, &act, &before), 0);
  const itimerval often{{0, 300}, {0, 300}}, never{};
  ASSERT_EQ(setitimer(ITIMER_REAL, &often, nullptr), 0);
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(start(1), "qemu-system-arm: not found; Debian has it in qemu-system-arm");
  }
  ASSERT_EQ(setitimer(ITIMER_REAL, &never, nullptr), 0);
  ASSERT_EQ(sigaction(SIGALRM, &before, nullptr), 0);
}

}  // namespace
}  // namespace ballast
