// `ballast soak` as people use it, and the short soak of every test run.
#include <gtest/gtest.h>

#include "tests/sil/shell.h"

namespace ballast {
namespace {

using test::Folder;
using test::Outcome;
using test::read_file;

#define ASSERT_SAYS(text, words) ASSERT_NE((text).find(words), std::string::npos) << (text)

// The invariants hold; a seed that fails is printed with the command that shows it again.
TEST(SoakCommand, NoInvariantBreaks) {
  const Folder folder;
  const Outcome soak = folder.run("ballast soak --seeds 0..199 --quiet --keep failed");
  EXPECT_EQ(soak.exit_status, 0) << soak.out << soak.err;
  EXPECT_SAYS(soak.out, "200 seeds, ");
  EXPECT_SAYS(soak.out, ", 0 broken\n");
  EXPECT_EQ(folder.entries(), 0);  // a folder for seeds that fail is taken away where none does
}

// Seeds that once broke an invariant, with the mistake that they showed.
TEST(SoakCommand, SeedsThatOnceBrokeHold) {
  const Folder folder;
  for (const int seed : {
           4849,   9579,   14692, 38846, 45649,  // a corrupted tick made the controller deaf
           7545,   29793,  36788, 39299, 51656, 60297, 61334, 66658, 37504,  // stops out of a motion's last ramp
           34481,  51082,  59430, 69398,  // a second trip, after a reset, ended the run before its masses rested
           10015,                         // no normal force for the masses as commanded, and f_s / N of it infinite
           10528,                         // released in the very tick in which the run ended
           78062,                         // a trip at rest, which needs no stop
           81828,                         // a full disk in the tick in which the controller is started again
           136384, 141377,                // a rate of 1e200 rad/s, whose forces overflow
           12300,  27298,  43209, 49590,  // an alarm of a peer that is many ticks late
           37274,                         // full steps, which make N hard to measure
           258625,                        // a slip flag after a patch that resists
           50734,                         // a slip flag in the wind
           199467,                        // a light flag of an IMU with 69 samples a second
           171968,                        // a stop planned anew for steps that are impossible
           78397,                         // a monitor that is started again while the ball slides
       }) {
    SCOPED_TRACE(seed);
    const Outcome soak =
        folder.run("ballast soak --quiet --jobs 1 --seeds " + std::to_string(seed) + ".." + std::to_string(seed));
    EXPECT_SAYS(soak.out, ", 0 broken");
    EXPECT_EQ(soak.exit_status, 0) << soak.out;
  }
}

// All but the seconds.
TEST(SoakCommand, SaysTheSameHoweverManyWork) {
  const Folder folder;
  const std::string cut = " | sed 's/ ticks, .*//'";
  const Outcome one = folder.run("ballast soak --seeds 200..229 --quiet --jobs 1" + cut);
  const Outcome three = folder.run("ballast soak --seeds 200..229 --quiet --jobs 3" + cut);
  EXPECT_SAYS(one.out, "30 seeds, ");
  EXPECT_EQ(one.out, three.out);
}

// A limit that no seed keeps: a microsecond on the clock. Whenever one is done, the other worker is at one too.
TEST(SoakCommand, ASeedThatFailsCanBeShownAgain) {
  const Folder folder;
  const Outcome soak = folder.run("ballast soak --seeds 0..49 --quiet --jobs 2 --seed-limit 1e-6 --keep failed");
  EXPECT_EQ(soak.exit_status, 3) << soak.err;
  EXPECT_SAYS(soak.out, "\"patient\" is broken");
  const std::size_t again = soak.out.find("again: ballast soak --seeds "), run = soak.out.find("its run: ballast run ");
  ASSERT_NE(again, std::string::npos);
  ASSERT_NE(run, std::string::npos);
  // Nothing is wrong with the seed: with the usual limit it passes, and its scenario is one.
  const auto command = [&](std::size_t at) { return soak.out.substr(at, soak.out.find('\n', at) - at); };
  const std::string limit = " --seed-limit 1e-06";
  std::string with_the_usual = command(again + 7);
  ASSERT_SAYS(with_the_usual, limit);
  with_the_usual.erase(with_the_usual.find(limit), limit.size());
  EXPECT_EQ(folder.run(with_the_usual).exit_status, 0);
  const int status = folder.run(command(run + 9) + " --quiet --out r").exit_status;
  EXPECT_TRUE(status == 0 || status == 2 || status == 3 || status == 6) << status;
}

TEST(SoakCommand, AddsRangesUp) {
  const Folder folder;
  const std::string cut = " | sed 's/ ticks, .*//'";
  const Outcome whole = folder.run("ballast soak --seeds 200..229 --quiet" + cut);
  EXPECT_EQ(folder.run("ballast soak --seeds 210..229 --quiet --add sum.json").exit_status, 0);
  const Outcome both = folder.run("ballast soak --seeds 200..209 --quiet --add sum.json" + cut);
  const std::string title = "\nsum.json, 2 ranges of seeds:\n";
  ASSERT_SAYS(both.out, title);
  EXPECT_EQ(both.out.substr(both.out.find(title) + title.size()), whole.out);
  const std::string before = read_file(folder / "sum.json");
  const Outcome twice = folder.run("ballast soak --seeds 229..300 --quiet --add sum.json");
  EXPECT_EQ(twice.exit_status, 1);
  EXPECT_SAYS(twice.err, "sum.json has the seeds 210..229 already; allowed: other seeds");
  EXPECT_EQ(read_file(folder / "sum.json"), before);
  EXPECT_EQ(folder.run("sed -i 's/\"build\": \"/&x/' sum.json").exit_status, 0);
  const Outcome other = folder.run("ballast soak --seeds 300..301 --quiet --add sum.json");
  EXPECT_EQ(other.exit_status, 1);
  EXPECT_SAYS(other.err, "sum.json has seeds of another build, x");
  for (const char* broken : {"", "[]", "{}", "no JSON", "{\"build\": 1, \"ranges\": [], \"totals\": {}}"}) {
    folder.write("broken.json", broken);
    const Outcome outcome = folder.run("ballast soak --seeds 300..301 --quiet --add broken.json");
    EXPECT_EQ(outcome.exit_status, 1) << broken;
    EXPECT_SAYS(outcome.err, "broken.json is no file of this command");
  }
  const Outcome table = folder.run("ballast soak --seeds 0..1 --quiet --table --add table.json");
  EXPECT_EQ(table.exit_status, 1);
  EXPECT_SAYS(table.err, "--add: --table draws other scenarios");
  const Outcome nowhere = folder.run("ballast soak --seeds 300..301 --quiet --add none/sum.json");
  EXPECT_EQ(nowhere.exit_status, 2);
  EXPECT_SAYS(nowhere.err, "none/sum.json: cannot be written");
}

// Before hours of it have been run.
TEST(SoakCommand, RefusesAFolderThatCannotBe) {
  const Folder folder;
  folder.write("file", "not a folder");
  const Outcome soak = folder.run("ballast soak --seeds 0..0 --keep file/failed");
  EXPECT_EQ(soak.exit_status, 2);
  EXPECT_SAYS(soak.err, "--keep: file/failed: cannot be made");
  EXPECT_EQ(soak.out, "") << "a seed has been run";
}

TEST(SoakCommand, RefusesSeedsThatAreNone) {
  const Folder folder;
  for (const std::string seeds : {"x..3", "3..x", "4..3", "1..2..3", "-1..3", "0..99999999999999999999"}) {
    SCOPED_TRACE(seeds);
    const Outcome soak = folder.run("ballast soak --seeds=" + seeds);
    EXPECT_EQ(soak.exit_status, 1);
    EXPECT_SAYS(soak.err, "allowed: A..B");
  }
}

// The table of the docs is the one that is generated. If this fails because Ballast has changed, put the new one there.
TEST(SoakCommand, TheFailureTableIsTheOneOfTheDocs) {
  const Folder folder;
  const std::string page = read_file(BALLAST_SOURCE_DIR "/tools/docs/soak.md");
  const std::string header = "| fault | severity |";
  const std::size_t begin = page.find(header);
  ASSERT_NE(begin, std::string::npos);
  const std::size_t end = page.find("\n\n", begin);
  const std::size_t command = page.rfind("ballast soak --table --seeds ", begin);
  ASSERT_NE(command, std::string::npos);
  const Outcome table = folder.run(page.substr(command, page.find('\n', command) - command) + " --quiet");
  EXPECT_EQ(table.exit_status, 0) << table.err;
  EXPECT_EQ(table.out, page.substr(begin, end + 1 - begin));
}

}  // namespace
}  // namespace ballast
