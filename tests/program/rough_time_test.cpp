#include "tools/program/rough_time.h"

#include <gtest/gtest.h>

namespace ballast::program {
namespace {

TEST(RoughTime, HasTheUnitByWhichAPersonPlans) {
  EXPECT_EQ(rough_time(0), "0 s");
  EXPECT_EQ(rough_time(61.4), "61 s");
  EXPECT_EQ(rough_time(119.9), "120 s");
  EXPECT_EQ(rough_time(120), "2 min");
  EXPECT_EQ(rough_time(7199), "120 min");
  EXPECT_EQ(rough_time(7200), "2 h");
  EXPECT_EQ(rough_time(300065), "83 h");
  EXPECT_EQ(rough_time(4e6), "46 days");
}

}  // namespace
}  // namespace ballast::program
