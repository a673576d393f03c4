#include "occluders/fuse.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "occluders/clip.h"
#include "occluders/fast_erosion.h"

namespace ivis {
namespace {

using ::testing::SizeIs;

constexpr double kNoFloor = -1e9;

Prism box(const Vec2& lo, const Vec2& hi, double bottom, double top, bool grounded = false) {
  return {
      {{{{lo.x, lo.y}, {hi.x, lo.y}, {hi.x, hi.y}, {lo.x, hi.y}}}}, bottom, top, bottom, grounded};
}

double volume(const FusedStack& s) {
  double v = 0;
  double below = s.bottom;
  for (const FusedLevel& l : s.levels) {
    v += area(l.region) * (l.top - below);
    below = l.top;
  }
  return v;
}

bool in_stack(const FusedStack& s, const Vec3& p) {
  if (p.y < s.bottom) return false;
  for (const FusedLevel& l : s.levels)
    for (const Polygon& region : l.region)
      if (p.y < l.top && contains(region, ground(p))) return true;
  return false;
}

TEST(Fuse, WallsThatTouchErodeAsOne) {
  const auto stacks =
      fuse({box({0, 0}, {10, 10}, 0, 8), box({10, 2}, {20, 10}, 0, 8)}, kNoFloor, {}, {});
  ASSERT_THAT(stacks, SizeIs(1));
  ASSERT_THAT(stacks[0].levels, SizeIs(1));
  ASSERT_THAT(stacks[0].levels[0].region, SizeIs(1));
  EXPECT_NEAR(area(stacks[0].levels[0].region), 180, 1e-9);
  const auto eroded = FastEroder{}.erode(stacks[0].levels[0].region[0], Reach::disc(1));
  ASSERT_THAT(eroded, SizeIs(1));
  EXPECT_TRUE(contains(eroded[0], {10, 6}));  // on the party wall
}

TEST(Fuse, ASlitOfAMillimetreStaysOpen) {
  const auto stacks =
      fuse({box({0, 0}, {10, 10}, 0, 8), box({10.001, 0}, {20, 10}, 0, 8)}, kNoFloor, {}, {});
  EXPECT_THAT(stacks, SizeIs(2));
}

TEST(Fuse, CornersThatTouchInAPointDoNotJoinInTheErosion) {
  const auto stacks =
      fuse({box({0, 0}, {10, 10}, 0, 8), box({10, 10}, {20, 20}, 0, 8)}, kNoFloor, {}, {});
  double kept = 0;
  for (const FusedStack& s : stacks)
    for (const Polygon& region : s.levels[0].region)
      for (const Polygon& e : FastEroder{}.erode(region, Reach::disc(1))) {
        kept += area(e);
        EXPECT_FALSE(contains(e, {10, 10}));
      }
  EXPECT_NEAR(kept, 128, 1e-2);
}

TEST(Fuse, HigherNeighboursGiveNestedLevels) {
  const auto stacks =
      fuse({box({0, 0}, {10, 10}, 0, 8), box({10, 0}, {20, 10}, 0, 12)}, kNoFloor, {}, {});
  ASSERT_THAT(stacks, SizeIs(1));
  ASSERT_THAT(stacks[0].levels, SizeIs(2));
  EXPECT_EQ(stacks[0].levels[0].top, 8);
  EXPECT_NEAR(area(stacks[0].levels[0].region), 200, 1e-9);
  EXPECT_EQ(stacks[0].levels[1].top, 12);
  EXPECT_NEAR(area(stacks[0].levels[1].region), 100, 1e-9);
}

TEST(Fuse, ManyTopsAreRoundedDownToAFewLevels) {
  std::vector<Prism> row;
  for (int i = 0; i < 200; ++i)
    row.push_back(box({10.0 * i, 0}, {10.0 * i + 10, 10}, 0, 8 + 0.05 * i));
  FuseOptions options;
  options.level_loss = 0;
  const auto stacks = fuse(row, kNoFloor, options, {});
  ASSERT_THAT(stacks, SizeIs(1));
  EXPECT_LE(stacks[0].levels.size(), options.max_levels);
  double all = 0;
  for (const Prism& p : row)
    all += 100 * p.top;
  EXPECT_LE(volume(stacks[0]), all + 1e-6);
  EXPECT_GE(volume(stacks[0]), 0.95 * all);
}

TEST(Fuse, RealBottomsFuseFromTheHighestBaseUpAndOnlyWhenNear) {
  const auto near =
      fuse({box({0, 0}, {10, 10}, 0, 8), box({10, 0}, {20, 10}, 0.5, 8)}, kNoFloor, {}, {});
  ASSERT_THAT(near, SizeIs(1));
  EXPECT_EQ(near[0].bottom, 0.5);
  EXPECT_THAT(fuse({box({0, 0}, {10, 10}, 0, 8), box({10, 0}, {20, 10}, 3, 11)}, kNoFloor, {}, {}),
              SizeIs(2));
}

TEST(Fuse, ASlabThatFloatsDoesNotFuseWithTheBuildingUnderIt) {
  const auto stacks =
      fuse({box({0, 0}, {10, 10}, 0, 4), box({0, 0}, {30, 10}, 6, 7)}, kNoFloor, {}, {});
  EXPECT_THAT(stacks, SizeIs(2));
}

TEST(Fuse, GroundedMembersFuseWhateverTheirBases) {
  const auto stacks = fuse({box({0, 0}, {10, 10}, 0, 8, true), box({10, 0}, {20, 10}, 5, 11, true)},
                           kNoFloor, {}, {});
  ASSERT_THAT(stacks, SizeIs(1));
  EXPECT_TRUE(stacks[0].grounded);
  EXPECT_EQ(stacks[0].bottom, 5);
}

TEST(Fuse, KindsOfBottomsAreNeverMixed) {
  const auto stacks = fuse({box({0, 0}, {10, 10}, 0, 8, true), box({10, 0}, {20, 10}, 0, 8),
                            box({20, 0}, {30, 10}, 0.2, 8)},
                           0, {}, {});
  ASSERT_THAT(stacks, SizeIs(3));
  int grounded = 0;
  for (const FusedStack& s : stacks)
    grounded += s.grounded ? 1 : 0;
  EXPECT_EQ(grounded, 1);
}

TEST(Fuse, NeverFillsWhatNoMemberFills) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> u(0, 1);
  for (int round = 0; round < 30; ++round) {
    std::vector<Prism> prisms;
    for (int i = 0; i < 40; ++i) {
      const Vec2 lo = snap({60 * u(rng), 60 * u(rng)});
      const double bottom = u(rng) < 0.7 ? 0.9 * u(rng) : 5 * u(rng);
      prisms.push_back(
          box(lo, lo + snap({2 + 8 * u(rng), 2 + 8 * u(rng)}), bottom, bottom + 1 + 12 * u(rng)));
    }
    const auto stacks = fuse(prisms, kNoFloor, {}, {});
    for (int i = 0; i < 2000; ++i) {
      const Vec3 p{70 * u(rng), 18 * u(rng), 70 * u(rng)};
      bool fused = false;
      for (const FusedStack& s : stacks)
        fused = fused || in_stack(s, p);
      if (!fused) continue;
      bool solid = false;
      for (const Prism& q : prisms)
        solid = solid || (p.y >= q.bottom && p.y <= q.top && contains(q.footprint, ground(p)));
      ASSERT_TRUE(solid) << p.x << ' ' << p.y << ' ' << p.z;
    }
  }
}

}  // namespace
}  // namespace ivis
