#pragma once
// The value that travels from occluders/ to visibility/: shrunk solids. Light: no builder, no CGAL.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/aabb.h"
#include "core/ids.h"
#include "core/math.h"
#include "core/reach.h"
#include "core/result.h"

namespace ivis {

/// Region of the ground plane in (x, z): closed rings without repeated end point, even-odd filled.
/// The interior is on the left of outer rings when x points right and z *up* the page (positive
/// shoelace area), on the left of holes too (negative area).
struct Polygon {
  std::vector<std::vector<Vec2>> rings;
  bool empty() const { return rings.empty(); }
};

double area(const Polygon& polygon);                   ///< square metres, holes subtracted
bool contains(const Polygon& polygon, const Vec2& p);  ///< even-odd; on the border either answer

/// footprint x [bottom, top].
struct Prism {
  Polygon footprint;
  double bottom = 0;  ///< metres; of a shrunk prism: raised by the vertical reach
  double top = 0;
  /// Of a shrunk prism: the lowest y of the solid it came from (before any raising).
  double solid_bottom = 0;
  /// Drawn, opaque, closed ground covers the footprint at or above `solid_bottom`, and the
  /// footprint lies within OccluderSet::ground: the prism reaches down without end for cells over
  /// that ground.
  bool grounded = false;

  Aabb bounds() const;
};

/// Convex planar polygons: a solid's closed boundary, or the parts of a sheet.
struct FaceMesh {
  std::vector<Vec3> points;
  /// Three or four corners (a triangle repeats its third), counter-clockwise seen from outside the
  /// solid, or from the side the sheet's normal points to. Indices < points.size().
  std::vector<std::array<std::uint32_t, 4>> faces;
  bool empty() const { return faces.empty(); }
};

/// Intersection of half-spaces normal.x <= offset.
struct ConvexSolid {
  struct Plane {
    Vec3 normal{0};
    double offset = 0;
  };
  std::vector<Plane> planes;
  Aabb bounds;
};

/// One part of the solids, small in extent, at every margin of OccluderSet::margins_m. A part that
/// vanishes ends the list early or leaves an empty entry.
struct PrismPiece {
  std::vector<std::vector<Prism>> levels;
};
struct SolidPiece {
  std::vector<FaceMesh> levels;  ///< closed meshes
  /// For cells that lie wholly within all of `floors`, half-spaces: closed meshes that lose nothing
  /// at those planes, since nothing in the scene lies beyond. Both empty, or neither.
  std::vector<ConvexSolid::Plane> floors;
  std::vector<FaceMesh> floored_levels;
};

/// Part of a plane in which nothing but opaque matter lies, shrunk within the plane by every radius
/// of OccluderSet::sheet_radii_m. It hides from its normal's side only; a sheet to be seen from
/// both is listed twice.
struct Sheet {
  Vec3 normal{0};     ///< unit
  double offset = 0;  ///< the plane is { x : normal.x = offset }
  std::vector<FaceMesh> levels;
};

/// Solid under a height that is constant over each cell of a grid; reaches down without end.
struct HeightField {
  Vec2 origin{0};             ///< (x, z) of the corner of cell (0, 0)
  Vec2 step{1};               ///< metres a cell
  std::uint32_t columns = 0;  ///< along x
  std::uint32_t rows = 0;     ///< along z
  /// heights[row * columns + column]; kNone where nothing is known to be solid.
  std::vector<float> heights;
  static constexpr float kNone = -1e9F;
  bool empty() const { return heights.empty(); }
};

/// A plane behind which, on the side normal.x < offset, matter backs triangles of an object. An
/// object is hidden from a cell that lies wholly on that side of all its planes, and so far behind
/// that no sight line to it is too oblique: at least per_level times the greatest level distance
/// from a viewpoint of the cell to a point of the object, and per_height times the greatest
/// difference in height; both ratios count for the whole distance where the plane is not upright
/// (normal.y is not 0). See occluders/backing.h, occluders/wall_backing.h.
struct Backing {
  ObjectId object = 0;
  ConvexSolid::Plane plane;
  double per_level = 0;
  double per_height = 0;
};

/// Backings of one object, at most.
inline constexpr std::size_t kMostPlanesBehind = 6;

/// Where observers may be. Kept for the record: what counted as solid depends on it.
struct ViewSpace {
  enum class Kind : std::uint8_t { kOutside, kInside };
  Kind kind = Kind::kOutside;  ///< outside every solid
  std::vector<Vec3> seeds;     ///< points known to be in it (--inside, --path)
};

/// Occluders of one scene shrunk for one reach.
/// Guarantee: each shrunk prism, extended down where its rule allows, lies inside the erosion
///            E(O, W) of the union O of the scene's opaque solids (and what closed ground covers),
///            where W is the hull of 0 and V' - apex, V' = reach.grown(slack_m + tolerance, ...).
///            So a solution computed from the apex (the highest point of the cell) is right for the
///            whole cell (docs/theory.md, 4).
/// What the occlusion map draws is shrunk further, for its samples (docs/theory.md, 3), and speaks
/// of the cell's centre, not of its apex: every mesh of level k lies inside E(O, V' +
/// B(margins_m[k])). A sheet of level k is the set of points of its plane whose distance in the
/// plane from what is not opaque is at least sheet_radii_m[k] (docs/theory.md, 9). Threads: a
/// value.
struct OccluderSet {
  SceneHash scene_hash = 0;
  Reach reach;             ///< the largest reach a cell may have
  double slack_m = 0.001;  ///< further shrinking that pays for floating-point positions
  ViewSpace view_space;
  std::vector<Prism> shrunk;
  std::vector<Prism> solids;  ///< unshrunk: to know whether an eye is inside one
  /// Rectangle of the ground plane (lo.x..hi.x, lo.z..hi.z; y ignored) that one continuous opaque
  /// height field covers; empty when there is none.
  Aabb ground;
  /// Lowest y of any triangle of an object or hidden solid, worked out as solid_bottom is (so that
  /// a base at the floor compares equal; Object::bounds are grown by rounding). A prism whose
  /// solid_bottom is not above it reaches down without end for cells that lie nowhere below
  /// solid_bottom: no sight line passes under it.
  double floor = 0;

