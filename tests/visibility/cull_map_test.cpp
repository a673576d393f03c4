#include "visibility/cull_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/visibility/prism_scene.h"

namespace ivis {
namespace {

using test::PrismScene;

std::vector<Vec2> rectangle(double x0, double z0, double x1, double z1) {
  return {{x0, z0}, {x1, z0}, {x1, z1}, {x0, z1}};
}
Aabb small_box(const Vec3& at, double half = 0.25) {
  return {at - half, at + half};
}

bool lists(const Pvs& pvs, ObjectId id) {
  return std::binary_search(pvs.objects.begin(), pvs.objects.end(), id);
}

struct Case {
  const char* name;
  CullMapKind map;
};
class CullMapOnBothMaps : public ::testing::TestWithParam<Case> {
 protected:
  static Pvs solve(const PrismScene& s, const Vec3& eye, const Reach& reach, unsigned threads = 1) {
    MethodOptions options;
    options.map = GetParam().map;
    options.threads = threads;
    auto pvs = CullMap(s.scene, s.occluders, options).solve({eye, reach});
    EXPECT_TRUE(pvs) << (pvs ? "" : pvs.error().message);
    return *pvs;
  }
};
INSTANTIATE_TEST_SUITE_P(Maps, CullMapOnBothMaps,
                         ::testing::Values(Case{"polar", CullMapKind::kPolar},
                                           Case{"orthographic", CullMapKind::kOrthographic}),
                         [](const auto& i) { return std::string(i.param.name); });

TEST_P(CullMapOnBothMaps, AWallHidesWhatIsBehindAndBelowItsTopAndNothingElse) {
  const Reach reach = Reach::disc(1);
  const auto s =
      test::make_prism_scene({{rectangle(10, -50, 20, 50), 0, 20}},
                             {small_box({40, 1, 0}), small_box({5, 1, 0}), small_box({40, 90, 0}),
                              small_box({40, 1, 240}), small_box({-30, 1, 0})},
                             reach);
  const Pvs pvs = solve(s, {0, 1.7, 0}, reach);
  EXPECT_FALSE(lists(pvs, 1)) << "behind the wall";
  for (const ObjectId id : {0U, 2U, 3U, 4U, 5U})
    EXPECT_TRUE(lists(pvs, id)) << id;
}

TEST_P(CullMapOnBothMaps, AnOccluderLowerThanTheEyeHidesWhatLiesInItsShadowOnly) {
  const Reach reach = Reach::cylinder(0.5, 0.1);
  // Eye at 20, wall top at 10 from x = 10 to 20 (far end): the shadow leaves the far edge at slope
  // about -1/2.
  const auto s = test::make_prism_scene({{rectangle(10, -60, 20, 60), 0, 10}},
                                        {small_box({26, 0.3, 0}), small_box({60, 0.3, 0})}, reach);
  const Pvs pvs = solve(s, {0, 20, 0}, reach);
  EXPECT_FALSE(lists(pvs, 1)) << "close behind the far edge";
  EXPECT_TRUE(lists(pvs, 2)) << "seen over the roof";
}

TEST_P(CullMapOnBothMaps, AFloatingSlabHidesNothingThatIsSeenUnderIt) {
  const Reach reach = Reach::disc(0.5);
  auto s = test::make_prism_scene({{rectangle(10, -50, 20, 50), 3, 20}},
                                  {small_box({40, 0.3, 0}), small_box({40, 12, 0})}, reach);
  const Pvs pvs = solve(s, {0, 1.7, 0}, reach);
  EXPECT_TRUE(lists(pvs, 1)) << "seen under the slab";
  EXPECT_EQ(lists(pvs, 2), GetParam().map != CullMapKind::kPolar) << "behind the slab itself";
}

TEST_P(CullMapOnBothMaps, ABuildingOnASlopeWithoutGroundKeepsItsUnderside) {
  const Reach reach = Reach::disc(0.5);
  // The valley behind lies lower than the building's base: seen under it from the street.
  const auto s = test::make_prism_scene({{rectangle(10, -50, 20, 50), 0, 20}},
                                        {small_box({40, -10, 0}), small_box({24, 2, 0})}, reach);
  const Pvs pvs = solve(s, {0, 1.7, 0}, reach);
  EXPECT_TRUE(lists(pvs, 1));
  if (GetParam().map == CullMapKind::kPolar) {
    EXPECT_FALSE(lists(pvs, 2));
  }
}

TEST_P(CullMapOnBothMaps, ClosedGroundLetsAGroundedBuildingReachDownForCellsOverIt) {
  const Reach reach = Reach::disc(0.5);
  auto s = test::make_prism_scene({{rectangle(10, -50, 20, 50), 0, 20}}, {small_box({40, -10, 0})},
                                  reach);
  s.occluders.shrunk[0].grounded = true;
  s.occluders.ground = {{-5, 0, -100}, {100, 0, 100}};
  EXPECT_FALSE(lists(solve(s, {0, 1.7, 0}, reach), 1));
  s.occluders.ground = {{-0.4, 0, -100},
                        {100, 0, 100}};  // the cell sticks out of the ground's rectangle
  EXPECT_TRUE(lists(solve(s, {0, 1.7, 0}, reach), 1));
}

TEST_P(CullMapOnBothMaps, AnEyeInsideAnOccluderSeesEverythingAndSaysWhy) {
  const auto s = test::make_prism_scene({{rectangle(10, -5, 20, 5), 0, 20}},
                                        {small_box({40, 1, 0})}, Reach::disc(1));
  const Pvs pvs = solve(s, {15, 1.7, 0}, Reach::disc(1));
  EXPECT_EQ(pvs.objects.size(), 2U);
  EXPECT_EQ(pvs.everything_because, "eye inside an occluder");
}

TEST_P(CullMapOnBothMaps, AnEyeAboveAllRoofsSeesWhatShadowsDoNotCover) {
  const auto s =
      test::make_prism_scene({{rectangle(10, -5, 20, 5), 0, 20}},
                             {small_box({40, 1, 0}), small_box({21.5, 1, 0})}, Reach::ball(0.5));
  const Pvs pvs = solve(s, {0, 60, 0}, Reach::ball(0.5));
  EXPECT_TRUE(lists(pvs, 1));
}

TEST_P(CullMapOnBothMaps, AnObjectAcrossTheSeamOfTheAzimuthIsTestedOnBothSides) {
  const Reach reach = Reach::disc(0.5);
  // The seam of t lies at direction (1, -1); the wall ends there, half of the box sticks out past
  // its end.
  for (int quarter = 0; quarter < 4; ++quarter) {
    const double c = std::cos(quarter * std::numbers::pi / 2);
    const double n = std::sin(quarter * std::numbers::pi / 2);
    const auto turn = [&](double x, double z) { return Vec2{c * x - n * z, n * x + c * z}; };
    std::vector<Vec2> ring{turn(20, -20), turn(30, -20), turn(30, 60), turn(20, 60)};
    const Vec2 hidden = turn(60, -20);
    const Vec2 across = turn(60, -60);
    const auto s =
        test::make_prism_scene({{ring, 0, 30}},
                               {{{hidden.x - 2, 0, hidden.y - 2}, {hidden.x + 2, 2, hidden.y + 2}},
                                {{across.x - 5, 0, across.y - 5}, {across.x + 5, 2, across.y + 5}}},
                               reach);
    const Pvs pvs = solve(s, {0, 1.7, 0}, reach);
    EXPECT_FALSE(lists(pvs, 1)) << quarter;
    EXPECT_TRUE(lists(pvs, 2)) << quarter;
  }
}

TEST_P(CullMapOnBothMaps, ASlitWiderThanTwiceTheReachIsSeenThrough) {
  const Reach reach = Reach::disc(1);
  const auto s = test::make_prism_scene(
      {{rectangle(10, -50, 20, -1.5), 0, 20}, {rectangle(10, 1.5, 20, 50), 0, 20}},
      {small_box({60, 1, 0})}, reach);
  EXPECT_TRUE(lists(solve(s, {0, 1.7, 0}, reach), 2));
}

TEST_P(CullMapOnBothMaps, RefusesALargerReachThanTheOccludersWereShrunkFor) {
  const auto s = test::make_prism_scene({{rectangle(10, -5, 20, 5), 0, 20}}, {}, Reach::disc(1));
  MethodOptions options;
  options.map = GetParam().map;
  const CullMap map(s.scene, s.occluders, options);
  const auto refused = map.solve({{0, 1.7, 0}, Reach::disc(1.1)});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().message,
            "reach disc:1.1 is larger than the occluders were shrunk for, disc:1");
  EXPECT_FALSE(map.solve({{0, 1.7, 0}, Reach::ball(1)}));
  EXPECT_FALSE(map.solve({{std::nan(""), 1.7, 0}, Reach::disc(1)}));
  EXPECT_TRUE(map.solve({{0, 1.7, 0}, Reach::disc(0.2)}));
}

/// A random town of slanted prisms, some low, some floating, with small boxes all over.
PrismScene random_town(std::uint32_t seed, const Reach& reach, const Vec3& offset, bool floating) {
  std::mt19937 rng(seed);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(rng);
  };
  std::vector<PrismScene::Solid> solids;
  for (int i = 0; i < 60; ++i) {
    const Vec2 at{uniform(-150, 150), uniform(-150, 150)};
    if (glm::length(at) < 14) continue;
    const double angle = uniform(0, 7);
    const double a = uniform(4, 25);
    const double b = uniform(4, 12);
    std::vector<Vec2> ring;
    for (const Vec2 corner : {Vec2{-a, -b}, Vec2{a, -b}, Vec2{a, b}, Vec2{-a, b}})
      ring.push_back(ground(offset) + at +
                     Vec2{std::cos(angle) * corner.x - std::sin(angle) * corner.y,
                          std::sin(angle) * corner.x + std::cos(angle) * corner.y});
    const double bottom = floating ? uniform(-6, 4) : 0;
    solids.push_back({ring, offset.y + bottom, offset.y + bottom + uniform(3, 25)});
  }
  std::vector<Aabb> boxes;
  for (int i = 0; i < 1500; ++i)
    boxes.push_back(small_box(
        offset + Vec3{uniform(-200, 200), uniform(floating ? -6 : 0.3, 12), uniform(-200, 200)},
        uniform(0.1, 0.3)));
  return test::make_prism_scene(solids, boxes, reach);
}

