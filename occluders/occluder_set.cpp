#include "occluders/occluder_set.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/view_cell.h"

namespace ivis {

double area(const Polygon& polygon) {
  double twice = 0;
  for (const auto& ring : polygon.rings)
    for (std::size_t i = 0, n = ring.size(); i < n; ++i) {
      // Relative to the ring's first corner: far from the origin the products would swamp the sum.
      const Vec2 a = ring[i] - ring[0];
      const Vec2 b = ring[(i + 1) % n] - ring[0];
      twice += a.x * b.y - b.x * a.y;
    }
  return twice / 2;
}

bool contains(const Polygon& polygon, const Vec2& p) {
  bool inside = false;
  for (const auto& ring : polygon.rings)
    for (std::size_t i = 0, n = ring.size(); i < n; ++i) {
      const Vec2& a = ring[i];
      const Vec2& b = ring[(i + 1) % n];
      if ((a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x))
        inside = !inside;
    }
  return inside;
}

Aabb Prism::bounds() const {
  Aabb box;
  for (const auto& ring : footprint.rings)
    for (const Vec2& p : ring) {
      box.add(Vec3{p.x, bottom, p.y});
      box.add(Vec3{p.x, top, p.y});
    }
  return box;
}

namespace {

std::string check_prism(const Prism& p) {
  const auto outside = [](const char* field, double v) {
    return std::string(field) + ": found " + std::to_string(v) + ", expected at most 1e9";
  };
  if (!in_range(p.bottom)) return outside("bottom", p.bottom);
  if (!in_range(p.top)) return outside("top", p.top);
  if (!in_range(p.solid_bottom)) return outside("solid bottom", p.solid_bottom);
  if (p.bottom > p.top)
    return "top: found " + std::to_string(p.top) + ", expected at least its bottom " +
           std::to_string(p.bottom);
  for (const auto& ring : p.footprint.rings)
    for (const Vec2& corner : ring) {
      if (!in_range(corner.x)) return outside("corner x", corner.x);
      if (!in_range(corner.y)) return outside("corner z", corner.y);
    }
  return "";
}

}  // namespace

Status check_numbers(const OccluderSet& set) {
  const auto wrong = [](const std::string& field, double found, const char* expected) {
    return invalid_argument("occluders: " + field + ": found " + std::to_string(found) +
                            ", expected " + expected);
  };
  for (int i = 0; i < 3; ++i)
    if (const double e = set.reach.half_extents()[i]; !(e >= 0 && in_range(e)))
      return wrong("reach half-extent", e, "0 to 1e9");
  if (!(set.slack_m >= 0 && in_range(set.slack_m))) return wrong("slack", set.slack_m, "0 to 1e9");
  if (!in_range(set.floor)) return wrong("floor", set.floor, "at most 1e9");
  if (!set.ground.empty())
    for (int i = 0; i < 3; ++i)
      for (const double v : {set.ground.lo[i], set.ground.hi[i]})
        if (!in_range(v)) return wrong("ground", v, "at most 1e9");
  for (const auto* prisms : {&set.shrunk, &set.solids})
    for (std::size_t i = 0; i < prisms->size(); ++i)
      if (const std::string why = check_prism((*prisms)[i]); !why.empty())
        return invalid_argument(
            "occluders: " + std::string(prisms == &set.shrunk ? "shrunk prism " : "solid ") +
            std::to_string(i) + ": " + why);
  for (const PrismPiece& piece : set.prism_pieces)
    for (const auto& level : piece.levels)
      for (const Prism& prism : level)
        if (const std::string why = check_prism(prism); !why.empty())
          return invalid_argument("occluders: prism of a piece: " + why);
  for (const auto* ladder : {&set.margins_m, &set.sheet_radii_m})
    for (std::size_t i = 0; i < ladder->size(); ++i)
      if (!((*ladder)[i] >= (i == 0 ? 0 : (*ladder)[i - 1]) && in_range((*ladder)[i])))
        return wrong("margin or radius", (*ladder)[i], "0 to 1e9, ascending");
  if (set.height_field.heights.size() !=
      std::size_t{set.height_field.columns} * set.height_field.rows)
    return invalid_argument("occluders: the height field has not as many heights as cells");
  const auto outside = [](const Vec3& p) {
    return !in_range(p.x) || !in_range(p.y) || !in_range(p.z);
  };
  const auto bad_mesh = [&](const FaceMesh& mesh) {
    return std::any_of(mesh.points.begin(), mesh.points.end(), outside) ||
           std::any_of(mesh.faces.begin(), mesh.faces.end(), [&](const auto& face) {
             return std::any_of(face.begin(), face.end(),
                                [&](std::uint32_t c) { return c >= mesh.points.size(); });
           });
  };
  for (const SolidPiece& piece : set.solid_pieces)
    if (piece.levels.size() > set.margins_m.size() ||
        std::any_of(piece.levels.begin(), piece.levels.end(), bad_mesh) ||
        piece.floored_levels.size() > set.margins_m.size() ||
        std::any_of(piece.floored_levels.begin(), piece.floored_levels.end(), bad_mesh))
      return invalid_argument("occluders: a solid piece has a number out of range");
  for (const PrismPiece& piece : set.prism_pieces)
    if (piece.levels.size() > set.margins_m.size())
      return invalid_argument("occluders: a prism piece has more levels than there are margins");
  for (const Sheet& sheet : set.sheets)
    if (outside(sheet.normal) || !in_range(sheet.offset) ||
        sheet.levels.size() > set.sheet_radii_m.size() ||
        std::any_of(sheet.levels.begin(), sheet.levels.end(), bad_mesh))
      return invalid_argument("occluders: a sheet has a number out of range");
  for (std::size_t i = 0; i < set.backings.size(); ++i) {
    const Backing& b = set.backings[i];
    if (!(std::abs(glm::length(b.plane.normal) - 1) < 1e-9) || !in_range(b.plane.offset) ||
        !(b.per_level >= 0 && b.per_height >= 0 && in_range(b.per_level) && in_range(b.per_height)))
      return invalid_argument("occluders: a backing has a number out of range");
    if (i > 0 && b.object < set.backings[i - 1].object)
      return invalid_argument("occluders: backing " + std::to_string(i) + ": object " +
                              std::to_string(b.object) + " after object " +
                              std::to_string(set.backings[i - 1].object) +
                              ", expected ascending ones");
    if (i >= kMostPlanesBehind && b.object == set.backings[i - kMostPlanesBehind].object)
      return invalid_argument("occluders: object " + std::to_string(b.object) + " has more than " +
                              std::to_string(kMostPlanesBehind) + " backings");
  }
  return ok();
}

bool serves(const OccluderSet& set, const Reach& reach) {
  return serves(set.reach, set.slack_m, reach);
}

// A point Z under the prism and within its footprint, on a sight line QY. By the floor rule Q and Y
// lie no lower than solid_bottom, so Z cannot. By the ground rule Q is above the ground and Z below
// it, and the segment QZ stays over the rectangle that the ground covers: it crosses drawn, opaque
// ground.
bool extends_down(const OccluderSet& set, const Prism& prism, const Aabb& cell) {
  if (prism.solid_bottom <= set.floor && cell.lo.y >= prism.solid_bottom) return true;
  return prism.grounded && !set.ground.empty() && cell.lo.x >= set.ground.lo.x &&
         cell.hi.x <= set.ground.hi.x && cell.lo.z >= set.ground.lo.z &&
         cell.hi.z <= set.ground.hi.z;
}

bool contains(const ConvexSolid& solid, const Vec3& p) {
  for (const ConvexSolid::Plane& plane : solid.planes)
    if (glm::dot(plane.normal, p) >= plane.offset) return false;
  return !solid.planes.empty();
}

bool inside_solid(const OccluderSet& set, const Vec3& p) {
  for (const Prism& s : set.solids)
    if (p.y > s.bottom && p.y < s.top && contains(s.footprint, ground(p))) return true;
  for (const ConvexSolid& s : set.convex_solids)
    if (s.bounds.contains(p) && contains(s, p)) return true;
  for (const Aabb& b : set.closed_boxes)
    if (b.contains(p)) return true;
  return false;
}

}  // namespace ivis