  // For the occlusion map.
  std::vector<double> margins_m;  ///< ascending, the same for all pieces
  std::vector<PrismPiece> prism_pieces;
  std::vector<SolidPiece> solid_pieces;
  std::vector<double> sheet_radii_m;  ///< ascending
  std::vector<Sheet> sheets;
  /// By ascending objects: all planes of each object that has any.
  std::vector<Backing> backings;
  /// For the cull map: terrain, shrunk as `shrunk` is.
  HeightField height_field;
  // Unshrunk, like `solids`: an eye in one of these is inside matter, or where no observer gets to.
  std::vector<ConvexSolid> convex_solids;
  std::vector<Aabb> closed_boxes;
  /// Openings were taken for closed because somebody said so: the guarantee does not hold.
  bool sealed = false;
};

/// Beyond any scene; what is in range stays so in single precision, and so do its products.
inline constexpr double kMaxNumber = 1e9;
inline bool in_range(double v) {
  return std::abs(v) <= kMaxNumber;
}  // NaN is not

/// Can a method compute with the set: is every number in range, and no prism, ground or slack
/// inside out? Asked of every set that comes from outside. Errors: kInvalidArgument, naming the
/// number.
Status check_numbers(const OccluderSet& set);

/// May a cell have this reach? Asked by whoever takes a reach from outside, and by each solve.
bool serves(const OccluderSet& set, const Reach& reach);

/// May the shrunk prism be taken as reaching down without end, for every viewpoint of a cell that
/// spans `cell` (bounding box of eye + reach)? docs/theory.md, section 4, "downward extension".
bool extends_down(const OccluderSet& set, const Prism& prism, const Aabb& cell);

bool contains(const ConvexSolid& solid, const Vec3& p);  ///< on the border either answer

/// Is p inside one of the unshrunk solids? Cost: linear in solids; visibility/ has an index.
bool inside_solid(const OccluderSet& set, const Vec3& p);

}  // namespace ivis
