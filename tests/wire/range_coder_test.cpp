#include "wire/range_coder.h"

#include <vector>

#include <gtest/gtest.h>

#include "made_up.h"

namespace ivis::wire {
namespace {

std::vector<bool> coin(std::uint32_t bits, std::uint32_t one_in, std::uint64_t seed) {
  test::Numbers numbers(seed);
  std::vector<bool> out;
  for (std::uint32_t i = 0; i < bits; ++i)
    out.push_back(numbers.one_in(one_in));
  return out;
}

std::vector<std::byte> code(const std::vector<bool>& bits) {
  BitEncoder encoder;
  AdaptiveBit p;
  for (const bool b : bits)
    encoder.code(p, b);
  return encoder.finish();
}

TEST(RangeCoder, ReturnsTheBitsItWasGiven) {
  for (const std::uint32_t one_in : {1U, 2U, 3U, 100U, 100000U}) {
    for (const std::uint32_t count : {0U, 1U, 2U, 7U, 8U, 33U, 1000U, 100000U}) {
      const auto bits = coin(count, one_in, count + one_in);
      const auto bytes = code(bits);
      BitDecoder decoder(bytes);
      AdaptiveBit p;
      for (std::size_t i = 0; i < bits.size(); ++i)
        ASSERT_EQ(decoder.code(p), bits[i]) << one_in << " " << count << " " << i;
      EXPECT_TRUE(decoder.ends_well());
    }
  }
}

// The only place where low and high keep apart in their top byte for long: the interval closes
// around 0x80000000 and the coder must still tell its two parts apart.
TEST(RangeCoder, SurvivesAnIntervalThatStraddlesAByte) {
  Interval i;
  i.low = 0x7fffffffU;
  i.high = 0x80000000U;
  ASSERT_FALSE(i.settled());
  for (const std::uint32_t p : {1U, 32768U, 65535U}) {
    const std::uint32_t at = i.split(p);
    EXPECT_GE(at, i.low);
    EXPECT_LT(at, i.high);
  }
}

TEST(RangeCoder, ComesNearTheEntropy) {
  // 100,000 bits, one in a hundred set: 8,079 bits of entropy. A window of sixty costs some on
  // them.
  EXPECT_LT(code(coin(100000, 100, 1)).size(), 8079 / 8 * 112 / 100);
  EXPECT_LT(code(coin(100000, 2, 1)).size(), 100000 / 8 * 102 / 100);
}

TEST(RangeCoder, EndsWithoutZeroBytes) {
  for (std::uint32_t count = 0; count < 300; ++count) {
    const auto bytes = code(coin(count, 3, count));
    EXPECT_TRUE(bytes.empty() || bytes.back() != std::byte{0}) << count;
  }
}

TEST(RangeCoder, ReadsZerosBehindItsEndAndCountsWhatItDidNotRead) {
  const std::vector<std::byte> bytes(10, std::byte{7});
  BitDecoder decoder(bytes);
  EXPECT_EQ(decoder.unread(), 6U);
  for (int i = 0; i < 1000; ++i) {
    AdaptiveBit even;
    decoder.code(even);
  }
  EXPECT_EQ(decoder.unread(), 0U);
}

TEST(AdaptiveBit, StaysWithinItsRange) {
  for (const bool b : {false, true}) {
    AdaptiveBit p;
    for (int i = 0; i < 100000; ++i) {
      p.update(b);
      ASSERT_GE(p.p16(), 1U);
      ASSERT_LE(p.p16(), 65535U);
    }
    EXPECT_EQ(p.p16() > 32768U, b);
  }
}

}  // namespace
}  // namespace ivis::wire
