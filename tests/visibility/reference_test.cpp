#include "visibility/reference.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/scene_builder.h"

namespace ivis {
namespace {

const ViewCell kCell{{0, 1.7, 0}, Reach::disc(1)};

Scene wall_and_two_boxes() {
  test::SceneBuilder b;
  b.add_box({40, 0, -1}, {42, 2, 1});
  b.add_box({40, 0, 40}, {42, 2, 42});
  b.add_box({20, -1, -15}, {21, 30, 15});
  return std::move(b).finish();
}

TEST(Reference, ListsWhatIsSeen) {
  const Scene scene = wall_and_two_boxes();
  const OccluderSet none;
  const auto method = make_reference(scene, none, {});
  EXPECT_EQ(method->traits().name, "reference");
  EXPECT_EQ(method->traits().guarantee, Guarantee::kExactAtSamples);
  const auto pvs = method->solve(kCell);
  ASSERT_TRUE(pvs);
  EXPECT_EQ(pvs->objects, (std::vector<ObjectId>{1, 2}));
  EXPECT_EQ(pvs->scene_hash, scene.hash);
  EXPECT_TRUE(pvs->everything_because.empty());
}

TEST(Reference, ListsMovers) {
  Scene scene = wall_and_two_boxes();
  scene.objects[0].always_visible = true;
  ASSERT_TRUE(finish_scene(scene));
  const OccluderSet none;
  EXPECT_EQ(make_reference(scene, none, {})->solve(kCell)->objects,
            (std::vector<ObjectId>{0, 1, 2}));
}

TEST(Reference, AnEyeInsideAnOccluderSeesEverythingAndSaysWhy) {
  const Scene scene = wall_and_two_boxes();
  OccluderSet set;
  set.scene_hash = scene.hash;
  Prism prism;
  prism.footprint.rings = {{{20, -15}, {21, -15}, {21, 15}, {20, 15}}};
  prism.bottom = -1;
  prism.top = 30;
  set.solids.push_back(prism);
  const auto pvs = make_reference(scene, set, {})->solve({{20.5, 1.7, 0}, Reach::disc(0.1)});
  ASSERT_TRUE(pvs);
  EXPECT_EQ(pvs->objects.size(), 3U);
  EXPECT_FALSE(pvs->everything_because.empty());
}

TEST(Reference, SaysTheSameForAnyNumberOfThreads) {
  test::SceneBuilder b;
  for (int i = 0; i < 800; ++i) {
    const Vec3 lo{5.0 + 3 * (i % 40), 0, 3.0 * (i / 40) - 30};
    b.add_box(lo, lo + Vec3{1, 0.5 + 0.1 * (i % 17), 1});
  }
  const Scene scene = std::move(b).finish();
  const OccluderSet none;
  MethodOptions one;
  one.rays = 64;
  MethodOptions four = one;
  four.threads = 4;
  const auto a = make_reference(scene, none, one)->solve(kCell);
  EXPECT_GT(a->objects.size(), 50U);
  EXPECT_EQ(a->objects, make_reference(scene, none, four)->solve(kCell)->objects);
}

TEST(Reference, RefusesAnEyeThatIsNoPoint) {
  const Scene scene = wall_and_two_boxes();
  const OccluderSet none;
  const auto pvs = make_reference(scene, none, {})
                       ->solve({{std::numeric_limits<double>::quiet_NaN(), 0, 0}, Reach()});
  ASSERT_FALSE(pvs);
  EXPECT_EQ(pvs.error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace ivis
