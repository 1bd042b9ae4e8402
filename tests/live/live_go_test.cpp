// The live page's planner: its lines as they come, and its end, whatever program it is.
#include "tools/ballast/live_go.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "tests/sil/shell.h"
#include "tools/program/subprocess.h"

namespace ballast {
namespace {

constexpr const char* kWay =
    "goes to (0.4, 0.2) m in 2 s from tick 5 on, on its way to (1, 0.5) m, and needs f_s/N = 1";

// A shell script takes the place of `ballast`.
class Planner : public testing::Test {
 protected:
  Planner() { program::use_programs_in(folder_ / "."); }
  ~Planner() override { program::use_programs_in(""); }

  void start(const std::string& script) {
    folder_.write("ballast", "#!/bin/sh\n" + script);
    std::filesystem::permissions(folder_ / "ballast", std::filesystem::perms::owner_all);
    status_.run_id = 3;
    status_.mode = controller_status_t::MODE_RUNNING;
    ASSERT_EQ(go_.start({"viewer 1", {1, 0.5}, {}}, status_), "");
  }

  // Waits for a file that the script makes, and which it cannot fail to make.
  void await(const std::string& name) const {
    for (int k = 0; k < 10000 && !std::filesystem::exists(folder_ / name); ++k)
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    ASSERT_TRUE(std::filesystem::exists(folder_ / name));
  }

  // The lines until the planner has ended, for 20 s at most; the answer last.
  std::vector<std::string> said() {
    std::vector<std::string> out;
    for (int k = 0; k < 10000; ++k) {
      while (const auto line = go_.progress()) {
        out.push_back(line->text);
        sets_out_ += line->sets_out;
      }
      if (const auto answer = go_.poll(&status_)) {
        out.push_back(answer->text);
        obeyed_ = answer->obeyed;
        has_course_ = answer->has_course;
        return out;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return out;
  }

  test::Folder folder_;
  controller_status_t status_{};
  LiveGo go_{"memq://"};
  int sets_out_ = 0;
  bool obeyed_ = false, has_course_ = false;
};

TEST_F(Planner, ItsLinesAreToldAsTheyComeAndItsLastIsTheAnswer) {
  const std::string tried = "no motion is found yet: f_s/N would be too high; searches on", last = "goes to (1, 0.5) m";
  start("echo '" + tried + "'\necho '" + kWay + "'\necho '" + last + "'\n");
  EXPECT_EQ(said(), (std::vector<std::string>{tried, kWay, last}));
  EXPECT_EQ(sets_out_, 1);
  EXPECT_TRUE(obeyed_ && has_course_);
}

TEST_F(Planner, ARefusalIsTheAnswerAlsoWhereItsWordsAreThoseOfProgress) {
  start(std::string("echo 'ballast: no course: ") + kWay + "' >&2\nexit 1\n");
  EXPECT_EQ(said(), (std::vector<std::string>{std::string("no course: ") + kWay}));
  EXPECT_FALSE(obeyed_ || has_course_);
  EXPECT_EQ(sets_out_, 0);
}

TEST_F(Planner, ABallThatRestsThereHasNoCourse) {
  start("echo 'the ball rests there already, at (1, 0.5) m'\n");
  EXPECT_EQ(said().size(), 1u);
  EXPECT_TRUE(obeyed_);
  EXPECT_FALSE(has_course_);
}

// The controller halts before the page has read that the planner does so.
TEST_F(Planner, ItsOwnHaltDoesNotEndIt) {
  start("echo 'the ball is off its motion: halts it first'\ntouch '" + (folder_ / "told").string() +
        "'\nsleep 0.2\necho 'goes to (1, 0.5) m'\n");
  await("told");
  status_.mode = controller_status_t::MODE_HALTING;
  EXPECT_EQ(said(), (std::vector<std::string>{"the ball is off its motion: halts it first", "goes to (1, 0.5) m"}));
  EXPECT_TRUE(has_course_);
}

// The ball is lost on the way to a rest: lines that nobody waits for do not keep the ones that somebody does.
TEST_F(Planner, ALineOfAnyKindIsToldOnceAnotherFollows) {
  const std::string lost = "the ball has lost its course, at (0.2, 0) m", halts = "it is off: halts it first";
  start(std::string("echo '") + kWay + "'\necho '" + lost + "'\necho '" + halts + "'\ntouch '" +
        (folder_ / "told").string() + "'\nsleep 0.2\necho 'goes to (1, 0.5) m'\n");
  await("told");
  status_.mode = controller_status_t::MODE_HALTING;
  EXPECT_EQ(said(), (std::vector<std::string>{kWay, lost, halts, "goes to (1, 0.5) m"}));
  EXPECT_TRUE(has_course_);
}

// A halt before the ball sets out was the planner's own; one on the way is not.
TEST_F(Planner, AnothersHaltOnTheWayEndsIt) {
  start(std::string("echo 'it is off: halts it first'\necho '") + kWay + "'\ntouch '" + (folder_ / "told").string() +
        "'\nexec sleep 60\n");
  await("told");
  EXPECT_TRUE(go_.progress());
  EXPECT_TRUE(go_.progress());
  status_.mode = controller_status_t::MODE_HALTING;
  EXPECT_EQ(said(), (std::vector<std::string>{"dropped: the controller is halting"}));
}

TEST_F(Planner, AnothersHaltEndsIt) {
  start("exec sleep 60\n");
  status_.mode = controller_status_t::MODE_HALTING;
  EXPECT_EQ(said(), (std::vector<std::string>{"dropped: the controller is halting"}));
  EXPECT_EQ(go_.wish(), nullptr);
}

TEST_F(Planner, OneThatEndsWithoutAWordIsSaid) {
  start("kill -9 $$\n");
  const auto lines = said();
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0], "the planner ended: Killed");
  EXPECT_FALSE(obeyed_);
}

TEST_F(Planner, TheRunsEndEndsIt) {
  start("exec sleep 60\n");
  const auto answer = go_.poll(nullptr);
  ASSERT_TRUE(answer);
  EXPECT_SAYS(answer->text, "the run ended before the course was planned");
}

}  // namespace
}  // namespace ballast
