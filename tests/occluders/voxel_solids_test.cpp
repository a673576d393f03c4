#include "occluders/voxel_solids.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "occluders/file.h"
#include "tests/occluders/voxel_scenes.h"

namespace ivis {
namespace {

using test::add_house;
using test::in_pieces;
using test::look_at_solids;
using test::SceneBuilder;
using test::set_for;
using test::turned;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

VoxelReport add(const Scene& scene, OccluderSet& set, double cell_m, VoxelOptions options = {},
                const Context& context = {}) {
  options.cell_m = cell_m;
  auto report = add_voxel_solids(scene, options, set, context);
  EXPECT_TRUE(report) << report.error().message;
  return report ? std::move(*report) : VoxelReport{};
}

void expect_unseen(const Scene& scene, const OccluderSet& set, const std::string& what) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const auto census = look_at_solids(scene, set, seed);
    EXPECT_EQ(census.seen, 0U) << what << ": from " << census.from.x << ',' << census.from.y << ','
                               << census.from.z << " to " << census.to.x << ',' << census.to.y
                               << ',' << census.to.z;
  }
}

ViewSpace seen_from(const Vec3& p) {
  return {ViewSpace::Kind::kInside, {p}};
}

TEST(VoxelSolids, AClosedBoxLosesTheReachTheMarginAndAVoxel) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {20, 10, 20});
  const Scene scene = std::move(b).finish();
  OccluderSet set = set_for(Reach::cylinder(1, 0.2), {}, {0.1, 1});
  const VoxelReport r = add(scene, set, 0.5);
  EXPECT_EQ(r.proven, 1U);
  EXPECT_EQ(r.by_evidence, 0U);
  EXPECT_EQ(r.leaking, 0U);
  ASSERT_FALSE(set.solid_pieces.empty());
  EXPECT_TRUE(in_pieces(set, 0, {10.01, 5.01, 10.01}));
  EXPECT_TRUE(in_pieces(set, 0, {2.26, 1.76, 2.26}));
  EXPECT_FALSE(in_pieces(set, 0, {1.01, 5.01, 10.01}));
  EXPECT_FALSE(in_pieces(set, 0, {10.01, 0.25, 10.01}));
  EXPECT_TRUE(in_pieces(set, 1, {10.01, 5.01, 10.01}));
  EXPECT_FALSE(in_pieces(set, 1, {1.9, 5.01, 10.01}));
  EXPECT_TRUE(inside_solid(set, {10, 5, 10}));
  EXPECT_TRUE(inside_solid(set, {1.2, 1.2, 1.2}));
  EXPECT_FALSE(inside_solid(set, {-0.1, 5, 10}));
  EXPECT_FALSE(set.sealed);
  expect_unseen(scene, set, "box");
}

TEST(VoxelSolids, ABodyOfAnyWindingAndOneThatCutsItselfAreSolid) {
  for (const Mesh& mesh : {test::turned_inside_out(test::box_mesh({0, 0, 0}, {8, 8, 8})),
                           test::joined(test::box_mesh({0, 0, 0}, {8, 8, 8}),
                                        test::box_mesh({3, 3, 3}, {12, 6, 6}))}) {
    SceneBuilder b;
    b.add_mesh(mesh);
    const Scene scene = std::move(b).finish();
    OccluderSet set = set_for(Reach::ball(0.3));
    const VoxelReport r = add(scene, set, 0.5);
    EXPECT_GE(r.proven, 1U);
    EXPECT_TRUE(in_pieces(set, 0, {1.51, 1.51, 1.51}));
    expect_unseen(scene, set, "body");
  }
}

