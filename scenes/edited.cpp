#include "scenes/edited.h"

namespace ivis {
namespace {

/// More than placing a point errs by, in double precision and with a quaternion of floats.
constexpr double kPlacingErrorM = 1e-3;

}  // namespace

Object as_placed(const Object& object, const Placement& p) {
  Object out = object;
  const Vec3 origin(object.to_world[3]);
  // Without a detour by the origin, so that what is not tilted keeps its heights to the last bit.
  out.to_world = glm::mat4_cast(glm::normalize(glm::dquat(p.rotation))) * object.to_world;
  out.to_world[3] = glm::dvec4(p.position, 1);
  // The corners of the box in the file hold all of the object, wherever they come to.
  const Aabb& box = object.bounds;
  out.bounds = {};
  for (int corner = 0; corner < 8; ++corner)
    out.bounds.add(
        placed(p, origin,
               {(corner & 1) != 0 ? box.hi.x : box.lo.x, (corner & 2) != 0 ? box.hi.y : box.lo.y,
                (corner & 4) != 0 ? box.hi.z : box.lo.z}));
  out.bounds = {out.bounds.lo - kPlacingErrorM, out.bounds.hi + kPlacingErrorM};
  return out;
}

Scene edited(const Scene& scene, const std::map<ObjectId, ObjectState>& states) {
  Scene out = scene;
  const auto nothing = static_cast<std::uint32_t>(out.meshes.size());
  out.meshes.emplace_back();
  for (const auto& [id, s] : states) {
    Object& o = out.objects[id];
    if (s.moved) o = as_placed(o, s.placement);
    if (s.removed) o.mesh = nothing;
    if (s.occluder_off) o.tag = OccluderTag::kNever;
    out.bounds.add(o.bounds);
  }
  return out;
}

}  // namespace ivis
