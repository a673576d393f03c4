#include "occluders/backing.h"

#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "tests/occluders/mesh_shapes.h"
#include "tests/support/scene_builder.h"

namespace ivis {
namespace {

using test::mesh_of;
using test::SceneBuilder;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/// What is found about the drawn objects of a scene.
std::vector<Backing> backings(const Scene& scene) {
  std::vector<ConvexPiece> solids;
  const auto take = [&](const std::vector<Object>& objects) {
    for (const Object& o : objects)
      if (o.tag != OccluderTag::kNever)
        for (const ConvexPiece& p : extract_convex(scene, o).pieces)
          solids.push_back(p);
  };
  take(scene.objects);
  take(scene.hidden_solids);
  return find_backings(scene, solids, {});
}

/// The rectangle of the wall x = `x` over y, z from lo to hi.
Mesh face(double x, const Vec2& lo, const Vec2& hi) {
  return mesh_of({{x, lo.x, lo.y}, {x, hi.x, lo.y}, {x, hi.x, hi.y}, {x, lo.x, hi.y}},
                 {{0, 1, 2, 3}});
}

Scene with_face(const Mesh& mesh, OccluderTag solid = OccluderTag::kOnly, double gap = 0) {
  SceneBuilder b;
  b.add_mesh(mesh, OccluderTag::kNever);
  b.add_box({-1, 0, 0}, {4, 2, 1}, solid);
  b.add_box({-1, 0, 1 + gap}, {4, 2, 3}, solid);
  return std::move(b).finish();
}

TEST(Backing, AFaceOverSolidsKnowsWhereItIsSeenFrom) {
  const auto found = backings(with_face(face(4, {0, 0}, {2, 3})));
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].object, 0U);
  EXPECT_EQ(found[0].plane.normal, Vec3(1, 0, 0));
  EXPECT_EQ(found[0].plane.offset, 4);
  // On the other side of the wall.
  const auto other = backings(with_face(face(-1, {0.5, 0.5}, {1.5, 2.5})));
  ASSERT_THAT(other, SizeIs(1));
  EXPECT_EQ(other[0].plane.normal, Vec3(-1, 0, 0));
  EXPECT_EQ(other[0].plane.offset, 1);
}

TEST(Backing, AFaceWithAGapUnderItHasNone) {
  EXPECT_THAT(backings(with_face(face(4.001, {0, 0}, {2, 3}))), IsEmpty());
  EXPECT_THAT(backings(with_face(face(4.00001, {0, 0}, {2, 3}))), IsEmpty());
  // One corner lifted by what rounding alone may come to.
  Mesh tilted = face(4, {0, 0}, {2, 3});
  tilted.positions[2].x = std::nextafter(4.0F, 5.0F);
  EXPECT_THAT(backings(with_face(tilted)), IsEmpty());
}

TEST(Backing, AFaceThatJutsOutHasNone) {
  EXPECT_THAT(backings(with_face(face(4, {0, 0}, {2.001, 3}))), IsEmpty());
  EXPECT_THAT(backings(with_face(face(4, {0, -0.001}, {2, 3}))), IsEmpty());
}

TEST(Backing, AFaceOverASlitHasNone) {
  EXPECT_THAT(backings(with_face(face(4, {0, 0}, {2, 3}), OccluderTag::kOnly, 0.001)), IsEmpty());
}

TEST(Backing, OnlyWhatIsMarkedAsMatterBacks) {
  EXPECT_THAT(backings(with_face(face(4, {0, 0}, {2, 3}), OccluderTag::kAuto)), IsEmpty());
}

TEST(Backing, AFaceBetweenSolidsIsNotKnownToBeHiddenEverywhere) {
  SceneBuilder b;
  b.add_mesh(face(0, {0, 0}, {1, 1}), OccluderTag::kNever);
  b.add_box({-1, 0, 0}, {0, 1, 1}, OccluderTag::kOnly);
  b.add_box({0, 0, 0}, {1, 1, 1}, OccluderTag::kOnly);
  EXPECT_THAT(backings(std::move(b).finish()), IsEmpty());
}

TEST(Backing, MatterThatComesOverThePlaneByRoundingIsNotBehindIt) {
  // The face is drawn a little inside of its solid: it is to be seen from its front all the same.
  SceneBuilder b;
  b.add_mesh(face(std::nextafter(1.0F, 0.0F), {0, 0}, {1, 1}), OccluderTag::kNever);
  b.add_box({0, 0, 0}, {1, 1, 1}, OccluderTag::kOnly);
  const auto found = backings(std::move(b).finish());
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0].plane.normal.x, 1);
}

TEST(Backing, AnObjectOfSeveralFacesHasAllTheirPlanes) {
  SceneBuilder b;
  const Mesh corner = mesh_of({{0, 1, 0}, {2, 1, 0}, {2, 1, 1}, {0, 1, 1}, {2, 0, 0}, {2, 0, 1}},
                              {{0, 3, 2, 1}, {1, 2, 5, 4}});
  b.add_mesh(corner, OccluderTag::kNever);
  Mesh lone = corner;  // and a triangle on nothing
  lone.positions.insert(lone.positions.end(), {{0, 5, 0}, {1, 5, 0}, {0, 5, 1}});
  lone.indices.insert(lone.indices.end(), {6, 7, 8});
  ++lone.primitives[0].triangles;
  b.add_mesh(lone, OccluderTag::kNever);
  b.add_box({0, 0, 0}, {2, 1, 1}, OccluderTag::kOnly);
  const auto found = backings(std::move(b).finish());
  ASSERT_THAT(found, SizeIs(2));
  EXPECT_EQ(found[0].object, 0U);
  EXPECT_EQ(found[1].object, 0U);
  EXPECT_EQ(std::abs(glm::dot(found[0].plane.normal, found[1].plane.normal)), 0);
}

