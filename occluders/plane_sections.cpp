#include "occluders/plane_sections.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ivis {
namespace {

constexpr double kMostRoundingM = 1e-4;

/// The half-plane normal.p <= offset; false when it cuts everything away.
bool cut(Ring& ring, const Vec2& normal, double offset) {
  Ring out;
  out.reserve(ring.size() + 1);
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Vec2& a = ring[i];
    const Vec2& b = ring[(i + 1) % ring.size()];
    const double da = glm::dot(normal, a) - offset;
    const double db = glm::dot(normal, b) - offset;
    if (da <= 0) out.push_back(a);
    if ((da < 0 && db > 0) || (da > 0 && db < 0)) out.push_back(a + (b - a) * (da / (da - db)));
  }
  ring = std::move(out);
  return ring.size() >= 3;
}

/// Where the solid, grown by `seam` within the plane, meets the plane, inside `box`; empty if
/// nowhere. Corners are cut off at `seam` too, so that sharp ones do not reach out farther.
Ring section(const ConvexSolid& solid, const PlaneFrame& frame, const Box2& box, double seam) {
  struct HalfPlane {
    Vec2 normal;
    double offset;
  };
  std::vector<HalfPlane> halves;
  halves.reserve(solid.planes.size());
  const double span = glm::length(glm::max(glm::abs(box.lo), glm::abs(box.hi)));
  for (const ConvexSolid::Plane& p : solid.planes) {
    const Vec2 across{glm::dot(p.normal, frame.u), glm::dot(p.normal, frame.v)};
    const double offset = p.offset - glm::dot(p.normal, frame.origin);
    const double length = glm::length(across);
    // All but parallel: dividing would lose the digits. It cuts nothing off within the box, or the
    // section is given up.
    if (length < 1e-7) {
      if (offset < length * span) return {};
      continue;
    }
    halves.push_back({across / length, offset / length});
  }
  Ring ring = rectangle(box);
  for (const HalfPlane& h : halves)
    if (!cut(ring, h.normal, h.offset)) return {};
  if (seam <= 0) return ring;
  const Ring bare = ring;
  ring = rectangle(box);
  for (const HalfPlane& h : halves)
    if (!cut(ring, h.normal, h.offset + seam)) return {};
  for (std::size_t i = 0; i < bare.size(); ++i) {
    const Vec2& p = bare[i];
    const Vec2 a = p - bare[(i + bare.size() - 1) % bare.size()];
    const Vec2 b = bare[(i + 1) % bare.size()] - p;
    const double la = glm::length(a);
    const double lb = glm::length(b);
    if (!(la > 0 && lb > 0)) continue;
    const Vec2 out = a / la - b / lb;
    const double l = glm::length(out);
    if (l > 1e-6 && !cut(ring, out / l, glm::dot(out / l, p) + seam)) return {};
  }
  return ring;
}

}  // namespace

PlaneFrame frame_at(const Vec3& n, const Vec3& origin) {
  int axis = 0;
  for (int i = 1; i < 3; ++i)
    if (std::abs(n[i]) < std::abs(n[axis])) axis = i;
  Vec3 u{0};
  u[axis] = 1;
  u = glm::normalize(u - n * glm::dot(u, n));
  return {origin, u, glm::cross(n, u), n};
}

Ring rectangle(const Box2& box) {
  return {box.lo, {box.hi.x, box.lo.y}, box.hi, {box.lo.x, box.hi.y}};
}

Box2 box_of(const Ring& ring) {
  Box2 box;
  for (const Vec2& p : ring)
    box.add(p);
  return box;
}

Box2 grown(Box2 box, double by) {
  box.lo -= Vec2{by};
  box.hi += Vec2{by};
  return box;
}

double rounding_of(const Aabb& box) {
  const Vec3 far = glm::max(glm::abs(box.lo), glm::abs(box.hi));
  const auto f = static_cast<float>(std::max({far.x, far.y, far.z}));
  const float step = std::nextafter(f, std::numeric_limits<float>::infinity()) - f;
  return std::min(kMostRoundingM, 4 * static_cast<double>(step));
}

PlaneSections::PlaneSections(const std::vector<ConvexPiece>& solids) : solids_(solids) {
  std::vector<Box2> boxes;
  for (const ConvexPiece& s : solids) {
    boxes.push_back({ground(s.solid.bounds.lo), ground(s.solid.bounds.hi)});
    seams_.push_back(s.only ? rounding_of(s.solid.bounds) : 0);
  }
  tree_ = RectTree(boxes);
}

std::vector<PlaneSections::Cut> PlaneSections::cuts_at(const PlaneFrame& frame,
                                                       const Aabb& place) const {
  std::vector<std::uint32_t> near;
  tree_.all({ground(place.lo), ground(place.hi)}, [&](std::uint32_t s) {
    near.push_back(s);
    return true;
  });
  std::sort(near.begin(), near.end());
  std::vector<Cut> cuts;
  for (const std::uint32_t s : near) {
    const Aabb& b = solids_[s].solid.bounds;
    if (!b.overlaps(place)) continue;
    const Vec3 half = b.size() * 0.5;
    const Vec3 c = b.centre() - frame.origin;
    if (std::abs(glm::dot(frame.n, c)) > glm::dot(glm::abs(frame.n), half)) continue;
    const Vec2 m{glm::dot(frame.u, c), glm::dot(frame.v, c)};
    const Vec2 h{glm::dot(glm::abs(frame.u), half), glm::dot(glm::abs(frame.v), half)};
    cuts.push_back({s, {m - h, m + h}});
  }
  return cuts;
}

bool PlaneSections::any_near(const Aabb& place) const {
  return !tree_.all({ground(place.lo), ground(place.hi)},
                    [&](std::uint32_t s) { return !solids_[s].solid.bounds.overlaps(place); });
}

void PlaneSections::collect(const std::vector<Cut>& cuts, const PlaneFrame& frame, const Box2& box,
                            std::vector<Ring>& rings, double& seam) const {
  for (const Cut& c : cuts) {
    if (!c.box.overlaps(box)) continue;
    Ring ring = section(solids_[c.solid].solid, frame, box, seams_[c.solid]);
    if (ring.size() < 3) continue;
    rings.push_back(std::move(ring));
    seam = std::max(seam, seams_[c.solid]);
  }
}

}  // namespace ivis
