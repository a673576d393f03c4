#include "occluders/shrink.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <random>
#include <set>

#include "core/view_cell.h"
#include "occluders/fast_erosion.h"
#include "occluders/file.h"
#include "scenes/load.h"
#include "tests/occluders/mesh_shapes.h"
#include "tests/support/scene_builder.h"
#include "tests/support/shared_data.h"

namespace ivis {
namespace {

using test::SceneBuilder;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::SizeIs;

Shrunk shrink_well(const Scene& scene, const Reach& reach, const Context& context = {}) {
  auto result = shrink(scene, {reach, {}}, FastEroder{}, context);
  EXPECT_TRUE(result);
  return result ? std::move(*result) : Shrunk{};
}

/// Rows of houses with party walls, gables, unequal heights and bases.
Scene town(unsigned seed, int rows) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> u(0, 1);
  SceneBuilder b;
  for (int row = 0; row < rows; ++row) {
    double x = 0;
    for (int i = 0; i < 12; ++i) {
      const double w = 6 + 8 * u(rng);
      const double z = 30.0 * row;
      const double base = 0.3 * u(rng) * (i % 3);
      if (i % 4 == 1) {
        Mat4 m{1};
        m[3] = {x, base, z, 1};
        b.add_mesh(test::gabled_house(), OccluderTag::kAuto, m);
        x += 10;
      } else {
        b.add_box({x, base, z}, {x + w, base + 6 + 9 * u(rng), z + 8 + 4 * u(rng)});
        x += w;
      }
      if (i % 5 == 4) x += 6;
    }
  }
  return std::move(b).finish();
}

TEST(Shrink, ABoxLosesTheReachAtItsSidesAndTheSlackAtItsTop) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {10, 8, 20});
  const Shrunk s = shrink_well(std::move(b).finish(), Reach::disc(1));
  ASSERT_THAT(s.set.shrunk, SizeIs(1));
  const Prism& p = s.set.shrunk[0];
  EXPECT_NEAR(area(p.footprint), (8 - 0.004) * (18 - 0.004), 1e-3);
  EXPECT_NEAR(p.top, 8 - s.set.slack_m, 1e-12);
  EXPECT_NEAR(p.bottom, 2 * (0.01 + s.set.slack_m), 1e-12);
  EXPECT_EQ(p.solid_bottom, 0);
  EXPECT_EQ(s.set.floor, 0);
  EXPECT_EQ(s.report.occluders_in, 1U);
  EXPECT_NEAR(s.report.solid_volume, 1600, 1e-9);
  EXPECT_NEAR(s.report.kept_volume, 8 * 18 * 8, 2);
  ASSERT_THAT(s.set.solids, SizeIs(1));
  EXPECT_EQ(area(s.set.solids[0].footprint), 200);
  EXPECT_TRUE(inside_solid(s.set, {5, 4, 5}));
  EXPECT_FALSE(inside_solid(s.set, {-0.1, 4, 5}));
}

// The guarantee itself: for points X of a shrunk prism and moves m of W, X + m lies in a solid.
TEST(Shrink, EveryPointMovedByTheHangingReachStaysInASolid) {
  for (const Reach& reach : {Reach::ball(0.8), Reach::disc(1), Reach::cylinder(1.2, 0.3),
                             Reach::ellipsoid({1.5, 0.4, 0.7}), Reach::box({1, 0.2, 0.5})}) {
    const Scene scene = town(1, 2);
    const Shrunk s = shrink_well(scene, reach);
    ASSERT_GT(s.set.shrunk.size(), 3U) << reach.to_string();
    std::mt19937 rng(2);
    std::uniform_real_distribution<double> u(0, 1);
    const double apex = reach.half_extents().y;
    const double lowest = scene.bounds.lo.y;
    for (const Prism& p : s.set.shrunk) {
      const Aabb box = p.bounds();
      const bool deep = p.solid_bottom <= s.set.floor;
      for (int i = 0; i < 60; ++i) {
        const Vec3 x = box.lo + Vec3{u(rng), u(rng), u(rng)} * box.size();
        if (!contains(p.footprint, ground(x))) continue;
        for (Vec3 v : reach.extreme_points(24)) {
          v.y -= apex;
          for (const double t : {0.3, 1.0}) {
            const Vec3 q = x + v * t;
            if (deep && q.y <= lowest + 1e-6)
              continue;  // below the floor: no sight line goes there
            ASSERT_TRUE(inside_solid(s.set, q))
                << reach.to_string() << ' ' << q.x << ' ' << q.y << ' ' << q.z;
          }
        }
      }
    }
  }
}

