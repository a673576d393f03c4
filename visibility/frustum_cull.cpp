#include "visibility/frustum_cull.h"

#include <utility>

#include "visibility/culled_method.h"

namespace ivis {
namespace {

class FrustumCull final : public CulledMethod {
 public:
  FrustumCull(std::unique_ptr<Method> method, const Scene& scene, const Frustum& frustum,
              double slack_m)
      : CulledMethod(std::move(method)), scene_(scene), frustum_(frustum), slack_m_(slack_m) {}

 private:
  void cull(const ViewCell& cell, const Amendment* amendment,
            std::vector<ObjectId>& objects) const override {
    const FrustumSweep sweep(frustum_, cell, slack_m_);
    std::erase_if(objects, [&](ObjectId id) {
      const Object& o = scene_.objects[id];
      return !o.always_visible && !sweep.may_meet(o.bounds) &&
             (amendment == nullptr || !amendment->is_gone(id));
    });
  }

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
