#pragma once
// A sparse grid of bits over a scene: tiles of 8 x 8 x 8 voxels, of which only those that a
// triangle comes near store anything.

#include <array>
#include <cstdint>
#include <vector>

#include "core/math.h"

namespace ivis {

/// 512 voxels of a tile: bit x + 8 y of word z.
using TileBits = std::array<std::uint64_t, 8>;

struct IVec3 {
  std::int32_t x = 0, y = 0, z = 0;
  bool operator==(const IVec3&) const = default;
};

/// Corners in voxels from the grid's origin.
struct GridTriangle {
  std::array<Vec3, 3> v;
};

/// Voxels that triangles touch are *marked*; the unmarked ones of a tile fall into *nodes*,
/// 6-connected within the tile. A tile without triangles is one node and costs four bytes. A label
/// names a 6-connected set of unmarked voxels of the whole grid. Threads: a value.
class VoxelGrid {
 public:
  static constexpr std::int32_t kTile = 8;
  static constexpr std::uint32_t kAir =
      0x80000000U;  ///< table: an air tile, label in the other bits
  static constexpr std::uint32_t kMarked = 0xffffffffU;  ///< label_at: of a marked voxel
  static constexpr std::uint32_t kUnlabelled = 0;

  struct Tile {
    std::uint32_t at = 0;              ///< index into `table`
    std::uint32_t first_node = 0;      ///< up to the next tile's
    std::uint32_t first_triangle = 0;  ///< into tile_triangles, up to the next tile's
    TileBits marked{};
  };

  Vec3 origin{0};
  double cell = 1;                   ///< metres
  IVec3 tiles;                       ///< of the grid, along each axis
  std::vector<std::uint32_t> table;  ///< index into `mixed`, or kAir | label
  std::vector<Tile> mixed;           ///< ascending `at`; one more closes the ranges
  std::vector<TileBits> node_bits;
  std::vector<std::uint32_t> node_tile;  ///< index into `mixed`
  std::vector<std::uint32_t> node_label;
  std::vector<GridTriangle> triangles;
  std::vector<std::uint32_t> tile_triangles;

  std::size_t mixed_count() const { return mixed.empty() ? 0 : mixed.size() - 1; }
  IVec3 voxels() const { return {tiles.x * kTile, tiles.y * kTile, tiles.z * kTile}; }
  bool tile_inside(const IVec3& t) const {
    return t.x >= 0 && t.y >= 0 && t.z >= 0 && t.x < tiles.x && t.y < tiles.y && t.z < tiles.z;
  }
  bool inside(const IVec3& v) const {
    return v.x >= 0 && v.y >= 0 && v.z >= 0 && v.x < tiles.x * kTile && v.y < tiles.y * kTile &&
           v.z < tiles.z * kTile;
  }
  std::size_t tile_index(const IVec3& t) const {
    return static_cast<std::size_t>(t.x) +
           static_cast<std::size_t>(tiles.x) *
               (static_cast<std::size_t>(t.y) +
                static_cast<std::size_t>(tiles.y) * static_cast<std::size_t>(t.z));
  }
  IVec3 tile_at(std::size_t index) const {
    const auto nx = static_cast<std::size_t>(tiles.x);
    const auto ny = static_cast<std::size_t>(tiles.y);
    return {static_cast<std::int32_t>(index % nx), static_cast<std::int32_t>(index / nx % ny),
            static_cast<std::int32_t>(index / nx / ny)};
  }
  static unsigned local_bit(const IVec3& v) {
    return static_cast<unsigned>((v.x & 7) + 8 * (v.y & 7));
  }
  static bool test(const TileBits& bits, const IVec3& v) {
    return ((bits[static_cast<std::size_t>(v.z & 7)] >> local_bit(v)) & 1U) != 0;
  }
  Vec3 to_grid(const Vec3& world) const { return (world - origin) / cell; }
  Vec3 to_world(const Vec3& grid) const { return origin + grid * cell; }
  Vec3 centre(const IVec3& v) const { return to_world({v.x + 0.5, v.y + 0.5, v.z + 0.5}); }

  /// Of a voxel inside the grid: its label, or kMarked.
  std::uint32_t label_at(const IVec3& v) const;
  /// Bytes held.
  std::size_t bytes() const;
};

/// Voxels of `bits` at the side of a tile in direction `axis`, `positive`, moved to where the
/// neighbouring tile has the voxels beside them.
TileBits across(const TileBits& bits, int axis, bool positive);
bool any(const TileBits& bits);
bool meet(const TileBits& a, const TileBits& b);
/// The 6-connected part of `free` that holds `seed` (a subset of `free`).
TileBits fill(TileBits seed, const TileBits& free);

}  // namespace ivis
