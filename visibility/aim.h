#pragma once

#include <cstdint>
#include <vector>

#include "core/math.h"
#include "scenes/scene.h"
#include "visibility/sampling.h"

namespace ivis {

/// Points of objects to aim rays at. Of every four, two are spread over the surface by area, one
/// goes to a triangle drawn at random whatever its size, and one near a corner, extreme corners
/// preferred: what peeks over a roof or past a wall does so corner first.
/// Threads:   const and reentrant. Ownership: borrows the scene.
/// Cost:      building O(triangles of the meshes), 4 bytes each.
class AimPoints {
 public:
  explicit AimPoints(const Scene& scene);

  struct Aim {
    Vec3 point{0};
    std::uint32_t triangle = 0;  ///< of the object's mesh; the point lies on it
  };
  /// The k-th of n aims at the object, which must have triangles.
  Aim aim(const Object& object, std::size_t k, std::size_t n, Random& random) const;

 private:
  struct MeshAims {
    std::vector<float> area_below;  ///< of the triangles up to and with this one, over the whole
    std::vector<std::uint32_t>
        extremes;  ///< index positions (3 t + k) of corners that stick out farthest
  };
  const Scene& scene_;
  std::vector<MeshAims> meshes_;
};

}  // namespace ivis
