#pragma once

#include <optional>

#include "occluders/occluder_set.h"

namespace ivis {

/// The outline moved inwards by `distance_m` (> 0), its corners mitred: what eroding by a disc
/// gives where no reflex corner is rounded, and a little less at each that is. Edges that shrink to
/// nothing are dropped; a convex outline of which nothing is left gives an empty polygon.
/// Returns:   nothing where it is not as simple as that: the outline would part or cross itself, a
///            mitre is long, it has more than 128 corners. Ask an Eroder then.
/// Guarantee: none by itself; the result must pass within_erosion() like any erosion.
/// Threads:   reentrant. Cost: quadratic in corners; no boolean operation.
std::optional<Polygon> inset(const Polygon& polygon, double distance_m);

}  // namespace ivis