TEST(VoxelSolids, ABoxWithoutALidIsNot) {
  SceneBuilder b;
  b.add_mesh(test::mesh_of(
      {{0, 0, 0}, {8, 0, 0}, {8, 0, 8}, {0, 0, 8}, {0, 8, 0}, {8, 8, 0}, {8, 8, 8}, {0, 8, 8}},
      {{0, 1, 2, 3}, {0, 4, 5, 1}, {1, 5, 6, 2}, {2, 6, 7, 3}, {3, 7, 4, 0}}));
  const Scene scene = std::move(b).finish();
  OccluderSet set = set_for(Reach::ball(0.3));
  const VoxelReport r = add(scene, set, 0.5);
  EXPECT_EQ(r.components, 0U);
  EXPECT_THAT(set.solid_pieces, IsEmpty());
  EXPECT_FALSE(inside_solid(set, {4, 4, 4}));
}

TEST(VoxelSolids, AHouseOfTouchingSlabsIsShutByEvidence) {
  SceneBuilder b;
  add_house(b, 0, 0, turned(0.3, 0));
  const Scene scene = std::move(b).finish();
  OccluderSet set = set_for(Reach::ball(0.2));
  const VoxelReport r = add(scene, set, 0.25);
  EXPECT_EQ(r.by_evidence, 1U);
  EXPECT_EQ(r.leaking, 0U);
  EXPECT_GT(r.rays, 10000U);
  EXPECT_FALSE(set.solid_pieces.empty());
  expect_unseen(scene, set, "house");
  OccluderSet strict = set_for(Reach::ball(0.2));
  VoxelOptions options;
  options.proven_only = true;
  EXPECT_EQ(add(scene, strict, 0.25, options).dropped, 1U);
  EXPECT_THAT(strict.solid_pieces, IsEmpty());
}

// The grid seals these; neither a door nor a slit may stay sealed, however the house stands.
TEST(VoxelSolids, AHouseWithADoorIsOpen) {
  for (const double turn : {0.0, 0.4, 0.785})
    for (const double tilt : {0.0, 0.3})
      for (const double width : {0.9, 0.5, 0.3, 0.1}) {
        SceneBuilder b;
        add_house(b, width, 2, turned(turn, tilt, {0.13, 0.21, 0.37}));
        const Scene scene = std::move(b).finish();
        OccluderSet set = set_for(Reach::ball(0.2));
        const VoxelReport r = add(scene, set, 0.5);
        EXPECT_EQ(r.by_evidence + r.proven, 0U)
            << width << " m, turned " << turn << ", tilted " << tilt;
        EXPECT_THAT(set.solid_pieces, IsEmpty()) << width;
        EXPECT_FALSE(inside_solid(
            set, Vec3(turned(turn, tilt, {0.13, 0.21, 0.37}) * glm::dvec4(5, 2.5, 4, 1))));
      }
}

TEST(VoxelSolids, TheFineFloodAloneFindsAnOpeningOfAVoxel) {
  for (const double turn : {0.0, 0.4, 0.785}) {
    SceneBuilder b;
    add_house(b, 0.5, 2, turned(turn, 0));
    const Scene scene = std::move(b).finish();
    OccluderSet set = set_for(Reach::ball(0.2));
    VoxelOptions options;
    options.max_rays = 0;
    const VoxelReport r = add(scene, set, 0.5, options);
    EXPECT_EQ(r.rays, 0U);
    EXPECT_THAT(set.solid_pieces, IsEmpty()) << turn;
  }
}

TEST(VoxelSolids, RaysFindASlitOfAMillimetreAndSayWhere) {
  for (const double width : {0.05, 0.01, 0.003, 0.001})
    for (const double turn : {0.0, 0.4}) {
      SceneBuilder b;
      add_house(b, width, 2, turned(turn, turn));
      const Scene scene = std::move(b).finish();
      OccluderSet set = set_for(Reach::ball(0.2));
      const VoxelReport r = add(scene, set, 0.5);
      ASSERT_EQ(r.leaks.size(), 1U) << width << ' ' << turn;
      EXPECT_TRUE(r.leaks[0].by_ray);
      EXPECT_GT(r.leaks[0].volume_m3, 100);
      const Vec3 where = glm::transpose(glm::dmat3(turned(turn, turn))) * r.leaks[0].where;
      EXPECT_NEAR(where.x, 4, 4);
      EXPECT_NEAR(where.z, 0, 2);
      EXPECT_THAT(set.solid_pieces, IsEmpty());
    }
}

