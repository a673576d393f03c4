#pragma once

#include <memory>

#include "visibility/method.h"

namespace ivis {

/// Another method's answers, without the objects that the cell lies behind: on the far side of what
/// they lie against or hang on (OccluderSet::backings).
/// Guarantee: the method's own. Ownership: owns `method`, borrows scene and occluders. Threads,
///            errors: as the method.
/// Cost:      some ten nanoseconds a listed object that has backings.
std::unique_ptr<Method> cull_backed(std::unique_ptr<Method> method, const Scene& scene,
                                    const OccluderSet& occluders);

}  // namespace ivis
