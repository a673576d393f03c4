#include "wire/object_table.h"

#include <numeric>

#include <gtest/gtest.h>
#include <zstd.h>

#include "made_up.h"

namespace ivis::wire {
namespace {

ObjectTable shuffled(std::uint32_t n, bool instanced) {
  ObjectTable t;
  t.id.resize(n);
  std::iota(t.id.begin(), t.id.end(), 0U);
  test::Numbers numbers(n);
  for (std::uint32_t i = n; i > 1; --i)
    std::swap(t.id[i - 1], t.id[numbers.below(i)]);
  for (const ObjectId id : t.id) {
    t.node.push_back(instanced ? 7 : 2 * id + 1);
    t.instance.push_back(instanced ? id : 0);
  }
  return t;
}

std::vector<std::uint8_t> frame_of(const std::vector<std::uint8_t>& raw) {
  std::vector<std::uint8_t> frame(ZSTD_compressBound(raw.size()));
  frame.resize(ZSTD_compress(frame.data(), frame.size(), raw.data(), raw.size(), 1));
  return frame;
}

std::string error_of(const std::vector<std::uint8_t>& frame, std::uint32_t objects) {
  const auto t = unpack_table(frame, objects);
  return t ? std::string("no error") : t.error().message;
}

TEST(ObjectTable, ReturnsWhatWasPacked) {
  for (const std::uint32_t n : {0U, 1U, 2U, 64U, 1000U, 100000U}) {
    for (const bool instanced : {false, true}) {
      const ObjectTable table = shuffled(n, instanced);
      const auto back = unpack_table(pack_table(table), n);
      ASSERT_TRUE(back) << n << ": " << back.error().message;
      EXPECT_EQ(*back, table) << n;
    }
  }
}

TEST(ObjectTable, KeepsNumbersThatFillTheirWord) {
  ObjectTable table{{1, 0, 2}, {0xffffffffU, 0, 0x80000000U}, {0, 0xffffffffU, 1}};
  const auto back = unpack_table(pack_table(table), 3);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(*back, table);
}

TEST(ObjectTable, KeepsClustersAndSpendsNothingOnTheirAbsence) {
  ObjectTable table = shuffled(500, false);
  const auto without = pack_table(table);
  EXPECT_EQ(ZSTD_getFrameContentSize(without.data(), without.size()), 500U * 12);
  for (const ObjectId id : table.id)
    table.cluster.push_back(id % 7);
  const auto frame = pack_table(table);
  EXPECT_EQ(ZSTD_getFrameContentSize(frame.data(), frame.size()), 500U * 16);
  const auto back = unpack_table(frame, 500);
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(*back, table);
}

TEST(ObjectTable, RejectsMoreClustersThanAMessageHasRoomFor) {
  const std::uint32_t n = kMaxClusters + 1;
  const auto frame = frame_of(std::vector<std::uint8_t>(16 * std::size_t{n}));
  EXPECT_NE(error_of(frame, n).find("expected " + std::to_string(12 * std::size_t{n})),
            std::string::npos);
}

// Only the permutation costs bytes: for 100,000 random ids that is 17 bits each.
TEST(ObjectTable, SpendsItsBytesOnTheOrderAlone) {
  EXPECT_LT(pack_table(shuffled(100000, true)).size(), 100000U * 20 / 8);
}

TEST(ObjectTable, RejectsTruncationAndTrailingBytes) {
  const auto frame = pack_table(shuffled(200, false));
  for (std::size_t n = 0; n < frame.size(); ++n)
    EXPECT_FALSE(unpack_table(std::span(frame).first(n), 200)) << n;
  auto longer = frame;
  longer.push_back(0);
  EXPECT_FALSE(unpack_table(longer, 200));
  auto twice = frame;
  twice.insert(twice.end(), frame.begin(), frame.end());
  EXPECT_NE(error_of(twice, 200).find("left over"), std::string::npos);
}

TEST(ObjectTable, RejectsAFrameOfAnotherSizeBeforeOpeningIt) {
  const auto frame = pack_table(shuffled(200, false));
  for (const std::uint32_t n : {0U, 199U, 201U, 5000000U})
    EXPECT_NE(error_of(frame, n).find("expected"), std::string::npos) << n;
}

// 100 MB of zeros in 10 KB: refused by its stated size, and when it lies about that, by zstd.
TEST(ObjectTable, RejectsABomb) {
  auto bomb = frame_of(std::vector<std::uint8_t>(100U << 20U));
  ASSERT_LT(bomb.size(), 20000U);
  EXPECT_NE(error_of(bomb, 100).find("holds 104857600 bytes, expected 1200"), std::string::npos);
  // Frame header: magic, descriptor (4-byte content size, single segment), the size itself.
  const std::uint32_t lie = 1200;
  ASSERT_EQ(bomb[4] >> 6U, 2U);
  const std::size_t at = (bomb[4] & 0x20U) != 0 ? 5 : 6;
  for (std::size_t k = 0; k < 4; ++k)
    bomb[at + k] = static_cast<std::uint8_t>(lie >> (8 * k));
  EXPECT_FALSE(unpack_table(bomb, 100));
}

TEST(ObjectTable, RejectsAFrameThatDoesNotStateItsSize) {
  std::vector<std::uint8_t> raw(1200), frame(ZSTD_compressBound(raw.size()));
  ZSTD_CCtx* context = ZSTD_createCCtx();
  ZSTD_CCtx_setParameter(context, ZSTD_c_contentSizeFlag, 0);
  frame.resize(ZSTD_compress2(context, frame.data(), frame.size(), raw.data(), raw.size()));
  ZSTD_freeCCtx(context);
  EXPECT_NE(error_of(frame, 100).find("states its size"), std::string::npos);
}

TEST(ObjectTable, RejectsIdsThatAreNoPermutation) {
  // All differences 0: every rank is object 0.
  EXPECT_NE(error_of(frame_of(std::vector<std::uint8_t>(36)), 3).find("taken"), std::string::npos);
  std::vector<std::uint8_t> raw(36);
  raw[0] = 6;  // the first id is 3 of 3
  EXPECT_NE(error_of(frame_of(raw), 3).find("not below 3"), std::string::npos);
}

TEST(ObjectTable, TakesFlippedBitsForAnErrorOrASoundTable) {
  const auto frame = pack_table(shuffled(300, false));
  for (std::size_t bit = 0; bit < 8 * frame.size(); ++bit) {
    auto bytes = frame;
    bytes[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    const auto table = unpack_table(bytes, 300);
    if (!table) continue;
    ASSERT_EQ(table->id.size(), 300U);
    for (const ObjectId id : table->id)
      ASSERT_LT(id, 300U);
  }
}

}  // namespace
}  // namespace ivis::wire
