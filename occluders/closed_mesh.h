#pragma once
// Edge-connected closed pieces of an object's opaque triangles, and their horizontal sections.

#include <array>
#include <cstdint>
#include <vector>

#include "occluders/clip.h"
#include "scenes/scene.h"

namespace ivis {

/// Part of a mesh, connected over shared edges; corners are welded where they agree to the last
/// bit.
struct MeshPiece {
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< corners into WeldedMesh::points
  bool closed = false;    ///< every edge has an even number of triangles
  bool oriented = false;  ///< and they run along it equally often in both directions
};

struct WeldedMesh {
  std::vector<Vec3> points;  ///< world
  std::vector<MeshPiece> pieces;
};

/// Opaque triangles only; those with two corners at one place are dropped, which changes no parity.
WeldedMesh weld(const Scene& scene, const Object& object);

/// Signed volume, positive for outward winding; cubic metres.
double volume(const WeldedMesh& mesh, const MeshPiece& piece);

/// Closed loops in which the plane at height y, which no corner lies on, cuts a closed piece. Of an
/// oriented piece the loops run with the solid on their left (see Polygon). Snapped to the grid.
std::vector<Ring> section(const WeldedMesh& mesh, const MeshPiece& piece, double y);

}  // namespace ivis
