#pragma once
// Vectors everyone speaks: metres, world space, right-handed, +Y up, double precision.

#include <cstdint>

#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>

namespace ivis {

using Vec2 = glm::dvec2;  ///< (x, z) in the ground plane
using Vec3 = glm::dvec3;
using Mat4 = glm::dmat4;

inline Vec2 ground(const Vec3& p) {
  return {p.x, p.z};
}

}  // namespace ivis
