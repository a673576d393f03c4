#include "occluders/distance_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace ivis {
namespace {

using Ring = std::vector<Vec2>;

Ring rectangle(double x0, double z0, double x1, double z1) {
  return {{x0, z0}, {x1, z0}, {x1, z1}, {x0, z1}};
}

Ring reversed(Ring ring) {
  return {ring.rbegin(), ring.rend()};
}

Polygon turned(Polygon polygon, double angle, const Vec2& shift = {0, 0}) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  for (auto& ring : polygon.rings)
    for (Vec2& p : ring)
      p = Vec2{c * p.x - s * p.y, s * p.x + c * p.y} + shift;
  return polygon;
}

const Polygon kSquare{{rectangle(0, 0, 10, 10)}};
const Polygon kCourtyard{{rectangle(0, 0, 20, 20), reversed(rectangle(8, 8, 12, 12))}};
constexpr double kHair = 1e-8;

Polygon inset(double d) {
  return {{rectangle(d, d, 10 - d, 10 - d)}};
}

TEST(DistanceCheck, TakesAnInsetThatKeepsTheReach) {
  EXPECT_TRUE(within_erosion(inset(1 + kHair), kSquare, Reach::disc(1)));
  EXPECT_TRUE(within_erosion({}, kSquare, Reach::disc(1)));
}

TEST(DistanceCheck, RefusesAnEdgeNearerThanTheReach) {
  EXPECT_FALSE(within_erosion(inset(1 - kHair), kSquare, Reach::disc(1)));
  EXPECT_FALSE(within_erosion({{rectangle(1.1, 1.1, 9 + kHair, 8)}}, kSquare, Reach::disc(1)));
}

TEST(DistanceCheck, RefusesWhatCrossesTheBorderThoughAllCornersKeepTheReach) {
  EXPECT_FALSE(within_erosion({{rectangle(-5, 4, 15, 6)}}, kSquare, Reach::disc(1)));
  // A cross of two long bars: no corner of either is near the other's edges.
  EXPECT_FALSE(
      within_erosion({{rectangle(-50, 4, 60, 6)}}, {{rectangle(4, -50, 6, 60)}}, Reach::disc(0.1)));
}

TEST(DistanceCheck, RefusesAPieceOutside) {
  EXPECT_FALSE(within_erosion({{rectangle(20, 20, 22, 22)}}, kSquare, Reach::disc(1)));
  EXPECT_FALSE(within_erosion({{rectangle(2, 2, 3, 3), rectangle(20, 20, 22, 22)}}, kSquare,
                              Reach::disc(1)));
  EXPECT_FALSE(within_erosion({{rectangle(9.5, 9.5, 10.5, 10.5)}}, kCourtyard, Reach::disc(0.1)));
}

TEST(DistanceCheck, RefusesAPieceThatSwallowsAHoleOfTheOriginal) {
  EXPECT_FALSE(within_erosion({{rectangle(2, 2, 18, 18)}}, kCourtyard, Reach::disc(1)));
  EXPECT_TRUE(within_erosion({{rectangle(2, 2, 18, 18), reversed(rectangle(6.9, 6.9, 13.1, 13.1))}},
                             kCourtyard, Reach::disc(1)));
}

TEST(DistanceCheck, RefusesAPieceThatSwallowsTheWholeOriginal) {
  EXPECT_FALSE(within_erosion({{rectangle(-5, -5, 15, 15)}}, kSquare, Reach::disc(1)));
}

TEST(DistanceCheck, KnowsAnIslandInACourtyard) {
  Polygon island = kCourtyard;
  island.rings[1] = reversed(rectangle(4, 4, 16, 16));
  island.rings.push_back(rectangle(7, 7, 13, 13));
  EXPECT_TRUE(within_erosion({{rectangle(8.1, 8.1, 11.9, 11.9)}}, island, Reach::disc(1)));
  EXPECT_FALSE(within_erosion({{rectangle(5.1, 5.1, 5.9, 5.9)}}, island, Reach::disc(0.5)));
}

TEST(DistanceCheck, MeasuresRoundAtReflexCornersForADiscAndSquareForABox) {
  const Polygon ell{{{{0, 0}, {10, 0}, {10, 5}, {5, 5}, {5, 10}, {0, 10}}}};
  // The corner (4.2, 4.2) is 0.8 from each wall's line and 1.13 from the reflex corner (5, 5).
  const Polygon piece{{{{1.5, 1.5}, {4.2, 1.5}, {4.2, 4.2}, {1.5, 4.2}}}};
  EXPECT_TRUE(within_erosion(piece, ell, Reach::disc(1.1)));
  EXPECT_FALSE(within_erosion(piece, ell, Reach::disc(1.2)));
  EXPECT_TRUE(within_erosion(piece, ell, Reach::box({0.79, 5, 0.79})));
  EXPECT_FALSE(within_erosion(piece, ell, Reach::box({0.81, 5, 0.81})));
}

