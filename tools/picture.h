#pragma once
// Pictures from above: the ground plane as SVG.

#include <sstream>
#include <string>

#include "core/aabb.h"
#include "occluders/occluder_set.h"

namespace ivis::tool {

inline constexpr double kPixels = 1200;

class Picture {
 public:
  Picture(const Vec2& centre, double radius) : centre_(centre), radius_(radius) {
    svg_ << std::fixed;
    svg_.precision(1);
  }
  bool sees(const Aabb& b) const {
    return b.hi.x >= centre_.x - radius_ && b.lo.x <= centre_.x + radius_ &&
           b.hi.z >= centre_.y - radius_ && b.lo.z <= centre_.y + radius_;
  }
  void point(const Vec2& p) {
    svg_ << (p.x - centre_.x + radius_) * scale() << ',' << (p.y - centre_.y + radius_) * scale()
         << ' ';
  }
  double scale() const { return kPixels / (2 * radius_); }
  void polygon(const Polygon& polygon, const std::string& style) {
    svg_ << "<path fill-rule=\"evenodd\" " << style << " d=\"";
    for (const auto& ring : polygon.rings) {
      svg_ << 'M';
      for (const Vec2& p : ring)
        point(p);
      svg_ << 'Z';
    }
    svg_ << "\"/>\n";
  }
  void box(const Aabb& b, const std::string& style) {
    const double least = 1.2 / scale();  // small things stay visible
    const Vec3 c = b.centre();
    const Vec3 h = glm::max(b.size() * 0.5, Vec3{least});
    polygon({{{{c.x - h.x, c.z - h.z},
               {c.x + h.x, c.z - h.z},
               {c.x + h.x, c.z + h.z},
               {c.x - h.x, c.z + h.z}}}},
            style);
  }
  void raw(const std::string& text) { svg_ << text; }
  std::string text() const { return svg_.str(); }

 private:
  Vec2 centre_;
  double radius_;
  std::ostringstream svg_;
};

}  // namespace ivis::tool
