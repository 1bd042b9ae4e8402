// `ballast sweep` as people use it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/sil/shell.h"
#include "tests/sweep/sweeps.h"
#include "tools/sweep/netcdf_file.h"

namespace ballast {
namespace {

using sweep::NetcdfFile;
using test::Folder;
using test::Outcome;
using test::read_file;

std::vector<double> numbers(const Folder& folder, const std::string& results, const std::string& name,
                            std::size_t rows) {
  NetcdfFile file((folder / results).string(), NetcdfFile::Mode::kRead);
  const auto values = file.numbers(file.find_variable(name), 0, rows);
  EXPECT_EQ(file.error(), "");
  return values;
}

TEST(SweepCommand, WritesOneRowPerRun) {
  const Folder folder;
  folder.write("paper.toml", test::kPaperSweep);
  const Outcome sweep = folder.run("ballast sweep paper.toml --out r --quiet");
  ASSERT_EQ(sweep.exit_status, 0) << sweep.err;
  EXPECT_SAYS(sweep.out, "paper: 120 runs of paper_ball, seed 1\n  holds ");
  EXPECT_SAYS(sweep.out, "tracking.rms           no run has it\n");
  EXPECT_SAYS(sweep.out, "results                r/sweep.nc\n");
  EXPECT_EQ(sweep.out.substr(0, sweep.out.find("  results")), read_file(folder / "r/summary.txt"));
  EXPECT_FALSE(std::filesystem::exists(folder / "r/blocks"));
  const auto row = numbers(folder, "r/sweep.nc", "row", 120), held = numbers(folder, "r/sweep.nc", "held", 120);
  const auto status = numbers(folder, "r/sweep.nc", "exit_status", 120);
  const auto mu = numbers(folder, "r/sweep.nc", "mu_required_max", 120);
  const auto floor = numbers(folder, "r/sweep.nc", "surface_static_friction", 120);
  for (std::size_t i = 0; i < 120; ++i) {
    EXPECT_EQ(row[i], i);
    EXPECT_EQ(held[i], status[i] == 0);
    EXPECT_EQ(held[i] == 1, mu[i] <= floor[i]) << i;
  }
  NetcdfFile file((folder / "r/sweep.nc").string(), NetcdfFile::Mode::kRead);
  const auto reasons = file.texts(file.find_variable("end_reason"), 0, 120);
  for (std::size_t i = 0; i < 120; ++i) EXPECT_EQ(reasons[i] == "completed", held[i] == 1) << i;
  nc_type type = NC_BYTE;
  int dimensions = 0;
  EXPECT_TRUE(file.shape(file.find_variable("final_position"), type, dimensions));
  EXPECT_EQ(dimensions, 2);
}

TEST(SweepCommand, WritesTheSameBytesHoweverManyWork) {
  const Folder folder;
  folder.write("paper.toml", test::kPaperSweep);
  folder.write("stepper.toml", test::kStepperSweep);
  for (const std::string name : {"paper", "stepper"}) {
    for (const std::string jobs : {"1", "2", "3"}) {
      const Outcome sweep =
          folder.run("ballast sweep " + name + ".toml --quiet --jobs " + jobs + " --out " + name + jobs);
      ASSERT_EQ(sweep.exit_status, 0) << sweep.err;
      EXPECT_EQ(read_file(folder / (name + "1/sweep.nc")), read_file(folder / (name + jobs + "/sweep.nc"))) << jobs;
    }
  }
}

TEST(SweepCommand, ShardsJoinToTheSameBytes) {
  const Folder folder;
  folder.write("paper.toml", test::kPaperSweep);
  ASSERT_EQ(folder.run("ballast sweep paper.toml --quiet --out all").exit_status, 0);
  for (const std::string shard : {"1", "2", "3"}) {
    const Outcome part = folder.run("ballast sweep paper.toml --quiet --shard " + shard + "/3");
    ASSERT_EQ(part.exit_status, 0) << part.err;
    EXPECT_SAYS(part.out, "shard " + shard + " of 3, 40 of 120 runs\n");
  }
  const std::string parts = "runs/paper_shard_2_of_3 runs/paper_shard_1_of_3";
  const Outcome few = folder.run("ballast sweep --out merged --merge " + parts);
  EXPECT_EQ(few.exit_status, 2);
  EXPECT_SAYS(few.err, "rows 2 to 2 are missing");
  const Outcome merged = folder.run("ballast sweep --out merged --merge runs/paper_shard_3_of_3 " + parts);
  ASSERT_EQ(merged.exit_status, 0) << merged.err;
  EXPECT_EQ(read_file(folder / "merged/sweep.nc"), read_file(folder / "all/sweep.nc"));
  EXPECT_EQ(read_file(folder / "merged/summary.txt"), read_file(folder / "all/summary.txt"));
}

// One row of each kind as a full run: the same end, extrema to the 1e-6 of the contract.
TEST(SweepCommand, RunsARowAgain) {
  const Folder folder;
  folder.write("paper.toml", test::kPaperSweep);
  folder.write("stepper.toml", test::kStepperSweep);
  for (const auto& [name, row, rows] : {std::tuple{"paper", 1, 120u}, {"paper", 119, 120u}, {"stepper", 4, 12u}}) {
    const std::string results = std::string(name) + "_r/sweep.nc", again = fmt::format("{}_{}", name, row);
    if (!std::filesystem::exists(folder / results)) {
      ASSERT_EQ(folder.run(fmt::format("ballast sweep {0}.toml --quiet --out {0}_r", name)).exit_status, 0);
    }
    const Outcome run = folder.run(fmt::format("ballast sweep {}.toml --row {} --quiet --out {}", name, row, again));
    const auto place = static_cast<std::size_t>(row);
    EXPECT_EQ(run.exit_status, numbers(folder, results, "exit_status", rows)[place]) << run.err;
    const auto summary = folder.summary(again);
    EXPECT_NEAR(summary["mu_required"]["max"].get<double>(), numbers(folder, results, "mu_required_max", rows)[place],
                1e-6);
    EXPECT_EQ(summary["seed"].get<double>(), numbers(folder, results, "seed", rows)[place]);
  }
  // The folder of results is enough.
  EXPECT_SAYS(folder.run("ballast sweep paper_r/sweep.toml --row 1 --out again").out, "row 1 of paper: seed ");
  EXPECT_EQ(folder.summary("again")["mu_required"], folder.summary("paper_1")["mu_required"]);
  const Outcome beyond = folder.run("ballast sweep paper.toml --row 120");
  EXPECT_EQ(beyond.exit_status, 1);
  EXPECT_SAYS(beyond.err, "--row 120: is no row; allowed: 0 to 119");
}

TEST(SweepCommand, KeepsTheResultsOfAnotherSweep) {
  const Folder folder;
  folder.write("paper.toml", test::kPaperSweep);
  folder.write("stepper.toml", test::kStepperSweep);
  ASSERT_EQ(folder.run("ballast sweep stepper.toml --quiet --out r").exit_status, 0);
  const std::string before = read_file(folder / "r/sweep.nc");
  for (const std::string option : {"", " --resume"}) {
    const Outcome other = folder.run("ballast sweep paper.toml --quiet --out r" + option);
    EXPECT_EQ(other.exit_status, 1);
    EXPECT_SAYS(other.err, "r: holds the results of another sweep or run; allowed: another --out");
  }
  EXPECT_EQ(read_file(folder / "r/sweep.nc"), before);
  // The folder of the same sweep is complete, or made anew with the same bytes.
  EXPECT_SAYS(folder.run("ballast sweep stepper.toml --quiet --out r --resume").out, "stepper: 12 runs of paper_ball");
  EXPECT_EQ(folder.run("ballast sweep stepper.toml --quiet --out r").exit_status, 0);
  EXPECT_EQ(read_file(folder / "r/sweep.nc"), before);
  const Outcome merged = folder.run("ballast sweep --merge r --out m");
  EXPECT_EQ(merged.exit_status, 1);
  EXPECT_SAYS(merged.err, "r: holds complete results already");
}

TEST(SweepCommand, AnswersHowRobustARobotIs) {
  const Folder folder;
  const std::string command = "ballast sweep paper_ball --errors mass=5%,com=0.5%,tilt=3deg --runs 8 --seed 4 --quiet";
  const Outcome sweep = folder.run(command);
  ASSERT_EQ(sweep.exit_status, 0) << sweep.err;
  const auto held = numbers(folder, "runs/paper_ball_errors/sweep.nc", "held", 8);
  const auto share = 100 * static_cast<double>(std::count(held.begin(), held.end(), 1.0)) / 8;
  EXPECT_SAYS(sweep.out,
              fmt::format("With errors of mass=5%,com=0.5%,tilt=3deg paper_ball holds in {:.4g} % (", share));
  // The worst row is the one that needs the most, and can be run again.
  const auto mu = numbers(folder, "runs/paper_ball_errors/sweep.nc", "mu_required_max", 8);
  const auto worst = std::max_element(mu.begin(), mu.end()) - mu.begin();
  EXPECT_SAYS(sweep.out, fmt::format(", row {}.\n", worst));
  const Outcome row = folder.run(command + fmt::format(" --row {} --out again", worst));
  EXPECT_EQ(row.exit_status == 0, held[static_cast<std::size_t>(worst)] == 1) << row.err;
  EXPECT_NEAR(folder.summary("again")["mu_required"]["max"].get<double>(), mu[static_cast<std::size_t>(worst)], 1e-6);
  EXPECT_SAYS(folder.run("ballast sweep paper_ball --errors mass=5").err,
              "--errors: mass=5: is no part; allowed: a number >= 0 with %, such as mass=5%");
  EXPECT_SAYS(folder.run("ballast sweep paper_ball --errors tilt=3%").err,
              "is no angle; allowed: a number >= 0 with deg or rad, such as tilt=3deg");
  EXPECT_SAYS(folder.run("ballast sweep paper_ball --errors size=3%").err, "is no error; allowed: mass=PERCENT%,com=");
  EXPECT_EQ(folder.run("ballast sweep paper_ball --errors mass=5%,mass=6%").err,
            "--errors: mass=6%: mass is given twice; allowed: once\n");
  folder.write("paper.toml", test::kPaperSweep);
  EXPECT_EQ(folder.run("ballast sweep paper.toml --errors mass=5%").err,
            "paper.toml: is a sweep; allowed: a scenario with --errors, or a sweep without\n");
  EXPECT_SAYS(folder.run("ballast sweep none --errors mass=5%").err,
              "none: neither a file nor the name of a shipped scenario");
}

// The disk's inertia is at the limit of what a body can have, so that half of the errors make an impossible one.
TEST(SweepCommand, CountsImpossibleRobotsApart) {
  const Folder folder;
  const Outcome sweep = folder.run("ballast sweep paper_disk --errors inertia=1% --runs 20 --quiet");
  ASSERT_EQ(sweep.exit_status, 0) << sweep.err;
  const auto statuses = numbers(folder, "runs/paper_disk_errors/sweep.nc", "exit_status", 20);
  const auto refused = std::count(statuses.begin(), statuses.end(), 1.0);
  ASSERT_GT(refused, 0);
  ASSERT_EQ(std::count(statuses.begin(), statuses.end(), 0.0), 20 - refused);
  EXPECT_SAYS(sweep.out, fmt::format("paper_disk holds in 100 % ("));
  EXPECT_SAYS(sweep.out,
              fmt::format(" of {} runs; {} of 20 were refused or could not be run; worst: ", 20 - refused, refused));
  EXPECT_SAYS(sweep.out, fmt::format("  end.reason: no result  {:.4g} % (", 5.0 * static_cast<double>(refused)));
}

// A run that slips early has needed less than one that holds, and yet is the worse one; its extrema count for nothing.
TEST(SweepCommand, TellsRunsThatHoldFromThoseCutShort) {
  const Folder folder;
  folder.write("floor.toml",
               "scenario = \"paper_ball\"\n[set]\n\"run.actuation\" = \"prescribed\"\n[vary]\n"
               "\"surface.static_friction\" = { grid = [0.14, 0.15, 0.3, 0.4] }\n");
  const Outcome sweep = folder.run("ballast sweep floor.toml --quiet");
  ASSERT_EQ(sweep.exit_status, 0) << sweep.err;
  const auto mu = numbers(folder, "runs/floor/sweep.nc", "mu_required_max", 4);
  ASSERT_LT(mu[0], mu[2]);
  EXPECT_SAYS(sweep.out, fmt::format("  mu_required.max        least {:.4g}, ", mu[2]));
  EXPECT_SAYS(sweep.out, "; of 2 runs that hold\n");
  EXPECT_SAYS(sweep.out, "  worst                  slipped at t = ");
  EXPECT_SAYS(sweep.out, " on a floor of 0.14, row 0\n");
}

TEST(SweepCommand, RefusesResultsThatAreNotItsOwn) {
  const Folder folder;
  folder.write("paper.toml", test::kPaperSweep);
  folder.write("stepper.toml", test::kStepperSweep);
  ASSERT_EQ(folder.run("ballast sweep paper.toml --quiet --out p").exit_status, 0);
  ASSERT_EQ(folder.run("ballast sweep stepper.toml --quiet --out s").exit_status, 0);
  const auto resume = [&](const std::string& content) {
    folder.write("p/sweep.nc", content);
    const Outcome again = folder.run("ballast sweep paper.toml --quiet --out p --resume");
    EXPECT_EQ(again.exit_status, 2);
    return again.err;
  };
  EXPECT_SAYS(resume(read_file(folder / "s/sweep.nc")),
              "p/sweep.nc: holds the results of another sweep than sweep.toml");
  EXPECT_SAYS(resume(""),
              "p/sweep.nc: NetCDF: Unknown file format; the file is damaged: remove it, and run the sweep again");
  EXPECT_EQ(folder.run("ballast sweep paper.toml --quiet --out p --row ''").exit_status, 1);
}

TEST(SweepCommand, FindsLimits) {
  const Folder folder;
  folder.write("paper.toml", test::kPaperSweep);
  const std::string command = "ballast sweep paper.toml --find-limit surface.static_friction --quiet";
  for (const std::string jobs : {"1", "3"}) {
    const Outcome sweep = folder.run(command + " --out r" + jobs + " --jobs " + jobs);
    ASSERT_EQ(sweep.exit_status, 0) << sweep.err;
    EXPECT_SAYS(sweep.out, "  searched               the limit of surface.static_friction from 0.1 to 0.5\n");
    EXPECT_SAYS(sweep.out, "  limit                  least ");
    EXPECT_SAYS(sweep.out, "  limit_kind: holds above ");
  }
  EXPECT_EQ(read_file(folder / "r1/sweep.nc"), read_file(folder / "r3/sweep.nc"));
  const auto limit = numbers(folder, "r1/sweep.nc", "limit", 120);
  const auto floor = numbers(folder, "r1/sweep.nc", "surface_static_friction", 120);
  const auto found = static_cast<std::size_t>(
      std::find_if(limit.begin(), limit.end(), [](double value) { return std::isfinite(value); }) - limit.begin());
  ASSERT_LT(found, 120u);
  // The row again: with the last floor that held.
  const Outcome row = folder.run(fmt::format("ballast sweep r1/sweep.toml --row {} --out again", found));
  EXPECT_EQ(row.exit_status, 0) << row.err;
  EXPECT_EQ(folder.summary("again")["surface"]["static_friction"].get<double>(), floor[found]);
  const Outcome other = folder.run("ballast sweep paper.toml --quiet --out r1");
  EXPECT_EQ(other.exit_status, 1);
  EXPECT_SAYS(other.err, "holds the results of another sweep");
  EXPECT_SAYS(folder.run("ballast sweep paper.toml --find-limit mass.0.mass").err,
              "--find-limit mass.0.mass: is varied with normal; allowed: ");
}

TEST(SweepCommand, DrawsMaps) {
  const Folder folder;
  folder.write("paper.toml", test::kPaperSweep);
  const std::string map = " --map surface.static_friction,initial.angular_velocity.1";
  const Outcome sweep = folder.run("ballast sweep paper.toml --quiet --out r" + map);
  ASSERT_EQ(sweep.exit_status, 0) << sweep.err;
  EXPECT_SAYS(sweep.out, "  map                    r/map.png\n");
  EXPECT_TRUE(read_file(folder / "r/map.png").starts_with("\x89PNG"));
  const auto found = nlohmann::json::parse(read_file(folder / "r/map.json"));
  EXPECT_EQ(found["x"]["edges"].size(), 6u);
  EXPECT_EQ(found["y"]["edges"], nlohmann::json({-1.5, -0.5, 0.5, 1.5}));
  const auto held = numbers(folder, "r/sweep.nc", "held", 120);
  const auto floor = numbers(folder, "r/sweep.nc", "surface_static_friction", 120);
  for (std::size_t row = 0; row < 3; ++row) {  // 40 runs at each point of the grid, in this order
    std::array<std::uint64_t, 5> runs{}, holds{};
    for (std::size_t i = 40 * row; i < 40 * row + 40; ++i) {
      const auto cell = static_cast<std::size_t>((floor[i] - 0.1) / 0.08);
      ++runs[cell];
      holds[cell] += held[i] == 1;
    }
    EXPECT_EQ(found["runs"][row], nlohmann::json(runs));
    EXPECT_EQ(found["held"][row], nlohmann::json(holds));
  }
  // Later, from the results alone.
  std::filesystem::remove(folder / "r/map.png");
  ASSERT_EQ(folder.run("ballast sweep paper.toml --quiet --out r --resume" + map).exit_status, 0);
  EXPECT_TRUE(std::filesystem::exists(folder / "r/map.png"));
  EXPECT_SAYS(folder.run("ballast sweep paper.toml --map mass.0.mass").err,
              "--map mass.0.mass: is no pair of keys; allowed: X,Y, two keys of [vary] with numbers");
  EXPECT_SAYS(folder.run("ballast sweep paper.toml --map mass.0.mass,duration").err, "duration is not varied");
  EXPECT_SAYS(folder.run("ballast sweep paper.toml --shard 1/2" + map).err, "--map: a shard has no map");
}

TEST(SweepCommand, RefusesWhatItCannotRead) {
  const Folder folder;
  folder.write("bad.toml",
               "scenario = \"paper_ball\"\nruns = 3\n[vary]\n\"surface.statc_friction\" = { uniform = [0, 1] }\n");
  const Outcome bad = folder.run("ballast sweep bad.toml");
  EXPECT_EQ(bad.exit_status, 1);
  EXPECT_SAYS(bad.err, "bad.toml:4: surface.statc_friction = ");
  EXPECT_SAYS(folder.run("ballast sweep none.toml").err, "none.toml: no such file; allowed: a sweep file (TOML)");
  EXPECT_SAYS(folder.run("ballast sweep").err, "a sweep file is missing");
  for (const auto& [jobs, words] : {std::pair{"x", "x is no whole number; allowed: a whole number from 1 to 1024"},
                                    {"1.5", "1.5 is no whole number"},
                                    {"0", "0 is out of range"},
                                    {"99999999999", "99999999999 is out of range"}})
    EXPECT_SAYS(folder.run(fmt::format("ballast sweep bad.toml --jobs {}", jobs)).err, words);
  folder.write("paper.toml", test::kPaperSweep);
  for (const std::string shard : {"0/2", "3/2", "1", "1/", "x/2", "-1/2"}) {
    const Outcome refused = folder.run("ballast sweep paper.toml --shard=" + shard);
    EXPECT_EQ(refused.exit_status, 1) << shard;
    EXPECT_SAYS(refused.err, "allowed: K/N, whole numbers, 1 <= K <= N");
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "runs"));
}

}  // namespace
}  // namespace ballast
