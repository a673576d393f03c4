#include "occluders/fast_erosion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/assert.h"
#include "occluders/clip.h"
#include "occluders/distance_check.h"

namespace ivis {
namespace {

double cross(const Vec2& a, const Vec2& b) {
  return a.x * b.y - a.y * b.x;
}

/// V's shadow on the ground plane: an ellipse with semi-axes e, or the rectangle of half-sides e.
struct Shadow {
  Vec2 e;
  bool box;
};

/// The points of an ellipse where the outward normal is n; of a box the corner or the side.
std::vector<Vec2> extreme(const Shadow& v, const Vec2& n) {
  if (!v.box) return {v.e * v.e * n / glm::length(v.e * n)};
  std::vector<Vec2> corners;
  const double h = v.e.x * std::abs(n.x) + v.e.y * std::abs(n.y);
  for (const Vec2& c : {v.e, Vec2{-v.e.x, v.e.y}, -v.e, Vec2{v.e.x, -v.e.y}})
    if (glm::dot(c, n) >= h * (1 - 1e-9)) corners.push_back(c);
  return corners;
}

/// What a wall from a to b (interior on its left) takes away.
Ring strip(const Vec2& a, const Vec2& b, const Shadow& v) {
  const Vec2 d = (b - a) / glm::length(b - a);
  const Vec2 n{-d.y, d.x};
  const Vec2 along = d * kGridSlackM;
  const Vec2 out = n * -kGridSlackM;
  std::vector<Vec2> points{a - along, b + along, a - along + out, b + along + out};
  for (const Vec2& c : extreme(v, n)) {
    points.push_back(a - along + c);
    points.push_back(b + along + c);
  }
  return convex_hull(std::move(points));
}

/// What a reflex corner between walls of inward normals n and m takes away: the part of corner + V
/// between these directions, its arc replaced by tangents, the first and last along the walls'
/// strips.
Ring fan(const Vec2& corner, const Vec2& n, const Vec2& m, const Shadow& v, int k) {
  std::vector<Vec2> points{corner, corner - (n + m) * kGridSlackM};
  if (v.box) {
    for (const Vec2& c : {v.e, Vec2{-v.e.x, v.e.y}, -v.e, Vec2{v.e.x, -v.e.y}})
      points.push_back(corner + c);
    return convex_hull(std::move(points));
  }
  // On the circle that the ellipse is an image of, the normal n is at the angle of e n.
  const Vec2 from = v.e * n;
  const Vec2 to = v.e * m;
  const double start = std::atan2(from.y, from.x);
  double turn = std::atan2(cross(from, to), glm::dot(from, to));
  if (turn > 0) turn = -turn;  // a hairpin: exactly about
  const int sides =
      std::max(1, static_cast<int>(std::ceil(-turn * k / (2 * std::numbers::pi) - 1e-9)));
  const double step = turn / sides;
  const double r = 1 / std::cos(step / 2);
  points.push_back(corner + v.e * Vec2{std::cos(start), std::sin(start)});
  for (int i = 0; i < sides; ++i) {
    const double angle = start + step * (i + 0.5);
    points.push_back(corner + v.e * Vec2{std::cos(angle), std::sin(angle)} * r);
  }
  points.push_back(corner + v.e * Vec2{std::cos(start + turn), std::sin(start + turn)});
  return convex_hull(std::move(points));
}

/// corner + V whole, for outlines that do not tell which side is inside.
Ring around(const Vec2& corner, const Reach& reach, int k) {
  std::vector<Vec2> ring = reach.circumscribed_polygon(k);
  for (Vec2& p : ring)
    p += corner;
  return ring;
}

}  // namespace

FastEroder::FastEroder(int k) : k_(k) {
  IVIS_ASSERT(k >= 4, "a polygon around an ellipse needs at least four sides");
}

// E(P, V) = P \ (boundary of P + -V), as V is connected and contains 0; V is symmetric, -V = V. Of
// that boundary band only the part inside P counts. Let x in P have x + V meet the boundary, and s
// V be the smallest multiple that does. Where x + s V first touches a wall's inside, its inward
// normal is V's: x lies on the wall + the segment from 0 to V's extreme point there, in the strip.
// It cannot first touch at a convex corner only: both walls would have to keep clear of a convex
// set that has the corner on its border and lies between them. At a reflex corner x lies in the
// corner + V between the walls' normals, in the fan. Strips and fans are grown by what rounding to
// the grid may take from them.
// Where an outline crosses or touches itself, by rounding or as given, "inside" is not on the left
// of every wall, and a corner that looks convex may not be. The distance check finds such a result,
// and whole capsules, which need no sides, take its place.
std::vector<Polygon> FastEroder::erode(const Polygon& polygon, const Reach& reach) const {
  const std::vector<Ring> taken = taken_by(polygon, reach, false);
  if (taken.empty()) return {};  // no ring has three corners
  std::vector<Polygon> result = subtract(polygon.rings, Fill::kEvenOdd, taken);
  const bool good = std::all_of(result.begin(), result.end(), [&](const Polygon& p) {
    return within_erosion(p, polygon, reach);
  });
  if (good) return result;
  return subtract(polygon.rings, Fill::kEvenOdd, taken_by(polygon, reach, true));
}

std::vector<std::vector<Vec2>> FastEroder::taken_by(const Polygon& polygon, const Reach& reach,
                                                    bool both_sides) const {
  const Reach grown = reach.grown(kGridSlackM, 0);
  const Vec3& half = grown.half_extents();
  const Shadow v{{half.x, half.z}, grown.horizontal_is_box()};
  std::vector<Ring> taken;
  for (const Ring& given : polygon.rings) {
    Ring ring;
    for (const Vec2& p : given)
      if (ring.empty() || p != ring.back()) ring.push_back(p);
    while (ring.size() > 1 && ring.front() == ring.back())
      ring.pop_back();
    const std::size_t n = ring.size();
    if (n < 3) continue;
    for (std::size_t i = 0; i < n; ++i) {
      const Vec2& a = ring[i];
      const Vec2& b = ring[(i + 1) % n];
      const Vec2& c = ring[(i + 2) % n];
      taken.push_back(strip(a, b, v));
      if (both_sides) {
        taken.push_back(strip(b, a, v));
        taken.push_back(around(b, grown, k_));
        continue;
      }
      const Vec2 d = (b - a) / glm::length(b - a);
      const Vec2 e = (c - b) / glm::length(c - b);
      if (cross(d, e) <= 1e-12) taken.push_back(fan(b, {-d.y, d.x}, {-e.y, e.x}, v, k_));
    }
  }
  std::erase_if(taken, [](const Ring& r) { return r.empty(); });
  return taken;
}

}  // namespace ivis
