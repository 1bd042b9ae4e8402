// Blocks of rows in files.
#include "tools/sweep/block.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tools/sweep/crc32.h"

namespace ballast::sweep {
namespace {

TEST(Crc32, GivesTheKnownAnswer) { EXPECT_EQ(crc32("123456789"), 0xCBF43926u); }

Block some_block() {
  RowResult row{17, 99, 3, {1.5, std::string("steel")}, {{}, std::vector<double>{1, -0.0, INFINITY}, std::string()}};
  RowResult next{18, 100, 0, {2.5, std::string("glass")}, {0.25, {}, std::string("completed")}};
  return {0x123456789abcdef0, 17, {row, next}};
}

TEST(Block, ComesBackAsItWas) {
  const Block block = some_block();
  const auto read = decoded(encoded(block));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->sweep, block.sweep);
  EXPECT_EQ(read->first_row, 17u);
  ASSERT_EQ(read->rows.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read->rows[i].number, block.rows[i].number);
    EXPECT_EQ(read->rows[i].seed, block.rows[i].seed);
    EXPECT_EQ(read->rows[i].exit_status, block.rows[i].exit_status);
    EXPECT_EQ(read->rows[i].varied, block.rows[i].varied);
    EXPECT_EQ(read->rows[i].kept, block.rows[i].kept);
  }
}

TEST(Block, IsRefusedIfAnyByteIsAnother) {
  const std::string bytes = encoded(some_block());
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    std::string damaged = bytes;
    damaged[i] = static_cast<char>(damaged[i] ^ 4);
    EXPECT_FALSE(decoded(damaged)) << "byte " << i;
  }
}

TEST(Block, IsRefusedIfItIsCutOff) {
  const std::string bytes = encoded(some_block());
  for (std::size_t size = 0; size < bytes.size(); ++size) EXPECT_FALSE(decoded(bytes.substr(0, size))) << size;
}

TEST(Block, ThatCannotBeWrittenIsAnError) {
  const std::string why = write_block("/proc/no-such-folder/block", some_block());
  EXPECT_NE(why.find("cannot be written: No such file or directory"), std::string::npos) << why;
}

}  // namespace
}  // namespace ballast::sweep
