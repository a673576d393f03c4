#include "occluders/fast_erosion.h"

#include "core/assert.h"
#include "occluders/clip.h"

namespace ivis {
namespace {

/// Hull of `shape` (convex, positive area) placed at a and at b.
Ring capsule(const Vec2& a, const Vec2& b, const std::vector<Vec2>& shape) {
  const Vec2 right{b.y - a.y, a.x - b.x};
  const std::size_t n = shape.size();
  std::size_t r = 0;
  std::size_t l = 0;
  for (std::size_t i = 1; i < n; ++i) {
    if (glm::dot(shape[i], right) > glm::dot(shape[r], right)) r = i;
    if (glm::dot(shape[i], right) < glm::dot(shape[l], right)) l = i;
  }
  // Going round with the interior on the left, from the rightmost corner on one walks forward.
  Ring ring;
  ring.reserve(n + 2);
  ring.push_back(a + shape[r]);
  for (std::size_t i = r;; i = (i + 1) % n) {
    ring.push_back(b + shape[i]);
    if (i == l) break;
  }
  for (std::size_t i = l; i != r; i = (i + 1) % n)
    ring.push_back(a + shape[i]);
  return ring;
}

}  // namespace

FastEroder::FastEroder(int k) : k_(k) {
  IVIS_ASSERT(k >= 4 && k % 2 == 0,
              "the circumscribed polygon is symmetric, with at least four sides");
}

// E(P, V) = P \ (boundary of P + -V): V is connected and contains 0, so x + V leaves P only if it
// meets the boundary. V is symmetric: -V = V. Each capsule circumscribes its edge + V, grown by
// what rounding to the grid may take from it or add to P; the difference is thus inside the true
// erosion.
std::vector<Polygon> FastEroder::erode(const Polygon& polygon, const Reach& reach) const {
  const Reach grown = reach.grown(kGridSlackM, 0);
  const std::vector<Vec2> box = grown.circumscribed_polygon(4);
  std::vector<Ring> capsules;
  for (const Ring& ring : polygon.rings)
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Vec2& a = ring[i];
      const Vec2& b = ring[(i + 1) % ring.size()];
      if (a == b) continue;
      const Vec2 normal{a.y - b.y, b.x - a.x};
      capsules.push_back(
          capsule(a, b, grown.horizontal_is_box() ? box : grown.circumscribed_polygon(k_, normal)));
    }
  if (capsules.empty()) return {};
  return subtract(polygon.rings, Fill::kEvenOdd, capsules);
}

}  // namespace ivis
