#include "visibility/backing_cull.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/view_cell.h"
#include "visibility/culled_method.h"

namespace ivis {
namespace {

class BackingCull final : public CulledMethod {
 public:
  BackingCull(std::unique_ptr<Method> method, const Scene& scene, const OccluderSet& occluders)
      : CulledMethod(std::move(method)),
        slack_m_(occluders.slack_m),
        record_(scene.objects.size(), 0),
        backed_(1) {
    for (const Backing& b : occluders.backings) {
      if (scene.objects[b.object].always_visible) continue;
      std::uint32_t& record = record_[b.object];
      if (record == 0) {
        record = static_cast<std::uint32_t>(backed_.size());
        backed_.push_back({b, scene.objects[b.object].bounds, 0, 0});
        continue;
      }
      Backed& object = backed_[record];  // its planes follow each other
      if (object.more++ == 0) object.first = static_cast<std::uint32_t>(others_.size());
      others_.push_back(b);
    }
  }

 private:
  void cull(const ViewCell& cell, const Amendment* amendment,
            std::vector<ObjectId>& objects) const override {
    const Reach reach = padded(cell.reach, slack_m_);
    const Vec3 move = reach.half_extents();
    constexpr std::size_t kAhead = 12;  // memory takes longer than the arithmetic
    std::size_t kept = 0;
    for (std::size_t i = 0; i < objects.size(); ++i) {
      if (i + kAhead < objects.size()) {
        const char* next = reinterpret_cast<const char*>(&backed_[record_[objects[i + kAhead]]]);
        __builtin_prefetch(next);
        __builtin_prefetch(next + 64);
      }
      const std::uint32_t record = record_[objects[i]];
      if (record == 0 || !hidden(backed_[record], cell.eye, reach, move) ||
          (amendment != nullptr && !still_backed(*amendment, objects[i], backed_[record])))
        objects[kept++] = objects[i];
    }
    objects.resize(kept);
  }

  struct Backed {
    Backing plane;
    Aabb box;
    std::uint32_t first = 0;  ///< of further planes, in others_
    std::uint32_t more = 0;
  };

  bool hidden(const Backed& object, const Vec3& eye, const Reach& reach, const Vec3& move) const {
    if (!(behind(object.plane, eye, reach) > 0)) return false;
    // No point of the object is farther from any viewpoint of the cell, in any axis.
    const Aabb& box = object.box;
    const Vec3 far = glm::max(glm::abs(box.lo - eye), glm::abs(box.hi - eye)) + move;
    if (!hides(object.plane, eye, reach, far)) return false;
    for (std::uint32_t k = 0; k < object.more; ++k)
      if (!hides(others_[object.first + k], eye, reach, far)) return false;
    return true;
  }
  /// It is where it was, and so is what backs it.
  static bool still_backed(const Amendment& amendment, ObjectId id, const Backed& object) {
    return !amendment.is_gone(id) &&
           (!amendment.occluders || !amendment.occluders->displaced.near(object.box));
  }
  static double behind(const Backing& b, const Vec3& eye, const Reach& reach) {
    return b.plane.offset - glm::dot(b.plane.normal, eye) - reach.support(b.plane.normal);
  }
  static bool hides(const Backing& b, const Vec3& eye, const Reach& reach, const Vec3& far) {
    const double depth = behind(b, eye, reach);
    if (!(depth > 0)) return false;
    if (b.plane.normal.y != 0)
      return depth >= std::max(b.per_level, b.per_height) * glm::length(far);
    return depth >= b.per_level * std::sqrt(far.x * far.x + far.z * far.z) &&
           depth >= b.per_height * far.y;
  }

  double slack_m_;
  std::vector<std::uint32_t> record_;  ///< by id, in backed_; 0: nothing is behind it
  std::vector<Backed> backed_;
  std::vector<Backing> others_;
};

}  // namespace

std::unique_ptr<Method> cull_backed(std::unique_ptr<Method> method, const Scene& scene,
                                    const OccluderSet& occluders) {
  return std::make_unique<BackingCull>(std::move(method), scene, occluders);
}

}  // namespace ivis
