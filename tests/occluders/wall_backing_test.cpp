#include "occluders/wall_backing.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "tests/occluders/mesh_shapes.h"
#include "tests/support/scene_builder.h"

namespace ivis {
namespace {

using test::SceneBuilder;
using ::testing::IsEmpty;
using ::testing::SizeIs;

std::vector<Backing> backings(const Scene& scene) {
  ShrinkOptions options;
  options.reach = Reach::disc(0.5);
  options.margins = false;
  const auto made = shrink(scene, options, FastEroder{});
  EXPECT_TRUE(made) << (made ? "" : made.error().message);
  return made ? made->set.backings : std::vector<Backing>{};
}

/// A house of 20 x 9 x 10 m and one box, `lo` to `hi`.
Scene house_and(const Vec3& lo, const Vec3& hi) {
  SceneBuilder b;
  b.add_box(lo, hi, OccluderTag::kNever);
  b.add_box({0, 0, 0}, {20, 9, 10});
  return std::move(b).finish();
}

TEST(WallBacking, AWindowKnowsItsWallAndHowObliqueOneMayLook) {
  // On the side z = 10: 1 m wide, 3 m above the ground, standing out 0.05 m.
  const auto found = backings(house_and({8, 3, 9.98}, {9, 4.5, 10.05}));
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].object, 0U);
  EXPECT_NEAR(found[0].plane.normal.z, 1, 1e-12);
  EXPECT_NEAR(found[0].plane.offset, 9.975, 1e-6);
  // 8 m to the nearer end, 3 m to the ground; 5 mm are kept on either count.
  EXPECT_NEAR(found[0].per_level, (10.05 - 9.975) / (8 - 0.005), 1e-6);
  EXPECT_NEAR(found[0].per_height, (10.05 - 9.975) / (3 - 0.005), 1e-6);
}

TEST(WallBacking, NearerToAnEdgeOneMayLookLessObliquely) {
  const auto found = backings(house_and({0.3, 3, 10}, {1, 4, 10.1}));
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_NEAR(found[0].per_level, 0.105 / 0.295, 1e-5) << "but for float32 corners";
  EXPECT_THAT(backings(house_and({0.1, 3, 10}, {1, 4, 10.1})), IsEmpty());
  EXPECT_THAT(backings(house_and({-0.1, 3, 10}, {1, 4, 10.1})), IsEmpty());
  // Near the eaves it is heights that count.
  const auto eaves = backings(house_and({5, 7, 10}, {6, 8.9, 10.1}));
  ASSERT_THAT(eaves, SizeIs(1));
  EXPECT_NEAR(eaves[0].per_height, 0.105 / 0.095, 1e-4);
  EXPECT_THAT(backings(house_and({5, 7, 10}, {6, 9.01, 10.1})), IsEmpty());
}

TEST(WallBacking, WhatStandsOutFarOrFreeHasNone) {
  EXPECT_THAT(backings(house_and({8, 3, 10}, {9, 4, 11.6})), IsEmpty());
  EXPECT_THAT(backings(house_and({8, 3, 11.6}, {9, 4, 11.7})), IsEmpty());
  EXPECT_THAT(backings(house_and({8, 3, 5}, {9, 4, 6})), IsEmpty()) << "deep inside";
}

TEST(WallBacking, AWindowAcrossTheGapOfTwoHousesHasNone) {
  SceneBuilder b;
  b.add_box({9.5, 3, 10}, {10.5, 4, 10.1}, OccluderTag::kNever);
  b.add_box({0, 0, 0}, {10, 9, 10});
  b.add_box({10.01, 0, 0}, {20, 9, 10});
  EXPECT_THAT(backings(std::move(b).finish()), IsEmpty());
}

