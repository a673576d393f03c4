#include "occluders/flood.h"

#include <algorithm>
#include <bit>

namespace ivis {
namespace {

constexpr std::uint64_t kNodeFlag = std::uint64_t{1} << 63U;

class Labeller {
 public:
  Labeller(VoxelGrid& grid, const Context& context) : grid_(grid), context_(context) {}

  /// An item is an air tile, or a node with kNodeFlag.
  bool take(std::uint64_t item, std::uint32_t label, VoxelComponent& c) {
    if ((item & kNodeFlag) != 0) {
      const auto node = static_cast<std::uint32_t>(item);
      if (grid_.node_label[node] != VoxelGrid::kUnlabelled) return false;
      grid_.node_label[node] = label;
      const IVec3 t = grid_.tile_at(grid_.mixed[grid_.node_tile[node]].at);
      std::uint64_t xy = 0;
      for (std::int32_t z = 0; z < 8; ++z) {
        const std::uint64_t w = grid_.node_bits[node][static_cast<std::size_t>(z)];
        if (w == 0) continue;
        if (c.voxels == 0) {
          const int bit = std::countr_zero(w);
          c.sample = {8 * t.x + bit % 8, 8 * t.y + bit / 8, 8 * t.z + z};
        }
        c.voxels += static_cast<std::size_t>(std::popcount(w));
        c.lo.z = std::min(c.lo.z, 8 * t.z + z);
        c.hi.z = std::max(c.hi.z, 8 * t.z + z);
        xy |= w;
      }
      c.lo.y = std::min(c.lo.y, 8 * t.y + std::countr_zero(xy) / 8);
      c.hi.y = std::max(c.hi.y, 8 * t.y + 7 - std::countl_zero(xy) / 8);
      unsigned x = 0;
      for (int y = 0; y < 8; ++y)
        x |= static_cast<unsigned>((xy >> (8 * y)) & 0xffU);
      c.lo.x = std::min(c.lo.x, 8 * t.x + std::countr_zero(x));
      c.hi.x = std::max(c.hi.x, 8 * t.x + 31 - std::countl_zero(x));
    } else {
      std::uint32_t& entry = grid_.table[item];
      if (entry != VoxelGrid::kAir) return false;
      entry = VoxelGrid::kAir | label;
      const IVec3 t = grid_.tile_at(item);
      if (c.voxels == 0) c.sample = {8 * t.x, 8 * t.y, 8 * t.z};
      c.voxels += 512;
      c.lo = {std::min(c.lo.x, 8 * t.x), std::min(c.lo.y, 8 * t.y), std::min(c.lo.z, 8 * t.z)};
      c.hi = {std::max(c.hi.x, 8 * t.x + 7), std::max(c.hi.y, 8 * t.y + 7),
              std::max(c.hi.z, 8 * t.z + 7)};
    }
    queue_.push_back(item);
    return true;
  }

  /// Everything joined to what take() queued; false when stopped.
  bool spread(std::uint32_t label, VoxelComponent& c) {
    static constexpr TileBits kAll{~0ULL, ~0ULL, ~0ULL, ~0ULL, ~0ULL, ~0ULL, ~0ULL, ~0ULL};
    while (!queue_.empty()) {
      if ((++steps_ & 0xffffU) == 0 && context_.stopped()) return false;
      const std::uint64_t item = queue_.back();
      queue_.pop_back();
      const bool is_node = (item & kNodeFlag) != 0;
      const TileBits& bits = is_node ? grid_.node_bits[static_cast<std::uint32_t>(item)] : kAll;
      const std::size_t at = is_node
                                 ? grid_.mixed[grid_.node_tile[static_cast<std::uint32_t>(item)]].at
                                 : static_cast<std::size_t>(item);
      const IVec3 t = grid_.tile_at(at);
      for (int axis = 0; axis < 3; ++axis)
        for (const bool positive : {false, true}) {
          IVec3 next = t;
          (axis == 0 ? next.x : axis == 1 ? next.y : next.z) += positive ? 1 : -1;
          if (!grid_.tile_inside(next)) continue;
          const TileBits face = across(bits, axis, positive);
          if (is_node && !any(face)) continue;
          const std::size_t index = grid_.tile_index(next);
          const std::uint32_t entry = grid_.table[index];
          if ((entry & VoxelGrid::kAir) != 0) {
            take(index, label, c);
          } else {
            for (std::uint32_t n = grid_.mixed[entry].first_node;
                 n < grid_.mixed[entry + 1].first_node; ++n)
              if (meet(face, grid_.node_bits[n])) take(kNodeFlag | n, label, c);
          }
        }
    }
    return true;
  }

 private:
  VoxelGrid& grid_;
  const Context& context_;
  std::vector<std::uint64_t> queue_;
  std::size_t steps_ = 0;
};

}  // namespace

Result<Flooded> flood(VoxelGrid& grid, const std::vector<IVec3>& seeds, const Context& context) {
  Flooded out;
  out.components.resize(2);
  Labeller labeller(grid, context);
  context.report("voxels: flooding", 0, 2);
  for (const IVec3& s : seeds) {
    if (!grid.inside(s)) continue;
    const std::uint32_t entry = grid.table[grid.tile_index({s.x >> 3, s.y >> 3, s.z >> 3})];
    std::uint64_t item = grid.tile_index({s.x >> 3, s.y >> 3, s.z >> 3});
    if ((entry & VoxelGrid::kAir) == 0) {
      std::uint32_t n = grid.mixed[entry].first_node;
      while (n < grid.mixed[entry + 1].first_node && !VoxelGrid::test(grid.node_bits[n], s))
        ++n;
      if (n == grid.mixed[entry + 1].first_node) continue;  // marked
      item = kNodeFlag | n;
    }
    if (labeller.take(item, Flooded::kReached, out.components[1])) {
      out.starts.push_back(s);
      if (!labeller.spread(Flooded::kReached, out.components[1])) return cancelled();
    }
  }
  context.report("voxels: flooding", 1, 2);
  const auto next = [&](std::uint64_t item) {
    const auto label = static_cast<std::uint32_t>(out.components.size());
    VoxelComponent c;
    if (!labeller.take(item, label, c)) return true;
    if (!labeller.spread(label, c)) return false;
    out.components.push_back(c);
    return true;
  };
  for (std::size_t i = 0; i < grid.table.size(); ++i) {
    if ((i & 0xfffffU) == 0 && context.stopped()) return cancelled();
    const std::uint32_t entry = grid.table[i];
    if (entry == VoxelGrid::kAir) {
      if (!next(i)) return cancelled();
    } else if ((entry & VoxelGrid::kAir) == 0) {
      for (std::uint32_t n = grid.mixed[entry].first_node; n < grid.mixed[entry + 1].first_node;
           ++n)
        if (!next(kNodeFlag | n)) return cancelled();
    }
  }
  context.report("voxels: flooding", 2, 2);
  return out;
}

}  // namespace ivis