/// Rays from the cell to random points of culled boxes that no solid blocks.
std::size_t misses(const PrismScene& s, const Pvs& pvs, std::uint32_t seed, std::size_t rays) {
  std::mt19937 rng(seed);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(rng);
  };
  auto views = pvs.cell.reach.extreme_points(24);
  std::size_t found = 0;
  for (ObjectId id = static_cast<ObjectId>(s.solids.size()); id < s.scene.objects.size(); ++id) {
    if (lists(pvs, id)) continue;
    const Aabb& b = s.scene.objects[id].bounds;
    for (std::size_t r = 0; r < rays; ++r) {
      const Vec3 q =
          pvs.cell.eye + views[r % views.size()] * (r < views.size() ? 1.0 : uniform(0, 1));
      const Vec3 y{uniform(b.lo.x, b.hi.x), uniform(b.lo.y, b.hi.y), uniform(b.lo.z, b.hi.z)};
      if (!test::blocked(s, q, y)) {
        ++found;
        break;
      }
    }
  }
  return found;
}

TEST_P(CullMapOnBothMaps, NeverOmitsWhatRaysSeeInRandomTowns) {
  std::size_t culled = 0;
  for (const Reach& reach : {Reach::disc(1), Reach::ball(0.8), Reach::cylinder(1.5, 0.1),
                             Reach::ellipsoid({1, 0.5, 2}), Reach::box({1, 0.3, 0.5})})
    for (const bool floating : {false, true})
      for (std::uint32_t seed = 0; seed < 3; ++seed) {
        const Vec3 offset = seed == 2 ? Vec3{7000, 300, -7100} : Vec3{0};
        const auto s = random_town(seed, reach, offset, floating);
        for (const double height : {1.7, 9.0, 40.0}) {
          const Pvs pvs = solve(s, offset + Vec3{0, height, 0}, reach);
          if (!pvs.everything_because.empty()) continue;
          culled += s.scene.objects.size() - pvs.objects.size();
          EXPECT_EQ(misses(s, pvs, seed, 48), 0U) << reach.to_string() << " floating " << floating
                                                  << " seed " << seed << " height " << height;
        }
      }
  EXPECT_GT(culled, GetParam().map == CullMapKind::kPolar ? 20000U : 5000U)
      << "the map must cull, or the test says nothing";
}

