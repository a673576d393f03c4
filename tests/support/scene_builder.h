#pragma once

#include <string>

#include "scenes/scene.h"

namespace ivis::test {

/// Small analytic scenes, built by hand. Every add_* gives the new object's id (its order of
/// adding).
class SceneBuilder {
 public:
  /// A closed box, outward winding.
  ObjectId add_box(const Vec3& lo, const Vec3& hi, OccluderTag tag = OccluderTag::kAuto,
                   bool opaque = true);
  /// A vertical prism over a ring in (x, z), positive shoelace area (see occluders/occluder_set.h);
  /// closed, outward winding.
  ObjectId add_prism(const std::vector<Vec2>& ring, double bottom, double top,
                     OccluderTag tag = OccluderTag::kAuto);
  /// An upright rectangle between two corners, without a solid.
  ObjectId add_sheet(const Vec3& lo, const Vec3& hi);
  /// A horizontal rectangle at y, two triangles.
  ObjectId add_ground(const Vec2& lo, const Vec2& hi, double y);
  ObjectId add_mesh(Mesh mesh, OccluderTag tag = OccluderTag::kAuto,
                    const Mat4& to_world = Mat4{1});
  void name_last(const std::string& name);
  /// Asserts that the scene is sound.
  Scene finish() &&;

 private:
  Scene scene_;
};

}  // namespace ivis::test
