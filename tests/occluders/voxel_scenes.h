#pragma once
// Scenes for the voxel tests, and an oracle that knows nothing of voxels.

#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "core/view_cell.h"
#include "occluders/voxel_solids.h"
#include "tests/occluders/mesh_shapes.h"
#include "tests/support/scene_builder.h"

namespace ivis::test {

inline Mesh quad_mesh(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  return mesh_of({a, b, c, d}, {{0, 1, 2, 3}});
}

/// 10 x 5 x 8 m of slabs 0.2 m thick that touch or overlap; in the wall at z = 0 an opening from
/// x = 4 on, from the floor up.
inline void add_house(SceneBuilder& b, double width, double height, const Mat4& m = Mat4{1},
                      OccluderTag tag = OccluderTag::kAuto) {
  const auto slab = [&](const Vec3& lo, const Vec3& hi) { b.add_mesh(box_mesh(lo, hi), tag, m); };
  slab({0, 0, 0}, {10, 0.2, 8});
  slab({0, 4.8, 0}, {10, 5, 8});
  slab({0, 0, 0}, {0.2, 5, 8});
  slab({9.8, 0, 0}, {10, 5, 8});
  slab({0, 0, 7.8}, {10, 5, 8});
  slab({0, 0, 0}, {4, 5, 0.2});
  slab({4 + width, 0, 0}, {10, 5, 0.2});
  if (width > 0) slab({4, height, 0}, {4 + width, 5, 0.2});
}

inline Mat4 turned(double about_y, double about_x, const Vec3& to = Vec3{0}) {
  const double c = std::cos(about_y);
  const double s = std::sin(about_y);
  const double d = std::cos(about_x);
  const double t = std::sin(about_x);
  Mat4 m{1};
  m[0] = {c, 0, -s, 0};
  m[1] = {s * t, d, c * t, 0};
  m[2] = {s * d, -t, c * d, 0};
  m[3] = {to, 1};
  return m;
}

/// Opaque triangles that block and may be taken as occluders.
inline std::vector<Triangle> blockers_of(const Scene& scene) {
  std::vector<Triangle> out;
  for (const auto* list : {&scene.objects, &scene.hidden_solids})
    for (const Object& o : *list)
      for (const Primitive& p : scene.mesh_of(o).primitives)
        if (p.opaque && o.tag != OccluderTag::kNever)
          for (std::uint32_t t = 0; t < p.triangles; ++t)
            out.push_back(world_triangle(scene, o, p.first_triangle + t));
  return out;
}

inline bool blocked(const std::vector<Triangle>& triangles, const Vec3& p, const Vec3& q) {
  const Vec3 d = q - p;
  for (const Triangle& t : triangles) {
    const Vec3 e1 = t.b - t.a;
    const Vec3 e2 = t.c - t.a;
    const Vec3 h = glm::cross(d, e2);
    const double det = glm::dot(e1, h);
    if (det == 0) continue;
    const Vec3 s = p - t.a;
    const double u = glm::dot(s, h) / det;
    if (u < -1e-12 || u > 1 + 1e-12) continue;
    const Vec3 r = glm::cross(s, e1);
    const double v = glm::dot(d, r) / det;
    if (v < -1e-12 || u + v > 1 + 1e-12) continue;
    const double w = glm::dot(e2, r) / det;
    if (w >= 0 && w <= 1) return true;
  }
  return false;
}

/// A vector at the border of V + B(margin).
inline Vec3 extreme_move(const Reach& reach, double margin, std::mt19937& rng) {
  std::uniform_real_distribution<double> u(-1, 1);
  const auto points = reach.extreme_points(40);
  Vec3 b{u(rng), u(rng), u(rng)};
  b *= margin / std::max(1e-9, glm::length(b));
  return points[rng() % points.size()] + b;
}

struct Census {
  std::size_t targets = 0;
  std::size_t free_points = 0;
  std::size_t seen = 0;  ///< targets that a sight line from the observers' space reaches
  Vec3 from{0}, to{0};   ///< one of them
};

/// Walks about the observers' space by unobstructed segments, and looks from there at what the
/// pieces, moved by the reach and margin, take for solid.
inline Census look_at_solids(const Scene& scene, const OccluderSet& set, unsigned seed,
                             std::size_t looks = 1500, std::size_t first_piece = 0) {
  Census out;
  const auto triangles = blockers_of(scene);
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> u(0, 1);
  const Vec3 lo = scene.bounds.lo - 3.0;
  const Vec3 size = scene.bounds.size() + 6.0;
  const auto anywhere = [&] { return lo + Vec3(u(rng), u(rng), u(rng)) * size; };
  std::vector<Vec3> free = set.view_space.seeds;
  if (set.view_space.kind == ViewSpace::Kind::kOutside)
    for (int i = 0; i < 20; ++i) {
      Vec3 p = anywhere();
      p[static_cast<int>(rng() % 3)] = (rng() % 2 == 0) ? lo.x - 1e3 : lo.x + size.x + 1e3;
      if (!scene.bounds.contains(p)) free.push_back(p);
    }
  for (int i = 0; i < 3000 && free.size() < 500; ++i) {
    const Vec3 p = free[rng() % free.size()];
    const Vec3 q = i % 2 == 0 ? anywhere() : p + 2.0 * (Vec3(u(rng), u(rng), u(rng)) - 0.5);
    if (!blocked(triangles, p, q)) free.push_back(q);
  }
  out.free_points = free.size();
  const Reach reach = padded(set.reach, set.slack_m);
  std::vector<std::pair<const FaceMesh*, double>> meshes;
  for (std::size_t p = first_piece; p < set.solid_pieces.size(); ++p)
    for (std::size_t k = 0; k < set.solid_pieces[p].levels.size(); ++k)
      if (!set.solid_pieces[p].levels[k].empty())
        meshes.emplace_back(&set.solid_pieces[p].levels[k], set.margins_m[k]);
  if (meshes.empty()) return out;
  for (std::size_t i = 0; i < looks; ++i) {
    const auto& [mesh, margin] = meshes[rng() % meshes.size()];
    const auto& face = mesh->faces[rng() % mesh->faces.size()];
    const double s = u(rng);
    const double t = u(rng);
    const Vec3 x = glm::mix(glm::mix(mesh->points[face[0]], mesh->points[face[1]], s),
                            glm::mix(mesh->points[face[3]], mesh->points[face[2]], s), t);
    const Vec3 y = x + extreme_move(reach, margin, rng) * (u(rng) < 0.7 ? 1 - 1e-6 : u(rng));
    ++out.targets;
    for (int k = 0; k < 4; ++k) {
      const Vec3 p = free[rng() % free.size()];
      if (blocked(triangles, p, y)) continue;
      ++out.seen;
      out.from = p;
      out.to = y;
    }
  }
  return out;
}

/// Does a piece of that level hold p? p must not lie in the plane of a face.
inline bool in_pieces(const OccluderSet& set, std::size_t level, const Vec3& p) {
  for (const SolidPiece& piece : set.solid_pieces) {
    if (level >= piece.levels.size()) continue;
    const FaceMesh& mesh = piece.levels[level];
    int winding = 0;
    for (const auto& f : mesh.faces) {
      Vec3 lo = mesh.points[f[0]];
      Vec3 hi = lo;
      for (const std::uint32_t c : f) {
        lo = glm::min(lo, mesh.points[c]);
        hi = glm::max(hi, mesh.points[c]);
      }
      if (lo.x != hi.x || lo.x < p.x || p.y < lo.y || p.y > hi.y || p.z < lo.z || p.z > hi.z)
        continue;
      const Vec3 n =
          glm::cross(mesh.points[f[1]] - mesh.points[f[0]], mesh.points[f[2]] - mesh.points[f[0]]);
      winding += n.x > 0 ? 1 : -1;
    }
    if (winding > 0) return true;
  }
  return false;
}

inline OccluderSet set_for(const Reach& reach, ViewSpace space = {},
                           std::vector<double> margins = {}) {
  OccluderSet set;
  set.reach = reach;
  set.view_space = std::move(space);
  set.margins_m = std::move(margins);
  return set;
}

}  // namespace ivis::test
