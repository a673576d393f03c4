#pragma once
// Small meshes for the tests of this folder.

#include <initializer_list>
#include <vector>

#include "scenes/scene.h"

namespace ivis::test {

/// Faces are convex rings of corner numbers, counter-clockwise seen from outside.
inline Mesh mesh_of(const std::vector<Vec3>& corners,
                    const std::vector<std::vector<std::uint32_t>>& faces) {
  Mesh mesh;
  for (const Vec3& c : corners)
    mesh.positions.emplace_back(c);
  for (const auto& f : faces)
    for (std::size_t i = 2; i < f.size(); ++i)
      mesh.indices.insert(mesh.indices.end(), {f[0], f[i - 1], f[i]});
  mesh.primitives = {{0, static_cast<std::uint32_t>(mesh.triangles()), true, true}};
  return mesh;
}

inline Mesh box_mesh(const Vec3& lo, const Vec3& hi) {
  return mesh_of(
      {{lo.x, lo.y, lo.z},
       {hi.x, lo.y, lo.z},
       {hi.x, lo.y, hi.z},
       {lo.x, lo.y, hi.z},
       {lo.x, hi.y, lo.z},
       {hi.x, hi.y, lo.z},
       {hi.x, hi.y, hi.z},
       {lo.x, hi.y, hi.z}},
      {{0, 1, 2, 3}, {7, 6, 5, 4}, {0, 4, 5, 1}, {1, 5, 6, 2}, {2, 6, 7, 3}, {3, 7, 4, 0}});
}

/// 10 x 8 m, eaves at 5 m, ridge along x at 9 m.
inline Mesh gabled_house() {
  return mesh_of({{0, 0, 0},
                  {10, 0, 0},
                  {10, 0, 8},
                  {0, 0, 8},
                  {0, 5, 0},
                  {10, 5, 0},
                  {10, 5, 8},
                  {0, 5, 8},
                  {0, 9, 4},
                  {10, 9, 4}},
                 {{0, 1, 2, 3},
                  {0, 4, 5, 1},
                  {2, 6, 7, 3},
                  {1, 5, 9, 6, 2},
                  {3, 7, 8, 4, 0},
                  {4, 8, 9, 5},
                  {6, 9, 8, 7}});
}

/// Both meshes as one, sharing nothing.
inline Mesh joined(Mesh a, const Mesh& b) {
  const auto base = static_cast<std::uint32_t>(a.positions.size());
  a.positions.insert(a.positions.end(), b.positions.begin(), b.positions.end());
  for (const std::uint32_t i : b.indices)
    a.indices.push_back(base + i);
  a.primitives[0].triangles += b.primitives[0].triangles;
  return a;
}

inline Mesh turned_inside_out(Mesh m) {
  for (std::size_t i = 0; i < m.indices.size(); i += 3)
    std::swap(m.indices[i + 1], m.indices[i + 2]);
  return m;
}

}  // namespace ivis::test
