#pragma once
// Polygons with holes -> convex parts of three or four corners.

#include <array>
#include <vector>

#include "occluders/occluder_set.h"

namespace ivis {

/// Partition of the region that the polygon fills (even-odd) into trapezoids with two sides along
/// x; a triangle repeats its third corner. Positive shoelace area each. Guarantee: the parts lie
/// inside the region but for rounding of corners along its edges (1e-15 of the
///            coordinates, which the slack of occluder sets pays for).
/// Errors:    none; empty, which is safe, for rings that cross so often that they cannot be an
/// outline, or of more than
///            20,000 edges.
/// Cost:      O(n^2) in corners at worst. Threads: reentrant.
std::vector<std::array<Vec2, 4>> convex_parts(const Polygon& polygon);

/// Boundary of footprint x [bottom, top]: walls, roof and underside. A prism without height is
/// empty.
FaceMesh mesh_of(const Prism& prism);

}  // namespace ivis
