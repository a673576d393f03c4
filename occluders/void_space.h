#pragma once
// Space that matter shuts off from observers, where matter is known as convex solids.

#include <cstddef>
#include <vector>

#include "core/context.h"
#include "core/result.h"
#include "occluders/convex.h"

namespace ivis {

struct VoidOptions {
  double cell_m = 0.1;
  std::size_t max_voxels = 400'000'000;  ///< the cells grow until no more are needed
};

/// Boxes that no observer can get into: what is neither reached from the seeds nor, wholly, outside the solids' bounds.
/// Voxels that do not lie wholly in the union of the solids are *open*; a flood from the seeds goes through all of them,
/// from face to face. The boxes cover the open voxels that it does not reach.
/// Guarantee: a path from a seed into a box crosses matter. A path through free space can be moved off the voxels' edges
///            (free space is an open set), so it goes from voxel to voxel through faces; all of them hold free points, so
///            all are open, so the flood takes it. Hence a sight line from where observers are to a point of a box has
///            met a solid before (docs/theory.md, 8): for shrinking, the boxes are matter.
/// Errors:    kCancelled. No seeds, or a seed in the void outside: nothing is shut off from there.
/// Threads:   one, and as many as the context has for looking at seams.
/// Cost:      a bit a voxel and its flood; 30 us a voxel on a seam between solids.
Result<std::vector<Aabb>> find_void(const std::vector<ConvexPiece>& solids, const std::vector<Vec3>& seeds,
                                    const VoidOptions& options, const Context& context);

}  // namespace ivis
