#include "wire/pvs_codec.h"

#include <bit>
#include <deque>
#include <vector>

#include <gtest/gtest.h>

#include "made_up.h"
#include "spec_decoder.h"

namespace ivis::wire {
namespace {

constexpr std::uint32_t kSizes[] = {0, 1, 31, 32, 33, 63, 64, 65, 511, 512, 513, 5000, 100000};

std::vector<RankSet> sets_of(std::uint32_t size) {
  test::Numbers numbers(size);
  std::vector<RankSet> sets{RankSet(size), test::full_set(size)};
  if (size == 0) return sets;
  for (const std::uint32_t one_in : {2U, 10U, 1000U})
    sets.push_back(test::random_set(size, one_in, numbers));
  sets.push_back(test::Walk(size, size / 200 + 1, size).step());
  for (const Rank r : {0U, size / 2, size - 1}) {
    RankSet one(size);
    one.set(r);
    sets.push_back(one);
  }
  return sets;
}

std::vector<bool> bits_of(const RankSet& set) {
  std::vector<bool> bits(set.size);
  for (Rank r = 0; r < set.size; ++r)
    bits[r] = set.test(r);
  return bits;
}

TEST(PvsCodec, ReturnsEverySetAgainstEveryBase) {
  for (const std::uint32_t size : kSizes) {
    const auto sets = sets_of(size);
    for (const RankSet& first : sets) {
      PvsState base(size);
      encode_pvs(first, PvsState(size), base);
      for (const RankSet& second : sets) {
        PvsState after;
        const auto bytes = encode_pvs(second, base, after);
        const auto decoded = decode_pvs(bytes, base);
        ASSERT_TRUE(decoded) << size << ": " << decoded.error().message;
        ASSERT_EQ(decoded->set, second) << size;
        ASSERT_EQ(*decoded, after) << size;
        ASSERT_EQ(after.before, first) << size;
      }
    }
  }
}

TEST(PvsCodec, KeepsBothEndsAlikeOverThreeHundredMessages) {
  constexpr std::uint32_t kObjects = 20000;
  test::Walk walk(kObjects, 40, 1);
  PvsState server(kObjects), client(kObjects);
  for (int i = 0; i < 300; ++i) {
    const auto bytes = encode_pvs(walk.step(), server, server);  // base and after may be one
    auto decoded = decode_pvs(bytes, client);
    ASSERT_TRUE(decoded) << i << ": " << decoded.error().message;
    client = std::move(*decoded);
    ASSERT_EQ(client, server) << i;
  }
}

// Answers are lost and acknowledgements late, so bases are of any age.
TEST(PvsCodec, CodesAgainstAnyBaseThatBothEndsHold) {
  constexpr std::uint32_t kObjects = 20000;
  test::Walk walk(kObjects, 40, 2);
  test::Numbers numbers(3);
  std::deque<std::pair<PvsState, PvsState>> held{{PvsState(kObjects), PvsState(kObjects)}};
  for (int i = 0; i < 300; ++i) {
    const auto& [server, client] = held[numbers.below(static_cast<std::uint32_t>(held.size()))];
    PvsState after;
    const RankSet set = walk.step();
    const auto bytes = encode_pvs(set, server, after);
    auto decoded = decode_pvs(bytes, client);
    ASSERT_TRUE(decoded) << i;
    ASSERT_EQ(decoded->set, set) << i;
    if (numbers.one_in(3)) continue;
    held.emplace_back(std::move(after), std::move(*decoded));
    if (held.size() > 6) held.pop_front();
  }
}

TEST(PvsCodec, IsReadByADecoderWrittenFromTheSpecification) {
  for (const std::uint32_t size : kSizes) {
    PvsState base(size);
    test::SpecState spec(size);
    for (const RankSet& set : sets_of(size)) {
      const auto bytes = encode_pvs(set, base, base);
      const auto decoded = test::spec_decode(bytes, spec);
      ASSERT_TRUE(decoded) << size;
      ASSERT_EQ(decoded->set, bits_of(set)) << size;
      spec = *decoded;
    }
  }
}

TEST(PvsCodec, LeavesItsInputsAloneAndGivesTheSameBytesAgain) {
  test::Walk walk(3000, 20, 4);
  PvsState base(3000);
  encode_pvs(walk.step(), base, base);
  const PvsState copy = base;
  const RankSet set = walk.step();
  PvsState one, two;
  EXPECT_EQ(encode_pvs(set, base, one), encode_pvs(set, base, two));
  EXPECT_EQ(one, two);
  EXPECT_EQ(base, copy);
}

TEST(PvsCodec, SpendsFewBytesOnAStreetWalk) {
  constexpr std::uint32_t kObjects = 100000;
  test::Walk walk(kObjects, 120, 5);
  PvsState state(kObjects);
  std::size_t bytes = 0, changed = 0;
  for (int i = 0; i < 100; ++i) {
    const RankSet set = walk.step();
    for (std::size_t w = 0; w < set.words.size(); ++w)
      changed += static_cast<std::size_t>(std::popcount(set.words[w] ^ state.set.words[w]));
    bytes += encode_pvs(set, state, state).size();
  }
  EXPECT_LT(8 * bytes, 5 * changed) << bytes << " bytes for " << changed << " changes";
}

TEST(PvsCodec, SpendsAlmostNothingOnASetThatStays) {
  constexpr std::uint32_t kObjects = 100000;
  const RankSet set = test::Walk(kObjects, 120, 6).step();
  PvsState state(kObjects);
  for (int i = 0; i < 10; ++i)
    encode_pvs(set, state, state);
  EXPECT_LE(encode_pvs(set, state, state).size(), 8U);
}

// ---- hostile bytes ----

bool spare_bits_are_zero(const RankSet& set) {
  return set.size % 64 == 0 || set.words.back() >> (set.size % 64) == 0;
}

struct Coded {
  PvsState base, after;
  std::vector<std::byte> bytes;
};

Coded coded(std::uint32_t objects, std::uint64_t seed) {
  test::Walk walk(objects, objects / 100 + 1, seed);
  Coded c{PvsState(objects), PvsState(objects), {}};
  encode_pvs(walk.step(), c.base, c.base);
  c.bytes = encode_pvs(walk.step(), c.base, c.after);
  return c;
}

TEST(PvsDecoder, RejectsTruncationAtEveryLength) {
  const Coded c = coded(5000, 7);
  ASSERT_GT(c.bytes.size(), 30U);
  for (std::size_t n = 0; n < c.bytes.size(); ++n)
    EXPECT_FALSE(decode_pvs(std::span(c.bytes).first(n), c.base)) << n;
}

TEST(PvsDecoder, RejectsTrailingBytes) {
  const Coded c = coded(5000, 8);
  for (const int value : {0, 1, 255}) {
    for (const std::size_t more : {1U, 2U, 8U, 1000U}) {
      auto longer = c.bytes;
      longer.insert(longer.end(), more, static_cast<std::byte>(value));
      EXPECT_FALSE(decode_pvs(longer, c.base)) << value << " x " << more;
    }
  }
}

// Zeros are what a decoder reads behind the end, so only the count of bytes tells these.
TEST(PvsDecoder, RejectsBytesBehindZeros) {
  const Coded c = coded(5000, 8);
  for (std::size_t zeros = 1; zeros < 12; ++zeros) {
    auto longer = c.bytes;
    longer.insert(longer.end(), zeros, std::byte{0});
    longer.push_back(std::byte{1});
    EXPECT_FALSE(decode_pvs(longer, c.base)) << zeros;
  }
}

// A set has one payload against a base. All codes of up to two bytes are tried, each with the check
// that its set would have.
TEST(PvsDecoder, TakesOnlyWhatAnEncoderWrites) {
  constexpr std::uint32_t kObjects = 40;
  int taken = 0;
  for (std::uint32_t code = 0; code < 65536; ++code) {
    std::vector<std::byte> bytes{
        {}, {}, static_cast<std::byte>(code >> 8U), static_cast<std::byte>(code)};
    while (bytes.size() > 2 && bytes.back() == std::byte{0})
      bytes.pop_back();
    const auto decoded =
        test::spec_decode(bytes, test::SpecState(kObjects), test::SpecCheck::kIgnore);
    if (!decoded) continue;
    ++taken;
    RankSet set(kObjects);
    for (Rank r = 0; r < kObjects; ++r)
      if (decoded->set[r]) set.set(r);
    PvsState after;
    const auto written = encode_pvs(set, PvsState(kObjects), after);
    bytes[0] = written[0];
    bytes[1] = written[1];
    ASSERT_EQ(written, bytes) << code;
    ASSERT_TRUE(decode_pvs(bytes, PvsState(kObjects))) << code;
  }
  EXPECT_GT(taken, 40);
}

TEST(PvsDecoder, SaysWhatIsWrong) {
  const Coded c = coded(5000, 9);
  const auto message = [&](std::vector<std::byte> bytes, const PvsState& base) {
    const auto r = decode_pvs(bytes, base);
    return r ? std::string("no error") : r.error().message;
  };
  auto zero = c.bytes;
  zero.push_back(std::byte{0});
  auto longer = c.bytes;
  longer.insert(longer.end(), 100, std::byte{1});
  auto flipped = c.bytes;
  flipped[0] ^= std::byte{1};
  EXPECT_EQ(message({}, c.base), "pvs: 0 bytes, at least 2");
  EXPECT_NE(message(zero, c.base).find("does not end"), std::string::npos);
  EXPECT_NE(message(longer, c.base).find("bytes left over"), std::string::npos);
  EXPECT_NE(message(flipped, c.base).find("another base"), std::string::npos);
}

// Two ends that disagree about the base must not go on as if they agreed.
TEST(PvsDecoder, RejectsADifferenceToAnotherBase) {
  int wrong = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const Coded c = coded(2000, 100 + seed);
    PvsState other = c.base;
    const Rank r = static_cast<Rank>(seed * 9 % 2000);
    other.set.words[r >> 6U] ^= std::uint64_t{1} << (r & 63U);
    if (decode_pvs(c.bytes, other)) ++wrong;
    EXPECT_FALSE(decode_pvs(c.bytes, PvsState(2000)) && c.base.set.count() != 0) << seed;
    EXPECT_FALSE(decode_pvs(c.bytes, PvsState(2001))) << seed;
  }
  EXPECT_EQ(wrong, 0);
}

TEST(PvsDecoder, TakesFlippedBitsForAnErrorOrASoundSet) {
  int taken = 0;
  for (const std::uint32_t objects : {70U, 5000U}) {
    const Coded c = coded(objects, 10);
    for (std::size_t bit = 0; bit < 8 * c.bytes.size(); ++bit) {
      auto bytes = c.bytes;
      bytes[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
      const auto decoded = decode_pvs(bytes, c.base);
      if (!decoded) continue;
      ++taken;
      ASSERT_EQ(decoded->set.size, objects);
      ASSERT_TRUE(spare_bits_are_zero(decoded->set)) << objects;
    }
  }
  EXPECT_LE(taken, 1);
}

TEST(PvsDecoder, TakesGarbageForAnErrorOrASoundSet) {
  test::Numbers numbers(11);
  int taken = 0;
  for (int i = 0; i < 5000; ++i) {
    const std::uint32_t objects = numbers.below(3000);
    std::vector<std::byte> bytes(numbers.below(200));
    for (std::byte& b : bytes)
      b = static_cast<std::byte>(numbers.below(256));
    const auto decoded = decode_pvs(bytes, PvsState(objects));
    if (!decoded) continue;
    ++taken;
    ASSERT_EQ(decoded->set.size, objects);
    ASSERT_TRUE(spare_bits_are_zero(decoded->set)) << objects;
  }
  EXPECT_LE(taken, 5);
}

}  // namespace
}  // namespace ivis::wire