TEST(DistanceCheck, MeasuresAnEllipseByItsAxes) {
  const Polygon piece{{rectangle(2.5, 0.7, 7.5, 9.3)}};
  EXPECT_TRUE(within_erosion(piece, kSquare, Reach::ellipsoid({2.4, 1, 0.6})));
  EXPECT_FALSE(within_erosion(piece, kSquare, Reach::ellipsoid({0.6, 1, 2.4})));
  EXPECT_FALSE(within_erosion(piece, kSquare, Reach::ellipsoid({2.6, 1, 0.6})));
  EXPECT_FALSE(within_erosion(piece, kSquare, Reach::ellipsoid({2.4, 1, 0.8})));
}

TEST(DistanceCheck, MeasuresAnEllipseAgainstASlantedWallByItsSupport) {
  const double angle = 0.4;
  const Polygon wall = turned(kSquare, angle);
  const Reach reach = Reach::ellipsoid({2, 1, 0.5});
  // Distance of each side by the support of the ellipse in its normal's direction.
  const double across = reach.support({std::cos(angle), 0, std::sin(angle)});
  const double along = reach.support({-std::sin(angle), 0, std::cos(angle)});
  const auto piece = [&](double dx, double dz) {
    return turned({{rectangle(across + dx, along + dz, 10 - across - dx, 10 - along - dz)}}, angle);
  };
  EXPECT_TRUE(within_erosion(piece(kHair, kHair), wall, reach));
  EXPECT_FALSE(within_erosion(piece(-kHair, kHair), wall, reach));
  EXPECT_FALSE(within_erosion(piece(kHair, -kHair), wall, reach));
}

TEST(DistanceCheck, MeasuresABoxAgainstASlantedWallByItsSupport) {
  const Polygon wall = turned(kSquare, 0.4);
  const double d =
      1.0 * std::cos(0.4) + 0.5 * std::sin(0.4);  // support of the box towards the sides
  const double e = 1.0 * std::sin(0.4) + 0.5 * std::cos(0.4);
  const auto piece = [&](double grow) {
    return turned({{rectangle(d + grow, e + grow, 10 - d - grow, 10 - e - grow)}}, 0.4);
  };
  EXPECT_TRUE(within_erosion(piece(kHair), wall, Reach::box({1, 3, 0.5})));
  EXPECT_FALSE(within_erosion(piece(-kHair), wall, Reach::box({1, 3, 0.5})));
}

TEST(DistanceCheck, HoldsFarFromTheOriginAndTurned) {
  for (double angle = 0; angle < 6; angle += 0.37)
    for (const double far : {0.0, 1e4, 1e6}) {
      const Vec2 shift{far, -far};
      EXPECT_TRUE(within_erosion(turned(inset(1.000001), angle, shift),
                                 turned(kSquare, angle, shift), Reach::disc(1)));
      EXPECT_FALSE(within_erosion(turned(inset(0.999999), angle, shift),
                                  turned(kSquare, angle, shift), Reach::disc(1)));
    }
}

TEST(DistanceCheck, AReachWithoutExtentAsksForInclusionOnly) {
  EXPECT_TRUE(within_erosion(inset(1e-6), kSquare, Reach{}));
  EXPECT_FALSE(within_erosion(inset(-1e-6), kSquare, Reach{}));
  EXPECT_TRUE(
      within_erosion({{rectangle(1.1, 1e-6, 8.9, 10 - 1e-6)}}, kSquare, Reach::box({1, 1, 0})));
  EXPECT_FALSE(
      within_erosion({{rectangle(0.9, 1e-6, 8.9, 10 - 1e-6)}}, kSquare, Reach::box({1, 1, 0})));
}

TEST(DistanceCheck, RefusesNumbersThatAreNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, inf, 1e300}) {
    Polygon piece = inset(2);
    piece.rings[0][2].x = bad;
    EXPECT_FALSE(within_erosion(piece, kSquare, Reach::disc(1)));
    Polygon original = kSquare;
    original.rings[0][2].y = bad;
    EXPECT_FALSE(within_erosion(inset(2), original, Reach::disc(1)));
  }
  EXPECT_FALSE(within_erosion(inset(2), {}, Reach::disc(1)));
}

