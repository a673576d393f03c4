#include "visibility/depth_cube.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace ivis {
namespace {

using Corners = std::array<glm::vec3, 4>;

constexpr float kNear = 1;
constexpr float kEye[3] = {0, 0, 0};

std::vector<FaceBatch> batches_of(const std::vector<Corners>& faces) {
  std::vector<FaceBatch> out;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const std::size_t lane = f % FaceBatch::kWidth;
    if (lane == 0) out.push_back({});
    const Corners& p = faces[f];
    const glm::vec3 n = glm::normalize(glm::cross(p[2] - p[0], p[3] - p[1]));
    for (std::size_t k = 0; k < 4; ++k) {
      out.back().x[k][lane] = p[k].x;
      out.back().y[k][lane] = p[k].y;
      out.back().z[k][lane] = p[k].z;
    }
    out.back().nx[lane] = n.x;
    out.back().ny[lane] = n.y;
    out.back().nz[lane] = n.z;
  }
  return out;
}

/// The rectangle x = at, y0..y1, z0..z1, its front towards smaller x.
Corners wall(float at, float y0, float y1, float z0, float z1) {
  return {{{at, y0, z0}, {at, y0, z1}, {at, y1, z1}, {at, y1, z0}}};
}

BoxTree tree_of(const std::vector<Aabb>& boxes) {
  std::vector<std::uint32_t> items(boxes.size());
  for (std::uint32_t i = 0; i < items.size(); ++i)
    items[i] = i;
  return BoxTree::build(boxes, items, Vec3{0});
}

std::vector<std::uint32_t> visible(const DepthCube& cube, const std::vector<Aabb>& boxes) {
  DepthStats stats;
  std::vector<std::uint32_t> found;
  find_visible(tree_of(boxes), 0, kEye, cube, found, stats);
  std::sort(found.begin(), found.end());
  return found;
}

Aabb box(const Vec3& at, double half) {
  return {at - half, at + half};
}

class DepthCubeTest : public ::testing::Test {
 protected:
  void draw(const std::vector<Corners>& faces, bool sheet = false) {
    DepthStats stats;
    draw_faces(batches_of(faces), kEye, 0x3f, sheet, cube_, stats);
  }
  DepthCube cube_{256, kNear};
};

TEST_F(DepthCubeTest, AnEmptyCubeHidesNothing) {
  EXPECT_EQ(visible(cube_, {box({50, 0, 0}, 1), box({0, -50, 0}, 1), box({0, 0, 0}, 1)}).size(),
            3U);
}

TEST_F(DepthCubeTest, AWallHidesWhatLiesWhollyBehindItAndNothingElse) {
  draw({wall(20, -10, 10, -10, 10)});
  const std::vector<Aabb> boxes{box({40, 0, 0}, 1),         box({19, 0, 0}, 0.5),
                                box({20, 0, 0}, 0.5),       box({40, 20.5, 0}, 1),
                                box({40, 0, 22}, 3),        box({-40, 0, 0}, 1),
                                {{30, -5, -5}, {60, 5, 5}}, {{10, -1, -1}, {40, 1, 1}}};
  EXPECT_EQ(visible(cube_, boxes), (std::vector<std::uint32_t>{1, 2, 3, 4, 5, 7}));
}

TEST_F(DepthCubeTest, ABoxOnTwoSidesIsHiddenOnlyWhereBothHideIt) {
  draw({wall(20, -30, 30, -30, 20)});
  const Aabb across{{38, -1, 36}, {42, 1, 44}};  // the diagonal between +x and +z
  EXPECT_EQ(visible(cube_, {across}).size(), 1U);
  draw({{{{20, -30, 20}, {-20, -30, 20}, {-20, 30, 20}, {20, 30, 20}}}});
  EXPECT_EQ(visible(cube_, {across}).size(), 0U);
}

TEST_F(DepthCubeTest, EveryDirectionWorksAlike) {
  for (int axis = 0; axis < 3; ++axis)
    for (const float sign : {1.0F, -1.0F}) {
      cube_.clear();
      Corners p = wall(20, -10, 10, -10, 10);
      for (glm::vec3& c : p) {
        glm::vec3 q;
        for (int k = 0; k < 3; ++k)
          q[(k + axis) % 3] = c[k];
        c = sign * q;
      }
      if (sign < 0) std::swap(p[1], p[3]);  // a point reflection turns the winding
      draw({p});
      Vec3 behind{0};
      behind[axis] = static_cast<double>(40 * sign);
      Vec3 opposite = -behind;
      EXPECT_EQ(visible(cube_, {box(behind, 1), box(opposite, 1)}), (std::vector<std::uint32_t>{1}))
          << axis << ' ' << sign;
    }
}

