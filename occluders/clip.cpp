#include "occluders/clip.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <polyclipping/clipper.hpp>

namespace ivis {
namespace {

namespace cl = ClipperLib;

// Relative to a local origin on the grid: products of coordinates below 2^30 steps (1 km) stay
// within 64 bits, which the library is several times faster with.
class Frame {
 public:
  explicit Frame(const std::vector<Ring>& rings) {
    Aabb box;
    for (const Ring& ring : rings)
      for (const Vec2& p : ring)
        box.add(Vec3{p.x, 0, p.y});
    if (box.empty()) return;
    const Vec3 magnitude = glm::max(glm::abs(box.lo), glm::abs(box.hi));
    ok_ = std::max(magnitude.x, magnitude.z) <= kMaxCoordinateM;
    if (!ok_) return;
    const Vec3 c = box.centre();
    x_ = std::llround(c.x / kGridM);
    y_ = std::llround(c.z / kGridM);
  }
  bool ok() const { return ok_; }
  cl::Path to(const Ring& ring) const {
    cl::Path path;
    path.reserve(ring.size());
    for (const Vec2& p : ring)
      path.emplace_back(std::llround(p.x / kGridM) - x_, std::llround(p.y / kGridM) - y_);
    return path;
  }
  Ring from(const cl::Path& path) const {
    Ring ring;
    ring.reserve(path.size());
    for (const cl::IntPoint& p : path)
      ring.emplace_back(static_cast<double>(p.X + x_) * kGridM,
                        static_cast<double>(p.Y + y_) * kGridM);
    return ring;
  }

 private:
  cl::cInt x_ = 0;
  cl::cInt y_ = 0;
  bool ok_ = false;
};

cl::PolyFillType fill_type(Fill fill) {
  switch (fill) {
    case Fill::kEvenOdd:
      return cl::pftEvenOdd;
    case Fill::kNonZero:
      return cl::pftNonZero;
    case Fill::kPositive:
      return cl::pftPositive;
  }
  return cl::pftEvenOdd;
}

void collect(const cl::PolyNode& parent, const Frame& frame, std::vector<Polygon>& out) {
  for (const cl::PolyNode* outer : parent.Childs) {
    Polygon polygon;
    const auto add = [&](const cl::Path& path, bool hole) {
      Ring ring = frame.from(path);
      const double a = area(Polygon{{ring}});
      if (a == 0) return;
      if ((a < 0) != hole) std::reverse(ring.begin(), ring.end());
      polygon.rings.push_back(std::move(ring));
    };
    add(outer->Contour, false);
    const bool solid = !polygon.empty();
    for (const cl::PolyNode* hole : outer->Childs) {
      if (solid) add(hole->Contour, true);
      collect(*hole, frame, out);
    }
    if (solid) out.push_back(std::move(polygon));
  }
}

/// Nothing when the library refuses.
std::optional<std::vector<Polygon>> try_execute(cl::ClipType operation,
                                                const std::vector<Ring>& subject, Fill fill,
                                                const std::vector<Ring>& convex) {
  std::vector<Polygon> result;
  const Frame frame(subject);
  if (!frame.ok()) return {};
  try {
    cl::Clipper clipper;
    for (const Ring& ring : subject)
      clipper.AddPath(frame.to(ring), cl::ptSubject, true);
    for (const Ring& ring : convex) {
      cl::Path path = frame.to(ring);
      // All of one winding: under the non-zero rule two opposite ones would cancel where they
      // overlap.
      const double a = cl::Area(path);
      if (a == 0) continue;
      if (a < 0) cl::ReversePath(path);
      clipper.AddPath(path, cl::ptClip, true);
    }
    cl::PolyTree tree;
    if (!clipper.Execute(operation, tree, fill_type(fill), cl::pftNonZero)) return {};
    collect(tree, frame, result);
  } catch (const std::exception&) {  // out of the library's range
    return {};
  }
  return result;
}

/// For occluders: no region is always safe.
std::vector<Polygon> execute(cl::ClipType operation, const std::vector<Ring>& subject, Fill fill,
                             const std::vector<Ring>& convex) {
  return try_execute(operation, subject, fill, convex).value_or(std::vector<Polygon>{});
}

}  // namespace

std::vector<Polygon> unite(const std::vector<Ring>& rings, Fill fill) {
  return execute(cl::ctUnion, rings, fill, {});
}

std::vector<Polygon> subtract(const std::vector<Ring>& subject, Fill fill,
                              const std::vector<Ring>& convex) {
  return execute(convex.empty() ? cl::ctUnion : cl::ctDifference, subject, fill, convex);
}

std::vector<Polygon> intersect(const std::vector<Ring>& subject, Fill fill, const Ring& convex) {
  return execute(cl::ctIntersection, subject, fill, {convex});
}

bool covered(const Ring& ring, const std::vector<Ring>& convex) {
  Ring on_grid = ring;
  for (Vec2& p : on_grid)
    p = snap(p);
  if (convex.empty() || !(std::abs(area(Polygon{{on_grid}})) > 0)) return false;
  const auto left = try_execute(cl::ctDifference, {ring}, Fill::kNonZero, convex);
  return left && left->empty();
}

Ring convex_hull(std::vector<Vec2> points) {
  std::sort(points.begin(), points.end(),
            [](const Vec2& a, const Vec2& b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return {};
  Ring hull(2 * points.size());
  std::size_t n = 0;
  const auto turns_right = [&](const Vec2& p) {
    const Vec2 a = hull[n - 1] - hull[n - 2];
    const Vec2 b = p - hull[n - 2];
    return a.x * b.y - a.y * b.x <= 0;
  };
  for (const Vec2& p : points) {
    while (n >= 2 && turns_right(p))
      --n;
    hull[n++] = p;
  }
  const std::size_t lower = n + 1;
  for (std::size_t i = points.size() - 1; i-- > 0;) {
    while (n >= lower && turns_right(points[i]))
      --n;
    hull[n++] = points[i];
  }
  hull.resize(n - 1);
  return hull.size() < 3 ? Ring{} : hull;
}

std::vector<Ring> rings_of(const std::vector<Polygon>& polygons) {
  std::vector<Ring> rings;
  for (const Polygon& p : polygons)
    rings.insert(rings.end(), p.rings.begin(), p.rings.end());
  return rings;
}

double area(const std::vector<Polygon>& polygons) {
  double sum = 0;
  for (const Polygon& p : polygons)
    sum += area(p);
  return sum;
}

}  // namespace ivis
