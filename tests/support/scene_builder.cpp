#include "tests/support/scene_builder.h"

#include <utility>

namespace ivis::test {
namespace {

void add_quad(Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
  mesh.indices.insert(mesh.indices.end(), {a, b, c, a, c, d});
}

void close(Mesh& mesh, bool opaque = true) {
  mesh.primitives = {{0, static_cast<std::uint32_t>(mesh.triangles()), opaque, true}};
}

/// Ear clipping of a simple ring with positive shoelace area; test scenes only.
void triangulate(const std::vector<Vec2>& ring, const auto& emit) {
  std::vector<std::uint32_t> left(ring.size());
  for (std::uint32_t i = 0; i < left.size(); ++i)
    left[i] = i;
  const auto cross = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    const Vec2 u = ring[b] - ring[a];
    const Vec2 v = ring[c] - ring[a];
    return u.x * v.y - u.y * v.x;
  };
  while (left.size() >= 3) {
    bool clipped = false;
    for (std::size_t i = 0; i < left.size() && !clipped; ++i) {
      const auto a = left[(i + left.size() - 1) % left.size()];
      const auto b = left[i];
      const auto c = left[(i + 1) % left.size()];
      if (cross(a, b, c) <= 0) continue;
      bool ear = true;
      for (const auto p : left)
        if (p != a && p != b && p != c && cross(a, b, p) >= 0 && cross(b, c, p) >= 0 &&
            cross(c, a, p) >= 0)
          ear = false;
      if (!ear) continue;
      emit(a, b, c);
      left.erase(left.begin() + static_cast<std::ptrdiff_t>(i));
      clipped = true;
    }
    IVIS_ASSERT(clipped, "the ring of a test prism is simple and positively oriented");
  }
}

}  // namespace

ObjectId SceneBuilder::add_mesh(Mesh mesh, OccluderTag tag, const Mat4& to_world) {
  Object o;
  o.node = static_cast<std::uint32_t>(scene_.objects.size() + scene_.hidden_solids.size());
  o.mesh = static_cast<std::uint32_t>(scene_.meshes.size());
  o.tag = tag;
  o.to_world = to_world;
  scene_.meshes.push_back(std::move(mesh));
  scene_.node_names.emplace_back();
  if (tag == OccluderTag::kOnly) {
    scene_.hidden_solids.push_back(o);
    return ~0U;
  }
  scene_.objects.push_back(o);
  return static_cast<ObjectId>(scene_.objects.size() - 1);
}

void SceneBuilder::name_last(const std::string& name) {
  scene_.node_names.back() = name;
}

ObjectId SceneBuilder::add_prism(const std::vector<Vec2>& ring, double bottom, double top,
                                 OccluderTag tag) {
  Mesh mesh;
  const auto n = static_cast<std::uint32_t>(ring.size());
  for (const double y : {bottom, top})
    for (const Vec2& p : ring)
      mesh.positions.emplace_back(p.x, y, p.y);
  // Positive area in (x, z) with z up the page is clockwise seen from above (+Y towards the
  // reader).
  for (std::uint32_t i = 0; i < n; ++i)
    add_quad(mesh, i, n + i, n + (i + 1) % n, (i + 1) % n);
  triangulate(ring, [&](auto a, auto b, auto c) {
    mesh.indices.insert(mesh.indices.end(), {a, b, c, n + a, n + c, n + b});
  });
  close(mesh);
  return add_mesh(std::move(mesh), tag);
}

ObjectId SceneBuilder::add_box(const Vec3& lo, const Vec3& hi, OccluderTag tag, bool opaque) {
  const ObjectId id =
      add_prism({{lo.x, lo.z}, {hi.x, lo.z}, {hi.x, hi.z}, {lo.x, hi.z}}, lo.y, hi.y, tag);
  scene_.meshes.back().primitives[0].opaque = opaque;
  return id;
}

ObjectId SceneBuilder::add_sheet(const Vec3& lo, const Vec3& hi) {
  Mesh mesh;
  mesh.positions = {lo, {hi.x, lo.y, hi.z}, hi, {lo.x, hi.y, lo.z}};
  add_quad(mesh, 0, 1, 2, 3);
  close(mesh);
  return add_mesh(std::move(mesh));
}
ObjectId SceneBuilder::add_ground(const Vec2& lo, const Vec2& hi, double y) {
  Mesh mesh;
  mesh.positions = {{lo.x, y, lo.y}, {lo.x, y, hi.y}, {hi.x, y, hi.y}, {hi.x, y, lo.y}};
  add_quad(mesh, 0, 1, 2, 3);
  close(mesh);
  return add_mesh(std::move(mesh));
}

Scene SceneBuilder::finish() && {
  const auto status = finish_scene(scene_);
  IVIS_ASSERT(status, status ? "" : status.error().message.c_str());
  return std::move(scene_);
}

}  // namespace ivis::test