TEST(Backing, AMoverHasNone) {
  Scene scene = with_face(face(4, {0, 0}, {2, 3}));
  scene.objects[0].always_visible = true;
  EXPECT_THAT(backings(scene), IsEmpty());
}

/// The rim of `n` facets of a wheel about z, each on a wedge of matter of its own.
Scene wheel(int n) {
  SceneBuilder b;
  Mesh rim;
  std::vector<Mesh> wedges;
  for (int i = 0; i < n; ++i) {
    // Whole numbers on a circle's tangents, so that corners round to themselves.
    const Vec2 corners[] = {{8, 0}, {8, 3}, {6, 6}, {3, 8}, {-3, 8}, {-6, 6}, {-8, 3}, {-8, 0}};
    const Vec2 p = corners[i];
    const Vec2 q = corners[i + 1];
    const auto first = static_cast<std::uint32_t>(rim.positions.size());
    for (const Vec3& c : {Vec3{p, 0}, Vec3{q, 0}, Vec3{q, 1}, Vec3{p, 1}})
      rim.positions.emplace_back(c);
    rim.indices.insert(rim.indices.end(),
                       {first, first + 1, first + 2, first, first + 2, first + 3});
    wedges.push_back(mesh_of({{0, 0, 0}, {p, 0}, {q, 0}, {0, 0, 1}, {p, 1}, {q, 1}},
                             {{0, 2, 1}, {3, 4, 5}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}}));
  }
  rim.primitives = {{0, static_cast<std::uint32_t>(2 * n), true, true}};
  b.add_mesh(rim, OccluderTag::kNever);
  for (Mesh& wedge : wedges)
    b.add_mesh(std::move(wedge), OccluderTag::kOnly);
  return std::move(b).finish();
}

TEST(Backing, MoreThanSixPlanesAreTooMany) {
  EXPECT_THAT(backings(wheel(3)), SizeIs(3));
  EXPECT_THAT(backings(wheel(7)), IsEmpty());
}

/// One object of two triangles, on matter below y = 0 over x, z from 0 to 1.
std::vector<Backing> on_slab(const std::array<glm::vec3, 3>& second) {
  SceneBuilder b;
  Mesh two;
  two.positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, second[0], second[1], second[2]};
  two.indices = {0, 1, 2, 3, 4, 5};
  two.primitives = {{0, 2, true, true}};
  b.add_mesh(two, OccluderTag::kNever);
  b.add_box({0, -1, 0}, {1, 0, 1}, OccluderTag::kOnly);
  return backings(std::move(b).finish());
}

TEST(Backing, ATriangleWithoutAreaIsNotTakenForCovered) {
  EXPECT_THAT(on_slab({{{1, 0, 1}, {1, 0, 0}, {0, 0, 1}}}), SizeIs(1));
  EXPECT_THAT(on_slab({{{1, 0, 0}, {1000, 0, 0}, {1000, 0, 4e-7F}}}), IsEmpty());
  EXPECT_THAT(on_slab({{{0, 0, 0}, {1, 0, 0}, {0.5F, 0, 1e-7F}}}), IsEmpty());
}

TEST(Backing, WhatThePolygonLibraryCannotTakeIsNotCovered) {
  SceneBuilder b;
  b.add_mesh(face(0, {-1.5e7, -1.5e7}, {1.5e7, 1.5e7}), OccluderTag::kNever);
  b.add_box({-1, 0, 0}, {0, 1, 1}, OccluderTag::kOnly);
  EXPECT_THAT(backings(std::move(b).finish()), IsEmpty());
}

TEST(Backing, EveryTriangleHasToBeInMatterAtItsOwnHeight) {
  // The matter tapers to nothing at x = 0; a second sheet lies 9e-5 m under its top.
  const auto found = [](double depth) {
    SceneBuilder b;
    Mesh sheets;
    for (const double y : {0.0, -depth}) {
      const auto first = static_cast<std::uint32_t>(sheets.positions.size());
      for (const Vec3& p :
           {Vec3{0, y, 1000}, Vec3{10, y, 1000}, Vec3{10, y, 1010}, Vec3{0, y, 1010}})
        sheets.positions.emplace_back(p);
      sheets.indices.insert(sheets.indices.end(),
                            {first, first + 1, first + 2, first, first + 2, first + 3});
    }
    sheets.primitives = {{0, 4, true, true}};
    b.add_mesh(sheets, OccluderTag::kNever);
    b.add_mesh(mesh_of({{0, 0, 1000},
                        {10, 0, 1000},
                        {10, -0.1, 1000},
                        {0, 0, 1010},
                        {10, 0, 1010},
                        {10, -0.1, 1010}},
                       {{0, 1, 2}, {3, 5, 4}, {0, 3, 4, 1}, {1, 4, 5, 2}, {0, 2, 5, 3}}),
               OccluderTag::kOnly);
    return backings(std::move(b).finish());
  };
  EXPECT_THAT(found(0), SizeIs(1));
  EXPECT_THAT(found(9e-5), IsEmpty());
}

TEST(Backing, ShrinkingFindsThem) {
  const Scene scene = with_face(face(4, {0, 0}, {2, 3}));
  ShrinkOptions options;
  options.reach = Reach::ball(0.2);
  const auto made = shrink(scene, options, FastEroder{});
  ASSERT_TRUE(made);
  EXPECT_THAT(made->set.backings, SizeIs(1));
}

}  // namespace
}  // namespace ivis
