#pragma once

#include <memory>

#include "visibility/method.h"

namespace ivis {

/// The occlusion map on what options.backend asks for. With Backend::kAuto it is OpenGL's until
/// that fails, then the CPU's for good, whose answers hold as well. Errors: kUnsupported if
/// Backend::kGl is asked for and is not built in, or does not work. Threads: solve() is const and
/// reentrant.
Result<std::unique_ptr<Method>> make_occlusion_map(const Scene& scene, const OccluderSet& occluders,
                                                   const MethodOptions& options);

/// The cull map; of the orthographic one the shadows are drawn on what options.backend asks for, in
/// the same way. Errors: kInvalidArgument if Backend::kGl is asked for the polar map; else as
/// above.
Result<std::unique_ptr<Method>> make_cull_map(const Scene& scene, const OccluderSet& occluders,
                                              const MethodOptions& options);

}  // namespace ivis