TEST(WallBacking, AFootprintThatIsNotConvexEndsAtItsNotch) {
  // A U open towards +z, seen from its yard: the wall z = 4 is 6 m long.
  const std::vector<Vec2> u{{0, 0}, {12, 0}, {12, 10}, {9, 10}, {9, 4}, {3, 4}, {3, 10}, {0, 10}};
  const auto with_window = [&](double x, double z) {
    SceneBuilder b;
    b.add_box({x, 4, z}, {x + 0.5, 5, z + 0.1}, OccluderTag::kNever);
    b.add_prism(u, 0, 9);
    return backings(std::move(b).finish());
  };
  const auto yard = with_window(5, 4);
  ASSERT_THAT(yard, SizeIs(1));
  EXPECT_NEAR(yard[0].plane.offset, 3.995, 1e-6);
  EXPECT_NEAR(yard[0].per_level, 0.105 / (5 - 0.005), 1e-6) << "matter goes on in the wings";
  const auto wing = with_window(1, 10);
  ASSERT_THAT(wing, SizeIs(1));
  EXPECT_NEAR(wing[0].per_level, 0.105 / 0.995, 1e-6);
  EXPECT_THAT(with_window(2.95, 10), IsEmpty());
}

TEST(WallBacking, ASkylightHangsOnASlopingRoof) {
  // Eaves at 5 m, the ridge at 9 m, 4 m in: the slope is 5.66 m long, 10 m wide.
  const Vec3 n = glm::normalize(Vec3{0, 1, 1});
  const Vec3 down = glm::normalize(Vec3{0, -1, 1});
  const auto found = [&](double from_ridge, double x) {
    const Vec3 at = Vec3{0, 9, 4} + down * from_ridge;
    Mat4 turn{1};
    turn[1] = {n, 0};
    turn[2] = {down, 0};
    turn[3] = {x, at.y, at.z, 1};
    SceneBuilder b;
    b.add_mesh(test::box_mesh({-0.3, -0.02, -0.3}, {0.3, 0.04, 0.3}), OccluderTag::kNever, turn);
    b.add_mesh(test::gabled_house());
    return backings(std::move(b).finish());
  };
  const auto middle = found(2.5, 5);
  ASSERT_THAT(middle, SizeIs(1));
  EXPECT_GT(glm::dot(middle[0].plane.normal, n), 0.9999);
  EXPECT_EQ(middle[0].per_level, middle[0].per_height);
  // The two sides of the roof meet at a right angle: the plane in it goes as far as the roof.
  const double room = 2.5 - 0.3;
  EXPECT_NEAR(middle[0].per_level, 0.065 / ((room - 0.005) / std::sqrt(2.0)), 1e-4);
  const auto gable = found(2.5, 0.8);
  ASSERT_THAT(gable, SizeIs(1));
  EXPECT_NEAR(gable[0].per_level, 0.065 / (0.495 / std::sqrt(2.0)), 1e-4);
  EXPECT_THAT(found(0.4, 5), IsEmpty()) << "too near the ridge";
}

TEST(WallBacking, EverySightLineTheRuleAllowsComesThroughTheHouse) {
  const Vec3 lo{0.4, 3, 9.95};
  const Vec3 hi{1.2, 4.2, 10.12};
  const auto found = backings(house_and(lo, hi));
  ASSERT_THAT(found, SizeIs(1));
  const Backing& b = found[0];
  std::mt19937 rng(5);
  const auto uniform = [&](double x, double y) {
    return x + (y - x) * static_cast<double>(rng()) / 4294967296.0;
  };
  int allowed = 0;
  int beside = 0;
  for (int i = 0; i < 200000; ++i) {
    const Vec3 q{uniform(-30, 30), uniform(-5, 20), uniform(-20, 10)};
    const Vec3 y{uniform(lo.x, hi.x), uniform(lo.y, hi.y), uniform(lo.z, hi.z)};
    const double behind = b.plane.offset - glm::dot(b.plane.normal, q);
    if (behind <= 0) continue;
    const Vec3 x = y + (q - y) * ((glm::dot(b.plane.normal, y) - b.plane.offset) /
                                  glm::dot(b.plane.normal, y - q));
    const bool through = x.x > 0 && x.x < 20 && x.y > 0 && x.y < 9;
    if (behind >= b.per_level * std::hypot(y.x - q.x, y.z - q.z) &&
        behind >= b.per_height * std::abs(y.y - q.y)) {
      ++allowed;
      ASSERT_TRUE(through) << "from " << q.x << ',' << q.y << ',' << q.z;
    } else {
      beside += through ? 0 : 1;
    }
  }
  EXPECT_GT(allowed, 10000);
  EXPECT_GT(beside, 100) << "a rule that refuses nothing shows nothing";
}

}  // namespace
}  // namespace ivis
