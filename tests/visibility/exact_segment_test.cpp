#include "visibility/exact_segment.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/scene_builder.h"
#include "visibility/sampling.h"

namespace ivis {
namespace {

const Triangle kUpright{{10, 0, 0}, {10, 8, 0}, {10, 0, 8}};

TEST(SegmentMeets, InsideAndOutside) {
  EXPECT_TRUE(segment_meets(kUpright, {0, 2, 2}, {20, 2, 2}));
  EXPECT_TRUE(segment_meets(kUpright, {20, 2, 2}, {0, 2, 2}));
  EXPECT_FALSE(segment_meets(kUpright, {0, 5, 5}, {20, 5, 5}));
  EXPECT_FALSE(segment_meets(kUpright, {0, 2, 2}, {9, 2, 2})) << "ends before it";
  EXPECT_FALSE(segment_meets(kUpright, {11, 2, 2}, {20, 2, 2})) << "starts behind it";
}

TEST(SegmentMeets, EdgesAndCornersBelongToTheTriangle) {
  EXPECT_TRUE(segment_meets(kUpright, {0, 4, 4}, {20, 4, 4}));
  EXPECT_TRUE(segment_meets(kUpright, {0, 0, 4}, {20, 0, 4}));
  EXPECT_TRUE(segment_meets(kUpright, {0, 8, 0}, {20, 8, 0}));
  EXPECT_FALSE(segment_meets(kUpright, {0, 4 + 1e-9, 4 + 1e-9}, {20, 4 + 1e-9, 4 + 1e-9}));
}

TEST(SegmentMeets, AnEndOnTheTriangleDoesNotBlock) {
  EXPECT_FALSE(segment_meets(kUpright, {0, 1, 1}, {10, 2, 2}));
  EXPECT_FALSE(segment_meets(kUpright, {10, 2, 2}, {20, 1, 1}));
  EXPECT_TRUE(segment_meets(kUpright, {0, 1, 1}, {10 + 1e-9, 2, 2}));
}

TEST(SegmentMeets, AlongItsPlane) {
  EXPECT_TRUE(segment_meets(kUpright, {10, -5, 1}, {10, 20, 1}));
  EXPECT_TRUE(segment_meets(kUpright, {10, 1, 1}, {10, 2, 2})) << "within it";
  EXPECT_FALSE(segment_meets(kUpright, {10, -5, -1}, {10, 20, -1}));
  EXPECT_FALSE(segment_meets(kUpright, {10.001, -5, 1}, {10.001, 20, 1}));
}

TEST(SegmentMeets, TriangleWithoutAreaIsItsEdges) {
  const Triangle line{{10, 0, 0}, {10, 4, 0}, {10, 8, 0}};
  EXPECT_TRUE(segment_meets(line, {0, 2, 0}, {20, 2, 0}));
  EXPECT_FALSE(segment_meets(line, {0, 2, 0.001}, {20, 2, 0.001}));
  EXPECT_FALSE(segment_meets(line, {0, 9, 0}, {20, 9, 0}));
}

TEST(SegmentMeets, OneSidedBlocksFromItsFrontOnly) {
  const Vec3 n = glm::cross(kUpright.b - kUpright.a, kUpright.c - kUpright.a);
  const Vec3 front = Vec3{10, 2, 2} + n;
  const Vec3 back = Vec3{10, 2, 2} - n;
  EXPECT_TRUE(segment_meets(kUpright, front, back, true));
  EXPECT_FALSE(segment_meets(kUpright, back, front, true));
  EXPECT_TRUE(segment_meets(kUpright, back, front, false));
}

/// Corners, ends and products are integers below 2^53: every sign is exact, on edges and corners
/// too.
TEST(SegmentMeets, AgreesWithIntegerArithmetic) {
  Random random(5);
  const auto coordinate = [&] { return static_cast<double>(random.below(17)) - 8; };
  int met = 0;
  int touched = 0;
  for (int i = 0; i < 200000; ++i) {
    const auto point = [&] { return Vec3{coordinate(), coordinate(), coordinate()}; };
    const Triangle t{point(), point(), point()};
    const Vec3 q = point();
    const Vec3 y = point();
    const Vec3 n = glm::cross(t.b - t.a, t.c - t.a);
    const double hq = glm::dot(n, q - t.a);
    const double hy = glm::dot(n, y - t.a);
    if (hq == 0 && hy == 0) continue;  // in its plane: another test
    bool expected = false;
    if (hq * hy < 0) {
      const Vec3 d = y - q;
      const double u = glm::dot(d, glm::cross(t.c - q, t.b - q));
      const double v = glm::dot(d, glm::cross(t.a - q, t.c - q));
      const double w = glm::dot(d, glm::cross(t.b - q, t.a - q));
      expected = (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
      if (expected) {
        ++met;
        if (u == 0 || v == 0 || w == 0) ++touched;
      }
    }
    ASSERT_EQ(segment_meets(t, q, y), expected) << i;
  }
  EXPECT_GT(met, 1000);
  EXPECT_GT(touched, 100);
}

/// A wall of many cells, each cut along a diagonal, at an offset that floats cannot hold.
Mesh cut_wall(int cells, double size) {
  Mesh mesh;
  for (int y = 0; y <= cells; ++y)
    for (int z = 0; z <= cells; ++z)
      mesh.positions.emplace_back(0.1 * std::sin(y * 7 + z), size * y / cells,
                                  size * z / cells - size / 2);
  const auto at = [&](int y, int z) { return static_cast<std::uint32_t>(y * (cells + 1) + z); };
  for (int y = 0; y < cells; ++y)
    for (int z = 0; z < cells; ++z) {
      mesh.indices.insert(mesh.indices.end(), {at(y, z), at(y, z + 1), at(y + 1, z + 1)});
      mesh.indices.insert(mesh.indices.end(), {at(y, z), at(y + 1, z + 1), at(y + 1, z)});
    }
  mesh.primitives = {{0, static_cast<std::uint32_t>(mesh.triangles()), true, true}};
  return mesh;
}

TEST(ExactSegments, NothingSlipsThroughTheSharedEdgesOfAWall) {
  constexpr int kCells = 24;
  test::SceneBuilder b;
  Mat4 to_world{1};
  to_world[3] = {12345.678, 321.987, -9876.543, 1};
  b.add_mesh(cut_wall(kCells, 20), OccluderTag::kAuto, to_world);
  const Scene scene = std::move(b).finish();
  const Blockers blockers = find_blockers(scene);
  const ExactSegments segments(scene, blockers);
  Random random(3);
  for (std::size_t t = 0; t < blockers.triangles.size(); t += 2) {
    const Triangle w = world_triangle(scene, scene.objects[0], t);
    const bool inner = t / 2 / kCells > 0 && t / 2 % kCells > 0;  // corner a is not on the border
    for (int i = 0; i < 30; ++i) {
      const double s = i == 0 && inner ? 0 : 0.001 + 0.998 * random.unit();
      const Vec3 on = w.a + s * (w.c - w.a);  // the diagonal: two triangles share it
      const Vec3 q =
          Vec3(to_world[3]) + Vec3{-30 - 100 * random.unit(), 1.7, 40 * random.unit() - 20};
      ASSERT_TRUE(segments.blocked(q, on + 0.7 * (on - q))) << t << " " << i;
    }
  }
}

TEST(ExactSegments, AgreesWithEveryTriangleInTurn) {
  test::SceneBuilder b;
  Random random(11);
  const auto point = [&](double spread) {
    return Vec3{random.unit() - 0.5, random.unit() - 0.5, random.unit() - 0.5} * spread;
  };
  for (int i = 0; i < 60; ++i) {
    Mesh mesh;
    for (std::uint32_t t = 0; t < 1 + random.below(30); ++t) {
      const Vec3 centre = point(60);
      for (std::uint32_t k = 0; k < 3; ++k) {
        mesh.positions.emplace_back(centre + point(t % 5 == 0 ? 30 : 4));
        mesh.indices.push_back(static_cast<std::uint32_t>(mesh.indices.size()));
      }
    }
    mesh.primitives = {{0, static_cast<std::uint32_t>(mesh.triangles()), i % 7 != 0, true}};
    Mat4 to_world{1};
    to_world[0] = {2, 0.1, 0, 0};
    to_world[3] = {5000, 100, -7000, 1};
    b.add_mesh(std::move(mesh), i % 10 == 0 ? OccluderTag::kOnly : OccluderTag::kAuto, to_world);
  }
  const Scene scene = std::move(b).finish();
  const Blockers blockers = find_blockers(scene);
  const ExactSegments segments(scene, blockers);
  int met = 0;
  for (int i = 0; i < 4000; ++i) {
    const Vec3 q = Vec3{5000, 100, -7000} + point(150);
    Vec3 y = Vec3{5000, 100, -7000} + point(60);
    if (i % 8 == 0) y.x = q.x;  // a direction with a zero
    bool expected = false;
    for (const TriangleRef& ref : blockers.triangles)
      expected = expected || segment_meets(front_facing_triangle(scene, ref), q, y);
    ASSERT_EQ(segments.blocked(q, y), expected) << i;
    met += expected ? 1 : 0;
  }
  EXPECT_GT(met, 400);
  EXPECT_LT(met, 3600);
}

TEST(ExactSegments, EmptySceneBlocksNothing) {
  const Scene scene = test::SceneBuilder().finish();
  const Blockers blockers = find_blockers(scene);
  EXPECT_FALSE(ExactSegments(scene, blockers).blocked({0, 0, 0}, {1, 1, 1}));
}

TEST(Blockers, AreWhatIsDrawnOpaqueAndHiddenSolidsButNotMovers) {
  test::SceneBuilder b;
  b.add_box({0, 0, 0}, {1, 1, 1});
  b.add_box({2, 0, 0}, {3, 1, 1}, OccluderTag::kNever);
  b.add_box({4, 0, 0}, {5, 1, 1}, OccluderTag::kAuto, false);
  b.add_box({6, 0, 0}, {7, 1, 1}, OccluderTag::kOnly);
  b.add_box({8, 0, 0}, {9, 1, 1});
  Scene scene = std::move(b).finish();
  scene.objects.back().always_visible = true;
  const auto solids = [&](BlockerChoice choice) {
    std::vector<std::uint32_t> list;
    for (const TriangleRef& t : find_blockers(scene, choice).triangles)
      if (list.empty() || list.back() != t.solid) list.push_back(t.solid);
    return list;
  };
  EXPECT_EQ(solids(BlockerChoice::kDrawn), (std::vector<std::uint32_t>{0, 1, 4}));
  EXPECT_EQ(solids(BlockerChoice::kOccluding), (std::vector<std::uint32_t>{0, 4}));
}

TEST(Blockers, MirroredTriangleKeepsItsFront) {
  test::SceneBuilder b;
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {0, 1, 0}, {0, 0, 1}};  // front towards +x
  mesh.indices = {0, 1, 2};
  mesh.primitives = {{0, 1, true, false}};
  Mat4 mirror{1};
  mirror[1][1] = -1;
  b.add_mesh(mesh);
  b.add_mesh(mesh, OccluderTag::kAuto, mirror);
  Scene scene = std::move(b).finish();
  scene.honour_sidedness = true;
  const Blockers blockers = find_blockers(scene);
  ASSERT_EQ(blockers.first_one_sided, 0U);
  ASSERT_EQ(blockers.triangles.size(), 2U);
  for (const TriangleRef& ref : blockers.triangles) {
    const Triangle t = front_facing_triangle(scene, ref);
    EXPECT_GT(glm::cross(t.b - t.a, t.c - t.a).x, 0);
  }
}

}  // namespace
}  // namespace ivis
