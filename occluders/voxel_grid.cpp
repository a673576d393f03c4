#include "occluders/voxel_grid.h"

namespace ivis {
namespace {

constexpr std::uint64_t kX0 = 0x0101010101010101ULL;  // the voxels of a word with x = 0
constexpr std::uint64_t kX7 = kX0 << 7U;

}  // namespace

std::uint32_t VoxelGrid::label_at(const IVec3& v) const {
  const std::uint32_t entry = table[tile_index({v.x >> 3, v.y >> 3, v.z >> 3})];
  if ((entry & kAir) != 0) return entry & ~kAir;
  const Tile& tile = mixed[entry];
  if (test(tile.marked, v)) return kMarked;
  for (std::uint32_t n = tile.first_node; n < mixed[entry + 1].first_node; ++n)
    if (test(node_bits[n], v)) return node_label[n];
  return kUnlabelled;
}

std::size_t VoxelGrid::bytes() const {
  const auto of = [](const auto& v) { return v.capacity() * sizeof(v[0]); };
  return of(table) + of(mixed) + of(node_bits) + of(node_tile) + of(node_label) + of(triangles) +
         of(tile_triangles);
}

TileBits across(const TileBits& bits, int axis, bool positive) {
  TileBits out{};
  if (axis == 0) {
    for (std::size_t z = 0; z < 8; ++z)
      out[z] = positive ? (bits[z] & kX7) >> 7U : (bits[z] & kX0) << 7U;
  } else if (axis == 1) {
    for (std::size_t z = 0; z < 8; ++z)
      out[z] = positive ? bits[z] >> 56U : bits[z] << 56U;
  } else if (positive) {
    out[0] = bits[7];
  } else {
    out[7] = bits[0];
  }
  return out;
}

bool any(const TileBits& bits) {
  std::uint64_t all = 0;
  for (const std::uint64_t w : bits)
    all |= w;
  return all != 0;
}

bool meet(const TileBits& a, const TileBits& b) {
  std::uint64_t all = 0;
  for (std::size_t z = 0; z < 8; ++z)
    all |= a[z] & b[z];
  return all != 0;
}

TileBits fill(TileBits seed, const TileBits& free) {
  const auto spread = [](std::uint64_t w, std::uint64_t f) {
    while (true) {
      const std::uint64_t next =
          (w | ((w & ~kX7) << 1U) | ((w & ~kX0) >> 1U) | (w << 8U) | (w >> 8U)) & f;
      if (next == w) return w;
      w = next;
    }
  };
  bool changed = true;
  while (changed) {
    changed = false;
    for (std::size_t z = 0; z < 8; ++z) {
      std::uint64_t w = seed[z];
      if (z > 0) w |= seed[z - 1] & free[z];
      w = spread(w, free[z]);
      changed = changed || w != seed[z];
      seed[z] = w;
    }
    for (std::size_t z = 7; z-- > 0;) {
      const std::uint64_t w = spread(seed[z] | (seed[z + 1] & free[z]), free[z]);
      changed = changed || w != seed[z];
      seed[z] = w;
    }
  }
  return seed;
}

}  // namespace ivis
