// The OpenGL map against the verifier, the sampled reference and the CPU's map, in towns and rooms.

#include <algorithm>

#include "tests/visibility/contract_scenes.h"
#include "tests/visibility/gl_support.h"
#include "tests/visibility/thin_room.h"
#include "visibility/occlusion_map.h"

namespace ivis {
namespace {

using test::gl_map;
using test::misses;
using test::shrunk;
using test::solved;

TEST(GlContract, NothingIsMissedInRandomTownsForAnyKindOfReach) {
  IVIS_NEEDS_GL;
  std::size_t by_gl = 0;
  std::size_t by_cpu = 0;
  unsigned seed = 20;
  for (const Reach& reach : {Reach::disc(1), Reach::cylinder(0.8, 0.1), Reach::ball(0.4),
                             Reach::box({0.6, 0.3, 0.9}), Reach::ellipsoid({1, 0.3, 0.6})})
    for (const bool floating : {false, true}) {
      const Scene scene = test::random_town(seed++, floating);
      const OccluderSet set = shrunk(scene, reach);
      const Verifier verifier(scene, &set, BlockerChoice::kOccluding);
      const Verifier drawn(scene, &set);
      const auto map = gl_map(scene, set);
      ASSERT_NE(map, nullptr);
      const OcclusionMap cpu(scene, set, {});
      for (const Vec3& eye : {Vec3{0, 1.7, 0}, Vec3{12, 6, -9}, Vec3{-5, 30, 5}}) {
        SCOPED_TRACE(reach.to_string() + ", town " + std::to_string(seed - 1));
        const Pvs pvs = solved(*map, {eye, reach});
        EXPECT_TRUE(pvs.everything_because.empty()) << pvs.everything_because;
        EXPECT_EQ(misses(verifier, pvs), 0U);
        const auto seen = drawn.seen_from({eye, reach}, 64, 1);
        EXPECT_TRUE(
            std::includes(pvs.objects.begin(), pvs.objects.end(), seen.begin(), seen.end()));
        by_gl += pvs.objects.size();
        by_cpu += solved(cpu, {eye, reach}).objects.size();
      }
    }
  RecordProperty("listed_by_gl", static_cast<int>(by_gl));
  RecordProperty("listed_by_cpu", static_cast<int>(by_cpu));
  EXPECT_LT(by_gl, by_cpu * 11 / 10) << "larger margins cost a few objects, no more";
}

TEST(GlContract, FewerOccludersOrOtherResolutionsNeverMiss) {
  IVIS_NEEDS_GL;
  const Scene scene = test::random_town(3, true);
  const Reach reach = Reach::cylinder(0.8, 0.1);
  const OccluderSet set = shrunk(scene, reach);
  const Verifier verifier(scene, &set, BlockerChoice::kOccluding);
  const ViewCell cell{{0, 1.7, 0}, reach};
  const std::size_t all = solved(*gl_map(scene, set), cell).objects.size();
  for (const std::size_t most : {1U, 100U}) {
    MethodOptions options;
    options.max_occluders = most;
    const Pvs pvs = solved(*gl_map(scene, set, options), cell);
    EXPECT_GE(pvs.objects.size(), all);
    EXPECT_EQ(misses(verifier, pvs), 0U) << most;
  }
  for (const std::uint32_t pixels : {64U, 240U, 1024U}) {
    MethodOptions options;
    options.map_pixels = pixels;
    const Pvs pvs = solved(*gl_map(scene, set, options), cell);
    EXPECT_LT(pvs.objects.size(), scene.objects.size());
    EXPECT_EQ(misses(verifier, pvs), 0U) << pixels;
  }
}

TEST(GlContractPower, TheVerifierFindsThatThePixelMarginIsSwitchedOff) {
  IVIS_NEEDS_GL;
  const Reach reach = Reach::disc(1);
  MethodOptions options;
  options.map_pixels = 64;
  OcclusionGuards off;
  off.pixel_margin = false;
  std::size_t with = 0;
  std::size_t without = 0;
  for (unsigned seed = 20; seed < 26; ++seed) {
    const Scene scene = test::random_town(seed, false);
    const OccluderSet ladder = shrunk(scene, reach);
    const OccluderSet none = shrunk(scene, reach, {0});
    const Verifier verifier(scene, &ladder, BlockerChoice::kOccluding);
    with += misses(verifier, solved(*gl_map(scene, ladder, options), {{0, 1.7, 0}, reach}));
    without += misses(verifier, solved(*gl_map(scene, none, options, off), {{0, 1.7, 0}, reach}));
  }
  EXPECT_EQ(with, 0U);
  EXPECT_GT(without, 0U);
}

TEST(GlContract, SheetsHideBehindWallsThinnerThanTheReachButNotThroughTheDoor) {
  IVIS_NEEDS_GL;
  const Scene scene = test::thin_room();
  const Reach reach = Reach::ball(0.15);
  const OccluderSet set = shrunk(scene, reach, {}, SheetUse::kOn);
  ASSERT_FALSE(set.sheets.empty());
  const Verifier verifier(scene, &set);
  const auto map = gl_map(scene, set);
  for (const Vec3& eye :
       {Vec3{0, 1.6, 0}, Vec3{-2, 1.2, 2}, Vec3{3, 1.6, -2}, Vec3{3.2, 1.6, 3.4}}) {
    const Pvs pvs = solved(*map, {eye, reach});
    EXPECT_LT(pvs.objects.size(), scene.objects.size() / 2);
    EXPECT_GT(pvs.objects.size(), 0U);
    EXPECT_EQ(misses(verifier, pvs), 0U);
  }
}

TEST(GlContract, NothingIsMissedInTheAnalyticScenes) {
  IVIS_NEEDS_GL;
  for (const auto& s : test::analytic_scenes())
    for (const Reach& reach : {Reach::disc(1), Reach::ball(0.5)}) {
      const OccluderSet set = shrunk(s.scene, reach);
      const Verifier verifier(s.scene, &set, BlockerChoice::kOccluding);
      const auto map = gl_map(s.scene, set);
      ASSERT_NE(map, nullptr);
      for (const Vec3& eye : s.eyes) {
        const Pvs pvs = solved(*map, {eye, reach});
        EXPECT_EQ(misses(verifier, pvs), 0U) << s.name;
        EXPECT_TRUE(std::binary_search(pvs.objects.begin(), pvs.objects.end(), s.mover));
      }
    }
}

}  // namespace
}  // namespace ivis
