#pragma once

#include <cstdint>
#include <vector>

#include "scenes/scene.h"
#include "visibility/box_tree.h"
#include "visibility/map_frame.h"

namespace ivis {

/// Up to sixteen boxes that together hold an object's triangles, for objects whose one box is a
/// poor bound: large ones that fill little of it, such as walls and floors seen at a slant. What
/// hides all of an object's boxes hides the object. Threads: read-only after construction.
class SubBoxes {
 public:
  static constexpr std::uint32_t kNone = 0xffffffffU;

  /// Boxes in map coordinates. Cost: O(triangles of large objects x 16).
  SubBoxes(const Scene& scene, const MapFrame& frame);

  /// The node of `tree()` whose children are the object's boxes, or kNone. Its items are the
  /// object's id.
  std::uint32_t node_of(ObjectId id) const { return node_[id]; }
  const BoxTree& tree() const { return tree_; }

 private:
  BoxTree tree_;  ///< no tree: a row of nodes
  std::vector<std::uint32_t> node_;
};

}  // namespace ivis
