#include "occluders/voxel_erosion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>
#include <tuple>

#include "core/view_cell.h"

namespace ivis {
namespace {

const std::vector<Reach>& reaches() {
  static const std::vector<Reach> kAll{Reach{},
                                       Reach::ball(0.15),
                                       Reach::ball(0.7),
                                       Reach::disc(0.8),
                                       Reach::cylinder(0.9, 0.2),
                                       Reach::cylinder(0.2, 1.1),
                                       Reach::ellipsoid({0.9, 0.3, 0.5}),
                                       Reach::ellipsoid({0.2, 1.2, 0.4}),
                                       Reach::ellipsoid({0.6, 0, 0.3}),
                                       Reach::box({0.7, 0.1, 0.4}),
                                       Reach::box({0, 0.5, 0.25})};
  return kAll;
}

using Key = std::tuple<int, int, int>;

std::set<Key> voxels_of(const StructuringElement& e) {
  std::set<Key> out;
  for (const auto& run : e.runs)
    for (int x = -run.half; x <= run.half; ++x)
      EXPECT_TRUE(out.emplace(x, run.dy, run.dz).second);
  return out;
}

/// A vector of V + B(margin), often an extreme one.
Vec3 random_move(const Reach& reach, double margin, std::mt19937& rng) {
  std::uniform_real_distribution<double> u(-1, 1);
  const Vec3 e = reach.half_extents();
  Vec3 v{0};
  switch (reach.kind()) {
    case Reach::Kind::kBox:
      v = Vec3(u(rng), u(rng), u(rng)) * e;
      if (rng() % 2 == 0) v = glm::sign(v) * e;
      break;
    case Reach::Kind::kDisc:
    case Reach::Kind::kCylinder: {
      const double a = 4 * u(rng);
      v = {std::cos(a) * e.x, (rng() % 2 == 0 ? 1 : u(rng)) * e.y, std::sin(a) * e.x};
      break;
    }
    default: {
      Vec3 d{u(rng), u(rng), u(rng)};
      d /= std::max(1e-9, glm::length(d));
      v = d * e;
    }
  }
  Vec3 b{u(rng), u(rng), u(rng)};
  if (rng() % 3 == 0) b = glm::sign(b) * Vec3(rng() % 2, rng() % 2, rng() % 2);
  const double length = glm::length(b);
  return length > 0 ? v + b / length * margin : v;
}

TEST(StructuringElement, HoldsEveryVoxelThatAMovedOneOverlaps) {
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> u(0, 1);
  for (const Reach& plain : reaches())
    for (const Reach& reach : {plain, padded(plain, 0.001)})
      for (const double margin : {0.0, 0.1, 0.5, 1.0})
        for (const double cell : {0.1, 0.25, 0.5}) {
          const auto element = structuring_element(reach, margin, cell);
          const auto held = voxels_of(element);
          for (int i = 0; i < 3000; ++i) {
            const Vec3 p = Vec3(u(rng), u(rng), u(rng)) * 0.999999 + 5e-7 +
                           random_move(reach, margin, rng) * (1 - 1e-9) / cell;
            const Key k{static_cast<int>(std::floor(p.x)), static_cast<int>(std::floor(p.y)),
                        static_cast<int>(std::floor(p.z))};
            ASSERT_TRUE(held.count(k) == 1)
                << reach.to_string() << " + " << margin << " / " << cell;
          }
        }
}

// Else it would cost solids for nothing: each of its voxels is really touched, give or take a hair.
TEST(StructuringElement, HoldsNoVoxelThatIsOutOfReach) {
  for (const Reach& reach : reaches())
    for (const double margin : {0.1, 0.5}) {
      constexpr double kCell = 0.1;
      for (const auto& [x, y, z] : voxels_of(structuring_element(reach, margin, kCell))) {
        const Vec3 q = glm::max(glm::abs(Vec3(x, y, z)) - 1.0, 0.0) * kCell;
        // No direction of many shows the nearest corner outside.
        for (int i = 0; i <= 12; ++i)
          for (int j = 0; j <= 12; ++j) {
            const double a = i * std::acos(0.0) / 12;
            const double b = j * std::acos(0.0) / 12;
            const Vec3 n{std::cos(a) * std::cos(b), std::sin(b), std::sin(a) * std::cos(b)};
            ASSERT_LE(glm::dot(q, n), reach.support(n) + margin + 1e-6)
                << reach.to_string() << ' ' << x << ' ' << y << ' ' << z;
          }
      }
    }
}

struct Voxels {
  BitWindow window;
  bool operator()(int x, int y, int z) const {
    const int bit = x + 64 * (window.words() / 2);
    return ((window.row(y, z)[bit >> 6] >> (bit & 63)) & 1U) != 0;
  }
};

/// Blocks and holes, so that something is left after eroding.
Voxels random_voxels(const IVec3& pad, unsigned seed) {
  Voxels v{BitWindow(pad)};
  std::mt19937 rng(seed);
  const auto in = [&](int n) { return static_cast<int>(rng() % static_cast<unsigned>(n)); };
  for (int z = -pad.z; z < 64 + pad.z; ++z)
    for (int y = -pad.y; y < 64 + pad.y; ++y)
      for (int w = 0; w < v.window.words(); ++w)
        v.window.row(y, z)[w] = ~std::uint64_t{0};
  for (int i = 0; i < 30; ++i) {
    const int x0 = in(64 * v.window.words());
    const int y0 = in(64 + 2 * pad.y) - pad.y;
    const int z0 = in(64 + 2 * pad.z) - pad.z;
    const int n[3] = {1 + in(i < 5 ? 40 : 4), 1 + in(i < 5 ? 40 : 4), 1 + in(4)};
    for (int z = z0; z < std::min(z0 + n[2], 64 + pad.z); ++z)
      for (int y = y0; y < std::min(y0 + n[1], 64 + pad.y); ++y)
        for (int x = x0; x < std::min(x0 + n[0], 64 * v.window.words()); ++x)
          v.window.row(y, z)[x >> 6] &= ~(std::uint64_t{1} << (x & 63));
  }
  return v;
}

TEST(ErodeCube, IsWhatBruteForceLeavesForEveryReach) {
  unsigned seed = 1;
  for (const Reach& plain : reaches()) {
    const Reach reach = padded(plain, 0.001);
    for (const double margin : {0.1, 0.5}) {
      constexpr double kCell = 0.4;
      const auto element = structuring_element(reach, margin, kCell);
      const auto need = voxels_of(element);
      const Voxels v =
          random_voxels({element.radius.x + 1, element.radius.y + 1, element.radius.z + 1}, ++seed);
      const BitCube all(64 * 64, ~std::uint64_t{0});
      const BitCube left = erode_cube(v.window, element, all);
      std::size_t kept = 0;
      for (int z = 0; z < 64; ++z)
        for (int y = 0; y < 64; ++y)
          for (int x = 0; x < 64; ++x) {
            const bool stays = ((left[static_cast<std::size_t>(y + 64 * z)] >> x) & 1U) != 0;
            bool should = true;
            for (const auto& [dx, dy, dz] : need)
              if (!v(x + dx, y + dy, z + dz)) {
                should = false;
                break;
              }
            ASSERT_EQ(stays, should) << reach.to_string() << ' ' << x << ' ' << y << ' ' << z;
            kept += stays ? 1 : 0;
          }
      EXPECT_GT(kept, 0U) << reach.to_string();
    }
  }
}

TEST(GreedyBoxes, AreTheSetBitsEachOnce) {
  const Voxels v = random_voxels({0, 0, 0}, 7);
  BitCube bits;
  std::size_t count = 0;
  for (int z = 0; z < 64; ++z)
    for (int y = 0; y < 64; ++y) {
      bits.push_back(v.window.row(y, z)[0]);
      for (int x = 0; x < 64; ++x)
        count += v(x, y, z) ? 1U : 0U;
    }
  std::size_t held = 0;
  for (const VoxelBox& b : greedy_boxes(bits))
    for (int z = b.lo.z; z < b.hi.z; ++z)
      for (int y = b.lo.y; y < b.hi.y; ++y)
        for (int x = b.lo.x; x < b.hi.x; ++x) {
          ASSERT_TRUE(v(x, y, z));
          ++held;
        }
  EXPECT_EQ(held, count);
}

double volume(const FaceMesh& mesh) {
  double six = 0;
  for (const auto& f : mesh.faces)
    for (const auto& [a, b, c] : {std::tuple(f[0], f[1], f[2]), std::tuple(f[0], f[2], f[3])})
      six += glm::dot(mesh.points[a], glm::cross(mesh.points[b], mesh.points[c]));
  return six / 6;
}

TEST(BoundaryRectangles, EncloseTheSetBitsFromOutside) {
  const Voxels v = random_voxels({0, 0, 0}, 9);
  BitCube bits;
  std::size_t count = 0;
  for (int z = 0; z < 64; ++z)
    for (int y = 0; y < 64; ++y) {
      bits.push_back(v.window.row(y, z)[0]);
      count += static_cast<std::size_t>(__builtin_popcountll(bits.back()));
    }
  EXPECT_NEAR(volume(boundary_rectangles(bits)), static_cast<double>(count), 1e-6);
  EXPECT_NEAR(volume(box_faces(greedy_boxes(bits))), static_cast<double>(count), 1e-6);
  BitCube one(64 * 64, 0);
  one[5 + 64 * 6] = 0xf0;
  EXPECT_EQ(boundary_rectangles(one).faces.size(), 6U);
  EXPECT_EQ(boundary_rectangles(one).points.size(), 8U);
}

}  // namespace
}  // namespace ivis
