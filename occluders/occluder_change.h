#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/aabb.h"
#include "occluders/occluder_set.h"
#include "occluders/rect_tree.h"

namespace ivis {

/// Where matter is missing.
class DisplacedMatter {
 public:
  DisplacedMatter() = default;
  explicit DisplacedMatter(std::vector<Aabb> boxes) : boxes_(std::move(boxes)) {
    std::vector<Box2> flat;
    for (const Aabb& b : boxes_)
      flat.push_back(ground_box(b));
    tree_ = RectTree(flat);
  }
  /// May what backs an object with these bounds be missing? Backing matter holds the object's place
  /// but for what stands out of it (wall_backing.h: 1.5 m at most), or touches it (backing.h).
  /// Cost: logarithmic.
  bool near(const Aabb& bounds) const {
    constexpr double kNearM = 1.6;
    const Aabb about{bounds.lo - kNearM, bounds.hi + kNearM};
    return !tree_.all(ground_box(about),
                      [&](std::uint32_t i) { return !boxes_[i].overlaps(about); });
  }

 private:
  std::vector<Aabb> boxes_;
  RectTree tree_;
};

/// How the occluders of a changed scene differ from the set that was shrunk for it.
/// Guarantee: that of the set, for the scene without the matter in `displaced`, and with what
///            `added` rests on. Threads: a value, read by many.
struct OccluderChange {
  /// By index into OccluderSet::shrunk: not 0, it hides nothing. Empty: all stand.
  std::vector<std::uint8_t> shrunk_off;
  DisplacedMatter displaced;
  /// Shrunk as OccluderSet::shrunk is.
  std::vector<Prism> added;
  /// About the solids of `added` that the set does not know: an eye in one is inside matter.
  std::vector<Aabb> added_solids;
};

}  // namespace ivis
