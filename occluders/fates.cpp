#include "occluders/fates.h"

#include "occluders/rect_tree.h"

namespace ivis {
namespace {

/// Do the regions share more than a border? By corners and crossing edges: for reports, where a
/// rare wrong answer does no harm.
bool overlap(const Polygon& a, const Polygon& b) {
  const auto corner_in = [](const Polygon& p, const Polygon& q) {
    for (const auto& ring : p.rings)
      for (const Vec2& c : ring)
        if (contains(q, c)) return true;
    return false;
  };
  if (corner_in(a, b) || corner_in(b, a)) return true;
  const auto side = [](const Vec2& p, const Vec2& q, const Vec2& r) {
    return (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x) > 0;
  };
  for (const auto& r : a.rings)
    for (std::size_t i = 0; i < r.size(); ++i)
      for (const auto& s : b.rings)
        for (std::size_t k = 0; k < s.size(); ++k) {
          const Vec2& p = r[i];
          const Vec2& q = r[(i + 1) % r.size()];
          const Vec2& u = s[k];
          const Vec2& v = s[(k + 1) % s.size()];
          if (side(p, q, u) != side(p, q, v) && side(u, v, p) != side(u, v, q)) return true;
        }
  return false;
}

}  // namespace

void find_vanished(const OccluderSet& set, std::vector<ObjectFate>& fates) {
  std::vector<Box2> boxes;
  const auto box_of = [](const Polygon& p) {
    Box2 box;
    for (const auto& ring : p.rings)
      for (const Vec2& c : ring)
        box.add(c);
    return box;
  };
  boxes.reserve(set.shrunk.size());
  for (const Prism& p : set.shrunk)
    boxes.push_back(box_of(p.footprint));
  const RectTree tree(boxes);
  std::size_t next = 0;
  for (ObjectFate& fate : fates) {
    bool stands = false;
    for (std::size_t k = 0; k < fate.prisms; ++k) {
      const Polygon& footprint = set.solids[next++].footprint;
      if (!stands)
        stands = !tree.all(box_of(footprint), [&](std::uint32_t i) {
          return !overlap(footprint, set.shrunk[i].footprint);
        });
    }
    if (fate.prisms > 0) fate.vanished = !stands && (fate.convex == 0 || fate.vanished);
  }
}

}  // namespace ivis