TEST_F(DepthCubeTest, BackFacesAreNotDrawn) {
  Corners p = wall(20, -10, 10, -10, 10);
  std::swap(p[1], p[3]);
  draw({p});
  EXPECT_EQ(visible(cube_, {box({40, 0, 0}, 1)}).size(), 1U);
}

TEST_F(DepthCubeTest, WhatIsNearerThanTheNearDistanceIsVisible) {
  draw({wall(0.2F, -10, 10, -10, 10)});
  EXPECT_EQ(visible(cube_, {box({0.8, 0, 0}, 0.1), box({5, 0, 0}, 1)}),
            (std::vector<std::uint32_t>{0}));
}

TEST_F(DepthCubeTest, ClearingForgets) {
  draw({wall(20, -10, 10, -10, 10)});
  cube_.clear();
  EXPECT_EQ(visible(cube_, {box({40, 0, 0}, 1)}).size(), 1U);
}

TEST_F(DepthCubeTest, ASheetSeenAtASlantHidesOnlyWhatIsBehindItsFarthestDepthInAPixel) {
  // Plane x = 10 + z / 2 crosses a pixel's width with another depth at each end.
  const Corners slanted{{{5, -10, -10}, {15, -10, 10}, {15, 10, 10}, {5, 10, -10}}};
  draw({slanted}, false);
  DepthCube solid = cube_;
  cube_.clear();
  draw({slanted}, true);
  for (std::uint32_t b = 0; b < 6 * cube_.blocks_a_face(); ++b) {
    if (!cube_.is_touched(b)) continue;
    for (std::uint32_t k = 0; k < 256; ++k)
      EXPECT_LE(cube_.block(b)[k], solid.block(b)[k]);
  }
  EXPECT_EQ(visible(cube_, {box({30, 0, 0}, 1)}).size(), 0U);
}

/// The oracle: the largest K / w of all faces in front at a pixel's centre, in doubles; `inner`
/// shrinks the faces' edges by so much, relative to their distance.
double oracle(const std::vector<Corners>& faces, const Vec3& d, double inner) {
  double best = 0;
  for (const Corners& f : faces) {
    Vec3 p[4];
    for (std::size_t k = 0; k < 4; ++k)
      p[k] = Vec3(f[k]);
    const Vec3 n = glm::normalize(glm::cross(p[2] - p[0], p[3] - p[1]));
    const double c = glm::dot(n, p[0]);
    if (c >= 0) continue;
    const double inverse = glm::dot(n, d) / c;
    if (inverse <= 0) continue;
    bool in = true;
    for (std::size_t k = 0; k < 4; ++k) {
      const Vec3 e = glm::cross(p[(k + 1) % 4] - p[k], p[k]);
      if (glm::length(e) < 1e-9) continue;
      in = in && glm::dot(glm::normalize(e), glm::normalize(d)) >= inner;
    }
    if (in) best = std::max(best, inverse);
  }
  return best;
}

