#pragma once

#include <cstdint>
#include <vector>

#include "core/aabb.h"
#include "occluders/occluder_set.h"

namespace ivis {

/// How the occluders of a changed scene differ from the set that was shrunk for it.
/// Guarantee: that of the set, for the scene without the matter in `displaced`, and with what
///            `added` rests on. Threads: a value, read by many.
struct OccluderChange {
  /// By index into OccluderSet::shrunk: not 0, it hides nothing. Empty: all stand.
  std::vector<std::uint8_t> shrunk_off;
  /// Where matter is missing. A backing of an object near one does not hold (near_displaced).
  std::vector<Aabb> displaced;
  /// Shrunk as OccluderSet::shrunk is.
  std::vector<Prism> added;
  /// About the solids of `added` that the set does not know: an eye in one is inside matter.
  std::vector<Aabb> added_solids;
};

/// May what backs an object with these bounds be missing? Backing matter holds the object's place
/// but for what stands out of it (wall_backing.h: 1.5 m at most), or touches it (backing.h).
inline bool near_displaced(const OccluderChange& change, const Aabb& bounds) {
  constexpr double kNearM = 1.6;
  for (const Aabb& box : change.displaced)
    if (box.overlaps({bounds.lo - kNearM, bounds.hi + kNearM})) return true;
  return false;
}

}  // namespace ivis
