#pragma once
// The OpenGL map by Mesa's software rasteriser: include in tests of visibility/gl.

#include <cstdlib>
#include <memory>
#include <utility>

#include <gtest/gtest.h>

#include "occluders/fast_erosion.h"
#include "occluders/shrink.h"
#include "visibility/gl/gl_occlusion_map.h"
#include "visibility/verify.h"

namespace ivis::test {

/// A context, or null where there is no OpenGL: then skip.
inline std::unique_ptr<GlContext> software_context() {
  setenv("LIBGL_ALWAYS_SOFTWARE", "1", 1);
  auto context = GlContext::create();
  if (!context) return nullptr;
  return std::move(*context);
}

#define IVIS_NEEDS_GL                              \
  if (::ivis::test::software_context() == nullptr) \
  GTEST_SKIP() << "no OpenGL on this machine: " << ::ivis::GlContext::create().error().message

inline OccluderSet shrunk(const Scene& scene, const Reach& reach,
                          const std::vector<double>& margins = {},
                          SheetUse sheets = SheetUse::kAuto) {
  ShrinkOptions options;
  options.sheets = sheets;
  options.reach = reach;
  options.margins_m = margins;
  auto result = shrink(scene, options, FastEroder{});
  EXPECT_TRUE(result) << (result ? "" : result.error().message);
  return result ? std::move(result->set) : OccluderSet{};
}

inline std::unique_ptr<GlOcclusionMap> gl_map(const Scene& scene, const OccluderSet& set,
                                              const MethodOptions& options = {},
                                              const OcclusionGuards& guards = {}) {
  auto map = GlOcclusionMap::create(software_context(), scene, set, options, guards);
  EXPECT_TRUE(map) << (map ? "" : map.error().message);
  return map ? std::move(*map) : nullptr;
}

inline Pvs solved(const Method& map, const ViewCell& cell) {
  const auto pvs = map.solve(cell);
  EXPECT_TRUE(pvs) << (pvs ? "" : pvs.error().message);
  return pvs ? *pvs : Pvs{};
}

inline std::size_t misses(const Verifier& verifier, const Pvs& pvs) {
  const auto report = verifier.check(pvs, {});
  EXPECT_TRUE(report);
  return report ? report->false_negatives : 1;
}

}  // namespace ivis::test
