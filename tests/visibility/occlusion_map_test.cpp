#include "visibility/occlusion_map.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <glm/gtc/matrix_transform.hpp>

#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "tests/support/scene_builder.h"
#include "tests/visibility/contract_scenes.h"
#include "tests/visibility/thin_room.h"
#include "visibility/verify.h"

namespace ivis {
namespace {

using test::SceneBuilder;
using test::thin_room;

bool lists(const Pvs& pvs, ObjectId id) {
  return std::binary_search(pvs.objects.begin(), pvs.objects.end(), id);
}

OccluderSet shrunk(const Scene& scene, const Reach& reach, const std::vector<double>& margins = {},
                   SheetUse sheets = SheetUse::kAuto) {
  ShrinkOptions options;
  options.sheets = sheets;
  options.reach = reach;
  options.margins_m = margins;
  auto result = shrink(scene, options, FastEroder{});
  EXPECT_TRUE(result) << (result ? "" : result.error().message);
  return result ? std::move(result->set) : OccluderSet{};
}

Pvs solved(const Scene& scene, const OccluderSet& set, const ViewCell& cell,
           const MethodOptions& options = {}, const OcclusionGuards& guards = {}) {
  const auto pvs = OcclusionMap(scene, set, options, guards).solve(cell);
  EXPECT_TRUE(pvs) << (pvs ? "" : pvs.error().message);
  return pvs ? *pvs : Pvs{};
}

std::size_t misses(const Verifier& verifier, const Pvs& pvs) {
  const auto report = verifier.check(pvs, {});
  EXPECT_TRUE(report);
  return report ? report->false_negatives : 1;
}

TEST(OcclusionMap, AFloatingSlabHidesWhatIsAboveItAndNotWhatIsSeenUnderIt) {
  SceneBuilder b;
  b.add_box({-30, 4, -30}, {30, 8, 30});
  const ObjectId above = b.add_box({-1, 20, -1}, {1, 22, 1}, OccluderTag::kNever);
  const ObjectId beside = b.add_box({60, 1, 0}, {61, 2, 1}, OccluderTag::kNever);
  const ObjectId below = b.add_box({0, -20, 0}, {1, -19, 1}, OccluderTag::kNever);
  const Scene scene = std::move(b).finish();
  const Reach reach = Reach::ball(0.5);
  const OccluderSet set = shrunk(scene, reach);
  const Pvs under = solved(scene, set, {{0, 1, 0}, reach});
  EXPECT_FALSE(lists(under, above));
  EXPECT_TRUE(lists(under, beside));
  EXPECT_TRUE(lists(under, below));
  const Pvs over = solved(scene, set, {{0, 12, 0}, reach});
  EXPECT_TRUE(lists(over, above));
  EXPECT_FALSE(lists(over, below)) << "the cull map could not know";
}

/// Blocks and boxes turned about a slanted axis: nothing in it is upright.
Scene tilted_town(std::vector<Vec3>& eyes) {
  const Mat4 turn = glm::rotate(Mat4{1}, 0.7, glm::normalize(Vec3{1, 2, 3}));
  for (const Vec3& eye : {Vec3{0, 1.7, 0}, Vec3{30, 2, -20}})
    eyes.push_back(Vec3(turn * glm::dvec4(eye, 1)));
  return test::moved(test::random_town(5, false), turn);
}

TEST(OcclusionMap, HidesInATownThatIsTurnedInSpaceWhereNothingIsAPrism) {
  std::vector<Vec3> eyes;
  const Scene scene = tilted_town(eyes);
  const Reach reach = Reach::ball(0.3);
  const OccluderSet set = shrunk(scene, reach);
  EXPECT_GT(set.solid_pieces.size(), 10U);
  const Verifier verifier(scene, &set, BlockerChoice::kOccluding);
  for (const Vec3& eye : eyes) {
    const Pvs pvs = solved(scene, set, {eye, reach});
    ASSERT_TRUE(pvs.everything_because.empty()) << pvs.everything_because;
    EXPECT_LT(pvs.objects.size(), scene.objects.size() / 2);
    EXPECT_EQ(misses(verifier, pvs), 0U);
  }
}

TEST(OcclusionMap, APlaneBeyondWhichNothingLiesLosesNothingToTheReach) {
  const Mat4 turn = glm::rotate(Mat4{1}, 0.7, glm::normalize(Vec3{1, 2, 3}));
  for (const bool something_below : {false, true}) {
    SceneBuilder b;
    b.add_box({10, 0, -30}, {16, 20, 30});
    b.add_box({-60, 0, -20}, {-50, 10, 20});
    const ObjectId low = b.add_box({30, 0.2, 0}, {30.2, 0.4, 0.2}, OccluderTag::kNever);
    if (something_below) b.add_box({30, -1, 5}, {31, -0.5, 6}, OccluderTag::kNever);
    const Scene upright = std::move(b).finish();
    const Scene scene = test::moved(upright, turn);
    const Reach reach = Reach::ball(0.3);
    const OccluderSet set = shrunk(scene, reach);
    const Pvs pvs = solved(scene, set, {Vec3(turn * glm::dvec4(0, 0.5, 0, 1)), reach});
    ASSERT_EQ(set.solid_pieces.size(), 2U);
    EXPECT_EQ(set.solid_pieces[0].floors.size(), something_below ? 0U : 1U);
    // Shrunk at its base too, the block would let one look under it.
    EXPECT_EQ(lists(pvs, low), something_below);
    EXPECT_EQ(misses(Verifier(scene, &set, BlockerChoice::kOccluding), pvs), 0U);
    // From below that plane the rule says nothing.
    const Pvs from_below = solved(scene, set, {Vec3(turn * glm::dvec4(0, -4, 0, 1)), reach});
    EXPECT_EQ(misses(Verifier(scene, &set, BlockerChoice::kOccluding), from_below), 0U);
    EXPECT_TRUE(lists(from_below, low));
  }
}

TEST(OcclusionMap, FewerOccludersOrOtherResolutionsNeverMiss) {
  const Scene scene = test::random_town(3, true);
  const Reach reach = Reach::cylinder(0.8, 0.1);
  const OccluderSet set = shrunk(scene, reach);
  const Verifier verifier(scene, &set, BlockerChoice::kOccluding);
  const ViewCell cell{{0, 1.7, 0}, reach};
  const std::size_t all = solved(scene, set, cell).objects.size();
  for (const std::size_t most : {1U, 10U, 100U}) {
    MethodOptions options;
    options.max_occluders = most;
    const Pvs pvs = solved(scene, set, cell, options);
    EXPECT_GE(pvs.objects.size(), all);
    EXPECT_EQ(misses(verifier, pvs), 0U) << most;
  }
  for (const std::uint32_t pixels : {64U, 240U, 1024U}) {
    MethodOptions options;
    options.map_pixels = pixels;
    EXPECT_EQ(misses(verifier, solved(scene, set, cell, options)), 0U) << pixels;
  }
}

TEST(OcclusionMapPower, TheVerifierFindsThatThePixelMarginIsSwitchedOff) {
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
    with += misses(verifier, solved(scene, ladder, {{0, 1.7, 0}, reach}, options));
    without += misses(verifier, solved(scene, none, {{0, 1.7, 0}, reach}, options, off));
  }
  EXPECT_EQ(with, 0U);
  EXPECT_GT(without, 0U);
}

TEST(OcclusionMap, SheetsHideBehindWallsThinnerThanTheReachButNotThroughTheDoor) {
  const Scene scene = thin_room();
  const Reach reach = Reach::ball(0.15);
  const OccluderSet set = shrunk(scene, reach, {}, SheetUse::kOn);
  ASSERT_FALSE(set.sheets.empty());
  const Verifier verifier(scene, &set);
  for (const Vec3& eye : {Vec3{0, 1.6, 0}, Vec3{-2, 1.2, 2}, Vec3{3, 1.6, -2}}) {
    const Pvs pvs = solved(scene, set, {eye, reach});
    EXPECT_LT(pvs.objects.size(), scene.objects.size() / 3);
    EXPECT_GT(pvs.objects.size(), 0U);
    EXPECT_EQ(misses(verifier, pvs), 0U);
  }
}

TEST(OcclusionMapPower, TheVerifierFindsThatSheetsAreTakenForALineOfSightTooSteep) {
  const Scene scene = thin_room();
  const Reach reach = Reach::ball(0.15);
  const OccluderSet set = shrunk(scene, reach, {}, SheetUse::kOn);
  const Verifier verifier(scene, &set);
  OcclusionGuards off;
  off.sheet_obliqueness = false;
  std::size_t found = 0;
  for (const double z : {-3.4, -2.6, 2.6, 3.4})
    for (const double x : {3.2, 3.5, 3.7})
      found += misses(verifier, solved(scene, set, {{x, 1.6, z}, reach}, {}, off));
  EXPECT_GT(found, 0U);
}

}  // namespace
}  // namespace ivis
