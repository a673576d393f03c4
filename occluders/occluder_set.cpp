#include "occluders/occluder_set.h"

#include <cmath>

#include "core/view_cell.h"

namespace ivis {

double area(const Polygon& polygon) {
  double twice = 0;
  for (const auto& ring : polygon.rings)
    for (std::size_t i = 0, n = ring.size(); i < n; ++i) {
      // Relative to the ring's first corner: far from the origin the products would swamp the sum.
      const Vec2 a = ring[i] - ring[0];
      const Vec2 b = ring[(i + 1) % n] - ring[0];
      twice += a.x * b.y - b.x * a.y;
    }
  return twice / 2;
}

bool contains(const Polygon& polygon, const Vec2& p) {
  bool inside = false;
  for (const auto& ring : polygon.rings)
    for (std::size_t i = 0, n = ring.size(); i < n; ++i) {
      const Vec2& a = ring[i];
      const Vec2& b = ring[(i + 1) % n];
      if ((a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x)) inside = !inside;
    }
  return inside;
}

Aabb Prism::bounds() const {
  Aabb box;
  for (const auto& ring : footprint.rings)
    for (const Vec2& p : ring) {
      box.add(Vec3{p.x, bottom, p.y});
      box.add(Vec3{p.x, top, p.y});
    }
  return box;
}

bool serves(const OccluderSet& set, const Reach& reach) {
  return serves(set.reach, set.slack_m, reach);
}

// A point Z under the prism and within its footprint, on a sight line QY. By the floor rule Q and Y lie
// no lower than solid_bottom, so Z cannot. By the ground rule Q is above the ground and Z below it, and
// the segment QZ stays over the rectangle that the ground covers: it crosses drawn, opaque ground.
bool extends_down(const OccluderSet& set, const Prism& prism, const Aabb& cell) {
  if (prism.solid_bottom <= set.floor && cell.lo.y >= prism.solid_bottom) return true;
  return prism.grounded && !set.ground.empty() && cell.lo.x >= set.ground.lo.x && cell.hi.x <= set.ground.hi.x &&
         cell.lo.z >= set.ground.lo.z && cell.hi.z <= set.ground.hi.z;
}

bool inside_solid(const OccluderSet& set, const Vec3& p) {
  for (const Prism& s : set.solids)
    if (p.y > s.bottom && p.y < s.top && contains(s.footprint, ground(p))) return true;
  return false;
}

}  // namespace ivis
