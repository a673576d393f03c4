#pragma once
// Where a plane cuts through solids.

#include <cstddef>
#include <vector>

#include "core/aabb.h"
#include "occluders/clip.h"
#include "occluders/convex.h"
#include "occluders/rect_tree.h"

namespace ivis {

/// A plane's own coordinates: u x v = n.
struct PlaneFrame {
  Vec3 origin, u, v, n;
  Vec3 to_world(const Vec2& p) const { return origin + u * p.x + v * p.y; }
  Vec2 to_plane(const Vec3& p) const { return {glm::dot(p - origin, u), glm::dot(p - origin, v)}; }
};

/// The plane through `origin` with the unit normal `n`. Along an axis of the world where it can be:
/// then walls that follow the axes lie on clip.h's grid.
PlaneFrame frame_at(const Vec3& n, const Vec3& origin);

Box2 box_of(const Ring& ring);
Box2 grown(Box2 box, double by);
Ring rectangle(const Box2& box);

/// What rounding may take from corners of such coordinates: four float32 steps of the largest, at
/// most 0.1 mm.
double rounding_of(const Aabb& box);

/// Sections of many convex solids by planes. Solids marked `only` count as larger by a seam,
/// rounding_of() their bounds, since corners in files are rounded, so that faces of neighbours come
/// apart.
/// Ownership: borrows the solids. Threads: const and reentrant.
class PlaneSections {
 public:
  explicit PlaneSections(const std::vector<ConvexPiece>& solids);

  /// A solid that the plane may meet, and the part of the plane that the section lies in.
  struct Cut {
    std::size_t solid;
    Box2 box;
  };
  /// Those near `place`, by ascending solid.
  std::vector<Cut> cuts_at(const PlaneFrame& frame, const Aabb& place) const;

  /// Adds to `rings` the sections within `box`, each grown by its seam, and the largest of these
  /// seams to `seam`.
  void collect(const std::vector<Cut>& cuts, const PlaneFrame& frame, const Box2& box,
               std::vector<Ring>& rings, double& seam) const;

  /// May any solid touch the box?
  bool any_near(const Aabb& place) const;

 private:
  const std::vector<ConvexPiece>& solids_;
  std::vector<double> seams_;
  RectTree tree_;
};

}  // namespace ivis
