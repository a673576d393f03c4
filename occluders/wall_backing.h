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
/// its highest point; let the solid's section by the plane reach m beyond the object's own place on
/// every side. A sight line from behind that meets the plane at an angle a arrives at a point of
/// the object from at most h / tan a beside it: through the section, if sin a >= h / m. There it is
/// in the solid, in which viewpoints do not count, so it has crossed the solid's surface.
///
/// Shapes:    ascending objects, one plane each, with least_sine = h / m < 1. Objects that have a
///            backing in the set already are left out.
/// Guarantee: as above; no assumption on seams or rounding: the plane lies 5 mm in the solid, m is
///            5 mm less than it measures.
/// Errors:    none. Empty when cancelled. Threads: uses context.threads; the same for any number.
/// Cost:      a few microseconds an object near a wall.
std::vector<Backing> find_wall_backings(const Scene& scene, const OccluderSet& set,
                                        const Context& context);

}  // namespace ivis
