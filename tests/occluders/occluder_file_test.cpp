#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <filesystem>
#include <limits>

#include <unistd.h>

#include "occluders/file.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

namespace ivis {
namespace {

using ::testing::HasSubstr;

OccluderSet example() {
  OccluderSet set;
  set.scene_hash = 0x0123456789abcdefULL;
  set.reach = Reach::cylinder(1.5, 0.1);
  set.slack_m = 0.0017;
  set.floor = -3.25;
  set.ground = {{-10, 1, -20}, {30, 2, 40}};
  set.view_space = {ViewSpace::Kind::kInside, {{1, 2, 3}, {0.1, -0.2, 1e-300}}};
  const Polygon holed{{{{0, 0}, {10, 0}, {10, 10}, {0, 10}}, {{4, 4}, {4, 6}, {6, 6}, {6, 4}}}};
  const Polygon triangle{{{{0.1, 0.2}, {1.0 / 3, 0}, {1, 1}}}};
  set.shrunk = {{holed, 0.2, 8.5, 0, true}, {triangle, 0.2, 9, 0, false}};
  set.solids = {{triangle, 0, 9, 0, false}};
  const FaceMesh tetrahedron{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                             {{0, 2, 1, 1}, {0, 1, 3, 3}, {0, 3, 2, 2}, {1, 2, 3, 3}}};
  const FaceMesh square{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2, 3}}};
  set.margins_m = {0.1, 0.25};
  set.prism_pieces = {{{{{triangle, 0.5, 7, 0, true}}, {}}}};
  set.solid_pieces = {{{tetrahedron, {}}, {{{0, -1, 0}, 0.5}}, {tetrahedron}},
                      {{tetrahedron}, {}, {}}};
  set.sheet_radii_m = {0.5};
  set.sheets = {{{0, 0.6, 0.8}, 3.5, {square}}};
  set.backings = {
      {3, {{0, 1, 0}, 2.5}, 0, 0}, {3, {{0.6, 0, 0.8}, -1}, 0.25, 3}, {7, {{1, 0, 0}, 0}, 1, 1}};
  set.height_field = {{-1, 2}, {0.5, 0.25}, 2, 3, {1, 2, 3, 4.5F, HeightField::kNone, 6}};
  set.convex_solids = {
      {{{{1, 0, 0}, 1}, {{-1, 0, 0}, 0}, {{0, 1, 0}, 2}, {{0, 0, 1}, 3}}, {{0, 0, 0}, {1, 2, 3}}}};
  set.closed_boxes = {{{0, 1, 2}, {3, 4, 5}}};
  set.sealed = true;
  return set;
}

Result<OccluderSet> decode(const std::string& bytes) {
  return decode_occluders(std::as_bytes(std::span(bytes)), "test.ivo");
}

/// After bytes were changed on purpose.
std::string with_right_checksum(std::string bytes) {
  std::string covered = bytes.substr(0, 24) + bytes.substr(32);
  const std::uint64_t sum = XXH3_64bits(covered.data(), covered.size());
  for (std::size_t i = 0; i < 8; ++i)
    bytes[24 + i] = static_cast<char>((sum >> (8 * i)) & 0xffU);
  return bytes;
}

void put(std::string& bytes, std::size_t at, std::uint64_t v, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i)
    bytes[at + i] = static_cast<char>((v >> (8 * i)) & 0xffU);
}

// Where FORMAT.md puts things in the example: header 32; hash, kind, 3 half-extents, slack, floor,
// ground, seeds.
constexpr std::size_t kReachKind = 32 + 8;
constexpr std::size_t kReachX = kReachKind + 1;
constexpr std::size_t kSlack = kReachX + 24;
constexpr std::size_t kHasGround = kSlack + 16;
constexpr std::size_t kSeedCount = kHasGround + 1 + 48 + 1;
constexpr std::size_t kPrismCount = kSeedCount + 8 + 2 * 24;
constexpr std::size_t kFirstPrism = kPrismCount + 8;
constexpr std::size_t kRingCount = kFirstPrism + 25;
constexpr std::size_t kCornerCount = kRingCount + 4;

