#pragma once
// What every method does before and after computing.

#include <cstdint>
#include <string>
#include <vector>

#include "core/pvs.h"
#include "core/result.h"
#include "occluders/occluder_set.h"
#include "scenes/scene.h"
#include "visibility/solid_index.h"

namespace ivis {

/// Errors: kInvalidArgument if the eye is not finite or the occluders were not shrunk for the
/// cell's reach.
Status check_cell(const ViewCell& cell, const OccluderSet& occluders);

/// An answer that lists nothing yet.
Pvs empty_answer(const Scene& scene, const ViewCell& cell);

/// Why everything must be listed for this cell; empty if that need not be: the eye is in no solid,
/// and subtracting boxes from the eye (both in single precision, in the coordinates of the map,
/// where the eye is `map_eye`) errs by less than the slack.
std::string why_everything(const Vec3& eye, const Vec3& map_eye, const SolidIndex& solids,
                           double slack_m);

/// Every object of the scene, because of `why`.
void list_everything(const Scene& scene, std::string why, Pvs& pvs);

/// Ascending ids, each once, of two lists in any order: by way of bits, cheaper than sorting and
/// the same for any number of threads. `bits` is scratch.
void list_ascending(std::size_t objects, const std::vector<std::uint32_t>& found,
                    const std::vector<ObjectId>& always, std::vector<std::uint64_t>& bits,
                    Pvs& pvs);

}  // namespace ivis
