#include "scenes/height_grid.h"

#include <algorithm>
#include <cmath>

namespace ivis {
namespace {

float coordinate(double lo, double hi, std::size_t i, std::size_t n) {
  if (i == n) return static_cast<float>(hi);
  return static_cast<float>(lo + (hi - lo) * static_cast<double>(i) / static_cast<double>(n));
}

std::size_t cell_index(double v, double lo, double hi, std::size_t n) {
  const double f = std::floor((v - lo) / (hi - lo) * static_cast<double>(n));
  return static_cast<std::size_t>(std::clamp(f, 0.0, static_cast<double>(n - 1)));
}

}  // namespace

glm::vec3 HeightGrid::vertex(std::size_t i, std::size_t k) const {
  return {coordinate(lo.x, hi.x, i, cells_x), at(i, k), coordinate(lo.y, hi.y, k, cells_z)};
}

Vec2 HeightGrid::cell_size() const {
  return (hi - lo) / Vec2(static_cast<double>(cells_x), static_cast<double>(cells_z));
}

std::pair<std::size_t, std::size_t> HeightGrid::cell_of(const Vec2& p) const {
  return {cell_index(p.x, lo.x, hi.x, cells_x), cell_index(p.y, lo.y, hi.y, cells_z)};
}

double HeightGrid::height(const Vec2& p) const {
  const auto [i, k] = cell_of(p);
  const Vec2 size = cell_size();
  const Vec2 corner = lo + Vec2(static_cast<double>(i), static_cast<double>(k)) * size;
  const Vec2 f = glm::clamp((p - corner) / size, Vec2(0), Vec2(1));
  const double y00 = at(i, k);
  const double y11 = at(i + 1, k + 1);
  // The cell's diagonal runs from (0, 0) to (1, 1), as in add_ground_tiles.
  if (f.x >= f.y) {
    const double y10 = at(i + 1, k);
    return y00 + (y10 - y00) * f.x + (y11 - y10) * f.y;
  }
  const double y01 = at(i, k + 1);
  return y00 + (y11 - y01) * f.x + (y01 - y00) * f.y;
}

double HeightGrid::lowest(const Vec2& from, const Vec2& to) const {
  const auto [i0, k0] = cell_of(from);
  const auto [i1, k1] = cell_of(to);
  double low = at(i0, k0);
  for (std::size_t k = k0; k <= k1 + 1; ++k)
    for (std::size_t i = i0; i <= i1 + 1; ++i)
      low = std::min<double>(low, at(i, k));
  return low;
}

void add_ground_tiles(GlbScene& scene, const HeightGrid& grid, std::size_t tile_cells,
                      std::uint32_t material) {
  for (std::size_t k0 = 0; k0 < grid.cells_z; k0 += tile_cells) {
    for (std::size_t i0 = 0; i0 < grid.cells_x; i0 += tile_cells) {
      const std::size_t i1 = std::min(i0 + tile_cells, grid.cells_x);
      const std::size_t k1 = std::min(k0 + tile_cells, grid.cells_z);
      GlbPrimitive p;
      p.material = material;
      const auto row = static_cast<std::uint32_t>(i1 - i0 + 1);
      for (std::size_t k = k0; k <= k1; ++k)
        for (std::size_t i = i0; i <= i1; ++i)
          p.positions.push_back(grid.vertex(i, k));
      for (std::uint32_t k = 0; k < k1 - k0; ++k) {
        for (std::uint32_t i = 0; i + 1 < row; ++i) {
          const std::uint32_t v = k * row + i;  // winding: up
          p.indices.insert(p.indices.end(), {v, v + row + 1, v + 1, v, v + row, v + row + 1});
        }
      }
      GlbNode node;
      node.name =
          "ground_" + std::to_string(i0 / tile_cells) + "_" + std::to_string(k0 / tile_cells);
      node.mesh = static_cast<std::uint32_t>(scene.meshes.size());
      scene.meshes.push_back({node.name, {std::move(p)}});
      scene.nodes.push_back(std::move(node));
    }
  }
}

}  // namespace ivis
