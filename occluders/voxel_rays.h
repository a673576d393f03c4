#pragma once
// Rays through a voxel grid and the triangles in it.

#include <cmath>
#include <limits>

#include "occluders/voxel_grid.h"

namespace ivis {

/// Where the ray org + t dir meets the triangle, grown by `tolerance` (voxels) within its plane;
/// infinity when it does not. A ray that runs within the plane does not meet it.
inline double meets(const GridTriangle& tri, const Vec3& org, const Vec3& dir, double tolerance) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const Vec3 e1 = tri.v[1] - tri.v[0];
  const Vec3 e2 = tri.v[2] - tri.v[0];
  const Vec3 n = glm::cross(e1, e2);
  const double area = glm::length(n);
  const double along = glm::dot(n, dir);
  if (area == 0 || std::abs(along) <= 1e-12 * area * glm::length(dir)) return kNever;
  const double t = glm::dot(n, tri.v[0] - org) / along;
  if (!(t >= 0)) return kNever;
  const Vec3 q = org + t * dir - tri.v[0];
  const double u = glm::dot(glm::cross(q, e2), n) / area;
  const double v = glm::dot(glm::cross(e1, q), n) / area;
  if (u < -tolerance * glm::length(e2) || v < -tolerance * glm::length(e1)) return kNever;
  if (area - u - v < -tolerance * glm::length(e2 - e1)) return kNever;
  return t;
}

/// Calls visit(label, voxel) for each unmarked voxel that the segment from org (inside the grid) to
/// org + dir runs through before it meets a triangle; stops when that says false.
/// A triangle that crosses the segment lies in a marked voxel on it, give or take the rounding that
/// marking allows for, so only the triangles of tiles met need be looked at.
template <class F>
void walk_ray(const VoxelGrid& grid, const Vec3& org, const Vec3& dir, double tolerance,
              const F& visit) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  IVec3 v{static_cast<std::int32_t>(std::floor(org.x)),
          static_cast<std::int32_t>(std::floor(org.y)),
          static_cast<std::int32_t>(std::floor(org.z))};
  std::int32_t* const at[3] = {&v.x, &v.y, &v.z};
  double next[3];
  double delta[3];
  for (int a = 0; a < 3; ++a) {
    delta[a] = dir[a] != 0 ? 1 / std::abs(dir[a]) : kNever;
    const double to = dir[a] > 0 ? *at[a] + 1 - org[a] : org[a] - *at[a];
    next[a] = dir[a] != 0 ? to * delta[a] : kNever;
  }
  double hit = 1;
  double t = 0;
  std::uint32_t last = VoxelGrid::kMarked;
  while (t < hit && grid.inside(v)) {
    const std::uint32_t entry = grid.table[grid.tile_index({v.x >> 3, v.y >> 3, v.z >> 3})];
    if ((entry & VoxelGrid::kAir) == 0 && entry != last) {
      last = entry;
      for (std::uint32_t i = grid.mixed[entry].first_triangle;
           i < grid.mixed[entry + 1].first_triangle; ++i)
        hit = std::fmin(hit, meets(grid.triangles[grid.tile_triangles[i]], org, dir, tolerance));
      if (!(t < hit)) return;
    }
    const std::uint32_t label = grid.label_at(v);
    if (label != VoxelGrid::kMarked && !visit(label, v)) return;
    const int a = next[0] < next[1] ? (next[0] < next[2] ? 0 : 2) : (next[1] < next[2] ? 1 : 2);
    t = next[a];
    next[a] += delta[a];
    *at[a] += dir[a] > 0 ? 1 : -1;
  }
}

}  // namespace ivis
