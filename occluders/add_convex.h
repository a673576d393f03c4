#pragma once
// The step of shrink() that takes convex solids and sheets.

#include <vector>

#include "core/context.h"
#include "core/result.h"
#include "occluders/prisms.h"
#include "occluders/shrink.h"

namespace ivis {

/// Adds to `set`: every convex piece of the objects that is no upright prism, whole (convex_solids)
/// and shrunk (solid_pieces, at margins_m, which it sets); sheets, where the
/// options ask for them or promise gain. `prisms[i]` is what extract_prisms() made of objects[i];
/// reasons there that no longer hold are taken out. `skip[i]`: leave the object alone.
/// fates[i], if there are any: told of objects[i]'s convex solids, and whether one is left.
/// Errors:  kInvalidArgument when a seed of the view space lies in a convex solid; kCancelled.
/// Threads: uses context.threads; the result does not depend on their number.
Status add_convex_and_sheets(const Scene& scene, const std::vector<const Object*>& objects,
                             const std::vector<bool>& skip, const ShrinkOptions& options,
                             const Context& context, std::vector<ObjectSolids>& prisms,
                             OccluderSet& set, ShrinkReport& report,
                             std::vector<ObjectFate>& fates);

}  // namespace ivis
