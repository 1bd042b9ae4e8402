// Who runs where while two processes take turns.
#include "tools/qemu/turns.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <optional>

namespace ballast::sil {
namespace {

cpu_set_t processors_of(pid_t process) {
  cpu_set_t processors{};
  EXPECT_EQ(sched_getaffinity(process, sizeof processors, &processors), 0);
  return processors;
}

// A process that waits, and this thread's processors as they were.
class TurnsTest : public testing::Test {
 protected:
  TurnsTest() : before_(processors_of(0)) {
    turns_.emplace();
    turns_->start();
    process_ = fork();
    if (process_ == 0) {
      for (;;) pause();
    }
  }
  ~TurnsTest() override {
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
  void SetUp() override {
    ASSERT_GT(process_, 0);
    if (CPU_COUNT(&before_) < 2) GTEST_SKIP() << "takes two processors";
  }
  [[nodiscard]] bool are_together() const {
    const cpu_set_t here = processors_of(0), there = processors_of(process_);
    return CPU_COUNT(&here) == 1 && CPU_EQUAL(&here, &there);
  }
  void miss(int times) {
    for (int i = 0; i < times; ++i) turns_->did_not_come();
  }
  static constexpr int kMisses = Turns::kTooOften / Turns::kForgiven;

  cpu_set_t before_{};
  std::optional<Turns> turns_;
  pid_t process_ = 0;
};

TEST_F(TurnsTest, ApartEachHasAProcessorOfItsOwn) {
  EXPECT_FALSE(turns_->apart());
  EXPECT_TRUE(are_together());
  turns_->take_with(process_);
  EXPECT_TRUE(turns_->apart());
  const cpu_set_t there = processors_of(process_), here = processors_of(0);
  EXPECT_EQ(CPU_COUNT(&there), CPU_COUNT(&before_) - 1);
  EXPECT_TRUE(CPU_EQUAL(&here, &before_));
  turns_.reset();
  const cpu_set_t after = processors_of(0);
  EXPECT_TRUE(CPU_EQUAL(&after, &before_));
}

TEST_F(TurnsTest, MessagesThatAreLateOneAfterTheOtherBringThemTogetherForAWhile) {
  turns_->take_with(process_);
  for (int together_for = Turns::kShortestTogether; together_for <= 4 * Turns::kShortestTogether; together_for *= 2) {
    miss(kMisses - 1);
    EXPECT_TRUE(turns_->apart());
    miss(1);
    EXPECT_FALSE(turns_->apart());
    EXPECT_TRUE(are_together());
    for (int i = 0; i < together_for - 1; ++i) turns_->wait_together();
    EXPECT_FALSE(turns_->apart());
    turns_->wait_together();
    EXPECT_TRUE(turns_->apart());
    EXPECT_FALSE(are_together());
  }
  // All went well for long: what was before is forgotten.
  for (int i = 0; i < Turns::kLongApart; ++i) turns_->came();
  miss(kMisses);
  for (int i = 0; i < Turns::kShortestTogether; ++i) turns_->wait_together();
  EXPECT_TRUE(turns_->apart());
}

TEST_F(TurnsTest, ALateMessageNowAndThenChangesNothing) {
  turns_->take_with(process_);
  for (int i = 0; i < 100; ++i) {
    miss(1);
    for (int k = 0; k < Turns::kForgiven; ++k) turns_->came();
  }
  EXPECT_TRUE(turns_->apart());
}

TEST_F(TurnsTest, TheTimeTogetherHasAnEnd) {
  turns_->take_with(process_);
  for (int i = 0; i < 20; ++i) {
    miss(kMisses);
    int turns = 0;
    for (; !turns_->apart(); ++turns) turns_->wait_together();
    EXPECT_LE(turns, Turns::kLongestTogether);
  }
}

// Nobody is apart who has one processor.
TEST(Turns, OnOneProcessor) {
  const cpu_set_t before = processors_of(0);
  cpu_set_t one{};
  CPU_SET(static_cast<std::size_t>(sched_getcpu()), &one);
  ASSERT_EQ(sched_setaffinity(0, sizeof one, &one), 0);
  {
    Turns turns;
    turns.start();
    turns.take_with(getpid());
    EXPECT_FALSE(turns.apart());
    for (int i = 0; i < 3 * Turns::kShortestTogether; ++i) turns.wait_together();
    EXPECT_FALSE(turns.apart());
  }
  ASSERT_EQ(sched_setaffinity(0, sizeof before, &before), 0);
}

// A process that is gone is nobody's fault here.
TEST(Turns, AProcessThatIsGone) {
  Turns turns;
  turns.start();
  const pid_t gone = fork();
  if (gone == 0) _exit(0);
  ASSERT_EQ(waitpid(gone, nullptr, 0), gone);
  turns.take_with(gone);
  for (int i = 0; i < Turns::kTooOften / Turns::kForgiven; ++i) turns.did_not_come();
  EXPECT_FALSE(turns.apart());
}

}  // namespace
}  // namespace ballast::sil
