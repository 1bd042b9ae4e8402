// The encoder of hal/lcm/encode.h against those that lcm-gen writes.
#include "hal/lcm/encode.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <vector>

#include "tests/random_seed.h"

namespace ballast::hal {
namespace {

template <class M>
class Encode : public ::testing::Test {};

using Messages =
    ::testing::Types<contact_t, controller_status_t, operator_t, plant_state_t, sensors_t, step_command_t, trip_t>;
TYPED_TEST_SUITE(Encode, Messages);

// Every bit of every field is random, NaNs that signal included.
template <class M>
M random_bits(std::mt19937_64& random) {
  M message;
  std::vector<unsigned char> bytes(sizeof message);
  for (unsigned char& byte : bytes) byte = static_cast<unsigned char>(random());
  std::memcpy(&message, bytes.data(), sizeof message);
  return message;
}

TYPED_TEST(Encode, GivesTheBytesOfLcm) {
  std::mt19937_64 random(ballast::test::random_seed(20261123));
  for (int trial = 0; trial < 1000; ++trial) {
    const TypeParam message = random_bits<TypeParam>(random);
    const auto size = static_cast<std::size_t>(message.getEncodedSize());
    ASSERT_EQ(encoded_size(message), size);
    std::vector<char> expected(size), found(size);
    ASSERT_EQ(message.encode(expected.data(), 0, static_cast<int>(size)), static_cast<int>(size));
    encode(message, found.data());
    ASSERT_EQ(found, expected) << "trial " << trial;
  }
}

// Nothing is written beyond the size.
TYPED_TEST(Encode, WritesNoFurther) {
  const TypeParam message{};
  std::vector<char> bytes(encoded_size(message) + 16, 'x');
  encode(message, bytes.data());
  for (std::size_t i = encoded_size(message); i < bytes.size(); ++i) EXPECT_EQ(bytes[i], 'x') << i;
}

}  // namespace
}  // namespace ballast::hal