TEST(DistanceCheck, PointsAndRepeatedCornersDoNotPassUnmeasured) {
  EXPECT_FALSE(within_erosion({{{{0.5, 5}, {0.5, 5}, {0.5, 5}}}}, kSquare, Reach::disc(1)));
  EXPECT_TRUE(within_erosion({{{{1.5, 5}, {1.5, 5}, {1.5, 5}}}}, kSquare, Reach::disc(1)));
  Polygon doubled = kSquare;
  doubled.rings[0].insert(doubled.rings[0].begin() + 1, doubled.rings[0][1]);
  EXPECT_TRUE(within_erosion(inset(1.1), doubled, Reach::disc(1)));
  EXPECT_FALSE(within_erosion(inset(0.9), doubled, Reach::disc(1)));
}

/// A star-shaped ring of n corners about c.
Ring star(std::mt19937& random, const Vec2& c, double radius, int n) {
  std::uniform_real_distribution<double> part(0.5, 1);
  Ring ring;
  for (int i = 0; i < n; ++i) {
    const double angle = 2 * std::numbers::pi * i / n;
    ring.push_back(c + radius * part(random) * Vec2{std::cos(angle), std::sin(angle)});
  }
  return ring;
}

double norm(const Vec2& v, const Reach& reach) {
  const Vec2 q{v.x / reach.half_extents().x, v.y / reach.half_extents().z};
  return reach.horizontal_is_box() ? std::max(std::abs(q.x), std::abs(q.y)) : glm::length(q);
}

// The brute force: all pairs of edges, densely sampled on one side, nearest point by ternary
// search.
bool sampled_too_near(const Polygon& eroded, const Polygon& original, const Reach& reach) {
  for (const auto& r : eroded.rings)
    for (std::size_t i = 0; i < r.size(); ++i)
      for (int s = 0; s < 24; ++s) {
        const Vec2 p = glm::mix(r[i], r[(i + 1) % r.size()], s / 24.0);
        if (!contains(original, p)) return true;
        for (const auto& o : original.rings)
          for (std::size_t j = 0; j < o.size(); ++j) {
            double lo = 0;
            double hi = 1;
            const auto at = [&](double t) {
              return norm(glm::mix(o[j], o[(j + 1) % o.size()], t) - p, reach);
            };
            for (int k = 0; k < 40; ++k) {
              const double a = lo + (hi - lo) / 3;
              const double b = hi - (hi - lo) / 3;
              (at(a) < at(b) ? hi : lo) = at(a) < at(b) ? b : a;
            }
            if (at((lo + hi) / 2) < 1 - 1e-9) return true;
          }
      }
  return false;
}

TEST(DistanceCheck, NeverTakesWhatSamplingFindsTooNear) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> scale(0.2, 0.9);
  const Reach reaches[] = {Reach::disc(1), Reach::box({1.5, 1, 0.5}),
                           Reach::ellipsoid({0.5, 1, 1.5})};
  int taken = 0;
  int refused = 0;
  for (int round = 0; round < 300; ++round) {
    Polygon original{{star(random, {3, 4}, 10, 12)}};
    Polygon piece = original;
    const double f = scale(random);
    for (Vec2& p : piece.rings[0])
      p = Vec2{3, 4} + f * (p - Vec2{3, 4});
    const Reach& reach = reaches[round % 3];
    if (within_erosion(piece, original, reach)) {
      ++taken;
      EXPECT_FALSE(sampled_too_near(piece, original, reach)) << "round " << round;
    } else {
      ++refused;
    }
  }
  EXPECT_GT(taken, 40);
  EXPECT_GT(refused, 40);
}

// 100,000 edges a side: an all-pairs check would take minutes and trip the test's time-out.
TEST(DistanceCheck, TakesAHundredThousandEdges) {
  const auto circle = [](double radius) {
    Ring ring;
    constexpr int kCorners = 100000;
    for (int i = 0; i < kCorners; ++i) {
      const double angle = 2 * std::numbers::pi * i / kCorners;
      ring.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
    }
    return Polygon{{ring}};
  };
  EXPECT_TRUE(within_erosion(circle(1000 - 1.001), circle(1000), Reach::disc(1)));
  EXPECT_FALSE(within_erosion(circle(1000 - 0.999), circle(1000), Reach::disc(1)));
}

}  // namespace
}  // namespace ivis
