#include "occluders/convex_parts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include <gtest/gtest.h>

namespace ivis {
namespace {

double area_of(const std::array<Vec2, 4>& part) {
  return area(Polygon{{{part[0], part[1], part[2], part[3]}}});
}

void expect_partition(const Polygon& polygon) {
  const auto parts = convex_parts(polygon);
  double sum = 0;
  for (const auto& part : parts) {
    EXPECT_GE(area_of(part), 0);
    sum += area_of(part);
    const Vec2 middle = 0.25 * (part[0] + part[1] + part[2] + part[3]);
    if (area_of(part) > 1e-6) {
      EXPECT_TRUE(contains(polygon, middle)) << middle.x << ' ' << middle.y;
    }
  }
  EXPECT_NEAR(sum, area(polygon), 1e-9 * std::abs(area(polygon)));
}

TEST(ConvexParts, CoverASquareALShapeAHoleAndTwoIslands) {
  const std::vector<Vec2> square{{0, 0}, {4, 0}, {4, 4}, {0, 4}};
  EXPECT_EQ(convex_parts(Polygon{{square}}).size(), 1U);
  expect_partition(Polygon{{square}});
  expect_partition(Polygon{{{{0, 0}, {4, 0}, {4, 1}, {1, 1}, {1, 4}, {0, 4}}}});
  expect_partition(Polygon{{square, {{1, 1}, {1, 3}, {3, 3}, {3, 1}}}});
  expect_partition(Polygon{{square, {{10, 1}, {12, 1}, {11, 5}}}});
  EXPECT_TRUE(convex_parts(Polygon{}).empty());
}

TEST(ConvexParts, CoverRandomStars) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> radius(2, 10);
  for (int round = 0; round < 50; ++round) {
    std::vector<Vec2> ring;
    for (int i = 0; i < 23; ++i) {
      const double a = i * 2 * 3.14159265358979 / 23;
      ring.emplace_back(1e4 + radius(random) * std::cos(a), radius(random) * std::sin(a));
    }
    if (area(Polygon{{ring}}) < 0) std::reverse(ring.begin(), ring.end());
    // Stars whose radius differs in x and y may cross themselves: only those that do not are
    // polygons.
    bool simple = true;
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Vec2 a = ring[i] - Vec2{1e4, 0};
      const Vec2 b = ring[(i + 1) % ring.size()] - Vec2{1e4, 0};
      simple = simple && a.x * b.y - a.y * b.x > 0;
    }
    if (simple) expect_partition(Polygon{{ring}});
  }
}

TEST(ConvexParts, GiveUpOnRingsThatCrossEverywhere) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> place(-10, 10);
  std::vector<Vec2> ring(3000);
  for (Vec2& p : ring)
    p = {place(random), place(random)};
  EXPECT_TRUE(convex_parts(Polygon{{ring}}).empty());
  EXPECT_TRUE(convex_parts(Polygon{{std::vector<Vec2>(30000, Vec2{1, 2})}}).empty());
}

TEST(MeshOfPrism, IsClosedAndFacesOutwards) {
  const Prism prism{{{{{0, 0}, {4, 0}, {4, 1}, {1, 1}, {1, 4}, {0, 4}}}}, 2, 5, 0, false};
  const FaceMesh mesh = mesh_of(prism);
  // The divergence theorem over outward faces gives the volume.
  double volume = 0;
  for (const auto& f : mesh.faces)
    for (const auto& t : {std::array<std::size_t, 3>{0, 1, 2}, std::array<std::size_t, 3>{0, 2, 3}})
      volume +=
          glm::dot(mesh.points[f[t[0]]], glm::cross(mesh.points[f[t[1]]], mesh.points[f[t[2]]])) /
          6;
  EXPECT_NEAR(volume, 7 * 3, 1e-9);
  EXPECT_TRUE(mesh_of(Prism{prism.footprint, 5, 5, 0, false}).empty());
}

}  // namespace
}  // namespace ivis