// A sheet with a slit, and one that fails to meet its neighbour at the corner.
TEST(VoxelSolids, RaysFindASlitInASheet) {
  for (const double width : {0.05, 0.01, 0.002})
    for (const bool corner : {false, true}) {
      SceneBuilder b;
      const auto quad = [&](const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s) {
        b.add_mesh(test::quad_mesh(p, q, r, s), OccluderTag::kAuto, turned(0.3, 0.2));
      };
      quad({0, 0, 0}, {8, 0, 0}, {8, 0, 8}, {0, 0, 8});
      quad({0, 5, 0}, {8, 5, 0}, {8, 5, 8}, {0, 5, 8});
      quad({0, 0, 0}, {0, 5, 0}, {0, 5, 8}, {0, 0, 8});
      quad({8, 0, 0}, {8, 5, 0}, {8, 5, 8}, {8, 0, 8});
      quad({0, 0, 8}, {8, 0, 8}, {8, 5, 8}, {0, 5, 8});
      const double x = corner ? 0 : 3.3;
      if (x > 0) quad({0, 0, 0}, {x, 0, 0}, {x, 5, 0}, {0, 5, 0});
      quad({x + width, 0, 0}, {8, 0, 0}, {8, 5, 0}, {x + width, 5, 0});
      const Scene scene = std::move(b).finish();
      OccluderSet set = set_for(Reach::ball(0.2));
      EXPECT_EQ(add(scene, set, 0.5).leaking, 1U) << width << ' ' << corner;
      EXPECT_THAT(set.solid_pieces, IsEmpty());
    }
}

TEST(VoxelSolids, WhatIsSealedOnPurposeIsKeptAndSaidSo) {
  SceneBuilder b;
  add_house(b, 0.3, 2);
  const Scene scene = std::move(b).finish();
  OccluderSet set = set_for(Reach::ball(0.2));
  VoxelOptions options;
  options.seal = true;
  const VoxelReport r = add(scene, set, 0.5, options);
  EXPECT_EQ(r.leaking, 1U);
  EXPECT_TRUE(set.sealed);
  EXPECT_FALSE(set.solid_pieces.empty());
}

TEST(VoxelSolids, ClutterBeforeAWallIsNeverSolid) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> u(0, 1);
  SceneBuilder b;
  b.add_box({0, 0, 10}, {20, 8, 16});
  for (int i = 0; i < 1500; ++i) {
    const Vec3 p{20 * u(rng), 8 * u(rng), 7 + 3 * u(rng)};
    const auto near = [&] { return p + Vec3(u(rng), u(rng), u(rng)) * 0.5; };
    b.add_mesh(test::mesh_of({near(), near(), near()}, {{0, 1, 2}}));
  }
  const Scene scene = std::move(b).finish();
  OccluderSet set = set_for(Reach::ball(0.2), {}, {0.0, 0.1});
  const VoxelReport r = add(scene, set, 0.5);
  EXPECT_EQ(r.proven, 1U);
  for (const SolidPiece& p : set.solid_pieces)
    for (const FaceMesh& m : p.levels)
      for (const Vec3& q : m.points)
        EXPECT_GT(q.z, 10.2);
  expect_unseen(scene, set, "clutter");
}

