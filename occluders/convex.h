#pragma once
// Convex closed pieces of meshes -> intersections of half-spaces, whole and shrunk.

#include <array>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/reach.h"
#include "occluders/occluder_set.h"
#include "scenes/scene.h"

namespace ivis {

/// Corners of an object marked `only` count as one where they are this near to each other, metres:
/// such a node is matter by its author's word, not by its triangles, and editors cut the faces of a
/// solid one by one. Drawn meshes have to be closed to the last bit instead.
inline constexpr double kSeamM = 0.002;

struct ConvexPiece {
  ConvexSolid solid;
  /// The prism builder takes it as it is: closed to the last bit, walls upright, ends level.
  bool upright_prism = false;
  /// Of an object marked `only`.
  bool only = false;
};

struct ObjectConvex {
  std::vector<ConvexPiece> pieces;
  std::map<std::string, std::size_t> left_out;  ///< reason -> pieces
};

/// The convex closed pieces of one object. Winding is not trusted (docs/theory.md, 1): parity
/// decides what is inside. Where the scene honours sidedness and the object has single-sided
/// triangles, only pieces that are wound outwards throughout are taken, as by extract_prisms().
/// Guarantee: a segment from outside a solid to a point in it meets an opaque triangle of the
///            object. For an object marked `only` the solid is what its faces bound, seams of up
///            to kSeamM between them closed.
/// Errors:    none; what cannot be used is counted. Threads: reentrant.
/// Cost:      faces x corners of a piece.
ObjectConvex extract_convex(const Scene& scene, const Object& object);

/// One closed surface as half-spaces, if it is convex; else nothing. `points` may hold more than
/// the triangles use. `seam_m` 0: the edges pair up to the last bit, and the solid lies inside the
/// surface; otherwise as kSeamM says. The bounds hold the solid.
std::optional<ConvexSolid> recognise_convex(
    const std::vector<Vec3>& points, const std::vector<std::array<std::uint32_t, 3>>& triangles,
    double seam_m = 0);

/// The solid's faces as rings, counter-clockwise seen from outside, one for each of its planes; a
/// plane that carries no face has an empty ring. All empty when nothing is left, or when the
/// planes do not bound anything within the solid's bounds. Every corner satisfies every plane.
std::vector<std::vector<Vec3>> face_rings(const ConvexSolid& solid);

/// The same as a closed mesh of triangles and quadrangles.
FaceMesh face_mesh(const ConvexSolid& solid);

/// {x : x + V + B(margin) in solid}, exactly; bounds are those of the solid.
/// Source: docs/erosion.md: planes move inwards by the support function.
ConvexSolid shrunk(const ConvexSolid& solid, const Reach& reach, double margin_m);

/// Finds out whether a plane bounds a whole scene: nothing that is drawn or blocks lies beyond it.
/// Threads: const and reentrant. Ownership: borrows the scene.
class SceneSupport {
 public:
  explicit SceneSupport(const Scene& scene);
  /// Is every corner of every triangle in { x : normal.x <= offset }? Movers do not count: they are
  /// listed whatever hides them. Cost: usually a few hundred products; those of all corners once a
  /// normal that few samples lie beyond.
  bool within(const Vec3& normal, double offset) const;

 private:
  const Scene& scene_;
  std::vector<Vec3> samples_;
  mutable std::mutex mutex_;
  mutable std::map<std::array<double, 3>, double> support_;
};

/// The plane of the most solids, at least two, beyond which the scene has nothing: the ground they
/// stand on, however the scene is turned.
std::optional<ConvexSolid::Plane> common_floor(const std::vector<ConvexSolid>& solids,
                                               const SceneSupport& scene);

/// The solid at every margin, each level in E(solid, reach + B(margin)); ends where it vanishes.
/// If `floor` is one of its planes, floored_levels leave that plane where it is: no sight line
/// from before it to anything listed gets past it, so the solid might as well go on beyond, and
/// then loses nothing there (as docs/theory.md, 4, downward extension, but for any direction).
SolidPiece shrink_convex(const ConvexSolid& solid, const Reach& reach,
                         const std::vector<double>& margins_m, const SceneSupport* scene = nullptr,
                         const std::optional<ConvexSolid::Plane>& floor = {});

}  // namespace ivis
