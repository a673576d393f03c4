#include "scenes/generate_terrain.h"

#include <cmath>
#include <limits>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include "tests/scenes/generated_scene.h"

namespace ivis {
namespace {

TerrainOptions small() {
  TerrainOptions o;
  o.tile_cells = 16;
  o.trees = 300;
  o.path.poses = 300;
  return o;
}

TEST(GenerateTerrain, IsTheSameForTheSameInputsAndAnotherForAnotherSeed) {
  TerrainOptions o = small();
  const auto once = generate_terrain(made_up_dem(48, 8, 5, true), o);
  const auto again = generate_terrain(made_up_dem(48, 8, 5, true), o);
  ASSERT_TRUE(once);
  ASSERT_TRUE(again);
  EXPECT_EQ(once->glb, again->glb);
  ASSERT_EQ(once->path.size(), again->path.size());
  for (std::size_t i = 0; i < once->path.size(); ++i)
    EXPECT_EQ(once->path[i].eye, again->path[i].eye);
  o.seed = 2;
  EXPECT_NE(generate_terrain(made_up_dem(48, 8, 5, true), o)->glb, once->glb);
  EXPECT_NE(made_up_dem(48, 8, 5).heights, made_up_dem(48, 8, 6).heights);
}

TEST(GenerateTerrain, TilesShareTheirBorderToTheLastBitAndLeaveOutCellsAtHoles) {
  Dem dem = made_up_dem(40, 7.3, 2);
  dem.heights[20 * 41 + 20] = std::numeric_limits<float>::quiet_NaN();
  TerrainOptions o = small();
  o.trees = 0;
  const auto made = generate_terrain(dem, o);
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_EQ(made->triangles, 2U * (40 * 40 - 4));
  EXPECT_EQ(made->objects, 9U);
  const Scene scene = test::load_bytes(made->glb);
  ASSERT_EQ(scene.objects.size(), 9U);
  // Every vertex of the grid has one position, whichever tile it belongs to.
  std::map<std::pair<double, double>, double> height;
  for (const Object& object : scene.objects)
    for (const Triangle& t : test::world_triangles(scene, object))
      for (const Vec3& p : {t.a, t.b, t.c}) {
        const auto [it, fresh] = height.try_emplace({p.x, p.z}, p.y);
        EXPECT_EQ(it->second, p.y);
      }
  EXPECT_EQ(height.size(), 41U * 41 - 1);
}

TEST(GenerateTerrain, TreesStandOnTheGroundOneObjectEachTaggedNeverWithAFarLevelOutsideTheScene) {
  const Dem dem = made_up_dem(48, 8, 5, true);
  const auto made = generate_terrain(dem, small());
  ASSERT_TRUE(made);
  const Scene scene = test::load_bytes(made->glb);
  EXPECT_EQ(scene.objects.size(), made->objects);
  EXPECT_EQ(scene.triangle_count, made->triangles);
  std::size_t trees = 0;
  for (const Object& o : scene.objects) {
    const std::string& name = scene.name_of(o);
    EXPECT_EQ(name.find("_far"), std::string::npos);
    if (name.starts_with("terrain_")) {
      EXPECT_EQ(o.tag, OccluderTag::kAuto);
      continue;
    }
    ++trees;
    EXPECT_EQ(o.tag, OccluderTag::kNever) << name;
    EXPECT_GT(o.bounds.size().y, 5) << name;
  }
  EXPECT_EQ(trees, 300U);
  EXPECT_NE(made->glb.find("MSFT_lod"), std::string::npos);
  EXPECT_NE(made->glb.find("conifers_0_0_far"), std::string::npos);
}

TEST(GenerateTerrain, AimsAtAGivenNumberOfTriangles) {
  TerrainOptions o = small();
  o.trees = 0;
  o.triangles = 40'000;
  const auto made = generate_terrain(made_up_dem(64, 10, 1), o);
  ASSERT_TRUE(made);
  EXPECT_NEAR(static_cast<double>(made->triangles), 40'000, 2000);
}

TEST(Flyover, KeepsItsHeightAboveTheGroundAndTheStepBetweenPoses) {
  for (const bool ragged : {false, true}) {
    const Dem dem = made_up_dem(200, 10, 3, ragged);
    FlyoverOptions o;
    o.poses = 3000;
    const auto path = flyover(dem, 1, o);
    ASSERT_TRUE(path) << path.error().message;
    ASSERT_EQ(path->size(), 3000U);
    std::size_t over = 0;
    for (std::size_t i = 0; i < path->size(); ++i) {
      const Vec3& eye = (*path)[i].eye;
      const Vec2 at = Vec2{eye.x, eye.z} / 10.0 + 100.0;
      ASSERT_TRUE(at.x >= 0 && at.y >= 0 && at.x < 200 && at.y < 200);
      const auto c = static_cast<std::size_t>(at.x);
      const auto r = static_cast<std::size_t>(at.y);
      double highest = 0;
      for (const std::size_t k : {r, r + 1})
        for (const std::size_t j : {c, c + 1}) {
          ASSERT_TRUE(std::isfinite(dem.at(j, k))) << i;
          highest = std::max(highest, static_cast<double>(dem.at(j, k)));
        }
      EXPECT_GT(eye.y, highest + 80);
      if (i == 0) continue;
      const Vec3 move = eye - (*path)[i - 1].eye;
      EXPECT_LE(std::hypot(move.x, move.z), o.step_m * 1.001);
      over += std::hypot(move.x, move.z) > 0.99 * o.step_m ? 1 : 0;
      EXPECT_LT(std::abs(move.y), 3 * o.step_m);
    }
    EXPECT_GT(over, 2900U);
  }
}

TEST(GenerateTerrain, RefusesWhatMakesNoSense) {
  TerrainOptions o = small();
  o.tile_cells = 0;
  EXPECT_EQ(generate_terrain(made_up_dem(16, 8, 1), o).error().code, ErrorCode::kInvalidArgument);
  Dem holes = made_up_dem(16, 8, 1);
  for (std::size_t i = 0; i < holes.heights.size(); i += 2)
    holes.heights[i] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(generate_terrain(holes, small()).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(generate_terrain(Dem{}, small()).error().code, ErrorCode::kInvalidArgument);
  std::atomic<bool> stop{true};
  Context context;
  context.stop = &stop;
  EXPECT_EQ(generate_terrain(made_up_dem(16, 8, 1), small(), context).error().code,
            ErrorCode::kCancelled);
}

}  // namespace
}  // namespace ivis