TEST(OccluderFile, RoundTripKeepsEveryBit) {
  const std::string bytes = encode_occluders(example());
  const auto set = decode(bytes);
  ASSERT_TRUE(set);
  EXPECT_EQ(encode_occluders(*set), bytes);
  const OccluderSet& e = example();
  EXPECT_EQ(set->scene_hash, e.scene_hash);
  EXPECT_EQ(set->reach, e.reach);
  EXPECT_EQ(set->view_space.seeds, e.view_space.seeds);
  ASSERT_EQ(set->shrunk.size(), 2U);
  EXPECT_EQ(set->shrunk[0].footprint.rings, e.shrunk[0].footprint.rings);
  EXPECT_TRUE(set->shrunk[0].grounded);
  EXPECT_EQ(set->shrunk[1].top, 9);
  EXPECT_EQ(set->ground.hi, e.ground.hi);
  EXPECT_EQ(set->margins_m, e.margins_m);
  EXPECT_EQ(set->solid_pieces[0].levels[0].faces, e.solid_pieces[0].levels[0].faces);
  EXPECT_EQ(set->sheets[0].levels[0].points, e.sheets[0].levels[0].points);
  ASSERT_EQ(set->backings.size(), 3U);
  EXPECT_EQ(set->backings[1].object, 3U);
  EXPECT_EQ(set->backings[1].plane.normal, e.backings[1].plane.normal);
  EXPECT_EQ(set->backings[1].per_level, 0.25);
  EXPECT_EQ(set->backings[1].per_height, 3);
  EXPECT_EQ(set->height_field.heights, e.height_field.heights);
  EXPECT_EQ(set->convex_solids[0].planes[3].offset, 3);
  EXPECT_EQ(set->closed_boxes[0].hi, e.closed_boxes[0].hi);
  EXPECT_TRUE(set->sealed);
}

TEST(OccluderFile, KeepsEveryKindOfReachAndAnEmptyGround) {
  for (const Reach& r : {Reach::ball(1), Reach::disc(2), Reach::cylinder(1, 2),
                         Reach::ellipsoid({1, 2, 3}), Reach::box({3, 2, 1})}) {
    OccluderSet set;
    set.reach = r;
    const auto back = decode(encode_occluders(set));
    ASSERT_TRUE(back);
    EXPECT_EQ(back->reach, r);
    EXPECT_TRUE(back->ground.empty());
  }
}

TEST(OccluderFile, IsRefusedTruncatedAtEveryLength) {
  const std::string bytes = encode_occluders(example());
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_FALSE(decode(bytes.substr(0, n))) << n;
  EXPECT_FALSE(decode(bytes + '\0'));
}

TEST(OccluderFile, IsRefusedWithAnyBitFlipped) {
  const std::string bytes = encode_occluders(example());
  for (std::size_t i = 0; i < bytes.size(); ++i)
    for (unsigned bit = 0; bit < 8; ++bit) {
      std::string bad = bytes;
      bad[i] = static_cast<char>(static_cast<unsigned char>(bad[i]) ^ (1U << bit));
      EXPECT_FALSE(decode(bad)) << "byte " << i << " bit " << bit;
    }
}

TEST(OccluderFile, IsReadOrRefusedWithoutHarmWhenTheChecksumHidesTheDamage) {
  const std::string bytes = encode_occluders(example());
  for (std::size_t i = 32; i < bytes.size(); ++i)
    for (const int v : {0, 1, 0x7f, 0x80, 0xff}) {
      std::string bad = bytes;
      bad[i] = static_cast<char>(v);
      const auto set = decode(with_right_checksum(bad));
      if (!set) {
        EXPECT_FALSE(set.error().message.empty());
      }
    }
  for (std::size_t n = 32; n < bytes.size(); ++n) {
    std::string cut = bytes.substr(0, n);
    put(cut, 16, n - 32, 8);
    EXPECT_FALSE(decode(with_right_checksum(cut))) << n;
  }
}