TEST(Shrink, TwoWallsThatFuseHideWhatSingleOnesWouldNot) {
  SceneBuilder touching;
  touching.add_box({0, 0, 0}, {10, 8, 4});
  touching.add_box({10, 0, 0}, {20, 8, 4});
  const Shrunk one = shrink_well(std::move(touching).finish(), Reach::disc(1));
  ASSERT_THAT(one.set.shrunk, SizeIs(1));
  EXPECT_TRUE(contains(one.set.shrunk[0].footprint, {10, 2}));
  SceneBuilder apart;
  apart.add_box({0, 0, 0}, {10, 8, 4});
  apart.add_box({10.001, 0, 0}, {20, 8, 4});
  const Shrunk two = shrink_well(std::move(apart).finish(), Reach::disc(1));
  EXPECT_THAT(two.set.shrunk, SizeIs(2));
  for (const Prism& p : two.set.shrunk)
    EXPECT_FALSE(contains(p.footprint, {10.0005, 2}));
}

TEST(Shrink, AFloatingSlabKeepsARealBottomOrVanishes) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {1, 1, 1});
  b.add_box({10, 10, 10}, {30, 12, 30});    // thick enough
  b.add_box({40, 10, 10}, {60, 10.3, 30});  // thinner than the cell can move
  const Shrunk s = shrink_well(std::move(b).finish(), Reach::cylinder(1, 0.2));
  ASSERT_THAT(s.set.shrunk, SizeIs(1));
  EXPECT_GE(s.set.shrunk[0].bottom, 10.4);
  EXPECT_EQ(s.set.shrunk[0].solid_bottom, 10);
  EXPECT_FALSE(extends_down(s.set, s.set.shrunk[0], {{0, 1, 0}, {1, 2, 1}}));
  EXPECT_THAT(s.report.left_out, Contains(Pair("too thin for the reach", 2U)));
}

TEST(Shrink, ALowBuildingOnTheFloorStaysThoughTheCellMovesMore) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {20, 1, 20});
  const Shrunk s = shrink_well(std::move(b).finish(), Reach::cylinder(1, 0.8));
  ASSERT_THAT(s.set.shrunk, SizeIs(1));
  EXPECT_TRUE(extends_down(s.set, s.set.shrunk[0], {{30, 0.5, 30}, {32, 2.1, 32}}));
  EXPECT_LE(s.set.shrunk[0].bottom, s.set.shrunk[0].top);
}

TEST(Shrink, DrawnGroundMakesBuildingsOnASlopeReachDown) {
  const auto with = [](bool drawn) {
    SceneBuilder b;
    for (int i = 0; i < 5; ++i)
      b.add_box({20.0 * i, -0.5, 20}, {20.0 * i + 12, 9, 40});
    if (drawn) b.add_ground({-50, -50}, {150, 150}, 0);
    b.add_box({140, -3, 140},
              {141, 1, 141});  // something lower, so that the floor rule does not help
    return shrink_well(std::move(b).finish(), Reach::disc(1));
  };
  const Shrunk ground = with(true);
  ASSERT_FALSE(ground.set.ground.empty());
  int grounded = 0;
  for (const Prism& p : ground.set.shrunk)
    grounded += p.grounded ? 1 : 0;
  EXPECT_GE(grounded, 5);
  EXPECT_THAT(ground.report.left_out, Contains(Pair("ground", 1U)));
  const Shrunk none = with(false);
  EXPECT_TRUE(none.set.ground.empty());
  for (const Prism& p : none.set.shrunk)
    EXPECT_FALSE(p.grounded);
}

TEST(Shrink, ABuildingAboveTheGroundIsNotGrounded) {
  SceneBuilder b;
  b.add_ground({-50, -50}, {150, 150}, 0);
  b.add_box({0, 0, 0}, {20, 9, 20});
  b.add_box({40, 3, 0}, {60, 9, 20});  // on stilts
  const Shrunk s = shrink_well(std::move(b).finish(), Reach::disc(1));
  ASSERT_THAT(s.set.shrunk, SizeIs(2));
  for (const Prism& p : s.set.shrunk)
    EXPECT_EQ(p.grounded, p.solid_bottom == 0);
}

