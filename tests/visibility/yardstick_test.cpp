#include "bench/yardstick.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/support/scene_builder.h"

namespace ivis::bench {
namespace {

Scene wall_and_boxes(bool wall_is_building) {
  test::SceneBuilder b;
  b.add_box({20, 0, -50}, {22, 30, 50});
  b.name_last(wall_is_building ? "building_0" : "wall");
  b.add_box({40, 0, -1}, {42, 2, 1});    // behind the wall
  b.add_box({10, 0, -1}, {11, 2, 1});    // before it
  b.add_box({-42, 0, -1}, {-40, 2, 1});  // behind the eye
  b.add_box({-1, 0, 40}, {1, 2, 42});
  b.add_box({-1, 0, -42}, {1, 2, -40});
  return std::move(b).finish();
}

TEST(Yardstick, HidesOnlyTheBoxBehindTheBuilding) {
  const Scene scene = wall_and_boxes(true);
  Yardstick yardstick(scene);
  EXPECT_EQ(yardstick.triangles(), 12U);
  EXPECT_EQ(yardstick.boxes(), 5U);
  EXPECT_EQ(yardstick.run({0, 1.7, 0}), 4U);
}

TEST(Yardstick, OnlyBuildingsHide) {
  const Scene scene = wall_and_boxes(false);
  Yardstick yardstick(scene);
  EXPECT_EQ(yardstick.triangles(), 0U);
  EXPECT_EQ(yardstick.run({0, 1.7, 0}), 6U);
}

TEST(Yardstick, SeesEveryFaceAlike) {
  for (const bool along_x : {true, false})
    for (const double sign : {-1.0, 1.0}) {
      test::SceneBuilder b;
      const auto box = [&](double from, double to, double half, double bottom, double top) {
        const Vec3 lo = along_x ? Vec3{std::min(sign * from, sign * to), bottom, -half}
                                : Vec3{-half, bottom, std::min(sign * from, sign * to)};
        const Vec3 hi = along_x ? Vec3{std::max(sign * from, sign * to), top, half}
                                : Vec3{half, top, std::max(sign * from, sign * to)};
        b.add_box(lo, hi);
      };
      box(20, 22, 5, 0, 10);
      b.name_last("building_1");
      box(30, 31, 1, 1, 2);   // hidden
      box(30, 31, 20, 1, 2);  // sticks out at the sides
      box(30, 31, 1, 1, 40);  // sticks out above
      const Scene scene = std::move(b).finish();
      Yardstick yardstick(scene);
      EXPECT_EQ(yardstick.run({0, 1.7, 0}), 2U) << along_x << sign;
    }
}

TEST(Yardstick, WorksFarFromTheOrigin) {
  test::SceneBuilder b;
  const Vec3 o{10000, 500, -10000};
  b.add_box(o + Vec3{20, 0, -50}, o + Vec3{22, 30, 50});
  b.name_last("building_0");
  b.add_box(o + Vec3{40, 0, -1}, o + Vec3{42, 2, 1});
  const Scene scene = std::move(b).finish();
  Yardstick yardstick(scene);
  EXPECT_EQ(yardstick.run(o + Vec3{0, 1.7, 0}), 0U);
  EXPECT_EQ(yardstick.run(o + Vec3{60, 1.7, 0}), 1U);
}

}  // namespace
}  // namespace ivis::bench
