#include "occluders/fast_erosion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "occluders/clip.h"
#include "occluders/distance_check.h"
#include "occluders/simplify.h"

namespace ivis {
namespace {

const std::vector<Reach>& all_reaches() {
  static const std::vector<Reach> reaches{Reach::ball(1.2), Reach::disc(1),
                                          Reach::cylinder(1.5, 0.1), Reach::ellipsoid({2, 1, 0.7}),
                                          Reach::box({1.5, 0.2, 0.6})};
  return reaches;
}

Polygon square(double side) {
  return {{{{0, 0}, {side, 0}, {side, side}, {0, side}}}};
}

/// A star-shaped, jagged ring; reflex corners of all angles.
Polygon jagged(unsigned seed, double radius, const Vec2& at, std::size_t corners = 24) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> u(0.35, 1);
  Ring ring;
  for (std::size_t i = 0; i < corners; ++i) {
    const double a = 2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(corners);
    ring.push_back(snap(at + Vec2{std::cos(a), std::sin(a)} * (radius * u(rng))));
  }
  return {{ring}};
}

/// Does x + V stay in the polygon, for a dense sampling of V's rim and inside?
bool keeps_inside(const Polygon& p, const Vec2& x, const Reach& reach, double share) {
  for (int i = 0; i < 64; ++i) {
    const double a = 2 * std::numbers::pi * i / 64;
    Vec2 v{std::cos(a), std::sin(a)};
    const Vec3& e = reach.half_extents();
    if (reach.horizontal_is_box()) v /= std::max(std::abs(v.x), std::abs(v.y));
    for (const double s : {0.25, 0.5, 0.75, 1.0})
      if (!contains(p, x + v * Vec2{e.x, e.z} * (s * share))) return false;
  }
  return true;
}

TEST(FastErosion, OfASquareByADiscIsTheSmallerSquare) {
  const auto eroded = FastEroder{}.erode(square(10), Reach::disc(1));
  ASSERT_EQ(eroded.size(), 1U);
  EXPECT_NEAR(area(eroded[0]), 64, 1e-3);
  EXPECT_EQ(eroded[0].rings[0].size(), 4U);
}

TEST(FastErosion, OfASquareByABoxTakesEachSideByItsOwnExtent) {
  const auto eroded = FastEroder{}.erode(square(10), Reach::box({2, 9, 0.5}));
  ASSERT_EQ(eroded.size(), 1U);
  EXPECT_NEAR(area(eroded[0]), 6 * 9, 1e-3);
}

TEST(FastErosion, OfATurnedRectangleByAnEllipseMovesWallsByTheSupport) {
  const double turn = 0.4;
  Ring ring;
  for (const Vec2& p : {Vec2{0, 0}, {30, 0}, {30, 20}, {0, 20}})
    ring.emplace_back(p.x * std::cos(turn) - p.y * std::sin(turn),
                      p.x * std::sin(turn) + p.y * std::cos(turn));
  const Reach reach = Reach::ellipsoid({3, 1, 1});
  const double along = reach.support({std::cos(turn), 0, std::sin(turn)});
  const double across = reach.support({-std::sin(turn), 0, std::cos(turn)});
  const auto eroded = FastEroder{}.erode({{ring}}, reach);
  ASSERT_EQ(eroded.size(), 1U);
  EXPECT_NEAR(area(eroded[0]), (30 - 2 * along) * (20 - 2 * across), 2e-3);
}

TEST(FastErosion, NeverGoesOutsideTheTrueErosionForAnyReach) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    const Vec2 at = seed % 2 == 0 ? Vec2{0} : Vec2{9000.25, -8000.5};
    const Polygon p = jagged(seed, 15, at);
    for (const Reach& reach : all_reaches()) {
      std::mt19937 rng(seed);
      std::uniform_real_distribution<double> u(0, 1);
      for (const Polygon& e : FastEroder{}.erode(p, reach)) {
        EXPECT_TRUE(within_erosion(e, p, reach)) << seed << ' ' << reach.to_string();
        for (const Ring& ring : e.rings)
          for (std::size_t i = 0; i < ring.size(); ++i) {
            const Vec2 x = ring[i] + (ring[(i + 1) % ring.size()] - ring[i]) * u(rng);
            EXPECT_TRUE(keeps_inside(p, x, reach, 1)) << seed << ' ' << reach.to_string();
          }
      }
    }
  }
}

