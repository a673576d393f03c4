#include "scenes/wall_windows.h"

#include <algorithm>
#include <cmath>

namespace ivis {
namespace {

Vec2 outwards(const WallPlane& w) {
  return {w.along.y, -w.along.x};
}

/// How far before (and behind) a wall the raster is asked: past the half diagonal of a cell, so
/// that the answer is not about the wall itself.
double probe_m(const CoverRaster& cover) {
  return 0.4 + 0.8 * cover.cell_m();
}

bool in_triangle(const std::array<Vec2, 3>& t, const Vec2& p) {
  const auto side = [&](int a, int b) {
    const Vec2 u = t[static_cast<std::size_t>(b)] - t[static_cast<std::size_t>(a)];
    const Vec2 v = p - t[static_cast<std::size_t>(a)];
    return u.x * v.y - u.y * v.x;
  };
  const double a = side(0, 1);
  const double b = side(1, 2);
  const double c = side(2, 0);
  return (a >= 0 && b >= 0 && c >= 0) || (a <= 0 && b <= 0 && c <= 0);
}

/// Nine points of the rectangle decide; walls with holes smaller than a third of a window do not
/// matter here.
bool on_wall(const WallPlane& wall, const Vec2& lo, const Vec2& hi) {
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < 3; ++i) {
      const Vec2 p = lo + (hi - lo) * Vec2(i * 0.5, k * 0.5);
      if (std::none_of(wall.triangles.begin(), wall.triangles.end(),
                       [&](const auto& t) { return in_triangle(t, p); }))
        return false;
    }
  return true;
}

}  // namespace

std::vector<WallPlane> outer_walls(const Scene& scene, const Object& object,
                                   const CoverRaster& cover) {
  std::vector<WallPlane> walls;
  const Mesh& mesh = scene.mesh_of(object);
  for (std::size_t t = 0; t < mesh.triangles(); ++t) {
    const Triangle w = world_triangle(scene, object, t);
    const Vec3 n = glm::cross(w.b - w.a, w.c - w.a);
    const double length = glm::length(n);
    if (length < 0.2 || std::abs(n.y) > 0.02 * length) continue;
    const Vec2 out = glm::normalize(Vec2(n.x, n.z));
    const Vec2 along(-out.y, out.x);
    WallPlane* wall = nullptr;
    for (WallPlane& other : walls)
      if (glm::dot(other.along, along) > 0.9999 &&
          std::abs(glm::dot(ground(w.a) - other.origin, outwards(other))) < 0.03)
        wall = &other;
    if (wall == nullptr) {
      walls.push_back({ground(w.a), along, 0, 0, w.a.y, w.a.y, {}});
      wall = &walls.back();
    }
    std::array<Vec2, 3> flat;
    const std::array<Vec3, 3> corners{w.a, w.b, w.c};
    for (std::size_t k = 0; k < 3; ++k) {
      flat[k] = {glm::dot(ground(corners[k]) - wall->origin, wall->along), corners[k].y};
      wall->from = std::min(wall->from, flat[k].x);
      wall->to = std::max(wall->to, flat[k].x);
      wall->bottom = std::min(wall->bottom, flat[k].y);
      wall->top = std::max(wall->top, flat[k].y);
    }
    wall->triangles.push_back(flat);
  }
  // Winding is not to be trusted: the side that the building stands on is inside.
  const double probe = probe_m(cover);
  std::vector<WallPlane> outer;
  for (WallPlane& wall : walls) {
    if (wall.to - wall.from < 2 || wall.top - wall.bottom < 2.2) continue;
    const Vec2 middle = wall.origin + wall.along * ((wall.from + wall.to) / 2);
    const double level = (wall.bottom + wall.top) / 2;
    const bool behind = cover.top(middle - outwards(wall) * probe) > level;
    const bool before = cover.top(middle + outwards(wall) * probe) > level;
    if (behind == before && (before || wall.to - wall.from < 2 * probe)) continue;
    if (before && !behind) {
      wall.along = -wall.along;
      std::swap(wall.from, wall.to);
      wall.from = -wall.from;
      wall.to = -wall.to;
      for (auto& t : wall.triangles)
        for (Vec2& p : t)
          p.x = -p.x;
    }
    outer.push_back(std::move(wall));
  }
  return outer;
}

void hang_windows(const std::vector<WallPlane>& walls, double bay_m, const HeightGrid& ground,
                  const CoverRaster& cover, Random random, PartList& parts) {
  const double storey = random.in(3.0, 3.6);
  const double width = std::min(random.in(1.0, 1.5), 0.7 * bay_m);
  const double height = random.in(1.4, 1.9);
  const double bay = bay_m * random.in(0.85, 1.15);
  for (const WallPlane& wall : walls) {
    const double length = wall.to - wall.from;
    const auto bays = static_cast<std::size_t>((length - 0.4) / bay);
    if (bays == 0) continue;
    const double pitch = length / static_cast<double>(bays);
    const auto at = [&](double s) { return wall.origin + wall.along * s; };
    const Vec2 out = outwards(wall);
    const double street = std::max(
        {wall.bottom, ground.height(at(wall.from) + out), ground.height(at(wall.to) + out)});
    for (std::size_t floor = 0;
         street + static_cast<double>(floor) * storey + 1.0 + height < wall.top && floor < 60;
         ++floor) {
      const double sill = street + static_cast<double>(floor) * storey + 0.9;
      for (std::size_t i = 0; i < bays; ++i) {
        const double s = wall.from + pitch * (static_cast<double>(i) + 0.5);
        const Vec2 p = at(s);
        if (!on_wall(wall, {s - width / 2 - 0.15, sill - 0.15},
                     {s + width / 2 + 0.15, sill + height + 0.15}))
          continue;
        if (cover.top(p + out * probe_m(cover)) > sill) continue;
        parts.add(Part::kWindowPlain, {p.x, sill, p.y}, out, {width, height, 1});
      }
    }
  }
}

}  // namespace ivis
