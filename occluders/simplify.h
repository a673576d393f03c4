#pragma once

#include "occluders/occluder_set.h"

namespace ivis {

struct SimplifyOptions {
  double share_per_corner = 5e-4;  ///< of the polygon's area, for one corner less
  double share = 5e-3;             ///< of the polygon's area, in all
};

/// Fewer corners by giving up area: cuts shallow convex corners, and replaces a short edge between
/// two reflex corners by the meeting point of its neighbours. Guarantee: none by itself where other
/// parts of the outline come near: the result must pass the distance
///            check like any erosion. It is normalised: rings do not cross.
/// Threads:   reentrant. Cost: quadratic in corners at worst, a few rounds as a rule.
std::vector<Polygon> simplify_inwards(const Polygon& polygon, const SimplifyOptions& options = {});

}  // namespace ivis
