#include "occluders/touched.h"

#include <algorithm>
#include <limits>

#include "core/view_cell.h"
#include "occluders/ground_soup.h"

namespace ivis {
namespace {

/// More than the tolerances by which W is larger than the reach, and than bounds are rounded by.
constexpr double kMoreM = 0.05;

}  // namespace

OccluderIndex::OccluderIndex(const OccluderSet& set)
    : set_(set), reach_(padded(set.reach, set.slack_m).half_extents()) {
  std::vector<Box2> flat;
  for (const Prism& p : set.shrunk) {
    boxes_.push_back(box_of(p));
    flat.push_back(ground_box(boxes_.back()));
  }
  tree_ = RectTree(flat);
  flat.clear();
  for (const Prism& p : set.solids) {
    solid_boxes_.push_back(p.bounds());
    flat.push_back(ground_box(solid_boxes_.back()));
  }
  solids_ = RectTree(flat);
}

Aabb OccluderIndex::box_of(const Prism& prism) const {
  Aabb box = prism.bounds();
  for (int axis : {0, 2}) {
    box.lo[axis] -= reach_[axis] + kMoreM;
    box.hi[axis] += reach_[axis] + kMoreM;
  }
  box.lo.y = -std::numeric_limits<double>::infinity();
  box.hi.y += kMoreM;  // no w of W rises
  return box;
}

std::vector<std::uint32_t> OccluderIndex::touched(const Aabb& matter) const {
  std::vector<std::uint32_t> out;
  out.reserve(32);
  tree_.all(ground_box(matter), [&](std::uint32_t i) {
    if (boxes_[i].overlaps(matter)) out.push_back(i);
    return true;
  });
  std::ranges::sort(out);
  return out;
}

std::vector<std::uint32_t> OccluderIndex::solids_on(const Box2& area) const {
  std::vector<std::uint32_t> out;
  solids_.all(area, [&](std::uint32_t i) {
    out.push_back(i);
    return true;
  });
  std::ranges::sort(out);
  return out;
}

bool is_matter(const Scene& scene, const Object& object) {
  if (object.tag == OccluderTag::kNever || object.always_visible) return false;
  return std::ranges::any_of(scene.mesh_of(object).primitives,
                             [](const Primitive& p) { return p.opaque && p.triangles > 0; });
}

bool holds_ground(const Scene& scene, const Object& object) {
  return may_be_ground(scene, object);
}

}  // namespace ivis
