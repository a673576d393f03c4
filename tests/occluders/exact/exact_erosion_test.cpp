#include "occluders/exact/exact_erosion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "occluders/distance_check.h"

namespace ivis {
namespace {

using Ring = std::vector<Vec2>;

Ring rectangle(double x0, double z0, double x1, double z1) {
  return {{x0, z0}, {x1, z0}, {x1, z1}, {x0, z1}};
}
Ring reversed(Ring ring) {
  return {ring.rbegin(), ring.rend()};
}

double total(const std::vector<Polygon>& pieces) {
  double sum = 0;
  for (const Polygon& p : pieces)
    sum += area(p);
  return sum;
}

const Polygon kSquare{{rectangle(0, 0, 10, 10)}};
const Polygon kEll{{{{0, 0}, {10, 0}, {10, 5}, {5, 5}, {5, 10}, {0, 10}}}};

/// All pieces lie inside the true erosion; gives their area.
double eroded_area(const Polygon& polygon, const Reach& reach) {
  const auto pieces = ExactEroder().erode(polygon, reach);
  for (const Polygon& p : pieces) {
    EXPECT_TRUE(within_erosion(p, polygon, reach));
    EXPECT_GT(area(p), 0);
    for (std::size_t r = 0; r < p.rings.size(); ++r)
      EXPECT_EQ(area({{p.rings[r]}}) > 0, r == 0);
  }
  return total(pieces);
}

TEST(ExactEroder, ShrinksASquareByTheReach) {
  EXPECT_NEAR(eroded_area(kSquare, Reach::disc(1)), 64, 1e-4);
  EXPECT_NEAR(eroded_area(kSquare, Reach::cylinder(1, 7)), 64, 1e-4);
  EXPECT_NEAR(eroded_area(kSquare, Reach::box({1, 9, 2})), 8 * 6, 1e-4);
  EXPECT_NEAR(eroded_area(kSquare, Reach::ellipsoid({1, 9, 2})), 8 * 6, 1e-4);
}

TEST(ExactEroder, RoundsAReflexCornerByTheDisc) {
  // 8 x 3 + 3 x 5, and beside the reflex corner a square less a quarter disc.
  EXPECT_NEAR(eroded_area(kEll, Reach::disc(1)), 39 + 1 - std::numbers::pi / 4, 1e-3);
  EXPECT_NEAR(eroded_area(kEll, Reach::box({1, 1, 1})), 39, 1e-4);
}

TEST(ExactEroder, KeepsACourtyardOpenAndGrowsIt) {
  const Polygon court{{rectangle(0, 0, 30, 30), reversed(rectangle(12, 12, 18, 18))}};
  EXPECT_NEAR(eroded_area(court, Reach::disc(2)), 26 * 26 - (36 + 4 * 6 * 2 + std::numbers::pi * 4),
              0.02);
  // The walls about this one leave nothing but the four corners' inner parts, or nothing at all.
  const Polygon thin{{rectangle(0, 0, 10, 10), reversed(rectangle(1, 1, 9, 9))}};
  EXPECT_EQ(eroded_area(thin, Reach::disc(1)), 0);
}

TEST(ExactEroder, SplitsAtAThinNeck) {
  const Polygon dumbbell{{{{0, 0},
                           {10, 0},
                           {10, 4},
                           {20, 4},
                           {20, 0},
                           {30, 0},
                           {30, 10},
                           {20, 10},
                           {20, 5},
                           {10, 5},
                           {10, 10},
                           {0, 10}}}};
  EXPECT_EQ(ExactEroder().erode(dumbbell, Reach::disc(1)).size(), 2U);
  EXPECT_EQ(ExactEroder().erode(dumbbell, Reach::disc(0.4)).size(), 1U);
  EXPECT_EQ(ExactEroder().erode(dumbbell, Reach::disc(6)).size(), 0U);
  EXPECT_GT(eroded_area(dumbbell, Reach::disc(1)), 128);
}

TEST(ExactEroder, ErodesEachOfSeveralComponents) {
  const Polygon two{{rectangle(0, 0, 10, 10), rectangle(20, 0, 30, 10)}};
  EXPECT_EQ(ExactEroder().erode(two, Reach::disc(1)).size(), 2U);
  EXPECT_NEAR(eroded_area(two, Reach::disc(1)), 128, 1e-3);
  const Polygon island{
      {rectangle(0, 0, 50, 50), reversed(rectangle(10, 10, 40, 40)), rectangle(20, 20, 30, 30)}};
  EXPECT_NEAR(eroded_area(island, Reach::box({1, 1, 1})), 48 * 48 - 32 * 32 + 64, 0.01);
}

// CGAL's sums come back empty for every one of these when handed over as they are.
TEST(ExactEroder, CleansItsInput) {
  EXPECT_NEAR(eroded_area({{reversed(kSquare.rings[0])}}, Reach::disc(1)), 64, 1e-3) << "clockwise";
  EXPECT_NEAR(
      eroded_area({{{{0, 0}, {10, 0}, {10, 0}, {10, 10}, {0, 10}, {0, 0}}}}, Reach::disc(1)), 64,
      1e-3)
      << "doubled corners";
  EXPECT_NEAR(eroded_area({{{{0, 0}, {10, 0}, {10, 5}, {10, 10}, {0, 10}}}}, Reach::disc(1)), 64,
              1e-3)
      << "flat corner";
  EXPECT_NEAR(total(ExactEroder().erode({{rectangle(0, 0, 10, 10), {{20, 20}}, {{3, 3}, {4, 4}}}},
                                        Reach::disc(1))),
              64, 1e-3)
      << "points and lines";
  EXPECT_EQ(eroded_area({{{{0, 0}, {10, 0}, {5, 0}}}}, Reach::disc(1)), 0) << "no area";
  // A spike without width is no part of the region, so it may be cut off: distances do not know
  // that.
  const auto spiked = ExactEroder().erode(
      {{{{0, 0}, {10, 0}, {10, 5}, {15, 5}, {10, 5}, {10, 10}, {0, 10}}}}, Reach::disc(1));
  EXPECT_NEAR(total(spiked), 64, 1e-3);
}

TEST(ExactEroder, TakesRegionsThatTouchOrCrossThemselves) {
  const Polygon bow_tie{{{{0, 0}, {10, 10}, {10, 0}, {0, 10}}}};
  EXPECT_EQ(ExactEroder().erode(bow_tie, Reach::disc(0.5)).size(), 2U);
  eroded_area(bow_tie, Reach::disc(0.5));
  const Polygon corner_to_corner{
      {{{0, 0}, {10, 0}, {10, 10}, {20, 10}, {20, 20}, {10, 20}, {10, 10}, {0, 10}}}};
  EXPECT_NEAR(eroded_area(corner_to_corner, Reach::disc(1)), 128, 1e-3);
  // The courtyard touches the outer wall in one point, once as a ring of its own, once in one walk.
  const double one_ring = eroded_area(
      {{{{0, 0}, {10, 0}, {14, 4}, {10, 8}, {6, 4}, {10, 0}, {20, 0}, {20, 20}, {0, 20}}}},
      Reach::disc(1));
  const double two_rings =
      eroded_area({{{{0, 0}, {20, 0}, {20, 20}, {0, 20}}, {{10, 0}, {6, 4}, {10, 8}, {14, 4}}}},
                  Reach::disc(1));
  EXPECT_GT(one_ring, 200);
  EXPECT_NEAR(one_ring, two_rings, 1e-6);
}

TEST(ExactEroder, HoldsFarFromTheOriginAndForTinyReaches) {
  for (const double far : {1e4, 1e6}) {
    Polygon moved = kEll;
    for (Vec2& p : moved.rings[0])
      p += Vec2{far, -far};
    EXPECT_NEAR(eroded_area(moved, Reach::disc(1)), 40 - std::numbers::pi / 4, 1e-3);
  }
  EXPECT_NEAR(eroded_area(kEll, Reach{}), 75, 1e-3);
  EXPECT_NEAR(eroded_area(kEll, Reach::box({1, 1, 0})), 8 * 5 + 3 * 5, 1e-3);
}

TEST(ExactEroder, GivesNothingForNumbersThatAreNotFinite) {
  Polygon bad = kSquare;
  bad.rings[0][1].x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(ExactEroder().erode(bad, Reach::disc(1)).empty());
  bad.rings[0][1].x = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(ExactEroder().erode(bad, Reach::disc(1)).empty());
}

TEST(ExactEroder, GivesTheSameFromManyThreads) {
  const ExactEroder eroder;
  const double alone = total(eroder.erode(kEll, Reach::disc(1)));
  Context context;
  context.threads = 4;
  std::vector<double> areas(64);
  parallel_for(context, areas.size(),
               [&](std::size_t i) { areas[i] = total(eroder.erode(kEll, Reach::disc(1))); });
  for (const double a : areas)
    EXPECT_EQ(a, alone);
}

}  // namespace
}  // namespace ivis
