// Sweeps that are killed, damaged or out of space, and go on.
#include <gtest/gtest.h>

#include <chrono>
#include <random>
#include <thread>

#include "tests/random_seed.h"
#include "tests/sil/shell.h"
#include "tests/sweep/sweeps.h"
#include "tools/program/subprocess.h"

namespace ballast {
namespace {

using test::Folder;
using test::Outcome;
using test::read_file;

// Starts the sweep and kills it with SIGKILL after a time, unless it has ended.
void kill_after(const Folder& folder, std::chrono::microseconds time) {
  program::Subprocess sweep;
  const std::string ballast = BALLAST_BIN_DIR "/ballast";
  const auto error = sweep.start({.arguments = {ballast, "sweep", (folder / "s.toml").string(), "--quiet", "--resume",
                                                "--jobs", "2", "--out", (folder / "r").string()},
                                  .output = program::ProcessStart::kNull,
                                  .error = program::ProcessStart::kNull});
  ASSERT_FALSE(error) << error.message();
  std::this_thread::sleep_for(time);
  sweep.send(SIGKILL);
  static_cast<void>(sweep.wait());
}

TEST(KilledSweep, LosesAndDoublesNothing) {
  const Folder folder;
  folder.write("s.toml", test::kPaperSweep);
  const auto begun = std::chrono::steady_clock::now();
  ASSERT_EQ(folder.run("ballast sweep s.toml --quiet --jobs 2 --out whole").exit_status, 0);
  const auto whole = std::chrono::duration_cast<std::chrono::microseconds>(std::chrono::steady_clock::now() - begun);
  std::mt19937_64 engine(test::random_seed());
  std::uniform_int_distribution<std::int64_t> instant(0, whole.count());
  for (int kill = 0; kill < 20; ++kill) kill_after(folder, std::chrono::microseconds(instant(engine)));
  const Outcome last = folder.run("ballast sweep s.toml --quiet --jobs 2 --out r --resume");
  ASSERT_EQ(last.exit_status, 0) << last.err;
  EXPECT_EQ(read_file(folder / "r/sweep.nc"), read_file(folder / "whole/sweep.nc"));
  EXPECT_EQ(read_file(folder / "r/summary.txt"), read_file(folder / "whole/summary.txt"));
  EXPECT_FALSE(std::filesystem::exists(folder / "r/blocks"));
}

TEST(KilledSweep, IsNotBegunAgainUnasked) {
  const Folder folder;
  folder.write("s.toml", test::kPaperSweep);
  ASSERT_EQ(folder.run("ballast sweep s.toml --quiet --shard 1/2 --out r").exit_status, 0);
  const Outcome again = folder.run("ballast sweep s.toml --quiet --out r");
  EXPECT_EQ(again.exit_status, 1);
  EXPECT_SAYS(again.err, "r: holds an unfinished run of this sweep; allowed: --resume, or another --out");
  EXPECT_EQ(folder.run("ballast sweep s.toml --quiet --out r --resume").exit_status, 0);
}

TEST(KilledSweep, IsResumedByItsOwnBuildOnly) {
  const Folder folder;
  folder.write("s.toml", test::kPaperSweep);
  for (const std::string shard : {"1", "2"})
    ASSERT_EQ(folder.run("ballast sweep s.toml --quiet --shard " + shard + "/2 --out r" + shard).exit_status, 0);
  const std::string build = read_file(folder / "r1/build.txt");
  EXPECT_SAYS(build, "ballast ");
  EXPECT_SAYS(build, ", C library ");
  folder.write("r1/build.txt", "ballast 0123, C library 2.31\n");
  const Outcome other = folder.run("ballast sweep s.toml --quiet --out r1 --resume");
  EXPECT_EQ(other.exit_status, 1);
  EXPECT_SAYS(other.err, "r1: was begun by ballast 0123, C library 2.31; this is " + build.substr(0, build.size() - 1));
  const Outcome merged = folder.run("ballast sweep --out m --merge r2 r1");
  EXPECT_EQ(merged.exit_status, 1);
  EXPECT_SAYS(merged.err, "r1: was computed by ballast 0123, C library 2.31, but r2 by ballast ");
  EXPECT_FALSE(std::filesystem::exists(folder / "m"));
  folder.write("r1/build.txt", build);
  EXPECT_EQ(folder.run("ballast sweep --out m --merge r2 r1").exit_status, 0);
}

// The process that computes a row is killed; the sweep says which row.
TEST(KilledWorker, NamesItsRow) {
  const Folder folder;
  std::string slow = test::kStepperSweep;
  slow.replace(slow.find("duration = 0.3"), 14, "duration = 200.0");
  folder.write("s.toml", slow);
  const Outcome killed = folder.run(
      "ballast sweep s.toml --quiet --jobs 1 --out r & sweep=$!\n"
      "until worker=$(cat /proc/$sweep/task/$sweep/children) && [ -n \"$worker\" ]; do sleep 0.02; done\n"
      "sleep 0.3; kill -KILL $worker; wait $sweep");
  EXPECT_EQ(killed.exit_status, 2);
  EXPECT_SAYS(killed.err, "a worker died in row 0: Killed; the finished blocks are kept, and --resume continues");
}

TEST(DamagedBlocks, AreMadeAgain) {
  const Folder folder;
  folder.write("s.toml", test::kPaperSweep);
  ASSERT_EQ(folder.run("ballast sweep s.toml --quiet --out whole").exit_status, 0);
  ASSERT_EQ(folder.run("ballast sweep s.toml --quiet --shard 1/1 --out r").exit_status, 0);
  const auto block = folder / "r/blocks/0000000007";
  std::string bytes = read_file(block);
  ASSERT_GT(bytes.size(), 100u);
  bytes[90] = static_cast<char>(bytes[90] + 1);
  folder.write("r/blocks/0000000007", bytes);
  folder.write("r/blocks/0000000008", "");
  folder.write("r/blocks/0000000009", read_file(folder / "r/blocks/0000000010"));
  folder.write("r/blocks/0000000011.part", "half a block");
  ASSERT_EQ(folder.run("ballast sweep s.toml --quiet --out r --resume").exit_status, 0);
  EXPECT_EQ(read_file(folder / "r/sweep.nc"), read_file(folder / "whole/sweep.nc"));
}

// A limit on the size of files stands for a disk without space: writing fails in the same way.
TEST(FullDisk, IsOneErrorAndLosesNothing) {
  const Folder folder;
  folder.write("s.toml", test::kPaperSweep);
  ASSERT_EQ(folder.run("ballast sweep s.toml --quiet --out whole").exit_status, 0);
  for (const std::string kilobytes : {"1", "16"}) {  // the sweep cannot be written; sweep.nc cannot
    const Outcome full = folder.run("(trap '' XFSZ; ulimit -f " + kilobytes +
                                    "; ballast sweep s.toml --quiet --resume --out r" + kilobytes + ")");
    EXPECT_EQ(full.exit_status, 2) << full.err;
    EXPECT_FALSE(std::filesystem::exists(folder / ("r" + kilobytes + "/sweep.nc")));
    EXPECT_SAYS(full.err, "ballast: ");
  }
  const Outcome resumed = folder.run("ballast sweep s.toml --quiet --resume --out r16");
  EXPECT_EQ(resumed.exit_status, 0) << resumed.err;
  EXPECT_EQ(read_file(folder / "r16/sweep.nc"), read_file(folder / "whole/sweep.nc"));
}

}  // namespace
}  // namespace ballast
