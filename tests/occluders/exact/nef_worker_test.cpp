#include "occluders/nef_worker.h"

#include <chrono>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "tests/occluders/mesh_shapes.h"
#include "tests/support/scene_builder.h"

namespace ivis {
namespace {

using ::testing::HasSubstr;

/// An L of 6 x 6 m with arms of 3 m, 4 m high, outward.
Mesh ell() {
  return test::mesh_of({{0, 0, 0},
                        {6, 0, 0},
                        {6, 0, 3},
                        {3, 0, 3},
                        {3, 0, 6},
                        {0, 0, 6},
                        {0, 4, 0},
                        {6, 4, 0},
                        {6, 4, 3},
                        {3, 4, 3},
                        {3, 4, 6},
                        {0, 4, 6}},
                       {{0, 1, 2, 3},
                        {0, 3, 4, 5},
                        {9, 8, 7, 6},
                        {11, 10, 9, 6},
                        {0, 6, 7, 1},
                        {1, 7, 8, 2},
                        {2, 8, 9, 3},
                        {3, 9, 10, 4},
                        {4, 10, 11, 5},
                        {5, 11, 6, 0}});
}

Polyhedron polyhedron(const Mesh& mesh) {
  Polyhedron out;
  for (const glm::vec3& p : mesh.positions)
    out.points.emplace_back(p);
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3)
    out.triangles.push_back({mesh.indices[i], mesh.indices[i + 1], mesh.indices[i + 2]});
  return out;
}

const std::filesystem::path kWorker = IVIS_NEF;

TEST(NefWorker, AnEllLosesTheReachOnEverySideAndKeepsItsCorner) {
  const auto made = shrink_polyhedron(kWorker, polyhedron(ell()), {0.5, 0.25, 0.5},
                                      std::vector<double>{0, 0.5, 1.5}, 60);
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_FALSE(made->failed_check);
  ASSERT_EQ(made->levels.size(), 2U) << "arms of 3 m are gone at 0.5 + 1.5 m";
  Aabb box;
  for (const Vec3& p : made->levels[0].points)
    box.add(p);
  EXPECT_NEAR(box.lo.x, 0.5, 2e-6);
  EXPECT_NEAR(box.hi.x, 5.5, 2e-6);
  EXPECT_NEAR(box.lo.y, 0.25, 2e-6);
  EXPECT_NEAR(box.hi.y, 3.75, 2e-6);
  double volume = 0;
  for (const auto& f : made->levels[0].faces)
    volume += glm::dot(made->levels[0].points[f[0]],
                       glm::cross(made->levels[0].points[f[1]], made->levels[0].points[f[2]])) /
              6;
  EXPECT_NEAR(std::abs(volume), (5 * 2 + 2 * 3) * 3.5, 2e-4)
      << "an L still, of arms of 2 m, less 1e-6 m off its 116 m2";
  // The parts fill the solid: an eye in either arm is inside, one in the notch is not.
  const auto inside = [&](const Vec3& p) {
    return std::ranges::any_of(made->parts, [&](const ConvexSolid& c) { return contains(c, p); });
  };
  EXPECT_TRUE(inside({5, 1, 1}));
  EXPECT_TRUE(inside({1, 1, 5}));
  EXPECT_FALSE(inside({5, 1, 5}));
}

TEST(NefWorker, WhatItCannotTakeIsSaid) {
  Polyhedron open = polyhedron(ell());
  open.triangles.pop_back();
  const auto made = shrink_polyhedron(kWorker, open, {0.5, 0.25, 0.5}, std::vector<double>{0}, 60);
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(made.error().message, HasSubstr("not closed"));
}

TEST(NefWorker, AWorkerThatFailsHangsOrLiesCostsOneOccluder) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("ivis_nef_test_" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  const auto script = [&](const char* name, const std::string& body) {
    const auto file = folder / name;
    std::ofstream(file) << "#!/bin/sh\n" << body << '\n';
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
    return file;
  };
  const auto ask = [&](const std::filesystem::path& worker, double seconds) {
    return shrink_polyhedron(worker, polyhedron(ell()), {0.5, 0.25, 0.5}, std::vector<double>{0},
                             seconds);
  };
  EXPECT_EQ(ask(folder / "absent", 5).error().code, ErrorCode::kIo);
  EXPECT_EQ(ask(script("fails", "exit 3"), 5).error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(ask(script("hangs", "exec sleep 1000"), 0.3).error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(ask(script("babbles", "exec yes level"), 20).error().code, ErrorCode::kUnsupported);
  // A level that is the solid itself, not shrunk: the gate refuses it.
  const auto lies =
      ask(script("lies",
                 "echo 'parts 1 0p+0 0p+0 0p+0 1p+0 1p+0 1p+0 0 level 4 1p+0 1p+0 1p+0 1p+1 "
                 "1p+0 1p+0 1p+0 1p-4 1p+0 1p+0 1p+0 1p+1 4 0 2 1 0 1 3 0 3 2 1 2 3 "
                 "end '"),
          5);
  ASSERT_TRUE(lies) << lies.error().message;
  EXPECT_TRUE(lies->failed_check);
  EXPECT_TRUE(lies->levels.empty());
  EXPECT_EQ(ask(script("forgets", "echo 'parts 0 end '"), 5).error().code, ErrorCode::kUnsupported);
  std::atomic<bool> stop{true};
  Context context;
  context.stop = &stop;
  EXPECT_EQ(shrink_polyhedron(script("waits", "exec sleep 1000"), polyhedron(ell()),
                              {0.5, 0.25, 0.5}, std::vector<double>{0}, 100, context)
                .error()
                .code,
            ErrorCode::kCancelled);
  std::filesystem::remove_all(folder);
}

TEST(NefWorker, PartsKeepTheFaceThatAFinEndsOn) {
  // A block, 4 x 4 x 4 m, one edge of it chamfered by a metre, and a fin that stands on the
  // chamfer's upper edge: the fin's end puts corners on that edge.
  const Mesh block = test::mesh_of(
      {{0, 0, 0},
       {4, 0, 0},
       {4, 0, 4},
       {0, 0, 4},
       {0, 4, 0},
       {3, 4, 0},
       {3, 4, 4},
       {0, 4, 4},
       {4, 3, 0},
       {4, 3, 4},
       {3, 4, 1},
       {3, 4, 2},
       {1, 4, 1},
       {1, 4, 2},
       {3, 6, 1},
       {3, 6, 2},
       {1, 6, 1},
       {1, 6, 2}},
      {{0, 1, 2, 3},     {0, 4, 5, 8, 1},  {3, 2, 9, 6, 7},  {0, 3, 7, 4},     {1, 8, 9, 2},
       {5, 10, 8},       {10, 11, 8},      {11, 9, 8},       {11, 6, 9},       {4, 12, 5},
       {12, 10, 5},      {4, 7, 12},       {7, 13, 12},      {7, 6, 13},       {6, 11, 13},
       {12, 16, 14, 10}, {11, 15, 17, 13}, {13, 17, 16, 12}, {10, 14, 15, 11}, {16, 17, 15, 14}});
  const auto made =
      shrink_polyhedron(kWorker, polyhedron(block), {0.2, 0.2, 0.2}, std::vector<double>{0}, 60);
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_FALSE(made->failed_check);
  const auto inside = [&](const Vec3& p) {
    return std::ranges::any_of(made->parts, [&](const ConvexSolid& c) { return contains(c, p); });
  };
  EXPECT_TRUE(inside({3.4, 3.4, 3.2}));
  EXPECT_TRUE(inside({2, 5, 1.5}));
  for (double z = 0.1; z < 4; z += 0.3)
    EXPECT_FALSE(inside({3.7, 3.7, z})) << "cut off by the chamfer, z = " << z;
}

TEST(NefWorker, ShrinkingATiltedEllHidesAsASolidAndKnowsItsInside) {
  // Tilted, so that it is no prism.
  Mat4 tilt{1};
  tilt[0] = {0.8, 0.6, 0, 0};
  tilt[1] = {-0.6, 0.8, 0, 0};
  test::SceneBuilder b;
  b.add_mesh(ell(), OccluderTag::kAuto, tilt);
  const Scene scene = std::move(b).finish();
  ShrinkOptions options;
  options.reach = Reach::ball(0.3);
  const auto without = shrink(scene, options, FastEroder{});
  ASSERT_TRUE(without);
  EXPECT_EQ(without->set.solid_pieces.size(), 0U);
  options.polyhedra.worker = kWorker;
  options.polyhedra.seconds = 60;
  const auto with = shrink(scene, options, FastEroder{});
  ASSERT_TRUE(with) << with.error().message;
  EXPECT_EQ(with->report.polyhedra, 1U);
  EXPECT_EQ(with->report.polyhedra_shrunk, 1U);
  ASSERT_EQ(with->set.solid_pieces.size(), 1U);
  EXPECT_FALSE(with->set.solid_pieces[0].levels.empty());
  EXPECT_TRUE(inside_solid(with->set, Vec3(tilt * glm::dvec4(5, 1, 1, 1))));
  EXPECT_FALSE(inside_solid(with->set, Vec3(tilt * glm::dvec4(5, 1, 5, 1))));
  options.view_space = {ViewSpace::Kind::kInside, {Vec3(tilt * glm::dvec4(1, 1, 5, 1))}};
  const auto buried = shrink(scene, options, FastEroder{});
  ASSERT_FALSE(buried);
  EXPECT_THAT(buried.error().message, HasSubstr("seed 0"));
}

}  // namespace
}  // namespace ivis
