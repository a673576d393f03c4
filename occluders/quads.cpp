#include "occluders/quads.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>

#include "occluders/clip.h"

namespace ivis {
namespace {

struct IntPoint {
  std::int64_t x, y;
  bool operator==(const IntPoint&) const = default;
};
using IntRing = std::vector<IntPoint>;
constexpr std::int64_t kMaxExtent = std::int64_t{1} << 29;  // products of differences stay exact

std::int64_t cross(const IntPoint& o, const IntPoint& a, const IntPoint& b) {
  return (a.x - o.x) * (b.y - o.y) - (a.y - o.y) * (b.x - o.x);
}

bool in_triangle(const IntPoint& p, const IntPoint& a, const IntPoint& b, const IntPoint& c) {
  return cross(a, b, p) >= 0 && cross(b, c, p) >= 0 && cross(c, a, p) >= 0;
}

/// Index in `ring` of a corner that sees `m`, a hole's rightmost corner: the ray from m along +x
/// meets an edge; the edge's right end sees m, or of the corners between, the one nearest to the
/// ray by angle does.
std::size_t bridge(const IntRing& ring, const IntPoint& m) {
  const std::size_t n = ring.size();
  std::size_t best = n;
  double best_x = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const IntPoint& a = ring[i];
    const IntPoint& b = ring[(i + 1) % n];
    if (!(a.y <= m.y && b.y >= m.y) || a.y == b.y) continue;  // climbing: m is on its left
    const double x = static_cast<double>(a.x) + static_cast<double>(b.x - a.x) *
                                                    static_cast<double>(m.y - a.y) /
                                                    static_cast<double>(b.y - a.y);
    if (x < static_cast<double>(m.x)) continue;
    if (best == n || x < best_x) {
      best_x = x;
      best = a.x > b.x ? i : (i + 1) % n;
    }
  }
  if (best == n) return n;
  const IntPoint end = ring[best];
  const IntPoint hit{static_cast<std::int64_t>(std::llround(best_x)), m.y};
  if (end == hit) return best;
  double least = std::numeric_limits<double>::infinity();
  std::size_t result = best;
  for (std::size_t i = 0; i < n; ++i) {
    const IntPoint& p = ring[i];
    const bool inside = end.y > m.y ? in_triangle(p, m, hit, end) : in_triangle(p, m, end, hit);
    if (!inside || p.x < m.x) continue;
    // Of corners at one place only the one whose inside the bridge leaves through is right.
    const IntPoint& before = ring[(i + n - 1) % n];
    const IntPoint& after = ring[(i + 1) % n];
    const bool convex = cross(before, p, after) > 0;
    const bool left_of_in = cross(before, p, m) >= 0;
    const bool left_of_out = cross(p, after, m) >= 0;
    if (convex ? !(left_of_in && left_of_out) : !(left_of_in || left_of_out)) continue;
    const double dx = static_cast<double>(p.x - m.x);
    const double dy = std::abs(static_cast<double>(p.y - m.y));
    const double slope = dx > 0 ? dy / dx : (dy > 0 ? 1e300 : 0);
    if (slope < least || (slope == least && p.x < ring[result].x)) {
      least = slope;
      result = i;
    }
  }
  return result;
}

using Corner = std::array<std::size_t, 3>;

/// Ear clipping; what is left when no ear is found is given up.
std::vector<Corner> triangles_of(const IntRing& ring) {
  std::vector<Corner> out;
  std::vector<std::size_t> left(ring.size());
  for (std::size_t i = 0; i < left.size(); ++i)
    left[i] = i;
  const auto usable = [&](std::size_t i) {
    const std::size_t n = left.size();
    const IntPoint& a = ring[left[(i + n - 1) % n]];
    const IntPoint& b = ring[left[i]];
    const IntPoint& c = ring[left[(i + 1) % n]];
    if (cross(a, b, c) <= 0) return false;
    for (std::size_t k = 2; k + 1 < n; ++k) {
      const std::size_t j = (i + k) % n;
      const IntPoint& p = ring[left[j]];
      if (p == a || p == b || p == c) continue;
      if (in_triangle(p, a, b, c)) return false;
    }
    return true;
  };
  std::size_t start = 0;
  while (left.size() >= 3) {
    const std::size_t n = left.size();
    bool cut = false;
    for (std::size_t k = 0; k < n && !cut; ++k) {
      const std::size_t i = (start + k) % n;
      const std::size_t a = left[(i + n - 1) % n];
      const std::size_t c = left[(i + 1) % n];
      // Corners on a line and spikes carry no area.
      const bool flat = cross(ring[a], ring[left[i]], ring[c]) == 0;
      if (!flat && !usable(i)) continue;
      if (!flat) out.push_back({a, left[i], c});
      left.erase(left.begin() + static_cast<std::ptrdiff_t>(i));
      // Going on at the next corner but one keeps triangles from becoming a fan of slivers.
      start = i + 1 < left.size() ? i + 1 : 0;
      cut = true;
    }
    if (!cut) break;
  }
  return out;
}

}  // namespace

