#include "visibility/blockers.h"

#include <utility>

namespace ivis {

Blockers find_blockers(const Scene& scene, BlockerChoice choice) {
  Blockers blockers;
  std::vector<TriangleRef> one_sided;
  const auto add = [&](std::uint32_t solid, const Object& o, bool sided) {
    for (const Primitive& p : scene.mesh_of(o).primitives) {
      if (!p.opaque) continue;
      auto& list = sided && !p.double_sided ? one_sided : blockers.triangles;
      for (std::uint32_t t = 0; t < p.triangles; ++t)
        list.push_back({solid, p.first_triangle + t});
    }
  };
  std::uint32_t solid = 0;
  for (const Object& o : scene.objects) {
    const bool left_out = choice == BlockerChoice::kOccluding && o.tag == OccluderTag::kNever;
    if (!o.always_visible && !left_out) add(solid, o, scene.honour_sidedness);
    ++solid;
  }
  for (const Object& o : scene.hidden_solids)
    add(solid++, o, false);
  blockers.first_one_sided = blockers.triangles.size();
  blockers.triangles.insert(blockers.triangles.end(), one_sided.begin(), one_sided.end());
  return blockers;
}

Triangle front_facing_triangle(const Scene& scene, const TriangleRef& ref) {
  const Object& o = solid_at(scene, ref.solid);
  Triangle t = world_triangle(scene, o, ref.triangle);
  if (glm::determinant(glm::dmat3(o.to_world)) < 0) std::swap(t.b, t.c);
  return t;
}

}  // namespace ivis