TEST(Shrink, HiddenSolidsOccludeAndNeverMarkedObjectsDoNot) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {10, 8, 10}, OccluderTag::kOnly);
  b.add_box({20, 0, 0}, {30, 8, 10}, OccluderTag::kNever);
  b.add_box({40, 0, 0}, {50, 8, 10}, OccluderTag::kAuto, false);
  const Shrunk s = shrink_well(std::move(b).finish(), Reach::disc(1));
  ASSERT_THAT(s.set.shrunk, SizeIs(1));
  EXPECT_TRUE(contains(s.set.shrunk[0].footprint, {5, 5}));
  EXPECT_EQ(s.report.occluders_in, 3U);
  EXPECT_THAT(s.report.left_out, Contains(Pair("marked never", 1U)));
  EXPECT_THAT(s.report.left_out, Contains(Pair("not opaque", 1U)));
}

TEST(Shrink, SlackGrowsWithTheScene) {
  SceneBuilder small;
  small.add_box({0, 0, 0}, {10, 8, 10});
  EXPECT_EQ(shrink_well(std::move(small).finish(), Reach::disc(1)).set.slack_m, 0.001);
  SceneBuilder large;
  large.add_box({0, 0, 0}, {10, 8, 10});
  large.add_box({40000, 0, 0}, {40010, 8, 10});
  EXPECT_GE(shrink_well(std::move(large).finish(), Reach::disc(1)).set.slack_m, 0.004);
}

TEST(Shrink, TenKilometresFromTheOriginKeepsAsMuch) {
  SceneBuilder b;
  b.add_box({10000, 250, -12000}, {10010, 258, -11980});
  const Shrunk s = shrink_well(std::move(b).finish(), Reach::disc(1));
  ASSERT_THAT(s.set.shrunk, SizeIs(1));
  EXPECT_NEAR(area(s.set.shrunk[0].footprint), (8 - 0.004) * (18 - 0.004), 1e-2);
}

TEST(Shrink, RefusesASeedInsideASolidAndNamesBoth) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {10, 8, 20});
  b.name_last("town hall");
  const Scene scene = std::move(b).finish();
  const auto bad = shrink(
      scene, {Reach::disc(1), {ViewSpace::Kind::kInside, {{-5, 1, 1}, {5, 4, 5}}}}, FastEroder{});
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(bad.error().message, HasSubstr("seed 1"));
  EXPECT_THAT(bad.error().message, HasSubstr("town hall"));
  const auto good =
      shrink(scene, {Reach::disc(1), {ViewSpace::Kind::kInside, {{-5, 1, 1}}}}, FastEroder{});
  ASSERT_TRUE(good);
  EXPECT_THAT(good->set.view_space.seeds, SizeIs(1));
}

TEST(Shrink, GivesTheSameBytesWhateverTheNumberOfThreads) {
  const Scene scene = town(3, 6);
  Context one;
  one.threads = 1;
  Context many;
  many.threads = 7;
  const Shrunk a = shrink_well(scene, Reach::cylinder(1, 0.1), one);
  const Shrunk b = shrink_well(scene, Reach::cylinder(1, 0.1), many);
  EXPECT_GT(a.set.shrunk.size(), 10U);
  EXPECT_EQ(encode_occluders(a.set), encode_occluders(b.set));
  EXPECT_EQ(a.report.left_out, b.report.left_out);
  EXPECT_EQ(a.report.kept_volume, b.report.kept_volume);
}

TEST(Shrink, StopsWhenAskedAtEveryStage) {
  const Scene scene = town(4, 4);
  std::set<std::string> stages;
  Context look;
  look.threads = 1;
  look.progress = [&](std::string_view stage, std::size_t done, std::size_t total) {
    stages.emplace(stage);
    EXPECT_LE(done, total);
  };
  shrink_well(scene, Reach::disc(1), look);
  EXPECT_GE(stages.size(), 3U);
  for (const std::string& at : stages) {
    std::atomic<bool> stop{false};
    Context context;
    context.stop = &stop;
    context.progress = [&](std::string_view stage, std::size_t, std::size_t) {
      stop = stop || stage == at;
    };
    const auto result = shrink(scene, {Reach::disc(1), {}}, FastEroder{}, context);
    ASSERT_FALSE(result) << at;
    EXPECT_EQ(result.error().code, ErrorCode::kCancelled);
  }
}

