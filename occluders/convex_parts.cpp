#include "occluders/convex_parts.h"

#include <algorithm>

namespace ivis {
namespace {

/// The sweep is quadratic at worst; an outline of a building has tens.
constexpr std::size_t kMostEdges = 20000;

struct Edge {
  Vec2 low, high;  ///< low.y < high.y
  double x_at(double y) const {
    if (y == low.y) return low.x;
    if (y == high.y) return high.x;
    return low.x + (y - low.y) / (high.y - low.y) * (high.x - low.x);
  }
};

/// Region between two edges, open at the top until one of them ends.
struct Open {
  const Edge* left;
  const Edge* right;
  double from;
};

}  // namespace

// A sweep over the corners' y. Between two of them no edges cross (rings do not), so the edges
// there, ordered by x, pair up even-odd; a pair that goes on past a corner stays one trapezoid.
std::vector<std::array<Vec2, 4>> convex_parts(const Polygon& polygon) {
  std::vector<Edge> edges;
  std::vector<double> levels;
  for (const auto& ring : polygon.rings)
    for (std::size_t i = 0, n = ring.size(); i < n; ++i) {
      Vec2 a = ring[i];
      Vec2 b = ring[(i + 1) % n];
      levels.push_back(a.y);
      if (a.y == b.y) continue;
      if (a.y > b.y) std::swap(a, b);
      edges.push_back({a, b});
    }
  if (edges.size() > kMostEdges) return {};
  std::sort(levels.begin(), levels.end());
  levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
  std::sort(edges.begin(), edges.end(),
            [](const Edge& a, const Edge& b) { return a.low.y < b.low.y; });

  std::vector<std::array<Vec2, 4>> parts;
  const auto close = [&](const Open& o, double to) {
    const Vec2 a{o.left->x_at(o.from), o.from};
    const Vec2 b{o.right->x_at(o.from), o.from};
    const Vec2 c{o.right->x_at(to), to};
    const Vec2 d{o.left->x_at(to), to};
    if (b.x <= a.x && c.x <= d.x) return;
    if (b.x <= a.x) {
      parts.push_back({a, c, d, d});
    } else if (c.x <= d.x) {
      parts.push_back({a, b, c, c});
    } else {
      parts.push_back({a, b, c, d});
    }
  };
  std::vector<Open> open;
  std::vector<const Edge*> active;
  std::size_t next = 0;
  for (std::size_t l = 0; l + 1 < levels.size(); ++l) {
    const double from = levels[l];
    const double middle = 0.5 * (from + levels[l + 1]);
    std::erase_if(active, [&](const Edge* e) { return e->high.y <= from; });
    for (; next < edges.size() && edges[next].low.y <= from; ++next)
      active.push_back(&edges[next]);
    std::sort(active.begin(), active.end(),
              [&](const Edge* a, const Edge* b) { return a->x_at(middle) < b->x_at(middle); });
    std::vector<Open> now;
    for (std::size_t i = 0; i + 1 < active.size(); i += 2) {
      const auto same = std::find_if(open.begin(), open.end(), [&](const Open& o) {
        return o.left == active[i] && o.right == active[i + 1];
      });
      now.push_back(same != open.end() ? *same : Open{active[i], active[i + 1], from});
    }
    for (const Open& o : open)
      if (std::none_of(now.begin(), now.end(),
                       [&](const Open& n) { return n.left == o.left && n.right == o.right; }))
        close(o, from);
    open = std::move(now);
    // Rings that do not cross give a few parts a corner; no parts at all are safe.
    if (parts.size() > 4 * edges.size() + 16) return {};
  }
  for (const Open& o : open)
    close(o, levels.back());
  return parts;
}

FaceMesh mesh_of(const Prism& prism) {
  FaceMesh mesh;
  if (prism.top <= prism.bottom) return mesh;
  const auto corner = [&](const Vec2& p, double y) {
    mesh.points.emplace_back(p.x, y, p.y);
    return static_cast<std::uint32_t>(mesh.points.size() - 1);
  };
  // With x to the right and z up the page the interior is on the left; y then points into the page,
  // so that outside a wall is walked bottom first.
  for (const auto& ring : prism.footprint.rings) {
    const auto n = static_cast<std::uint32_t>(ring.size());
    const auto base = static_cast<std::uint32_t>(mesh.points.size());
    for (const Vec2& p : ring) {
      corner(p, prism.bottom);
      corner(p, prism.top);
    }
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = base + 2 * i;
      const std::uint32_t b = base + 2 * ((i + 1) % n);
      mesh.faces.push_back({a, a + 1, b + 1, b});
    }
  }
  for (const auto& part : convex_parts(prism.footprint)) {
    std::array<std::uint32_t, 4> roof{};
    std::array<std::uint32_t, 4> floor{};
    for (std::size_t k = 0; k < 4; ++k) {
      roof[3 - k] = corner(part[k], prism.top);
      floor[k] = corner(part[k], prism.bottom);
    }
    if (part[2] == part[3]) roof = {roof[1], roof[2], roof[3], roof[3]};
    mesh.faces.push_back(roof);
    mesh.faces.push_back(floor);
  }
  return mesh;
}

}  // namespace ivis
