#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/aabb.h"

namespace ivis {

/// A 16-wide hierarchy of boxes, full nodes, structure of arrays: one node is tested with one
/// vector instruction a step. Boxes are single precision relative to `origin`, rounded outwards.
/// Threads: read-only after build.
struct BoxTree {
  static constexpr std::uint32_t kWidth = 16;
  static constexpr std::uint32_t kItem = 0x80000000U;  ///< child is an item, not a node

  struct alignas(64) Node {
    std::array<float, kWidth> lo_x, hi_x, lo_z, hi_z, hi_y, lo_y;
    std::array<std::uint32_t, kWidth> child;  ///< node index, or kItem | item
    std::uint32_t count = 0;                  ///< children in use, from the front
  };

  Vec3 origin{0};
  std::vector<Node> nodes;  ///< nodes[0] is the root; empty when there is no item

  /// `items[i]` names box `boxes[i]`. Cost: O(n log² n). Relative to `tree_origin`.
  static BoxTree build(std::span<const Aabb> boxes, std::span<const std::uint32_t> items,
                       const Vec3& tree_origin);
  /// The same, sixteen neighbours in the order given to a node. Cost: O(n), some nanoseconds a box.
  static BoxTree pack(std::span<const Aabb> boxes, std::span<const std::uint32_t> items,
                      const Vec3& tree_origin);
};

}  // namespace ivis
