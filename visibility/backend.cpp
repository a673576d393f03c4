#include "visibility/backend.h"

#include <atomic>
#include <mutex>
#include <utility>

#include "visibility/cull_map.h"
#include "visibility/occlusion_map.h"

namespace ivis {
namespace {

class GlWhileItWorks : public Method {
 public:
  GlWhileItWorks(std::unique_ptr<Method> gl, const Scene& scene, const OccluderSet& occluders,
                 MethodOptions options)
      : gl_(std::move(gl)), scene_(scene), occluders_(occluders), options_(std::move(options)) {}

  const MethodTraits& traits() const override { return gl_->traits(); }
  Backend backend() const override { return failed_ ? Backend::kCpu : gl_->backend(); }

  Result<Pvs> solve(const ViewCell& cell) const override {
    if (!failed_) {
      auto pvs = gl_->solve(cell);
      // What is wrong with the cell is wrong on the CPU too.
      if (pvs || pvs.error().code == ErrorCode::kInvalidArgument) return pvs;
      std::call_once(once_, [&] {
        cpu_ = std::make_unique<OcclusionMap>(scene_, occluders_, options_);
        if (options_.log) options_.log(pvs.error().message + "; the CPU takes over");
        failed_ = true;
      });
    }
    return cpu_->solve(cell);
  }

 private:
  std::unique_ptr<Method> gl_;
  const Scene& scene_;
  const OccluderSet& occluders_;
  MethodOptions options_;
  mutable std::once_flag once_;
  mutable std::atomic<bool> failed_{false};
  mutable std::unique_ptr<OcclusionMap> cpu_;
};

Error not_built() {
  return unsupported("OpenGL: this program is built without it (IVIS_WITH_GL)");
}

}  // namespace

Result<std::unique_ptr<Method>> make_occlusion_map(const Scene& scene, const OccluderSet& occluders,
                                                   const MethodOptions& options) {
  const bool needs_cpu = options.selection != Selection::kConservative;
  if (needs_cpu && options.backend == Backend::kGl)
    return invalid_argument(
        "the OpenGL occlusion map draws all occluders; selecting them is the "
        "CPU's (--backend cpu)");
  if (options.backend != Backend::kCpu && options.make_gl && !needs_cpu) {
    auto gl = options.make_gl(scene, occluders, options);
    if (options.backend == Backend::kGl) return gl;
    if (gl)
      return std::unique_ptr<Method>(
          std::make_unique<GlWhileItWorks>(std::move(*gl), scene, occluders, options));
    if (options.log) options.log(gl.error().message + "; the occlusion map runs on the CPU");
  } else if (options.backend == Backend::kGl) {
    return not_built();
  }
  return std::unique_ptr<Method>(std::make_unique<OcclusionMap>(scene, occluders, options));
}

Result<std::unique_ptr<Method>> make_cull_map(const Scene& scene, const OccluderSet& occluders,
                                              const MethodOptions& options) {
  const bool asked = options.backend == Backend::kGl;
  if (options.map == CullMapKind::kPolar && asked)
    return invalid_argument(
        "the polar cull map has no OpenGL backend; the orthographic one and the "
        "occlusion map have");
  auto map = std::make_unique<CullMap>(scene, occluders, options);
  if (options.map == CullMapKind::kPolar) return std::unique_ptr<Method>(std::move(map));
  if (options.backend != Backend::kCpu && options.make_gl_shadows) {
    auto shadows = options.make_gl_shadows(*map->orthographic(), options.backend);
    if (shadows)
      map->draw_shadows_on(std::move(*shadows));
    else if (asked)
      return shadows.error();
    else if (options.log)
      options.log(shadows.error().message + "; the orthographic map runs on the CPU");
  } else if (asked) {
    return not_built();
  }
  return std::unique_ptr<Method>(std::move(map));
}

}  // namespace ivis