TEST(OccluderFile, RefusesHugeCountsBeforeAllocating) {
  const std::string bytes = encode_occluders(example());
  const struct {
    std::size_t at, size;
    const char* field;
  } counts[] = {{kSeedCount, 8, "view space seeds"},
                {kPrismCount, 8, "shrunk prisms"},
                {kRingCount, 4, "rings of a prism"},
                {kCornerCount, 4, "corners of a ring"}};
  for (const auto& c : counts)
    for (const std::uint64_t huge :
         {std::uint64_t{1} << 20U, std::uint64_t{0xffffffffU}, ~std::uint64_t{0}}) {
      std::string bad = bytes;
      put(bad, c.at, huge, c.size);
      const auto set = decode(with_right_checksum(bad));
      ASSERT_FALSE(set) << c.field;
      EXPECT_EQ(set.error().code, ErrorCode::kInput);
      EXPECT_THAT(set.error().message, HasSubstr(c.field));
      EXPECT_THAT(set.error().message, HasSubstr("test.ivo"));
    }
}

TEST(OccluderFile, RefusesValuesOutOfTheirRange) {
  const std::string bytes = encode_occluders(example());
  const std::uint64_t nan = std::bit_cast<std::uint64_t>(std::numeric_limits<double>::quiet_NaN());
  const std::uint64_t infinity =
      std::bit_cast<std::uint64_t>(std::numeric_limits<double>::infinity());
  const std::uint64_t minus = std::bit_cast<std::uint64_t>(-1.0);
  const struct {
    std::size_t at;
    std::uint64_t value;
    std::size_t size;
  } changes[] = {{kReachKind, 5, 1},
                 {kReachX, nan, 8},
                 {kReachX, minus, 8},
                 {kReachX, std::bit_cast<std::uint64_t>(2.0), 8},
                 {kSlack, minus, 8},
                 {kHasGround, 2, 1},
                 {kHasGround + 1, infinity, 8},
                 {kFirstPrism, nan, 8},
                 {kFirstPrism, std::bit_cast<std::uint64_t>(2e9), 8},
                 {kFirstPrism, std::bit_cast<std::uint64_t>(9.0), 8},
                 {kFirstPrism + 24, 2, 1},
                 {kRingCount, 0, 4},
                 {kCornerCount, 2, 4},
                 {kCornerCount + 4, nan, 8},
                 {kSeedCount - 1, 2, 1}};
  for (const auto& c : changes) {
    std::string bad = bytes;
    put(bad, c.at, c.value, c.size);
    EXPECT_FALSE(decode(with_right_checksum(bad))) << "byte " << c.at;
  }
}

