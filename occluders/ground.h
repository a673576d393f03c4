#pragma once
// The drawn, opaque ground of a scene, when it is one continuous height field over a full rectangle.

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/aabb.h"
#include "core/context.h"
#include "occluders/occluder_set.h"
#include "scenes/scene.h"

namespace ivis {

/// Piecewise linear height y(x, z) over a rectangle: every point of it lies under exactly one triangle, or
/// on an edge that two share.
/// Threads:   const members are reentrant. Ownership: keeps nothing of the scene.
class Ground {
 public:
  /// lo.x..hi.x, lo.z..hi.z; y spans the heights. This is OccluderSet::ground.
  const Aabb& rectangle() const { return rectangle_; }
  /// The objects it is made of, ascending: they are no solids.
  const std::vector<ObjectId>& objects() const { return objects_; }
  std::size_t triangle_count() const { return triangles_.size(); }

  /// Does the footprint lie within the rectangle, and the ground nowhere below `y` over it?
  /// Guarantee: true only when it is so, to within 1e-9 of the ground's own relief. Footprints fill even-odd.
  /// Cost:      triangles near the footprint; mostly their lowest corners decide.
  bool covers_at_or_above(const Polygon& footprint, double y) const;

  /// Height over (x, z); minus infinity outside the rectangle. To within rounding.
  double height_at(double x, double z) const;

 private:
  friend class GroundBuilder;
  void index();
  std::span<const std::uint32_t> cell(std::size_t ix, std::size_t iz) const;
  std::array<std::size_t, 2> cell_of(double x, double z) const;

  Aabb rectangle_;
  std::vector<ObjectId> objects_;
  std::vector<Vec3> corners_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  // Uniform grid: triangles whose projected box touches a cell, as one list cut by offsets.
  std::array<std::size_t, 2> cells_{0, 0};
  std::vector<std::uint32_t> cell_start_;
  std::vector<std::uint32_t> cell_triangles_;
};

/// Finds the ground: of the drawn, opaque, not always-visible objects that have no steep triangle, the
/// edge-connected piece that is a continuous height field over a full rectangle, covers most of the
/// scene and has next to nothing under it. Tiles join where their corners agree to the last bit.
/// nullopt when there is none, with a line to context.log that says why; that is safe, only dearer.
/// Modelling: viewpoints under the ground do not count. So a ceiling or a canopy must not be taken for
///            ground: nine tenths of the scene's rectangle have to be covered, and at most one object in
///            a hundred may lie wholly below.
/// Threads:   reentrant. Cost: O(t log t) in candidate triangles.
std::optional<Ground> find_ground(const Scene& scene, const Context& context = {});

}  // namespace ivis
