#pragma once

#include <cstdint>
#include <vector>

#include "scenes/scene.h"

namespace ivis {

/// A triangle of an object, or of a hidden solid.
struct TriangleRef {
  std::uint32_t solid = 0;     ///< ObjectId, or objects.size() + index into Scene::hidden_solids
  std::uint32_t triangle = 0;  ///< of the solid's mesh
};

/// What rays may not cross (docs/theory.md, section 1): the opaque triangles of every object,
/// whatever its occluder tag, and of the hidden solids. Movers (Object::always_visible) do not
/// block: where they are at rest says nothing about where they will be.
struct Blockers {
  std::vector<TriangleRef> triangles;
  /// Triangles from here on block only what meets their front; Scene::honour_sidedness. Hidden
  /// solids have no drawn side and block from both.
  std::size_t first_one_sided = 0;

  bool one_sided(std::size_t i) const { return i >= first_one_sided; }
};

/// Which objects block.
enum class BlockerChoice {
  kDrawn,      ///< as above: the definition of "seen"
  kOccluding,  ///< those that may be taken as occluders: nodes marked `never` are seen through
};

/// Cost: O(triangles).
Blockers find_blockers(const Scene& scene, BlockerChoice choice = BlockerChoice::kDrawn);

inline const Object& solid_at(const Scene& scene, std::uint32_t solid) {
  const std::size_t n = scene.objects.size();
  return solid < n ? scene.objects[solid] : scene.hidden_solids[solid - n];
}

/// In world space, counter-clockwise seen from the front: a mirroring transform turns the winding.
Triangle front_facing_triangle(const Scene& scene, const TriangleRef& ref);

}  // namespace ivis
