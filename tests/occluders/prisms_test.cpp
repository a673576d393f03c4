#include "occluders/prisms.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "occluders/closed_mesh.h"
#include "tests/occluders/mesh_shapes.h"
#include "tests/support/scene_builder.h"

namespace ivis {
namespace {

using test::box_mesh;
using test::gabled_house;
using test::joined;
using test::SceneBuilder;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::SizeIs;

Scene scene_of(Mesh mesh, const Mat4& to_world = Mat4{1}, OccluderTag tag = OccluderTag::kAuto) {
  SceneBuilder b;
  b.add_mesh(std::move(mesh), tag, to_world);
  return std::move(b).finish();
}

/// How often a slanted ray from p leaves through the object's triangles.
int crossings(const Scene& scene, const Object& o, const Vec3& p) {
  const Vec3 d = glm::normalize(Vec3{0.313, 0.721, 0.518});
  int n = 0;
  for (std::size_t t = 0; t < scene.mesh_of(o).triangles(); ++t) {
    const Triangle w = world_triangle(scene, o, t);
    const Vec3 e = w.b - w.a;
    const Vec3 f = w.c - w.a;
    const Vec3 h = glm::cross(d, f);
    const double det = glm::dot(e, h);
    if (std::abs(det) < 1e-14) continue;
    const Vec3 s = p - w.a;
    const double u = glm::dot(s, h) / det;
    const Vec3 q = glm::cross(s, e);
    const double v = glm::dot(d, q) / det;
    if (u >= 0 && v >= 0 && u + v <= 1 && glm::dot(f, q) / det > 0) ++n;
  }
  return n;
}

/// Random points of every prism, near its faces too, lie inside the mesh by parity.
void expect_inside(const Scene& scene, const std::vector<Prism>& prisms) {
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> u(0, 1);
  for (const Prism& p : prisms) {
    const Aabb box = p.bounds();
    int tried = 0;
    for (int i = 0; i < 4000; ++i) {
      const double y = i % 3 == 0 ? 1e-4 : i % 3 == 1 ? 1 - 1e-4 : u(rng);
      const Vec3 x = box.lo + Vec3{u(rng), y, u(rng)} * box.size();
      if (!contains(p.footprint, ground(x))) continue;
      ++tried;
      ASSERT_EQ(crossings(scene, scene.objects[0], x) % 2, 1) << x.x << ' ' << x.y << ' ' << x.z;
    }
    EXPECT_GT(tried, 100);
  }
}

TEST(Prisms, ABoxIsOnePrismOfItsOwnSize) {
  const Scene s = scene_of(box_mesh({1, 2, 3}, {5, 12, 9}));
  const ObjectSolids found = extract_prisms(s, s.objects[0]);
  ASSERT_THAT(found.prisms, SizeIs(1));
  EXPECT_EQ(found.prisms[0].bottom, 2);
  EXPECT_EQ(found.prisms[0].solid_bottom, 2);
  EXPECT_EQ(found.prisms[0].top, 12);
  EXPECT_EQ(area(found.prisms[0].footprint), 24);
  EXPECT_THAT(found.prisms[0].footprint.rings[0], SizeIs(4));
  EXPECT_DOUBLE_EQ(found.volume, 240);
  EXPECT_THAT(found.left_out, IsEmpty());
}

TEST(Prisms, AnLShapeKeepsItsReflexCorner) {
  SceneBuilder b;
  b.add_prism({{0, 0}, {20, 0}, {20, 10}, {10, 10}, {10, 20}, {0, 20}}, 0, 6);
  const Scene s = std::move(b).finish();
  const auto found = extract_prisms(s, s.objects[0]);
  ASSERT_THAT(found.prisms, SizeIs(1));
  EXPECT_THAT(found.prisms[0].footprint.rings[0], SizeIs(6));
  EXPECT_EQ(area(found.prisms[0].footprint), 300);
  expect_inside(s, found.prisms);
}

TEST(Prisms, AGabledHouseIsAStaircaseUnderItsRoof) {
  const Scene s = scene_of(gabled_house());
  const auto found = extract_prisms(s, s.objects[0]);
  ASSERT_THAT(found.prisms, SizeIs(kMaxLevelsPerPiece));
  EXPECT_EQ(found.prisms[0].top, 5);
  EXPECT_NEAR(area(found.prisms[0].footprint), 80, 1e-3);
  for (std::size_t i = 1; i < found.prisms.size(); ++i) {
    EXPECT_GT(found.prisms[i].top, found.prisms[i - 1].top);
    EXPECT_LT(area(found.prisms[i].footprint), area(found.prisms[i - 1].footprint));
  }
  EXPECT_NEAR(found.volume, 80 * 5 + 80 * 4 / 2.0, 1e-6);
  expect_inside(s, found.prisms);
}

TEST(Prisms, ATurnedMirroredHouseTenKilometresAwayIsAsGood) {
  Mat4 m{1};
  const double a = 0.7;
  m[0] = {std::cos(a), 0, std::sin(a), 0};
  m[2] = {std::sin(a), 0, -std::cos(a), 0};  // determinant -1: the winding turns round
  m[3] = {10000.3, 250.7, -9000.1, 1};
  const Scene s = scene_of(gabled_house(), m);
  const auto found = extract_prisms(s, s.objects[0]);
  ASSERT_THAT(found.prisms, SizeIs(kMaxLevelsPerPiece));
  EXPECT_NEAR(area(found.prisms[0].footprint), 80, 1e-3);
  EXPECT_NEAR(found.volume, 560, 1e-6);
  expect_inside(s, found.prisms);
}

TEST(Prisms, ACourtyardStaysAHole) {
  // A frame: four abutting corners' worth of walls as one closed mesh.
  const std::vector<Vec2> outer{{0, 0}, {20, 0}, {20, 20}, {0, 20}};
  const std::vector<Vec2> inner{{6, 6}, {14, 6}, {14, 14}, {6, 14}};
  std::vector<Vec3> corners;
  for (const double y : {0.0, 9.0})
    for (const auto* ring : {&outer, &inner})
      for (const Vec2& p : *ring)
        corners.emplace_back(p.x, y, p.y);
  std::vector<std::vector<std::uint32_t>> faces;
  for (std::uint32_t i = 0; i < 4; ++i) {
    const std::uint32_t n = (i + 1) % 4;
    faces.push_back({i, 8 + i, 8 + n, n});            // outer wall
    faces.push_back({4 + n, 12 + n, 12 + i, 4 + i});  // court wall
    faces.push_back({i, n, 4 + n, 4 + i});            // below
    faces.push_back({12 + i, 12 + n, 8 + n, 8 + i});  // above
  }
  const Scene s = scene_of(test::mesh_of(corners, faces));
  const auto found = extract_prisms(s, s.objects[0]);
  ASSERT_THAT(found.prisms, SizeIs(1));
  EXPECT_THAT(found.prisms[0].footprint.rings, SizeIs(2));
  EXPECT_NEAR(area(found.prisms[0].footprint), 400 - 64, 1e-9);
  EXPECT_NEAR(found.volume, (400 - 64) * 9, 1e-9);
  expect_inside(s, found.prisms);
}

TEST(Prisms, OverlappingPiecesOfOneMeshAreSolidsOfTheirOwn) {
  const Scene s =
      scene_of(joined(box_mesh({0, 0, 0}, {10, 5, 10}), box_mesh({5, 0, 5}, {15, 8, 15})));
  const auto found = extract_prisms(s, s.objects[0]);
  ASSERT_THAT(found.prisms, SizeIs(2));
  EXPECT_EQ(area(found.prisms[0].footprint), 100);
  EXPECT_EQ(area(found.prisms[1].footprint), 100);
  EXPECT_EQ(found.prisms[1].top, 8);
}

TEST(Prisms, AnUndercutIsNotFilled) {
  // A table: a slab on one thick leg; under the slab is air.
  const Scene s = scene_of(test::mesh_of({{0, 0, 0},
                                          {2, 0, 0},
                                          {2, 0, 6},
                                          {0, 0, 6},
                                          {0, 3, 0},
                                          {2, 3, 0},
                                          {2, 3, 6},
                                          {0, 3, 6},
                                          {6, 3, 0},
                                          {6, 3, 6},
                                          {0, 5, 0},
                                          {6, 5, 0},
                                          {6, 5, 6},
                                          {0, 5, 6}},
                                         {{0, 1, 2, 3},
                                          {0, 4, 5, 1},
                                          {1, 5, 6, 2},
                                          {2, 6, 7, 3},
                                          {3, 7, 4, 0},
                                          {5, 8, 9, 6},
                                          {13, 12, 11, 10},
                                          {4, 10, 11, 8, 5},
                                          {8, 11, 12, 9},
                                          {6, 9, 12, 13, 7},
                                          {7, 13, 10, 4}}));
  const auto found = extract_prisms(s, s.objects[0]);
  ASSERT_FALSE(found.prisms.empty());
  expect_inside(s, found.prisms);
  EXPECT_NEAR(found.prisms[0].bounds().hi.x, 2, 1e-4);
}

TEST(Prisms, ABaseOnASlopeStartsAtItsHighestCorner) {
  Mesh m = box_mesh({0, 0, 0}, {10, 9, 10});
  m.positions[1].y = m.positions[2].y = 2;
  const Scene s = scene_of(m);
  const auto found = extract_prisms(s, s.objects[0]);
  ASSERT_FALSE(found.prisms.empty());
  EXPECT_EQ(found.prisms[0].bottom, 2);
  EXPECT_NEAR(area(found.prisms[0].footprint), 100, 1e-3);
  expect_inside(s, found.prisms);
}

TEST(Prisms, NamesWhyAMeshIsLeftOut) {
  Mesh open = box_mesh({0, 0, 0}, {5, 5, 5});
  open.indices.resize(open.indices.size() - 3);
  open.primitives[0].triangles -= 1;
  Mesh glass = box_mesh({0, 0, 0}, {5, 5, 5});
  glass.primitives[0].opaque = false;
  Mesh empty = box_mesh({0, 0, 0}, {5, 5, 5});
  empty.indices.clear();
  empty.primitives.clear();
  const struct {
    Mesh mesh;
    const char* reason;
    OccluderTag tag = OccluderTag::kAuto;
    Mat4 to_world{1};
  } cases[] = {
      {open, "open mesh"},
      {test::turned_inside_out(box_mesh({0, 0, 0}, {5, 5, 5})), "inside out"},
      {glass, "not opaque"},
      {empty, "no triangles"},
      {box_mesh({0, 0, 0}, {5, 5, 5}), "marked never", OccluderTag::kNever},
      {box_mesh({0, 0, 0}, {5, 0.001, 5}), "too thin or too sloped for a prism"},
      {box_mesh({3e7, 0, 0}, {4e7, 5, 5}), "too far from the origin"},
  };
  for (const auto& c : cases) {
    const Scene s = scene_of(c.mesh, c.to_world, c.tag);
    const auto found = extract_prisms(s, s.objects[0]);
    EXPECT_THAT(found.prisms, IsEmpty()) << c.reason;
    EXPECT_THAT(found.left_out, ElementsAre(Pair(c.reason, 1U)));
  }
}

TEST(Prisms, AnimatedObjectsAreLeftOut) {
  Scene s = scene_of(box_mesh({0, 0, 0}, {5, 5, 5}));
  s.objects[0].always_visible = true;
  EXPECT_THAT(extract_prisms(s, s.objects[0]).left_out, ElementsAre(Pair("moves", 1U)));
}

TEST(Prisms, AWindowOfGlassOpensTheMesh) {
  Mesh m = box_mesh({0, 0, 0}, {5, 5, 5});
  const auto all = static_cast<std::uint32_t>(m.triangles());
  m.primitives = {{0, all - 1, true, true}, {all - 1, 1, false, true}};
  const Scene s = scene_of(m);
  EXPECT_THAT(extract_prisms(s, s.objects[0]).left_out, ElementsAre(Pair("open mesh", 1U)));
}

TEST(Prisms, UnderHonouredSidednessOnlyConsistentWindingOccludes) {
  Mesh mixed = box_mesh({0, 0, 0}, {5, 5, 5});
  std::swap(mixed.indices[1], mixed.indices[2]);
  mixed.primitives[0].double_sided = false;
  Mesh good = box_mesh({0, 0, 0}, {5, 5, 5});
  good.primitives[0].double_sided = false;
  Scene s = scene_of(mixed);
  EXPECT_THAT(extract_prisms(s, s.objects[0]).prisms, SizeIs(1));
  s.honour_sidedness = true;
  EXPECT_THAT(extract_prisms(s, s.objects[0]).left_out,
              ElementsAre(Pair("winding not consistent", 1U)));
  Scene t = scene_of(good);
  t.honour_sidedness = true;
  EXPECT_THAT(extract_prisms(t, t.objects[0]).prisms, SizeIs(1));
}

TEST(Prisms, DuplicateAndDegenerateTrianglesDoNotOpenAMesh) {
  Mesh m = box_mesh({0, 0, 0}, {5, 5, 5});
  m.indices.insert(m.indices.end(), {0, 0, 1, 2, 2, 2, 0, 1, 2, 0, 1, 2});
  m.primitives[0].triangles += 4;
  const Scene s = scene_of(m);
  const auto found = extract_prisms(s, s.objects[0]);
  ASSERT_THAT(found.prisms, SizeIs(1));
  EXPECT_EQ(area(found.prisms[0].footprint), 25);
}

TEST(ClosedMesh, SectionsOfOrientedPiecesHaveTheSolidOnTheirLeft) {
  const Scene s = scene_of(box_mesh({0, 0, 0}, {5, 4, 5}));
  const WeldedMesh w = weld(s, s.objects[0]);
  ASSERT_THAT(w.pieces, SizeIs(1));
  EXPECT_THAT(w.points, SizeIs(8));
  EXPECT_TRUE(w.pieces[0].closed);
  EXPECT_TRUE(w.pieces[0].oriented);
  const auto loops = section(w, w.pieces[0], 1);
  ASSERT_THAT(loops, SizeIs(1));
  EXPECT_EQ(area(Polygon{{loops[0]}}), 25);
}

TEST(Prisms, RandomClosedMeshesNeverGetAPrismOutside) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int round = 0; round < 60; ++round) {
    Mesh m =
        round % 2 == 0 ? gabled_house() : joined(gabled_house(), box_mesh({2, -1, 2}, {14, 6, 6}));
    for (auto& p : m.positions)
      p += glm::vec3(u(rng), u(rng) * 0.7, u(rng));
    const Scene s = scene_of(m);
    const auto found = extract_prisms(s, s.objects[0]);
    std::uniform_real_distribution<double> v(0, 1);
    const WeldedMesh w = weld(s, s.objects[0]);
    for (const Prism& p : found.prisms) {
      const Aabb box = p.bounds();
      for (int i = 0; i < 300; ++i) {
        const Vec3 x = box.lo + Vec3{v(rng), v(rng), v(rng)} * box.size();
        if (!contains(p.footprint, ground(x))) continue;
        // Inside one of the pieces, that is: not all pieces have even parity. Of one piece: odd.
        if (w.pieces.size() == 1) {
          ASSERT_EQ(crossings(s, s.objects[0], x) % 2, 1) << round;
        } else {
          ASSERT_GT(crossings(s, s.objects[0], x), 0) << round;
        }
      }
    }
  }
}

}  // namespace
}  // namespace ivis