TEST_F(DepthCubeTest, NeverClaimsMoreThanRaysThroughPixelCentresFindNorMuchLess) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> place(-60, 60);
  std::uniform_real_distribution<float> side(1, 25);
  for (int round = 0; round < 12; ++round) {
    std::vector<Corners> faces;
    for (int f = 0; f < 40; ++f) {
      const glm::vec3 at{place(random), place(random), place(random)};
      glm::vec3 u = glm::normalize(glm::vec3{place(random), place(random), place(random)});
      const glm::vec3 v =
          glm::normalize(glm::cross(u, glm::vec3{place(random), place(random), place(random)}));
      const float a = side(random);
      const float b = side(random);
      Corners p{{at, at + a * u, at + a * u + b * v, at + b * v}};
      if (f % 3 == 0) p[3] = p[2] = at + b * v;  // a triangle
      faces.push_back(p);
    }
    cube_.clear();
    draw(faces);
    const double k = 65535.0 * static_cast<double>(kNear);
    const auto n = cube_.pixels();
    std::size_t drawn = 0;
    for (std::uint32_t s = 0; s < 6; ++s)
      for (std::uint32_t j = 0; j < n; j += 3)
        for (std::uint32_t i = 0; i < n; i += 3) {
          const std::uint32_t b =
              s * cube_.blocks_a_face() + j / 16 * cube_.blocks_a_row() + i / 16;
          const int q = cube_.is_touched(b) ? cube_.block(b)[j % 16 * 16 + i % 16] + 32768 : 0;
          const double u = (2.0 * i + 1) / n - 1;
          const double v = (2.0 * j + 1) / n - 1;
          const double w = s % 2 == 0 ? 1 : -1;
          const Vec3 d = s / 2 == 0 ? Vec3{w, v, u} : s / 2 == 1 ? Vec3{u, w, v} : Vec3{u, v, w};
          ASSERT_LE(q, std::min(65535.0, k * oracle(faces, d, -1e-5)))
              << "side " << s << " pixel " << i << ',' << j;
          const double least = k * oracle(faces, d, 1e-5);
          ASSERT_GE(q, std::min(65535.0, std::floor(least * 0.995)) - 1)
              << "side " << s << " pixel " << i << ',' << j;
          drawn += q > 0 ? 1 : 0;
        }
    EXPECT_GT(drawn, 1000U);
  }
}

TEST_F(DepthCubeTest, LookingOnlyAtWhatIsThereChangesNoAnswerAboutIt) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-40, 40);
  std::uniform_real_distribution<double> height(-3, 6);
  std::vector<Aabb> boxes;
  Aabb all;
  for (int i = 0; i < 600; ++i) {
    boxes.push_back(box({place(random), height(random), place(random)}, 0.4));
    all.add(boxes.back());
  }
  std::vector<Corners> faces;
  for (int f = 0; f < 30; ++f) {
    const auto x = static_cast<float>(std::abs(place(random)) + 1);
    const auto z = static_cast<float>(place(random));
    faces.push_back(wall(x, -8, static_cast<float>(height(random)) + 4, z, z + 8));
  }
  draw(faces);
  const auto everywhere = visible(cube_, boxes);
  cube_.clear();
  const std::uint32_t sides = cube_.look_at(glm::vec3(all.lo), glm::vec3(all.hi));
  EXPECT_EQ(sides & 0x33U, 0x33U);
  DepthStats stats;
  draw_faces(batches_of(faces), kEye, sides, false, cube_, stats);
  EXPECT_EQ(visible(cube_, boxes), everywhere);
  EXPECT_LT(everywhere.size(), boxes.size());
}

TEST_F(DepthCubeTest, EverySimdTargetGivesTheSameBits) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> place(-50, 50);
  std::vector<Corners> faces;
  std::vector<Aabb> boxes;
  for (int i = 0; i < 100; ++i) {
    const glm::vec3 at{place(random), place(random), place(random)};
    const glm::vec3 u{place(random) * 0.3F, place(random) * 0.3F, place(random) * 0.3F};
    const glm::vec3 v = glm::cross(u, glm::vec3{1, 2, 3}) * 0.2F;
    faces.push_back({{at, at + u, at + u + v, at + v}});
  }
  for (int i = 0; i < 800; ++i)
    boxes.push_back(box({static_cast<double>(place(random)), static_cast<double>(place(random)),
                         static_cast<double>(place(random))},
                        0.5));
  std::vector<std::int16_t> first;
  std::vector<std::uint32_t> first_visible;
  std::size_t targets = 0;
  for (const char* name : depth_targets()) {
    ASSERT_TRUE(use_depth_target(name)) << name;
    ++targets;
    cube_.clear();
    draw(faces);
    std::vector<std::int16_t> bits;
    for (std::uint32_t b = 0; b < 6 * cube_.blocks_a_face(); ++b)
      if (cube_.is_touched(b)) bits.insert(bits.end(), cube_.block(b), cube_.block(b) + 256);
    const auto shown = visible(cube_, boxes);
    if (first.empty()) {
      first = bits;
      first_visible = shown;
      EXPECT_LT(shown.size(), boxes.size());
    }
    EXPECT_EQ(bits, first) << name;
    EXPECT_EQ(shown, first_visible) << name;
  }
  EXPECT_TRUE(use_depth_target(""));
  EXPECT_FALSE(use_depth_target("no such target"));
  EXPECT_GT(targets, 1U);
}

}  // namespace
}  // namespace ivis
