#include "occluders/polyhedron.h"

#include <algorithm>
#include <cmath>

namespace ivis {
namespace {

constexpr std::size_t kMostFaces = 20'000;  ///< of a shrunk solid; more would take long

using Corners = std::array<Vec3, 3>;

/// Does a plane part triangle `a`, thickened by the box, from triangle `b`? The directions that can
/// be normal to one that touches both: of faces, and of pairs of edges.
bool apart(const Corners& a, const Corners& b, const Vec3& half) {
  const auto parts = [&](const Vec3& axis) {
    const double size = glm::length(axis);
    if (!(size > 0)) return false;
    const auto [a0, a1] =
        std::minmax({glm::dot(axis, a[0]), glm::dot(axis, a[1]), glm::dot(axis, a[2])});
    const auto [b0, b1] =
        std::minmax({glm::dot(axis, b[0]), glm::dot(axis, b[1]), glm::dot(axis, b[2])});
    const double reach = glm::dot(glm::abs(axis), half);
    return a1 + reach < b0 || b1 < a0 - reach;
  };
  const Vec3 units[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (const Vec3& u : units)
    if (parts(u)) return true;
  const Vec3 ea[3] = {a[1] - a[0], a[2] - a[1], a[0] - a[2]};
  const Vec3 eb[3] = {b[1] - b[0], b[2] - b[1], b[0] - b[2]};
  if (parts(glm::cross(ea[0], ea[1])) || parts(glm::cross(eb[0], eb[1]))) return true;
  for (const Vec3& e : eb) {
    for (const Vec3& u : units)
      if (parts(glm::cross(e, u))) return true;
    for (const Vec3& f : ea)
      if (parts(glm::cross(e, f))) return true;
  }
  for (const Vec3& f : ea)
    for (const Vec3& u : units)
      if (parts(glm::cross(f, u))) return true;
  return false;
}

bool odd_along(const std::vector<Corners>& surface, const Vec3& p, const Vec3& d) {
  bool in = false;
  for (const Corners& t : surface) {
    const Vec3 n = glm::cross(t[1] - t[0], t[2] - t[0]);
    const double speed = glm::dot(n, d);
    if (speed == 0) continue;
    const double at = glm::dot(n, t[0] - p) / speed;
    if (at <= 0) continue;
    const Vec3 x = p + d * at;
    bool left = true;
    bool right = true;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3& from = t[i];
      const Vec3& to = t[(i + 1) % 3];
      const double side = glm::dot(glm::cross(to - from, x - from), n);
      left = left && side >= 0;
      right = right && side <= 0;
    }
    if (left || right) in = !in;
  }
  return in;
}

enum class Place { kOut, kIn, kUnsure };

/// Parity along three directions: one that meets an edge is outvoted by none.
Place place(const std::vector<Corners>& surface, const Vec3& p) {
  const Vec3 directions[3] = {glm::normalize(Vec3{0.4131592, 0.7538271, 0.5110713}),
                              glm::normalize(Vec3{-0.6180339, 0.3247179, 0.7159217}),
                              glm::normalize(Vec3{0.2718281, -0.5772156, 0.7700433})};
  int in = 0;
  for (const Vec3& d : directions)
    in += odd_along(surface, p, d) ? 1 : 0;
  return in == 0 ? Place::kOut : in == 3 ? Place::kIn : Place::kUnsure;
}

}  // namespace

bool within_box_erosion(const FaceMesh& mesh, const Polyhedron& solid, const Vec3& half) {
  if (mesh.empty() || mesh.faces.size() > kMostFaces || !(half.x > 0 && half.y > 0 && half.z > 0))
    return false;
  std::vector<Corners> faces;
  for (const auto& f : mesh.faces)
    for (std::size_t i = 2; i < 4; ++i)
      if (i == 2 || f[3] != f[2])
        faces.push_back({mesh.points[f[0]], mesh.points[f[i - 1]], mesh.points[f[i]]});
  std::vector<Corners> surface;
  for (const auto& t : solid.triangles)
    surface.push_back({solid.points[t[0]], solid.points[t[1]], solid.points[t[2]]});
  for (const Corners& f : faces)
    for (const Corners& s : surface)
      if (!apart(f, s, half)) return false;
  for (const Corners& f : faces)
    for (const Vec3& p : f)
      if (place(surface, p) != Place::kIn) return false;
  for (const Corners& s : surface)
    for (const Vec3& p : s)
      if (place(faces, p) != Place::kOut) return false;
  return true;
}

}  // namespace ivis
