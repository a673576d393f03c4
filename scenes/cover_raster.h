#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "core/math.h"
#include "scenes/scene.h"

namespace ivis {

/// What stands where, seen from above: for each cell the top of the highest object over its centre,
/// or -infinity. For decoration: sampled, not conservative.
class CoverRaster {
 public:
  CoverRaster(const Scene& scene, const Vec2& lo, const Vec2& hi, double cell_m)
      : lo_(lo),
        cell_(cell_m),
        nx_(static_cast<std::size_t>(std::ceil((hi.x - lo.x) / cell_m))),
        nz_(static_cast<std::size_t>(std::ceil((hi.y - lo.y) / cell_m))),
        top_(nx_ * nz_, -std::numeric_limits<float>::infinity()) {
    for (const Object& o : scene.objects)
      for (std::size_t t = 0; t < scene.mesh_of(o).triangles(); ++t)
        draw(world_triangle(scene, o, t));
  }

  double cell_m() const { return cell_; }
  std::size_t nx() const { return nx_; }
  std::size_t nz() const { return nz_; }
  bool covered(std::size_t cell) const { return std::isfinite(top_[cell]); }
  /// Top at p; -infinity where nothing stands or p is outside.
  double top(const Vec2& p) const {
    const Vec2 q = glm::floor((p - lo_) / cell_);
    if (q.x < 0 || q.y < 0 || q.x >= static_cast<double>(nx_) || q.y >= static_cast<double>(nz_))
      return -std::numeric_limits<double>::infinity();
    return top_[index(p)];
  }
  /// Cell that holds p, which must be inside.
  std::size_t index(const Vec2& p) const {
    const Vec2 q = glm::floor((p - lo_) / cell_);
    return static_cast<std::size_t>(q.y) * nx_ + static_cast<std::size_t>(q.x);
  }

 private:
  void draw(const Triangle& t) {
    const Vec2 a = (ground(t.a) - lo_) / cell_;
    const Vec2 b = (ground(t.b) - lo_) / cell_;
    const Vec2 c = (ground(t.c) - lo_) / cell_;
    const auto side = [](const Vec2& p, const Vec2& q, const Vec2& r) {
      return (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
    };
    const double area = side(a, b, c);
    if (std::abs(area) < 1e-9) return;
    const Vec2 most(static_cast<double>(nx_) - 1, static_cast<double>(nz_) - 1);
    const Vec2 from = glm::max(glm::floor(glm::min(glm::min(a, b), c)), Vec2(0));
    const Vec2 to = glm::min(glm::floor(glm::max(glm::max(a, b), c)), most);
    if (from.x > to.x || from.y > to.y) return;
    for (auto k = static_cast<std::size_t>(from.y); k <= static_cast<std::size_t>(to.y); ++k) {
      for (auto i = static_cast<std::size_t>(from.x); i <= static_cast<std::size_t>(to.x); ++i) {
        const Vec2 p(static_cast<double>(i) + 0.5, static_cast<double>(k) + 0.5);
        const double u = side(b, c, p) / area;
        const double v = side(c, a, p) / area;
        const double w = 1 - u - v;
        if (u < 0 || v < 0 || w < 0) continue;
        float& top = top_[k * nx_ + i];
        top = std::max(top, static_cast<float>(u * t.a.y + v * t.b.y + w * t.c.y));
      }
    }
  }

  Vec2 lo_;
  double cell_;
  std::size_t nx_, nz_;
  std::vector<float> top_;
};

}  // namespace ivis
