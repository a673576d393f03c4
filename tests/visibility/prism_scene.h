#pragma once

#include <random>

#include "occluders/occluder_set.h"
#include "tests/support/scene_builder.h"

namespace ivis::test {

/// Upright convex prisms that occlude and small boxes that do not, with the exact erosion of each
/// prism worked out apart from the project's builders (half-planes moved inwards).
struct PrismScene {
  struct Solid {
    std::vector<Vec2> ring;  ///< convex, positive area
    double bottom, top;
  };
  std::vector<Solid> solids;
  Scene scene;
  OccluderSet occluders;
};

/// The convex ring with every side moved inwards by the reach's support there; empty if nothing is
/// left.
inline std::vector<Vec2> erode_convex(const std::vector<Vec2>& ring, const Reach& reach) {
  std::vector<Vec2> kept = ring;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Vec2 a = ring[i];
    const Vec2 e = ring[(i + 1) % ring.size()] - a;
    const Vec2 inward = glm::normalize(Vec2{-e.y, e.x});
    const double offset = glm::dot(inward, a) + reach.support({inward.x, 0, inward.y});
    std::vector<Vec2> next;
    for (std::size_t k = 0; k < kept.size(); ++k) {
      const Vec2 p = kept[k];
      const Vec2 q = kept[(k + 1) % kept.size()];
      const double dp = glm::dot(inward, p) - offset;
      const double dq = glm::dot(inward, q) - offset;
      if (dp >= 0) next.push_back(p);
      if ((dp >= 0) != (dq >= 0)) next.push_back(p + (q - p) * (dp / (dp - dq)));
    }
    kept = std::move(next);
    if (kept.size() < 3) return {};
  }
  return kept;
}

/// A scene of the given solids and boxes, shrunk for `reach`. The floor rule holds as in the
/// product.
inline PrismScene make_prism_scene(const std::vector<PrismScene::Solid>& solids,
                                   const std::vector<Aabb>& boxes, const Reach& reach) {
  PrismScene out;
  out.solids = solids;
  SceneBuilder builder;
  for (const auto& s : solids)
    builder.add_prism(s.ring, s.bottom, s.top);
  for (const Aabb& b : boxes)
    builder.add_box(b.lo, b.hi, OccluderTag::kNever);
  out.scene = std::move(builder).finish();
  out.occluders.scene_hash = out.scene.hash;
  out.occluders.reach = reach;
  out.occluders.floor = std::numeric_limits<double>::infinity();
  for (const auto& solid : solids)
    out.occluders.floor = std::min(out.occluders.floor, solid.bottom);
  for (const Aabb& b : boxes)
    out.occluders.floor = std::min(out.occluders.floor, b.lo.y);
  const Reach margin = padded(reach, out.occluders.slack_m);
  for (const auto& s : solids) {
    Prism prism;
    prism.footprint.rings = {s.ring};
    prism.bottom = prism.solid_bottom = s.bottom;
    prism.top = s.top;
    out.occluders.solids.push_back(prism);
    const auto ring = erode_convex(s.ring, margin);
    if (ring.empty()) continue;
    prism.footprint.rings = {ring};
    prism.top -= out.occluders.slack_m;
    prism.bottom += 2 * margin.half_extents().y;
    out.occluders.shrunk.push_back(prism);
  }
  return out;
}

/// Does the segment from q to y meet the interior of a solid?
inline bool blocked(const PrismScene& s, const Vec3& q, const Vec3& y) {
  for (const auto& solid : s.solids) {
    double t0 = 0;
    double t1 = 1;
    const auto clip = [&](double at_q, double at_y) {  // keep where the value is >= 0
      if (at_q < 0 && at_y < 0)
        t1 = -1;
      else if (at_q < 0)
        t0 = std::max(t0, at_q / (at_q - at_y));
      else if (at_y < 0)
        t1 = std::min(t1, at_q / (at_q - at_y));
    };
    clip(solid.top - q.y, solid.top - y.y);
    clip(q.y - solid.bottom, y.y - solid.bottom);
    for (std::size_t i = 0; i < solid.ring.size(); ++i) {
      const Vec2 a = solid.ring[i];
      const Vec2 e = solid.ring[(i + 1) % solid.ring.size()] - a;
      const auto side = [&](const Vec3& p) { return e.x * (p.z - a.y) - e.y * (p.x - a.x); };
      clip(side(q), side(y));
    }
    if (t1 > t0) return true;
  }
  return false;
}

}  // namespace ivis::test
