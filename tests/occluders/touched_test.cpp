// Which prisms rest on matter at a place, and what mending makes of the rest.

#include "occluders/touched.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/view_cell.h"
#include "occluders/fast_erosion.h"
#include "occluders/mend.h"
#include "occluders/prisms.h"
#include "occluders/shrink.h"
#include "tests/support/scene_builder.h"

namespace ivis {
namespace {

using test::SceneBuilder;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

OccluderSet shrunk(const Scene& scene, const Reach& reach) {
  ShrinkOptions options;
  options.reach = reach;
  options.margins = false;
  auto result = shrink(scene, options, FastEroder{});
  EXPECT_TRUE(result);
  return result ? std::move(result->set) : OccluderSet{};
}

/// Rows of houses with party walls, of unequal heights; annexes thinner than a reach end them.
Scene rows_of_houses(unsigned seed) {
  std::mt19937 random(seed);
  const auto part = [&] { return static_cast<double>(random() % 1000) / 1000; };
  SceneBuilder b;
  for (int row = 0; row < 4; ++row) {
    double x = 0;
    for (int house = 0; house < 10; ++house) {
      const double width = 6 + 8 * part();
      b.add_box({x, 0, 30.0 * row}, {x + width, 6 + 9 * part(), 30.0 * row + 10});
      x += width;
      if (house % 4 != 3) continue;
      b.add_box({x, 0, 30.0 * row}, {x + 0.3, 25, 30.0 * row + 10});
      x += 5;
    }
  }
  return std::move(b).finish();
}

bool covers(const std::vector<Prism>& prisms, const Vec3& p) {
  return std::ranges::any_of(
      prisms, [&](const Prism& q) { return p.y < q.top && contains(q.footprint, ground(p)); });
}

TEST(OccluderIndexTest, MatterCountsUpToTheReachAndNoFarther) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {20, 10, 20});
  const OccluderSet set = shrunk(std::move(b).finish(), Reach::disc(2));
  const OccluderIndex index(set);
  ASSERT_EQ(set.shrunk.size(), 1U);
  const auto at = [&](const Vec3& lo, const Vec3& hi) { return index.touched({lo, hi}); };
  constexpr double kE = 0.01;
  EXPECT_THAT(at({20 - kE, 1, 5}, {25, 2, 6}), ElementsAre(0U));
  EXPECT_THAT(at({-5, 1, 5}, {kE, 2, 6}), ElementsAre(0U));
  EXPECT_THAT(at({5, 1, 20 - kE}, {6, 2, 25}), ElementsAre(0U));
  EXPECT_THAT(at({5, 10 - kE, 5}, {6, 30, 6}), ElementsAre(0U)) << "at its top";
  EXPECT_THAT(at({5, -90, 5}, {6, -80, 6}), ElementsAre(0U)) << "it may reach down without end";
  constexpr double kRoom = 0.2;
  EXPECT_THAT(at({20 + kRoom, 1, 5}, {25, 2, 6}), IsEmpty());
  EXPECT_THAT(at({-5, 1, 5}, {-kRoom, 2, 6}), IsEmpty());
  EXPECT_THAT(at({5, 1, 20 + kRoom}, {6, 2, 25}), IsEmpty());
  EXPECT_THAT(at({5, 10 + kRoom, 5}, {6, 30, 6}), IsEmpty());
}

// What the index is for, point by point: what is not touched lies, with all of W about it, in
// solids that stand elsewhere than the matter that is missing.
TEST(OccluderIndexTest, WhatIsNotTouchedRestsOnOtherMatter) {
  const Scene scene = rows_of_houses(7);
  for (const Reach& reach : {Reach::disc(1), Reach::cylinder(0.5, 0.3), Reach::ball(0.8)}) {
    const OccluderSet set = shrunk(scene, reach);
    const OccluderIndex index(set);
    const Vec3 w = padded(reach, set.slack_m).half_extents();
    std::size_t points = 0;
    std::size_t kept = 0;
    for (const Object& gone : scene.objects) {
      std::vector<Prism> standing;
      for (const Prism& s : set.solids) {
        const Aabb box = s.bounds();
        const Aabb inner{box.lo + 1e-6, box.hi - 1e-6};  // neighbours share walls
        if (!inner.overlaps(gone.bounds) || !gone.bounds.overlaps(inner)) standing.push_back(s);
      }
      const auto touched = index.touched(gone.bounds);
      EXPECT_FALSE(touched.empty());
      for (std::uint32_t i = 0; i < set.shrunk.size(); ++i) {
        if (std::ranges::binary_search(touched, i)) continue;
        ++kept;
        for (const auto& ring : set.shrunk[i].footprint.rings)
          for (const Vec2& corner : ring)
            for (int k = 0; k < 8; ++k) {
              const double turn = 0.7853981633974483 * k;
              const Vec3 p{corner.x + 0.999 * w.x * std::cos(turn), set.shrunk[i].top - 0.01,
                           corner.y + 0.999 * w.z * std::sin(turn)};
              // A corner's round may end in the wall between two solids that both stand.
              EXPECT_TRUE(covers(standing, p) || covers(standing, p + Vec3{1e-4, 0, 1e-4}) ||
                          covers(standing, p - Vec3{1e-4, 0, 1e-4}))
                  << "prism " << i << " at " << p.x << " " << p.y << " " << p.z;
              ++points;
            }
      }
    }
    EXPECT_GT(kept, 0U);
    EXPECT_GT(points, 1000U);
  }
}

