#include "core/reach.h"

#include <random>

#include <gtest/gtest.h>

#include "core/view_cell.h"

namespace ivis {
namespace {

std::vector<Reach> all_kinds() {
  return {Reach::ball(1.5), Reach::disc(2), Reach::cylinder(1.5, 0.1),
          Reach::ellipsoid({1, 0.5, 2}), Reach::box({1, 0.25, 3})};
}

TEST(Reach, ParsesWhatItPrints) {
  for (const Reach& r : all_kinds()) {
    const auto parsed = Reach::parse(r.to_string());
    ASSERT_TRUE(parsed) << r.to_string();
    EXPECT_EQ(*parsed, r);
  }
}

TEST(Reach, RefusesWhatIsNotAReachAndNamesIt) {
  for (const char* text :
       {"", "ball", "ball:", "ball:-1", "ball:nan", "ball:inf", "ball:1,2", "cylinder:1", "box:1,2",
        "box:1,2,3,4", "cone:1", "ball:1x", "ball:1e9", "ball: 1"}) {
    const auto parsed = Reach::parse(text);
    ASSERT_FALSE(parsed) << text;
    EXPECT_NE(parsed.error().message.find("'" + std::string(text) + "'"), std::string::npos)
        << parsed.error().message;
  }
}

TEST(Reach, SupportIsTheLargestDotProductOverItsPoints) {
  std::mt19937 rng(7);
  std::normal_distribution<double> normal;
  for (const Reach& r : all_kinds()) {
    const auto points = r.extreme_points(20000);
    for (const Vec3& p : points)
      ASSERT_TRUE(r.contains(p, 1e-9, 1e-9)) << r.to_string();
    for (int i = 0; i < 20; ++i) {
      const Vec3 d{normal(rng), normal(rng), normal(rng)};
      double best = -1;
      for (const Vec3& p : points)
        best = std::max(best, glm::dot(p, d));
      EXPECT_LE(best, r.support(d) + 1e-9) << r.to_string();
      EXPECT_GE(best, 0.98 * r.support(d)) << r.to_string();
    }
  }
}

TEST(Reach, ContainmentOfReachesAgreesWithTheirExtremePoints) {
  std::mt19937 rng(11);
  std::uniform_real_distribution<double> size(0.2, 2);
  int held = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    const Vec3 a{size(rng), size(rng), size(rng)};
    const Vec3 b{size(rng), size(rng), size(rng)};
    const auto make = [](int kind, const Vec3& e) {
      switch (kind) {
        case 0:
          return Reach::ball(e.x);
        case 1:
          return Reach::disc(e.x);
        case 2:
          return Reach::cylinder(e.x, e.y);
        case 3:
          return Reach::ellipsoid(e);
        default:
          return Reach::box(e);
      }
    };
    const Reach outer = make(trial % 5, a);
    const Reach inner = make(trial / 5 % 5, b);
    bool all = true;
    for (const Vec3& p : inner.extreme_points(2000))
      all = all && outer.contains(p, 1e-9, 1e-9);
    if (outer.contains(inner)) {
      EXPECT_TRUE(all) << outer.to_string() << " holds " << inner.to_string();
      ++held;
    } else {
      // Points sample the boundary: allow the sliver that 2,000 of them miss.
      bool slightly_smaller_fits = true;
      for (const Vec3& p : inner.extreme_points(2000))
        slightly_smaller_fits = slightly_smaller_fits && outer.contains(p * 1.02);
      EXPECT_FALSE(slightly_smaller_fits) << outer.to_string() << " lacks " << inner.to_string();
    }
  }
  EXPECT_GT(held, 100);
}

TEST(Reach, GrownHoldsTheMinkowskiSumWithACylinder) {
  for (const Reach& r : all_kinds()) {
    const Reach g = r.grown(0.01, 0.2);
    std::mt19937 rng(3);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 1000; ++i) {
      const Vec3 d{normal(rng), normal(rng), normal(rng)};
      EXPECT_GE(g.support(d) + 1e-12,
                r.support(d) + 0.01 * std::hypot(d.x, d.z) + 0.2 * std::abs(d.y))
          << r.to_string();
    }
  }
}

TEST(Reach, CircumscribedPolygonHoldsTheShadowAndTouchesItTowardsTheGivenSide) {
  for (const Reach& r : all_kinds()) {
    for (const int k : {4, 8, 16, 17}) {
      for (const Vec2 toward : {Vec2{1, 0}, Vec2{0.6, -0.8}, Vec2{-1, 2}}) {
        const auto polygon = r.circumscribed_polygon(k, toward);
        const std::size_t n = polygon.size();
        double twice = 0;
        for (std::size_t i = 0; i < n; ++i) {
          const Vec2 a = polygon[i];
          const Vec2 b = polygon[(i + 1) % n];
          twice += a.x * b.y - b.x * a.y;
          const Vec2 e = b - a;
          const Vec2 outward = glm::normalize(Vec2{e.y, -e.x});
          EXPECT_GE(glm::dot(outward, a) + 1e-12, r.support({outward.x, 0, outward.y}))
              << r.to_string();
        }
        EXPECT_GT(twice, 0) << r.to_string();
        double farthest = 0;
        for (const Vec2& p : polygon)
          farthest = std::max(farthest, glm::dot(p, glm::normalize(toward)));
        if (r.horizontal_is_box()) continue;
        EXPECT_NEAR(farthest, r.support(glm::normalize(Vec3{toward.x, 0, toward.y})), 1e-9);
      }
    }
  }
}

TEST(ViewCell, AcceptsThePoseWithinToleranceAndNoFurther) {
  const ViewCell cell{{10, 1.7, 0}, Reach::disc(1)};
  EXPECT_TRUE(cell.contains({11.0009, 1.7, 0}));
  EXPECT_TRUE(cell.contains({10, 1.709, 0}));
  EXPECT_FALSE(cell.contains({11.0011, 1.7, 0}));
  EXPECT_FALSE(cell.contains({10, 1.711, 0}));
}

}  // namespace
}  // namespace ivis
