#pragma once
// Building meshes -> prisms that lie inside them.

#include <map>
#include <string>
#include <vector>

#include "occluders/occluder_set.h"
#include "scenes/scene.h"

namespace ivis {

/// What one object's mesh holds as a solid.
struct ObjectSolids {
  /// Inside the mesh's closed pieces; of one piece: nested, ascending tops, shrinking footprints.
  /// `bottom` = `solid_bottom`.
  std::vector<Prism> prisms;
  double volume = 0;  ///< cubic metres, of the closed, outward pieces' meshes
  /// Why pieces (edge-connected parts of the mesh) were left out -> how many.
  std::map<std::string, std::size_t> left_out;
};

/// At most this many nested prisms for a piece: eaves, and what fits under the roof.
inline constexpr std::size_t kMaxLevelsPerPiece = 3;

/// Guarantee: a segment from outside a prism to a point in it meets an opaque triangle of the
/// object (a
///            front side where the scene honours sidedness), up to twice kGridM at footprints'
///            edges.
/// Errors:    none; what cannot be used is counted. Threads: reentrant.
/// Cost:      a few sections and differences of the mesh's outline; 0.1-1 ms for a building.
/// Source:    the building prisms of Wonka, Wimmer, Sillion 2001; parity is used instead of
/// winding.
ObjectSolids extract_prisms(const Scene& scene, const Object& object);

/// Cubic metres that the prisms fill.
double volume_taken(const ObjectSolids& found);

}  // namespace ivis
