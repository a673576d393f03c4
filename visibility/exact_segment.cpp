#include "visibility/exact_segment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace ivis {
namespace {

// A triple product of differences is off by at most 9 roundings of its terms' absolute values: one
// a difference (3), two products, one sum within and two sums outside, and one to spare. 16 holds
// that and the rounding of the bound itself.
constexpr double kRounding = 16 * 0x1p-53;

double max_abs(const Vec3& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

/// Sum of the absolute values of the terms of cross(a, b), by component.
Vec3 cross_terms(const Vec3& a, const Vec3& b) {
  return {std::abs(a.y * b.z) + std::abs(a.z * b.y), std::abs(a.z * b.x) + std::abs(a.x * b.z),
          std::abs(a.x * b.y) + std::abs(a.y * b.x)};
}

/// Sign of d . (a x b), 0 when rounding could have made it.
int side(const Vec3& d, const Vec3& a, const Vec3& b) {
  const double value = glm::dot(d, glm::cross(a, b));
  const double bound = kRounding * glm::dot(glm::abs(d), cross_terms(a, b));
  return value > bound ? 1 : value < -bound ? -1 : 0;
}

/// Squared distance between the segments p + s u and r + t v, s and t in [0, 1].
double distance2(const Vec3& p, const Vec3& u, const Vec3& r, const Vec3& v) {
  const double uu = glm::dot(u, u);
  const double vv = glm::dot(v, v);
  const auto to_point = [](const Vec3& x, const Vec3& o, const Vec3& d, double dd) {
    const double t = dd > 0 ? std::clamp(glm::dot(x - o, d) / dd, 0.0, 1.0) : 0.0;
    const Vec3 e = x - (o + t * d);
    return glm::dot(e, e);
  };
  // The least is at an end of one of them, or where both are interior.
  double least = std::min({to_point(p, r, v, vv), to_point(p + u, r, v, vv), to_point(r, p, u, uu),
                           to_point(r + v, p, u, uu)});
  const double uv = glm::dot(u, v);
  const double det = uu * vv - uv * uv;
  if (det > 0) {
    const Vec3 w = p - r;
    const double s = (uv * glm::dot(v, w) - vv * glm::dot(u, w)) / det;
    const double t = (uu * glm::dot(v, w) - uv * glm::dot(u, w)) / det;
    if (s >= 0 && s <= 1 && t >= 0 && t <= 1) {
      const Vec3 e = w + s * u - t * v;
      least = std::min(least, glm::dot(e, e));
    }
  }
  return least;
}

/// The segment lies in the triangle's plane (or the triangle has no area): does it meet it?
bool meets_in_plane(const Triangle& t, const Vec3& n, const Vec3& q, const Vec3& y) {
  const double reach =
      1e-12 * std::max({max_abs(t.a), max_abs(t.b), max_abs(t.c), max_abs(q), max_abs(y)});
  const Vec3 d = y - q;
  for (const auto& [from, to] : {std::pair{t.a, t.b}, std::pair{t.b, t.c}, std::pair{t.c, t.a}})
    if (distance2(q, d, from, to - from) <= reach * reach) return true;
  return n != Vec3{0} && glm::dot(n, glm::cross(t.b - t.a, q - t.a)) >= 0 &&
         glm::dot(n, glm::cross(t.c - t.b, q - t.b)) >= 0 &&
         glm::dot(n, glm::cross(t.a - t.c, q - t.c)) >= 0;
}

}  // namespace

bool segment_meets(const Triangle& triangle, const Vec3& q, const Vec3& y, bool one_sided) {
  const Vec3 d = y - q;
  const Vec3 a = triangle.a - q;
  const Vec3 b = triangle.b - q;
  const Vec3 c = triangle.c - q;
  // The line passes the triangle when it does not pass its three edges on different sides. An edge
  // that two triangles share has the same value up to sign in both (same operands), and a doubtful
  // one counts as met: no line gets through between them.
  const int u = side(d, c, b);
  const int v = side(d, a, c);
  const int w = side(d, b, a);
  if ((u > 0 || v > 0 || w > 0) && (u < 0 || v < 0 || w < 0)) return false;

  const Vec3 e1 = triangle.b - triangle.a;
  const Vec3 e2 = triangle.c - triangle.a;
  const Vec3 n = glm::cross(e1, e2);
  const Vec3 terms = cross_terms(e1, e2);
  // y was computed (a point of a triangle): it lies off its plane by some roundings of a
  // coordinate.
  const double position =
      kRounding * std::max(max_abs(y), max_abs(triangle.a)) * (terms.x + terms.y + terms.z);
  const Vec3 from_y = y - triangle.a;
  const double height_q = -glm::dot(n, a);
  const double height_y = glm::dot(n, from_y);
  const bool q_on = std::abs(height_q) <= kRounding * glm::dot(terms, glm::abs(a)) + position;
  const bool y_on = std::abs(height_y) <= kRounding * glm::dot(terms, glm::abs(from_y)) + position;
  if (q_on && y_on) return meets_in_plane(triangle, n, q, y);
  if (q_on || y_on) return false;
  return (height_q > 0) != (height_y > 0) && (!one_sided || height_q > 0);
}

struct ExactSegments::Build {
  struct Box {
    std::array<float, 3> lo, hi;
  };
  std::vector<Box> boxes;
};

ExactSegments::ExactSegments(const Scene& scene, const Blockers& blockers)
    : scene_(scene), blockers_(blockers) {
  const std::size_t n = blockers.triangles.size();
  if (n == 0) return;
  centre_ = scene.bounds.centre();
  // Pays for the rounding of positions and of the slab test, both far below it.
  const double pad = 1e-11 * std::max({max_abs(scene.bounds.lo), max_abs(scene.bounds.hi), 1.0});
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Build build;
  build.boxes.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const TriangleRef& ref = blockers.triangles[i];
    const Triangle t = world_triangle(scene, solid_at(scene, ref.solid), ref.triangle);
    const Vec3 lo = glm::min(glm::min(t.a, t.b), t.c) - centre_ - pad;
    const Vec3 hi = glm::max(glm::max(t.a, t.b), t.c) - centre_ + pad;
    for (int k = 0; k < 3; ++k) {
      build.boxes[i].lo[static_cast<std::size_t>(k)] =
          std::nextafter(static_cast<float>(lo[k]), -kInfinity);
      build.boxes[i].hi[static_cast<std::size_t>(k)] =
          std::nextafter(static_cast<float>(hi[k]), kInfinity);
    }
  }
  order_.resize(n);
  std::iota(order_.begin(), order_.end(), 0U);
  nodes_.reserve(n);
  split(build, 0, static_cast<std::uint32_t>(n));
  nodes_.shrink_to_fit();
}

