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
/// Guarantee: as above, of points within triangles (edges have no area), for a scene in which the
///            solids are larger by their seams along the planes (PlaneSections: four float32 steps,
///            at most 0.1 mm): a slit of two seams between solids counts as closed, a face may jut
///            out by one. Across the plane nothing is assumed: matter reaches the triangles'
///            highest corner, so there is no gap under them.
/// Errors:    none. Empty when cancelled. Threads: uses context.threads; the same for any number.
/// Cost:      some boolean operations on polygons a triangle of an object that touches a solid;
///            objects of more than 2000 triangles have none.
std::vector<Backing> find_backings(const Scene& scene, const std::vector<ConvexPiece>& solids,
                                   const Context& context);

}  // namespace ivis
