#include "visibility/sub_boxes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>

namespace ivis {
namespace {

constexpr double kLeastSizeM = 1;  ///< smaller objects have one box
constexpr std::size_t kMostTriangles =
    20000;  ///< larger meshes have one box: clusters are for them
/// The parts' surfaces together must stay below this many times the one box's: those of what fills
/// its box do not.
constexpr double kWorthwhile = 1.1;

using Ring = std::vector<Vec3>;

/// Part of a convex ring with coordinate `axis` <= at, or >= at.
Ring clip(const Ring& ring, int axis, double at, bool below) {
  Ring out;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Vec3& a = ring[i];
    const Vec3& b = ring[(i + 1) % ring.size()];
    const double da = below ? at - a[axis] : a[axis] - at;
    const double db = below ? at - b[axis] : b[axis] - at;
    if (da >= 0) out.push_back(a);
    if ((da > 0 && db < 0) || (da < 0 && db > 0)) {
      Vec3 p = a + (b - a) * (da / (da - db));
      p[axis] = at;
      out.push_back(p);
    }
  }
  return out;
}

struct Part {
  std::vector<Ring> rings;
  Aabb box;
  bool operator<(const Part& o) const { return longest() < o.longest(); }
  double longest() const {
    const Vec3 s = box.size();
    return std::max({s.x, s.y, s.z});
  }
};

double surface(const Aabb& b) {
  const Vec3 s = b.size();
  return s.x * s.y + s.y * s.z + s.z * s.x;
}

Aabb bounds_of(const std::vector<Ring>& rings) {
  Aabb box;
  for (const Ring& r : rings)
    for (const Vec3& p : r)
      box.add(p);
  return box;
}

/// The longest part is halved again and again; every triangle's points end up in some part's box.
std::vector<Aabb> parts_of(const MapFrame& frame, const Scene& scene, const Object& o) {
  Part whole;
  for (std::size_t t = 0; t < scene.mesh_of(o).triangles(); ++t) {
    const Triangle w = world_triangle(scene, o, t);
    whole.rings.push_back({frame.to_map(w.a), frame.to_map(w.b), frame.to_map(w.c)});
  }
  whole.box = bounds_of(whole.rings);
  std::priority_queue<Part> queue;
  queue.push(std::move(whole));
  while (queue.size() < BoxTree::kWidth) {
    Part top = queue.top();
    queue.pop();
    const Vec3 size = top.box.size();
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const double at = top.box.centre()[axis];
    Part halves[2];
    for (int h = 0; h < 2; ++h) {
      for (const Ring& r : top.rings) {
        Ring c = clip(r, axis, at, h == 0);
        if (!c.empty()) halves[h].rings.push_back(std::move(c));
      }
      halves[h].box = bounds_of(halves[h].rings);
    }
    for (Part& half : halves)
      if (!half.rings.empty()) queue.push(std::move(half));
    if (queue.top().longest() < 0.25 * kLeastSizeM) break;
  }
  std::vector<Aabb> boxes;
  for (; !queue.empty(); queue.pop())
    boxes.push_back(queue.top().box);
  return boxes;
}

}  // namespace

SubBoxes::SubBoxes(const Scene& scene, const MapFrame& frame) : node_(scene.objects.size(), kNone) {
  for (ObjectId id = 0; id < scene.objects.size(); ++id) {
    const Object& o = scene.objects[id];
    const std::size_t triangles = scene.mesh_of(o).triangles();
    const Vec3 size = o.bounds.size();
    if (o.always_visible || triangles == 0 || triangles > kMostTriangles ||
        std::max({size.x, size.y, size.z}) < kLeastSizeM)
      continue;
    std::vector<Aabb> boxes = parts_of(frame, scene, o);
    // Rounding of transforms and cuts, far below the slack.
    const Vec3 far = glm::max(glm::abs(o.bounds.lo), glm::abs(o.bounds.hi));
    const double slack = 1e-9 * std::max({far.x, far.y, far.z}) + 1e-7;
    double sum = 0;
    for (Aabb& b : boxes) {
      b.lo -= Vec3{slack};
      b.hi += Vec3{slack};
      sum += surface(b);
    }
    if (sum > kWorthwhile * surface(bounds_in(frame, scene, o))) continue;
    const std::vector<std::uint32_t> items(boxes.size(), id);
    BoxTree one = BoxTree::build(boxes, items, Vec3{0});
    node_[id] = static_cast<std::uint32_t>(tree_.nodes.size());
    tree_.nodes.push_back(one.nodes.front());
  }
}

}  // namespace ivis