TEST(VoxelSolids, WhatDoesNotBlockIsFloodedThrough) {
  const auto solid = [](const char* what, const auto& build) {
    SceneBuilder b;
    build(b);
    Scene scene = std::move(b).finish();
    if (std::string(what) == "single-sided") {
      scene.honour_sidedness = true;
      for (Mesh& m : scene.meshes)
        m.primitives[0].double_sided = false;
    }
    if (std::string(what) == "mover") scene.objects[0].always_visible = true;
    OccluderSet set = set_for(Reach::ball(0.2));
    add(scene, set, 0.5);
    return !set.solid_pieces.empty();
  };
  EXPECT_TRUE(solid("box", [](SceneBuilder& b) { b.add_box({0, 0, 0}, {8, 8, 8}); }));
  EXPECT_TRUE(solid("only", [](SceneBuilder& b) {
    b.add_box({0, 0, 0}, {8, 8, 8}, OccluderTag::kOnly);
    b.add_box({20, 0, 0}, {21, 1, 1});
  }));
  EXPECT_FALSE(solid("never", [](SceneBuilder& b) {
    b.add_box({0, 0, 0}, {8, 8, 8}, OccluderTag::kNever);
  }));
  EXPECT_FALSE(solid("MASK", [](SceneBuilder& b) {
    b.add_box({0, 0, 0}, {8, 8, 8}, OccluderTag::kAuto, false);
  }));
  EXPECT_FALSE(solid("single-sided", [](SceneBuilder& b) { b.add_box({0, 0, 0}, {8, 8, 8}); }));
  EXPECT_FALSE(solid("mover", [](SceneBuilder& b) { b.add_box({0, 0, 0}, {8, 8, 8}); }));
}

TEST(VoxelSolids, FromWithinARoomAllElseIsSolid) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {10, 4, 10});
  b.add_box({20, 0, 0}, {30, 4, 10});
  const Scene scene = std::move(b).finish();
  OccluderSet set = set_for(Reach::ball(0.2), seen_from({5, 2, 5}));
  const VoxelReport r = add(scene, set, 0.5);
  EXPECT_EQ(r.proven, 2U);  // the outside and the other room
  EXPECT_TRUE(in_pieces(set, 0, {15.01, 2.01, 5.01}) || r.deep_pieces > 0);
  EXPECT_FALSE(inside_solid(set, {5, 2, 5}));
  EXPECT_TRUE(inside_solid(set, {15, 2, 5}));
  EXPECT_TRUE(inside_solid(set, {25, 2, 5}));
  EXPECT_TRUE(inside_solid(set, {500, 2, 5}));
  EXPECT_TRUE(inside_solid(set, {5, -700, 5}));
  expect_unseen(scene, set, "room");
}

TEST(VoxelSolids, ASeedBesideAWallReachesItsOwnSideOnly) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {10, 4, 10});
  const Scene scene = std::move(b).finish();
  OccluderSet set = set_for(Reach::ball(0.2), seen_from({0.02, 2.03, 5.04}));
  const VoxelReport r = add(scene, set, 0.5);
  EXPECT_EQ(r.seeds_moved, 1U);
  EXPECT_FALSE(inside_solid(set, {5, 2, 5}));
  EXPECT_TRUE(inside_solid(set, {-5, 2, 5}));
  OccluderSet none = set_for(Reach::ball(0.2), {ViewSpace::Kind::kInside, {}});
  EXPECT_FALSE(add_voxel_solids(scene, {}, none));
}

TEST(VoxelSolids, ASeedWalledInByClutterOpensAllAboutIt) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {10, 4, 10});
  b.add_box({4.9, 1.9, 4.9}, {5.1, 2.1, 5.1});  // about the seed
  const Scene scene = std::move(b).finish();
  OccluderSet set = set_for(Reach::ball(0.2), seen_from({5, 2, 5}));
  const VoxelReport r = add(scene, set, 0.5);
  EXPECT_EQ(r.seeds_unclear, 1U);
  EXPECT_FALSE(inside_solid(set, {2, 2, 2}));
}

