#pragma once

#include <memory>

#include "visibility/method.h"

namespace ivis {

/// The sampled reference: what aimed rays see from many viewpoints of the cell, extreme ones
/// included.
/// Guarantee: exact at the samples; every object it lists is seen from the cell (or is a mover). An
///            eye inside a solid of the occluder set lists everything; of a cell inside any other
///            closed solid only the viewpoints outside it count.
/// Errors:    solve(): kInvalidArgument if the eye is not finite.
/// Threads:   solve() is const and reentrant; uses options.threads; same result for any number.
/// Ownership: borrows scene and occluders, which may be an empty set.
/// Cost:      options.rays rays an object and cell.
std::unique_ptr<Method> make_reference(const Scene& scene, const OccluderSet& occluders,
                                       const MethodOptions& options);

/// "reference".
MethodTraits reference_traits();

}  // namespace ivis