TEST(FastErosion, KeepsAlmostAllPointsOfTheTrueErosion) {
  std::size_t inside = 0;
  std::size_t missed = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Polygon p = jagged(seed, 15, {0, 0});
    for (const Reach& reach : all_reaches()) {
      const auto eroded = FastEroder{}.erode(p, reach);
      std::mt19937 rng(seed);
      std::uniform_real_distribution<double> u(-15, 15);
      for (int i = 0; i < 200; ++i) {
        const Vec2 x{u(rng), u(rng)};
        if (!keeps_inside(p, x, reach, 1.02)) continue;
        ++inside;
        bool found = false;
        for (const Polygon& e : eroded)
          found = found || contains(e, x);
        if (!found) ++missed;
      }
    }
  }
  EXPECT_GT(inside, 1000U);
  EXPECT_LE(missed, inside / 200);  // 64 directions let a few points by
}

TEST(FastErosion, KeepsClearOfHoles) {
  Polygon p = square(20);
  p.rings.push_back({{8, 8}, {8, 12}, {12, 12}, {12, 8}});
  const auto eroded = FastEroder{64}.erode(p, Reach::disc(1));
  ASSERT_EQ(eroded.size(), 1U);
  EXPECT_NEAR(area(eroded[0]), 18 * 18 - (16 + 16 + std::numbers::pi), 0.01);
  EXPECT_FALSE(contains(eroded[0], {7.5, 10}));
  EXPECT_TRUE(contains(eroded[0], {6.9, 10}));
}

TEST(FastErosion, SplitsAtANeckAndVanishesWhenThin) {
  const Polygon dumbbell{{{{0, 0},
                           {10, 0},
                           {10, 4.5},
                           {20, 4.5},
                           {20, 0},
                           {30, 0},
                           {30, 10},
                           {20, 10},
                           {20, 5.5},
                           {10, 5.5},
                           {10, 10},
                           {0, 10}}}};
  EXPECT_EQ(FastEroder{}.erode(dumbbell, Reach::disc(1)).size(), 2U);
  EXPECT_TRUE(FastEroder{}.erode(square(1.9), Reach::disc(1)).empty());
}

TEST(FastErosion, OfAnOutlineThatCrossesItselfOrRunsBackwardsStaysInside) {
  const Reach reach = Reach::disc(1);
  // A bow tie, a square wound the wrong way, and one with corners a tenth of a millimetre off.
  const std::vector<Polygon> odd{
      {{{{0, 0}, {20, 20}, {20, 0}, {0, 20}}}},
      {{{{0, 0}, {0, 10}, {10, 10}, {10, 0}}}},
      {{{{0, 0}, {1e-4, -1e-4}, {-1e-4, 1e-4}, {10, 0}, {10, 10}, {0, 10}}}}};
  for (const Polygon& p : odd) {
    const auto eroded = FastEroder{}.erode(p, reach);
    EXPECT_FALSE(eroded.empty());
    for (const Polygon& e : eroded)
      EXPECT_TRUE(within_erosion(e, p, reach));
  }
  EXPECT_TRUE(FastEroder{}.erode({{{{0, 0}, {5, 5}}}}, reach).empty());
}

TEST(FastErosion, ByThePointKeepsAllButMicrometres) {
  const auto eroded = FastEroder{}.erode(square(10), Reach{});
  ASSERT_EQ(eroded.size(), 1U);
  EXPECT_NEAR(area(eroded[0]), 100, 1e-3);
  EXPECT_LT(area(eroded[0]), 100);
}

TEST(SimplifyInwards, OnlyGivesUpAreaAndStaysWithinTheErosion) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    const Polygon p = jagged(seed, 20, {100, 100}, 40);
    const Reach reach = Reach::disc(1);
    for (const Polygon& e : FastEroder{}.erode(p, reach)) {
      std::size_t corners = 0;
      double kept = 0;
      for (const Polygon& s : simplify_inwards(e)) {
        kept += area(s);
        corners += s.rings[0].size();
        EXPECT_TRUE(within_erosion(s, p, reach)) << seed;
      }
      EXPECT_LE(kept, area(e) + 1e-4);
      EXPECT_GE(kept, 0.99 * area(e));
      EXPECT_LE(corners, e.rings[0].size());
    }
  }
}

TEST(SimplifyInwards, MitresTheArcOfAReflexCorner) {
  const Polygon l{{{{0, 0}, {40, 0}, {40, 20}, {20, 20}, {20, 40}, {0, 40}}}};
  const auto eroded = FastEroder{32}.erode(l, Reach::disc(1));
  ASSERT_EQ(eroded.size(), 1U);
  EXPECT_GT(eroded[0].rings[0].size(), 10U);
  const auto simple = simplify_inwards(eroded[0]);
  ASSERT_EQ(simple.size(), 1U);
  EXPECT_EQ(simple[0].rings[0].size(), 6U);
}

}  // namespace
}  // namespace ivis