TEST_P(CullMapOnBothMaps, GivesTheSameBitsFromAnyNumberOfThreads) {
  const Reach reach = Reach::disc(1);
  const auto s = random_town(5, reach, {}, false);
  const Pvs one = solve(s, {0, 1.7, 0}, reach, 1);
  for (const unsigned threads : {2U, 3U, 8U})
    EXPECT_EQ(solve(s, {0, 1.7, 0}, reach, threads).objects, one.objects);
}

TEST_P(CullMapOnBothMaps, DrawingFewerOccludersOnlyAddsObjects) {
  const Reach reach = Reach::disc(1);
  const auto s = random_town(6, reach, {}, false);
  MethodOptions options;
  options.map = GetParam().map;
  const Pvs all = solve(s, {0, 1.7, 0}, reach);
  std::size_t last = s.scene.objects.size();
  for (const std::size_t n : {1U, 5U, 20U, 1000U}) {
    options.max_occluders = n;
    const auto some = CullMap(s.scene, s.occluders, options).solve({{0, 1.7, 0}, reach});
    ASSERT_TRUE(some);
    EXPECT_TRUE(std::includes(some->objects.begin(), some->objects.end(), all.objects.begin(),
                              all.objects.end()))
        << n;
    EXPECT_LE(some->objects.size(), last);
    last = some->objects.size();
  }
  EXPECT_EQ(last, all.objects.size());
}

