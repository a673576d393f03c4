#include "visibility/aim.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace ivis {
namespace {

/// Faces' centres and corners of the cube.
std::vector<Vec3> outward_directions() {
  std::vector<Vec3> directions;
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z)
        if (const int n = std::abs(x) + std::abs(y) + std::abs(z); n == 1 || n == 3)
          directions.push_back(glm::normalize(Vec3{x, y, z}));
  return directions;
}

}  // namespace

AimPoints::AimPoints(const Scene& scene) : scene_(scene), meshes_(scene.meshes.size()) {
  const std::vector<Vec3> directions = outward_directions();
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const Mesh& mesh = scene.meshes[m];
    MeshAims& aims = meshes_[m];
    std::vector<double> sums;
    double total = 0;
    for (std::size_t t = 0; t < mesh.triangles(); ++t) {
      const Vec3 a(mesh.positions[mesh.indices[3 * t]]);
      const Vec3 b(mesh.positions[mesh.indices[3 * t + 1]]);
      const Vec3 c(mesh.positions[mesh.indices[3 * t + 2]]);
      total += glm::length(glm::cross(b - a, c - a));
      sums.push_back(total);
    }
    for (std::size_t t = 0; t < sums.size(); ++t)
      aims.area_below.push_back(static_cast<float>(
          total > 0 ? sums[t] / total
                    : static_cast<double>(t + 1) / static_cast<double>(sums.size())));
    for (const Vec3& d : directions) {
      double most = -std::numeric_limits<double>::infinity();
      std::uint32_t corner = 0;
      for (std::uint32_t i = 0; i < mesh.indices.size(); ++i)
        if (const double along = glm::dot(d, Vec3(mesh.positions[mesh.indices[i]])); along > most) {
          most = along;
          corner = i;
        }
      if (!mesh.indices.empty() &&
          std::find(aims.extremes.begin(), aims.extremes.end(), corner) == aims.extremes.end())
        aims.extremes.push_back(corner);
    }
  }
}

AimPoints::Aim AimPoints::aim(const Object& object, std::size_t k, std::size_t n,
                              Random& random) const {
  const Mesh& mesh = scene_.mesh_of(object);
  const MeshAims& aims = meshes_[object.mesh];
  const auto triangles = static_cast<std::uint32_t>(mesh.triangles());
  std::array<double, 3> weight;
  std::uint32_t triangle = 0;
  if (k % 4 == 3) {
    const std::uint32_t corner =
        (k / 4) % 4 != 3
            ? aims.extremes[random.below(static_cast<std::uint32_t>(aims.extremes.size()))]
            : random.below(3 * triangles);
    // Pulled inwards, a little more or less each time: the corner itself is a point of three faces.
    const double pull = 0.002 + 0.05 * random.unit();
    const double share = random.unit();
    triangle = corner / 3;
    weight[corner % 3] = 1 - pull;
    weight[(corner + 1) % 3] = pull * share;
    weight[(corner + 2) % 3] = pull * (1 - share);
  } else {
    if (k % 4 == 2) {
      triangle = random.below(triangles);
    } else {
      const std::size_t strata = std::max<std::size_t>(1, (n + 1) / 2);
      const std::size_t stratum = k / 4 * 2 + k % 4;
      const double at =
          (static_cast<double>(stratum % strata) + random.unit()) / static_cast<double>(strata);
      const auto it =
          std::upper_bound(aims.area_below.begin(), aims.area_below.end(), static_cast<float>(at));
      triangle = std::min(static_cast<std::uint32_t>(it - aims.area_below.begin()), triangles - 1);
    }
    double s = random.unit();
    double t = random.unit();
    if (s + t > 1) {
      s = 1 - s;
      t = 1 - t;
    }
    weight = {1 - s - t, s, t};
  }
  Vec3 local{0};
  for (std::size_t c = 0; c < 3; ++c)
    local += weight[c] * Vec3(mesh.positions[mesh.indices[3 * std::size_t{triangle} + c]]);
  return {Vec3(object.to_world * glm::dvec4(local, 1.0)), triangle};
}

}  // namespace ivis
