// The cost of a control tick in QEMU, counted in the work it does: blocks of
// instructions it enters (translation blocks), and those it must leave and begin anew because a register of a device is
// read or written in the middle of them. Numbers, not times: the same every time, on any machine.
#include <gtest/gtest.h>

#include <fstream>

#include "tests/sil/shell.h"

namespace ballast {
namespace {

struct Work {
  double blocks = 0, device_accesses = 0;
};

// The work of a whole run of this length: QEMU's log has a line for each piece.
Work work_of(const test::Folder& folder, const std::string& duration_s) {
  const test::Outcome run = folder.run(
      "PATH=$PWD/logging:$PATH ballast run paper_ball --firmware qemu --peer-timeout 120 --set duration=" + duration_s +
      " --quiet --out r");
  EXPECT_EQ(run.exit_status, 0) << run.err;
  Work work;
  std::ifstream log(folder / "exec.log");
  for (std::string line; std::getline(log, line);) {
    if (line.starts_with("Trace ")) ++work.blocks;
    if (line.starts_with("cpu_io_recompile")) ++work.device_accesses;
  }
  return work;
}

TEST(QemuWork, OfAControlTick) {
  const test::Folder folder;
  std::filesystem::create_directory(folder / "logging");
  const std::filesystem::path qemu = folder / "logging/qemu-system-arm";
  std::ofstream(qemu) << "#!/bin/sh\nexec " BALLAST_QEMU_ARM " \"$@\" -d exec,nochain -D exec.log\n";
  std::filesystem::permissions(qemu, std::filesystem::perms::owner_all);

  // Work done once per run cancels.
  const Work some = work_of(folder, "0.02"), more = work_of(folder, "0.06");
  const double blocks = (more.blocks - some.blocks) / 40;
  const double device_accesses = (more.device_accesses - some.device_accesses) / 40;
  RecordProperty("blocks", std::to_string(blocks));
  RecordProperty("device_accesses", std::to_string(device_accesses));
  // 250,000 instructions, 512 in a block at most: no fewer than 488 blocks. Waiting takes hardly more (machine.cpp),
  // the tick itself 1100. A loop that waits in four blocks of 100 would alone be over the bound.
  EXPECT_GT(blocks, 488);
  EXPECT_LT(blocks, 1800);
  EXPECT_GT(device_accesses, 0);  // the log says such things at all
  // Both ends of the tick's own time, the watchdog; and the step timer, in ticks that have pulses.
  EXPECT_LT(device_accesses, 5);
}

}  // namespace
}  // namespace ballast
