#pragma once

#include <string>
#include <vector>

#include "core/math.h"
#include "scenes/write_glb.h"

namespace ivis {

/// A ground: heights at the crossings of a regular grid, two triangles a cell. Metres.
struct HeightGrid {
  Vec2 lo{0};  ///< of the rectangle it covers
  Vec2 hi{0};
  std::size_t cells_x = 0;
  std::size_t cells_z = 0;
  std::vector<float> y;  ///< (cells_x + 1) * (cells_z + 1), x fastest

  std::size_t index(std::size_t i, std::size_t k) const { return k * (cells_x + 1) + i; }
  float& at(std::size_t i, std::size_t k) { return y[index(i, k)]; }
  float at(std::size_t i, std::size_t k) const { return y[index(i, k)]; }
  /// As drawn: in float, each coordinate from its index in the whole grid, so that tiles share it
  /// exactly.
  glm::vec3 vertex(std::size_t i, std::size_t k) const;
  Vec2 cell_size() const;
  /// Cell that holds p; clamped to the grid.
  std::pair<std::size_t, std::size_t> cell_of(const Vec2& p) const;
  /// Height of the drawn triangle at p; p outside is clamped to the border.
  double height(const Vec2& p) const;
  /// Lowest vertex of any cell that the rectangle touches: nowhere in it does the ground lie lower.
  double lowest(const Vec2& from, const Vec2& to) const;
};

/// Adds the ground to `scene` as tiles of at most `tile_cells` cells a side, nodes "ground_<i>_<k>"
/// with the identity as transform. Neighbours share border vertices bit by bit; every border vertex
/// of one is a border vertex of the other, so there are neither gaps nor T-junctions; together they
/// cover exactly the rectangle lo..hi (rounded to float).
void add_ground_tiles(GlbScene& scene, const HeightGrid& grid, std::size_t tile_cells,
                      std::uint32_t material);

}  // namespace ivis
