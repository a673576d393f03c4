#include "occluders/inset.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "occluders/clip.h"
#include "occluders/distance_check.h"
#include "occluders/fast_erosion.h"

namespace ivis {
namespace {

TEST(Inset, OfARectangleMovesEverySide) {
  const auto p = inset({{{{0, 0}, {10, 0}, {10, 6}, {0, 6}}}}, 1);
  ASSERT_TRUE(p);
  ASSERT_EQ(p->rings.size(), 1U);
  EXPECT_EQ(p->rings[0].size(), 4U);
  EXPECT_NEAR(area(*p), 8 * 4, 1e-3);
}

TEST(Inset, OfAnLKeepsItsReflexCornerSharp) {
  const Polygon l{{{{0, 0}, {20, 0}, {20, 8}, {8, 8}, {8, 20}, {0, 20}}}};
  const auto p = inset(l, 1);
  ASSERT_TRUE(p);
  EXPECT_EQ(p->rings[0].size(), 6U);
  EXPECT_NEAR(area(*p), 18 * 6 + 12 * 6, 1e-3);
  EXPECT_TRUE(within_erosion(*p, l, Reach::disc(1)));
}

TEST(Inset, GrowsACourt) {
  const Polygon block{
      {{{0, 0}, {30, 0}, {30, 30}, {0, 30}}, {{10, 10}, {10, 20}, {20, 20}, {20, 10}}}};
  const auto p = inset(block, 1);
  ASSERT_TRUE(p);
  ASSERT_EQ(p->rings.size(), 2U);
  EXPECT_NEAR(area(*p), 28 * 28 - 12 * 12, 1e-2);
  EXPECT_TRUE(within_erosion(*p, block, Reach::disc(1)));
  // Moved so far that court and outside change places: no edges cross, and the gate refuses it.
  const auto swapped = inset(block, 5.5);
  EXPECT_TRUE(!swapped || !within_erosion(*swapped, block, Reach::disc(5.5)));
}

TEST(Inset, DropsAnEdgeThatShrinksToNothing) {
  // A corner cut off by 0.4 m: gone two metres further in.
  const Polygon p{{{{0, 0}, {20, 0}, {20, 19.6}, {19.6, 20}, {0, 20}}}};
  const auto in = inset(p, 2);
  ASSERT_TRUE(in);
  EXPECT_EQ(in->rings[0].size(), 4U);
  EXPECT_NEAR(area(*in), 16 * 16, 1e-3);
  EXPECT_TRUE(within_erosion(*in, p, Reach::disc(2)));
}

TEST(Inset, LeavesWhatPartsOrVanishesToTheEroder) {
  const Polygon dumbbell{{{{0, 0},
                           {10, 0},
                           {10, 4},
                           {20, 4},
                           {20, 0},
                           {30, 0},
                           {30, 10},
                           {20, 10},
                           {20, 6},
                           {10, 6},
                           {10, 10},
                           {0, 10}}}};
  EXPECT_TRUE(inset(dumbbell, 0.5));
  EXPECT_FALSE(inset(dumbbell, 1.5)) << "its waist is two metres wide";
  EXPECT_FALSE(inset({{{{0, 0}, {1, 0}}}}, 0.1));
}

TEST(Inset, SaysThatNothingIsLeftOfAThinConvexOutline) {
  const auto in = inset({{{{0, 0}, {10, 0}, {10, 1}, {0, 1}}}}, 1);
  ASSERT_TRUE(in);
  EXPECT_TRUE(in->empty());
  ASSERT_TRUE(inset({}, 1));
  EXPECT_TRUE(inset({}, 1)->empty());
}

TEST(Inset, OfAThickOutlineWithANearlyStraightCornerIsNotSaidToBeNothing) {
  const Polygon p{{{{0, 0.003}, {10, 0}, {10.0001, 0}, {20, 0.003}, {20, 10}, {0, 10}}}};
  for (const double distance : {0.25, 0.5, 1.0, 2.0, 4.0}) {
    const auto in = inset(p, distance);
    EXPECT_TRUE(!in || !in->empty()) << distance;
  }
}

TEST(Inset, LeavesALongMitreToTheEroder) {
  // A notch like a needle, whose tip is a reflex corner of nearly 360 degrees.
  const Polygon notched{{{{0, 0}, {9.9, 0}, {10, 10}, {10.1, 0}, {20, 0}, {20, 20}, {0, 20}}}};
  EXPECT_FALSE(inset(notched, 1));
}

TEST(Inset, OfRandomOutlinesEitherPassesTheGateOrIsLeft) {
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> u(0.5, 1);
  int made = 0;
  int passed = 0;
  double kept = 0;
  double could = 0;
  for (int round = 0; round < 400; ++round) {
    Ring ring;
    const int corners = 4 + round % 13;
    for (int i = 0; i < corners; ++i) {
      const double a = 2 * std::numbers::pi * i / corners;
      ring.push_back(snap(Vec2{1000, -300} + Vec2{std::cos(a), std::sin(a)} * (30 * u(rng))));
    }
    const Polygon p{{ring}};
    const auto in = inset(p, 0.5);
    if (!in) continue;
    ++made;
    if (!within_erosion(*in, p, Reach::disc(0.5))) continue;
    ++passed;
    kept += area(*in);
    could += area(FastEroder{}.erode(p, Reach::disc(0.5)));
  }
  EXPECT_GT(made, 350);
  EXPECT_EQ(passed, made);
  EXPECT_GT(kept, 0.999 * could);
}

}  // namespace
}  // namespace ivis
