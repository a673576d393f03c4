#include "occluders/height_field.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "core/view_cell.h"
#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "tests/support/scene_builder.h"

namespace ivis {
namespace {

using test::SceneBuilder;

constexpr double kStep = 4;

/// A grid of `n` x `n` cells of kStep about the origin; cells for which `hole` holds are left out.
template <class Height, class Hole>
Mesh grid_mesh(int n, const Height& height, const Hole& hole) {
  Mesh m;
  for (int k = 0; k <= n; ++k)
    for (int i = 0; i <= n; ++i)
      m.positions.emplace_back((i - n / 2) * kStep, height(i, k), (k - n / 2) * kStep);
  for (int k = 0; k < n; ++k)
    for (int i = 0; i < n; ++i) {
      if (hole(i, k)) continue;
      const auto a = static_cast<std::uint32_t>(k * (n + 1) + i);
      const auto c = a + static_cast<std::uint32_t>(n + 1);
      m.indices.insert(m.indices.end(), {a, c + 1, a + 1, a, c, c + 1});
    }
  m.primitives = {{0, static_cast<std::uint32_t>(m.triangles()), true, true}};
  return m;
}
bool nowhere(int, int) {
  return false;
}

float at(const HeightField& f, std::size_t c, std::size_t r) {
  return f.heights[r * f.columns + c];
}

const std::vector<Reach> kReaches{Reach::ball(5),          Reach::disc(3),
                                  Reach::cylinder(9, 2),   Reach::ellipsoid({11, 2, 3}),
                                  Reach::box({2, 1, 8.5}), Reach::ball(0)};

// The oracle looks at every pair of cells and samples of the reach, and knows nothing of kernels.
TEST(HeightFieldErosion, LiesUnderTheFieldHoweverItIsMovedAndNoLowerThanItMust) {
  std::mt19937 rng(3);
  const auto unit = [&] { return static_cast<double>(rng()) / 4294967296.0; };
  for (const Reach& reach : kReaches) {
    HeightField field;
    field.columns = 23;
    field.rows = 17;
    field.step = {2.5, 4};
    for (int i = 0; i < 23 * 17; ++i)
      field.heights.push_back(rng() % 60 == 0 ? HeightField::kNone
                                              : static_cast<float>(100 * unit()));
    const Reach grown = padded(reach, 0.001);
    const HeightField out = erode(field, grown, 0.25);
    ASSERT_EQ(out.heights.size(), field.heights.size());
    const Vec3 e = grown.half_extents();
    std::size_t kept = 0;
    for (std::size_t r = 0; r < field.rows; ++r)
      for (std::size_t c = 0; c < field.columns; ++c) {
        const float h = at(out, c, r);
        float least = std::numeric_limits<float>::infinity();
        bool past = false;
        // Moved by samples of the reach from samples of the cell.
        for (int s = 0; s < 600; ++s) {
          const Vec2 p =
              Vec2{static_cast<double>(c) + unit(), static_cast<double>(r) + unit()} * field.step;
          Vec3 v{e.x * (2 * unit() - 1), 0, e.z * (2 * unit() - 1)};
          if (s % 4 == 0)
            v = grown.extreme_points(64)[static_cast<std::size_t>(s / 4 % 64)] * Vec3{1, 0, 1};
          if (!grown.contains(v, 1e-9, 1e-9)) continue;
          const Vec2 q = glm::floor((p + Vec2{v.x, v.z}) / field.step);
          if (q.x < 0 || q.y < 0 || q.x >= field.columns || q.y >= field.rows) {
            past = true;
          } else {
            least = std::min(
                least, at(field, static_cast<std::size_t>(q.x), static_cast<std::size_t>(q.y)));
          }
        }
        if (past || least == HeightField::kNone) {
          EXPECT_EQ(h, HeightField::kNone) << reach.to_string() << ' ' << c << ' ' << r;
          continue;
        }
        EXPECT_TRUE(h == HeightField::kNone || h <= least - 0.249F) << reach.to_string();
        // No lower than the least over cells whose rectangles are as near as the reach.
        float all = std::numeric_limits<float>::infinity();
        bool inside = true;
        for (int y = -20; y <= 20; ++y)
          for (int x = -30; x <= 30; ++x) {
            const Vec3 gap{std::max(0, std::abs(x) - 1) * field.step.x, 0,
                           std::max(0, std::abs(y) - 1) * field.step.y};
            if (!grown.contains(gap, 1e-6, 1)) continue;
            const auto cx = static_cast<int>(c) + x;
            const auto cy = static_cast<int>(r) + y;
            if (cx < 0 || cy < 0 || cx >= 23 || cy >= 17) {
              inside = false;
              continue;
            }
            all = std::min(all,
                           at(field, static_cast<std::size_t>(cx), static_cast<std::size_t>(cy)));
          }
        if (inside && all != HeightField::kNone) {
          ++kept;
          EXPECT_NEAR(h, all - 0.25F, 1e-3F) << reach.to_string();
        } else {
          EXPECT_EQ(h, HeightField::kNone) << reach.to_string();
        }
      }
    EXPECT_TRUE(kept > 5 || e.x > 6) << reach.to_string();
  }
}

TEST(Terrain, TakesTheLeastHeightOfEachCellAndLeavesHolesAndBordersOut) {
  const auto height = [](int i, int k) { return 10 + 3 * std::sin(i * 1.3) * std::cos(k * 0.7); };
  SceneBuilder b;
  b.add_mesh(grid_mesh(20, height, [](int i, int k) { return i == 12 && k == 9; }));
  const Scene scene = std::move(b).finish();
  const auto terrain = find_terrain(scene, 100);
  ASSERT_TRUE(terrain);
  const HeightField& f = terrain->field;
  ASSERT_EQ(f.columns, 20U);
  ASSERT_EQ(f.rows, 20U);
  EXPECT_EQ(terrain->objects, std::vector<ObjectId>{0});
  for (int k = 0; k < 20; ++k)
    for (int i = 0; i < 20; ++i) {
      const bool border = i == 0 || k == 0 || i == 19 || k == 19;
      const bool by_hole = std::abs(i - 12) <= 1 && std::abs(k - 9) <= 1;
      const double least =
          std::min({height(i, k), height(i + 1, k), height(i, k + 1), height(i + 1, k + 1)});
      const float h = at(f, static_cast<std::size_t>(i), static_cast<std::size_t>(k));
      if (border || by_hole) {
        EXPECT_EQ(h, HeightField::kNone) << i << ' ' << k;
      } else {
        EXPECT_NEAR(h, least, 1e-4) << i << ' ' << k;
        EXPECT_LE(h, least);
      }
    }
}

TEST(Terrain, SmallerCellsFollowTheTrianglesMoreCloselyAndNeverFromAbove) {
  const auto height = [](int i, int k) { return 2.0 * i + ((i + k) % 2 == 0 ? 3 : 0); };
  SceneBuilder b;
  b.add_mesh(grid_mesh(12, height, nowhere));
  const Scene scene = std::move(b).finish();
  const auto terrain = find_terrain(scene, 1);
  ASSERT_TRUE(terrain);
  const HeightField& f = terrain->field;
  ASSERT_EQ(f.columns, 48U);
  for (std::size_t r = 4; r < 44; ++r)
    for (std::size_t c = 4; c < 44; ++c) {
      const std::size_t i = c / 4;
      const std::size_t k = r / 4;
      double least = 1e9;
      for (double y = 0; y <= 1; y += 0.125)
        for (double x = 0; x <= 1; x += 0.125) {
          const double fx = (static_cast<double>(c % 4) + x) / 4;
          const double fz = (static_cast<double>(r % 4) + y) / 4;
          const auto h = [&](std::size_t a, std::size_t d) {
            return height(static_cast<int>(i + a), static_cast<int>(k + d));
          };
          const double y00 = h(0, 0);
          const double y11 = h(1, 1);
          least = std::min(least, fx >= fz ? y00 + (h(1, 0) - y00) * fx + (y11 - h(1, 0)) * fz
                                           : y00 + (y11 - h(0, 1)) * fx + (h(0, 1) - y00) * fz);
        }
      EXPECT_LE(at(f, c, r), least);
      EXPECT_NEAR(at(f, c, r), least, 0.01);
    }
}

TEST(Terrain, ACrackOfATenthOfAMillimetreIsAHole) {
  const auto height = [](int i, int k) { return 5.0 + i + 0.3 * k; };
  for (const float crack : {0.0F, 1e-4F}) {
    Mesh mesh = grid_mesh(16, height, nowhere);
    // A triangle of cell (8, 8) gets a corner of its own, a little off.
    const std::size_t t = 2 * (8 * 16 + 8);
    const std::uint32_t old = mesh.indices[3 * t + 1];
    mesh.indices[3 * t + 1] = static_cast<std::uint32_t>(mesh.positions.size());
    const auto moved = mesh.positions[old] - glm::vec3{crack, 0, crack};
    mesh.positions.push_back(moved);
    SceneBuilder b;
    b.add_mesh(std::move(mesh));
    const Scene scene = std::move(b).finish();
    const auto terrain = find_terrain(scene, 100);
    ASSERT_TRUE(terrain);
    EXPECT_EQ(at(terrain->field, 8, 8) == HeightField::kNone, crack > 0);
  }
}

TEST(Terrain, IsNotMadeOfFlatGroundOrACeilingOrWhatIsMarkedNever) {
  {
    SceneBuilder b;
    b.add_ground({-50, -50}, {50, 50}, 0);
    EXPECT_FALSE(find_terrain(std::move(b).finish(), 10));
  }
  const auto height = [](int i, int) { return 20.0 + i; };
  {
    SceneBuilder b;
    b.add_mesh(grid_mesh(20, height, nowhere));
    for (int i = 0; i < 10; ++i)
      b.add_box({i, 1, i}, {i + 1, 2, i + 1}, OccluderTag::kNever);
    EXPECT_FALSE(find_terrain(std::move(b).finish(), 10));
  }
  {
    SceneBuilder b;
    b.add_mesh(grid_mesh(20, height, nowhere), OccluderTag::kNever);
    EXPECT_FALSE(find_terrain(std::move(b).finish(), 10));
  }
}

TEST(Terrain, ShrinkGivesPrismsAndAHeightFieldAndGroundsNoPrismOnRaggedTerrain) {
  const auto height = [](int i, int k) { return 2.0 * std::sin(0.4 * i) + 3 * std::cos(0.3 * k); };
  for (const bool ragged : {false, true}) {
    SceneBuilder b;
    b.add_mesh(grid_mesh(60, height, [&](int i, int k) { return ragged && i + k < 8; }));
    b.add_box({10, -6, 10}, {30, 20, 40});
    const Scene scene = std::move(b).finish();
    ShrinkOptions options;
    options.reach = Reach::cylinder(1, 0.2);
    const auto shrunk = shrink(scene, options, FastEroder{});
    ASSERT_TRUE(shrunk);
    EXPECT_FALSE(shrunk->set.height_field.empty());
    ASSERT_EQ(shrunk->set.shrunk.size(), 1U);
    EXPECT_EQ(shrunk->set.shrunk[0].grounded, !ragged);
    EXPECT_EQ(shrunk->set.ground.empty(), ragged);
    EXPECT_EQ(shrunk->report.left_out.count("ground"), 1U);
  }
}

}  // namespace
}  // namespace ivis
