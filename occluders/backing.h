#pragma once
// Objects that lie flush against matter: from behind they cannot be seen, with no shrinking at all.

#include <vector>

#include "core/context.h"
#include "occluders/convex.h"
#include "occluders/occluder_set.h"
#include "scenes/scene.h"

namespace ivis {

/// Finds the objects each of whose triangles lies flush against solids marked `only`, as the faces
/// drawn over a game map's solids do, with the planes they lie in.
///
/// Why such an object is hidden from a cell that lies behind all those planes: a sight line from Q
/// behind the plane to a point Y of a triangle arrives at Y through the matter it lies against. Q
/// is not in matter (such viewpoints do not count), so the line has crossed the matter's surface.
/// That holds up to the triangle's border, where the shrunk solid has long ended: the backs of
/// walls and crates go with this, and with nothing that is drawn into a map.
///
/// Shapes:    ascending objects, one entry a plane; at most 6 planes an object, others have none.
/// Guarantee: as above, of points within triangles (edges have no area). Flush means: the plane
///            through the triangles' highest corner meets the union of the solids, each counting
///            as larger by its seam along the plane (PlaneSections), wherever a triangle is. So
///            there is no gap under a triangle; what may jut out is a seam's width, on a solid
///            whose corners' rounding comes to as much.
/// Errors:    none. Empty when cancelled. Threads: uses context.threads; the same for any number.
/// Cost:      some boolean operations on polygons an object that touches a solid.
std::vector<Backing> find_backings(const Scene& scene, const std::vector<ConvexPiece>& solids,
                                   const Context& context);

}  // namespace ivis
