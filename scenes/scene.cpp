#include "scenes/scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#define XXH_INLINE_ALL
#include <xxhash.h>

namespace ivis {
namespace {

bool finite(const Mat4& m) {
  for (int c = 0; c < 4; ++c)
    for (int r = 0; r < 4; ++r)
      if (!std::isfinite(m[c][r])) return false;
  return true;
}

/// Sums, differences and squares of such coordinates are finite.
bool within_limit(const Aabb& box) {
  constexpr double kLimit = 1e30;
  const Vec3 m = glm::max(glm::abs(box.lo), glm::abs(box.hi));
  return !glm::any(glm::isnan(box.lo)) && !glm::any(glm::isnan(box.hi)) && m.x <= kLimit &&
         m.y <= kLimit && m.z <= kLimit;
}

std::string describe(const Scene& scene, const Object& o) {
  std::string name = o.node < scene.node_names.size() ? scene.name_of(o) : std::string();
  return "node " + std::to_string(o.node) + (name.empty() ? "" : " '" + name + "'");
}

Status check_mesh(const Mesh& mesh, std::size_t index) {
  const std::string where = "mesh " + std::to_string(index);
  if (mesh.indices.size() % 3 != 0)
    return input_error(where + ": " + std::to_string(mesh.indices.size()) +
                       " indices, expected a multiple of 3");
  for (const std::uint32_t i : mesh.indices)
    if (i >= mesh.positions.size())
      return input_error(where + ": index " + std::to_string(i) + ", expected below " +
                         std::to_string(mesh.positions.size()));
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const auto& p = mesh.positions[i];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      return input_error(where + ": position " + std::to_string(i) + " is not finite");
  }
  std::size_t next = 0;
  for (const Primitive& p : mesh.primitives) {
    if (p.first_triangle != next)
      return input_error(where + ": primitives do not cover its triangles in order");
    next += p.triangles;
  }
  if (next != mesh.triangles())
    return input_error(where + ": primitives do not cover its triangles");
  return ok();
}

/// Of the vertices that triangles use, in the mesh's own space; zero without triangles.
struct Extent {
  Aabb box;
  Vec3 magnitude{0};
  bool uses_all = false;  ///< there are no other vertices
};

Extent extent_of(const Mesh& mesh) {
  Extent e;
  std::vector<bool> used(mesh.positions.size(), false);
  for (const std::uint32_t i : mesh.indices) {
    if (used[i]) continue;
    used[i] = true;
    e.box.add(Vec3(mesh.positions[i]));
  }
  e.uses_all = std::find(used.begin(), used.end(), false) == used.end();
  if (!e.box.empty()) e.magnitude = glm::max(glm::abs(e.box.lo), glm::abs(e.box.hi));
  return e;
}

/// Boxes go to boxes: every world axis depends on one axis of the mesh at most.
bool maps_boxes_to_boxes(const Mat4& m) {
  for (int r = 0; r < 3; ++r)
    if ((m[0][r] != 0) + (m[1][r] != 0) + (m[2][r] != 0) > 1) return false;
  return true;
}

/// Finds world boxes of objects that share meshes.
class Bounds {
 public:
  explicit Bounds(const Scene& scene) : scene_(scene), extents_(scene.meshes.size()) {
    for (std::size_t m = 0; m < extents_.size(); ++m)
      extents_[m] = extent_of(scene.meshes[m]);
  }

  /// World box of the object's triangles, grown by what rounding of the transform may have lost.
  Aabb of(const Object& o) {
    const Mesh& mesh = scene_.mesh_of(o);
    const Extent& extent = extents_[o.mesh];
    const Mat4& m = o.to_world;
    const Vec3 origin(m[3]);
    if (extent.box.empty()) return {origin, origin};
    Aabb box;
    // A file can ask for a million instances of a mesh of a million triangles. When that gets out
    // of hand, the transformed corners of the mesh's box do: a larger box is seen sooner, never
    // later.
    const std::size_t work = extent.uses_all ? mesh.positions.size() : mesh.indices.size();
    const bool corners = maps_boxes_to_boxes(m) || vertices_left_ < work;
    if (corners) {
      for (unsigned c = 0; c < 8; ++c)
        box.add(world(m, {(c & 1U) != 0 ? extent.box.hi.x : extent.box.lo.x,
                          (c & 2U) != 0 ? extent.box.hi.y : extent.box.lo.y,
                          (c & 4U) != 0 ? extent.box.hi.z : extent.box.lo.z}));
    } else {
      vertices_left_ -= work;
      if (extent.uses_all)
        for (const auto& p : mesh.positions)
          box.add(world(m, Vec3(p)));
      else
        for (const std::uint32_t i : mesh.indices)
          box.add(world(m, Vec3(mesh.positions[i])));
    }
    // The terms of the sum may be far larger than the sum.
    Vec3 terms = glm::abs(origin);
    for (int c = 0; c < 3; ++c)
      terms += glm::abs(Vec3(m[c])) * extent.magnitude[c];
    return {box.lo - terms * kRounding, box.hi + terms * kRounding};
  }

