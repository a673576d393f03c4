#pragma once

#include <cstdint>
#include <vector>

#include "occluders/occluder_set.h"
#include "occluders/rect_tree.h"
#include "scenes/scene.h"

namespace ivis {

/// Which shrunk prisms may rest on matter at a place.
///
/// Why: a shrunk prism P is in use because P + W lies in the union of the scene's solids (W:
/// OccluderSet). Taking away the matter of an object that P + W does not meet leaves that true. P
/// may reach down without end, so all matter below its top counts, whatever P's bottom.
/// Threads:   read-only once made. Ownership: borrows the set.
/// Cost:      made in O(n log n); a query is logarithmic, and linear in what it finds.
class OccluderIndex {
 public:
  explicit OccluderIndex(const OccluderSet& set);
  const OccluderSet& occluders() const { return set_; }
  /// What a prism of OccluderSet::shrunk may rest on lies in this.
  const Aabb& box(std::uint32_t prism) const { return boxes_[prism]; }
  /// The same of any prism shrunk as they are.
  Aabb box_of(const Prism& prism) const;
  /// Indices into OccluderSet::shrunk, ascending; `matter` holds all of an object.
  std::vector<std::uint32_t> touched(const Aabb& matter) const;
  /// Indices into OccluderSet::solids that may stand on the area, ascending.
  std::vector<std::uint32_t> solids_on(const Box2& area) const;
  /// Of a solid.
  const Aabb& solid_box(std::uint32_t solid) const { return solid_boxes_[solid]; }

 private:
  const OccluderSet& set_;
  Vec3 reach_;
  RectTree tree_;
  std::vector<Aabb> boxes_;  ///< of P + W, down without end
  RectTree solids_;
  std::vector<Aabb> solid_boxes_;
};

/// Can the object be part of an occluder? Not one tagged `never`, nor one that moves by itself, nor
/// one without an opaque triangle. Clusters of a mesh are not told apart from it: ask for wholes.
bool is_matter(const Scene& scene, const Object& object);

/// Could the object be ground, which grounded prisms and height fields rest on far from it? True
/// for whatever is made of nothing but opaque triangles that are not steep and do not lie over each
/// other.
/// Cost: linear in its triangles.
bool holds_ground(const Scene& scene, const Object& object);

}  // namespace ivis
