#include "visibility/verify.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>

#include "tests/support/scene_builder.h"

namespace ivis {
namespace {

using test::SceneBuilder;

Pvs pvs_without(const Scene& scene, const ViewCell& cell, const std::vector<ObjectId>& left_out) {
  Pvs pvs;
  pvs.cell = cell;
  pvs.scene_hash = scene.hash;
  for (ObjectId id = 0; id < scene.objects.size(); ++id)
    if (std::find(left_out.begin(), left_out.end(), id) == left_out.end())
      pvs.objects.push_back(id);
  return pvs;
}

CellReport check(const Scene& scene, const ViewCell& cell, const std::vector<ObjectId>& left_out,
                 const OccluderSet* occluders = nullptr, std::size_t rays = 64) {
  VerifyOptions options;
  options.rays_per_culled_object = rays;
  const auto report = Verifier(scene, occluders).check(pvs_without(scene, cell, left_out), options);
  EXPECT_TRUE(report) << (report ? "" : report.error().message);
  return report ? *report : CellReport{};
}

const ViewCell kCell{{0, 1.7, 0}, Reach::cylinder(1.5, 0.1)};

struct WallScene {
  Scene scene;
  ObjectId wall = 0;
  ObjectId hidden = 1;
  ObjectId beside = 2;
};

/// A wall at x = 20, a box in its shadow, a box beside it; all moved by `origin`.
WallScene wall_scene(const Vec3& origin = Vec3{0}, OccluderTag tag = OccluderTag::kAuto,
                     bool opaque = true) {
  SceneBuilder b;
  b.add_box(origin + Vec3{40, 0, -1}, origin + Vec3{42, 2, 1});
  b.add_box(origin + Vec3{40, 0, 40}, origin + Vec3{42, 2, 42});
  b.add_box(origin + Vec3{20, -1, -15}, origin + Vec3{21, 30, 15}, tag, opaque);
  return {std::move(b).finish(), 2, 0, 1};
}

TEST(Verifier, PassesWhatAWallHides) {
  const WallScene w = wall_scene();
  const CellReport report = check(w.scene, kCell, {w.hidden});
  EXPECT_EQ(report.false_negatives, 0U);
  EXPECT_EQ(report.rays, 64U);
  EXPECT_EQ(report.pvs, 2U);
  EXPECT_EQ(report.seen, 2U);
  EXPECT_EQ(report.discarded, 0U);
}

TEST(Verifier, CatchesAnObjectLeftOut) {
  const WallScene w = wall_scene();
  const CellReport report = check(w.scene, kCell, {w.hidden, w.beside});
  ASSERT_EQ(report.false_negatives, 1U);
  ASSERT_EQ(report.missing.size(), 1U);
  EXPECT_EQ(report.missing[0].id, w.beside);
  EXPECT_TRUE(kCell.contains(report.missing[0].eye));
  EXPECT_TRUE(w.scene.objects[w.beside].bounds.contains(report.missing[0].hit));
}

TEST(Verifier, ARayAimedAtOneFindsAnother) {
  const WallScene w = wall_scene();
  const CellReport report = check(w.scene, kCell, {w.hidden, w.wall});
  EXPECT_GE(report.false_negatives, 1U);
  EXPECT_EQ(report.missing.back().id, w.wall);
}

TEST(Verifier, WorksFarFromTheOrigin) {
  const Vec3 origin{10000, 300, -10000};
  const WallScene w = wall_scene(origin);
  const ViewCell cell{origin + kCell.eye, kCell.reach};
  EXPECT_EQ(check(w.scene, cell, {w.hidden}).false_negatives, 0U);
  EXPECT_EQ(check(w.scene, cell, {w.beside}).false_negatives, 1U);
}

/// The wall ends at (x, z) = (10, -5). The tangent from there to a circle of 1 m about the eye
/// meets x = 20 at z = -8.93, to one of 0.9 m at -9.03: the box at z >= -9.02 shows 0.1 m of its
/// side to the last tenth of the reach.
TEST(Verifier, CatchesASliverSeenFromTheRimOnly) {
  SceneBuilder b;
  b.add_box({20, 0, -9.02}, {20.02, 3, -8});
  b.add_box({10, -1, -5}, {10.1, 30, 30});
  const Scene scene = std::move(b).finish();
  for (const Reach& reach : {Reach::disc(1), Reach::cylinder(1, 0.1), Reach::box({1, 0.1, 1})})
    EXPECT_EQ(check(scene, {{0, 1.7, 0}, reach}, {0}).false_negatives, 1U) << reach.to_string();
  EXPECT_EQ(check(scene, {{0, 1.7, 0}, Reach::ball(1)}, {0}, nullptr, 256).false_negatives, 1U)
      << "the rim is a point";
  EXPECT_EQ(check(scene, {{0, 1.7, 0}, Reach::disc(0.9)}, {0}, nullptr, 4096).false_negatives, 0U);
}

TEST(Verifier, TransparentTrianglesDoNotBlockAndAreSeen) {
  const WallScene w = wall_scene({}, OccluderTag::kAuto, false);
  EXPECT_EQ(check(w.scene, kCell, {w.hidden}).false_negatives, 1U);
  EXPECT_EQ(check(w.scene, kCell, {w.wall}).false_negatives, 1U);
  EXPECT_EQ(check(w.scene, kCell, {}).seen, 3U);
}

TEST(Verifier, HiddenSolidsBlock) {
  const WallScene w = wall_scene({}, OccluderTag::kOnly);
  ASSERT_EQ(w.scene.objects.size(), 2U);
  EXPECT_EQ(check(w.scene, kCell, {w.hidden}).false_negatives, 0U);
}

TEST(Verifier, NeverNodesBlockUnlessAskedToSeeThrough) {
  const WallScene w = wall_scene({}, OccluderTag::kNever);
  const Pvs pvs = pvs_without(w.scene, kCell, {w.hidden});
  EXPECT_EQ(Verifier(w.scene, nullptr).check(pvs, {})->false_negatives, 0U);
  const Verifier strict(w.scene, nullptr, BlockerChoice::kOccluding);
  EXPECT_EQ(strict.check(pvs, {})->false_negatives, 1U);
}

Scene one_sided_wall(bool honour, bool front_to_eye) {
  SceneBuilder b;
  b.add_box({40, 0, -1}, {42, 2, 1});
  Mesh mesh;
  mesh.positions = {{20, -50, -50}, {20, 50, -50}, {20, 50, 50}, {20, -50, 50}};
  mesh.indices = {0, 1, 2, 0, 2, 3};  // front towards +x
  if (front_to_eye) std::reverse(mesh.indices.begin(), mesh.indices.end());
  mesh.primitives = {{0, 2, true, false}};
  b.add_mesh(std::move(mesh));
  Scene scene = std::move(b).finish();
  scene.honour_sidedness = honour;
  EXPECT_TRUE(finish_scene(scene));
  return scene;
}

TEST(Verifier, OneSidedWallBlocksFromBehindOnlyWhenSidesAreNotHonoured) {
  EXPECT_EQ(check(one_sided_wall(false, false), kCell, {0}).false_negatives, 0U);
  EXPECT_EQ(check(one_sided_wall(true, false), kCell, {0}).false_negatives, 1U);
  EXPECT_EQ(check(one_sided_wall(true, true), kCell, {0}).false_negatives, 0U);
}

TEST(Verifier, MoversMustBeListedAndHideNothing) {
  WallScene w = wall_scene();
  w.scene.objects[w.wall].always_visible = true;
  ASSERT_TRUE(finish_scene(w.scene));
  const CellReport wall = check(w.scene, kCell, {w.wall});
  ASSERT_EQ(wall.false_negatives, 1U);
  EXPECT_EQ(wall.missing[0].id, w.wall);
  EXPECT_EQ(check(w.scene, kCell, {w.hidden}).false_negatives, 1U);
}

TEST(Verifier, NodesWithoutTrianglesAreNeverMissed) {
  SceneBuilder b;
  b.add_mesh(Mesh{});
  b.add_box({5, 0, 5}, {6, 1, 6});
  const Scene scene = std::move(b).finish();
  EXPECT_EQ(check(scene, kCell, {0}).false_negatives, 0U);
}

TEST(Verifier, InstancesAreToldApart) {
  SceneBuilder b;
  Mesh cube;
  cube.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  cube.indices = {0, 1, 2, 0, 2, 3};
  cube.primitives = {{0, 2, true, true}};
  b.add_mesh(cube);
  Scene scene = std::move(b).finish();
  for (std::uint32_t i = 1; i < 6; ++i) {
    Object o = scene.objects[0];
    o.instance = i;
    o.to_world[0] = {10, 0, 0, 0};
    o.to_world[1] = {0, 10, 0, 0};
    o.to_world[3] = {-5, -2, 10.0 * i, 1};  // one behind the other
    scene.objects.push_back(o);
  }
  scene.objects[0].to_world[3] = {0, 0, -10, 1};
  ASSERT_TRUE(finish_scene(scene));
  const ViewCell cell{{0, 1.7, 0}, Reach::disc(0.1)};
  EXPECT_EQ(Verifier(scene, nullptr).seen_from(cell, 64, 1), (std::vector<ObjectId>{0, 1}));
}

/// One triangle's long edge meets many short ones, without a gap in double precision. 10 km from
/// the local origin single precision moves their corners by up to 0.5 mm off the edge: rays aimed
/// there slip through, and what they see must not be reported.
TEST(Verifier, ALeakOfSinglePrecisionIsNotAMiss) {
  SceneBuilder b;
  const Vec3 origin{0, 0, 10000};
  const Vec3 eye = origin + Vec3{0, 1.75, 0};
  Mesh wall;  // in the plane x = 20, cut along y = z
  wall.positions = {{20, -64, -64}, {20, 64, 64}, {20, -64, 64}, {20, 64, -64}};
  wall.indices = {0, 1, 2};
  std::vector<ObjectId> hidden;
  std::uint32_t last = 0;
  for (int k = -15; k <= 15; ++k) {
    const double s = 4.0 * k + (2 * (k + 40) + 1) / 8192.0;
    const Vec3 behind = eye + 1.5 * (origin + Vec3{20, s, s} - eye);
    hidden.push_back(b.add_box(behind - 0.005, behind + 0.005));
    wall.positions.emplace_back(20, s, s);
    const auto next = static_cast<std::uint32_t>(wall.positions.size() - 1);
    wall.indices.insert(wall.indices.end(), {3, last, next});
    last = next;
  }
  wall.indices.insert(wall.indices.end(), {3, last, 1});
  wall.primitives = {{0, static_cast<std::uint32_t>(wall.triangles()), true, true}};
  Mat4 to_world{1};
  to_world[3] = {origin, 1};
  b.add_mesh(std::move(wall), OccluderTag::kAuto, to_world);
  b.add_box({-1, -1, -10001}, {1, 1, -10000});  // puts the local origin far away
  const Scene scene = std::move(b).finish();
  EXPECT_EQ(check(scene, {eye, Reach()}, hidden).false_negatives, 0U);
}

/// Inside the closed box (the cell's far half) one would see what stands in it.
TEST(Verifier, ViewpointsInsideASolidDoNotCount) {
  SceneBuilder b;
  b.add_box({3.5, 0.5, -0.5}, {4, 1, 0.5});
  b.add_box({0.5, -1, -10}, {10, 10, 10});
  const Scene scene = std::move(b).finish();
  const CellReport report = check(scene, kCell, {0});
  EXPECT_EQ(report.false_negatives, 0U);
  EXPECT_GT(report.discarded, 4U);
  EXPECT_GT(report.viewpoints, 20U);
}

TEST(Verifier, ViewpointsInsideAHiddenSolidOrAKnownPrismDoNotCount) {
  SceneBuilder b;
  b.add_box({3.5, 0.5, -0.5}, {4, 1, 0.5});
  b.add_box({0.5, -1, -10}, {10, 10, 10}, OccluderTag::kOnly);
  EXPECT_EQ(check(std::move(b).finish(), kCell, {0}).false_negatives, 0U);

  // An open shell: closed meshes tell nothing, the occluder set does.
  SceneBuilder c;
  c.add_box({3.5, 0.5, -0.5}, {4, 1, 0.5});
  Mesh front;
  front.positions = {{0.5, -50, -50}, {0.5, 50, -50}, {0.5, 50, 50}, {0.5, -50, 50}};
  front.indices = {0, 1, 2, 0, 2, 3};
  front.primitives = {{0, 2, true, true}};
  c.add_mesh(std::move(front));
  const Scene open = std::move(c).finish();
  EXPECT_EQ(check(open, kCell, {0}).false_negatives, 1U) << "both sides of a sheet are free";
  OccluderSet set;
  set.scene_hash = open.hash;
  Prism prism;
  prism.footprint.rings = {{{0.5, -10}, {10, -10}, {10, 10}, {0.5, 10}}};
  prism.bottom = -1;
  prism.top = 10;
  set.solids.push_back(prism);
  EXPECT_EQ(check(open, kCell, {0}, &set).false_negatives, 0U);
}

TEST(Verifier, ViewpointsBehindAThinFenceStillCount) {
  SceneBuilder b;
  b.add_box({3.5, 0.5, -0.5}, {4, 1, 0.5});
  b.add_box({0.5, -1, -10}, {0.52, 10, 10});
  EXPECT_EQ(check(std::move(b).finish(), kCell, {0}).false_negatives, 1U);
}

TEST(Verifier, ViewpointsUnderTheGroundDoNotCount) {
  SceneBuilder b;
  const ObjectId cellar = b.add_box({5, -3, -1}, {6, -2, 1});
  b.add_ground({-100, -100}, {100, 100}, 0);
  b.add_box({30, 0, 30}, {40, 10, 40});
  b.add_box({-40, 0, 30}, {-30, 10, 40});
  b.add_box({-40, 0, -40}, {-30, 10, -30});
  const Scene scene = std::move(b).finish();
  const ViewCell deep{{0, 1.7, 0}, Reach::cylinder(1.5, 3)};
  const CellReport report = check(scene, deep, {cellar});
  EXPECT_EQ(report.false_negatives, 0U);
  EXPECT_GT(report.discarded, 10U);
}

TEST(Verifier, ACeilingIsNoGround) {
  SceneBuilder b;
  const ObjectId box = b.add_box({5, 0, -1}, {6, 2, 1});
  b.add_ground({-100, -100}, {100, 100}, 3);
  b.add_box({30, 0, 30}, {40, 2, 40});
  b.add_box({-40, 0, 30}, {-30, 2, 40});
  EXPECT_EQ(check(std::move(b).finish(), kCell, {box}).false_negatives, 1U);
}

TEST(Verifier, AListOfEverythingLeavesNothingToCheck) {
  const WallScene w = wall_scene();
  const CellReport report = check(w.scene, kCell, {});
  EXPECT_EQ(report.rays, 0U);
  EXPECT_EQ(report.false_negatives, 0U);
}

Scene crowd() {
  SceneBuilder b;
  for (int i = 0; i < 1500; ++i) {
    const Vec3 lo{5.0 + 3 * (i % 40), 0, 3.0 * (i / 40) - 50};
    b.add_box(lo, lo + Vec3{1, 0.5 + 0.1 * (i % 17), 1});
  }
  return std::move(b).finish();
}

TEST(Verifier, SaysTheSameForAnyNumberOfThreads) {
  const Scene scene = crowd();
  const Verifier verifier(scene, nullptr);
  Pvs pvs;
  pvs.cell = kCell;
  pvs.scene_hash = scene.hash;
  Context one;
  one.threads = 1;
  Context five;
  five.threads = 5;
  const CellReport a = *verifier.check(pvs, {}, one);
  const CellReport b = *verifier.check(pvs, {}, five);
  EXPECT_GT(a.false_negatives, 100U);
  EXPECT_EQ(a.rays, b.rays);
  EXPECT_EQ(a.seen, b.seen);
  EXPECT_EQ(a.false_negatives, b.false_negatives);
  ASSERT_EQ(a.missing.size(), 20U);
  ASSERT_EQ(b.missing.size(), 20U);
  for (std::size_t i = 0; i < 20; ++i) {
    EXPECT_EQ(a.missing[i].id, b.missing[i].id);
    EXPECT_EQ(a.missing[i].eye, b.missing[i].eye);
    EXPECT_EQ(a.missing[i].hit, b.missing[i].hit);
  }
}

TEST(Verifier, RefusesAPvsOfAnotherScene) {
  const WallScene w = wall_scene();
  const Verifier verifier(w.scene, nullptr);
  Pvs pvs = pvs_without(w.scene, kCell, {});
  ++pvs.scene_hash;
  auto report = verifier.check(pvs, {});
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().code, ErrorCode::kMismatch);
  --pvs.scene_hash;
  pvs.objects.push_back(77);
  report = verifier.check(pvs, {});
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().code, ErrorCode::kMismatch);
}

TEST(Verifier, StopsWhenAsked) {
  const WallScene w = wall_scene();
  const std::atomic<bool> stop{true};
  Context context;
  context.stop = &stop;
  const auto report =
      Verifier(w.scene, nullptr).check(pvs_without(w.scene, kCell, {0}), {}, context);
  ASSERT_FALSE(report);
  EXPECT_EQ(report.error().code, ErrorCode::kCancelled);
}

TEST(Verifier, TakesAnEmptyScene) {
  const Scene scene = SceneBuilder().finish();
  EXPECT_EQ(check(scene, kCell, {}).false_negatives, 0U);
}

}  // namespace
}  // namespace ivis
