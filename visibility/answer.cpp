#include "visibility/answer.h"

#include <bit>
#include <cmath>
#include <numeric>

namespace ivis {

Status check_cell(const ViewCell& cell, const OccluderSet& occluders) {
  if (!std::isfinite(cell.eye.x) || !std::isfinite(cell.eye.y) || !std::isfinite(cell.eye.z))
    return invalid_argument("the eye is not finite");
  if (!serves(occluders, cell.reach))
    return invalid_argument("reach " + cell.reach.to_string() +
                            " is larger than the occluders were shrunk for, " +
                            occluders.reach.to_string());
  return ok();
}

Pvs empty_answer(const Scene& scene, const ViewCell& cell) {
  Pvs pvs;
  pvs.cell = cell;
  pvs.scene_hash = scene.hash;
  return pvs;
}

std::string why_everything(const Vec3& eye, const Vec3& map_eye, const SolidIndex& solids,
                           double slack_m) {
  if (solids.holds(eye)) return "eye inside an occluder";
  // As a length, since a map's axes may be turned: the slack is an upright cylinder.
  const Vec3 error = map_eye - Vec3(glm::vec3(map_eye));
  if (!(glm::length(error) <= 0.7 * slack_m))
    return "eye too far from the scene for single precision";
  return {};
}

void list_everything(const Scene& scene, std::string why, Pvs& pvs) {
  pvs.objects.resize(scene.objects.size());
  std::iota(pvs.objects.begin(), pvs.objects.end(), 0U);
  pvs.everything_because = std::move(why);
}

void list_ascending(std::size_t objects, const std::vector<std::uint32_t>& found,
                    const std::vector<ObjectId>& always, std::vector<std::uint64_t>& bits,
                    Pvs& pvs) {
  bits.assign((objects + 63) / 64, 0);
  for (const std::uint32_t id : found)
    bits[id >> 6U] |= std::uint64_t{1} << (id & 63U);
  for (const ObjectId id : always)
    bits[id >> 6U] |= std::uint64_t{1} << (id & 63U);
  pvs.objects.reserve(found.size() + always.size());
  for (std::size_t w = 0; w < bits.size(); ++w)
    for (std::uint64_t m = bits[w]; m != 0; m &= m - 1)
      pvs.objects.push_back(
          static_cast<ObjectId>(w * 64 + static_cast<std::size_t>(std::countr_zero(m))));
}

}  // namespace ivis
