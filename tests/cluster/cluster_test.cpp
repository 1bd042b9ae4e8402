// ballast-sweep on the ranks of an MPI program.
#include <gtest/gtest.h>

#include <regex>

#include "tests/sil/shell.h"
#include "tests/sweep/sweeps.h"

namespace ballast {
namespace {

using test::Folder;
using test::Outcome;
using test::read_file;

// Open MPI refuses root and more ranks than processors unless it is told otherwise; other implementations do not read
// these variables. What the MPI library leaves allocated is not our leak; the other sanitizers stay on.
const std::string kMpirun =
    "ASAN_OPTIONS=detect_leaks=0 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 "
    "OMPI_MCA_rmaps_base_oversubscribe=1 " BALLAST_MPIRUN " -n ";

Outcome run_ranks(const Folder& folder, int ranks, const std::string& arguments) {
  return folder.run(kMpirun + std::to_string(ranks) + " ballast-sweep " + arguments);
}

// The sweep's results by `ballast sweep`.
std::string expected(const Folder& folder, const std::string& sweep) {
  const Outcome outcome = folder.run("ballast sweep " + sweep + ".toml --quiet --out expected_" + sweep);
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  return read_file(folder / ("expected_" + sweep + "/sweep.nc"));
}

// A block of another rank takes a report and an answer; each of these ranks asks once more and says that it ends.
TEST(Ranks, WriteTheSameBytesHoweverMany) {
  const Folder folder;
  folder.write("paper.toml", test::kPaperSweep);
  folder.write("stepper.toml", test::kStepperSweep);
  for (const std::string sweep : {"paper", "stepper"}) {
    const std::string whole = expected(folder, sweep);
    for (const int ranks : {1, 2, 4}) {
      const std::string out = sweep + std::to_string(ranks);
      const Outcome outcome = run_ranks(folder, ranks, sweep + ".toml --quiet --out " + out);
      ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
      EXPECT_EQ(read_file(folder / (out + "/sweep.nc")), whole) << out;
      EXPECT_EQ(read_file(folder / (out + "/summary.txt")), read_file(folder / ("expected_" + sweep + "/summary.txt")));
      std::smatch counts;
      ASSERT_TRUE(std::regex_search(outcome.out, counts, std::regex("(\\d+) ranks, (\\d+) blocks, (\\d+) messages")))
          << outcome.out;
      EXPECT_EQ(std::stoi(counts[1]), ranks);
      EXPECT_EQ(std::stoi(counts[2]), sweep == "paper" ? 120 : 12);
      EXPECT_LE(std::stoi(counts[3]), 2 * std::stoi(counts[2]) + 3 * (ranks - 1));
      EXPECT_GE(std::stoi(counts[3]), 3 * (ranks - 1));
    }
  }
}

TEST(Ranks, SearchLimits) {
  const Folder folder;
  folder.write("paper.toml", test::kPaperSweep);
  const std::string key = " --find-limit surface.static_friction --quiet";
  ASSERT_EQ(folder.run("ballast sweep paper.toml --out a" + key).exit_status, 0);
  const Outcome outcome = run_ranks(folder, 3, "paper.toml --out b" + key);
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_EQ(read_file(folder / "a/sweep.nc"), read_file(folder / "b/sweep.nc"));
}

// Sends a signal to one of two ranks, once a block is there.
std::string signal_to_a_rank(const std::string& signal) {
  return kMpirun +
         "2 ballast-sweep slow.toml --quiet --out r --resume & mpirun=$!\n"
         "until ranks=$(cat /proc/$mpirun/task/$mpirun/children) && [ \"$(echo $ranks | wc -w)\" = 2 ]; do\n"
         "  sleep 0.02; done\n"
         "until [ -e r/blocks/0000000000 ]; do sleep 0.02; done\n"
         "sleep 0.2; kill -" +
         signal + " $(echo $ranks | cut -d' ' -f2); wait $mpirun";
}

TEST(Ranks, GoOnAfterACrash) {
  const Folder folder;
  std::string slow = test::kStepperSweep;
  slow.replace(slow.find("duration = 0.3"), 14, "duration = 24.0");
  folder.write("slow.toml", slow);
  const std::string whole = expected(folder, "slow");
  const Outcome crashed = folder.run(signal_to_a_rank("SEGV"));
  EXPECT_NE(crashed.exit_status, 0);
  // On a loaded machine the killed rank may not have begun when the other has written a block.
  const std::regex died("ballast-sweep: rank [01] died of signal 11 (in rows \\d+ to|before its first row)");
  EXPECT_TRUE(std::regex_search(crashed.err, died)) << crashed.err;
  EXPECT_NE(folder.run(signal_to_a_rank("KILL")).exit_status, 0);
  EXPECT_FALSE(std::filesystem::exists(folder / "r/sweep.nc"));
  const Outcome resumed = run_ranks(folder, 2, "slow.toml --quiet --out r --resume");
  ASSERT_EQ(resumed.exit_status, 0) << resumed.err;
  EXPECT_EQ(read_file(folder / "r/sweep.nc"), whole);
}

TEST(Ranks, RefuseWhatRank0CannotRead) {
  const Folder folder;
  folder.write("bad.toml",
               "scenario = \"paper_ball\"\nruns = 3\n[vary]\n\"surface.static_friction\" = { grid = [] }\n");
  const Outcome bad = run_ranks(folder, 2, "bad.toml");
  EXPECT_EQ(bad.exit_status, 1);
  const std::string words = "bad.toml:4: vary.surface.static_friction.grid = []: is empty";
  EXPECT_SAYS(bad.err, words);
  EXPECT_EQ(bad.err.find(words), bad.err.rfind(words));  // one rank says it
  EXPECT_SAYS(run_ranks(folder, 2, "").err, "ballast-sweep: sweep: is missing; ");
  EXPECT_SAYS(run_ranks(folder, 2, "--help").out, "Usage: ballast-sweep");
  folder.write("paper.toml", test::kPaperSweep);
  ASSERT_EQ(folder.run("ballast sweep paper.toml --quiet --shard 1/2 --out r").exit_status, 0);
  EXPECT_SAYS(run_ranks(folder, 2, "paper.toml --out r").err, "r: holds an unfinished run of this sweep");
  EXPECT_SAYS(run_ranks(folder, 2, "paper.toml --out r --resume").err, "r: was begun by ballast ");
}

#if BALLAST_HAS_SLURM
// A cluster of one node, made of this machine, that is really started.
TEST(Slurm, RunsTheRanks) {
  const Folder folder;
  folder.write("paper.toml", test::kPaperSweep);
  const std::string whole = expected(folder, "paper");
  const Outcome outcome =
      folder.run(BALLAST_SLURM_SCRIPT
                 " bash -c 'srun --overcommit -n 2 ballast-sweep paper.toml --quiet --out r && "
                 "sbatch --wait --array=1-3 -o job_%a.txt --wrap \"ballast sweep paper.toml --jobs 1 --quiet --resume "
                 "--shard \\$SLURM_ARRAY_TASK_ID/3\"'");
  ASSERT_EQ(outcome.exit_status, 0) << outcome.out << outcome.err;
  EXPECT_SAYS(outcome.out, "2 ranks, 120 blocks, ");
  EXPECT_EQ(read_file(folder / "r/sweep.nc"), whole);
  ASSERT_EQ(folder.run("ballast sweep --out merged --merge runs/paper_shard_*_of_3").exit_status, 0);
  EXPECT_EQ(read_file(folder / "merged/sweep.nc"), whole);
}
#endif

}  // namespace
}  // namespace ballast
