#pragma once
// A visibility method that tests of the network can predict: objects whose centre is near the cell.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <new>

#include "tests/support/scene_builder.h"
#include "visibility/method.h"

namespace ivis::test {

class NearMethod : public Method {
 public:
  explicit NearMethod(const Scene& scene, double radius_m = 10)
      : scene_(scene), radius_m_(radius_m) {}

  const MethodTraits& traits() const override { return traits_; }
  Result<Pvs> solve(const ViewCell& cell) const override {
    ++solves;
    Pvs pvs;
    pvs.cell = cell;
    pvs.scene_hash = scene_.hash;
    if (cell.eye.y < -500) throw std::bad_alloc();
    if (cell.eye.y < -50) return invalid_argument("below the world");
    const bool everything = cell.eye.y > 50;
    if (everything) pvs.everything_because = "above the world";
    for (ObjectId id = 0; id < scene_.object_count(); ++id)
      if (everything || glm::distance(scene_.objects[id].bounds.centre(), cell.eye) <=
                            radius_m_ + cell.reach.half_extents().x)
        pvs.objects.push_back(id);
    return pvs;
  }
  bool takes_amendments() const override { return true; }
  Result<Pvs> solve(const ViewCell& cell, const Effort& /*effort*/, const Amendment& amendment,
                    Work& /*done*/) const override {
    auto pvs = solve(cell);
    if (!pvs || !pvs->everything_because.empty()) return pvs;
    std::erase_if(pvs->objects, [&](ObjectId id) { return amendment.is_gone(id); });
    for (const Amendment::Placed& p : amendment.placed) {
      const Vec3 nearest = glm::clamp(cell.eye, p.bounds.lo, p.bounds.hi);
      if (glm::distance(nearest, cell.eye) <= radius_m_) pvs->objects.push_back(p.object);
    }
    std::sort(pvs->objects.begin(), pvs->objects.end());
    return pvs;
  }
  mutable std::atomic<int> solves{0};

 private:
  const Scene& scene_;
  double radius_m_;
  MethodTraits traits_{"near", Guarantee::kAggressive, false, "objects near the eye"};
};

/// n x n unit boxes, 2 m apart, from the origin along +X and +Z.
inline Scene grid_scene(int n) {
  SceneBuilder builder;
  for (int z = 0; z < n; ++z)
    for (int x = 0; x < n; ++x)
      builder.add_box(Vec3{2.0 * x, 0, 2.0 * z}, Vec3{2.0 * x + 1, 1, 2.0 * z + 1});
  return std::move(builder).finish();
}

}  // namespace ivis::test
