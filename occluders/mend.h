#pragma once

#include <span>
#include <vector>

#include "occluders/occluder_change.h"
#include "occluders/shrink.h"
#include "occluders/touched.h"

namespace ivis {

/// An object that is not where the scene has it any more.
struct Displaced {
  Aabb bounds;                ///< where it was
  std::vector<Prism> solids;  ///< extract_prisms() of it there
};

/// Shrinks anew the blocks that the displaced objects were part of, without them: what the prisms
/// that they touch can still hide. Only solids near those prisms are looked at.
///
/// Why some solids are enough: erosion grows with what is eroded, so what is left of fewer solids
/// lies in what is left of all. A displaced object's own solids are known by their numbers, to the
/// last bit; where one is not found, all solids that meet its place are left out.
///
/// Guarantee: as OccluderSet::shrunk, for the scene without the displaced objects.
/// Errors:    none; what fails is left out, and all that remains when the context is stopped.
/// Threads:   reentrant. Cost: as of shrinking the blocks, whatever else the scene has.
std::vector<Prism> mend(const OccluderIndex& index, std::span<const Displaced> displaced,
                        const Eroder& eroder, const Context& context = {});

struct ShrunkObject {
  std::vector<Prism> prisms;
  std::vector<Aabb> solids;  ///< about the unshrunk ones
};

/// One object alone, wherever it is now, by the set's reach, floor and slack. It does not rest on
/// ground: its prisms reach down only to where it ends, or past the floor.
ShrunkObject shrink_object(const Scene& scene, const Object& object, const OccluderSet& set,
                           const Eroder& eroder, const Context& context = {});

}  // namespace ivis