TEST(VoxelSolids, HostileMeshesNeverMakeAFalseOccluder) {
  std::mt19937 rng(11);
  std::uniform_real_distribution<double> u(0, 1);
  for (int round = 0; round < 12; ++round) {
    SceneBuilder b;
    for (int i = 0; i < 12; ++i) {
      const Vec3 lo{20 * u(rng), 20 * u(rng), 20 * u(rng)};
      Mesh m = test::box_mesh(lo, lo + Vec3(u(rng), u(rng), u(rng)) * 8.0 + 0.3);
      for (auto& p : m.positions)
        p += glm::vec3(u(rng), u(rng), u(rng)) * (round % 3 == 0 ? 0.0F : 2.0F);
      if (i % 3 == 1) m.indices.resize(m.indices.size() - 6);  // a face is missing
      if (i % 4 == 2) m = test::turned_inside_out(m);
      if (i % 5 == 3) m.indices.insert(m.indices.end(), {0, 1, 6, 0, 0, 0, 1, 1, 2, 0, 6, 0});
      if (i % 6 == 4) m.positions[3] = m.positions[2] = m.positions[1];
      m.primitives = {{0, static_cast<std::uint32_t>(m.triangles()), true, true}};
      b.add_mesh(m, i % 7 == 5 ? OccluderTag::kOnly : OccluderTag::kAuto,
                 round % 2 == 0 ? Mat4{1} : turned(u(rng) * 6, u(rng) * 6, {3, 2, 1}));
    }
    const Scene scene = std::move(b).finish();
    OccluderSet set =
        set_for(round % 2 == 0 ? Reach::ball(0.1) : Reach::box({0.1, 0.3, 0.2}), {}, {0.02, 0.2});
    add(scene, set, 0.25);
    expect_unseen(scene, set, "round " + std::to_string(round));
  }
}

TEST(VoxelSolids, HoldFarFromTheOrigin) {
  for (const Vec3& at : {Vec3{10000, 200, -10000}, Vec3{1e6, -1e6, 1e6}}) {
    for (const double width : {0.0, 0.3}) {
      SceneBuilder b;
      add_house(b, width, 2, turned(0.3, 0.1, at));
      b.add_mesh(test::box_mesh({0, 0, 0}, {0.004, 0.003, 0.002}), OccluderTag::kAuto,
                 turned(0, 0, at));
      const Scene scene = std::move(b).finish();
      OccluderSet set = set_for(Reach::ball(0.2));
      set.slack_m = 0.001;
      const VoxelReport r = add(scene, set, 0.25);
      EXPECT_EQ(set.solid_pieces.empty(), width > 0) << at.x << ' ' << width;
      EXPECT_EQ(r.leaking, width > 0 ? 1U : 0U);
      expect_unseen(scene, set, "far");
    }
  }
}

TEST(VoxelSolids, DetailBelowAVoxelFarAwayIsMarked) {
  SceneBuilder b;  // millimetres, 10 km from where the scene begins
  b.add_box({0, 0, 0}, {0.01, 0.01, 0.01});
  b.add_mesh(test::box_mesh({0, 0, 0}, {1, 1, 1}), OccluderTag::kAuto,
             turned(0.2, 0.1, {300, 0, 0}));
  const Scene scene = std::move(b).finish();
  OccluderSet set = set_for(Reach::ball(0.02), {}, {0.01});
  const VoxelReport r = add(scene, set, 0.02);
  EXPECT_EQ(r.proven, 1U);
  EXPECT_GT(r.kept_m3.at(0), 0.5);
  expect_unseen(scene, set, "small");
}

