#include "visibility/backing_cull.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "core/view_cell.h"
#include "visibility/culled_method.h"

namespace ivis {
namespace {

class BackingCull final : public CulledMethod {
 public:
  BackingCull(std::unique_ptr<Method> method, const Scene& scene, const OccluderSet& occluders)
      : CulledMethod(std::move(method)),
        scene_(scene),
        occluders_(occluders),
        first_(scene.objects.size() + 1, 0) {
    for (const Backing& b : occluders.backings)
      ++first_[b.object + 1];
    for (std::size_t i = 1; i < first_.size(); ++i)
      first_[i] += first_[i - 1];
  }

 private:
  void cull(const ViewCell& cell, std::vector<ObjectId>& objects) const override {
    const Reach reach = padded(cell.reach, occluders_.slack_m);
    const Vec3 move = reach.half_extents();
    std::erase_if(objects, [&](ObjectId id) {
      const std::span<const Backing> planes(occluders_.backings.data() + first_[id],
                                            first_[id + 1] - first_[id]);
      if (planes.empty() || scene_.objects[id].always_visible) return false;
      const Aabb& box = scene_.objects[id].bounds;
      // No point of the object is farther from any viewpoint of the cell, in any axis.
      const Vec3 far = glm::max(glm::abs(box.lo - cell.eye), glm::abs(box.hi - cell.eye)) + move;
      const double level = std::sqrt(far.x * far.x + far.z * far.z);
      return std::ranges::all_of(planes, [&](const Backing& b) {
        const double behind =
            b.plane.offset - glm::dot(b.plane.normal, cell.eye) - reach.support(b.plane.normal);
        if (!(behind > 0)) return false;
        if (b.plane.normal.y != 0)
          return behind >= std::max(b.per_level, b.per_height) * glm::length(far);
        return behind >= b.per_level * level && behind >= b.per_height * far.y;
      });
    });
  }

  const Scene& scene_;
  const OccluderSet& occluders_;
  std::vector<std::size_t> first_;  ///< backings of object i: [first_[i], first_[i + 1])
};

}  // namespace

std::unique_ptr<Method> cull_backed(std::unique_ptr<Method> method, const Scene& scene,
                                    const OccluderSet& occluders) {
  return std::make_unique<BackingCull>(std::move(method), scene, occluders);
}

}  // namespace ivis
