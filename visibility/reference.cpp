#include "visibility/reference.h"

#include <cmath>
#include <numeric>

#include "visibility/verify.h"

namespace ivis {
namespace {

class ReferenceMethod final : public Method {
 public:
  ReferenceMethod(const Scene& scene, const OccluderSet& occluders, const MethodOptions& options)
      : scene_(scene),
        occluders_(occluders),
        options_(options),
        traits_(reference_traits()),
        verifier_(scene, &occluders) {}

  const MethodTraits& traits() const override { return traits_; }

  Result<Pvs> solve(const ViewCell& cell) const override {
    if (!std::isfinite(cell.eye.x + cell.eye.y + cell.eye.z))
      return invalid_argument("reference: the eye is not finite");
    Pvs pvs;
    pvs.cell = cell;
    pvs.scene_hash = scene_.hash;
    if (inside_solid(occluders_, cell.eye)) {
      pvs.objects.resize(scene_.objects.size());
      std::iota(pvs.objects.begin(), pvs.objects.end(), 0U);
      pvs.everything_because = "eye inside an occluder";
      return pvs;
    }
    Context context;
    context.threads = options_.threads;
    const std::vector<ObjectId> seen =
        verifier_.seen_from(cell, options_.rays, options_.seed, context);
    auto next = seen.begin();
    for (ObjectId id = 0; id < scene_.objects.size(); ++id) {
      const bool is_seen = next != seen.end() && *next == id;
      if (is_seen) ++next;
      if (is_seen || scene_.objects[id].always_visible) pvs.objects.push_back(id);
    }
    return pvs;
  }

 private:
  const Scene& scene_;
  const OccluderSet& occluders_;
  MethodOptions options_;
  MethodTraits traits_;
  Verifier verifier_;
};

}  // namespace

MethodTraits reference_traits() {
  return {"reference", Guarantee::kExactAtSamples, false,
          "aimed rays from many viewpoints of the cell"};
}

std::unique_ptr<Method> make_reference(const Scene& scene, const OccluderSet& occluders,
                                       const MethodOptions& options) {
  return std::make_unique<ReferenceMethod>(scene, occluders, options);
}

}  // namespace ivis