/// An eroder that forgets to erode.
class Lazy : public Eroder {
 public:
  const char* name() const override { return "lazy"; }
  std::vector<Polygon> erode(const Polygon& polygon, const Reach&) const override {
    return {polygon};
  }
};

TEST(Shrink, TheDistanceCheckDropsWhatAFaultyEroderGives) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {10, 8, 20});
  const auto s = shrink(std::move(b).finish(), {Reach::disc(1), {}}, Lazy{});
  ASSERT_TRUE(s);
  EXPECT_THAT(s->set.shrunk, IsEmpty());
  EXPECT_THAT(s->report.left_out, Contains(Pair("failed distance check", 1U)));
}

TEST(Shrink, TellsWhatBecameOfEachObject) {
  SceneBuilder b;
  const ObjectId thick = b.add_box({0, 0, 0}, {20, 10, 20});
  const ObjectId thin = b.add_box({40, 0, 0}, {60, 10, 1.5});
  const ObjectId wing =
      b.add_box({20, 0, 5}, {22, 10, 15});  // thin alone, but it touches the thick one
  const ObjectId never = b.add_box({80, 0, 0}, {100, 10, 20}, OccluderTag::kNever);
  const ObjectId open = b.add_ground({120, 0}, {130, 10}, 3);
  const Scene scene = std::move(b).finish();
  ShrinkOptions options;
  options.reach = Reach::disc(1);
  options.fates = true;
  const auto s = shrink(scene, options, FastEroder{});
  ASSERT_TRUE(s);
  const auto& fates = s->report.objects;
  ASSERT_THAT(fates, SizeIs(scene.objects.size()));
  for (std::size_t i = 0; i < fates.size(); ++i)
    EXPECT_EQ(fates[i].object, &scene.objects[i]);
  EXPECT_EQ(fates[thick].prisms, 1U);
  EXPECT_FALSE(fates[thick].vanished);
  EXPECT_NEAR(fates[thick].volume, 4000, 1e-6);
  EXPECT_THAT(fates[thick].left_out, IsEmpty());
  EXPECT_EQ(fates[thin].prisms, 1U);
  EXPECT_TRUE(fates[thin].vanished);
  EXPECT_FALSE(fates[wing].vanished) << "fused first";
  EXPECT_EQ(fates[never].prisms, 0U);
  EXPECT_FALSE(fates[never].vanished);
  EXPECT_THAT(fates[never].left_out, Contains(Pair("marked never", 1U)));
  EXPECT_THAT(fates[open].left_out, Contains(Pair("open mesh", 1U)));
  std::map<std::string, std::size_t> sum;
  for (const ObjectFate& f : fates)
    for (const auto& [reason, count] : f.left_out)
      sum[reason] += count;
  for (const auto& [reason, count] : sum)
    EXPECT_EQ(s->report.left_out.at(reason), count) << reason;
  options.fates = false;
  EXPECT_THAT(shrink(scene, options, FastEroder{})->report.objects, IsEmpty());
}

TEST(Shrink, AnEmptySceneGivesAnEmptySet) {
  const Shrunk s = shrink_well(SceneBuilder{}.finish(), Reach::ball(1));
  EXPECT_THAT(s.set.shrunk, IsEmpty());
  EXPECT_EQ(s.report.volume_kept(), 0);
}

TEST(ShrinkReal, PeerCityKeepsNineTenths) {
  IVIS_NEED_DATA(file, "peer_city/peer_city.glb");
  const auto scene = load_scene(file);
  ASSERT_TRUE(scene);
  const Shrunk s = shrink_well(*scene, Reach::disc(1));
  EXPECT_EQ(s.report.left_out.at("marked never"), 100000U);
  EXPECT_FALSE(s.report.left_out.contains("failed distance check"));
  EXPECT_GT(s.report.volume_kept(), 0.9);
  EXPECT_LT(s.report.volume_kept(), 0.95);
}

TEST(ShrinkReal, LinzCentreUsesNearlyAllClosedBuildings) {
  IVIS_NEED_DATA(file, "linz/linz_centre_2km.glb");
  const auto scene = load_scene(file);
  ASSERT_TRUE(scene);
  const Shrunk s = shrink_well(*scene, Reach::cylinder(1.5, 0.1));
  EXPECT_LT(s.report.left_out.at("open mesh"), 1000U);
  EXPECT_GT(s.report.volume_kept(), 0.55);
  EXPECT_FALSE(s.report.left_out.contains("failed distance check"));
}

}  // namespace
}  // namespace ivis
