// Commands of operators elsewhere on the bus, as the live page tells them.
#include "tools/ballast/live_others.h"

#include <gtest/gtest.h>

#include <limits>

namespace ballast {
namespace {

constexpr std::int64_t kOwn = 7, kOther = 8;

operator_t command_of(std::int64_t sender, std::int64_t sequence, std::int8_t command) {
  operator_t message{};
  message.sender = sender;
  message.sequence = sequence;
  message.command = command;
  return message;
}

operator_t part_of(std::int64_t sender, std::int64_t sequence, std::int64_t course) {
  operator_t message = command_of(sender, sequence, operator_t::COMMAND_GO);
  message.course = course;
  return message;
}

TEST(LiveOthers, TellsEachCommandOnce) {
  LiveOthers others(kOwn);
  const controller_status_t status{};
  others.hear(command_of(kOwn, 1, operator_t::COMMAND_STOP), status);
  others.hear(command_of(0, 1, operator_t::COMMAND_START), status);  // the run's own
  EXPECT_TRUE(others.poll(status).empty());
  for (int copies = 0; copies < 3; ++copies)
    others.hear(command_of(kOther, std::numeric_limits<std::int64_t>::min(), operator_t::COMMAND_STOP), status);
  const auto said = others.poll(status);
  ASSERT_EQ(said.size(), 1u);
  EXPECT_EQ(said[0].text, "stop");
  EXPECT_FALSE(said[0].refused);
  EXPECT_TRUE(others.poll(status).empty());
}

TEST(LiveOthers, TellsACourseOnce) {
  LiveOthers others(kOwn);
  const controller_status_t status{};
  for (int k = 0; k < 5; ++k) others.hear(part_of(kOther, k, 3), status);
  EXPECT_EQ(others.poll(status).size(), 1u);
  others.hear(part_of(kOther, 9, 4), status);
  EXPECT_EQ(others.poll(status).size(), 1u);
}

TEST(LiveOthers, TellsTheRefusalOfWhatItHasTold) {
  LiveOthers others(kOwn);
  controller_status_t status{};
  status.mode = controller_status_t::MODE_RUNNING;
  others.hear(command_of(kOther, 1, operator_t::COMMAND_START), status);
  EXPECT_EQ(others.poll(status).size(), 1u);
  ++status.operator_commands;
  status.refusal = controller_status_t::REFUSAL_MODE;
  const auto said = others.poll(status);
  ASSERT_EQ(said.size(), 1u);
  EXPECT_TRUE(said[0].refused);
  EXPECT_EQ(said[0].text.rfind("the controller refuses the start: it is running", 0), 0u) << said[0].text;
  EXPECT_TRUE(others.poll(status).empty());
}

// However many messages come between two polls, and of however many senders.
TEST(LiveOthers, IsBounded) {
  LiveOthers others(kOwn);
  const controller_status_t status{};
  for (std::int64_t k = 0; k < 10'000; ++k) others.hear(command_of(100 + k, k, operator_t::COMMAND_STOP), status);
  EXPECT_LE(others.poll(status).size(), 16u);
}

// A sender is forgotten when 64 others have been heard, and its newest message is new again.
TEST(LiveOthers, RemembersTheLastSenders) {
  LiveOthers others(kOwn);
  const controller_status_t status{};
  const auto told = [&](std::int64_t sender) {
    others.hear(command_of(sender, 1, operator_t::COMMAND_STOP), status);
    return !others.poll(status).empty();
  };
  for (std::int64_t k = 0; k < 64; ++k) EXPECT_TRUE(told(100 + k));
  EXPECT_FALSE(told(100));
  EXPECT_TRUE(told(164));
  EXPECT_FALSE(told(164));
  EXPECT_TRUE(told(100));
}

// The answer of another run's command would be taken for that of one which was never counted.
TEST(LiveOthers, DoesNotWaitForAnAnswerInAnotherRun) {
  LiveOthers others(kOwn);
  controller_status_t status{};
  others.hear(command_of(kOther, 1, operator_t::COMMAND_START), status);
  EXPECT_EQ(others.poll(status).size(), 1u);
  status.run_id = 1;
  status.operator_commands = 3;
  status.refusal = controller_status_t::REFUSAL_MODE;
  EXPECT_TRUE(others.poll(status).empty());
}

}  // namespace
}  // namespace ballast
