#include "visibility/map_frame.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

namespace ivis {
namespace {

constexpr double kWorthwhile = 0.8;             ///< of the boxes' surfaces
constexpr std::size_t kMostSamples = 200000;    ///< triangles looked at
constexpr std::size_t kMostVertices = 4000000;  ///< whose turned boxes are compared
constexpr double kCellsAUnit = 32;              ///< of the grid that directions are counted in
constexpr double kSquare = 0.02;  ///< cosine of directions that count as perpendicular

double surface(const Aabb& b) {
  const Vec3 s = b.size();
  return s.x * s.y + s.y * s.z + s.z * s.x;
}

/// Twice-area normals of evenly picked triangles, of either sign.
std::vector<Vec3> normals(const Scene& scene) {
  std::size_t triangles = 0;
  for (const Object& o : scene.objects)
    triangles += scene.mesh_of(o).triangles();
  const std::size_t step = triangles / kMostSamples + 1;
  std::vector<Vec3> out;
  std::size_t next = 0;
  std::size_t first = 0;
  for (const Object& o : scene.objects) {
    const std::size_t count = scene.mesh_of(o).triangles();
    for (; next < first + count; next += step) {
      const Triangle t = world_triangle(scene, o, next - first);
      const Vec3 n = glm::cross(t.b - t.a, t.c - t.a);
      if (glm::length(n) > 1e-12 && std::isfinite(glm::length(n))) out.push_back(n);
    }
    first += count;
  }
  return out;
}

/// The direction, up to its sign, that most area faces; of those perpendicular to `to` if given.
std::optional<Vec3> commonest(const std::vector<Vec3>& normals, const Vec3* to) {
  struct Bin {
    double area = 0;
    Vec3 sum{0};
  };
  std::map<std::array<long, 3>, Bin> bins;
  for (Vec3 n : normals) {
    const double area = glm::length(n);
    if (to != nullptr && std::abs(glm::dot(n, *to)) > kSquare * area) continue;
    if (n.x < 0 || (n.x == 0 && (n.y < 0 || (n.y == 0 && n.z < 0)))) n = -n;
    const Vec3 cell = n / area * kCellsAUnit;
    Bin& bin = bins[{std::lround(cell.x), std::lround(cell.y), std::lround(cell.z)}];
    bin.area += area;
    bin.sum += n;
  }
  const auto best = std::max_element(bins.begin(), bins.end(), [](const auto& a, const auto& b) {
    return a.second.area < b.second.area;
  });
  if (best == bins.end() || !(glm::length(best->second.sum) > 0)) return std::nullopt;
  return glm::normalize(best->second.sum);
}

}  // namespace

Aabb bounds_in(const MapFrame& frame, const Scene& scene, const Object& object) {
  Aabb box;
  if (!frame.turned) {
    box.add(object.bounds.lo - frame.origin);
    box.add(object.bounds.hi - frame.origin);
    return box;
  }
  const Mesh& mesh = scene.mesh_of(object);
  for (const auto& p : mesh.positions)
    box.add(frame.to_map(Vec3(object.to_world * glm::dvec4(Vec3(p), 1.0))));
  if (box.empty()) box.add(frame.to_map(Vec3(object.to_world[3])));
  // What transforms may round, far below any slack.
  const Vec3 far = glm::max(glm::abs(object.bounds.lo), glm::abs(object.bounds.hi));
  const double grow = 1e-12 * (far.x + far.y + far.z + glm::length(frame.origin));
  box.lo -= Vec3{grow};
  box.hi += Vec3{grow};
  return box;
}

Aabb bounds_in(const MapFrame& frame, const Scene& scene) {
  Aabb box;
  if (!frame.turned) {
    if (scene.bounds.empty()) return box;
    box.add(scene.bounds.lo - frame.origin);
    box.add(scene.bounds.hi - frame.origin);
    return box;
  }
  for (const auto* list : {&scene.objects, &scene.hidden_solids, &scene.wholes})
    for (const Object& o : *list)
      box.add(bounds_in(frame, scene, o));
  return box;
}

MapFrame choose_frame(const Scene& scene, double slack_m) {
  MapFrame plain;
  if (scene.bounds.empty()) return plain;
  plain.origin = scene.bounds.centre();
  const std::vector<Vec3> faces = normals(scene);
  const auto a = commonest(faces, nullptr);
  if (!a) return plain;
  const auto b = commonest(faces, &*a);
  if (!b) return plain;
  MapFrame turned = plain;
  turned.turned = true;
  // `a` is up where the scene is a turned city, so that it becomes the maps' second axis.
  const Vec3 x = glm::normalize(*b - *a * glm::dot(*a, *b));
  turned.turn = glm::transpose(glm::dmat3(x, *a, glm::cross(x, *a)));
  // Instances of large meshes may have far more vertices than the file: no turning then.
  std::size_t vertices = 0;
  for (const auto* list : {&scene.objects, &scene.hidden_solids, &scene.wholes})
    for (const Object& o : *list)
      vertices += scene.mesh_of(o).positions.size();
  if (vertices > kMostVertices) return plain;
  double before = 0;
  double after = 0;
  for (const Object& o : scene.objects) {
    if (o.always_visible) continue;
    before += surface(o.bounds);
    after += surface(bounds_in(turned, scene, o));
  }
  if (!(after < kWorthwhile * before)) return plain;
  // OccluderSet::slack_m pays for coordinates up to the scene's half extent; these must be no
  // worse.
  const Aabb all = bounds_in(turned, scene);
  const Vec3 far = glm::max(glm::abs(all.lo), glm::abs(all.hi));
  // Prisms drawn down to the floor may reach as far as the corners of the world's box, and a metre.
  const double drawn = glm::length(scene.bounds.size()) / 2 + 1;
  const auto extent = static_cast<float>(std::max({far.x, far.y, far.z, drawn}));
  const float next = std::nextafter(extent, std::numeric_limits<float>::infinity());
  if (!(4 * (static_cast<double>(next) - static_cast<double>(extent)) <= slack_m)) return plain;
  return turned;
}

}  // namespace ivis
