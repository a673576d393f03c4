// Terrain in the cull map: what it hides, what it must not, and that the verifier would notice.

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "core/path.h"
#include "core/view_cell.h"
#include "occluders/fast_erosion.h"
#include "occluders/height_field.h"
#include "occluders/shrink.h"
#include "scenes/generate_terrain.h"
#include "scenes/load.h"
#include "tests/support/scene_builder.h"
#include "tests/support/shared_data.h"
#include "visibility/cull_map.h"
#include "visibility/verify.h"

#include <unistd.h>

namespace ivis {
namespace {

using test::SceneBuilder;

OccluderSet shrunk(const Scene& scene, const Reach& reach) {
  ShrinkOptions options;
  options.reach = reach;
  auto result = shrink(scene, options, FastEroder{});
  EXPECT_TRUE(result) << (result ? "" : result.error().message);
  return result ? std::move(result->set) : OccluderSet{};
}

Pvs solved(const Scene& scene, const OccluderSet& set, const ViewCell& cell, unsigned threads = 1) {
  MethodOptions options;
  options.threads = threads;
  auto pvs = CullMap(scene, set, options).solve(cell);
  EXPECT_TRUE(pvs) << (pvs ? "" : pvs.error().message);
  return pvs ? std::move(*pvs) : Pvs{};
}

std::size_t misses(const Scene& scene, const OccluderSet& set, const Pvs& pvs) {
  VerifyOptions options;
  options.rays_per_culled_object = 256;
  const auto report = Verifier(scene, &set).check(pvs, options);
  EXPECT_TRUE(report);
  return report ? report->false_negatives : 1;
}

bool lists(const Pvs& pvs, ObjectId id) {
  return std::binary_search(pvs.objects.begin(), pvs.objects.end(), id);
}

/// Cells of `step` whose corners are at `first` + step * (i, k); i, k in [0, n].
template <class Height, class Hole>
Mesh grid(int n, double first, double step, const Height& height, const Hole& hole) {
  Mesh m;
  for (int k = 0; k <= n; ++k)
    for (int i = 0; i <= n; ++i) {
      const double x = first + step * i;
      const double z = first + step * k;
      m.positions.emplace_back(x, height(x, z), z);
    }
  for (int k = 0; k < n; ++k)
    for (int i = 0; i < n; ++i) {
      if (hole(first + step * (i + 0.5), first + step * (k + 0.5))) continue;
      const auto a = static_cast<std::uint32_t>(k * (n + 1) + i);
      const auto c = a + static_cast<std::uint32_t>(n + 1);
      m.indices.insert(m.indices.end(), {a, c + 1, a + 1, a, c, c + 1});
    }
  m.primitives = {{0, static_cast<std::uint32_t>(m.triangles()), true, true}};
  return m;
}
bool nowhere(double, double) {
  return false;
}

double mesa(double x, double) {
  return x > 29.9 && x < 60.1 ? 20 : 0;
}

TEST(TerrainInTheCullMap, AMesaHidesWhatIsBehindItAndNothingElse) {
  SceneBuilder b;
  b.add_mesh(grid(80, -200, 5, mesa, nowhere));
  const ObjectId behind = b.add_box({90, 1, -1}, {92, 3, 1}, OccluderTag::kNever);
  const ObjectId high = b.add_box({90, 65, -1}, {92, 67, 1}, OccluderTag::kNever);
  const ObjectId before = b.add_box({15, 1, -1}, {17, 3, 1}, OccluderTag::kNever);
  const ObjectId on_top = b.add_box({33, 20.5, -1}, {34, 21.5, 1}, OccluderTag::kNever);
  const Scene scene = std::move(b).finish();
  for (const Reach& reach : {Reach::disc(1), Reach::ball(1.2), Reach::box({1, 0.2, 2})}) {
    const OccluderSet set = shrunk(scene, reach);
    ASSERT_FALSE(set.height_field.empty());
    const Pvs pvs = solved(scene, set, {{0, 1.7, 0}, reach});
    EXPECT_FALSE(lists(pvs, behind)) << reach.to_string();
    for (const ObjectId id : {ObjectId{0}, high, before, on_top})
      EXPECT_TRUE(lists(pvs, id)) << id;
    EXPECT_EQ(misses(scene, set, pvs), 0U);
  }
}

TEST(TerrainInTheCullMap, OutsideTheFieldOrAtItsBorderNothingIsHidden) {
  SceneBuilder b;
  b.add_mesh(grid(80, -200, 5, mesa, nowhere));
  b.add_box({90, 1, -1}, {92, 3, 1}, OccluderTag::kNever);
  const Scene scene = std::move(b).finish();
  const OccluderSet set = shrunk(scene, Reach::disc(1));
  for (const double x : {-260.0, -201.0, -198.0})
    EXPECT_EQ(solved(scene, set, {{x, 3, 0}, Reach::disc(1)}).objects.size(), 2U) << x;
  EXPECT_EQ(solved(scene, set, {{-150, 3, 0}, Reach::disc(1)}).objects.size(), 1U);
}

TEST(TerrainInTheCullMap, AHoleLetsTheEyeSeeUnderTheGroundAndTheVerifierNoticesIfItDoesNot) {
  SceneBuilder b;
  b.add_mesh(grid(80, -200, 5, mesa,
                  [](double x, double z) { return x > 10 && x < 20 && std::abs(z) < 5; }));
  const ObjectId under = b.add_box({38, -6, -1}, {42, -3, 1}, OccluderTag::kNever);
  const ObjectId behind = b.add_box({66, 1, 183}, {68, 3, 185}, OccluderTag::kNever);
  for (int i = 0; i < 200; ++i)
    b.add_box({-100 - i * 0.2, 1, i * 0.5}, {-99.9 - i * 0.2, 1.2, 0.2 + i * 0.5},
              OccluderTag::kNever);
  const Scene scene = std::move(b).finish();
  const Reach reach = Reach::disc(0.5);
  OccluderSet set = shrunk(scene, reach);
  ASSERT_FALSE(set.height_field.empty());
  const ViewCell cell{{0, 3, 0}, reach};
  const Pvs pvs = solved(scene, set, cell);
  EXPECT_TRUE(lists(pvs, under)) << "seen through the hole";
  EXPECT_FALSE(lists(pvs, behind)) << "the mesa beside the hole hides it";
  EXPECT_EQ(misses(scene, set, pvs), 0U);
  for (float& h : set.height_field.heights)
    if (h == HeightField::kNone) h = -0.5F;  // as if there were no hole
  const Pvs wrong = solved(scene, set, cell);
  EXPECT_FALSE(lists(wrong, under));
  EXPECT_GT(misses(scene, set, wrong), 0U);
}

// The claim is as tight as it can be: the mesa's edge lies one cell, 1.85 m, before a row of the
// horizon, what is looked at is far off, and the cell's rim is 2 m behind the eye.
TEST(VerifierPower, FindsThatTerrainWasShrunkForAReachTenPercentTooSmall) {
  constexpr double kStep = 1.85;
  constexpr double kEdge = 12 - kStep - 1e-3;
  const auto height = [](double x, double) {
    return x > kEdge - 0.1 && x < kEdge + 40 ? 20.0 : 0.0;
  };
  SceneBuilder b;
  b.add_mesh(grid(240, kEdge - 120 * kStep, kStep, height, nowhere));
  for (int i = 0; i < 100; ++i) {
    const Vec3 at{400, 500 + 1.2 * i, 0};
    b.add_box(at - 0.02, at + 0.02, OccluderTag::kNever);
  }
  const Scene scene = std::move(b).finish();
  const Reach asked = Reach::disc(2);
  OccluderSet set = shrunk(scene, asked);
  const auto terrain = find_terrain(scene, 100);
  ASSERT_TRUE(terrain);
  for (const double shrunk_for : {2.0, 1.8}) {
    set.height_field =
        erode(terrain->field, padded(Reach::disc(shrunk_for), set.slack_m), set.slack_m);
    const Pvs pvs = solved(scene, set, {{0, 1.7, 0}, asked});
    EXPECT_LT(pvs.objects.size(), 101U);
    EXPECT_EQ(misses(scene, set, pvs) > 0, shrunk_for < 2) << pvs.objects.size();
  }
}

Scene loaded(const GeneratedScene& made) {
  const auto file = std::filesystem::temp_directory_path() /
                    ("ivis_terrain_" + std::to_string(getpid()) + ".glb");
  EXPECT_TRUE(write_file_whole(file, made.glb));
  auto scene = load_scene(file);
  std::error_code ignored;
  std::filesystem::remove(file, ignored);
  EXPECT_TRUE(scene) << (scene ? "" : scene.error().message);
  return scene ? std::move(*scene) : Scene{};
}

void expect_flight_sound(const Dem& dem, TerrainOptions options, const Reach& reach,
                         std::size_t stride) {
  options.tile_cells = 16;
  const auto made = generate_terrain(dem, options);
  ASSERT_TRUE(made) << made.error().message;
  const Scene scene = loaded(*made);
  const OccluderSet set = shrunk(scene, reach);
  ASSERT_FALSE(set.height_field.empty());
  const Verifier verifier(scene, &set);
  MethodOptions more;
  more.threads = 3;
  const CullMap map(scene, set, {});
  const CullMap map3(scene, set, more);
  std::size_t culled = 0;
  for (std::size_t i = 0; i < made->path.size(); i += stride) {
    const ViewCell cell{made->path[i].eye, reach};
    const auto pvs = map.solve(cell);
    ASSERT_TRUE(pvs);
    EXPECT_EQ(pvs->objects, map3.solve(cell)->objects) << "threads";
    culled += scene.objects.size() - pvs->objects.size();
    const auto report = verifier.check(*pvs, {});
    ASSERT_TRUE(report);
    EXPECT_EQ(report->false_negatives, 0U) << "pose " << i;
    if (!report->missing.empty())
      ADD_FAILURE() << scene.name_of(scene.objects[report->missing[0].id]);
  }
  EXPECT_GT(culled, 20U);
}

TEST(TerrainFlown, NoRayReachesACulledTileOrTreeOverMadeUpHills) {
  for (const bool ragged : {false, true}) {
    TerrainOptions options;
    options.trees = 2000;
    options.path.poses = 400;
    options.path.height_m = 20;
    options.path.smooth_m = 20;
    expect_flight_sound(made_up_dem(160, 10, 4, ragged), options, Reach::ball(5), 40);
  }
}

TEST(TerrainFlown, NoRayReachesACulledTileOverTyrol) {
  IVIS_NEED_DATA(file, "terrain/tyrol_mal_5m.tif");
  if (!can_read_dem()) GTEST_SKIP() << "built without GDAL";
  DemCrop crop;
  crop.metres = Vec2{1600, 1600};
  const auto dem = read_dem(file, crop);
  ASSERT_TRUE(dem) << dem.error().message;
  TerrainOptions options;
  options.path.poses = 400;
  expect_flight_sound(*dem, options, Reach::ball(10), 40);
}

}  // namespace
}  // namespace ivis