TEST(CullMapGuards, EachOneTakenOutIsCaughtByRays) {
  const auto broken = [](const char* name, auto take_out, bool floating, double height,
                         std::uint32_t bins) {
    PolarGuards guards;
    take_out(guards);
    const Reach reach = Reach::disc(1);
    std::size_t whole = 0;
    std::size_t without = 0;
    for (std::uint32_t seed = 20; seed < 26; ++seed) {
      const auto s = random_town(seed, reach, {}, floating);
      for (const bool on : {true, false}) {
        const CullMap map(s.scene, s.occluders, {}, on ? PolarGuards{} : guards, bins);
        const auto pvs = map.solve({{0, height, 0}, reach});
        if (!pvs || !pvs->everything_because.empty()) continue;
        (on ? whole : without) += misses(s, *pvs, seed, 96);
      }
    }
    EXPECT_EQ(whole, 0U) << name;
    EXPECT_GT(without, 0U) << name;
  };
  broken(
      "cover_whole_bins", [](PolarGuards& g) { g.cover_whole_bins = false; }, false, 1.7, 64);
  broken(
      "test_distance", [](PolarGuards& g) { g.test_distance = false; }, false, 1.7, 1024);
  broken(
      "respect_undersides", [](PolarGuards& g) { g.respect_undersides = false; }, true, 1.7, 1024);
  broken(
      "far_end_below_eye", [](PolarGuards& g) { g.far_end_below_eye = false; }, false, 30, 64);
}

TEST(CullMapGuards, TheLeastOverABinSavesWhatStandsBeforeAWallSeenAtAGrazingAngle) {
  const Reach reach = Reach::disc(0.5);
  std::vector<Aabb> boxes;
  // In front of the wall's line z = -3.114 + 0.0228 x, in the bin left of u = 0 where the wall
  // recedes from 75 m to 158 m.
  for (int x = 100; x < 130; x += 2)
    boxes.push_back(small_box({x, 1.5, (-3.114 + 0.0228 * x) / 2}, 0.05));

  const auto s =
      test::make_prism_scene({{{{5, -23}, {400, -14}, {400, 6}, {5, -3}}, 0, 20}}, boxes, reach);
  for (const bool on : {true, false}) {
    PolarGuards guards;
    guards.least_over_bin = on;
    const auto pvs = CullMap(s.scene, s.occluders, {}, guards, 64).solve({{0, 1.7, 0}, reach});
    ASSERT_TRUE(pvs);
    EXPECT_EQ(misses(s, *pvs, 1, 48) == 0, on);
  }
}

TEST(CullMapPower, AReachTenPercentTooSmallIsCaughtByRays) {
  // Far behind a wall the bound is tight: what shows above its top from two metres farther back
  // than the eye.
  std::vector<Aabb> boxes;
  for (int i = 0; i < 60; ++i)
    boxes.push_back(small_box({3000, 4500 + 4 * i, 0}));
  const Reach asked = Reach::disc(2);
  for (const double shrunk_for : {2.0, 1.8}) {
    auto s = test::make_prism_scene({{rectangle(10, -4000, 20, 4000), 0, 20}}, boxes,
                                    Reach::disc(shrunk_for));
    s.occluders.reach = asked;  // a lie, the second time
    const auto pvs = CullMap(s.scene, s.occluders, {}).solve({{0, 1.7, 0}, asked});
    ASSERT_TRUE(pvs);
    EXPECT_LT(pvs->objects.size(), boxes.size());
    EXPECT_EQ(misses(s, *pvs, 1, 64) > 0, shrunk_for < 2);
  }
}

}  // namespace
}  // namespace ivis
