#pragma once
// Things that hang on walls - windows, signs, ledges: from behind the wall they cannot be seen.

#include <vector>

#include "core/context.h"
#include "occluders/occluder_set.h"
#include "scenes/scene.h"

namespace ivis {

/// Finds the objects that stand out from a wall by so little, and so far from its edges, that a
/// cell behind the wall sees them at a graze only. Walls are faces of the set's unshrunk solids.
///
/// Why: let the plane lie in the solid, parallel to the wall and behind all of the object, h below
/// its highest point; let the solid's section by the plane hold the object's own place, grown by
/// m_l to both sides and m_h up and down. A sight line from a viewpoint a behind the plane, which
/// goes l along the wall and rises by r on its way to a point of the object, crosses the plane at
/// most h l / a and h r / a beside that point: in the section, if a >= l h / m_l and a >= r h /
/// m_h. There it is in the solid, in which viewpoints do not count, so it has crossed the solid's
/// surface. Where the plane is not upright both directions are bounded by the whole distance.
///
/// Shapes:    ascending objects, one plane each, per_level = h / m_l < 1, per_height = h / m_h.
///            Objects that have a backing in the set already are left out.
/// Guarantee: as above; no assumption on seams or rounding: the plane lies 5 mm in the solid, m is
///            5 mm less than it measures.
/// Errors:    none. Empty when cancelled. Threads: uses context.threads; the same for any number.
/// Cost:      a few microseconds an object near a wall.
std::vector<Backing> find_wall_backings(const Scene& scene, const OccluderSet& set,
                                        const Context& context);

}  // namespace ivis