TEST(MatterTest, IsWhatOccludersAreMadeOf) {
  SceneBuilder b;
  const ObjectId house = b.add_box({0, 0, 0}, {9, 9, 9});
  const ObjectId never = b.add_box({20, 0, 0}, {29, 9, 9}, OccluderTag::kNever);
  const ObjectId glass = b.add_box({40, 0, 0}, {49, 9, 9}, OccluderTag::kAuto, false);
  Scene scene = std::move(b).finish();
  EXPECT_TRUE(is_matter(scene, scene.objects[house]));
  EXPECT_FALSE(is_matter(scene, scene.objects[never]));
  EXPECT_FALSE(is_matter(scene, scene.objects[glass]));
  // Of all that is no matter the builders make nothing.
  for (const ObjectId id : {never, glass})
    EXPECT_THAT(extract_prisms(scene, scene.objects[id]).prisms, IsEmpty());
  scene.objects[house].always_visible = true;
  EXPECT_FALSE(is_matter(scene, scene.objects[house])) << "it moves by itself";
}

TEST(MatterTest, GroundIsWhatIsFlatOpaqueAndLiesOverNothingOfItself) {
  SceneBuilder b;
  const ObjectId tile = b.add_ground({-50, -50}, {50, 50}, 0);
  const ObjectId house = b.add_box({0, 0, 0}, {9, 9, 9});
  const ObjectId slab = b.add_box({20, 0, 0}, {60, 0.1, 40});
  Mesh lens;
  lens.positions = {{70, 0, 0}, {80, 0, 0}, {80, 0, 10}, {70, 0, 10}, {75, 1, 5}, {75, -1, 5}};
  for (std::uint32_t k = 0; k < 4; ++k)
    for (const std::uint32_t i : {k, 4U, (k + 1) % 4, k, (k + 1) % 4, 5U})
      lens.indices.push_back(i);
  lens.primitives.push_back({0, 8});
  const ObjectId crown = b.add_mesh(lens);
  const Scene scene = std::move(b).finish();
  EXPECT_FALSE(holds_ground(scene, scene.objects[crown])) << "closed, though nowhere steep";
  EXPECT_TRUE(is_matter(scene, scene.objects[crown]));
  EXPECT_TRUE(holds_ground(scene, scene.objects[tile]));
  EXPECT_FALSE(holds_ground(scene, scene.objects[house]));
  EXPECT_FALSE(holds_ground(scene, scene.objects[slab])) << "it has sides";
}

Displaced displaced(const Scene& scene, ObjectId id) {
  return {scene.objects[id].bounds, extract_prisms(scene, scene.objects[id]).prisms};
}

TEST(MendTest, TheRestOfARowStaysAndTheMissingHouseDoesNot) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {20, 10, 12});
  const ObjectId middle = b.add_box({20, 0, 0}, {40, 10, 12});
  b.add_box({40, 0, 0}, {60, 10, 12});
  b.add_box({0, 0, 60}, {20, 10, 72});  // far from all this
  const Scene scene = std::move(b).finish();
  const OccluderSet set = shrunk(scene, Reach::disc(1));
  const OccluderIndex index(set);
  const std::vector<Displaced> gone{displaced(scene, middle)};
  const auto mended = mend(index, gone, FastEroder{});
  EXPECT_TRUE(covers(mended, {10, 5, 6}));
  EXPECT_TRUE(covers(mended, {50, 5, 6}));
  EXPECT_FALSE(covers(mended, {10, 5, 66})) << "that never was out of use";
  for (double x = 19.1; x < 41; x += 0.3)
    EXPECT_FALSE(covers(mended, {x, 5, 6})) << x << " is the missing house's, or within the reach";
}

// Two solids of which one is known twice and one not at all are not both known.
TEST(MendTest, ASolidThatIsNotFoundTakesAllAboutItWithIt) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {20, 10, 12});
  b.add_box({0, 0, 0}, {20, 10, 12});
  const ObjectId other = b.add_box({20, 0, 0}, {40, 10, 12});
  const Scene scene = std::move(b).finish();
  const OccluderSet set = shrunk(scene, Reach::disc(1));
  const OccluderIndex index(set);
  Displaced both = displaced(scene, 0);
  both.bounds.add(scene.objects[other].bounds);
  both.solids.push_back(extract_prisms(scene, scene.objects[other]).prisms.at(0));
  both.solids.back().top += 1e-9;  // as another machine's arithmetic might have it
  EXPECT_FALSE(covers(mend(index, {&both, 1}, FastEroder{}), {30, 5, 6}));
}

}  // namespace
}  // namespace ivis
