#pragma once
// The part of shrink() that deals with small closed solids that are neither prisms nor convex.

#include <vector>

#include "core/context.h"
#include "core/result.h"
#include "occluders/prisms.h"
#include "occluders/shrink.h"

namespace ivis {

/// Closed pieces of objects in which no prism was found (a stack of prisms hides nearly as much,
/// and takes no time), wound outwards, not convex, of at most options.polyhedra.most_triangles:
/// each to the worker (nef_worker.h); what it makes goes to set.solid_pieces, the whole solids as
/// convex parts to set.convex_solids. `prisms`: what was found in each object; `skip`: objects that
/// are ground. Does nothing without a worker. Errors: kInvalidArgument when a seed of the view
/// space lies in a solid; kIo when the worker
///         cannot be run; kCancelled. What fails is left out and counted.
/// Threads: one worker a thread of the context.
Status add_polyhedra(const Scene& scene, const std::vector<const Object*>& objects,
                     const std::vector<bool>& skip, const std::vector<ObjectSolids>& prisms,
                     const ShrinkOptions& options, OccluderSet& set, ShrinkReport& report,
                     const Context& context);

}  // namespace ivis
