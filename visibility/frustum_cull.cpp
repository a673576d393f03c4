#include "visibility/frustum_cull.h"

#include <utility>

namespace ivis {
namespace {

class FrustumCull final : public Method {
 public:
  FrustumCull(std::unique_ptr<Method> method, const Scene& scene, const Frustum& frustum,
              double slack_m)
      : method_(std::move(method)), scene_(scene), frustum_(frustum), slack_m_(slack_m) {}

  const MethodTraits& traits() const override { return method_->traits(); }
  Backend backend() const override { return method_->backend(); }

  Result<Pvs> solve(const ViewCell& cell) const override {
    return culled(method_->solve(cell), cell);
  }
  Result<Pvs> solve(const ViewCell& cell, LastShown& last) const override {
    return culled(method_->solve(cell, last), cell);
  }

 private:
  Result<Pvs> culled(Result<Pvs> pvs, const ViewCell& cell) const {
    if (!pvs || !pvs->everything_because.empty()) return pvs;
    const FrustumSweep sweep(frustum_, cell, slack_m_);
    std::erase_if(pvs->objects, [&](ObjectId id) {
      const Object& o = scene_.objects[id];
      return !o.always_visible && !sweep.may_meet(o.bounds);
    });
    return pvs;
  }

  std::unique_ptr<Method> method_;
  const Scene& scene_;
  Frustum frustum_;
  double slack_m_;
};

}  // namespace

std::unique_ptr<Method> cull_by_frustum(std::unique_ptr<Method> method, const Scene& scene,
                                        const Frustum& frustum, double slack_m) {
  return std::make_unique<FrustumCull>(std::move(method), scene, frustum, slack_m);
}

}  // namespace ivis
