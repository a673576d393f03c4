#include "visibility/map_frame.h"

#include <cmath>

#include <gtest/gtest.h>
#include <glm/gtc/matrix_transform.hpp>

#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "tests/support/scene_builder.h"
#include "tests/visibility/contract_scenes.h"
#include "visibility/occlusion_map.h"
#include "visibility/verify.h"

namespace ivis {
namespace {

constexpr double kSlackM = 0.001;
const Mat4 kTurn = glm::rotate(Mat4{1}, 0.7, glm::normalize(Vec3{1, 2, 3}));

TEST(MapFrame, AnUprightSceneKeepsItsAxes) {
  for (const Scene& scene :
       {test::small_city().scene, test::random_town(5, false),
        test::moved(test::random_town(5, true), glm::translate(Mat4{1}, Vec3{1e4, 0, 300}))}) {
    const MapFrame frame = choose_frame(scene, kSlackM);
    EXPECT_FALSE(frame.turned);
    EXPECT_EQ(frame.to_map(frame.origin), Vec3{0});
    EXPECT_EQ(frame.direction({1, 2, 3}), (Vec3{1, 2, 3}));
    const Aabb all = bounds_in(frame, scene);
    EXPECT_EQ(all.lo, scene.bounds.lo - frame.origin);
    EXPECT_EQ(all.hi, scene.bounds.hi - frame.origin);
  }
}

TEST(MapFrame, ATurnedSceneIsTurnedBack) {
  const Scene scene = test::moved(test::small_city().scene, kTurn);
  const MapFrame frame = choose_frame(scene, kSlackM);
  ASSERT_TRUE(frame.turned);
  const glm::dmat3 one = frame.turn * glm::transpose(frame.turn);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(one[i][k], i == k ? 1 : 0, 1e-12);
  EXPECT_NEAR(glm::determinant(frame.turn), 1, 1e-12) << "a rotation: faces keep their fronts";
  const Vec3 up = frame.direction(Vec3(kTurn * glm::dvec4(0, 1, 0, 0)));
  EXPECT_NEAR(std::abs(up.y), 1, 1e-6);
  // Boxes hold all vertices, and little more than what they were before the turn.
  const Scene upright = test::small_city().scene;
  double volume = 0;
  double before = 0;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const Object& o = scene.objects[i];
    const Aabb box = bounds_in(frame, scene, o);
    for (const auto& p : scene.mesh_of(o).positions)
      EXPECT_TRUE(box.contains(frame.to_map(Vec3(o.to_world * glm::dvec4(Vec3(p), 1.0)))));
    const Vec3 s = box.size();
    const Vec3 u = upright.objects[i].bounds.size();
    volume += s.x * s.y * s.z;
    before += u.x * u.y * u.z;
  }
  EXPECT_LT(volume, 1.01 * before);
}

TEST(MapFrame, StaysWherePrecisionWouldNotDo) {
  const Scene scene = test::moved(test::small_city().scene, kTurn);
  EXPECT_FALSE(choose_frame(scene, 1e-6).turned);
  EXPECT_FALSE(choose_frame(Scene{}, kSlackM).turned);
}

TEST(MapFrame, ATurnedCityIsAnsweredAlmostAsTheUprightOne) {
  const test::ContractScene city = test::small_city();
  const Scene turned = test::moved(city.scene, kTurn);
  const Reach reach = Reach::ball(0.5);
  ShrinkOptions options;
  options.reach = reach;
  const auto upright_set = shrink(city.scene, options, FastEroder{});
  const auto turned_set = shrink(turned, options, FastEroder{});
  ASSERT_TRUE(upright_set && turned_set);
  const OcclusionMap upright_map(city.scene, upright_set->set, {});
  const OcclusionMap turned_map(turned, turned_set->set, {});
  MethodOptions threads;
  threads.threads = 3;
  const OcclusionMap in_threads(turned, turned_set->set, threads);
  const Verifier verifier(turned, &turned_set->set, BlockerChoice::kOccluding);
  std::size_t upright_count = 0;
  std::size_t turned_count = 0;
  for (const Vec3& eye : city.eyes) {
    const ViewCell cell{Vec3(kTurn * glm::dvec4(eye, 1)), reach};
    const auto pvs = turned_map.solve(cell);
    const auto upright = upright_map.solve({eye, reach});
    ASSERT_TRUE(pvs && upright);
    EXPECT_TRUE(pvs->everything_because.empty()) << pvs->everything_because;
    EXPECT_EQ(in_threads.solve(cell)->objects, pvs->objects);
    const auto report = verifier.check(*pvs, {});
    ASSERT_TRUE(report);
    EXPECT_EQ(report->false_negatives, 0U);
    upright_count += upright->objects.size();
    turned_count += pvs->objects.size();
  }
  // There is no ground to stand on in a turned city, so its houses have undersides.
  EXPECT_LT(static_cast<double>(turned_count), 1.3 * static_cast<double>(upright_count));
}

}  // namespace
}  // namespace ivis
