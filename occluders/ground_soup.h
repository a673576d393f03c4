#pragma once
// Triangles that could be ground, joined where their corners agree to the last bit.

#include <array>
#include <cstdint>
#include <vector>

#include "core/aabb.h"
#include "scenes/scene.h"

namespace ivis {

using Corners = std::array<std::uint32_t, 3>;

/// Twice the signed area of the projection; positive where Polygon's outer rings are.
inline double twice_area(const Vec3& a, const Vec3& b, const Vec3& c) {
  return (b.x - a.x) * (c.z - a.z) - (b.z - a.z) * (c.x - a.x);
}

/// Triangles of the objects that could be part of a ground, with corners joined by their exact
/// positions.
struct Soup {
  std::vector<Vec3> corners;
  std::vector<Corners> triangles;
  std::vector<double> twice;           // signed projected area of each
  std::vector<std::uint32_t> objects;  // of each, as an index into sources()
};

/// One side of one triangle; sorting brings the sides that share an edge together.
struct Side {
  std::uint32_t lo = 0, hi = 0, triangle = 0;
  bool left = false;  ///< on which side of lo -> hi its triangle's projection lies
  bool same_edge(const Side& o) const { return lo == o.lo && hi == o.hi; }
};

/// One edge-connected piece of the soup.
struct Piece {
  std::vector<std::uint32_t> triangles;
  std::vector<Side> sides;  // sorted
  Aabb box;
  double area = 0;
  double volume = 0;  // under it, above y = 0
};

/// The triangles of the drawn, opaque, not always-visible objects that have no steep triangle and
/// do not lie over themselves. `occluders_only`: without the nodes marked `never`. Threads:
/// reentrant. Cost: linear in triangles.
Soup ground_soup(const Scene& scene, bool occluders_only);

/// Could the object be part of a ground: would its triangles be in the soup?
bool may_be_ground(const Scene& scene, const Object& object);

/// The edge-connected pieces, with their sides sorted.
std::vector<Piece> split(const Soup& soup);

/// Why the sides from `first` to the end of their edge (which is set) join nothing: the edge of one
/// triangle, of more than two, or a fold; empty when two triangles lie on opposite sides of it.
enum class EdgeFlaw : std::uint8_t { kNone, kOpen, kMany, kFold };
EdgeFlaw edge_flaw(const Piece& piece, std::size_t first, std::size_t& end);

}  // namespace ivis
