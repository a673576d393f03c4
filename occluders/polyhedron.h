#pragma once
// Closed surfaces of triangles, and the check of what was shrunk from them.

#include <array>
#include <cstdint>
#include <vector>

#include "occluders/occluder_set.h"

namespace ivis {

/// A closed surface, wound outwards; no corner out of range.
struct Polyhedron {
  std::vector<Vec3> points;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// The gate of shrunk polyhedra: is every point of `mesh`, a closed surface, moved by any vector of
/// the box of half-extents `half` (more than 0), inside the solid? Separating axes between pairs of
/// faces, and parities; shares nothing with what shrinks.
///
/// Why that is enough: if no face of the mesh, thickened by the box, meets the solid's surface, no
/// corner of the solid lies in the mesh, and every corner of the mesh lies in the solid, then each
/// component of the solid's surface lies outside the mesh as a whole. Take x in the mesh, v in the
/// box, with x + v on the solid's surface: the way there leaves the mesh at x + s v, 0 <= s <= 1,
/// from where (1 - s) v leads to the surface: that face would have met it.
///
/// Says no when unsure. Threads: reentrant. Cost: faces x triangles.
bool within_box_erosion(const FaceMesh& mesh, const Polyhedron& solid, const Vec3& half);

}  // namespace ivis
