#pragma once
// The drawn, opaque ground of a scene, when it is one continuous height field over a full
// rectangle.

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/aabb.h"
#include "core/context.h"
#include "occluders/occluder_set.h"
#include "occluders/rect_tree.h"
#include "scenes/scene.h"

namespace ivis {

/// Piecewise linear height y(x, z) over a rectangle: every point of it lies under exactly one
/// triangle, or on an edge that two share.
/// Threads:   const members are reentrant. Ownership: keeps nothing of the scene.
class Ground {
 public:
  /// lo.x..hi.x, lo.z..hi.z; y spans the heights. This is OccluderSet::ground.
  const Aabb& rectangle() const { return rectangle_; }
  /// The objects it is made of, as indices into sources(), ascending: they are no solids.
  const std::vector<std::uint32_t>& objects() const { return objects_; }
  std::size_t triangle_count() const { return triangles_.size(); }

  /// Does the footprint (even-odd filled) lie within the rectangle, and the ground nowhere below
  /// `y` over it?
  /// Guarantee: true only when it is so, but for 1e-9 of the largest height involved: a sixtieth
  ///            of the step of a float32 of that size, in which scene files hold heights.
  /// Cost:      logarithmic, and linear in the triangles near the footprint; mostly their lowest
  ///            corner decides.
  bool covers_at_or_above(const Polygon& footprint, double y) const;

  /// Height over (x, z), to within rounding; minus infinity outside the rectangle.
  double height_at(double x, double z) const;

 private:
  friend std::optional<Ground> find_ground(const Scene&, const Context&);
  Ground(std::vector<Vec3> corners, std::vector<std::array<std::uint32_t, 3>> triangles,
         std::vector<std::uint32_t> objects);

  Aabb rectangle_;
  std::vector<std::uint32_t> objects_;
  std::vector<Vec3> corners_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  RectTree tree_;  // over triangles_, by their projections
};

/// Finds the ground: of the drawn, opaque, not always-visible objects without steep triangles, the
/// edge-connected piece that is a continuous height field over a full rectangle, covers most of the
/// scene and has next to nothing under it. Tiles join where their corners agree to the last bit.
/// Errors:    nullopt when there is none, with lines to context.log that say why; safe, only
/// dearer. Modelling: viewpoints under the ground do not count, so a ceiling or a canopy must not
/// be taken
///            for ground: it has to cover nine tenths of the scene's rectangle, and at most one
///            object in a hundred may lie wholly below it.
/// Threads:   reentrant. Cost: O(t log t) in candidate triangles.
std::optional<Ground> find_ground(const Scene& scene, const Context& context = {});

}  // namespace ivis
