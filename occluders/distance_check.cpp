#include "occluders/distance_check.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "occluders/rect_tree.h"

namespace ivis {
namespace {

// An axis on which the reach has no extent is treated as if it had this much, metres: a larger
// reach.
constexpr double kLeastExtentM = 1e-7;
constexpr double kRounding = 0x1p-53;

/// Edge in coordinates in which the reach is the unit disc or the unit square.
struct Edge {
  Vec2 a, b;
};

Box2 box_of(const Edge& e) {
  Box2 box;
  box.add(e.a);
  box.add(e.b);
  return box;
}

class EdgeTree {
 public:
  explicit EdgeTree(std::vector<Edge> edges) : edges_(std::move(edges)) {
    std::vector<Box2> boxes;
    boxes.reserve(edges_.size());
    for (const Edge& e : edges_)
      boxes.push_back(box_of(e));
    tree_ = RectTree(boxes);
  }
  const std::vector<Edge>& edges() const { return edges_; }
  /// Does `accept` hold for every edge that may meet `box`?
  template <class F>
  bool all(const Box2& box, const F& accept) const {
    return tree_.all(box, [&](std::uint32_t i) { return accept(edges_[i]); });
  }

 private:
  std::vector<Edge> edges_;
  RectTree tree_;
};

/// Even-odd, by crossings to the right. Right for points well away from the edges.
bool contains(const EdgeTree& tree, const Vec2& p) {
  bool inside = false;
  const Box2 ray{p, {std::numeric_limits<double>::infinity(), p.y}};
  tree.all(ray, [&](const Edge& e) {
    if ((e.a.y > p.y) != (e.b.y > p.y) &&
        p.x < e.a.x + (p.y - e.a.y) / (e.b.y - e.a.y) * (e.b.x - e.a.x))
      inside = !inside;
    return true;
  });
  return inside;
}

// The differences of the points of two edges fill a parallelogram; the edges keep the reach's
// distance when it misses the open unit disc (square). A line between the two is the proof: n·p >=
// h(n) at its four corners, h the support of disc or square. If there is one, there is one along a
// side of either convex set, or for the disc across the corner nearest to it; so no other n is
// tried.
class Separation {
 public:
  Separation(bool square, double slack) : square_(square), grown_(1 + slack) {}

  bool holds(const Edge& e, const Edge& f) const {
    const Vec2 p[4] = {e.a - f.a, e.a - f.b, e.b - f.a, e.b - f.b};
    if (square_) {
      if (across({1, 0}, p) || across({0, 1}, p)) return true;
    } else {
      const auto nearer = [](const Vec2& s, const Vec2& t) {
        return glm::dot(s, s) < glm::dot(t, t);
      };
      if (across(*std::min_element(p, p + 4, nearer), p)) return true;
    }
    const Vec2 d = e.b - e.a;
    const Vec2 g = f.b - f.a;
    return across({-d.y, d.x}, p) || across({-g.y, g.x}, p);
  }

 private:
  /// Does a line with normal n, on either side of the reach, separate? `slack` pays for rounding.
  bool across(const Vec2& n, std::span<const Vec2, 4> p) const {
    const double support = square_ ? std::abs(n.x) + std::abs(n.y) : std::sqrt(glm::dot(n, n));
    if (!(support > 1e-30)) return false;  // an edge without length has no normal
    double least = std::numeric_limits<double>::infinity();
    double most = -least;
    for (const Vec2& q : p) {
      const double along = glm::dot(n, q);
      least = std::min(least, along);
      most = std::max(most, along);
    }
    return least >= support * grown_ || -most >= support * grown_;
  }

  bool square_;
  double grown_;
};

std::vector<Edge> edges_of(const Polygon& polygon, const Vec2& origin, const Vec2& extent) {
  std::vector<Edge> edges;
  for (const auto& ring : polygon.rings)
    for (std::size_t i = 0; i < ring.size(); ++i)
      edges.push_back(
          {(ring[i] - origin) / extent, (ring[(i + 1) % ring.size()] - origin) / extent});
  return edges;
}

/// Largest coordinate; infinite if any is no number.
double magnitude(const std::vector<Edge>& edges) {
  double m = 0;
  for (const Edge& e : edges)
    for (const double v : {e.a.x, e.a.y}) {
      if (!std::isfinite(v)) return std::numeric_limits<double>::infinity();
      m = std::max(m, std::abs(v));
    }
  return m;
}

}  // namespace

// Let R be `eroded`, O `original`, U the open reach; distances in its norm. Checked:
// (b) no edge of R comes nearer than 1 to an edge of O; (a) a corner of every ring of R lies in O;
// (c) no ring of O has a corner in R.
// A point y of O's border in R, or nearer than 1 to a point x of R: if y is not in R, the segment
// xy leaves R through an edge of R nearer than 1 to y, against (b). If y is in R, so is, by (b),
// its whole ring of O, against (c). So R keeps the distance 1 from O's border; every piece of R
// hangs on a ring of R, which by (a) and (b) lies in O, so R does. Then x + U misses O's border for
// x in R, so it and its closure lie in O.
//
// Rounding: a scaled coordinate of size M is off by at most 3 M 2^-53 (subtract, divide), a corner
// of the parallelogram by at most 2 * sqrt(2) * (3 + 1) M 2^-53, and n·p by 4 * 2 M |n| 2^-53 more;
// `slack` doubles that, and another 16 units pay for the support. Corners used by (a) and (c) keep
// the distance 1 - slack from the edges, where rounding of the crossing cannot turn a parity.
bool within_erosion(const Polygon& eroded, const Polygon& original, const Reach& reach) {
  Box2 bounds;
  for (const auto& ring : original.rings)
    for (const Vec2& p : ring)
      bounds.add(p);
  const Vec3& half = reach.half_extents();
  const Vec2 extent = glm::max(Vec2{half.x, half.z}, Vec2{kLeastExtentM});
  const Vec2 origin = (bounds.lo + bounds.hi) * 0.5;

  std::vector<Edge> inner = edges_of(eroded, origin, extent);
  if (inner.empty()) return true;
  std::vector<Edge> outer = edges_of(original, origin, extent);
  if (outer.empty()) return false;
  const double slack = kRounding * (48 * std::max(magnitude(inner), magnitude(outer)) + 16);
  if (!(slack < 1e-3)) return false;

  const EdgeTree inner_tree(std::move(inner));
  const EdgeTree outer_tree(std::move(outer));
  const Separation apart(reach.horizontal_is_box(), slack);
  const Vec2 near{1 + 2 * slack};
  for (const Edge& e : inner_tree.edges()) {
    Box2 box = box_of(e);
    box.lo -= near;
    box.hi += near;
    if (!outer_tree.all(box, [&](const Edge& f) { return apart.holds(e, f); }))
      return false;  // (b)
  }
  const auto local = [&](const Vec2& p) { return (p - origin) / extent; };
  for (const auto& ring : eroded.rings)
    if (!ring.empty() && !contains(outer_tree, local(ring[0]))) return false;  // (a)
  for (const auto& ring : original.rings)
    if (!ring.empty() && contains(inner_tree, local(ring[0]))) return false;  // (c)
  return true;
}

}  // namespace ivis
