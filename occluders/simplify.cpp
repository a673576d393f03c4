#include "occluders/simplify.h"

#include <algorithm>
#include <cmath>

#include "occluders/clip.h"

namespace ivis {
namespace {

double cross(const Vec2& a, const Vec2& b) {
  return a.x * b.y - a.y * b.x;
}

/// One way to have a corner less at position i, and the area it costs.
struct Change {
  double cost = std::numeric_limits<double>::infinity();
  std::size_t at = 0;
  bool merge = false;  ///< corners at, at + 1 become `point`; else corner `at` goes
  Vec2 point{0};
};

Change change_at(const Ring& r, std::size_t i) {
  const std::size_t n = r.size();
  const Vec2& a = r[(i + n - 1) % n];
  const Vec2& b = r[i];
  const Vec2& c = r[(i + 1) % n];
  const Vec2& d = r[(i + 2) % n];
  Change change;
  change.at = i;
  const double ear = cross(b - a, c - b);
  if (ear >= 0) {
    // The ear abc belongs to the region: without b it does not.
    change.cost = ear / 2;
    return change;
  }
  if (cross(c - b, d - c) >= 0) return change;
  // Both reflex: the triangle between bc and the extensions of ab and dc belongs to the region.
  const Vec2 u = b - a;
  const Vec2 w = c - d;
  const double turn = cross(u, w);
  if (!(turn > 0)) return change;  // they turn by half a circle or more
  const double s = cross(c - b, w) / turn;
  if (!(s > 0)) return change;
  change.merge = true;
  change.point = b + u * s;
  change.cost = std::abs(cross(c - b, change.point - b)) / 2;
  return change;
}

}  // namespace

std::vector<Polygon> simplify_inwards(const Polygon& polygon, const SimplifyOptions& options) {
  const double whole = area(polygon);
  double budget = whole * options.share;
  std::vector<Ring> rings;
  for (Ring ring : polygon.rings) {
    while (ring.size() > 3) {
      Change best;
      for (std::size_t i = 0; i < ring.size(); ++i)
        if (const Change c = change_at(ring, i); c.cost < best.cost) best = c;
      if (best.cost > std::min(budget, whole * options.share_per_corner)) break;
      budget -= best.cost;
      if (best.merge) ring[(best.at + 1) % ring.size()] = best.point;
      ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(best.at));
    }
    rings.push_back(std::move(ring));
  }
  // Only what is wound round once more often by outer rings than by holes: where a cut crossed
  // another part of the outline, that is less than before.
  return unite(rings, Fill::kPositive);
}

}  // namespace ivis