TEST(OccluderFile, RefusesPiecesThatDoNotFitTogether) {
  const auto refused = [](const char* field, const auto& change) {
    OccluderSet set = example();
    change(set);
    const auto back = decode(encode_occluders(set));
    ASSERT_FALSE(back) << field;
    EXPECT_THAT(back.error().message, HasSubstr(field));
  };
  refused("margins", [](OccluderSet& s) { s.margins_m = {0.25, 0.1}; });
  refused("margins", [](OccluderSet& s) { s.margins_m.assign(65, 1); });
  refused("levels", [](OccluderSet& s) { s.margins_m = {0.1}; });
  refused("levels", [](OccluderSet& s) { s.sheet_radii_m = {}; });
  refused("corner of a face", [](OccluderSet& s) { s.solid_pieces[0].levels[0].faces[1][2] = 4; });
  refused("normal of a sheet", [](OccluderSet& s) { s.sheets[0].normal = {0, 0.6, 0.7}; });
  refused("normal of a plane", [](OccluderSet& s) {
    s.convex_solids[0].planes[1].normal = {0, 0, 0};
  });
  refused("planes of a convex solid", [](OccluderSet& s) { s.convex_solids[0].planes.resize(3); });
  refused("box of a convex solid", [](OccluderSet& s) { s.convex_solids[0].bounds.lo.x = 2; });
  refused("closed box", [](OccluderSet& s) { s.closed_boxes[0].lo.y = 5; });
  refused("normal of a backing", [](OccluderSet& s) { s.backings[1].plane.normal.x = 0.5; });
  refused("object 7 has more than 6 backings",
          [](OccluderSet& s) { s.backings.insert(s.backings.end(), 6, s.backings[2]); });
  refused("a backing has a number", [](OccluderSet& s) { s.backings[1].per_height = -0.5; });
  refused("backing 2: object 2 after object 3", [](OccluderSet& s) { s.backings[2].object = 2; });
  refused("step of the height field", [](OccluderSet& s) { s.height_field.step.y = 0; });
  refused("cells of the height field",
          [](OccluderSet& s) { s.height_field.columns = s.height_field.rows = ~0U; });
  refused("height", [](OccluderSet& s) {
    s.height_field.heights[2] = std::numeric_limits<float>::infinity();
  });
}

TEST(OccluderFile, RefusesAnotherVersionAsAMismatch) {
  std::string bytes = encode_occluders(example());
  put(bytes, 8, 2, 4);
  const auto set = decode(with_right_checksum(bytes));
  ASSERT_FALSE(set);
  EXPECT_EQ(set.error().code, ErrorCode::kMismatch);
  EXPECT_THAT(set.error().message, HasSubstr("version 2"));
}

TEST(OccluderFile, OnlyServesItsOwnSceneAndReachesItContains) {
  const OccluderSet set = example();
  EXPECT_TRUE(check_occluders(set, set.scene_hash, set.reach, "f"));
  EXPECT_TRUE(check_occluders(set, set.scene_hash, Reach::disc(1), "f"));
  const auto other_scene = check_occluders(set, set.scene_hash + 1, set.reach, "f");
  ASSERT_FALSE(other_scene);
  EXPECT_EQ(other_scene.error().code, ErrorCode::kMismatch);
  const auto larger = check_occluders(set, set.scene_hash, Reach::cylinder(1.6, 0.1), "f");
  ASSERT_FALSE(larger);
  EXPECT_EQ(larger.error().code, ErrorCode::kMismatch);
  EXPECT_THAT(larger.error().message, HasSubstr("cylinder:1.6,0.1"));
}

TEST(OccluderFile, ServesAReachByTheSlackOfItsOwnSet) {
  // Padding scales an ellipsoid up as a whole: with much slack it outgrows the cylinder.
  OccluderSet set = example();
  set.reach = Reach::cylinder(1, 0.5);
  const Reach wanted = Reach::ellipsoid({0.95, 0.4, 0.95});
  for (const double slack_m : {0.001, 0.05}) {
    set.slack_m = slack_m;
    EXPECT_EQ(serves(set, wanted), slack_m < 0.01);
    EXPECT_EQ(check_occluders(set, set.scene_hash, wanted, "f").has_value(), slack_m < 0.01);
  }
}

TEST(OccluderFile, IsWrittenAndReadWholeAndAMissingOneIsNamed) {
  const auto file = std::filesystem::temp_directory_path() /
                    ("ivis_occluder_file_test_" + std::to_string(::getpid()) + ".ivo");
  ASSERT_TRUE(write_occluders(file, example()));
  const auto set = read_occluders(file);
  ASSERT_TRUE(set);
  EXPECT_EQ(encode_occluders(*set), encode_occluders(example()));
  std::filesystem::remove(file);
  const auto missing = read_occluders(file);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::kIo);
  EXPECT_THAT(missing.error().message, HasSubstr(file.string()));
}

}  // namespace
}  // namespace ivis