 private:
  static constexpr double kRounding = 1e-12;
  static Vec3 world(const Mat4& m, const Vec3& p) {
    const auto row = [&](int r) { return m[0][r] * p.x + m[1][r] * p.y + m[2][r] * p.z + m[3][r]; };
    return {row(0), row(1), row(2)};
  }

  const Scene& scene_;
  std::vector<Extent> extents_;
  std::size_t vertices_left_ = std::size_t{1} << 27U;
};

class Hasher {
 public:
  Hasher() { XXH3_64bits_reset(&state_); }
  template <class T>
  void add(const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    XXH3_64bits_update(&state_, &value, sizeof value);
  }
  template <class T>
  void add(const std::vector<T>& values) {
    add(std::uint64_t{values.size()});
    XXH3_64bits_update(&state_, values.data(), values.size() * sizeof(T));
  }
  void add(const Object& o) {
    add(o.node);
    add(o.instance);
    add(o.mesh);
    add(static_cast<std::uint8_t>(o.tag));
    add(static_cast<std::uint8_t>(o.always_visible));
    for (int c = 0; c < 4; ++c)
      for (int r = 0; r < 4; ++r)
        add(o.to_world[c][r]);
  }
  std::uint64_t digest() const { return XXH3_64bits_digest(&state_); }

 private:
  XXH3_state_t state_{};
};

/// The low 10 bits of v, two zero bits between each.
std::uint32_t spread3(std::uint32_t v) {
  v &= 0x3ffU;
  v = (v | (v << 16U)) & 0x030000ffU;
  v = (v | (v << 8U)) & 0x0300f00fU;
  v = (v | (v << 4U)) & 0x030c30c3U;
  v = (v | (v << 2U)) & 0x09249249U;
  return v;
}

}  // namespace

Status finish_scene(Scene& scene) {
  for (std::size_t m = 0; m < scene.meshes.size(); ++m)
    if (auto s = check_mesh(scene.meshes[m], m); !s) return s;
  scene.bounds = {};
  scene.triangle_count = 0;
  Bounds bounds(scene);
  for (auto* list : {&scene.objects, &scene.hidden_solids, &scene.wholes}) {
    for (Object& o : *list) {
      if (o.mesh >= scene.meshes.size())
        return input_error(describe(scene, o) + ": mesh " + std::to_string(o.mesh) +
                           ", expected below " + std::to_string(scene.meshes.size()));
      if (o.node >= scene.node_names.size()) scene.node_names.resize(std::size_t{o.node} + 1);
      if (!finite(o.to_world))
        return input_error(describe(scene, o) + ": its transform is not finite");
      o.bounds = bounds.of(o);
      if (!within_limit(o.bounds))
        return input_error(describe(scene, o) +
                           ": its world bounds are beyond 1e30 m or not finite");
      scene.bounds.add(o.bounds);
    }
  }
  for (const Object& o : scene.objects)
    scene.triangle_count += scene.mesh_of(o).triangles();

  Hasher hasher;
  for (const Mesh& m : scene.meshes) {
    hasher.add(m.positions);
    hasher.add(m.indices);
    for (const Primitive& p : m.primitives) {
      hasher.add(p.first_triangle);
      hasher.add(p.triangles);
      hasher.add(static_cast<std::uint8_t>(p.opaque));
      hasher.add(static_cast<std::uint8_t>(p.double_sided));
    }
  }
  for (const auto* list : {&scene.objects, &scene.hidden_solids}) {
    hasher.add(std::uint64_t{list->size()});
    for (const Object& o : *list)
      hasher.add(o);
  }
  hasher.add(static_cast<std::uint8_t>(scene.honour_sidedness));
  if (!scene.wholes.empty()) {  // else nothing: a scene that is not split keeps its hash
    for (const Object& o : scene.objects)
      hasher.add(o.cluster);
    hasher.add(std::uint64_t{scene.wholes.size()});
    for (const Object& o : scene.wholes)
      hasher.add(o);
  }
  scene.hash = hasher.digest();
  scene.whole_hash = scene.hash;
  return ok();
}

std::vector<ObjectId> rank_order(const Scene& scene) {
  Aabb centres;
  for (const Object& o : scene.objects)
    centres.add(o.bounds.centre());
  const Vec3 size = centres.size();
  const double extent = std::max({size.x, size.y, size.z, 1e-9});
  std::vector<std::uint32_t> code(scene.objects.size());
  for (std::size_t i = 0; i < code.size(); ++i) {
    const Vec3 p = (scene.objects[i].bounds.centre() - centres.lo) / extent * 1023.0;
    code[i] = spread3(static_cast<std::uint32_t>(p.x)) |
              (spread3(static_cast<std::uint32_t>(p.z)) << 1U) |
              (spread3(static_cast<std::uint32_t>(p.y)) << 2U);
  }
  std::vector<ObjectId> order(scene.objects.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(),
            [&](ObjectId a, ObjectId b) { return code[a] != code[b] ? code[a] < code[b] : a < b; });
  return order;
}

}  // namespace ivis
