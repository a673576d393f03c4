#include "occluders/convex.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "core/view_cell.h"
#include "scenes/load.h"
#include "tests/occluders/mesh_shapes.h"
#include "tests/support/scene_builder.h"
#include "tests/support/shared_data.h"

namespace ivis {
namespace {

using test::SceneBuilder;
using ::testing::Contains;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::SizeIs;

ObjectConvex convex_of(Mesh mesh, OccluderTag tag = OccluderTag::kAuto, const Mat4& at = Mat4{1},
                       bool honour_sidedness = false) {
  SceneBuilder b;
  b.add_mesh(std::move(mesh), tag, at);
  Scene scene = std::move(b).finish();
  scene.honour_sidedness = honour_sidedness;
  return extract_convex(scene,
                        scene.hidden_solids.empty() ? scene.objects[0] : scene.hidden_solids[0]);
}

Mat4 turned(double angle, const Vec3& axis, const Vec3& by) {
  const Vec3 a = glm::normalize(axis);
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  Mat4 m{1};
  for (int j = 0; j < 3; ++j) {
    Vec3 e{0};
    e[j] = 1;
    m[j] = glm::dvec4(e * c + glm::cross(a, e) * s + a * (glm::dot(a, e) * (1 - c)), 0);
  }
  m[3] = glm::dvec4(by, 1);
  return m;
}

/// Tetrahedron, skew.
Mesh tetrahedron() {
  return test::mesh_of({{0, 0, 0}, {4, 0, 1}, {1, 0, 5}, {2, 6, 2}},
                       {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}});
}

double volume_of(const FaceMesh& mesh) {
  double six = 0;
  for (const auto& f : mesh.faces) {
    const Vec3 o = mesh.points[0];
    const auto p = [&](std::size_t k) { return mesh.points[f[k]] - o; };
    six += glm::dot(p(0), glm::cross(p(1), p(2)));
    if (f[2] != f[3]) six += glm::dot(p(0), glm::cross(p(2), p(3)));
  }
  return six / 6;
}

/// Every edge once in each direction.
bool closed(const FaceMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& f : mesh.faces) {
    const std::size_t n = f[2] == f[3] ? 3 : 4;
    for (std::size_t k = 0; k < n; ++k)
      ++edges[{f[k], f[(k + 1) % n]}];
  }
  for (const auto& [e, count] : edges) {
    const auto back = edges.find({e.second, e.first});
    if (count != 1 || back == edges.end() || back->second != 1) return false;
  }
  return !edges.empty();
}

TEST(Convex, ABoxIsSixPlanesAndAnUprightPrism) {
  const ObjectConvex c = convex_of(test::box_mesh({1, 2, 3}, {4, 7, 9}));
  ASSERT_THAT(c.pieces, SizeIs(1));
  EXPECT_TRUE(c.pieces[0].upright_prism);
  EXPECT_FALSE(c.pieces[0].only);
  EXPECT_THAT(c.pieces[0].solid.planes, SizeIs(6));
  const FaceMesh mesh = face_mesh(c.pieces[0].solid);
  EXPECT_THAT(mesh.faces, SizeIs(6));
  EXPECT_TRUE(closed(mesh));
  EXPECT_NEAR(volume_of(mesh), 3 * 5 * 6, 1e-4);
}

TEST(Convex, AGabledHouseIsConvexAndNoPrism) {
  const ObjectConvex c = convex_of(test::gabled_house());
  ASSERT_THAT(c.pieces, SizeIs(1));
  EXPECT_FALSE(c.pieces[0].upright_prism);
  EXPECT_THAT(c.pieces[0].solid.planes, SizeIs(7));
  EXPECT_NEAR(volume_of(face_mesh(c.pieces[0].solid)), 10 * 8 * 7, 1e-3);
}

TEST(Convex, WindingDoesNotMatterUnlessSidednessIsHonoured) {
  Mesh out = test::turned_inside_out(tetrahedron());
  EXPECT_THAT(convex_of(out).pieces, SizeIs(1));
  EXPECT_GT(volume_of(face_mesh(convex_of(out).pieces[0].solid)), 10);
  out.primitives[0].double_sided = false;
  EXPECT_THAT(convex_of(out, OccluderTag::kAuto, Mat4{1}, true).pieces, IsEmpty());
  Mesh in = tetrahedron();
  in.primitives[0].double_sided = false;
  const auto outwards =
      convex_of(in, OccluderTag::kAuto, Mat4{1}, true).pieces.size() +
      convex_of(test::turned_inside_out(in), OccluderTag::kAuto, Mat4{1}, true).pieces.size();
  EXPECT_GE(outwards, 1U);
}

