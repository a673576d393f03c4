#include "occluders/polyhedron.h"

#include <random>

#include <gtest/gtest.h>

#include "occluders/nef_messages.h"
#include "tests/occluders/mesh_shapes.h"

namespace ivis {
namespace {

FaceMesh faces_of(const Mesh& mesh) {
  FaceMesh out;
  for (const glm::vec3& p : mesh.positions)
    out.points.emplace_back(p);
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3)
    out.faces.push_back(
        {mesh.indices[i], mesh.indices[i + 1], mesh.indices[i + 2], mesh.indices[i + 2]});
  return out;
}

Polyhedron solid_of(const Mesh& mesh) {
  Polyhedron out;
  for (const auto& f : faces_of(mesh).faces)
    out.triangles.push_back({f[0], f[1], f[2]});
  for (const glm::vec3& p : mesh.positions)
    out.points.emplace_back(p);
  return out;
}

void add(Polyhedron& to, const Polyhedron& more, bool inside_out) {
  const auto first = static_cast<std::uint32_t>(to.points.size());
  to.points.insert(to.points.end(), more.points.begin(), more.points.end());
  for (auto t : more.triangles) {
    if (inside_out) std::swap(t[1], t[2]);
    to.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
}

const Vec3 kHalf{0.5, 0.25, 0.5};

TEST(BoxErosion, ABoxKeepsItsDistanceOrNot) {
  const Polyhedron solid = solid_of(test::box_mesh({0, 0, 0}, {10, 4, 6}));
  const auto within = [&](const Vec3& lo, const Vec3& hi) {
    return within_box_erosion(faces_of(test::box_mesh(lo, hi)), solid, kHalf);
  };
  EXPECT_TRUE(within({0.51, 0.26, 0.51}, {9.49, 3.74, 5.49}));
  EXPECT_FALSE(within({0.49, 0.26, 0.51}, {9.49, 3.74, 5.49}));
  EXPECT_FALSE(within({0.51, 0.24, 0.51}, {9.49, 3.74, 5.49}));
  EXPECT_FALSE(within({0.51, 0.26, 0.51}, {9.49, 3.74, 5.51}));
  EXPECT_FALSE(within({20, 1, 1}, {21, 2, 2})) << "outside, far from the surface";
  EXPECT_FALSE(within({-9, -9, -9}, {19, 9, 9})) << "about it";
}

TEST(BoxErosion, AHollowIsSeen) {
  Polyhedron solid = solid_of(test::box_mesh({0, 0, 0}, {10, 10, 10}));
  add(solid, solid_of(test::box_mesh({4, 4, 4}, {6, 6, 6})), true);
  EXPECT_FALSE(within_box_erosion(faces_of(test::box_mesh({1, 1, 1}, {9, 9, 9})), solid, kHalf));
  EXPECT_TRUE(within_box_erosion(faces_of(test::box_mesh({1, 1, 1}, {3, 9, 9})), solid, kHalf));
  EXPECT_FALSE(within_box_erosion(faces_of(test::box_mesh({4.6, 4.6, 4.6}, {5.4, 5.4, 5.4})), solid,
                                  {0.1, 0.1, 0.1}))
      << "in the hollow";
}

TEST(BoxErosion, NothingAndAFlatReachAreRefused) {
  const Polyhedron solid = solid_of(test::box_mesh({0, 0, 0}, {10, 4, 6}));
  EXPECT_FALSE(within_box_erosion({}, solid, kHalf));
  EXPECT_FALSE(
      within_box_erosion(faces_of(test::box_mesh({2, 1, 2}, {3, 2, 3})), solid, {1, 0, 1}));
}

TEST(BoxErosion, AgreesWithSampledMovesOfSlantedSolids) {
  const Polyhedron house = solid_of(test::gabled_house());
  std::mt19937 rng(3);
  const auto uniform = [&](double a, double b) {
    return a + (b - a) * static_cast<double>(rng()) / 4294967296.0;
  };
  // Of the gabled house: 10 x 8 m, eaves at 5, ridge along x at 9 over z = 4.
  const auto in_house = [](const Vec3& p) {
    return p.x > 0 && p.x < 10 && p.z > 0 && p.z < 8 && p.y > 0 && p.y < 9 - std::abs(p.z - 4);
  };
  int yes = 0;
  int no = 0;
  for (int i = 0; i < 3000; ++i) {
    const Vec3 lo{uniform(0, 8), uniform(0, 7), uniform(0, 6)};
    const Vec3 hi = lo + Vec3{uniform(0.1, 3), uniform(0.1, 3), uniform(0.1, 3)};
    // For boxes in a convex solid the corners moved by corners decide.
    const bool truth = in_house(lo - kHalf) && in_house(hi + kHalf) &&
                       in_house({hi.x + kHalf.x, hi.y + kHalf.y, lo.z - kHalf.z});
    const bool said = within_box_erosion(faces_of(test::box_mesh(lo, hi)), house, kHalf);
    ASSERT_EQ(said, truth);
    (truth ? yes : no) += 1;
  }
  EXPECT_GT(yes, 100);
  EXPECT_GT(no, 100);
}

TEST(NefMessages, GoThereAndBack) {
  const NefRequest asked{solid_of(test::gabled_house()), {0.5, 0.1, 1.0 / 3}, {0, 0.25}};
  const auto got = decode_nef_request(encode(asked));
  ASSERT_TRUE(got) << got.error().message;
  EXPECT_EQ(got->solid.points, asked.solid.points);
  EXPECT_EQ(got->solid.triangles, asked.solid.triangles);
  EXPECT_EQ(got->half, asked.half);
  EXPECT_EQ(got->margins_m, asked.margins_m);

  const ConvexSolid part{{{{1, 0, 0}, 1}, {{0, -1, 0}, 1e-300}}, {{0, 0, 0}, {1, 2, 3}}};
  const FaceMesh level = faces_of(test::box_mesh({0, 0, 0}, {1, 1, 1}));
  const std::string said =
      encode_parts({part}) + encode_level(level) + encode_level({}) + encode_end();
  const auto answer = decode_nef_answer(said);
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_TRUE(answer->complete);
  ASSERT_EQ(answer->parts.size(), 1U);
  EXPECT_EQ(answer->parts[0].planes[1].offset, 1e-300);
  EXPECT_EQ(answer->parts[0].bounds.hi, part.bounds.hi);
  ASSERT_EQ(answer->levels.size(), 2U);
  EXPECT_EQ(answer->levels[0].points, level.points);
  EXPECT_EQ(answer->levels[0].faces, level.faces);
}

TEST(NefMessages, WhatIsCutShortKeepsWhatWasWhole) {
  const FaceMesh level = faces_of(test::box_mesh({0, 0, 0}, {1, 1, 1}));
  const std::string whole = encode_parts({}) + encode_level(level);
  const std::string said = whole + encode_level(level) + encode_end();
  for (std::size_t n = 0; n < said.size(); ++n) {
    const auto answer = decode_nef_answer(std::string_view(said).substr(0, n));
    ASSERT_TRUE(answer) << n;
    EXPECT_FALSE(answer->complete) << n;
    EXPECT_LE(answer->levels.size(), 2U);
    if (n >= whole.size()) {
      EXPECT_GE(answer->levels.size(), 1U);
    }
  }
}

TEST(NefMessages, RefuseWhatIsWrong) {
  EXPECT_FALSE(decode_nef_request(""));
  EXPECT_FALSE(decode_nef_request("hello "));
  EXPECT_FALSE(decode_nef_request("ivis-nef-1 1p+0 1p+0 1p+0 0 99999999999999 "));
  for (const char* bad : {"what ", "level 1 1p+0 1p+0 1p+0 1 0 0 1 ", "level 1 nan 0p+0 0p+0 0 ",
                          "level 1 1p+99 0p+0 0p+0 0 ", "level -1 ", "level 1 x 0p+0 0p+0 0 "})
    EXPECT_FALSE(decode_nef_answer(bad)) << bad;
  // A count beyond the bytes: nothing is allocated for it.
  const auto huge = decode_nef_answer("level 99999999999 1p+0 ");
  ASSERT_TRUE(huge);
  EXPECT_TRUE(huge->levels.empty());
  const auto trouble = decode_nef_answer(encode_trouble("no manifold"));
  ASSERT_TRUE(trouble);
  EXPECT_EQ(trouble->trouble.substr(0, 12), " no manifold");
}

}  // namespace
}  // namespace ivis