std::vector<Quad> quads_of(const Polygon& polygon) {
  if (polygon.empty()) return {};
  const Vec2 origin = snap(polygon.rings[0][0]);
  std::vector<IntRing> rings;
  for (const auto& given : polygon.rings) {
    IntRing ring;
    for (const Vec2& p : given) {
      const IntPoint q{std::llround((p.x - origin.x) / kGridM),
                       std::llround((p.y - origin.y) / kGridM)};
      if (std::abs(q.x) > kMaxExtent || std::abs(q.y) > kMaxExtent) return {};
      if (ring.empty() || !(q == ring.back())) ring.push_back(q);
    }
    while (ring.size() > 1 && ring.front() == ring.back())
      ring.pop_back();
    if (ring.size() >= 3) rings.push_back(std::move(ring));
  }
  if (rings.empty()) return {};
  for (IntRing& ring : rings) {
    const auto right = std::max_element(ring.begin(), ring.end(), [](const auto& a, const auto& b) {
      return a.x != b.x ? a.x < b.x : a.y < b.y;
    });
    if (&ring != &rings[0]) std::rotate(ring.begin(), right, ring.end());
  }
  std::sort(rings.begin() + 1, rings.end(), [](const IntRing& a, const IntRing& b) {
    return a[0].x != b[0].x ? a[0].x > b[0].x : a[0].y < b[0].y;
  });
  IntRing ring = rings[0];
  for (std::size_t h = 1; h < rings.size(); ++h) {
    const std::size_t at = bridge(ring, rings[h][0]);
    if (at == ring.size()) return {};
    IntRing merged(ring.begin(), ring.begin() + static_cast<std::ptrdiff_t>(at) + 1);
    merged.insert(merged.end(), rings[h].begin(), rings[h].end());
    merged.push_back(rings[h][0]);
    merged.insert(merged.end(), ring.begin() + static_cast<std::ptrdiff_t>(at), ring.end());
    ring = std::move(merged);
  }
  const std::vector<Corner> triangles = triangles_of(ring);

  // Longest shared sides first: what they part makes the best quadrangles.
  struct Side {
    std::int64_t length2;
    std::size_t triangle;
    std::size_t k;
  };
  std::map<std::pair<std::size_t, std::size_t>, Side> open;
  struct Pair {
    std::int64_t length2;
    Side first, second;
  };
  std::vector<Pair> pairs;
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t a = triangles[t][k];
      const std::size_t b = triangles[t][(k + 1) % 3];
      const std::int64_t dx = ring[a].x - ring[b].x;
      const std::int64_t dy = ring[a].y - ring[b].y;
      const Side side{dx * dx + dy * dy, t, k};
      if (const auto it = open.find({b, a}); it != open.end())
        pairs.push_back({side.length2, it->second, side});
      else
        open.try_emplace({a, b}, side);
    }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.length2 > b.length2; });
  std::vector<bool> done(triangles.size(), false);
  std::vector<Quad> out;
  const auto place = [&](std::size_t i) {
    return origin + Vec2{static_cast<double>(ring[i].x), static_cast<double>(ring[i].y)} * kGridM;
  };
  for (const Pair& p : pairs) {
    if (done[p.first.triangle] || done[p.second.triangle]) continue;
    const Corner& s = triangles[p.first.triangle];
    const std::size_t a = s[p.first.k];
    const std::size_t b = s[(p.first.k + 1) % 3];
    const std::size_t c = s[(p.first.k + 2) % 3];
    const std::size_t d = triangles[p.second.triangle][(p.second.k + 2) % 3];
    // a d b c: strictly convex at a and b, where the triangles meet.
    if (cross(ring[c], ring[a], ring[d]) <= 0 || cross(ring[d], ring[b], ring[c]) <= 0) continue;
    done[p.first.triangle] = done[p.second.triangle] = true;
    out.push_back({place(a), place(d), place(b), place(c)});
  }
  for (std::size_t t = 0; t < triangles.size(); ++t)
    if (!done[t]) {
      const Vec2 c = place(triangles[t][2]);
      out.push_back({place(triangles[t][0]), place(triangles[t][1]), c, c});
    }
  return out;
}

}  // namespace ivis