TEST(Convex, LeavesOutWhatIsNotConvexNotClosedOrNotMatter) {
  // An L.
  SceneBuilder l;
  l.add_prism({{0, 0}, {4, 0}, {4, 1}, {1, 1}, {1, 4}, {0, 4}}, 0, 3);
  const Scene ell = std::move(l).finish();
  EXPECT_THAT(extract_convex(ell, ell.objects[0]).pieces, IsEmpty());
  // A box without its lid.
  Mesh open = test::box_mesh({0, 0, 0}, {1, 1, 1});
  open.indices.resize(open.indices.size() - 6);
  open.primitives[0].triangles -= 2;
  EXPECT_THAT(convex_of(open).pieces, IsEmpty());
  EXPECT_THAT(convex_of(open, OccluderTag::kOnly).pieces, IsEmpty());
  // Every face twice: a closed surface that holds nothing.
  Mesh twice = test::box_mesh({0, 0, 0}, {1, 1, 1});
  const auto once = twice.indices;
  twice.indices.insert(twice.indices.end(), once.begin(), once.end());
  twice.primitives[0].triangles *= 2;
  EXPECT_THAT(convex_of(twice).pieces, IsEmpty());
  EXPECT_THAT(convex_of(test::box_mesh({0, 0, 0}, {1, 1, 1}), OccluderTag::kNever).pieces,
              IsEmpty());
  Mesh masked = test::box_mesh({0, 0, 0}, {1, 1, 1});
  masked.primitives[0].opaque = false;
  EXPECT_THAT(convex_of(masked).pieces, IsEmpty());
  SceneBuilder m;
  m.add_box({0, 0, 0}, {1, 1, 1});
  Scene moves = std::move(m).finish();
  moves.objects[0].always_visible = true;
  EXPECT_THAT(extract_convex(moves, moves.objects[0]).pieces, IsEmpty());
}

TEST(Convex, ADentDeeperThanTheToleranceIsNotConvex) {
  for (const auto& [dent, convex] : {std::pair{0.0, true}, {1e-7, true}, {1e-3, false}}) {
    // A box whose lid has a corner in its middle, a little lower.
    Mesh mesh = test::mesh_of({{0, 0, 0},
                               {2, 0, 0},
                               {2, 0, 2},
                               {0, 0, 2},
                               {0, 2, 0},
                               {2, 2, 0},
                               {2, 2, 2},
                               {0, 2, 2},
                               {1, 2 - dent, 1}},
                              {{0, 1, 2, 3},
                               {7, 6, 8},
                               {6, 5, 8},
                               {5, 4, 8},
                               {4, 7, 8},
                               {0, 4, 5, 1},
                               {1, 5, 6, 2},
                               {2, 6, 7, 3},
                               {3, 7, 4, 0}});
    const ObjectConvex c = convex_of(std::move(mesh));
    EXPECT_EQ(c.pieces.size(), convex ? 1U : 0U) << dent;
    if (!convex) continue;
    for (const ConvexSolid::Plane& p : c.pieces[0].solid.planes) {
      if (p.normal.y > 0.9) {
        EXPECT_LE(p.offset, 2 - dent + 1e-9);  // below the dent
      }
    }
  }
}

TEST(Convex, SeamsCloseInMatterOnly) {
  // A box whose faces do not share their corners to the last bit.
  Mesh apart = test::box_mesh({0, 0, 0}, {3, 0.4, 3});
  Mesh loose;
  for (std::size_t i = 0; i < apart.indices.size(); ++i) {
    glm::vec3 p = apart.positions[apart.indices[i]];
    p +=
        glm::vec3(static_cast<float>(i % 5), static_cast<float>(i % 3), static_cast<float>(i % 4)) *
        2e-5F;
    loose.positions.push_back(p);
    loose.indices.push_back(static_cast<std::uint32_t>(i));
  }
  loose.primitives = {{0, 12, true, true}};
  EXPECT_THAT(convex_of(loose).pieces, IsEmpty());
  const ObjectConvex c = convex_of(loose, OccluderTag::kOnly);
  ASSERT_THAT(c.pieces, SizeIs(1));
  EXPECT_TRUE(c.pieces[0].only);
  EXPECT_NEAR(volume_of(face_mesh(c.pieces[0].solid)), 3.6, 0.002);
}

