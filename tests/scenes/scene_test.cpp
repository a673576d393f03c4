// finish_scene and rank_order on scenes built by hand.
#include "scenes/scene.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>
#include <glm/gtc/matrix_transform.hpp>

namespace ivis::test {
namespace {

Mesh triangle() {
  Mesh m;
  m.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  m.indices = {0, 1, 2};
  m.primitives = {{0, 1, true, true}};
  return m;
}

Scene one_triangle() {
  Scene s;
  s.meshes = {triangle()};
  s.objects = {Object{}};
  return s;
}

void expect_refused(Scene s, const char* word) {
  const auto status = finish_scene(s);
  ASSERT_FALSE(status) << word;
  EXPECT_EQ(status.error().code, ErrorCode::kInput);
  EXPECT_NE(status.error().message.find(word), std::string::npos) << status.error().message;
}

TEST(FinishScene, RefusesWhatTheStructDoesNotAllow) {
  Scene s = one_triangle();
  s.meshes[0].indices[1] = 3;
  expect_refused(s, "index 3, expected below 3");
  s = one_triangle();
  s.meshes[0].indices.pop_back();
  expect_refused(s, "2 indices, expected a multiple of 3");
  s = one_triangle();
  s.meshes[0].positions[2].y = std::numeric_limits<float>::quiet_NaN();
  expect_refused(s, "position 2 is not finite");
  s = one_triangle();
  s.meshes[0].primitives.clear();
  expect_refused(s, "primitives do not cover");
  s = one_triangle();
  s.meshes[0].primitives[0].first_triangle = 1;
  expect_refused(s, "primitives do not cover");
  s = one_triangle();
  s.objects[0].mesh = 1;
  expect_refused(s, "node 0: mesh 1, expected below 1");
  s = one_triangle();
  s.node_names = {"wall"};
  s.objects[0].to_world[3][0] = std::numeric_limits<double>::infinity();
  expect_refused(s, "node 0 'wall': its transform is not finite");
  s = one_triangle();
  s.objects[0].to_world[0][0] = 1e31;
  expect_refused(s, "1e30");
}

TEST(FinishScene, BoxesHoldEveryCornerUnderAnyTransform) {
  Mesh mesh = triangle();
  mesh.positions = {
      {-3, 1, 2}, {5, -2, 7}, {0.1F, 9, -4}, {100, 100, 100}};  // the last is not used
  const Mat4 turned =
      glm::rotate(glm::translate(Mat4(1), Vec3(1e6, -2e5, 3e6)), 0.7, Vec3(1, 2, 3));
  const Mat4 mirrored = glm::scale(Mat4(1), Vec3(-2, 0.5, 3));
  const Mat4 swapped(glm::dvec4(0, 0, 2, 0), glm::dvec4(-1, 0, 0, 0), glm::dvec4(0, 3, 0, 0),
                     glm::dvec4(1, 2, 3, 1));
  for (const Mat4& m : {Mat4(1), turned, mirrored, swapped}) {
    Scene s = one_triangle();
    s.meshes[0] = mesh;
    s.objects[0].to_world = m;
    ASSERT_TRUE(finish_scene(s));
    const Aabb& box = s.objects[0].bounds;
    const Triangle t = world_triangle(s, s.objects[0], 0);
    Aabb tight;
    for (const Vec3& p : {t.a, t.b, t.c}) {
      EXPECT_TRUE(box.contains(p));
      tight.add(p);
    }
    EXPECT_LT(glm::length(box.lo - tight.lo), 1e-4) << "and is not larger than rounding asks for";
    EXPECT_LT(glm::length(box.hi - tight.hi), 1e-4);
    EXPECT_EQ(s.bounds.lo, box.lo);
  }
}

TEST(FinishScene, GrowsBoxesByTheTermsThatCancel) {
  // Positions around 1e9 in a node shifted by -1e9: the sum is small, its rounding is not.
  Scene s = one_triangle();
  for (auto& p : s.meshes[0].positions)
    p.x += 1e9F;
  s.objects[0].to_world = glm::translate(Mat4(1), Vec3(-1e9, 0, 0));
  ASSERT_TRUE(finish_scene(s));
  EXPECT_LE(s.objects[0].bounds.lo.x, -1e-4);
}

TEST(FinishScene, CountsTrianglesOfEachInstanceButNotOfSolids) {
  Scene s = one_triangle();
  s.objects.push_back(s.objects[0]);
  s.hidden_solids = {s.objects[0]};
  s.hidden_solids[0].to_world = glm::translate(Mat4(1), Vec3(0, 0, 50));
  ASSERT_TRUE(finish_scene(s));
  EXPECT_EQ(s.triangle_count, 2U);
  EXPECT_GT(s.bounds.hi.z, 49) << "the bounds hold the solids, too";
}

TEST(FinishScene, HashesAllThatVisibilityDependsOn) {
  const auto hash_of = [](auto edit) {
    Scene s = one_triangle();
    s.meshes.push_back(triangle());
    edit(s);
    EXPECT_TRUE(finish_scene(s));
    return s.hash;
  };
  std::vector<SceneHash> hashes{
      hash_of([](Scene&) {}),
      hash_of([](Scene& s) { s.meshes[0].positions[0].x = 1e-30F; }),
      hash_of([](Scene& s) {
        s.meshes[0].indices = {0, 2, 1};
      }),
      hash_of([](Scene& s) { s.meshes[0].primitives[0].opaque = false; }),
      hash_of([](Scene& s) { s.meshes[0].primitives[0].double_sided = false; }),
      hash_of([](Scene& s) { s.objects[0].tag = OccluderTag::kNever; }),
      hash_of([](Scene& s) { s.objects[0].always_visible = true; }),
      hash_of([](Scene& s) { s.objects[0].to_world[2][1] = 1e-300; }),
      hash_of([](Scene& s) { s.objects[0].mesh = 1; }),
      hash_of([](Scene& s) { s.objects[0].node = 1; }),
      hash_of([](Scene& s) { s.objects[0].instance = 1; }),
      hash_of([](Scene& s) { s.hidden_solids = s.objects; }),
      hash_of([](Scene& s) { s.objects.push_back(s.objects[0]); }),
      hash_of([](Scene& s) { s.honour_sidedness = true; }),
      hash_of([](Scene& s) { s.wholes = s.objects; }),
      hash_of([](Scene& s) { s.wholes = s.objects, s.objects[0].cluster = 1; }),
  };
  std::sort(hashes.begin(), hashes.end());
  EXPECT_EQ(std::adjacent_find(hashes.begin(), hashes.end()), hashes.end());
  EXPECT_EQ(hash_of([](Scene&) {}),
            hash_of([](Scene& s) { s.warnings = {"a"}, s.node_names = {"b"}; }));
}

Scene dots(const std::vector<Vec3>& at) {
  Scene s;
  s.meshes = {Mesh{}};
  for (const Vec3& p : at) {
    Object o;
    o.to_world = glm::translate(Mat4(1), p);
    s.objects.push_back(o);
  }
  EXPECT_TRUE(finish_scene(s));
  return s;
}

TEST(WorldTriangle, KeepsTheMeshsOrderUnderAMirroringTransform) {
  Scene s = one_triangle();
  s.objects[0].to_world = glm::scale(Mat4(1), Vec3(-1, 1, 1));
  ASSERT_TRUE(finish_scene(s));
  const Triangle t = world_triangle(s, s.objects[0], 0);
  EXPECT_EQ(t.b, Vec3(-1, 0, 0));
  EXPECT_LT(glm::cross(t.b - t.a, t.c - t.a).z, 0)
      << "who asks for the front must look at the determinant";
}

TEST(RankOrder, IsAPermutationThatKeepsNeighboursTogether) {
  std::vector<Vec3> grid;
  for (int k = 0; k < 64; ++k)
    grid.emplace_back((k * 37) % 64 % 8, 0, (k * 37) % 64 / 8);
  const Scene s = dots(grid);
  const auto order = rank_order(s);
  auto sorted = order;
  std::sort(sorted.begin(), sorted.end());
  for (ObjectId i = 0; i < 64; ++i)
    EXPECT_EQ(sorted[i], i);
  // Along a Morton curve the mean step on a grid is below 2; in the order of ids here it is
  // above 4.
  double steps = 0;
  for (std::size_t r = 1; r < order.size(); ++r)
    steps += glm::length(grid[order[r]] - grid[order[r - 1]]);
  EXPECT_LT(steps / 63, 2);
}

TEST(RankOrder, BreaksTiesById) {
  const Scene s = dots({{1, 2, 3}, {1, 2, 3}, {1, 2, 3}});
  EXPECT_EQ(rank_order(s), (std::vector<ObjectId>{0, 1, 2}));
}

TEST(RankOrder, TakesEmptyAndHugeScenes) {
  EXPECT_TRUE(rank_order(dots({})).empty());
  EXPECT_EQ(rank_order(dots({{5, 5, 5}})), std::vector<ObjectId>{0});
  EXPECT_EQ(rank_order(dots({{1e29, 0, 0}, {-1e29, 0, 0}})), (std::vector<ObjectId>{1, 0}));
}

}  // namespace
}  // namespace ivis::test
