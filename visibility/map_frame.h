#pragma once

#include "core/aabb.h"
#include "core/math.h"
#include "scenes/scene.h"

namespace ivis {

/// Coordinates in which a perspective map works: relative to an origin and, where that makes boxes
/// tighter, turned, so that what the scene's faces are parallel to are its axes.
struct MapFrame {
  Vec3 origin{0};
  bool turned = false;
  glm::dmat3 turn{1};  ///< a rotation

  Vec3 direction(const Vec3& d) const { return turned ? turn * d : d; }
  Vec3 to_map(const Vec3& p) const { return direction(p - origin); }
};

/// About the middle of the scene's bounds; turned to the two commonest directions of its faces if
/// the surfaces of all objects' boxes together become a fifth smaller by that, and if single
/// precision of the turned coordinates is within `slack_m` as it is within the scene's own.
/// Cost: O(objects), and O(vertices) where it turns. The same for the same scene.
MapFrame choose_frame(const Scene& scene, double slack_m);

/// In map coordinates: a box that holds all of the object's vertices.
Aabb bounds_in(const MapFrame& frame, const Scene& scene, const Object& object);
/// In map coordinates: all that Scene::bounds holds.
Aabb bounds_in(const MapFrame& frame, const Scene& scene);

}  // namespace ivis