TEST(Convex, SliversAndPointsDoNoHarm) {
  Mesh mesh = tetrahedron();
  // A side split at a corner that lies on it but for rounding, and two triangles without area.
  const auto n = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.indices.insert(mesh.indices.end(), {0, 0, 1, 2, 2, 2});
  mesh.primitives[0].triangles += 2;
  EXPECT_THAT(convex_of(mesh).pieces, SizeIs(1));
  EXPECT_EQ(n, mesh.positions.size());
}

TEST(Convex, ErosionIsWhatTheSupportFunctionSays) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> u(0, 1);
  std::vector<Mesh> meshes{tetrahedron(), test::gabled_house(),
                           test::box_mesh({0, 0, 0}, {5, 4, 6})};
  for (const Mesh& mesh : meshes)
    for (const Vec3& at : {Vec3{0}, Vec3{1e4, -300, 1.2e4}, Vec3{1e6, 0, -1e6}})
      for (const Reach& reach : {Reach::ball(0.3), Reach::disc(0.4), Reach::cylinder(0.4, 0.1),
                                 Reach::ellipsoid({0.5, 0.1, 0.3}), Reach::box({0.3, 0.2, 0.1})}) {
        const ObjectConvex c = convex_of(mesh, OccluderTag::kAuto, turned(0.7, {1, 2, 3}, at));
        ASSERT_THAT(c.pieces, SizeIs(1)) << at.x;
        const ConvexSolid& solid = c.pieces[0].solid;
        const double margin = 0.05;
        const FaceMesh level = face_mesh(shrunk(solid, reach, margin));
        ASSERT_FALSE(level.empty());
        EXPECT_TRUE(closed(level));
        const double rounding = 1e-14 * glm::length(at);
        for (const auto& f : level.faces)
          for (int i = 0; i < 20; ++i) {
            const double s = u(rng);
            const double t = u(rng);
            const auto& p = level.points;
            const Vec3 x =
                (p[f[0]] * (1 - s) + p[f[1]] * s) * (1 - t) + (p[f[3]] * (1 - s) + p[f[2]] * s) * t;
            bool tight = false;
            for (const ConvexSolid::Plane& plane : solid.planes) {
              const double room = plane.offset - glm::dot(plane.normal, x);
              const double need = reach.support(plane.normal) + margin;
              ASSERT_GE(room, need - rounding) << reach.to_string();
              tight = tight || room < need + 1e-5 + 100 * rounding;
            }
            EXPECT_TRUE(tight);  // nothing is given away: a face touches what it must keep from
            for (const Vec3& v : reach.extreme_points(16))
              ASSERT_TRUE(contains(solid, x + v * 0.999)) << reach.to_string();
          }
      }
}

TEST(Convex, LevelsEndWhereTheSolidVanishes) {
  const ObjectConvex c = convex_of(test::box_mesh({0, 0, 0}, {4, 1, 4}));
  const SolidPiece piece = shrink_convex(c.pieces[0].solid, Reach::ball(0.2), {0.1, 0.25, 0.5, 1});
  EXPECT_THAT(piece.levels, SizeIs(2));
  EXPECT_NEAR(volume_of(piece.levels[1]), 3.1 * 3.1 * 0.1, 1e-4);
}

TEST(Convex, PlanesThatBoundNothingGiveNothing) {
  ConvexSolid open;
  open.bounds = {{-1, -1, -1}, {1, 1, 1}};
  for (const Vec3& n : {Vec3{1, 0, 0}, Vec3{-1, 0, 0}, Vec3{0, 0, 1}, Vec3{0, 0, -1}})
    open.planes.push_back({n, 1});
  EXPECT_TRUE(face_mesh(open).empty());
  ConvexSolid against = open;
  against.planes.push_back({{0, 1, 0}, -2});
  against.planes.push_back({{0, -1, 0}, -2});
  EXPECT_TRUE(face_mesh(against).empty());
}

TEST(ConvexReal, NearlyAllBrushesOfAGameMapAreTaken) {
  for (const char* name : {"q3map/czest3ctf.glb", "q3map/oa_shouse.glb"}) {
    IVIS_NEED_DATA(file, name);
    const auto scene = load_scene(file);
    ASSERT_TRUE(scene);
    std::size_t taken = 0;
    for (const Object& o : scene->hidden_solids)
      for (const ConvexPiece& p : extract_convex(*scene, o).pieces) {
        ++taken;
        EXPECT_FALSE(face_mesh(p.solid).empty());
      }
    EXPECT_GE(static_cast<double>(taken), 0.98 * static_cast<double>(scene->hidden_solids.size()))
        << name;
  }
}

}  // namespace
}  // namespace ivis
