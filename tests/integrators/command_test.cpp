// `ballast integrate` as people run it.
#include <gtest/gtest.h>

#include "tests/sil/shell.h"

namespace ballast {
namespace {

using test::Folder;
using test::Outcome;

nlohmann::json table(const Folder& folder, const std::string& run) {
  return nlohmann::json::parse(test::read_file(folder / (run + "/integrators.json")));
}

TEST(Integrate, LeavesASummaryLikeThatOfRun) {
  const Folder folder;
  const Outcome integrate = folder.run("ballast integrate paper_ball");
  EXPECT_EQ(integrate.exit_status, 0) << integrate.err;
  EXPECT_EQ(integrate.err, "");
  for (const char* word : {"completed", "most f_s/N", "published", "dop853", "Jacobians", "distance"})
    EXPECT_NE(integrate.out.find(word), std::string::npos) << word;
  EXPECT_EQ(integrate.out.find("sliding"), std::string::npos) << integrate.out;
  ASSERT_EQ(folder.run("ballast run paper_ball --actuation prescribed --quiet").exit_status, 0);

  const auto here = folder.summary("runs/paper_ball-integrate"), there = folder.summary("runs/paper_ball");
  for (const auto& [key, value] : there.items()) EXPECT_TRUE(here.contains(key)) << key;
  EXPECT_EQ(here["actuation"], "prescribed");
  EXPECT_EQ(here["end"], there["end"]);
  EXPECT_EQ(here["regimes"], there["regimes"]);
  EXPECT_EQ(here["surfaces"], there["surfaces"]);
  EXPECT_EQ(here["trip"], nullptr);
  // Tolerance 1e-10, errors multiplied by 1e2.
  const auto near = [&](const char* object, const char* key) {
    EXPECT_NEAR(here[object][key].get<double>(), there[object][key].get<double>(), 1e-8) << object << '.' << key;
  };
  near("mu_required", "max");
  near("normal_force", "min");
  near("normal_force", "max");
  near("static_friction", "max");
  for (int i = 0; i < 3; ++i) {
    // Sampled by both.
    EXPECT_NEAR(here["motors"][i]["max_torque"].get<double>(), there["motors"][i]["max_torque"].get<double>(), 0.01);
    EXPECT_NEAR(here["motors"][i]["torque_margin"].get<double>(), there["motors"][i]["torque_margin"].get<double>(),
                0.01);
  }
}

TEST(Integrate, AllMethodsSideBySide) {
  const Folder folder;
  const Outcome all =
      folder.run("ballast integrate paper_ball --set duration=2 --method all --tolerance 1e-8 --out all");
  EXPECT_EQ(all.exit_status, 0) << all.err;
  EXPECT_NE(all.out.find("* fastest: "), std::string::npos) << all.out;
  const auto j = table(folder, "all");
  std::vector<std::string> names;
  for (const auto& row : j["methods"]) {
    names.push_back(row["method"]);
    EXPECT_NE(all.out.find("  " + names.back() + " "), std::string::npos) << names.back();
    EXPECT_EQ(row["failure"], nullptr);
    EXPECT_EQ(row["end"]["reason"], "completed");
    EXPECT_LT(row["distance"].get<double>(), 1e-5) << names.back();  // order 2 sums up some 1e2 tolerances
    EXPECT_GE(row["repetitions"].get<int>(), 3);
  }
  EXPECT_EQ(names, (std::vector<std::string>{"rk4", "dopri5", "dop853", "adams", "bdf", "trapezoid", "trbdf2", "radau5",
                                             "radau5_dae", "ida"}));
  EXPECT_EQ(j["reference"]["method"], "dop853");
  // The summary is dop853's.
  const Outcome one = folder.run("ballast integrate paper_ball --set duration=2 --tolerance 1e-8 --out one --quiet");
  EXPECT_EQ(one.out + one.err, "");
  auto a = folder.summary("all"), b = folder.summary("one");
  for (const char* key : {"wall_time", "speed"}) a.erase(key), b.erase(key);
  EXPECT_EQ(a, b);
}

TEST(Integrate, EndsWithStatus3WhereRollingEnds) {
  const Folder folder;
  const Outcome glass = folder.run("ballast integrate paper_ball --set surface.static_friction=0.17 --out glass");
  EXPECT_EQ(glass.exit_status, 3) << glass.err;
  EXPECT_EQ(folder.summary("glass")["end"]["reason"], "slipped");
  const Outcome detach = folder.run("ballast integrate paper_detach --method radau5_dae --out detach");
  EXPECT_EQ(detach.exit_status, 3) << detach.err;
  EXPECT_EQ(folder.summary("detach")["end"]["reason"], "detached");
}

// Squares of such a force are beyond a double's range.
TEST(Integrate, AForceBeyondNumbersIsRefused) {
  const Folder folder;
  const Outcome run = folder.run("ballast integrate paper_ball --set 'external_force=[1e200,0,0]' --out r");
  EXPECT_EQ(run.exit_status, 1) << run.err;
  EXPECT_NE(run.err.find("1e+15 in size"), std::string::npos) << run.err;
}

TEST(Integrate, RefusesWhatItCannotDo) {
  const Folder folder;
  const std::pair<const char*, const char*> kRefusals[] = {
      {"--method euler", "rk4, dopri5, dop853, adams, bdf, trapezoid, trbdf2, radau5, radau5_dae, ida, all"},
      {"--tolerance 1e-20", "allowed: 1e-13 to 0.01"},
      {"--tolerance nan", "allowed: 1e-13 to 0.01"},
      {"--step 0", "allowed: a finite number > 0"},
      {"--method adams --step 0.1", "adams chooses its steps itself"},
      {"--method rk4 --step 1e-9", "allowed: at least 2e-07"},
      {"--set initial.height=0.1",
       "in the air (initial.height); ballast integrate simulates rolling only, ballast run"},
      {"--set gravity=-1", "gravity"},
      {"--actuation stepper", "--actuation"},
  };
  for (const auto& [options, answer] : kRefusals) {
    const Outcome refused = folder.run(std::string("ballast integrate paper_ball ") + options);
    EXPECT_EQ(refused.exit_status, 1) << options;
    EXPECT_NE((refused.out + refused.err).find(answer), std::string::npos) << options << ": " << refused.err;
  }
  EXPECT_EQ(folder.entries(), 0);
}

// A fixed step far too long for Newton's iteration: the method's failure, not the physics' end.
TEST(Integrate, AMethodThatGivesUpIsStatus2) {
  const Folder folder;
  const Outcome failed = folder.run("ballast integrate paper_detach --method radau5 --step 2 --out r");
  EXPECT_EQ(failed.exit_status, 2) << failed.out;
  EXPECT_NE(failed.err.find("radau5 failed at t ="), std::string::npos) << failed.err;
  EXPECT_NE(failed.err.find("Newton's iteration does not converge"), std::string::npos) << failed.err;
  EXPECT_FALSE(std::filesystem::exists(folder / "r/summary.json"));
  EXPECT_NE(table(folder, "r")["methods"][0]["failure"], nullptr);
}

TEST(Integrate, NamesAStepThatIsTooCoarse) {
  const Folder folder;
  const Outcome coarse = folder.run("ballast integrate paper_ball --method rk4 --step 1 --quiet");
  EXPECT_NE(coarse.err.find("rk4 is too coarse here: its end state is 0.5"), std::string::npos) << coarse.err;
  const std::string advice = "; --step ";
  const std::size_t at = coarse.err.find(advice);
  ASSERT_NE(at, std::string::npos) << coarse.err;
  const std::string step = std::to_string(std::stod(coarse.err.substr(at + advice.size())));
  EXPECT_EQ(folder.run("ballast integrate paper_ball --method rk4 --quiet --step " + step).err, "");
}

TEST(Integrate, EndsWithOneLineWhenInterrupted) {
  const Folder folder;
  // A step that takes minutes.
  const Outcome killed =
      folder.run("timeout --preserve-status -s INT 1 ballast integrate paper_ball --method rk4 --step 1e-6");
  EXPECT_EQ(killed.exit_status, 2);
  EXPECT_EQ(killed.err, "ballast: interrupted; no results are written\n");
}

TEST(Integrate, SaysWhichFolderItCannotUse) {
  const Folder folder;
  folder.write("file", "");
  const Outcome failed = folder.run("ballast integrate paper_ball --out file");
  EXPECT_EQ(failed.exit_status, 2);
  EXPECT_NE(failed.err.find("file: is a file; allowed: a folder"), std::string::npos) << failed.err;
}

}  // namespace
}  // namespace ballast
