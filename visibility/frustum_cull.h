#pragma once

#include <memory>

#include "core/frustum.h"
#include "visibility/method.h"

namespace ivis {

/// Another method's answers, without the objects that cannot be in the picture: those whose boxes
/// lie outside the frustum swept over the cell. Movers stay, as their boxes are not to be trusted.
/// `slack_m`: OccluderSet::slack_m.
/// Guarantee: the method's own, for views within the frustum turned by at most its turn_deg.
/// Ownership: owns `method`, borrows the scene. Threads, errors: as the method.
/// Cost:      a few nanoseconds a listed object.
std::unique_ptr<Method> cull_by_frustum(std::unique_ptr<Method> method, const Scene& scene,
                                        const Frustum& frustum, double slack_m = 0.001);

}  // namespace ivis
