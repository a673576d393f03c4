#include "occluders/inset.h"

#include <cmath>
#include <cstddef>
#include <vector>

#include "occluders/clip.h"

namespace ivis {
namespace {

constexpr std::size_t kMostCorners = 128;
constexpr double kLeastSine = 1e-3;  ///< of the turn at a corner, for its mitre to be computed
constexpr double kLongestMitre = 2;  ///< times the distance, at reflex corners

double cross(const Vec2& a, const Vec2& b) {
  return a.x * b.y - a.y * b.x;
}

double signed_area(const Ring& ring) {
  double twice = 0;
  for (std::size_t i = 0; i < ring.size(); ++i)
    twice += cross(ring[i] - ring[0], ring[(i + 1) % ring.size()] - ring[0]);
  return twice / 2;
}

/// An edge and its moved line {p : n·p = c}, the inside where n·p is more.
struct Line {
  Vec2 a, b;
  Vec2 d;  ///< along, unit length
  Vec2 n;
  double c;
};

/// Where two consecutive lines meet.
std::optional<Vec2> corner(const Line& e, const Line& f, double distance) {
  const double turn = cross(e.d, f.d);
  if (std::abs(turn) < kLeastSine) {
    if (glm::dot(e.d, f.d) < 0 || e.b != f.a) return std::nullopt;
    // Next to straight: the farther of the two moved ends lies inside both lines, to second order.
    return f.a + (e.n + f.n) * (0.5 * distance * (1 + turn * turn));
  }
  const Vec2 p = (f.d * e.c - e.d * f.c) / turn;
  if (turn < 0 && e.b == f.a && glm::length(p - f.a) > kLongestMitre * distance)
    return std::nullopt;
  return p;
}

/// Empty where nothing is left of a convex ring.
std::optional<Ring> inset_ring(const Ring& ring, double distance) {
  std::vector<Line> lines;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Vec2& a = ring[i];
    const Vec2& b = ring[(i + 1) % ring.size()];
    if (a == b) continue;
    const Vec2 d = (b - a) / glm::length(b - a);
    const Vec2 n{-d.y, d.x};
    // From the ring's first corner, so that products stay small.
    lines.push_back({a - ring[0], b - ring[0], d, n, glm::dot(n, a - ring[0]) + distance});
  }
  bool convex = true;
  for (std::size_t i = 0; i < lines.size(); ++i)
    convex = convex && cross(lines[i].d, lines[(i + 1) % lines.size()].d) >= 0;
  while (lines.size() >= 3) {
    const std::size_t count = lines.size();
    Ring moved(count);  // moved[i]: between lines i - 1 and i
    for (std::size_t i = 0; i < count; ++i) {
      const auto p = corner(lines[(i + count - 1) % count], lines[i], distance);
      if (!p) {
        // Of a convex outline two sides that face each other are left, too near: nothing between.
        const bool facing = glm::dot(lines[(i + count - 1) % count].d, lines[i].d) < 0;
        return convex && facing && count < ring.size() ? std::optional<Ring>(Ring{}) : std::nullopt;
      }
      moved[i] = *p;
    }
    // The edge that turned round by most goes, and its neighbours meet.
    double most = 0;
    std::size_t gone = count;
    for (std::size_t i = 0; i < count; ++i) {
      const double left = glm::dot(moved[(i + 1) % count] - moved[i], lines[i].d);
      if (left <= most) {
        most = left;
        gone = i;
      }
    }
    if (gone == count) {
      for (Vec2& p : moved)
        p = snap(p + ring[0]);
      return moved;
    }
    lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(gone));
  }
  return convex ? std::optional<Ring>(Ring{}) : std::nullopt;
}

bool cross_or_touch(const Vec2& a, const Vec2& b, const Vec2& c, const Vec2& d) {
  const auto side = [](double v) { return (v > 0) - (v < 0); };
  if (std::max(a.x, b.x) < std::min(c.x, d.x) || std::max(c.x, d.x) < std::min(a.x, b.x) ||
      std::max(a.y, b.y) < std::min(c.y, d.y) || std::max(c.y, d.y) < std::min(a.y, b.y))
    return false;
  return side(cross(b - a, c - a)) * side(cross(b - a, d - a)) <= 0 &&
         side(cross(d - c, a - c)) * side(cross(d - c, b - c)) <= 0;
}

/// Do two edges meet that do not follow each other?
bool crosses_itself(const std::vector<Ring>& rings) {
  struct Edge {
    Vec2 a, b;
    std::size_t next;
  };
  std::vector<Edge> edges;
  for (const Ring& r : rings) {
    const std::size_t first = edges.size();
    for (std::size_t i = 0; i < r.size(); ++i)
      edges.push_back({r[i], r[(i + 1) % r.size()], first + (i + 1) % r.size()});
  }
  for (std::size_t i = 0; i < edges.size(); ++i)
    for (std::size_t k = i + 1; k < edges.size(); ++k)
      if (edges[i].next != k && edges[k].next != i &&
          cross_or_touch(edges[i].a, edges[i].b, edges[k].a, edges[k].b))
        return true;
  return false;
}

}  // namespace

std::optional<Polygon> inset(const Polygon& polygon, double distance_m) {
  std::size_t corners = 0;
  for (const Ring& ring : polygon.rings)
    corners += ring.size();
  if (corners > kMostCorners) return std::nullopt;
  Polygon out;
  for (const Ring& ring : polygon.rings) {
    if (ring.size() < 3) return std::nullopt;
    auto moved = inset_ring(ring, distance_m + kGridSlackM);
    if (moved && moved->empty() && polygon.rings.size() == 1) return Polygon{};
    if (!moved || (signed_area(*moved) > 0) != (signed_area(ring) > 0)) return std::nullopt;
    out.rings.push_back(std::move(*moved));
  }
  if (crosses_itself(out.rings)) return std::nullopt;
  return out;
}

}  // namespace ivis
