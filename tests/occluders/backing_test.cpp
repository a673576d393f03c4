#include "occluders/backing.h"

#include <array>
#include <cmath>

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

TEST(Backing, RoundBodiesAndSliversHaveNone) {
  // Seven facets of a wheel's rim, each flush with a wedge of its own would be too many.
  Mesh rim;
  SceneBuilder b;
  for (int i = 0; i < 7; ++i) {
    const double a = 0.3 * i;
    const double c = 0.3 * (i + 1);
    const auto first = static_cast<std::uint32_t>(rim.positions.size());
    for (const Vec3& p : {Vec3{std::cos(a), std::sin(a), 0}, Vec3{std::cos(c), std::sin(c), 0},
                          Vec3{std::cos(c), std::sin(c), 1}, Vec3{std::cos(a), std::sin(a), 1}})
      rim.positions.emplace_back(p);
    rim.indices.insert(rim.indices.end(),
                       {first, first + 1, first + 2, first, first + 2, first + 3});
  }
  rim.primitives = {{0, 14, true, true}};
  b.add_mesh(rim, OccluderTag::kNever);
  Mesh sliver;
  sliver.positions = {{0, 0, 0}, {1, 0, 0}, {0.5, 1e-7, 0}};
  sliver.indices = {0, 1, 2};
  sliver.primitives = {{0, 1, true, true}};
  b.add_mesh(sliver, OccluderTag::kNever);
  b.add_box({-2, -2, -1}, {2, 2, 2}, OccluderTag::kOnly);
  EXPECT_THAT(backings(std::move(b).finish()), IsEmpty());
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