TEST(VoxelSolids, AnEmptySceneAndASinglePointAreHarmless) {
  Scene scene;
  ASSERT_TRUE(finish_scene(scene));
  OccluderSet set = set_for(Reach::ball(1));
  EXPECT_EQ(add(scene, set, 0.5).pieces, 0U);
  SceneBuilder b;
  b.add_mesh(test::mesh_of({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, {{0, 1, 2}}));
  const Scene point = std::move(b).finish();
  EXPECT_EQ(add(point, set, 0.5).pieces, 0U);
  EXPECT_THAT(set.closed_boxes, IsEmpty());
}

TEST(VoxelSolids, DoNotDependOnTheNumberOfThreads) {
  std::string first;
  for (const unsigned threads : {1U, 2U, 5U}) {
    SceneBuilder b;
    add_house(b, 0, 0, turned(0.3, 0));
    add_house(b, 0.05, 2, turned(0.1, 0, {20, 0, 0}));
    b.add_box({-20, 0, 0}, {-5, 9, 9});
    const Scene scene = std::move(b).finish();
    OccluderSet set = set_for(Reach::cylinder(0.3, 0.1));
    Context context;
    context.threads = threads;
    add(scene, set, 0.25, {}, context);
    const std::string bytes = encode_occluders(set);
    if (first.empty()) first = bytes;
    EXPECT_EQ(bytes, first) << threads;
  }
}

TEST(VoxelSolids, ReadBackFromAFile) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {20, 10, 20});
  const Scene scene = std::move(b).finish();
  OccluderSet set = set_for(Reach::cylinder(1, 0.2));
  add(scene, set, 0.5);
  const std::string bytes = encode_occluders(set);
  const auto back = decode_occluders(std::as_bytes(std::span(bytes)), "memory");
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back->solid_pieces.size(), set.solid_pieces.size());
}

TEST(VoxelSolids, WhatDoesNotFitSaysSoAndChangesNothing) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {2000, 10, 2000});
  const Scene scene = std::move(b).finish();
  const auto refused = [&](double cell, std::size_t bytes, const char* text) {
    OccluderSet set = set_for(Reach::ball(1));
    VoxelOptions options;
    options.cell_m = cell;
    options.max_bytes = bytes;
    const auto r = add_voxel_solids(scene, options, set);
    ASSERT_FALSE(r) << cell;
    EXPECT_EQ(r.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(r.error().message, HasSubstr(text));
    EXPECT_THAT(set.margins_m, IsEmpty());
    EXPECT_THAT(set.closed_boxes, IsEmpty());
  };
  refused(0.001, 4'000'000'000, "the limit is");
  refused(0.01, 1'000'000'000, "the limit is 1000 MB");
  refused(0.25, 20'000'000, "the limit is 20 MB");
  refused(0, 1'000'000'000, "voxel size");
  refused(-1, 1'000'000'000, "voxel size");
  refused(std::nan(""), 1'000'000'000, "voxel size");
}

TEST(VoxelSolids, AStopIsObeyedAtEveryStageAndChangesNothing) {
  SceneBuilder b;
  add_house(b, 0, 0, turned(0.3, 0));
  b.add_box({-20, 0, 0}, {-5, 9, 9});
  const Scene scene = std::move(b).finish();
  for (int after = 0; after < 12; ++after) {
    std::atomic<bool> stop = after == 0;
    std::atomic<int> reports = 0;
    Context context;
    context.stop = &stop;
    std::string last;
    context.progress = [&](std::string_view stage, std::size_t, std::size_t) {
      if (stage != last && ++reports == after) stop = true;
      last = stage;
    };
    OccluderSet set = set_for(Reach::ball(0.2));
    VoxelOptions options;
    options.cell_m = 0.25;
    const auto r = add_voxel_solids(scene, options, set, context);
    if (r) {
      EXPECT_GT(after, 5);  // there are that many stages
      continue;
    }
    EXPECT_EQ(r.error().code, ErrorCode::kCancelled);
    EXPECT_THAT(set.solid_pieces, IsEmpty());
    EXPECT_THAT(set.margins_m, IsEmpty());
  }
}

TEST(VoxelSolids, AReachWiderThanTheWindowLeavesMarginsOut) {
  SceneBuilder b;
  b.add_box({0, 0, 0}, {20, 10, 20});
  const Scene scene = std::move(b).finish();
  OccluderSet set = set_for(Reach::ball(1000));
  const VoxelReport r = add(scene, set, 0.5);
  EXPECT_EQ(r.levels_too_wide, 6U);
  EXPECT_THAT(set.solid_pieces, IsEmpty());
  EXPECT_TRUE(inside_solid(set, {10, 5, 10}));
}

}  // namespace
}  // namespace ivis