/// Median of the boxes' centres along their longest extent: depth log2 n whatever the triangles.
void ExactSegments::split(Build& build, std::uint32_t begin, std::uint32_t end) {
  constexpr std::uint32_t kLeaf = 4;
  Node node{};
  std::array<float, 3> lo, hi;
  lo.fill(std::numeric_limits<float>::infinity());
  hi.fill(-std::numeric_limits<float>::infinity());
  for (std::size_t k = 0; k < 3; ++k) {
    node.lo[k] = lo[k];
    node.hi[k] = hi[k];
  }
  for (std::uint32_t i = begin; i < end; ++i) {
    const Build::Box& box = build.boxes[order_[i]];
    for (std::size_t k = 0; k < 3; ++k) {
      node.lo[k] = std::min(node.lo[k], box.lo[k]);
      node.hi[k] = std::max(node.hi[k], box.hi[k]);
      lo[k] = std::min(lo[k], box.lo[k] + box.hi[k]);
      hi[k] = std::max(hi[k], box.lo[k] + box.hi[k]);
    }
  }
  const std::size_t index = nodes_.size();
  node.first = begin;
  node.count = end - begin <= kLeaf ? end - begin : 0;
  nodes_.push_back(node);
  if (node.count > 0) return;
  std::size_t axis = 0;
  for (std::size_t k = 1; k < 3; ++k)
    if (hi[k] - lo[k] > hi[axis] - lo[axis]) axis = k;
  const std::uint32_t middle = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](std::uint32_t x, std::uint32_t y) {
                     const Build::Box& p = build.boxes[x];
                     const Build::Box& r = build.boxes[y];
                     return p.lo[axis] + p.hi[axis] < r.lo[axis] + r.hi[axis];
                   });
  split(build, begin, middle);
  nodes_[index].first = static_cast<std::uint32_t>(nodes_.size());
  split(build, middle, end);
}

bool ExactSegments::blocked(const Vec3& q, const Vec3& y) const {
  if (nodes_.empty()) return false;
  const Vec3 o = q - centre_;
  const Vec3 d = y - q;
  const auto misses = [&](const Node& node) {
    double from = 0;
    double to = 1;
    for (int k = 0; k < 3; ++k) {
      if (d[k] == 0) {
        if (o[k] < node.lo[k] || o[k] > node.hi[k]) return true;
        continue;
      }
      const double s = (node.lo[k] - o[k]) / d[k];
      const double t = (node.hi[k] - o[k]) / d[k];
      from = std::max(from, std::min(s, t));
      to = std::min(to, std::max(s, t));
    }
    return from > to;
  };
  std::array<std::uint32_t, 64> stack;  // a median split of 2^32 triangles is 32 deep
  std::size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const std::uint32_t index = stack[--depth];
    const Node& node = nodes_[index];
    if (misses(node)) continue;
    if (node.count == 0) {
      stack[depth++] = node.first;
      stack[depth++] = index + 1;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const std::uint32_t t = order_[i];
      if (segment_meets(front_facing_triangle(scene_, blockers_.triangles[t]), q, y,
                        blockers_.one_sided(t)))
        return true;
    }
  }
  return false;
}

}  // namespace ivis
