#pragma once
// Polygons with holes -> few convex faces of three or four corners.

#include <array>
#include <vector>

#include "occluders/occluder_set.h"

namespace ivis {

/// Three or four corners, positive area; a triangle repeats its third.
using Quad = std::array<Vec2, 4>;

/// Parts the polygon into triangles between its own corners, and joins pairs of them that make a
/// convex quadrangle. Corners are taken on the grid of clip.h; extent at most 512 m.
/// Guarantee: none of its own: where rings touch or cross, parts may be missing, or lie outside.
/// For
///            proper polygons the faces part it exactly. What matters is checked afterwards.
/// Threads:   reentrant. Cost: quadratic in corners.
std::vector<Quad> quads_of(const Polygon& polygon);

}  // namespace ivis
