#pragma once

#include <cstdint>
#include <vector>

#include "visibility/blockers.h"

namespace ivis {

/// Does the open segment from q to y meet the closed triangle (edges and corners belong to it)? A
/// one-sided triangle (corners counter-clockwise seen from its front) blocks only from its front.
/// Guarantee: errs towards "meets". All corners are taken as exact doubles; a sign is trusted only
///            when it is larger than the bound on its rounding, so a segment that passes closer to
///            an edge than about 1e-15 |yq|^2 / |edge| counts as meeting it. A triangle that holds
///            y or q within 1e-15 of the largest coordinate is only touched at the end, which does
///            not block.
/// Threads:   reentrant.
bool segment_meets(const Triangle& triangle, const Vec3& q, const Vec3& y, bool one_sided = false);

/// All blockers of a scene, for segments in double precision: what single-precision rays let slip
/// between two triangles is found here.
/// Threads:   const and reentrant. Ownership: borrows scene and blockers.
/// Cost:      building O(n log n), 35 bytes a triangle; a query as a ray in a binary hierarchy.
class ExactSegments {
 public:
  ExactSegments(const Scene& scene, const Blockers& blockers);

  /// Guarantee: true if the open segment crosses a blocker; as segment_meets().
  bool blocked(const Vec3& q, const Vec3& y) const;

 private:
  /// Box relative to centre_, rounded outwards. Leaf: count > 0 and triangles order_[first ..];
  /// else the children are the next node and the node at `first`.
  struct Node {
    float lo[3];
    std::uint32_t first;
    float hi[3];
    std::uint32_t count;
  };
  struct Build;
  void split(Build& build, std::uint32_t begin, std::uint32_t end);

  const Scene& scene_;
  const Blockers& blockers_;
  Vec3 centre_{0};
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> order_;
};

}  // namespace ivis
