#include "core/view_cell.h"

#include "core/aabb.h"
#include "core/assert.h"

namespace ivis {

ViewCell cover(std::span<const Vec3> eyes, const Reach& reach) {
  IVIS_ASSERT(!eyes.empty(), "an observer has at least one eye");
  Aabb box;
  for (const Vec3& e : eyes)
    box.add(e);
  const Vec3 centre = eyes.size() == 1 ? eyes[0] : box.centre();
  double horizontal = 0;
  double vertical = 0;
  for (const Vec3& e : eyes) {
    horizontal = std::max(horizontal, std::hypot(e.x - centre.x, e.z - centre.z));
    vertical = std::max(vertical, std::abs(e.y - centre.y));
  }
  if (horizontal == 0 && vertical == 0) return {centre, reach};
  // What is grown is no disc any more, so a disc's larger vertical tolerance becomes reach.
  return {centre, reach.grown(horizontal, vertical + vertical_tolerance(reach) - kReachToleranceM)};
}

}  // namespace ivis
