#pragma once

#include "core/view_cell.h"

namespace ivis::client {

/// The point of the cell at which a walker that wants to be at `p` is held: p itself when the cell
/// contains it, else a point near it; nearest for ball, disc, cylinder and box, on the segment from
/// the cell's eye for an ellipsoid. Guarantee: cell.contains(result). Requires p finite.
Vec3 clamp_to_cell(const ViewCell& cell, const Vec3& p);

/// How far p may move and stay in the cell, less the tolerance of contains(); 0 outside it. Along
/// the ground for disc and cylinder, whose height is another matter; else in any direction but
/// along a flat axis.
double margin_in_cell(const ViewCell& cell, const Vec3& p);

}  // namespace ivis::client
